//! The ranges of a scene's fields: each is checked once, and an error names field, value and constraint.

use glam::DVec3;

use super::super::RenderError;
use super::super::film::MAX_PIXELS;
use super::spec::{BuiltInMesh, MaterialSpec, MeshNormals, PlacementSpec, SceneSpec, VariantSpec};
use super::validate_lights::validate_lights;

/// Names the place of one value for the checks below.
pub(super) struct Check<'a> {
    origin: &'a str,
}

impl Check<'_> {
    pub(super) fn fail(&self, field: &str, value: impl std::fmt::Debug, constraint: &str) -> RenderError {
        RenderError::Field {
            origin: self.origin.into(),
            field: field.into(),
            value: format!("{value:?}"),
            constraint: constraint.into(),
        }
    }

    pub(super) fn holds(
        &self,
        ok: bool,
        field: &str,
        value: impl std::fmt::Debug,
        constraint: &str,
    ) -> Result<(), RenderError> {
        if ok { Ok(()) } else { Err(self.fail(field, value, constraint)) }
    }

    pub(super) fn finite(&self, field: &str, v: [f64; 3]) -> Result<(), RenderError> {
        self.holds(v.iter().all(|x| x.is_finite()), field, v, "three finite numbers")
    }

    pub(super) fn direction(&self, field: &str, v: [f64; 3]) -> Result<(), RenderError> {
        self.finite(field, v)?;
        self.holds(DVec3::from(v).try_normalize().is_some(), field, v, "a direction, so not 0 0 0")
    }

    pub(super) fn color(&self, field: &str, v: [f64; 3]) -> Result<(), RenderError> {
        self.holds(v.iter().all(|x| x.is_finite() && *x >= 0.0), field, v, "three finite numbers of at least 0")
    }

    pub(super) fn half_edges(&self, place: &str, u: [f64; 3], v: [f64; 3]) -> Result<(), RenderError> {
        self.direction(&format!("{place}.u"), u)?;
        self.direction(&format!("{place}.v"), v)?;
        let (a, b) = (DVec3::from(u).normalize(), DVec3::from(v).normalize());
        let spans = a.cross(b).length() > 1e-12;
        self.holds(spans, &format!("{place}.v"), v, "a direction other than that of `u`")
    }

    pub(super) fn radius(&self, field: &str, radius: f64) -> Result<(), RenderError> {
        self.holds(radius.is_finite() && radius > 0.0, field, radius, "a finite number above 0")
    }

    pub(super) fn placement(&self, place: &str, p: &PlacementSpec) -> Result<(), RenderError> {
        self.radius(&format!("{place}.scale"), p.scale)?;
        self.direction(&format!("{place}.axis"), p.axis)?;
        self.holds(p.rotate_deg.is_finite(), &format!("{place}.rotate_deg"), p.rotate_deg, "a finite number")?;
        self.finite(&format!("{place}.translate"), p.translate)
    }
}

impl SceneSpec {
    /// Checks every field; `origin` names the scene in errors.
    ///
    /// # Errors
    /// [`RenderError::Field`] for the first field that is out of range.
    pub fn validate(&self, origin: &str) -> Result<(), RenderError> {
        let check = Check { origin };
        check.holds(self.version == 1, "version", self.version, "1, the only version there is")?;
        check.holds(self.max_bounces <= 1000, "max_bounces", self.max_bounces, "at most 1000")?;
        self.validate_camera(&check)?;
        for (name, material) in &self.materials {
            validate_material(&check, &format!("materials.{name}"), material)?;
            material.variant.iter().try_for_each(|variant| self.validate_variant(&check, name, variant))?;
        }
        self.validate_shapes(&check)?;
        validate_lights(&check, &self.lights)?;
        self.validate_names(&check)
    }

    fn validate_camera(&self, check: &Check<'_>) -> Result<(), RenderError> {
        let camera = &self.camera;
        check.finite("camera.position", camera.position)?;
        check.finite("camera.target", camera.target)?;
        check.direction("camera.up", camera.up)?;
        let fov = camera.fov_deg;
        check.holds(fov > 0.0 && fov < 180.0, "camera.fov_deg", fov, "above 0 and below 180")?;
        let radius = camera.lens_radius;
        check.holds(
            radius.is_finite() && radius >= 0.0,
            "camera.lens_radius",
            radius,
            "a finite number of at least 0",
        )?;
        if let Some(focus) = camera.focus_distance {
            check.radius("camera.focus_distance", focus)?;
        }
        let forward = (DVec3::from(camera.target) - DVec3::from(camera.position)).try_normalize();
        let forward = forward
            .ok_or_else(|| check.fail("camera.target", camera.target, "a point other than `camera.position`"))?;
        let upright = forward.cross(DVec3::from(camera.up).normalize()).length() > 1e-9;
        check.holds(upright, "camera.up", camera.up, "a direction that is not parallel to the line of sight")?;
        let size = self.film.resolution;
        let fits = size.iter().all(|n| (1..=16384).contains(n));
        check.holds(fits, "film.resolution", size, "two numbers of pixels from 1 to 16384")?;
        let fits = size.iter().map(|n| u64::from(*n)).product::<u64>() <= MAX_PIXELS;
        check.holds(fits, "film.resolution", size, &format!("at most {MAX_PIXELS} pixels in all (8192 × 8192)"))?;
        let samples = self.film.samples;
        check.holds((1..=1 << 24).contains(&samples), "film.samples", samples, "from 1 to 16777216")
    }

    fn validate_variant(&self, check: &Check<'_>, name: &str, variant: &VariantSpec) -> Result<(), RenderError> {
        let place = format!("materials.{name}.variant");
        let of = self.materials.get(&variant.of);
        let fits = of.is_some_and(|material| material.variant.is_none());
        let constraint = "the name of a material of this scene that is no variant itself";
        check.holds(fits, &format!("{place}.of"), &variant.of, constraint)?;
        let exponent = variant.exponent.is_none_or(|n| (0.0..=1e8).contains(&n));
        check.holds(exponent, &format!("{place}.exponent"), variant.exponent, "from 0 to 1e8")?;
        let scale = variant.scale.is_none_or(|factor| (0.0..=1.0).contains(&factor));
        check.holds(scale, &format!("{place}.scale"), variant.scale, "from 0 to 1")
    }

    fn validate_shapes(&self, check: &Check<'_>) -> Result<(), RenderError> {
        for (i, s) in self.spheres.iter().enumerate() {
            check.finite(&format!("sphere[{i}].center"), s.center)?;
            check.radius(&format!("sphere[{i}].radius"), s.radius)?;
        }
        for (i, p) in self.planes.iter().enumerate() {
            check.finite(&format!("plane[{i}].point"), p.point)?;
            check.direction(&format!("plane[{i}].normal"), p.normal)?;
        }
        for (i, q) in self.quads.iter().enumerate() {
            check.finite(&format!("quad[{i}].center"), q.center)?;
            check.half_edges(&format!("quad[{i}]"), q.u, q.v)?;
        }
        for (i, m) in self.meshes.iter().enumerate() {
            let one = m.file.is_some() != m.builtin.is_some();
            let found = if m.file.is_some() { "both" } else { "neither" };
            check.holds(one, &format!("mesh[{i}]"), format_args!("{found}"), "either a `file` or a `builtin`")?;
            let flat = m.builtin != Some(BuiltInMesh::DisplacedIcosphere) || m.normals == MeshNormals::Face;
            check.holds(
                flat,
                &format!("mesh[{i}].normals"),
                m.normals,
                "\"face\" for a mesh without vertex normals",
            )?;
            for (k, place) in m.instances.iter().enumerate() {
                check.placement(&format!("mesh[{i}].instance[{k}]"), place)?;
            }
        }
        Ok(())
    }

    /// Every material that is named is described.
    fn validate_names(&self, check: &Check<'_>) -> Result<(), RenderError> {
        let spheres = self.spheres.iter().enumerate().map(|(i, s)| (format!("sphere[{i}].material"), &s.material));
        let planes = self.planes.iter().enumerate().map(|(i, p)| (format!("plane[{i}].material"), &p.material));
        let quads = self.quads.iter().enumerate().map(|(i, q)| (format!("quad[{i}].material"), &q.material));
        let meshes = self.meshes.iter().enumerate().map(|(i, m)| (format!("mesh[{i}].material"), &m.material));
        let subject = self.subject.iter().map(|name| ("subject".to_owned(), name));
        for (field, name) in spheres.chain(planes).chain(quads).chain(meshes).chain(subject) {
            let known = self.materials.keys().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", ");
            let constraint = format!("the name of a material of this scene: {known}");
            check.holds(self.materials.contains_key(name), &field, name, &constraint)?;
        }
        Ok(())
    }
}

fn validate_material(check: &Check<'_>, place: &str, material: &MaterialSpec) -> Result<(), RenderError> {
    let lobes = material.kd.is_some() || !material.phong.is_empty();
    let described = [material.file.is_some(), material.equation.is_some(), material.variant.is_some()];
    let kinds = [lobes, material.black].into_iter().chain(described);
    let one = kinds.filter(|given| *given).count();
    let constraint = "exactly one of lobes (`kd`, `phong`), `file`, `equation`, `black = true`, `variant`";
    check.holds(one == 1, place, format_args!("{one} kinds of material"), constraint)?;
    material.kd.iter().try_for_each(|kd| check.color(&format!("{place}.kd"), *kd))?;
    for (i, lobe) in material.phong.iter().enumerate() {
        check.color(&format!("{place}.phong[{i}].ks"), lobe.ks)?;
        let fits = (0.0..=1e8).contains(&lobe.n);
        check.holds(fits, &format!("{place}.phong[{i}].n"), lobe.n, "from 0 to 1e8")?;
    }
    if let Some(equation) = &material.equation {
        check.color(&format!("{place}.equation.ambient"), equation.ambient)?;
        check.color(&format!("{place}.equation.diffuse"), equation.diffuse)?;
        check.color(&format!("{place}.equation.specular"), equation.specular)?;
        let fits = equation.alpha.is_finite() && equation.alpha >= 0.0;
        check.holds(fits, &format!("{place}.equation.alpha"), equation.alpha, "a finite number of at least 0")?;
    }
    Ok(())
}
