//! A scene as packets walk through it: a list of spheres and of flat pieces, materials that are sums of lobes, lights.

use glam::DVec3;

use super::super::lights::{Environment, Light, QuadLight};
use super::super::material::Material;
use super::super::scene::Scene;
use super::super::shapes::{Owner, Sphere};

/// Shapes and materials that a scene may have: every ray asks all of them.
const MOST_SHAPES: usize = 48;
const MOST_MATERIALS: usize = 16;
/// Phong lobes of one material.
pub(super) const MOST_LOBES: usize = 3;

/// A plane, or the piece of it with |a|, |b| ≤ 1 where the coordinates of p are `to_a`·(p − point), `to_b`·(p − point).
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub point: DVec3,
    pub normal: DVec3,
    pub to_a: DVec3,
    pub to_b: DVec3,
    /// The largest coordinate of its own, m: what a computed point on it is off by grows with that.
    pub reach: f64,
}

/// Whose a shape is: a material's index, or −1 less a light's.
pub(super) type OwnerNumber = f64;

/// A sum of lobes.
#[derive(Debug, Clone, Default)]
pub(super) struct Lobes {
    pub diffuse: DVec3,
    /// Probability of drawing from the diffuse lobe.
    pub diffuse_share: f64,
    /// Weight, exponent and probability of each Phong lobe.
    pub phong: Vec<(DVec3, f64, f64)>,
    pub black: bool,
}

/// The scene.
#[derive(Debug)]
pub(in crate::render) struct FlatScene<'a> {
    pub(super) spheres: Vec<(Sphere, OwnerNumber)>,
    pub(super) pieces: Vec<(Piece, OwnerNumber)>,
    pub(super) materials: Vec<Lobes>,
    pub(super) lights: &'a [Light],
    pub(super) environment: Option<DVec3>,
    pub(super) max_bounces: u32,
    /// Whether a ray can find light at all.
    pub(super) rays_find_light: bool,
    /// Phong lobes of the material that has most.
    pub(super) lobes: usize,
}

impl<'a> FlatScene<'a> {
    /// The scene, where packets can walk through it: no meshes, no tables, no shading rules, no lights but points,
    /// parallel light, quads and an even environment, not too many shapes.
    pub fn of(scene: &'a Scene) -> Option<Self> {
        let (spheres, planes, quads) = scene.geometry.analytic()?;
        let environment = match scene.environment {
            None => None,
            Some(Environment::Constant(radiance)) => Some(radiance),
            Some(Environment::Image(_)) => return None,
        };
        if scene.lights.iter().any(|light| matches!(light, Light::Spot(_) | Light::Sphere(_) | Light::Mesh(_))) {
            return None;
        }
        let materials: Vec<Lobes> = scene.materials.iter().map(lobes).collect::<Option<_>>()?;
        if spheres.len() + planes.len() + quads.len() > MOST_SHAPES || materials.len() > MOST_MATERIALS {
            return None;
        }
        let spheres = spheres.iter().map(|(sphere, owner)| (*sphere, number(*owner))).collect();
        let planes = planes.iter().map(|(plane, owner)| {
            let reach = plane.point.abs().max_element();
            (Piece { point: plane.point, normal: plane.normal, to_a: DVec3::ZERO, to_b: DVec3::ZERO, reach }, *owner)
        });
        let quads = quads.iter().map(|(quad, owner)| {
            let (to_a, to_b) = quad.dual();
            let reach = (quad.center.abs() + quad.u.abs() + quad.v.abs()).max_element();
            (Piece { point: quad.center, normal: quad.normal, to_a, to_b, reach }, *owner)
        });
        let pieces = planes.chain(quads).map(|(piece, owner)| (piece, number(owner))).collect();
        let most = materials.iter().map(|m| m.phong.len()).max().unwrap_or(0);
        Some(Self {
            spheres,
            pieces,
            lobes: most,
            materials,
            lights: &scene.lights,
            environment,
            max_bounces: scene.max_bounces,
            rays_find_light: scene.rays_find_light(),
        })
    }

    /// Whether a ray from a surface can meet any: with one convex piece that reflects, and no other, none can.
    pub fn sees_itself(&self) -> bool {
        self.spheres.len() + self.pieces.len() > 1
    }

    /// The lights that have a surface, with their owner's number.
    pub(super) fn shining(&self) -> impl Iterator<Item = (OwnerNumber, &'a QuadLight)> {
        self.lights.iter().enumerate().filter_map(|(i, light)| match light {
            Light::Quad(quad) => Some((light_number(i), quad)),
            _ => None,
        })
    }
}

fn number(owner: Owner) -> OwnerNumber {
    match owner {
        Owner::Material(i) => i as f64,
        Owner::Light { light, .. } => light_number(light as usize),
    }
}

fn light_number(light: usize) -> OwnerNumber {
    -1.0 - light as f64
}

fn lobes(material: &Material) -> Option<Lobes> {
    let brdf = match material {
        Material::Black => return Some(Lobes { black: true, diffuse_share: 1.0, ..Lobes::default() }),
        Material::PhongEquation(_) => return None,
        Material::Brdf(brdf) => brdf.lobes()?,
    };
    let rgb = |w: &[f64]| match w {
        [grey] => Some(DVec3::splat(*grey)),
        [r, g, b] => Some(DVec3::new(*r, *g, *b)),
        _ => None,
    };
    let (diffuse, diffuse_share, phong) = brdf.parts();
    let phong: Vec<_> = phong.map(|(w, n, share)| Some((rgb(w)?, n, share))).collect::<Option<_>>()?;
    (phong.len() <= MOST_LOBES).then_some(Lobes { diffuse: rgb(diffuse)?, diffuse_share, phong, black: false })
}
