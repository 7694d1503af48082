//! Parallelograms.

use glam::DVec3;

use super::super::ray::{Ray, SurfacePoint, gamma};

/// The points center + a·u + b·v with a, b in [−1, 1], lit on the side of u × v.
#[derive(Debug, Clone, Copy)]
pub struct Quad {
    /// Centre, m.
    pub center: DVec3,
    /// First half-edge, m.
    pub u: DVec3,
    /// Second half-edge, m.
    pub v: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Area, m².
    pub area: f64,
    to_a: DVec3,
    to_b: DVec3,
    error: f64,
}

impl Quad {
    /// The parallelogram of these half-edges, which are not parallel.
    pub fn new(center: DVec3, u: DVec3, v: DVec3) -> Self {
        let cross = u.cross(v);
        let normal = cross.normalize();
        // a and b of a point: dot products with the dual basis of (u, v).
        let (u_dual, v_dual) = (v.cross(normal), normal.cross(u));
        let (to_a, to_b) = (u_dual / u_dual.dot(u), v_dual / v_dual.dot(v));
        // Also covers what a later ray's own intersection rounds off, so that a ray leaving the quad does not find it again.
        let error = gamma(32) * (center.abs() + u.abs() + v.abs()).max_element();
        Self { center, u, v, normal, area: 4.0 * cross.length(), to_a, to_b, error }
    }

    /// The vectors whose dot products with p − center are a and b.
    pub fn dual(&self) -> (DVec3, DVec3) {
        (self.to_a, self.to_b)
    }

    /// Bound on what a computed point of it is off by, m.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Where in (0, `t_max`) the ray meets the quad: (t, a, b).
    pub fn hit(&self, ray: &Ray, t_max: f64) -> Option<(f64, f64, f64)> {
        let f = self.center - ray.origin;
        let t = f.dot(self.normal) / ray.direction.dot(self.normal);
        if !(t > 0.0 && t < t_max) {
            return None;
        }
        let p = t * ray.direction - f;
        let (a, b) = (p.dot(self.to_a), p.dot(self.to_b));
        (a.abs() <= 1.0 && b.abs() <= 1.0).then_some((t, a, b))
    }

    /// The point with the coordinates a and b.
    pub fn surface(&self, a: f64, b: f64) -> SurfacePoint {
        let position = self.center + a * self.u + b * self.v;
        SurfacePoint { position, error: DVec3::splat(self.error), normal: self.normal }
    }
}
