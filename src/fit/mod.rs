//! The fit: from a measurement to the analytic model that comes closest to it, and how sure of it one can be.
//!
//! In: a [`Measurement`] and [`FitOptions`]. Out: [`Fitted`], a [`Material`] with its record. The one decision to know: the
//! weights are linear, so for given shapes they come from a small non-negative least-squares solve (variable projection, Golub
//! & Pereyra 1973; Kaufman 1975) and the nonlinear search runs over t = ln(shape) alone. It needs no start value: a pass over
//! exponents an octave apart brackets every minimum, and the solver polishes the promising ones.

mod covariance;
mod nnls;
mod options;
mod passes;
mod record;
mod samples;
pub mod solver;
mod start;
mod varpro;

use std::time::Instant;

use nalgebra::DVector;

use crate::brdf::Material;
use crate::measurement::Measurement;

pub use covariance::{Interval, Uncertainty};
pub use options::{FitError, FitOptions, Loss, WeightMode};
pub use solver::Stop;

/// A fitted material and what the caller may want besides its file.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The material, with its record.
    pub material: Material,
    /// The search, step by step.
    pub history: Vec<solver::Iteration>,
    /// Why it ended.
    pub stop: Stop,
}

/// Fits a model to a measurement.
///
/// # Errors
/// [`FitError`] where the options are wrong or nothing valid is left to fit.
pub fn fit(measurement: &Measurement, options: &FitOptions) -> Result<Fitted, FitError> {
    let clock = Instant::now();
    options.validate()?;
    let model = options.model_for(measurement)?;
    let samples = samples::Samples::gather(measurement, &model, options)?;
    let problem = varpro::Profile::new(&samples, &model);
    let outcome = search(&problem, options)?;
    let solution = problem.solve(outcome.t.as_slice());
    if !solution.cost.is_finite() {
        return Err(FitError::Solver { reason: "the cost is not finite".into() });
    }
    let uncertainty = covariance::uncertainty(&problem, &solution, measurement);
    let material = record::material(&record::Facts {
        measurement,
        options,
        problem: &problem,
        solution: &solution,
        uncertainty: &uncertainty,
        outcome: &outcome,
        seconds: clock.elapsed().as_secs_f64(),
    });
    Ok(Fitted { material, history: outcome.history, stop: outcome.stop })
}

/// The best minimum that the solver reaches from the promising starts.
fn search(problem: &varpro::Profile<'_>, options: &FitOptions) -> Result<solver::Outcome, FitError> {
    let lm = solver::LevenbergMarquardt::bounded(problem.bounds());
    let mut starts = start::starts(problem);
    if let Some(smaller) = problem.without_last_shape() {
        // A lobe more can only help: from the smaller model's optimum the larger one never ends above it.
        starts.push(start::extended(problem, &search(&smaller, options)?.t)?);
    }
    let mut best: Option<solver::Outcome> = None;
    for start in starts {
        let outcome = solver::minimize(problem, lm.clone(), DVector::from_vec(start), options.max_iterations)
            .map_err(|e| FitError::Solver { reason: e.to_string() })?;
        if best.as_ref().is_none_or(|b| outcome.cost < b.cost) {
            best = Some(outcome);
        }
    }
    best.ok_or_else(|| FitError::Solver { reason: "no start".into() })
}
