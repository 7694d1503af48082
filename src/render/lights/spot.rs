//! Spot lights: a point that shines into a cone.

use glam::{DVec2, DVec3};

use super::super::ray::{Ray, SurfacePoint};
use super::Arrival;
use crate::geometry::angles::angle_between;

/// Radiant intensity I₀·S((θ_outer − θ)/(θ_outer − θ_inner)) at the angle θ from the axis, S(x) = x²(3 − 2x) for x in [0, 1], 0 below and 1
/// above: I₀ within the inner angle, 0 beyond the outer one, and smooth between. With equal angles the edge is sharp.
#[derive(Debug, Clone, Copy)]
pub struct SpotLight {
    /// Where, m.
    pub position: DVec3,
    /// Unit direction of the cone's axis, away from the light.
    pub axis: DVec3,
    /// I₀, W/sr.
    pub intensity: DVec3,
    /// Angle from the axis up to which the intensity is whole, rad, 0 to `outer`.
    pub inner: f64,
    /// Angle from the axis beyond which there is none, rad, at most π.
    pub outer: f64,
}

impl SpotLight {
    /// Light that arrives at a point; `None` outside of the cone.
    pub fn sample(&self, at: &SurfacePoint, _u: DVec2) -> Option<Arrival> {
        let shadow = Ray::between(at.above(), self.position)?;
        let wi = shadow.direction;
        let share = self.share(-wi);
        let irradiance = share * self.intensity / (self.position - at.position).length_squared();
        (share > 0.0).then_some(Arrival { wi, irradiance, pdf: None, shadow })
    }

    /// The segment from a point inside of the cone.
    pub fn segment(&self, at: &SurfacePoint) -> Option<Ray> {
        Ray::between(at.above(), self.position).filter(|ray| self.share(-ray.direction) > 0.0)
    }

    /// Share of the intensity that leaves in a unit direction, 0 to 1.
    fn share(&self, direction: DVec3) -> f64 {
        let angle = angle_between(self.axis, direction);
        if angle <= self.inner {
            return 1.0;
        }
        if angle >= self.outer {
            return 0.0;
        }
        let x = (self.outer - angle) / (self.outer - self.inner);
        x * x * (3.0 - 2.0 * x)
    }
}
