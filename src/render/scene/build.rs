//! From the description to the scene that the tracer walks through.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::super::RenderError;
use super::super::lights::{Light, QuadLight};
use super::super::material::{Material, Materials, PhongEquation};
use super::super::shapes::{Geometry, Mesh, Owner, Plane, Quad, Sphere, read_obj};
use super::CameraSpec;
use super::spec::{MaterialSpec, MeshNormals, SceneSpec};
use crate::brdf::Reflectance;

/// A scene to be rendered.
#[derive(Debug)]
pub struct Scene {
    pub(crate) name: String,
    pub(crate) camera: CameraSpec,
    /// What was subtracted from every position.
    pub(crate) origin: DVec3,
    pub(crate) max_bounces: u32,
    pub(crate) geometry: Geometry,
    pub(crate) materials: Vec<Material>,
    pub(crate) lights: Vec<Light>,
    pub(crate) environment: Option<DVec3>,
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
        let mut meshes = Vec::new();
        for mesh in &spec.meshes {
            let read = read_obj(&base.join(&mesh.file), mesh.normals == MeshNormals::Vertex)?;
            meshes.push((read, owner(&mesh.material)));
        }
        let origin = common_origin(spec, &meshes);
        let own = spec.materials.iter().map(|(name, described)| resolve(spec, name, described, materials));
        let lights = lights(spec, origin);
        let geometry = geometry(spec, origin, &owner, meshes, &lights);
        Ok(Self {
            name: spec.name.clone(),
            camera: spec.camera.clone(),
            origin,
            max_bounces: spec.max_bounces,
            geometry,
            materials: own.collect::<Result<_, _>>()?,
            lights: lights.into_iter().map(|(light, _)| light).collect(),
            environment: spec.lights.environment.as_ref().map(|e| e.radiance.into()),
        })
    }

    /// Name of the scene.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }
}

fn resolve(spec: &SceneSpec, name: &str, own: &MaterialSpec, given: &Materials) -> Result<Material, RenderError> {
    let fail = |reason: String| RenderError::Material { origin: spec.name.clone(), name: name.into(), reason };
    let material = match given.get(name) {
        Some(material) => material.clone(),
        None => inline(own).map_err(|file| fail(format!("its file {} was not loaded", file.display())))?,
    };
    if let Material::Brdf(brdf) = &material
        && !matches!(brdf.channels(), 1 | 3)
    {
        let found = brdf.channels();
        return Err(fail(format!("expected 1 channel (grey) or 3 (red, green, blue), found {found}; choose three")));
    }
    Ok(material)
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

/// The middle of all bounded shapes where they lie far from the origin compared with their extent, else 0: a scene that
/// was moved far away is rendered where f64 has digits to spare, and an ordinary one keeps its coordinates.
fn common_origin(spec: &SceneSpec, meshes: &[(Mesh, Owner)]) -> DVec3 {
    let balls = spec.spheres.iter().map(|s| (DVec3::from(s.center), DVec3::splat(s.radius)));
    let reach = |u: [f64; 3], v: [f64; 3]| DVec3::from(u).abs() + DVec3::from(v).abs();
    let quads = spec.quads.iter().map(|q| (DVec3::from(q.center), reach(q.u, q.v)));
    let shining = spec.lights.quad.iter().map(|q| (DVec3::from(q.center), reach(q.u, q.v)));
    let corners = meshes.iter().flat_map(|(mesh, _)| mesh.triangles.iter().flatten()).map(|p| (*p, DVec3::ZERO));
    let camera = std::iter::once((DVec3::from(spec.camera.position), DVec3::ZERO));
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (center, half) in balls.chain(quads).chain(shining).chain(corners).chain(camera) {
        (low, high) = (low.min(center - half), high.max(center + half));
    }
    let middle = 0.5 * low + 0.5 * high;
    if middle.length() > 4.0 * (high - low).length() { middle } else { DVec3::ZERO }
}

fn lights(spec: &SceneSpec, origin: DVec3) -> Vec<(Light, Option<Quad>)> {
    let points =
        spec.lights.point.iter().map(|l| {
            (Light::Point { position: DVec3::from(l.position) - origin, intensity: l.intensity.into() }, None)
        });
    let directional = spec.lights.directional.iter().map(|l| {
        (Light::Directional { toward: DVec3::from(l.toward).normalize(), irradiance: l.irradiance.into() }, None)
    });
    let quads = spec.lights.quad.iter().map(|l| {
        let quad = Quad::new(DVec3::from(l.center) - origin, l.u.into(), l.v.into());
        (Light::Quad(QuadLight::new(quad, l.radiance.into())), Some(quad))
    });
    points.chain(directional).chain(quads).collect()
}

fn geometry(
    spec: &SceneSpec,
    origin: DVec3,
    owner: &dyn Fn(&str) -> Owner,
    mut meshes: Vec<(Mesh, Owner)>,
    lights: &[(Light, Option<Quad>)],
) -> Geometry {
    let spheres = spec
        .spheres
        .iter()
        .map(|s| (Sphere { center: DVec3::from(s.center) - origin, radius: s.radius }, owner(&s.material)));
    let planes = spec.planes.iter().map(|p| {
        let plane = Plane { point: DVec3::from(p.point) - origin, normal: DVec3::from(p.normal).normalize() };
        (plane, owner(&p.material))
    });
    let quads = spec
        .quads
        .iter()
        .map(|q| (Quad::new(DVec3::from(q.center) - origin, q.u.into(), q.v.into()), owner(&q.material)));
    let shining = lights.iter().enumerate().filter_map(|(i, (_, quad))| Some(((*quad)?, Owner::Light(i))));
    meshes.iter_mut().flat_map(|(mesh, _)| mesh.triangles.iter_mut().flatten()).for_each(|p| *p -= origin);
    Geometry::new(spheres.collect(), planes.collect(), quads.chain(shining).collect(), meshes)
}
