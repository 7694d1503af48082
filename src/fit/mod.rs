//! The fit: from a measurement to the analytic model that comes closest to it, and how sure of it one can be.
//!
//! In: a [`Measurement`] and [`FitOptions`]. Out: [`Fitted`], a [`Material`] with its record. The one decision to know: the
//! weights are linear, so for given shapes they follow (variable projection, Golub & Pereyra 1973; Kaufman 1975) and the nonlinear
//! search runs over t = ln(shape) alone. All sums that it needs are Laplace transforms of the weighted samples, which one pass
//! over the data compresses: after it, a cost with its derivatives takes microseconds. So no start value is needed: the whole range is
//! searched.

mod bins;
mod bootstrap;
mod budget;
mod choose;
mod copies;
mod covariance;
mod energy;
mod evaluate;
mod folded;
mod identify;
mod intervals;
mod joint;
mod leverage;
mod limits;
mod loss;
mod merl_lines;
mod missing;
mod offset;
mod options;
mod outliers;
mod part;
mod passes;
mod powers;
mod profile;
mod quadratic;
mod record;
mod reduced;
mod residuals;
mod robust;
mod samples;
pub mod solver;
mod start;
mod streamed;
mod structure;
mod tally;
mod timed;
mod transform;
mod walk;

use std::time::{Duration, Instant};

use crate::brdf::{Material, ModelSpec};
use crate::measurement::Measurement;

pub use choose::fit_best_model;
pub use covariance::Interval;
pub(crate) use evaluate::judged;
pub use evaluate::rmse_of;
pub use limits::{Field, Limit, ParameterName};
pub use loss::{Datum, Loss, Robust, RobustKind};
pub use options::{Bootstrap, FitError, FitOptions, WeightMode};
pub use solver::Stop;

use limits::Ranges;
use samples::{Samples, Thin};

/// A fitted material and what the caller may want besides its file.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The material, with its record.
    pub material: Material,
    /// The search, step by step; of every channel in turn where they were fitted apart.
    pub history: Vec<solver::Iteration>,
    /// Why it ended.
    pub stop: Stop,
}

/// Fits a model to a measurement.
///
/// # Errors
/// [`FitError`] where the options are wrong or nothing valid is left to fit.
pub fn fit(measurement: &Measurement, options: &FitOptions) -> Result<Fitted, FitError> {
    fit_since(Instant::now(), measurement, options)
}

/// Fits a model by work that began at `clock`: what is gone of a time budget is gone.
fn fit_since(clock: Instant, measurement: &Measurement, options: &FitOptions) -> Result<Fitted, FitError> {
    options.validate(measurement)?;
    let options = &timed::timed(options, clock);
    let model = options.model_for(measurement)?;
    let ranges = Ranges::new(&model, &measurement.channels, &options.limits)?;
    let all: Vec<usize> = (0..measurement.channels.len()).collect();
    let parts = fit_parts(measurement, &model, &ranges, options, &all, clock)?;
    let samples = if let [part] = &parts[..] {
        part.samples
    } else if parts.iter().any(|p| p.subset.is_some()) {
        parts.iter().map(|p| p.samples).max().unwrap_or(0)
    } else {
        Samples::gather(measurement, &model, options, &all, Thin { step: options.part, run: 1 })?.0.len()
    };
    let facts = record::Facts { measurement, options, model: &model, ranges: &ranges, parts: &parts, samples };
    let mut material = record::material(&facts);
    if let Some(record) = &mut material.fit {
        let elapsed = clock.elapsed();
        record.seconds = elapsed.as_secs_f64();
        budget::tell(record, &parts, options, elapsed);
    }
    let stop = parts.last().map_or(Stop::MaxIterations, |p| p.stop);
    let history = parts.into_iter().flat_map(|p| p.history).collect();
    Ok(Fitted { material, history, stop })
}

/// The fit of all channels together, or of each alone; one without a valid sample is dark as long as another has some.
fn fit_parts(
    measurement: &Measurement,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
    all: &[usize],
    clock: Instant,
) -> Result<Vec<part::Part>, FitError> {
    let groups = options.groups(all);
    let mut found = Vec::new();
    for (done, group) in groups.iter().enumerate() {
        let time = options.time_budget.map(|budget| budget::share(budget, clock.elapsed(), groups.len() - done));
        let part = fit_part(measurement, model, ranges, options, group, time);
        if !matches!(part, Ok(_) | Err(FitError::NothingToFit { .. })) {
            return part.map(|p| vec![p]);
        }
        found.push(part);
    }
    let lit = found.iter().flatten().next().cloned();
    let or_dark = |(part, group): (Result<part::Part, FitError>, &&[usize])| match (part, &lit) {
        (Err(_), Some(lit)) => Ok(lit.dark(group, ranges)),
        (part, _) => part,
    };
    found.into_iter().zip(&groups).map(or_dark).collect()
}

/// The fit of channels that share their shapes, to as many samples as their time or the target asks for.
fn fit_part(
    measurement: &Measurement,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
    channels: &[usize],
    time: Option<Duration>,
) -> Result<part::Part, FitError> {
    if time.is_some() || options.target_rmse_excess.is_some() {
        return budget::fit(measurement, model, ranges, options, channels, time);
    }
    let thin = Thin { step: options.part, run: 1 };
    let (mut samples, transforms) = Samples::gather(measurement, model, options, channels, thin)?;
    samples.are_drawn = options.part > 1;
    let mut part = part::fit(&samples, transforms, model, ranges, options, budget::Deadline::NEVER)?;
    part.bootstrap =
        bootstrap::bootstrap(bootstrap::listed(&samples, options).as_ref(), &part, model, ranges, options, None)?;
    Ok(part)
}
