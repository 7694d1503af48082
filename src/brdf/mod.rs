//! Reflectance models, one file each, and what they have in common.
//!
//! In: pairs of unit directions in the local frame (normal +z) and parameters. Out: BRDF values in 1/sr (1/rad in the flat
//! world), samples with their densities, basis values and derivatives for the fit. The one decision to know: a model is a
//! sum of lobes, each with one linear weight per channel and shape parameters of its own; everything nonlinear is in the
//! shapes, so a fit searches the shapes alone.

pub mod check;
pub mod file;
pub mod lambert;
pub mod lobe;
pub mod material;
pub mod phong;
pub mod spec;

pub use file::{
    BootstrapRecord, Correlation, EnergyRecord, FitRecord, LobeRecord, MaterialError, ModelCandidate, ModelChoice,
    ResidualRecord, SearchRecord, SubsetRecord,
};
pub use lobe::{Lobe, LobeKind, Parameter, Place, Sight};
pub use material::{LobeTerm, Material, PerChannel, Reflectance};
pub(crate) use spec::MAX_LOBES;
pub use spec::{ModelSpec, SpecError};

use glam::DVec3;

/// A reflectance function with one value per channel.
pub trait Brdf: Send + Sync {
    /// Number of channels.
    fn channels(&self) -> usize;

    /// Writes the value (1/sr) of every channel into `out`, whose length is [`Brdf::channels`]. 0 unless `wi` and `wo`
    /// are both above the horizon. Returns whether the value is known: a measured table answers `false`, with zeros, for
    /// directions outside of what was measured.
    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool;

    /// Draws `wi` for a given `wo` from three numbers uniform in [0, 1): the first chooses a part, a lobe say, the point of the
    /// others a direction, so that even points give even directions; `None` where the draw fell below the horizon, or
    /// `wo` is: such a draw counts as one that carries nothing.
    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample>;

    /// The sum of lobes that it is, if it is one.
    fn lobes(&self) -> Option<&Reflectance> {
        None
    }

    /// Density (1/sr) with which [`Brdf::sample`] draws `wi` given `wo`. It integrates to at most 1 over the upper
    /// hemisphere, the rest being the draws that return `None`.
    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64;
}

/// A direction drawn by [`Brdf::sample`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The direction, above the horizon.
    pub wi: DVec3,
    /// Its density, per sr; positive.
    pub pdf: f64,
}
