//! What a fit is asked for, and why it may refuse.

use crate::brdf::ModelSpec;
use crate::measurement::{Dimension, Measurement};

/// What is minimised: the residual r of one sample and channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Loss {
    /// r = f − f̂.
    L2,
    /// r = cosθi (f − f̂) (Ngan, Durand, Matusik 2005).
    #[default]
    CosineL2,
}

impl Loss {
    /// All losses.
    pub const ALL: [Self; 2] = [Self::L2, Self::CosineL2];

    /// Its name in options and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::L2 => "l2",
            Self::CosineL2 => "cosine-l2",
        }
    }

    /// ∂r/∂f of a sample with this cosine of the incident angle.
    #[must_use]
    pub fn slope(self, cos_i: f64) -> f64 {
        match self {
            Self::L2 => 1.0,
            Self::CosineL2 => cos_i,
        }
    }
}

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

/// Options of [`super::fit`].
#[derive(Debug, Clone)]
pub struct FitOptions {
    /// The model.
    pub model: ModelSpec,
    /// The loss.
    pub loss: Loss,
    /// The weights.
    pub weights: WeightMode,
    /// Samples with θi or θo above this (degrees, (0, 90]) are left out; the limit itself is in.
    pub max_angle_deg: f64,
    /// Most steps of the solver from one start.
    pub max_iterations: u64,
}

impl FitOptions {
    /// The defaults for a model: `cosine-l2`, solid-angle weights, 80°.
    #[must_use]
    pub fn new(model: ModelSpec) -> Self {
        Self { model, loss: Loss::default(), weights: WeightMode::default(), max_angle_deg: 80.0, max_iterations: 100 }
    }

    pub(super) fn validate(&self) -> Result<(), FitError> {
        if !(self.max_angle_deg > 0.0 && self.max_angle_deg <= 90.0) {
            return Err(FitError::Option {
                field: "max-angle",
                expected: "an angle in (0, 90] degrees",
                found: self.max_angle_deg.to_string(),
            });
        }
        Ok(())
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
        /// Which.
        field: &'static str,
        /// Its range.
        expected: &'static str,
        /// What was given.
        found: String,
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
    /// The solver failed.
    #[error("the solver failed: {reason}")]
    Solver {
        /// What it said.
        reason: String,
    },
}
