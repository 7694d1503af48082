//! Flat pieces: planes and parallelograms as one kind.

use glam::DVec3;

use super::{Plane, Quad};

/// A plane, or the piece of it with |a|, |b| ≤ 1 where the coordinates of p are `to_a`·(p − point), `to_b`·(p − point).
#[derive(Debug, Clone, Copy)]
pub struct Piece {
    /// A point on it, a quad's centre, m.
    pub point: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// 0 for all of a plane, 1/m.
    pub to_a: DVec3,
    /// The same for b.
    pub to_b: DVec3,
    /// The largest coordinate of its own, m: what a computed point on it is off by grows with that.
    pub reach: f64,
}

impl Piece {
    /// All of a plane.
    pub fn of_plane(plane: &Plane) -> Self {
        let reach = plane.point.abs().max_element();
        Self { point: plane.point, normal: plane.normal, to_a: DVec3::ZERO, to_b: DVec3::ZERO, reach }
    }

    /// A quad.
    pub fn of_quad(quad: &Quad) -> Self {
        let (to_a, to_b) = quad.dual();
        let reach = (quad.center.abs() + quad.u.abs() + quad.v.abs()).max_element();
        Self { point: quad.center, normal: quad.normal, to_a, to_b, reach }
    }
}
