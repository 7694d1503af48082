//! Rays, and how they leave a surface without finding it again.

use glam::DVec3;

/// The points origin + t·direction for t in (0, `t_max`).
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Start, m.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// End, m; may be infinite.
    pub t_max: f64,
}

impl Ray {
    /// The ray from `origin` along the unit vector `direction` without an end.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_max: f64::INFINITY }
    }

    /// The segment between two points that differ.
    pub fn between(origin: DVec3, end: DVec3) -> Option<Self> {
        let to = end - origin;
        let distance = to.length();
        let direction = to / distance;
        direction.is_finite().then_some(Self { origin, direction, t_max: distance })
    }

    /// The point at t.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

/// Bound n·u/(1 − n·u) on the relative error of n rounded operations, u = 2⁻⁵³ (Higham 2002, lemma 3.1).
pub fn gamma(n: u32) -> f64 {
    let nu = f64::from(n) * 0.5 * f64::EPSILON;
    nu / (1.0 - nu)
}

/// A computed point of a surface: it lies within `error` of the true surface, coordinate by coordinate.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// The point, m.
    pub position: DVec3,
    /// Bound on its distance from the surface along each axis, m.
    pub error: DVec3,
    /// Unit normal of the surface.
    pub normal: DVec3,
}

impl SurfacePoint {
    /// The nearest start on the normal's side that is certainly off the surface: shifted along the normal by the error bound,
    /// then rounded outward (Pharr, Jakob, Humphreys 2023, section 6.8.6). Its scale is that of the coordinates.
    pub fn above(&self) -> DVec3 {
        let shift = self.normal.abs().dot(self.error) * self.normal;
        let round = |x: f64, towards: f64| match towards {
            t if t > 0.0 => x.next_up(),
            t if t < 0.0 => x.next_down(),
            _ => x,
        };
        let p = self.position + shift;
        DVec3::new(round(p.x, shift.x), round(p.y, shift.y), round(p.z, shift.z))
    }
}
