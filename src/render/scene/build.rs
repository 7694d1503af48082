//! From the description to the scene that the tracer walks through.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::super::RenderError;
use super::super::lights::{Environment, Light};
use super::super::material::{Material, Materials, PhongEquation};
use super::super::shapes::{Geometry, Owner};
use super::parts::{Files, common_origin, environment, geometry, lights};
use super::spec::{MaterialSpec, SceneSpec};
use super::variant::vary;
use super::{CameraSpec, Filter};
use crate::brdf::Reflectance;

/// A scene to be rendered.
#[derive(Debug)]
pub struct Scene {
    pub(crate) name: String,
    pub(crate) camera: CameraSpec,
    pub(crate) filter: Filter,
    /// What was subtracted from every position.
    pub(crate) origin: DVec3,
    pub(crate) max_bounces: u32,
    pub(crate) geometry: Geometry,
    pub(crate) materials: Vec<Material>,
    pub(crate) lights: Vec<Light>,
    pub(crate) environment: Option<Environment>,
}

impl Scene {
    /// Builds a validated scene. `base` is the folder to which the scene's mesh files are relative. A name in `materials` stands
    /// before the scene's own description of that material; materials that are files must be there.
    ///
    /// # Errors
    /// [`RenderError`] where a field is out of range, a mesh can't be read or a material can't be rendered.
    pub fn build(spec: &SceneSpec, base: &Path, materials: &Materials) -> Result<Self, RenderError> {
        spec.validate(&spec.name)?;
        let names: Vec<&str> = spec.materials.keys().map(String::as_str).collect();
        let owner = |name: &str| Owner::Material(names.binary_search(&name).unwrap_or(0)); // validated to be there
        let files = Files::read(spec, base)?;
        let origin = common_origin(spec, &files);
        let own = spec.materials.iter().map(|(name, described)| resolve(spec, name, described, materials));
        let lights = lights(spec, origin, &files);
        let geometry = geometry(spec, origin, &owner, files, &lights);
        Ok(Self {
            name: spec.name.clone(),
            camera: spec.camera.clone(),
            filter: spec.film.filter,
            origin,
            max_bounces: spec.max_bounces,
            geometry,
            materials: own.collect::<Result<_, _>>()?,
            lights,
            environment: environment(spec, base)?,
        })
    }

    /// Whether a ray can find light at all.
    pub(crate) fn rays_find_light(&self) -> bool {
        self.environment.is_some() || self.lights.iter().any(Light::has_surface)
    }

    /// Name of the scene.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }
}

fn resolve(spec: &SceneSpec, name: &str, own: &MaterialSpec, given: &Materials) -> Result<Material, RenderError> {
    let fail = |reason: String| RenderError::Material { origin: spec.name.clone(), name: name.into(), reason };
    let material = match (given.get(name), &own.variant) {
        (Some(material), _) => material.clone(),
        (None, Some(variant)) => match spec.materials.get(&variant.of) {
            Some(base) => vary(&resolve(spec, &variant.of, base, given)?, variant),
            None => Material::Black, // validated: never
        },
        (None, None) => inline(own).map_err(|file| fail(format!("its file {} was not loaded", file.display())))?,
    };
    if let Material::Brdf(brdf) = &material
        && !matches!(brdf.channels(), 1 | 3)
    {
        let found = brdf.channels();
        return Err(fail(format!("expected 1 channel (grey) or 3 (red, green, blue), found {found}; choose three")));
    }
    let is_black = matches!(&material, Material::Brdf(brdf) if brdf.lobes().is_some_and(Reflectance::is_black));
    Ok(if is_black { Material::Black } else { material })
}

/// A material that the scene describes itself; otherwise the file that it is in.
fn inline(spec: &MaterialSpec) -> Result<Material, &Path> {
    if let Some(file) = &spec.file {
        return Err(file);
    }
    if spec.black {
        return Ok(Material::Black);
    }
    Ok(match &spec.equation {
        Some(equation) => Material::PhongEquation(PhongEquation {
            ambient: equation.ambient.into(),
            diffuse: equation.diffuse.into(),
            specular: equation.specular.into(),
            alpha: equation.alpha,
        }),
        None => Material::Brdf(Arc::new(lobes(spec))),
    })
}

/// The lobes that a scene file writes out.
fn lobes(spec: &MaterialSpec) -> Reflectance {
    let phong = spec.phong.iter().map(|lobe| (lobe.ks.to_vec(), lobe.n));
    Reflectance::lobes(spec.kd.unwrap_or_default().to_vec(), phong)
}
