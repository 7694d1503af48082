//! One fit of channels that share their shapes, from samples to intervals.

use super::budget::Subset;
use super::covariance::{self, Uncertainty};
use super::intervals::{self, Intervals};
use super::limits::Ranges;
use super::options::{FitError, FitOptions};
use super::passes::{self, Saturation, Scratch};
use super::reduced::{Problem, Search, Solution, Streamed, polish};
use super::samples::{self, Samples, Transforms};
use super::solver::{self, Iteration, LevenbergMarquardt, Stop};
use super::start::{self, SearchReport};
use super::structure::{self, Structure};
use crate::brdf::{ModelSpec, Parameter};

/// What one fit found; weights and costs in the samples' scale.
#[derive(Debug)]
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
    pub intervals: Intervals,
    pub saturation: Saturation,
    pub structure: Option<Structure>,
    pub stop: Stop,
    pub history: Vec<Iteration>,
    pub report: SearchReport,
    /// How much of the samples it is about, where not all.
    pub subset: Option<Subset>,
    /// Standard deviation of every parameter over redrawn data, in the uncertainty's order and scale.
    pub bootstrap: Option<Vec<f64>>,
}

/// Reduced cost below this share of the data's energy, or a Gram matrix of a larger condition number: sums of products have lost digits.
const LOST_COST: f64 = 1e-6;
const LOST_CONDITION: f64 = 1e8;

/// Fits the samples.
pub(super) fn fit(
    samples: &Samples<'_>,
    transforms: Option<Transforms>,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
) -> Result<Part, FitError> {
    let problem = Problem::new(samples, model, ranges, options.conserve_energy);
    problem.check(&samples.measurement.channels)?;
    if options.robust.is_none() && problem.is_transformable() {
        let (transform, energy) = transforms.unwrap_or_else(|| passes::transform(samples));
        let search = Search::new(&problem, &transform, &energy);
        return by_search(&search, options);
    }
    by_passes(&problem, options)
}

/// A loss that is linear in the weights, without outliers: everything from the transforms, last digits from true residuals.
pub(super) fn by_search(search: &Search<'_>, options: &FitOptions) -> Result<Part, FitError> {
    let found = start::search(search, options.max_iterations)?;
    let mut solution = search.solve(found.outcome.t.as_slice());
    let energy: f64 = search.energy.iter().sum();
    if solution.cost < LOST_COST * energy || condition(search, &solution) > LOST_CONDITION {
        solution = polish(search, solution);
    }
    let moments = search.moments(&solution.lobes, true);
    let uncertainty = covariance::uncertainty(search.problem, &solution, Some(&moments));
    solution.cost = uncertainty.cost;
    let intervals = intervals::profiled(search, &solution, &uncertainty);
    finish(search.problem, solution, uncertainty, intervals, found)
}

/// Largest condition number of the weights' Gram matrices, columns scaled to 1.
fn condition(search: &Search<'_>, at: &Solution) -> f64 {
    let moments = search.moments(&at.lobes, false);
    let of = |gram: &nalgebra::DMatrix<f64>| {
        let scale = gram.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
        let n = scale.len();
        let scaled = nalgebra::DMatrix::from_fn(n, n, |i, j| gram[(i, j)] * scale[i] * scale[j]);
        let eigen = scaled.symmetric_eigenvalues();
        if eigen.min() > 0.0 { eigen.max() / eigen.min() } else { f64::INFINITY }
    };
    moments.gram.iter().map(of).fold(1.0, f64::max)
}

/// Samples that the search for a start looks at.
const START_SAMPLES: usize = 6000;
/// Rounds in which the robust scale settles, and the relative change at which it has.
const SCALE_ROUNDS: usize = 40;
const SCALE_SETTLED: f64 = 1e-9;

/// Any other loss: passes over the samples, the start from a part of them.
fn by_passes(problem: &Problem<'_>, options: &FitOptions) -> Result<Part, FitError> {
    let samples = problem.samples;
    let step = samples.len().div_ceil(START_SAMPLES).max(1);
    let few = samples.listed(|i| i % step == samples::offset(i / step, step));
    let mut rough = problem.on(&few);
    let mut found = start::search_streamed(&rough, options.max_iterations)?;
    let mut solution = Streamed::new(&rough).solve(found.outcome.t.as_slice());
    if options.robust.is_some() {
        // The scale of the plain fit's residuals is too large where outliers pull it; it shrinks as they let go.
        for _ in 0..3 {
            rough.saturation = passes::saturation(options.robust, spread(&rough, &solution));
            found = start::search_streamed(&rough, options.max_iterations)?;
            solution = Streamed::new(&rough).solve(found.outcome.t.as_slice());
        }
    }
    let all = samples.listed(|_| true);
    let mut problem = problem.on(&all);
    let mut history = Vec::new();
    let mut stop = found.outcome.stop;
    for _ in 0..SCALE_ROUNDS {
        let before = problem.saturation;
        problem.saturation = passes::saturation(options.robust, spread(&problem, &solution));
        if let (Some((_, old)), Some((_, new))) = (before, problem.saturation)
            && (new / old - 1.0).abs() <= SCALE_SETTLED
        {
            problem.saturation = before;
            break;
        }
        let streamed = Streamed::from(&problem, solution.clone());
        let lm = LevenbergMarquardt::bounded(problem.bounds.clone());
        let start = nalgebra::DVector::from_column_slice(&solution.t);
        let outcome = solver::minimize(&streamed, lm, start, options.max_iterations)
            .map_err(|e| FitError::Solver { reason: e.to_string() })?;
        solution = streamed.solve(outcome.t.as_slice());
        stop = outcome.stop;
        history.extend(outcome.history);
        if options.robust.is_none() {
            break;
        }
    }
    found.outcome.stop = stop;
    found.outcome.history = history;
    let uncertainty = covariance::uncertainty(&problem, &solution, None);
    solution.cost = uncertainty.cost;
    let intervals = intervals::plain(&problem, &solution, &uncertainty);
    finish(&problem, solution, uncertainty, intervals, found)
}

/// σ of the residuals by their median absolute deviation from their median; where that is 0 (more than half of them are alike), the smallest
/// that still is a scale.
fn spread(problem: &Problem<'_>, at: &Solution) -> f64 {
    let samples = problem.samples;
    let pieces = samples.map_pieces(|| (Vec::new(), Scratch::default()), |(list, scratch), block| {
        scratch.basis(block, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            scratch.residuals(samples, block, c, x, None);
            list.extend(scratch.r.iter().zip(block.weight(c)).filter(|(_, w)| **w > 0.0).map(|(r, _)| *r));
        }
    });
    let mut r: Vec<f64> = pieces.into_iter().flat_map(|(list, _)| list).collect();
    let centre = median(&mut r);
    r.iter_mut().for_each(|r| *r = (*r - centre).abs());
    let deviation = median(&mut r);
    let largest = r.iter().copied().fold(0.0, f64::max);
    (MAD_TO_SIGMA * deviation).max(1e-13 * largest).max(f64::MIN_POSITIVE.sqrt())
}

/// σ of normal noise over its median absolute deviation.
const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

fn median(list: &mut [f64]) -> f64 {
    if list.is_empty() {
        return 0.0;
    }
    let middle = list.len() / 2;
    let odd = list.len() % 2 == 1;
    let (below, upper, _) = list.select_nth_unstable_by(middle, f64::total_cmp);
    if odd { *upper } else { 0.5 * (*upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max)) }
}

fn finish(
    problem: &Problem<'_>,
    solution: Solution,
    uncertainty: Uncertainty,
    intervals: Intervals,
    found: start::Found,
) -> Result<Part, FitError> {
    if !solution.cost.is_finite() {
        return Err(FitError::Solver { reason: "the cost is not finite".into() });
    }
    let samples = problem.samples;
    let residuals = samples.residuals();
    let rmse = (solution.cost / residuals.max(1) as f64).sqrt();
    let (sum, known) = uncertainty.stated;
    let stated = (known == residuals && known > 0).then(|| (sum / residuals as f64).sqrt());
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
        structure: structure::structure(
            rmse,
            stated,
            &uncertainty.neighbours,
            residuals as f64 / uncertainty.design_effect,
        ),
        saturation: problem.saturation,
        stop: found.outcome.stop,
        history: found.outcome.history,
        report: found.report,
        solution,
        uncertainty,
        intervals,
        subset: None,
        bootstrap: None,
    })
}
