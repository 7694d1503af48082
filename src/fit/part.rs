//! One fit of channels that share their shapes, from samples to intervals.

use nalgebra::DVector;

use super::bootstrap::Redrawn;
use super::budget::{Deadline, Subset};
use super::covariance::{self, Uncertainty};
use super::identify;
use super::intervals::{self, Intervals, Profiled};
use super::joint::{self, Digits};
use super::limits::Ranges;
use super::options::{FitError, FitOptions};
use super::passes::{self, Saturation};
use super::quadratic;
use super::reduced::{Problem, Search, Solution, polish};
use super::robust;
use super::samples::{self, Samples, Transforms};
use super::solver::{self, Iteration, LevenbergMarquardt, SolverOptions, Stop};
use super::start::{self, SearchReport};
use super::streamed::Streamed;
use super::structure::{self, Structure};
use crate::brdf::{ModelSpec, Parameter};

/// What one fit found; weights and costs in the samples' scale.
#[derive(Debug, Clone)]
pub(super) struct Part {
    /// The measurement's channels that were fitted.
    pub channels: Vec<usize>,
    pub scale: f64,
    pub samples: usize,
    /// Samples of each channel.
    pub counts: Vec<usize>,
    pub weighting: &'static str,
    /// Values that the loss could not take.
    pub refused: usize,
    pub epsilon: Vec<f64>,
    pub layout: Vec<(usize, Parameter)>,
    pub bounds: Vec<(f64, f64)>,
    pub solution: Solution,
    pub uncertainty: Uncertainty,
    /// Whether each shape ended at an end of its range, so that it has no standard error.
    pub at_end: Vec<bool>,
    pub intervals: Intervals,
    pub saturation: Saturation,
    /// ln(robust scale that the residuals ask for / scale used), where the two have not met.
    pub unsettled: Option<f64>,
    pub structure: Option<Structure>,
    /// Whether noise could not be told from model error although there are residuals.
    pub unjudged: bool,
    /// Whether the energy limit decides a channel's weights, channel by channel.
    pub capped: Vec<bool>,
    pub stop: Stop,
    pub history: Vec<Iteration>,
    pub report: SearchReport,
    /// How much of the samples it is about, where not all.
    pub subset: Option<Subset>,
    /// What redrawn data say, where they were asked.
    pub bootstrap: Option<Redrawn>,
    /// Whether the time left out profiles of which intervals would have been read.
    pub lacks_profiles: bool,
}

impl Part {
    /// Whether the time left something out.
    pub fn is_cut(&self) -> bool {
        self.report.cut || self.report.unsettled || self.lacks_profiles
    }

    /// What stands for channels without a valid sample, each fitted alone: no weight that is not demanded, nothing determined that is not
    /// held, and shapes and scales as in this fit of another channel.
    pub fn dark(&self, channels: &[usize], ranges: &Ranges) -> Self {
        let mut dark = self.clone();
        dark.channels = channels.to_vec();
        (dark.samples, dark.counts, dark.refused) = (0, vec![0; channels.len()], 0);
        dark.solution.cost = 0.0;
        dark.uncertainty.errors.fill(None);
        (dark.uncertainty.outliers, dark.uncertainty.by_others, dark.unsettled) = Default::default();
        dark.uncertainty.structured.fill(0.0);
        dark.intervals.fill(None);
        for (own, &channel) in channels.iter().enumerate() {
            for (l, &(low, high)) in ranges.weights[channel].iter().enumerate() {
                let (weight, place) = (low / self.scale, own * self.solution.lobes.len() + l);
                dark.solution.weights[own][l] = weight;
                dark.uncertainty.errors[place] = (low == high).then_some(0.0);
                dark.intervals[place] = (low == high).then_some((weight, weight));
            }
        }
        dark.at_end.fill(false);
        dark.capped.fill(false);
        (dark.structure, dark.unjudged, dark.uncertainty.offset) = (None, false, None);
        (dark.history, dark.report) = (Vec::new(), SearchReport::default());
        (dark.subset, dark.bootstrap) = (None, None);
        dark
    }
}

/// Reduced cost below this share of the data's energy, or a Gram matrix of a larger condition number: sums of products have lost digits.
const LOST_COST: f64 = 1e-6;
const LOST_CONDITION: f64 = 1e8;

/// Values of a table whose last digits are worth many passes.
pub(super) const SMALL: usize = 200_000;

/// An rmse below this, in the fit's scale, is rounding: nothing can be said of its structure.
pub(super) const ROUNDING: f64 = 1e-13;

/// Fits the samples; what only makes the answer surer is not begun after `deadline`.
pub(super) fn fit(
    samples: &Samples<'_>,
    transforms: Option<Transforms>,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
    deadline: Deadline,
) -> Result<Part, FitError> {
    let problem = Problem::new(samples, model, ranges, options.conserve_energy);
    problem.check(&samples.measurement.channels)?;
    if options.robust.is_none() && problem.is_transformable() {
        let (transform, energy) = transforms.unwrap_or_else(|| passes::transform(samples));
        let search = Search::new(&problem, &transform, &energy);
        return by_search(&search, options);
    }
    by_passes(&problem, options, deadline)
}

/// The same model on other samples, from shapes known to be near, as `like` has them: its solution alone.
pub(super) fn refit(
    samples: &Samples<'_>,
    like: &Part,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
) -> Result<Solution, FitError> {
    let mut problem = Problem::new(samples, model, ranges, options.conserve_energy);
    problem.saturation = like.saturation;
    if problem.is_transformable() {
        let (transform, energy) = passes::transform(samples);
        let search = Search::new(&problem, &transform, &energy);
        let start = DVector::from_column_slice(&like.solution.t);
        let lm = LevenbergMarquardt::bounded(problem.bounds.clone());
        let found = solver::minimize(search.walk(), lm, start, options.max_iterations).map_err(failed)?;
        return Ok(search.solve(found.parameters.as_slice()));
    }
    Ok(descend_shapes(&problem, &like.solution, options.max_iterations, Digits::All)?.0)
}

/// A loss that is linear in the weights, without outliers: everything from the transforms, last digits from true residuals.
fn by_search(search: &Search<'_>, options: &FitOptions) -> Result<Part, FitError> {
    let found = start::search(search, options.max_iterations, Deadline::NEVER)?;
    let mut solution = search.solve(found.outcome.parameters.as_slice());
    let energy: f64 = search.energy.iter().sum();
    if solution.cost < LOST_COST * energy || condition(search, &solution) > LOST_CONDITION {
        solution = last_digits(search, solution, options)?;
    }
    let moments = search.moments(&solution.lobes, true);
    let mut uncertainty = covariance::uncertainty(search.problem, &solution, Some(&moments), None);
    identify::by_search(search, &solution, &mut uncertainty);
    solution.cost = uncertainty.cost;
    let by_profile = || intervals::by_search(search, &solution, &uncertainty);
    let intervals =
        if options.profiles { by_profile() } else { intervals::plain(search.problem, &solution, &uncertainty) };
    finish(search.problem, solution, uncertainty, intervals, found)
}

/// What sums of products have lost, won back on true residuals.
fn last_digits(search: &Search<'_>, found: Solution, options: &FitOptions) -> Result<Solution, FitError> {
    let problem = search.problem;
    let mut best = polish(search, found);
    if problem.samples.residuals() > SMALL {
        return Ok(best);
    }
    if let [(low, high)] = problem.bounds[..] {
        // A sharp lobe's tail may be too small for the sums: what it says of the exponent only true residuals see.
        for t in start::octaves(low, high) {
            let mut held = problem.on(problem.samples);
            held.bounds = vec![(t, t)];
            let tried = polish(&search.of(&held), search.of(&held).solve(&[t]));
            if tried.cost < 0.5 * best.cost {
                best = tried;
            }
        }
    }
    let (polished, _) = descend(problem, &best, options.max_iterations, Digits::All)?;
    // Where rounding is all that is left the cost no longer tells; the descent ends at the shortest step.
    Ok(if polished.cost <= 4.0 * best.cost { polished } else { best })
}

/// Largest condition number of the weights' Gram matrices, columns scaled to 1.
fn condition(search: &Search<'_>, at: &Solution) -> f64 {
    let moments = search.moments(&at.lobes, false);
    let of = |gram: &nalgebra::DMatrix<f64>| {
        let eigen = quadratic::unit_columns(gram).0.symmetric_eigenvalues();
        if eigen.min() > 0.0 { eigen.max() / eigen.min() } else { f64::INFINITY }
    };
    moments.gram.iter().map(of).fold(1.0, f64::max)
}

/// Samples that the search for a start looks at, and those that its first round does.
const START_SAMPLES: usize = 6000;
const FIRST_SAMPLES: usize = 600;

/// Any other loss: passes over the samples, the start from a part of them.
fn by_passes(problem: &Problem<'_>, options: &FitOptions, deadline: Deadline) -> Result<Part, FitError> {
    let samples = problem.samples;
    let thinned = |count: usize| {
        let step = samples.len().div_ceil(count).max(1);
        samples.listed(|i| i % step == samples::offset(i / step, step))
    };
    let (few, more) = (thinned(FIRST_SAMPLES), thinned(START_SAMPLES));
    let (few, more, mut problem) = (problem.on(&few), problem.on(&more), problem.on(samples));
    let mut found = start::search_plain(&problem, (&few, &more), options.max_iterations, deadline)?;
    let mut solution = Streamed::new(&problem).solve(found.outcome.parameters.as_slice());
    let mut met = true;
    if let Some(robust) = options.robust {
        let plain_cut = found.report.cut;
        (solution, met, found.report) =
            robust::settle(&mut problem, (&few, &more), &solution, (robust, options), deadline)?;
        found.report.cut |= plain_cut;
    }
    let mut judged = judge(&problem, &more, &start::ordered(&problem, solution), options, deadline)?;
    for _ in 0..VALLEYS {
        let Some(lower) = judged.lower.clone() else { break };
        if deadline.is_past() {
            found.report.cut = true;
            break;
        }
        let near = (&judged.solution, met);
        let Some(moved) = robust::resettle(&problem, near, lower, options, deadline) else { break };
        (problem.saturation, met) = (moved.saturation, moved.met);
        found.report.unsettled = !met && deadline.is_past();
        judged = judge(&problem, &more, &start::ordered(&problem, moved.at), options, deadline)?;
    }
    if judged.lower.is_some() {
        // It stays here all the same: the profiles that were cut short there are followed.
        let all = intervals::by_passes(&problem, &judged.solution, &judged.uncertainty, false, deadline);
        (judged.intervals, judged.lacks_profiles) = (all.intervals, all.is_cut);
    }
    let unsettled = if met { None } else { robust::left(&problem, &judged.solution, options) };
    found.outcome = judged.outcome;
    let lacks_profiles = judged.lacks_profiles;
    let part = finish(&problem, judged.solution, judged.uncertainty, judged.intervals, found)?;
    Ok(Part { unsettled, lacks_profiles, ..part })
}

/// Valleys that a fit moves on to at most, each lower than the last, when the profile of a parameter meets them.
const VALLEYS: usize = 4;

/// A minimum, and how sure it is.
struct Judged {
    solution: Solution,
    outcome: solver::Outcome,
    uncertainty: Uncertainty,
    intervals: Intervals,
    /// A point of another valley that is lower.
    lower: Option<Solution>,
    /// Whether the time left out profiles that intervals are read off.
    lacks_profiles: bool,
}

/// The minimum next to a solution and what there is to say of it; `more` is the same problem on a part of the samples.
fn judge(
    problem: &Problem<'_>,
    more: &Problem<'_>,
    start: &Solution,
    options: &FitOptions,
    deadline: Deadline,
) -> Result<Judged, FitError> {
    let (solution, outcome) = descend(problem, start, options.max_iterations, Digits::All)?;
    let mut uncertainty = covariance::uncertainty(problem, &solution, None, options.robust);
    let mut part = problem.on(more.samples);
    part.saturation = problem.saturation;
    identify::by_passes(&part, &solution, &mut uncertainty);
    let solution = Solution { cost: uncertainty.cost, ..solution };
    let found = if options.profiles {
        intervals::by_passes(problem, &solution, &uncertainty, true, deadline)
    } else {
        Profiled::plain(problem, &solution, &uncertainty)
    };
    let Profiled { intervals, lower, is_cut: lacks_profiles } = found;
    Ok(Judged { solution, outcome, uncertainty, intervals, lower, lacks_profiles })
}

/// The minimum next to a solution, on all samples, to its last digits or roughly.
pub(super) fn descend(
    problem: &Problem<'_>,
    start: &Solution,
    steps: u64,
    digits: Digits,
) -> Result<(Solution, solver::Outcome), FitError> {
    if let Some(found) = joint::polish(problem, start, steps, digits) {
        let (solution, mut outcome) = found.map_err(failed)?;
        // The history is of the shapes.
        let weights = outcome.parameters.len() - problem.layout.len();
        outcome.history.iter_mut().for_each(|step| drop(step.parameters.drain(..weights)));
        return Ok((solution, outcome));
    }
    descend_shapes(problem, start, steps, digits)
}

/// The minimum next to a solution by the shapes alone, the weights following.
fn descend_shapes(
    problem: &Problem<'_>,
    start: &Solution,
    steps: u64,
    digits: Digits,
) -> Result<(Solution, solver::Outcome), FitError> {
    let streamed = Streamed::new(problem).starting_at(start);
    let options = match digits {
        Digits::Cost(ftol) => SolverOptions { ftol, polish: 0, ..SolverOptions::default() },
        Digits::Rough | Digits::All => SolverOptions::default(),
    };
    let lm = LevenbergMarquardt::new(options).with_bounds(problem.bounds.clone());
    let outcome = solver::minimize(&streamed, lm, DVector::from_column_slice(&start.t), steps).map_err(failed)?;
    Ok((streamed.solve(outcome.parameters.as_slice()), outcome))
}

#[allow(clippy::needless_pass_by_value)] // as map_err hands it over
fn failed(error: argmin::core::Error) -> FitError {
    FitError::Solver { reason: error.to_string() }
}

fn finish(
    problem: &Problem<'_>,
    solution: Solution,
    mut uncertainty: Uncertainty,
    mut intervals: Intervals,
    found: start::Found,
) -> Result<Part, FitError> {
    if !solution.cost.is_finite() {
        return Err(FitError::Solver { reason: "the cost is not finite".into() });
    }
    let samples = problem.samples;
    let residuals = samples.residuals();
    let rmse = (solution.cost / residuals.max(1) as f64).sqrt();
    let structure = told_structure(problem, &uncertainty, rmse);
    let capped = solution.weights.iter().enumerate().map(|(c, x)| problem.is_capped(c, x)).collect();
    let at_end = without_ends(problem, &solution, &mut uncertainty, &mut intervals);
    Ok(Part {
        channels: samples.channels.clone(),
        scale: samples.scale,
        samples: samples.len(),
        counts: samples.counts.clone(),
        weighting: samples.weighting,
        refused: samples.refused,
        epsilon: samples.epsilon.clone(),
        layout: problem.layout.clone(),
        bounds: problem.bounds.clone(),
        unjudged: rmse > ROUNDING && structure.is_none() && residuals > uncertainty.errors.len(),
        structure,
        capped,
        saturation: problem.saturation,
        unsettled: None,
        stop: found.outcome.stop,
        history: found.outcome.history,
        report: found.report,
        solution,
        uncertainty,
        at_end,
        intervals,
        subset: None,
        bootstrap: None,
        lacks_profiles: false,
    })
}

/// What the residuals say of noise and of the model's error.
fn told_structure(problem: &Problem<'_>, uncertainty: &Uncertainty, rmse: f64) -> Option<Structure> {
    let residuals = problem.samples.residuals();
    let (sum, known) = uncertainty.stated;
    // Of outliers a stated σ says nothing: a robust fit's noise is told by neighbours.
    let says = known == residuals && known > 0 && problem.saturation.is_none();
    // Shared errors may show in residuals or be taken up by the fit: as much of them counts as noise as there is.
    let [own, most] = [sum, sum + uncertainty.common_noise].map(|sum| (sum / residuals as f64).sqrt());
    let stated = says.then(|| rmse.clamp(own, most));
    let independent = residuals as f64 / uncertainty.design_effect;
    let structure = structure::structure(rmse, stated, &uncertainty.neighbours, residuals, independent);
    structure.filter(|_| rmse > ROUNDING)
}

/// Takes errors and intervals from shapes that have none: those at an end of their range, which are returned, and those whose interval is all that is searched.
fn without_ends(
    problem: &Problem<'_>,
    solution: &Solution,
    uncertainty: &mut Uncertainty,
    intervals: &mut Intervals,
) -> Vec<bool> {
    let weights = solution.weights.len() * problem.kinds.len();
    let at_end: Vec<bool> =
        (weights..uncertainty.errors.len()).map(|i| intervals::is_at_end(problem, solution, uncertainty, i)).collect();
    for (i, (low, high)) in problem.bounds.iter().enumerate().filter(|(_, (low, high))| low < high) {
        // An interval over all that is searched is no answer.
        if intervals[weights + i].is_some_and(|(a, b)| a <= *low && b >= *high) {
            (uncertainty.errors[weights + i], intervals[weights + i]) = (None, None);
        }
    }
    let errors = uncertainty.errors[weights..].iter_mut();
    errors.zip(&at_end).filter(|(_, ends)| **ends).for_each(|(error, _)| *error = None);
    at_end
}
