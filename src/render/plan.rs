//! The plan of effects: what a scene calls for, found from the scene.

use super::lights::Environment;
use super::material::Material;
use super::packet::FlatScene;
use super::scene::Scene;
use crate::control::{self, counted};

/// What is computed for a scene. What is off is proved not to matter: the picture is that of [`Plan::FULL`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Something may stand between a surface and a light.
    pub shadows: bool,
    /// Light may go from one surface to another.
    pub interreflection: bool,
    /// Rays may run into lights or the environment whose light is not known otherwise.
    pub chance: bool,
    /// Light that nothing can hide is integrated in closed form, where there is one.
    pub closed_forms: bool,
    /// Paths are followed eight at a time.
    pub packets: bool,
}

impl Plan {
    /// Everything, one path at a time, whatever the scene: what every other plan is checked against.
    pub const FULL: Self =
        Self { shadows: true, interreflection: true, chance: true, closed_forms: false, packets: false };

    /// What the scene calls for.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        match FlatScene::of(scene) {
            Some(flat) => Self::of_flat(scene, &flat),
            None => Self {
                shadows: !scene.lights.is_empty() || scene.environment.is_some(),
                interreflection: scene.max_bounces > 1,
                chance: scene.rays_find_light(),
                closed_forms: false,
                packets: false,
            },
        }
    }

    fn of_flat(scene: &Scene, flat: &FlatScene<'_>) -> Self {
        Self {
            shadows: flat.casts_shadows(),
            interreflection: scene.max_bounces > 1 && flat.may_interreflect(),
            chance: flat.must_find_light(),
            closed_forms: flat.closed_lights() > 0 || flat.closed_environment(),
            packets: true,
        }
    }

    /// Scattering events of a path at most, where the scene allows `most`.
    pub(super) fn events(&self, most: u32) -> u32 {
        if self.interreflection { most } else { most.min(1) }
    }

    /// The plan in words: what is on, what is off, and why.
    #[must_use]
    pub fn effects(&self, scene: &Scene) -> control::Plan {
        let mut plan = control::Plan::default();
        let flat = FlatScene::of(scene);
        let shapes = || counted(scene.geometry.shapes() as u64, "shape");
        let (shadows, interreflection) = match (&flat, self.shadows, self.interreflection) {
            (Some(_), true, _) => (format!("{} may stand between lights and surfaces", shapes()), None),
            (Some(_), false, _) => ("nothing can stand between a surface and a light".into(), None),
            (None, true, _) => (format!("{} may stand between lights and surfaces", shapes()), None),
            (None, false, _) => ("there is no light".into(), Some("there is no light")),
        };
        plan.push(SHADOWS, self.shadows, shadows);
        plan.push(
            INTERREFLECTION,
            self.interreflection,
            match (interreflection, self.interreflection) {
                (Some(why), _) => why.into(),
                (None, true) => {
                    format!("surfaces see each other; paths of at most {} scattering events", scene.max_bounces)
                }
                (None, false) if scene.max_bounces <= 1 => "the scene asks for one scattering event".into(),
                (None, false) => "one convex surface sees nothing of itself".into(),
            },
        );
        let area = scene.lights.iter().filter(|light| light.has_surface()).count();
        let points = scene.lights.len() - area;
        let on = |n: usize, what: &str| if n == 0 { "there is none".into() } else { counted(n as u64, what) };
        plan.push(POINT_LIGHTS, points > 0, on(points, "light"));
        plan.push(AREA_LIGHTS, area > 0, on(area, "light"));
        plan.push(
            ENVIRONMENT,
            scene.environment.is_some(),
            match &scene.environment {
                None => "there is none",
                Some(Environment::Constant(_)) => "even",
                Some(Environment::Image(_)) => "a picture, sampled by its radiance",
            },
        );
        let glossy = scene.materials.iter().filter(|m| is_glossy(m)).count();
        plan.push(GLOSSY, glossy > 0, on(glossy, "material"));
        plan.push(
            LENS,
            scene.camera.lens_radius > 0.0,
            match scene.camera.lens_radius {
                0.0 => "the camera is a pinhole".to_owned(),
                radius => format!("radius {radius} m"),
            },
        );
        plan.push(
            "light met by chance",
            self.chance,
            match (self.chance, area > 0 || scene.environment.is_some()) {
                (true, _) => "rays find lights too, weighed against aiming at them",
                (false, true) => "closed forms give all of it",
                (false, false) => "nothing that shines has a surface",
            },
        );
        let (lights, sky) = flat.as_ref().map_or((0, false), |f| (f.closed_lights(), f.closed_environment()));
        plan.push(
            "closed forms",
            self.closed_forms,
            match (lights, sky) {
                (0, false) if area == 0 && scene.environment.is_none() => "there is no light to integrate over".into(),
                (0, false) => "lights may be hidden in part".to_owned(),
                (0, true) => "one convex body in an even environment shows its directional albedo".into(),
                (n, _) => format!(
                    "nothing can hide {}: diffuse surfaces need no samples of it",
                    counted(n as u64, "quad light")
                ),
            },
        );
        plan.push(
            "packets",
            self.packets,
            match self.packets {
                true => "spheres, planes and quads with sums of lobes: eight paths at a time",
                false => "meshes, tables, pictures of light, spots or shining spheres: one path at a time",
            },
        );
        plan
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
