//! The quantities of the flat world.

use std::f64::consts::PI;

use crate::radiometry::quantity::{Flux, Length, product, quantity, quotient, relate};

quantity!(
    /// Size of a set of directions: the length of an arc of the unit circle.
    Angle, "rad");
quantity!(
    /// Projected angle ∫ cosθ dθ: the size of a set of directions, projected onto the surface.
    ProjectedAngle, "rad (projected)");
quantity!(
    /// Radiant intensity I(ω) = dΦ/dω of a point source.
    Intensity, "W/rad");
quantity!(
    /// Irradiance H = dΦ/dx: flux that arrives per length.
    Irradiance, "W/m");
quantity!(
    /// Radiance L(p, d) = d²Φ/(dx⊥ dω): flux per angle and per length seen face-on.
    Radiance, "W/(rad·m)");
quantity!(
    /// Radiant exitance E = dΦ/dx: flux that leaves per length.
    Exitance, "W/m");
quantity!(
    /// Value of a BRDF ρ(θi, θo): radiance that leaves along θo per irradiance that arrives from a small arc round θi.
    BrdfValue, "1/rad");

relate! {
    Intensity, Angle => Flux;
    Irradiance, Length => Flux;
    Radiance, Length => Intensity;
    Radiance, ProjectedAngle => Irradiance;
    BrdfValue, Irradiance => Radiance;
}
product!(Exitance, Length => Flux);
quotient!(Flux, Exitance => Length);
product!(BrdfValue, ProjectedAngle => f64);

impl Angle {
    /// All directions, 2π rad.
    pub const CIRCLE: Self = Self::new(2.0 * PI);
    /// The directions above a surface, π rad.
    pub const HALF_CIRCLE: Self = Self::new(PI);

    /// This (small) angle projected onto a surface that sees it under the cosine `cos_theta`; 0 below the horizon.
    #[must_use]
    pub fn projected(self, cos_theta: f64) -> ProjectedAngle {
        ProjectedAngle::new(self.value() * cos_theta.clamp(0.0, f64::INFINITY))
    }
}

impl ProjectedAngle {
    /// All directions above a surface: ∫ cosθ dθ = 2.
    pub const HALF_CIRCLE: Self = Self::new(2.0);
}

impl Exitance {
    /// The flux that leaves, per length.
    #[must_use]
    pub fn of(leaving: Flux, length: Length) -> Self {
        Self::new(leaving.value() / length.value())
    }
}

impl std::ops::Div<Irradiance> for Exitance {
    /// The share of the arriving light that leaves: the albedo.
    type Output = f64;
    fn div(self, arriving: Irradiance) -> f64 {
        self.value() / arriving.value()
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // exact results are compared exactly
mod tests {
    use super::*;

    #[test]
    fn products_and_quotients_invert_each_other() {
        let (radiance, length) = (Radiance::new(3.0), Length::new(0.5));
        assert_eq!(radiance * length * Angle::new(2.0) / length, Irradiance::new(6.0));
        assert_eq!(radiance * Angle::new(2.0).projected(0.5) / radiance, ProjectedAngle::new(1.0));
        assert_eq!(BrdfValue::new(0.5) * Irradiance::new(6.0), radiance);
        assert_eq!(Exitance::of(Flux::new(2.0), length) / Irradiance::new(8.0), 0.5);
        assert_eq!(BrdfValue::new(0.5) * ProjectedAngle::HALF_CIRCLE, 1.0);
        assert_eq!(radiance.to_string(), "3 W/(rad·m)");
    }
}
