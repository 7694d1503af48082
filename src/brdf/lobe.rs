//! What the lobes have in common: their parameters, the coordinate they depend on, their basis values.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::{lambert, phong};
use crate::geometry::half_diff::cos_alpha;
use crate::numeric::float::dot_compensated;

/// A shape parameter of a lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name in files and options.
    pub name: &'static str,
    /// Its unit; "1" for a pure number.
    pub unit: &'static str,
    /// The range that a fit searches.
    pub bounds: (f64, f64),
}

/// A lobe as a fit sees it: a basis function of direction pairs with nonlinear shape parameters, to be multiplied by one
/// weight per channel.
pub trait Lobe: Send + Sync + std::fmt::Debug {
    /// Its name in model specifications and files.
    fn name(&self) -> &'static str;

    /// Its shape parameters, all positive and searched on a logarithmic scale.
    fn parameters(&self) -> &'static [Parameter];

    /// All that the value depends on besides the shape, as one number per direction pair, −∞ where the lobe is 0 whatever its
    /// shape. It does not depend on the shape, so a fit computes it once.
    fn coordinate(&self, wi: DVec3, wo: DVec3) -> f64;

    /// The lobe of weight 1 at a coordinate (1/sr, or 1/rad in the flat world); its derivatives by each shape parameter go
    /// into `gradient`, whose length is that of [`Lobe::parameters`].
    fn value(&self, shape: &[f64], coordinate: f64, gradient: &mut [f64]) -> f64;

    /// [`Lobe::value`] of many coordinates at once: values and, parameter by parameter, derivatives; all of the coordinates'
    /// length. What a fit calls: one call a block, however many samples.
    fn fill(&self, shape: &[f64], coordinates: &[f64], values: &mut [f64], derivatives: &mut [Vec<f64>]) {
        let mut gradient = [0.0; MAX_PARAMETERS];
        let gradient = &mut gradient[..self.parameters().len()];
        for (i, (value, &x)) in values.iter_mut().zip(coordinates).enumerate() {
            *value = self.value(shape, x, gradient);
            derivatives.iter_mut().zip(gradient.iter()).for_each(|(list, g)| list[i] = *g);
        }
    }

    /// The lobe's normalisation c(n) and its derivative by n, where its value is c(n)·exp(n·coordinate) with the one shape
    /// parameter n; `None` for other lobes. All sums over samples of such lobes come from one pass, whatever the shapes.
    fn power(&self, _n: f64) -> Option<(f64, f64)> {
        None
    }
}

/// Where a pair of directions stands for a [`Sight`]: what does not depend on a shape.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Angle from the mirror direction to wo, rad.
    pub alpha: f64,
    /// cosθi/cosθo.
    pub ratio: f64,
    /// How far what is averaged over reaches besides cones, rad.
    pub smear: f64,
    /// Direction to the source.
    pub wi: DVec3,
    /// Direction to the detector.
    pub wo: DVec3,
}

/// Lobes as an instrument sees them: averaged over the directions that its source lights and its detector takes in.
pub trait Sight: Send + Sync + std::fmt::Debug {
    /// What it averages over, in a few words.
    fn describe(&self) -> String;

    /// Where a pair of directions stands. `None` where what is averaged over reaches below the horizon,
    /// so that lobes have no value to compare a reading with.
    fn place(&self, wi: DVec3, wo: DVec3) -> Option<Place>;

    /// Makes what [`Self::fill`] of this shape needs, as long as `until` is not past; whether all is there.
    fn prepare(&self, _kind: LobeKind, _shape: &[f64], _until: Instant) -> bool {
        true
    }

    /// Of one whose time is over, so that all lobes it has filled since are 0: how many shapes had been made before.
    fn made_when_ended(&self) -> Option<u32> {
        None
    }

    /// The same sight before anything was made for [`Self::fill`]: of it a first fit's time can be measured. `None` where nothing is kept.
    fn anew(&self) -> Option<Arc<dyn Sight>> {
        None
    }

    /// As [`Lobe::fill`], at such places.
    fn fill(&self, kind: LobeKind, shape: &[f64], places: &[Place], values: &mut [f64], derivatives: &mut [Vec<f64>]);
}

/// Most shape parameters that a lobe may have.
pub const MAX_PARAMETERS: usize = 4;

/// The lobes that goniofit knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LobeKind {
    /// Diffuse, weight/π.
    Lambert,
    /// Reciprocal, normalised Phong.
    Phong,
    /// Diffuse in the flat world, weight/2.
    Lambert2d,
    /// Phong in the flat world.
    Phong2d,
}

impl LobeKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Lambert, Self::Phong, Self::Lambert2d, Self::Phong2d];

    /// The lobe itself.
    #[must_use]
    pub fn lobe(self) -> &'static dyn Lobe {
        match self {
            Self::Lambert => &lambert::Lambert,
            Self::Phong => &phong::Phong,
            Self::Lambert2d => &lambert::Lambert2d,
            Self::Phong2d => &phong::Phong2d,
        }
    }

    /// Its name in model specifications and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.lobe().name()
    }

    /// Whether it belongs to the flat world.
    #[must_use]
    pub fn is_flat(self) -> bool {
        matches!(self, Self::Lambert2d | Self::Phong2d)
    }

    /// The lobe in the flat world that corresponds to it.
    #[must_use]
    pub fn flat_twin(self) -> Self {
        match self {
            Self::Lambert | Self::Lambert2d => Self::Lambert2d,
            Self::Phong | Self::Phong2d => Self::Phong2d,
        }
    }

    /// One line for the user.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Lambert => "diffuse: weight/π",
            Self::Phong => "glossy, reciprocal, normalised: weight·(n+2)/(2π)·(r·wo)ⁿ",
            Self::Lambert2d => "diffuse in the flat world: weight/2",
            Self::Phong2d => "glossy in the flat world: weight·Γ((n+3)/2)/(√π·Γ((n+2)/2))·cosⁿα",
        }
    }

    /// The kind with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// Whether both directions are above the horizon.
#[must_use]
pub fn above_horizon(wi: DVec3, wo: DVec3) -> bool {
    wi.z > 0.0 && wo.z > 0.0
}

/// ln cosα, α the angle between the mirror image r of `wi` and `wo`; −∞ where r·wo ≤ 0.
///
/// For unit vectors 1 − cosα = |r − wo|²/2, so near the peak ln1p(−|r − wo|²/2) keeps the digits that ln(r·wo) loses.
#[must_use]
pub fn ln_cos_alpha(wi: DVec3, wo: DVec3) -> f64 {
    let r = crate::geometry::mirror(wi);
    let squared = (r - wo).length_squared();
    if squared <= 1.0 {
        return f64::ln_1p(-0.5 * squared);
    }
    if cos_alpha(wi, wo) < -1e-9 {
        return f64::NEG_INFINITY;
    }
    let cosine = dot_compensated(r, wo);
    if cosine > 0.0 {
        cosine.ln()
    } else if cosine <= 0.0 {
        f64::NEG_INFINITY
    } else {
        cosine
    }
}
