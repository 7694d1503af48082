//! Infinite planes.

use glam::DVec3;

use super::super::ray::{Ray, SurfacePoint, gamma};

/// An infinite plane, lit on the side of its normal.
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    /// A point on it, m.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
}

impl Plane {
    /// The t in (0, `t_max`) at which the ray meets the plane.
    pub fn hit(&self, ray: &Ray, t_max: f64) -> Option<f64> {
        let t = (self.point - ray.origin).dot(self.normal) / ray.direction.dot(self.normal);
        (t > 0.0 && t < t_max).then_some(t)
    }

    /// The point of the plane nearest to `p`, which lies close to it. The error bound also covers what a later ray's own
    /// intersection with this plane rounds off, so that ray does not find it again.
    pub fn surface(&self, p: DVec3) -> SurfacePoint {
        let position = p - (p - self.point).dot(self.normal) * self.normal;
        let reach = position.abs().max_element() + self.point.abs().max_element();
        SurfacePoint { position, error: DVec3::splat(gamma(32) * reach), normal: self.normal }
    }
}
