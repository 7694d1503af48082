//! A scene as packets walk through it: a list of spheres and of flat pieces, materials that are sums of lobes, lights.

use glam::DVec3;

use super::super::lights::{Environment, Light, QuadLight};
use super::super::material::Material;
use super::super::scene::Scene;
use super::super::shapes::{Owner, Piece, Sphere};
use super::super::surroundings::{Occluders, Surroundings};
use super::surround::Surround;

/// Materials that a scene may have: every ray asks all of them, as it asks all shapes.
const MOST_MATERIALS: usize = 16;
/// Phong lobes of one material.
pub(super) const MOST_LOBES: usize = 3;
/// Up to this exponent a Phong lobe's light of a quad that nothing can hide is integrated: sharper lobes find it more cheaply by their own samples.
pub(in crate::render) const MOST_CLOSED: f64 = 1000.0;

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

impl Lobes {
    /// Whether what it reflects of a quad that nothing hides has a closed form, for each of its lobes.
    pub fn is_closed(&self) -> bool {
        self.phong.iter().all(|(_, n, _)| *n <= MOST_CLOSED)
    }
}

/// The scene.
#[derive(Debug)]
pub(in crate::render) struct FlatScene<'a> {
    pub(super) spheres: Vec<(Sphere, OwnerNumber)>,
    pub(super) pieces: Vec<(Piece, OwnerNumber)>,
    pub(super) materials: Vec<Lobes>,
    pub(super) lights: &'a [Light],
    pub(super) environment: Option<DVec3>,
    /// What may hide each light from a surface.
    pub(super) before_lights: Vec<Occluders>,
    /// What may hide the environment.
    pub(super) before_environment: Occluders,
    pub(super) max_bounces: u32,
    /// Which quads nothing can hide, so that what most materials reflect of them has a closed form.
    pub(super) closed: Vec<bool>,
    /// How many of the shapes reflect.
    surfaces: usize,
    /// Phong lobes of the material that has most.
    pub(super) lobes: usize,
}

impl<'a> FlatScene<'a> {
    /// The scene, where packets can walk through it: no meshes, no tables, no shading rules, no lights but points,
    /// parallel light, quads and an even environment, not too many shapes.
    pub fn of(scene: &'a Scene) -> Option<Self> {
        let surroundings = Surroundings::of(scene)?;
        let environment = match scene.environment {
            None => None,
            Some(Environment::Constant(radiance)) => Some(radiance),
            Some(Environment::Image(_)) => return None,
        };
        if scene.lights.iter().any(|light| matches!(light, Light::Spot(_) | Light::Sphere(_) | Light::Mesh(_))) {
            return None;
        }
        let materials: Vec<Lobes> = scene.materials.iter().map(lobes).collect::<Option<_>>()?;
        let Surroundings { spheres, pieces, surfaces, before_lights, before_environment } = surroundings;
        if materials.len() > MOST_MATERIALS {
            return None;
        }
        let spheres: Vec<_> = spheres.into_iter().map(|(sphere, owner)| (sphere, number(owner))).collect();
        let pieces: Vec<_> = pieces.into_iter().map(|(piece, owner)| (piece, number(owner))).collect();
        let most = materials.iter().map(|m| m.phong.len()).max().unwrap_or(0);
        let free = |(light, before): (&Light, &Occluders)| matches!(light, Light::Quad(_)) && before.is_empty();
        let closed = scene.lights.iter().zip(&before_lights).map(free).collect();
        Some(Self {
            before_lights,
            before_environment,
            spheres,
            pieces,
            lobes: most,
            materials,
            lights: &scene.lights,
            environment,
            max_bounces: scene.max_bounces,
            closed,
            surfaces,
        })
    }

    /// Number of quads that nothing can hide, where what a surface reflects of them has a closed form.
    pub fn closed_lights(&self) -> usize {
        let some = self.used().any(|material| !material.black && material.is_closed());
        if some { self.closed.iter().filter(|closed| **closed).count() } else { 0 }
    }

    /// Materials of shapes.
    fn used(&self) -> impl Iterator<Item = &Lobes> {
        let owners = self.spheres.iter().map(|s| s.1).chain(self.pieces.iter().map(|p| p.1));
        owners.filter(|owner| *owner >= 0.0).filter_map(|owner| self.materials.get(owner as usize))
    }

    /// Whether what the environment sends has a closed form: it is even, and there is nothing but one body.
    pub fn closed_environment(&self) -> bool {
        self.environment.is_some() && self.surfaces == 1 && self.spheres.len() + self.pieces.len() == 1
    }

    /// Whether rays must look for light that no closed form gives.
    pub fn must_find_light(&self) -> bool {
        let sampled = !self.used().all(Lobes::is_closed);
        let open = self.shining().any(|(k, _)| sampled || !self.closed[k]);
        open || self.environment.is_some() && !self.closed_environment()
    }

    /// What the only material there is shows in an even environment.
    pub(super) fn surround(&self) -> Option<Surround> {
        let owner = self.spheres.first().map(|s| s.1).or(self.pieces.first().map(|p| p.1))?;
        let material = self.materials.get(owner as usize).filter(|_| owner >= 0.0 && self.closed_environment())?;
        Some(Surround::new(material))
    }

    /// Whether a surface of this owner, a material, has Phong lobes.
    #[inline(always)]
    pub(super) fn is_glossy(&self, owner: OwnerNumber) -> bool {
        self.materials.get(owner as usize).is_some_and(|material| !material.phong.is_empty())
    }

    /// The lights that have a surface, with their indices.
    pub(super) fn shining(&self) -> impl Iterator<Item = (usize, &'a QuadLight)> {
        self.lights.iter().enumerate().filter_map(|(i, light)| match light {
            Light::Quad(quad) => Some((i, quad)),
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

pub(super) fn light_number(light: usize) -> OwnerNumber {
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
