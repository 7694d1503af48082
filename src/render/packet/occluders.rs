//! What may stand between the surfaces of a scene and a light: known before any ray is followed, so that no ray asks the rest.

use glam::DVec3;

use super::super::lights::Light;
use super::super::shapes::{Plane, Quad, Sphere};
use super::flat::Piece;

/// Shapes that may hide a light from a surface.
#[derive(Debug, Clone, Default)]
pub(super) struct Occluders {
    pub spheres: Vec<Sphere>,
    pub pieces: Vec<Piece>,
}

/// How far a shape reaches, for signed distances from planes.
#[derive(Debug, Clone, Copy)]
pub(super) enum Extent {
    Ball(Sphere),
    Corners([DVec3; 4]),
    Endless(Plane),
}

impl Extent {
    /// Of a quad.
    pub fn of_quad(quad: &Quad) -> Self {
        let corner = |a: f64, b: f64| quad.center + a * quad.u + b * quad.v;
        Self::Corners([corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)])
    }

    /// Least and largest signed distance from the plane through `point`, m.
    fn distances(&self, point: DVec3, normal: DVec3) -> (f64, f64) {
        match self {
            Self::Ball(sphere) => {
                let d = (sphere.center - point).dot(normal);
                (d - sphere.radius, d + sphere.radius)
            }
            Self::Corners(corners) => {
                let d = corners.map(|c| (c - point).dot(normal));
                d.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), d| (low.min(*d), high.max(*d)))
            }
            Self::Endless(plane) if plane.normal.cross(normal) == DVec3::ZERO => {
                let d = (plane.point - point).dot(normal);
                (d, d)
            }
            Self::Endless(_) => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }
}

/// Relative distance that counts as none: coordinates that were meant to be equal may differ by their rounding.
const ROUNDING: f64 = 1e-12;

/// Whether a flat piece may hide the light from any of the surfaces: not where all of them and the light lie on one side of its plane, nor where it is
/// the light itself, which shines away from its own plane.
fn may_hide(piece: &Piece, surfaces: &[Extent], light: &Light) -> bool {
    let (point, normal) = (piece.point, piece.normal);
    let slack = ROUNDING * piece.reach;
    let surfaces = surfaces.iter().map(|s| s.distances(point, normal));
    let (low, high) = surfaces.fold((0.0f64, 0.0f64), |(l, h), (low, high)| (l.min(low), h.max(high)));
    // Lengths for places, a sine for a direction.
    let mut light_slack = slack;
    let (light_low, light_high) = match light {
        Light::Point { position, .. } => {
            let d = (*position - point).dot(normal);
            (d, d)
        }
        Light::Directional { toward, .. } => {
            light_slack = ROUNDING;
            let d = toward.dot(normal);
            (d, d)
        }
        Light::Quad(light) => {
            let quad = light.quad();
            if quad.center == point && quad.normal == normal {
                return false;
            }
            Extent::of_quad(quad).distances(point, normal)
        }
        Light::Spot(_) | Light::Sphere(_) | Light::Mesh(_) => return true,
    };
    let above = low >= -slack && light_low >= -light_slack;
    let below = high <= slack && light_high <= light_slack;
    !(above || below)
}

impl Occluders {
    /// Those of a light, out of all shapes of a scene; `surfaces` are those that reflect.
    pub fn of(light: &Light, all: &Self, surfaces: &[Extent]) -> Self {
        let pieces = all.pieces.iter().filter(|piece| may_hide(piece, surfaces, light)).copied().collect();
        // A ball hides nothing from the points of its own that face the light.
        let others = |ball: &&Sphere| surfaces.iter().any(|s| !matches!(s, Extent::Ball(b) if b == *ball));
        Self { spheres: all.spheres.iter().filter(others).copied().collect(), pieces }
    }

    /// Whether there is none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.spheres.is_empty() && self.pieces.is_empty()
    }
}
