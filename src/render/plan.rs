//! The plan of effects: what a scene calls for, found from the scene.

use super::lights::Environment;
use super::material::Material;
use super::packet::{FlatScene, MOST_CLOSED};
use super::scene::Scene;
use super::surroundings::Surroundings;
use crate::control::{self, counted};

/// What is computed for a scene. What is off is proved not to matter: the picture is that of [`Plan::FULL`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools)] // each is a switch of its own
pub struct Plan {
    /// Something may stand between a surface and a light.
    pub shadows: bool,
    /// Light may go from one surface to another.
    pub interreflection: bool,
    /// Rays may run into lights or the environment whose light is not known otherwise.
    pub chance: bool,
    /// Light that nothing can hide is integrated in closed form, where there is one. Without them, `chance` must be on where lights have a surface.
    pub closed_forms: bool,
    /// Paths are followed side by side, on the vector units.
    pub packets: bool,
}

impl Plan {
    /// Everything, one path at a time, whatever the scene: what every other plan is checked against.
    pub const FULL: Self =
        Self { shadows: true, interreflection: true, chance: true, closed_forms: false, packets: false };

    /// What the scene calls for.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let surroundings = Surroundings::of(scene);
        let lit = !scene.lights.is_empty() || scene.environment.is_some();
        // Of meshes, and of many shapes, nothing is known.
        let (shadows, interreflection) = surroundings
            .map_or((lit, true), |all| (all.casts_shadows(scene.environment.is_some()), all.may_interreflect()));
        let interreflection = scene.max_bounces > 1 && interreflection;
        match FlatScene::of(scene) {
            Some(flat) => Self {
                shadows,
                interreflection,
                chance: flat.must_find_light(),
                closed_forms: flat.closed_lights() > 0 || flat.closed_environment(),
                packets: true,
            },
            None => {
                Self { shadows, interreflection, chance: scene.rays_find_light(), closed_forms: false, packets: false }
            }
        }
    }

    /// Scattering events of a path at most, where the scene allows `most`.
    pub(super) fn events(self, most: u32) -> u32 {
        if self.interreflection { most } else { most.min(1) }
    }

    /// The plan in words: what is on, what is off, and why.
    #[must_use]
    pub fn effects(self, scene: &Scene) -> control::Plan {
        let mut plan = control::Plan::default();
        let flat = FlatScene::of(scene);
        let counts = |n: usize, what: &str| if n == 0 { "there is none".into() } else { counted(n as u64, what) };
        let area = scene.lights.iter().filter(|light| light.has_surface()).count();
        let points = scene.lights.len() - area;
        let glossy = scene.materials.iter().filter(|m| is_glossy(m)).count();
        let lens = scene.camera.lens_radius;
        plan.push(SHADOWS, self.shadows, self.why_shadows(scene));
        plan.push(INTERREFLECTION, self.interreflection, self.why_interreflection(scene));
        plan.push(POINT_LIGHTS, points > 0, counts(points, "light"));
        plan.push(AREA_LIGHTS, area > 0, counts(area, "light"));
        plan.push(ENVIRONMENT, scene.environment.is_some(), why_environment(scene));
        plan.push(GLOSSY, glossy > 0, counts(glossy, "material"));
        let pinhole = "the camera is a pinhole".to_owned();
        plan.push(LENS, lens > 0.0, if lens > 0.0 { format!("radius {lens} m") } else { pinhole });
        plan.push("light met by chance", self.chance, self.why_chance(scene));
        plan.push("closed forms", self.closed_forms, why_closed_forms(scene, flat.as_ref()));
        plan.push("packets", self.packets, self.why_packets());
        plan
    }

    fn why_shadows(self, scene: &Scene) -> String {
        if self.shadows {
            return format!(
                "{} may stand between lights and surfaces",
                counted(scene.geometry.shapes() as u64, "shape")
            );
        }
        "nothing can stand between a surface and a light".into()
    }

    fn why_interreflection(self, scene: &Scene) -> String {
        if self.interreflection {
            return format!("surfaces see each other; paths of at most {} scattering events", scene.max_bounces);
        }
        let convex = "one convex surface sees nothing of itself";
        match scene.max_bounces {
            0 => "the scene asks for no scattering event".into(),
            1 => "the scene asks for one scattering event".into(),
            _ => convex.into(),
        }
    }

    fn why_chance(self, scene: &Scene) -> &'static str {
        if self.chance {
            "rays find lights too, weighed against aiming at them"
        } else if scene.rays_find_light() {
            "closed forms give all of it"
        } else {
            "nothing that shines has a surface"
        }
    }

    fn why_packets(self) -> &'static str {
        if self.packets {
            "spheres, planes and quads with sums of lobes: sixteen paths side by side"
        } else {
            "meshes, tables, pictures of light, spots or shining spheres: one path at a time"
        }
    }
}

fn why_environment(scene: &Scene) -> &'static str {
    match &scene.environment {
        None => "there is none",
        Some(Environment::Constant(_)) => "even",
        Some(Environment::Image(_)) => "a picture, sampled by its light times the cosine",
    }
}

fn why_closed_forms(scene: &Scene, flat: Option<&FlatScene<'_>>) -> String {
    match flat.map_or((0, false), |f| (f.closed_lights(), f.closed_environment())) {
        (0, true) => "one convex body in an even environment shows its directional albedo".into(),
        (0, false) if !scene.rays_find_light() => "there is no light to integrate over".into(),
        (0, false) if flat.is_none() => "paths that are followed one at a time have none".into(),
        (0, false) => "lights may be hidden in part, or lobes are sharp".into(),
        (n, _) => format!(
            "nothing can hide {}: no samples of it but of materials with lobes sharper than n = {MOST_CLOSED}",
            counted(n as u64, "quad light")
        ),
    }
}

// Names of effects that a scene can be shown without.

/// Lights hidden from surfaces.
pub const SHADOWS: &str = "shadows";
/// Light that goes from one surface to another.
pub const INTERREFLECTION: &str = "interreflection";
/// Lights without a surface.
pub const POINT_LIGHTS: &str = "point lights";
/// Lights with a surface.
pub const AREA_LIGHTS: &str = "area lights";
/// Light from all around.
pub const ENVIRONMENT: &str = "environment";
/// What materials reflect beyond their Lambert lobes.
pub const GLOSSY: &str = "glossy lobes";
/// The lens's depth of field.
pub const LENS: &str = "lens";

fn is_glossy(material: &Material) -> bool {
    match material {
        Material::Black => false,
        Material::PhongEquation(equation) => equation.specular.max_element() > 0.0,
        Material::Brdf(brdf) => brdf.lobes().is_none_or(|lobes| lobes.parts().2.next().is_some()),
    }
}
