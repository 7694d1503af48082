//! Spheres.

use glam::DVec3;

use super::super::ray::{Ray, SurfacePoint, gamma};

/// A sphere, lit outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Centre, m.
    pub center: DVec3,
    /// Radius, m, above 0.
    pub radius: f64,
}

impl Sphere {
    /// The nearest t in (0, `t_max`) at which the ray meets the sphere.
    ///
    /// The discriminant is r² − |l|², l the vector from the centre to the ray's closest point, which keeps its digits for small
    /// and distant spheres (Haines, Günther, Akenine-Möller 2019); the roots are q and c/q, never a difference of near equals. A
    /// ray that leaves from outside and points away has no positive root, however close it starts.
    pub fn hit(&self, ray: &Ray, t_max: f64) -> Option<f64> {
        let f = ray.origin - self.center;
        let b = -f.dot(ray.direction);
        let c = f.length_squared() - self.radius * self.radius;
        if c >= 0.0 && b <= 0.0 {
            return None;
        }
        let discriminant = self.radius * self.radius - (f + b * ray.direction).length_squared();
        if discriminant < 0.0 {
            return None;
        }
        let q = b + discriminant.sqrt().copysign(b);
        let (near, far) = if q >= 0.0 { (c / q, q) } else { (q, c / q) };
        let t = if near > 0.0 { near } else { far };
        (t > 0.0 && t < t_max).then_some(t)
    }

    /// The point of the sphere nearest to `p`, which lies close to it.
    pub fn surface(&self, p: DVec3) -> SurfacePoint {
        let normal = (p - self.center).normalize();
        let relative = self.radius * normal;
        let position = self.center + relative;
        SurfacePoint { position, error: gamma(12) * relative.abs() + gamma(2) * position.abs(), normal }
    }
}
