//! Which model? Candidates compared by the error on directions that they were not fitted to.

use std::fmt::Write;
use std::time::{Duration, Instant};

use super::budget::Deadline;
use super::limits::{Limit, Ranges};
use super::loss::{Robust, RobustKind};
use super::options::{FitError, FitOptions};
use super::part;
use super::passes::{self, Saturation, Want};
use super::reduced::Solution;
use super::robust::{JUDGE_SCALE, bounded_cost, sizes};
use super::samples::{Samples, Thin};
use super::timed;
use super::{Fitted, fit_since};
use crate::brdf::{ModelCandidate, ModelChoice, ModelSpec};
use crate::geometry::theta_of;
use crate::measurement::{Directions, Measurement, MerlGrid};

/// The models that are compared, simplest first.
const CANDIDATES: [&str; 6] =
    ["lambert", "phong", "lambert+phong", "phong+phong", "lambert+phong+phong", "lambert+phong+phong+phong"];
/// Parts that the directions are cut into; each is held out once.
const FOLDS: usize = 5;
/// Side of the cells in (θi, θo) that are held out whole, degrees: neighbours of a sample don't tell what its value is.
const CELL_DEG: f64 = 10.0;
/// Entries that the comparison looks at, at most.
const SAMPLES: usize = 40_000;
/// Runs of neighbours that the entries of a grid come in, or more.
const RUNS: usize = 200;
/// Share of a time budget that the comparison may take.
const COMPARISON: f64 = 0.5;
/// Entries of the first round where time is short, and by how much the next ones have more.
const FIRST: usize = 2500;
const GROWTH: usize = 4;
/// The candidates in the order in which a first round takes them: the usual model, then the quick ones.
const IN_HASTE: [usize; 6] = [2, 0, 1, 3, 4, 5];
/// A glossy lobe more makes a model take about so many times as long.
const STEEP: f64 = 6.0;
/// An rmse below this share of the data's rms is rounding: of two such models neither is the better one.
const ROUNDING: f64 = 1e-13;
/// A held-out error within this share of the best is as good.
const AS_GOOD: f64 = 0.01;

/// Compares all models and fits the simplest one whose held-out error is as good as the best's. `options.model` is not looked at. A limit
/// concerns the models that have its parameter. The comparison takes half of the time budget at most, with fewer samples or models if need
/// be, and the fit has what is left.
///
/// # Errors
/// As [`super::fit`]; a limit that concerns no model.
pub fn fit_best_model(measurement: &Measurement, options: &FitOptions) -> Result<Fitted, FitError> {
    let clock = Instant::now();
    options.validate(measurement)?;
    let models = models(measurement, options)?;
    for limit in &options.limits {
        let last = models.last().filter(|_| !models.iter().any(|m| concerns(limit, m, measurement)));
        last.map_or(Ok(()), |richest| ranges_of(limit, richest, measurement).map(|_| ()))?;
    }
    let options = &timed::timed(options, clock);
    let compared = compare(&models, measurement, options, clock)?;
    let choice = choose(&compared.tried);
    let model = choice.chosen.parse().map_err(|_| FitError::Solver { reason: "no model was chosen".into() })?;
    let (limits, idle): (Vec<Limit>, Vec<Limit>) =
        options.limits.iter().cloned().partition(|limit| concerns(limit, &model, measurement));
    let mut fitted = fit_since(clock, measurement, &FitOptions { model, limits, ..options.clone() })?;
    if let Some(record) = &mut fitted.material.fit {
        record.warnings.extend(compared.warnings(&models, measurement));
        let said = idle.iter().map(|limit| format!("{limit} limits nothing: {} has no such parameter", choice.chosen));
        record.warnings.extend(said);
        record.choice = Some(choice);
    }
    Ok(fitted)
}

/// The models that are compared, in the measurement's world.
fn models(measurement: &Measurement, options: &FitOptions) -> Result<Vec<ModelSpec>, FitError> {
    let model = |name: &str| {
        let model = name.parse().map_err(|_| FitError::Solver { reason: format!("no model {name}") })?;
        FitOptions { model, ..options.clone() }.model_for(measurement)
    };
    CANDIDATES.into_iter().map(model).collect()
}

/// What was compared, simplest first.
struct Compared {
    tried: Vec<Tried>,
    /// Entries of the measurement that were looked at, at most.
    entries: usize,
}

impl Compared {
    /// What the time left out.
    fn warnings(&self, models: &[ModelSpec], measurement: &Measurement) -> Vec<String> {
        let mut list = Vec::new();
        let is_tried = |name: &String| self.tried.iter().any(|t| t.candidate.model == *name);
        let not: Vec<String> = models.iter().map(ToString::to_string).filter(|name| !is_tried(name)).collect();
        if !not.is_empty() {
            list.push(format!("the time ended the comparison of models before {} were looked at", not.join(", ")));
        }
        let cut: Vec<&str> = self.tried.iter().filter(|t| t.is_cut).map(|t| t.candidate.model.as_str()).collect();
        if !cut.is_empty() {
            list.push(format!("the time ended the comparison of models before all was done for {}", cut.join(", ")));
        }
        let part = self.tried.first().and_then(|t| t.part).filter(|_| self.entries < SAMPLES.min(measurement.len()));
        list.extend(part.map(|part| format!("the time left {part} directions for the comparison of models")));
        list
    }
}

/// Every model's errors, on as many samples as the time allows. The first round does not begin a model that would end too late.
fn compare(
    models: &[ModelSpec],
    measurement: &Measurement,
    options: &FitOptions,
    clock: Instant,
) -> Result<Compared, FitError> {
    let richest_first: Vec<usize> = (0..models.len()).rev().collect();
    let Some(budget) = options.time_budget else {
        let tried = compare_on((SAMPLES, &richest_first), models, measurement, options, &Haste::NONE)?;
        return Ok(Compared { tried, entries: SAMPLES });
    };
    let time = budget.mul_f64(COMPARISON);
    let late = |more: Duration| clock.elapsed() + more > time;
    let deadline = Deadline::of(clock, Some(budget));
    let mut entries = FIRST;
    loop {
        let began = Instant::now();
        let all = entries >= SAMPLES.min(measurement.len());
        let first = entries == FIRST;
        let order: &[usize] = if first { &IN_HASTE } else { &richest_first };
        let haste = Haste { late: if first { Some(&late) } else { None }, deadline };
        match compare_on((entries, order), models, measurement, options, &haste) {
            Err(FitError::NothingToFit { .. }) if !all => {} // what counts may be among the others
            Ok(tried) => {
                let cut = tried.len() < models.len();
                if all || cut || deadline.is_past() || late(began.elapsed().mul_f64(GROWTH as f64)) {
                    return Ok(Compared { tried, entries });
                }
            }
            Err(error) => return Err(error),
        }
        entries *= GROWTH;
    }
}

/// What the time asks of a comparison.
struct Haste<'a> {
    /// Whether what takes so long more would end too late; models of which it is so are left out.
    late: Option<&'a dyn Fn(Duration) -> bool>,
    /// When the searches within a model end.
    deadline: Deadline,
}

impl Haste<'_> {
    const NONE: Self = Self { late: None, deadline: Deadline::NEVER };
}

/// Models' errors on so many entries of the measurement, simplest first; of those that would end too late none, but the first in `order`.
fn compare_on(
    (entries, order): (usize, &[usize]),
    models: &[ModelSpec],
    measurement: &Measurement,
    options: &FitOptions,
    haste: &Haste<'_>,
) -> Result<Vec<Tried>, FitError> {
    let mut numbered = Vec::new();
    // The first one's residuals set the robust scale by which all are judged.
    let mut common = None;
    let mut of_one_lobe = None;
    for (place, model) in order.iter().filter_map(|&place| Some((place, models.get(place)?))) {
        let began = Instant::now();
        let glossy = model.lobes().iter().filter(|k| !k.lobe().parameters().is_empty()).count();
        let needed = of_one_lobe.map(|time: Duration| time.mul_f64(STEEP.powi(glossy as i32 - 1)));
        if haste.late.zip(needed).is_some_and(|(late, needed)| late(needed)) {
            continue;
        }
        let limits = options.limits.iter().filter(|l| concerns(l, model, measurement)).cloned().collect();
        let own = FitOptions { model: model.clone(), limits, bootstrap: None, time_budget: None, ..options.clone() };
        let tried = candidate(measurement, &own, (entries, haste.deadline), &mut common);
        timed::check(options)?;
        numbered.push((place, tried?));
        if glossy == 1 {
            of_one_lobe = Some(began.elapsed());
        }
    }
    numbered.sort_by_key(|(place, _)| *place);
    let mut candidates: Vec<Tried> = numbered.into_iter().map(|(_, tried)| tried).collect();
    // Residuals are the less alike the better the model: the richest one's tell best how many there are.
    let effective = candidates.iter().rev().find_map(|tried| tried.effective);
    for tried in &mut candidates {
        tried.candidate.judge(effective.unwrap_or(measurement.len() as f64), tried.rounding);
    }
    Ok(candidates)
}

/// One model's errors on the samples it was fitted to and on those it was not.
/// Residuals count as they do in `common`, which the first candidate sets.
fn candidate(
    measurement: &Measurement,
    options: &FitOptions,
    (entries, deadline): (usize, Deadline),
    common: &mut Option<Vec<Saturation>>,
) -> Result<Tried, FitError> {
    let model = options.model_for(measurement)?;
    let ranges = Ranges::new(&model, &measurement.channels, &options.limits)?;
    let all: Vec<usize> = (0..measurement.channels.len()).collect();
    let groups = options.groups(&all);
    // Pieces of a table's lines, whole ones where there are enough, so that neighbours stay neighbours.
    let is_grid = matches!(measurement.directions, Directions::Merl(_));
    let run = if is_grid { (entries / RUNS).clamp(1, MerlGrid::PHI_D) } else { 1 };
    let thin = Thin { step: measurement.len().div_ceil(entries), run };
    let (mut total, mut held_out, mut residuals, mut parameters) = (0.0, vec![(0.0, 0usize); FOLDS], 0, 0);
    let mut effective = Some(0.0);
    let mut energy = 0.0;
    let (mut own, mut directions, mut is_cut) = (Vec::new(), 0, false);
    for (k, group) in groups.into_iter().enumerate() {
        let (samples, _) = Samples::gather(measurement, &model, options, group, thin)?;
        let samples = samples.listed(|_| true);
        let unit = options.loss.cost_unit(samples.scale);
        let whole = part::fit(&samples, None, &model, &ranges, options, deadline)?;
        is_cut |= whole.is_cut();
        own.push(whole.saturation);
        let saturation = common.as_ref().map_or(whole.saturation, |list| list[k]);
        let cost_on = |at: &Solution, on: &Samples<'_>| unit * cost(at, on, saturation.zip(options.robust));
        total += cost_on(&whole.solution, &samples);
        directions = directions.max(samples.len());
        energy += energy_of(&samples, &whole.solution, options.robust.is_some()) * unit;
        residuals += samples.residuals();
        parameters += whole.uncertainty.errors.len();
        effective = effective.zip(whole.structure).map(|(sum, s)| sum + s.effective_samples);
        let folds = folds(&samples);
        for (fold, held_out) in held_out.iter_mut().enumerate() {
            let train = samples.listed(|i| folds[i] != fold);
            let test = samples.listed(|i| folds[i] == fold);
            if train.len() == 0 || test.len() == 0 {
                continue;
            }
            let found = part::refit(&train, &whole, &model, &ranges, options)?;
            held_out.0 += cost_on(&found, &test);
            held_out.1 += test.residuals();
        }
    }
    common.get_or_insert(own);
    let rms = |(cost, n): (f64, usize)| (cost / n.max(1) as f64).sqrt();
    let rounding = ROUNDING * rms((energy, residuals));
    let candidate = ModelCandidate {
        model: options.model.to_string(),
        parameters: parameters as u64,
        rmse: rms((total, residuals)),
        held_out_rmse: rms(held_out.iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1))),
        aicc: f64::NAN,
        bic: f64::NAN,
    };
    let held_out = held_out.into_iter().filter(|(_, n)| *n > 0);
    let part = (thin.step > 1).then_some(directions as u64);
    Ok(Tried { candidate, effective, rounding, folds: held_out.map(rms).collect(), part, is_cut })
}

/// Σ w r². Under a robust loss an outlier counts as much as one sample can, for its own size says nothing of a model: Σ w s²/3 ρ with Tukey's
/// bisquare, which is Σ w r² where residuals are small.
fn cost(at: &Solution, on: &Samples<'_>, robust: Option<((RobustKind, f64), Robust)>) -> f64 {
    match robust {
        None => passes::sums(on, &at.lobes, &at.weights, None, Want::Gradient).iter().map(|s| s.cost).sum(),
        Some(((_, s), robust)) => {
            let s = JUDGE_SCALE * s / robust.scale;
            bounded_cost(on, at, s) * s * s / 3.0
        }
    }
}

/// Σ w r² where every weight is 0; under a robust loss what it would be if all values had their median size.
fn energy_of(samples: &Samples<'_>, at: &Solution, is_robust: bool) -> f64 {
    if is_robust {
        return samples.residuals() as f64 * sizes(samples, at).0.powi(2);
    }
    let nothing: Vec<_> = at.weights.iter().map(|x| x * 0.0).collect();
    passes::sums(samples, &at.lobes, &nothing, None, Want::Gradient).iter().map(|s| s.cost).sum()
}

/// A model's errors.
struct Tried {
    candidate: ModelCandidate,
    /// How many independent samples its residuals are worth.
    effective: Option<f64>,
    /// An rmse below this is rounding.
    rounding: f64,
    /// Held-out rmse of every fold.
    folds: Vec<f64>,
    /// Directions looked at, where not all were.
    part: Option<u64>,
    /// Whether the time left something of its search out.
    is_cut: bool,
}

impl Tried {
    /// The held-out rmse, or what rounding leaves of it.
    fn error(&self) -> f64 {
        let e = self.candidate.held_out_rmse;
        if e.is_finite() { e.max(self.rounding) } else { f64::INFINITY }
    }

    fn is_exact(&self) -> bool {
        self.error() <= self.rounding
    }
}

/// Whether a model has the parameter that a limit is about.
fn concerns(limit: &Limit, model: &ModelSpec, measurement: &Measurement) -> bool {
    ranges_of(limit, model, measurement).is_ok()
}

fn ranges_of(limit: &Limit, model: &ModelSpec, measurement: &Measurement) -> Result<Ranges, FitError> {
    Ranges::new(model, &measurement.channels, std::slice::from_ref(limit))
}

/// The fold of every sample, by its cell of (θi, θo).
fn folds(samples: &Samples<'_>) -> Vec<usize> {
    let cell = |theta: f64| (theta.to_degrees() / CELL_DEG) as usize;
    samples.pairs_of().iter().map(|(wi, wo)| (cell(theta_of(*wi)) + 2 * cell(theta_of(*wo))) % FOLDS).collect()
}

impl ModelCandidate {
    /// Information criteria for this many independent samples; an rmse below `rounding` counts as that.
    fn judge(&mut self, samples: f64, rounding: f64) {
        let (n, k) = (samples, self.parameters as f64 + 1.0); // and the noise
        let fit = 2.0 * n * self.rmse.max(rounding).max(f64::MIN_POSITIVE).ln();
        self.aicc = if n > k + 1.0 { fit + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0) } else { f64::INFINITY };
        self.bic = fit + k * n.ln();
    }
}

/// By how much a model's held-out error exceeds the best's, as a share, and the standard error of that over the folds.
fn excess(own: &Tried, best: &Tried) -> (f64, f64) {
    let least = best.error();
    if own.error() <= least {
        return (0.0, 0.0);
    }
    let floored = |list: &[f64]| -> Vec<f64> { list.iter().map(|e| e.max(best.rounding)).collect() };
    let pairs = floored(&own.folds).into_iter().zip(floored(&best.folds));
    let differences: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (own.error() / least - 1.0, (variance / n).sqrt() / least)
}

/// The simplest candidate that is as good as the best, and why.
fn choose(tried: &[Tried]) -> ModelChoice {
    let candidates: Vec<ModelCandidate> = tried.iter().map(|t| t.candidate.clone()).collect();
    let Some(best) = tried.iter().min_by(|a, b| a.error().total_cmp(&b.error())) else {
        return ModelChoice { chosen: String::new(), reason: String::new(), candidates, samples: None };
    };
    let good = |t: &&Tried| {
        let (excess, error) = excess(t, best);
        excess <= AS_GOOD.max(error)
    };
    let chosen = tried.iter().filter(good).min_by_key(|t| t.candidate.parameters).unwrap_or(best);
    let mut reason = why(chosen, best, tried.len());
    let simpler = tried.iter().filter(|t| t.candidate.parameters < chosen.candidate.parameters);
    if let Some(next) = simpler.map(Tried::error).min_by(f64::total_cmp) {
        let _ = write!(reason, "; the best simpler model's is {}", higher(next / chosen.error()));
    }
    ModelChoice { chosen: chosen.candidate.model.clone(), reason, candidates, samples: best.part }
}

/// Why `chosen` and not `best`.
fn why(chosen: &Tried, best: &Tried, tried: usize) -> String {
    if tried == 1 {
        return "the only model that there was time to look at".into();
    }
    if chosen.is_exact() {
        return "the simplest model whose held-out error is no more than rounding".into();
    }
    if chosen.candidate.model == best.candidate.model {
        return "the lowest held-out error".into();
    }
    let (excess, error) = excess(chosen, best);
    format!(
        "the simplest model as good as the best one held out, {}, whose error is {:.2} % lower (within {:.2} % counts as good)",
        best.candidate.model,
        100.0 * excess / (1.0 + excess),
        100.0 * AS_GOOD.max(error)
    )
}

/// A ratio in words.
fn higher(ratio: f64) -> String {
    match ratio {
        r if r >= 1e6 => format!("{r:.0e} times as high"),
        r if r > 10.0 => format!("{r:.0} times as high"),
        r => format!("{:.1} % higher", 100.0 * (r - 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tried(model: &str, parameters: u64, held_out_rmse: f64) -> Tried {
        let model = model.into();
        let (aicc, bic) = (0.0, 0.0);
        let candidate = ModelCandidate { model, parameters, rmse: held_out_rmse, held_out_rmse, aicc, bic };
        Tried {
            candidate,
            effective: None,
            rounding: 1e-13,
            folds: vec![held_out_rmse; FOLDS],
            part: None,
            is_cut: false,
        }
    }

    #[test]
    fn errors_below_rounding_are_equal_and_large_ratios_are_said_as_multiples() {
        let choice = choose(&[tried("a", 1, 0.1), tried("b", 2, 3e-16), tried("c", 3, 0.0)]);
        assert_eq!(choice.chosen, "b");
        assert!(choice.reason.contains("no more than rounding"), "{}", choice.reason);
        assert!(choice.reason.ends_with("1e12 times as high"), "{}", choice.reason);
        let choice = choose(&[tried("a", 1, 0.1), tried("b", 2, 0.002), tried("c", 3, 0.001)]);
        assert_eq!((choice.chosen.as_str(), higher(1.5).as_str()), ("c", "50.0 % higher"));
        assert!(choice.reason.ends_with("the best simpler model's is 100.0 % higher"), "{}", choice.reason);
    }

    #[test]
    fn of_models_that_are_all_without_error_the_simplest_is_chosen() {
        let without = |model, parameters| Tried { rounding: 0.0, ..tried(model, parameters, 0.0) };
        assert_eq!(choose(&[without("a", 1), without("b", 2)]).chosen, "a");
    }
}
