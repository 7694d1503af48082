//! Which model? Candidates compared by the error on directions that they were not fitted to.

use super::limits::Ranges;
use super::options::{FitError, FitOptions};
use super::part;
use super::passes::{self, Want};
use super::samples::{Samples, Thin};
use super::{Fitted, fit};
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
/// Samples that the comparison looks at.
const SAMPLES: usize = 40_000;
/// A held-out error within this share of the best is as good.
const AS_GOOD: f64 = 0.01;

/// Compares all models and fits the simplest one whose held-out error is as good as the best's. `options.model` is not looked at.
///
/// # Errors
/// As [`fit`].
pub fn fit_best_model(measurement: &Measurement, options: &FitOptions) -> Result<Fitted, FitError> {
    options.validate(measurement)?;
    let mut candidates = Vec::new();
    let mut effective = measurement.len() as f64;
    for name in CANDIDATES {
        let spec: ModelSpec = name.parse().map_err(|_| FitError::Solver { reason: format!("no model {name}") })?;
        let own = FitOptions { model: spec, bootstrap: None, time_budget: None, ..options.clone() };
        let (candidate, samples) = candidate(measurement, &own)?;
        // Residuals are the less alike the better the model: the last one's tell best how many there are.
        effective = samples.unwrap_or(effective);
        candidates.push(candidate);
    }
    for candidate in &mut candidates {
        candidate.judge(effective);
    }
    let choice = choose(candidates);
    let model = choice.chosen.parse().map_err(|_| FitError::Solver { reason: "no model was chosen".into() })?;
    let mut fitted = fit(measurement, &FitOptions { model, ..options.clone() })?;
    if let Some(record) = &mut fitted.material.fit {
        record.choice = Some(choice);
    }
    Ok(fitted)
}

/// One model's errors on the samples it was fitted to and on those it was not; with it, how many independent samples its residuals are
/// worth.
fn candidate(measurement: &Measurement, options: &FitOptions) -> Result<(ModelCandidate, Option<f64>), FitError> {
    let model = options.model_for(measurement)?;
    let ranges = Ranges::new(&model, &measurement.channels, &options.limits)?;
    let all: Vec<usize> = (0..measurement.channels.len()).collect();
    let groups: Vec<&[usize]> = if options.per_channel { all.chunks(1).collect() } else { vec![&all] };
    // Whole lines of a table, so that neighbours stay neighbours.
    let run = if matches!(measurement.directions, Directions::Merl(_)) { MerlGrid::PHI_D } else { 1 };
    let thin = Thin { step: measurement.len().div_ceil(SAMPLES), run };
    let (mut cost, mut held_out, mut residuals, mut parameters) = (0.0, vec![(0.0, 0usize); FOLDS], 0, 0);
    let mut effective = Some(0.0);
    for group in groups {
        let (samples, _) = Samples::gather(measurement, &model, options, group, thin)?;
        let samples = samples.listed(|_| true);
        let unit = options.loss.cost_unit(samples.scale);
        let whole = part::fit(&samples, None, &model, &ranges, options)?;
        cost += whole.solution.cost * unit;
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
            let found = part::fit(&train, None, &model, &ranges, options)?;
            let sums =
                passes::sums(&test, &found.solution.lobes, &found.solution.weights, found.saturation, Want::Gradient);
            held_out.0 += sums.iter().map(|s| s.cost).sum::<f64>() * unit;
            held_out.1 += test.residuals();
        }
    }
    let rms = |(cost, n): (f64, usize)| (cost / n.max(1) as f64).sqrt();
    let candidate = ModelCandidate {
        model: options.model.to_string(),
        parameters: parameters as u64,
        rmse: rms((cost, residuals)),
        held_out_rmse: rms(held_out.iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1))),
        aicc: f64::NAN,
        bic: f64::NAN,
    };
    Ok((candidate, effective))
}

/// The fold of every sample, by its cell of (θi, θo).
fn folds(samples: &Samples<'_>) -> Vec<usize> {
    let cell = |theta: f64| (theta.to_degrees() / CELL_DEG) as usize;
    samples.pairs_of().iter().map(|(wi, wo)| (cell(theta_of(*wi)) + 2 * cell(theta_of(*wo))) % FOLDS).collect()
}

impl ModelCandidate {
    /// Information criteria for this many independent samples.
    fn judge(&mut self, samples: f64) {
        let (n, k) = (samples, self.parameters as f64 + 1.0); // and the noise
        let fit = 2.0 * n * self.rmse.ln();
        self.aicc = if n > k + 1.0 { fit + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0) } else { f64::INFINITY };
        self.bic = fit + k * n.ln();
    }
}

/// The simplest candidate that is as good as the best, and why.
fn choose(candidates: Vec<ModelCandidate>) -> ModelChoice {
    let error = |c: &ModelCandidate| if c.held_out_rmse.is_finite() { c.held_out_rmse } else { f64::INFINITY };
    let least = candidates.iter().map(error).fold(f64::INFINITY, f64::min);
    let good = |c: &&ModelCandidate| error(c) <= least * (1.0 + AS_GOOD);
    let chosen = candidates.iter().filter(good).min_by_key(|c| c.parameters).or(candidates.first());
    let (name, own) = chosen.map_or((String::new(), f64::NAN), |c| (c.model.clone(), error(c)));
    let best = candidates.iter().min_by(|a, b| error(a).total_cmp(&error(b))).map_or("", |c| &c.model);
    let reason = if best == name {
        let simpler = candidates.iter().filter(|c| chosen.is_some_and(|own| c.parameters < own.parameters));
        match simpler.map(error).min_by(f64::total_cmp) {
            Some(next) => {
                format!("lowest held-out error; the best simpler model's is {:.1} % higher", 100.0 * (next / own - 1.0))
            }
            None => "lowest held-out error, and no model is simpler".to_owned(),
        }
    } else {
        let gain = 100.0 * (own / least - 1.0);
        format!("the simplest model within {:.0} % of the lowest held-out error ({best}, {gain:.2} % lower)", 100.0 * AS_GOOD)
    };
    ModelChoice { chosen: name, reason, candidates }
}
