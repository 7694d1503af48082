//! What a fit is asked for, and why it may refuse.

use std::sync::Arc;
use std::time::Duration;

use super::limits::Limit;
use super::loss::{Loss, ROBUST_SCALES, Robust};
use crate::brdf::{ModelSpec, Sight};
use crate::measurement::{Dimension, Measurement};

/// How samples count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WeightMode {
    /// By the solid angle that each stands for; all alike where the file knows none.
    #[default]
    SolidAngle,
    /// All alike.
    Uniform,
}

impl WeightMode {
    /// Its name in options and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SolidAngle => "solid-angle",
            Self::Uniform => "uniform",
        }
    }
}

/// Draws of the bootstrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bootstrap {
    /// How many data sets are redrawn.
    pub replicates: u32,
    /// Seed of the draws.
    pub seed: u64,
}

/// Options of [`super::fit`].
#[derive(Debug, Clone)]
#[allow(clippy::struct_excessive_bools)] // options, each on its own
pub struct FitOptions {
    /// The model.
    pub model: ModelSpec,
    /// The loss.
    pub loss: Loss,
    /// The weights.
    pub weights: WeightMode,
    /// Weigh by 1/((∂r/∂y)² (σ² + Σ u²)) instead, by all of the error that the measurement states of a value, its own σ and the u that it shares; no solid angle then.
    pub use_sigma: bool,
    /// Lets outliers count less.
    pub robust: Option<Robust>,
    /// Samples with θi or θo above this (degrees, (0, 90]) are left out; the limit itself is in.
    pub max_angle_deg: f64,
    /// Every how many-th entry of the measurement is used, from the first on; at least 1.
    pub stride: usize,
    /// One of every so many entries is used, at places that keep step with no grid, as a budget or target draws them; at least 1. Where there is a budget or
    /// target, that says how many.
    pub part: usize,
    /// Which of the parts alike of the samples is taken: a stride begins at entry `draw` mod `stride`, and a budget or target draws other
    /// entries. 0 is what the command line takes.
    pub draw: u64,
    /// Shapes of their own for every channel.
    pub per_channel: bool,
    /// Ranges of single parameters, one a parameter at most; a range of one point fixes it.
    pub limits: Vec<Limit>,
    /// Fit under the constraint that no channel reflects more than it receives.
    pub conserve_energy: bool,
    /// The instrument through which the measurement saw the material: lobes are averaged as it averages, so that the material itself is
    /// fitted. Without one the values are taken for those of the directions they stand at.
    pub through: Option<Arc<dyn Sight>>,
    /// Time that the fit may take; it then works on as many samples as that allows.
    pub time_budget: Option<Duration>,
    /// Largest share by which the rmse over all samples may exceed the best one's (0.01 for 1 %), with 95 % confidence.
    pub target_rmse_excess: Option<f64>,
    /// Standard errors by redrawing the data, beside the analytic ones.
    pub bootstrap: Option<Bootstrap>,
    /// Intervals by profile where a standard error's does not do; else all are estimate ± t·σ, and no other valley is looked for along profiles.
    pub profiles: bool,
    /// Most steps of the solver from one start.
    pub max_iterations: u64,
}

impl FitOptions {
    /// The defaults for a model: `cosine-l2`, solid-angle weights, 80°, all samples.
    #[must_use]
    pub fn new(model: ModelSpec) -> Self {
        Self {
            model,
            loss: Loss::default(),
            weights: WeightMode::default(),
            use_sigma: false,
            robust: None,
            max_angle_deg: 80.0,
            stride: 1,
            part: 1,
            draw: 0,
            per_channel: false,
            limits: Vec::new(),
            conserve_energy: false,
            through: None,
            time_budget: None,
            target_rmse_excess: None,
            bootstrap: None,
            profiles: true,
            max_iterations: 100,
        }
    }

    /// Whether the stride takes an entry.
    pub(super) fn takes(&self, entry: usize) -> bool {
        self.stride == 1 || entry as u64 % self.stride as u64 == self.draw % self.stride as u64
    }

    pub(super) fn validate(&self, measurement: &Measurement) -> Result<(), FitError> {
        let wrong = |field, expected, found: String| Err(FitError::Option { field, expected, found });
        if !(self.max_angle_deg > 0.0 && self.max_angle_deg <= 90.0) {
            return wrong("max-angle", "an angle in (0, 90] degrees", self.max_angle_deg.to_string());
        }
        if self.stride == 0 {
            return wrong("stride", "at least 1", "0".into());
        }
        if self.part == 0 {
            return wrong("part", "at least 1", "0".into());
        }
        if let Some(excess) = self.target_rmse_excess.filter(|e| !(*e > 0.0 && e.is_finite())) {
            return wrong("target-rmse-excess", "a positive share", excess.to_string());
        }
        if let Some(robust) = self.robust.filter(|r| !ROBUST_SCALES.contains(&r.scale)) {
            return wrong("robust", "a scale from 1e-3 to 1e6", format!("{:e}", robust.scale));
        }
        if let Some(few) = self.bootstrap.filter(|b| b.replicates < 2) {
            return wrong("bootstrap", "at least 2 replicates", few.replicates.to_string());
        }
        if let Some((first, second)) = Limit::doubled(&self.limits) {
            let [first, second] = [first, second].map(|i| self.limits[i].to_string());
            return Err(FitError::LimitTwice { first, second });
        }
        if self.use_sigma && measurement.sigma.is_none() {
            return wrong("use-sigma", "a measurement that states sigma", "none stated".into());
        }
        let sigma = measurement.sigma.as_ref().filter(|_| self.use_sigma);
        if sigma.is_some_and(|sigma| !sigma.iter().any(|s| *s > 0.0)) {
            return wrong("use-sigma", "a measurement that states a positive sigma", "sigma 0 throughout".into());
        }
        if self.through.is_some() && measurement.dimension == Dimension::Flat {
            return wrong("through", "a measurement in space", "one of the flat world".into());
        }
        if self.time_budget == Some(Duration::ZERO) {
            return wrong("time-budget", "more than 0", "0".into());
        }
        Ok(())
    }

    /// Channels fitted together, of those given.
    pub(super) fn groups<'a>(&self, channels: &'a [usize]) -> Vec<&'a [usize]> {
        if self.per_channel { channels.chunks(1).collect() } else { vec![channels] }
    }

    /// The model in the measurement's world: a flat table is fitted by the flat twins of the lobes.
    pub(super) fn model_for(&self, measurement: &Measurement) -> Result<ModelSpec, FitError> {
        match (measurement.dimension, self.model.is_flat()) {
            (Dimension::Flat, _) => Ok(self.model.flattened()),
            (Dimension::Space, false) => Ok(self.model.clone()),
            (Dimension::Space, true) => Err(FitError::Option {
                field: "model",
                expected: "lobes of space, for the measurement is not flat",
                found: self.model.to_string(),
            }),
        }
    }
}

/// Why there is no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// An option out of its range.
    #[error("{field}: expected {expected}, found {found}")]
    Option {
        /// Which, as on the command line.
        field: &'static str,
        /// Its range.
        expected: &'static str,
        /// What was given.
        found: String,
    },
    /// A material of other channels than the measurement's.
    #[error("channels of the material: expected {measurement}, as the measurement has them, found {material}")]
    Channels {
        /// Those of the material.
        material: String,
        /// Those of the measurement.
        measurement: String,
    },
    /// A limit that fits nothing.
    #[error("{name}: expected {expected}, found {found}")]
    Limit {
        /// The parameter as it was named.
        name: String,
        /// What it could have been.
        expected: String,
        /// What of it does not fit.
        found: String,
    },
    /// Two limits of one parameter.
    #[error("{first} and {second} limit the same parameter; expected one limit a parameter")]
    LimitTwice {
        /// One of them.
        first: String,
        /// The other.
        second: String,
    },
    /// Limits that can't all be met.
    #[error(
        "channel {channel}: the least weights allowed reflect {least} in all, more than the light that energy conservation leaves"
    )]
    Infeasible {
        /// The channel.
        channel: String,
        /// Sum of the least weights.
        least: f64,
    },
    /// No sample is left.
    #[error(
        "{name}: nothing valid to fit: of {entries} direction pairs {below} have a direction below the horizon, \
         {beyond} lie beyond {max_angle_deg}°, {masked} are masked, {weightless} have weight 0"
    )]
    NothingToFit {
        /// The measurement.
        name: String,
        /// Direction pairs in all.
        entries: usize,
        /// Pairs below the horizon.
        below: usize,
        /// Pairs left out for their angle.
        beyond: usize,
        /// Pairs masked in every channel.
        masked: usize,
        /// Pairs of weight 0.
        weightless: usize,
        /// The limit.
        max_angle_deg: f64,
    },
    /// A value that is too large to square.
    #[error("{name}: the values reach {largest:e}, whose square overflows; scale them down")]
    Overflow {
        /// The measurement.
        name: String,
        /// Largest value.
        largest: f64,
    },
    /// Values so small that they have lost digits, or are about to.
    #[error("{name}: the values reach no more than {largest:e}, too small for all digits; scale them up")]
    Underflow {
        /// The measurement.
        name: String,
        /// Largest value.
        largest: f64,
    },
    /// The time was over before there was a fit through an instrument.
    #[error(
        "time-budget: {budget:?} ended after lobes of {made} exponents were averaged over the cones of the instrument, before any fit was there; \
         expected about {needed:?} or more"
    )]
    OutOfTime {
        /// The time.
        budget: Duration,
        /// Exponents of which lobes were averaged.
        made: u32,
        /// About the time that it takes.
        needed: Duration,
    },
    /// The solver failed.
    #[error("the solver failed: {reason}")]
    Solver {
        /// What it said.
        reason: String,
    },
}
