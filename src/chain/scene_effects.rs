//! What the effects of a scene are worth: the picture without each, beside the picture with all.

use std::sync::Arc;

use serde::Serialize;

use super::error::ChainError;
use super::pictures::{Stage, scene_of};
use super::source::{Source, render_material};
use crate::brdf::Reflectance;
use crate::control::Control;
use crate::render::scene::LightsSpec;
use crate::render::{Film, Material, Materials, Options, Plan, RenderError, Scene, SceneSpec, plan, render};

/// An effect of a scene.
#[derive(Debug, Clone, Serialize)]
pub struct SceneEffect {
    /// Its name.
    pub effect: &'static str,
    /// Whether the scene calls for it.
    pub on: bool,
    /// Because of what.
    pub why: String,
    /// Share of the time of rays that it takes, where it can be left out: 1 less the time without it over the time with all. It can be below 0, where what is
    /// left out ends paths early.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// How far the picture is off without it, where it can be left out: the root of the mean of (x − all)²/(all² + (L̄/10)²).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub off_by: Option<f64>,
}

/// The plan of a scene, and what it is worth.
#[derive(Debug, Clone, Serialize)]
pub struct SceneEffects {
    /// The effects, in the order in which they are known.
    pub effects: Vec<SceneEffect>,
    /// Time of the picture with all of them, s.
    pub seconds: f64,
    /// The same by the full integrator: everything on, one path at a time.
    pub seconds_full: f64,
    /// How far the full integrator's picture is off this one, both noises included, measured like [`SceneEffect::off_by`].
    pub full_off_by: f64,
    /// How far two pictures are off each other that differ by their noise alone: less than this, `off_by` says nothing.
    pub noise: f64,
}

/// Which effects a stage calls for with a material in the place of its replaceable one, and because of what. Nothing is rendered.
///
/// # Errors
/// [`ChainError`] where the material can't be shown, or the scene can't be built.
pub fn scene_plan(stage: &Stage, subject: &crate::brdf::Material) -> Result<crate::control::Plan, ChainError> {
    let subject = render_material("the material", &Source::Fitted(Box::new(subject.clone())), None)?;
    let (scene, _) = scene_of(stage, Some(subject))?;
    Ok(Plan::of(&scene).effects(&scene))
}

/// Renders the stage with all effects that it calls for and without each.
///
/// # Errors
/// [`ChainError`] where the scene can't be built or rendered.
pub fn scene_effects(
    stage: &Stage,
    subject: Option<Material>,
    options: &Options,
    control: Control<'_>,
) -> Result<SceneEffects, ChainError> {
    let (scene, materials) = scene_of(stage, subject)?;
    let derived = Plan::of(&scene);
    let of =
        |scene: &Scene, plan: Plan, seed: u64| render(scene, &Options { plan: Some(plan), seed, ..*options }, control);
    // The first picture warms caches up; the second is the one that counts.
    let other = of(&scene, derived, options.seed.wrapping_add(1))?;
    let all = of(&scene, derived, options.seed)?;
    let full = of(&scene, Plan::FULL, options.seed.wrapping_add(2))?;
    let mut effects = Vec::new();
    for effect in derived.effects(&scene).effects {
        let mut found = SceneEffect { effect: effect.name, on: effect.on, why: effect.why, share: None, off_by: None };
        if effect.on
            && let Some(film) = without(effect.name, stage, &materials, &scene, &|s, plan| of(s, plan, options.seed))?
        {
            found.share = Some(1.0 - film.seconds / all.seconds);
            found.off_by = Some(film.off_by(&all));
        }
        effects.push(found);
    }
    let (seconds, seconds_full) = (all.seconds, full.seconds);
    Ok(SceneEffects { effects, seconds, seconds_full, full_off_by: full.off_by(&all), noise: other.off_by(&all) })
}

/// The picture without an effect; `None` for one that only says how the picture is computed.
fn without(
    effect: &str,
    stage: &Stage,
    materials: &Materials,
    scene: &Scene,
    render: &dyn Fn(&Scene, Plan) -> Result<Film, RenderError>,
) -> Result<Option<Film>, ChainError> {
    let derived = Plan::of(scene);
    match effect {
        plan::SHADOWS => return Ok(Some(render(scene, Plan { shadows: false, ..derived })?)),
        plan::INTERREFLECTION => return Ok(Some(render(scene, Plan { interreflection: false, ..derived })?)),
        _ => {}
    }
    let mut spec = stage.spec.clone();
    let mut materials = materials.clone();
    match effect {
        plan::POINT_LIGHTS => {
            let LightsSpec { point, directional, spot, .. } = &mut spec.lights;
            point.clear();
            directional.clear();
            spot.clear();
        }
        plan::AREA_LIGHTS => {
            let LightsSpec { quad, sphere, mesh, .. } = &mut spec.lights;
            quad.clear();
            sphere.clear();
            mesh.clear();
        }
        plan::ENVIRONMENT => spec.lights.environment = None,
        plan::GLOSSY => match without_gloss(&mut spec, &materials) {
            Some(matte) => materials = matte,
            None => return Ok(None),
        },
        plan::LENS => spec.camera.lens_radius = 0.0,
        _ => return Ok(None),
    }
    let changed = Scene::build(&spec, &stage.base, &materials)?;
    Ok(Some(render(&changed, Plan::of(&changed))?))
}

/// Materials with their Lambert lobes alone; `None` where one is no sum of lobes, or where materials vary others, so that it can't be told what stays.
fn without_gloss(spec: &mut SceneSpec, materials: &Materials) -> Option<Materials> {
    if spec.materials.values().any(|m| m.variant.is_some() || m.equation.is_some()) {
        return None;
    }
    for material in spec.materials.values_mut().filter(|m| !m.phong.is_empty()) {
        material.phong.clear();
        material.kd = Some(material.kd.unwrap_or_default());
    }
    let matte = |material: &Material| match material {
        Material::Brdf(brdf) => Some(Material::Brdf(Arc::new(Reflectance::lambert(brdf.lobes()?.parts().0.to_vec())))),
        Material::PhongEquation(_) => None,
        Material::Black => Some(Material::Black),
    };
    materials.iter().map(|(name, material)| Some((name.clone(), matte(material)?))).collect()
}
