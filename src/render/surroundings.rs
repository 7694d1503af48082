//! What may stand between the surfaces of a scene and a light: known before any ray is followed, so that no ray asks the rest.

use glam::DVec3;

use super::lights::Light;
use super::material::Material;
use super::scene::Scene;
use super::shapes::{Owner, Piece, Plane, Quad, Sphere};

/// Shapes that a scene may have: each would be asked about all others, and a packet's rays ask all of them.
const MOST_SHAPES: usize = 48;

/// Shapes that may hide a light from a surface.
#[derive(Debug, Clone, Default)]
pub(super) struct Occluders {
    pub spheres: Vec<Sphere>,
    pub pieces: Vec<Piece>,
}

/// A scene of spheres, planes and quads: what reflects, and what may stand in the way.
#[derive(Debug)]
pub(super) struct Surroundings {
    pub(super) spheres: Vec<(Sphere, Owner)>,
    pub(super) pieces: Vec<(Piece, Owner)>,
    /// How many of the shapes reflect.
    pub(super) surfaces: usize,
    /// What may hide each light from a surface.
    pub(super) before_lights: Vec<Occluders>,
    /// What may hide the environment.
    pub(super) before_environment: Occluders,
}

impl Surroundings {
    /// Those of a scene; `None` of one with meshes, and of more than [`MOST_SHAPES`].
    pub fn of(scene: &Scene) -> Option<Self> {
        let (spheres, planes, quads) = scene.geometry.analytic()?;
        if scene.geometry.shapes() > MOST_SHAPES {
            return None;
        }
        let reflects = |owner: &Owner| match owner {
            Owner::Material(i) => !matches!(scene.materials[*i], Material::Black),
            Owner::Light { .. } => false,
        };
        let balls = spheres.iter().filter(|s| reflects(&s.1)).map(|s| Extent::Ball(s.0));
        let endless = planes.iter().filter(|p| reflects(&p.1)).map(|p| Extent::Endless(p.0));
        let corners = quads.iter().filter(|q| reflects(&q.1)).map(|q| Extent::of_quad(&q.0));
        let surfaces: Vec<Extent> = balls.chain(endless).chain(corners).collect();
        let planes = planes.iter().map(|(plane, owner)| (Piece::of_plane(plane), *owner));
        let quads = quads.iter().map(|(quad, owner)| (Piece::of_quad(quad), *owner));
        let pieces: Vec<(Piece, Owner)> = quads.chain(planes).collect();
        let all =
            Occluders { spheres: spheres.iter().map(|s| s.0).collect(), pieces: pieces.iter().map(|p| p.0).collect() };
        Some(Self {
            spheres: spheres.to_vec(),
            before_lights: scene.lights.iter().map(|light| Occluders::of(light, &all, &surfaces)).collect(),
            before_environment: if spheres.len() + pieces.len() <= 1 { Occluders::default() } else { all },
            pieces,
            surfaces: surfaces.len(),
        })
    }

    /// Whether more than one shape reflects. All are convex, so that one alone sees nothing of itself.
    pub fn may_interreflect(&self) -> bool {
        self.surfaces > 1
    }

    /// Whether anything may stand between a surface and a light or the `environment`, where there is one.
    pub fn casts_shadows(&self, environment: bool) -> bool {
        let hides = |occluders: &Occluders| !occluders.is_empty();
        self.surfaces > 0 && (self.before_lights.iter().any(hides) || environment && hides(&self.before_environment))
    }
}

/// How far a shape reaches, for signed distances from planes.
#[derive(Debug, Clone, Copy)]
enum Extent {
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
        Light::Spot(light) => {
            let d = (light.position - point).dot(normal);
            (d, d)
        }
        Light::Sphere(light) => Extent::Ball(light.sphere).distances(point, normal),
        Light::Mesh(_) => return true,
    };
    let above = low >= -slack && light_low >= -light_slack;
    let below = high <= slack && light_high <= light_slack;
    !(above || below)
}

impl Occluders {
    /// Those of a light, out of all shapes of a scene; `surfaces` are those that reflect.
    fn of(light: &Light, all: &Self, surfaces: &[Extent]) -> Self {
        let pieces = all.pieces.iter().filter(|piece| may_hide(piece, surfaces, light)).copied().collect();
        // A ball hides nothing from the points of its own that face the light, and a shining one nothing of itself.
        let shines = |ball: &Sphere| matches!(light, Light::Sphere(own) if own.sphere == *ball);
        let others =
            |ball: &&Sphere| !shines(ball) && surfaces.iter().any(|s| !matches!(s, Extent::Ball(b) if b == *ball));
        Self { spheres: all.spheres.iter().filter(others).copied().collect(), pieces }
    }

    /// Whether there is none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.spheres.is_empty() && self.pieces.is_empty()
    }
}
