//! The parts of a scene: its files, lights and shapes, about a common origin.

use std::path::Path;

use glam::DVec3;

use super::super::RenderError;
use super::super::lights::{Environment, EnvironmentImage, Light, MeshLight, QuadLight, SphereLight, SpotLight};
use super::super::shapes::{Geometry, Mesh, Owner, Placement, Plane, Quad, Sphere, read_mesh};
use super::light_spec::LightsSpec;
use super::spec::{MeshNormals, PlacementSpec, SceneSpec};

/// The meshes of a scene as they were read, in the order of its description.
pub(super) struct Files {
    meshes: Vec<Mesh>,
    /// In place.
    shining: Vec<Mesh>,
}

impl Files {
    /// Reads all meshes; names are relative to the folder `base`.
    pub(super) fn read(spec: &SceneSpec, base: &Path) -> Result<Self, RenderError> {
        let mut files = Self { meshes: Vec::new(), shining: Vec::new() };
        for mesh in &spec.meshes {
            files.meshes.push(match (&mesh.file, mesh.builtin) {
                (Some(file), _) => read_mesh(&base.join(file), mesh.normals == MeshNormals::Vertex)?,
                (None, Some(builtin)) => builtin.mesh(mesh.normals == MeshNormals::Vertex),
                (None, None) => Mesh::default(), // validated: never
            });
        }
        for light in &spec.lights.mesh {
            let mut mesh = read_mesh(&base.join(&light.file), false)?;
            let place = placement(&light.place);
            mesh.triangles.iter_mut().flatten().for_each(|p| *p = place.place(*p));
            files.shining.push(mesh);
        }
        Ok(files)
    }

    /// Every corner where it stands.
    fn corners<'a>(&'a self, spec: &'a SceneSpec) -> impl Iterator<Item = DVec3> + 'a {
        let placed = self.meshes.iter().zip(&spec.meshes).flat_map(|(mesh, described)| {
            let places: Vec<Placement> = described.instances.iter().map(placement).collect();
            // Of an instance the corners of its box: enough for a middle, and not its triangles all over again.
            let at_rest = if places.is_empty() { mesh.triangles.as_slice() } else { &[] };
            let corners = if places.is_empty() { Vec::new() } else { box_corners(mesh) };
            let moved =
                places.into_iter().flat_map(move |place| corners.clone().into_iter().map(move |p| place.place(p)));
            at_rest.iter().flatten().copied().chain(moved)
        });
        placed.chain(self.shining.iter().flat_map(|mesh| mesh.triangles.iter().flatten().copied()))
    }
}

fn box_corners(mesh: &Mesh) -> Vec<DVec3> {
    let all = || mesh.triangles.iter().flatten();
    let low = all().fold(DVec3::INFINITY, |m, p| m.min(*p));
    let high = all().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
    let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
    (0..8).map(|i| DVec3::new(pick(i, 0), pick(i, 1), pick(i, 2))).collect()
}

fn placement(p: &PlacementSpec) -> Placement {
    let angle = (p.rotate_deg % 360.0).to_radians();
    Placement::new(DVec3::from(p.axis).normalize(), angle, p.scale, p.translate.into())
}

/// The middle of all bounded shapes where they lie far from the origin compared with their extent, else 0: a scene that
/// was moved far away is rendered where f64 has digits to spare, and an ordinary one keeps its coordinates.
pub(super) fn common_origin(spec: &SceneSpec, files: &Files) -> DVec3 {
    let ball = |center: [f64; 3], radius: f64| (DVec3::from(center), DVec3::splat(radius));
    let balls = spec.spheres.iter().map(|s| ball(s.center, s.radius));
    let bright_balls = spec.lights.sphere.iter().map(|s| ball(s.center, s.radius));
    let reach = |u: [f64; 3], v: [f64; 3]| DVec3::from(u).abs() + DVec3::from(v).abs();
    let quads = spec.quads.iter().map(|q| (DVec3::from(q.center), reach(q.u, q.v)));
    let bright_quads = spec.lights.quad.iter().map(|q| (DVec3::from(q.center), reach(q.u, q.v)));
    let corners = files.corners(spec).map(|p| (p, DVec3::ZERO));
    let camera = std::iter::once(ball(spec.camera.position, 0.0));
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (center, half) in balls.chain(bright_balls).chain(quads).chain(bright_quads).chain(corners).chain(camera) {
        (low, high) = (low.min(center - half), high.max(center + half));
    }
    let middle = 0.5 * low + 0.5 * high;
    if middle.length() > 4.0 * (high - low).length() { middle } else { DVec3::ZERO }
}

/// All lights, moved by −`origin`.
pub(super) fn lights(spec: &SceneSpec, origin: DVec3, files: &Files) -> Vec<Light> {
    let mut lights = without_surface(&spec.lights, origin);
    lights.extend(spec.lights.quad.iter().map(|l| {
        let quad = Quad::new(DVec3::from(l.center) - origin, l.u.into(), l.v.into());
        Light::Quad(QuadLight::new(quad, l.radiance.into()))
    }));
    lights.extend(spec.lights.sphere.iter().map(|l| {
        let sphere = Sphere { center: DVec3::from(l.center) - origin, radius: l.radius };
        Light::Sphere(SphereLight { sphere, radiance: l.radiance.into() })
    }));
    lights.extend(spec.lights.mesh.iter().zip(&files.shining).map(|(l, mesh)| {
        let triangles = mesh.triangles.iter().map(|t| t.map(|p| p - origin)).collect();
        Light::Mesh(MeshLight::new(triangles, l.radiance.into()))
    }));
    lights
}

fn without_surface(spec: &LightsSpec, origin: DVec3) -> Vec<Light> {
    let points = spec
        .point
        .iter()
        .map(|l| Light::Point { position: DVec3::from(l.position) - origin, intensity: l.intensity.into() });
    let directional = spec
        .directional
        .iter()
        .map(|l| Light::Directional { toward: DVec3::from(l.toward).normalize(), irradiance: l.irradiance.into() });
    let spots = spec.spot.iter().map(|l| {
        Light::Spot(SpotLight {
            position: DVec3::from(l.position) - origin,
            axis: DVec3::from(l.direction).normalize(),
            intensity: l.intensity.into(),
            inner: l.inner_deg.to_radians(),
            outer: l.outer_deg.to_radians(),
        })
    });
    points.chain(directional).chain(spots).collect()
}

/// The environment; `None` where it is black or there is none.
pub(super) fn environment(spec: &SceneSpec, base: &Path) -> Result<Option<Environment>, RenderError> {
    let Some(described) = &spec.lights.environment else { return Ok(None) };
    if let Some(radiance) = described.radiance {
        return Ok(Some(DVec3::from(radiance)).filter(|r| *r != DVec3::ZERO).map(Environment::Constant));
    }
    let scale = described.scale.unwrap_or(1.0);
    let turn = (described.rotate_deg.unwrap_or(0.0) % 360.0).to_radians();
    let image = match (&described.file, described.builtin) {
        (Some(file), _) => EnvironmentImage::read(&base.join(file), scale, turn)?,
        (None, Some(sky)) => EnvironmentImage::new(Path::new("sun-and-sky"), sky.picture(), scale, turn)?,
        (None, None) => None, // validated: never
    };
    Ok(image.map(Environment::Image))
}

/// All shapes, those of lights among them, moved by −`origin`.
pub(super) fn geometry(
    spec: &SceneSpec,
    origin: DVec3,
    owner: &dyn Fn(&str) -> Owner,
    files: Files,
    lights: &[Light],
) -> Geometry {
    // Lights come before what reflects: of two that lie in each other a ray meets the one that comes first.
    let (mut spheres, mut quads, mut meshes, mut placed) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (i, light) in lights.iter().enumerate() {
        let owner = Owner::Light { light: i as u32, part: 0 };
        match light {
            Light::Quad(light) => quads.push((*light.quad(), owner)),
            Light::Sphere(light) => spheres.push((light.sphere, owner)),
            Light::Mesh(light) => {
                meshes.push((Mesh { triangles: light.triangles().to_vec(), normals: Vec::new() }, owner));
            }
            Light::Point { .. } | Light::Directional { .. } | Light::Spot(_) => {}
        }
    }
    spheres.extend(
        spec.spheres
            .iter()
            .map(|s| (Sphere { center: DVec3::from(s.center) - origin, radius: s.radius }, owner(&s.material))),
    );
    let planes = spec.planes.iter().map(|p| {
        let plane = Plane { point: DVec3::from(p.point) - origin, normal: DVec3::from(p.normal).normalize() };
        (plane, owner(&p.material))
    });
    quads.extend(
        spec.quads
            .iter()
            .map(|q| (Quad::new(DVec3::from(q.center) - origin, q.u.into(), q.v.into()), owner(&q.material))),
    );
    for (mut mesh, described) in files.meshes.into_iter().zip(&spec.meshes) {
        let owner = owner(&described.material);
        if described.instances.is_empty() {
            mesh.triangles.iter_mut().flatten().for_each(|p| *p -= origin);
            meshes.push((mesh, owner));
        } else {
            let places = described.instances.iter().map(|p| placement(p).relative_to(origin)).collect();
            placed.push((mesh, owner, places));
        }
    }
    Geometry::new(spheres, planes.collect(), quads, meshes, placed)
}
