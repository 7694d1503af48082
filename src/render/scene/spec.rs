//! The scene file as typed: one struct per table of the TOML, every field with its unit.
//!
//! Lengths are metres, angles degrees, colours linear RGB. Unknown keys are errors.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::RenderError;
use super::light_spec::LightsSpec;

/// A scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// Version of the file's format: 1.
    pub version: u32,
    /// Name of the scene.
    pub name: String,
    /// One line on what the scene shows.
    #[serde(default)]
    pub description: String,
    /// Scattering events of a path at most, 0 to 1000; with 0 only lights are seen.
    pub max_bounces: u32,
    /// Name of the material that a caller may replace (`--material`).
    #[serde(default)]
    pub subject: Option<String>,
    /// The camera.
    pub camera: CameraSpec,
    /// Resolution and samples when the caller names none.
    #[serde(default)]
    pub film: FilmSpec,
    /// Materials by name.
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialSpec>,
    /// Spheres, lit outside.
    #[serde(default, rename = "sphere")]
    pub spheres: Vec<SphereSpec>,
    /// Infinite planes, lit on the side of the normal.
    #[serde(default, rename = "plane")]
    pub planes: Vec<PlaneSpec>,
    /// Parallelograms, lit on the side of u × v.
    #[serde(default, rename = "quad")]
    pub quads: Vec<QuadSpec>,
    /// Triangle meshes, lit on the side from which a face's vertices run counter-clockwise.
    #[serde(default, rename = "mesh")]
    pub meshes: Vec<MeshSpec>,
    /// Lights.
    #[serde(default, rename = "light")]
    pub lights: LightsSpec,
}

/// A camera: a pinhole, or a thin lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSpec {
    /// Where the pinhole or the middle of the lens is, m.
    pub position: [f64; 3],
    /// A point in the middle of the picture, m; not the position.
    pub target: [f64; 3],
    /// The direction that is up in the picture; not parallel to the line of sight.
    #[serde(default = "CameraSpec::default_up")]
    pub up: [f64; 3],
    /// Full field of view along x, degrees, above 0 and below 180. Pixels are square.
    pub fov_deg: f64,
    /// Radius of a thin lens, m, at least 0; 0, the default, is a pinhole.
    #[serde(default)]
    pub lens_radius: f64,
    /// Distance along the line of sight at which a lens is in focus, m, above 0; the target's when none is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus_distance: Option<f64>,
}

impl CameraSpec {
    const fn default_up() -> [f64; 3] {
        [0.0, 1.0, 0.0]
    }
}

/// What is rendered when the caller does not say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilmSpec {
    /// Width and height, pixels, 1 to 16384 each and at most 2²⁶ pixels in all.
    pub resolution: [u32; 2],
    /// Samples per pixel, 1 to 2²⁴.
    pub samples: u32,
    /// How points of the picture count for pixels.
    pub filter: Filter,
}

/// The weight of a point of the picture for a pixel, by its distance from the pixel's middle; all integrate to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// The pixel's own area counts evenly: pixels know nothing of each other's light, as comparisons want it.
    #[default]
    Box,
    /// A pyramid two pixels wide.
    Tent,
    /// A Gaussian of half a pixel, cut off at 1.5 pixels: smoother edges.
    Gaussian,
}

impl Default for FilmSpec {
    fn default() -> Self {
        Self { resolution: [512, 512], samples: 64, filter: Filter::Box }
    }
}

/// A material: a sum of lobes (`kd`, `phong`), or a `file`, or Phong's `equation`, or `black`, or a `variant` of another.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialSpec {
    /// Weight of a Lambert lobe, kd/π in 1/sr, at least 0.
    pub kd: Option<[f64; 3]>,
    /// Normalised Phong lobes that are added.
    pub phong: Vec<PhongLobeSpec>,
    /// A fitted material or a measurement that covers enough to be rendered; relative to the scene file.
    pub file: Option<PathBuf>,
    /// Phong's equation as a shading rule.
    pub equation: Option<EquationSpec>,
    /// Reflects nothing.
    pub black: bool,
    /// Another material of the scene with one property changed.
    pub variant: Option<VariantSpec>,
}

/// The material `of`, whatever stands in its place, with one property changed: the `exponent` of its Phong lobes (α of Phong's
/// equation) where it has any, else all that it reflects, times `scale`. What is left out is not changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariantSpec {
    /// Name of a material of this scene that is no variant itself.
    pub of: String,
    /// Exponent n, 0 to 10⁸.
    #[serde(default)]
    pub exponent: Option<f64>,
    /// Factor, 0 to 1.
    #[serde(default)]
    pub scale: Option<f64>,
}

/// The lobe ks·(n+2)/(2π)·cosⁿα in 1/sr, α the angle between wo and the mirror image of wi.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhongLobeSpec {
    /// Weight, at least 0: the share reflected at normal incidence.
    pub ks: [f64; 3],
    /// Exponent n, 0 to 10⁸.
    pub n: f64,
}

/// L = `ambient` + Σ over the lights seen (`diffuse`·max(0, n·s) + `specular`·max(0, r·b)^`alpha`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EquationSpec {
    /// `r_a I_a`, radiance, at least 0.
    pub ambient: [f64; 3],
    /// `r_d I_d`, radiance, at least 0.
    pub diffuse: [f64; 3],
    /// `r_s I_s`, radiance, at least 0.
    pub specular: [f64; 3],
    /// α, at least 0.
    pub alpha: f64,
}

/// A sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SphereSpec {
    /// Centre, m.
    pub center: [f64; 3],
    /// Radius, m, above 0.
    pub radius: f64,
    /// Name of its material.
    pub material: String,
}

/// An infinite plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneSpec {
    /// A point on it, m.
    pub point: [f64; 3],
    /// Its normal, of any length but 0.
    pub normal: [f64; 3],
    /// Name of its material.
    pub material: String,
}

/// The parallelogram of the points centre + a·u + b·v, a and b in [−1, 1].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuadSpec {
    /// Centre, m.
    pub center: [f64; 3],
    /// First half-edge, m.
    pub u: [f64; 3],
    /// Second half-edge, m; not parallel to the first.
    pub v: [f64; 3],
    /// Name of its material.
    pub material: String,
}

/// A triangle mesh, from a `file` or `builtin`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshSpec {
    /// An OBJ, PLY or glTF file (`.obj`, `.ply`, `.gltf`, `.glb`), relative to the scene file.
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// A mesh that the program makes.
    #[serde(default)]
    pub builtin: Option<BuiltInMesh>,
    /// Name of its material.
    pub material: String,
    /// Which normals shade it.
    #[serde(default)]
    pub normals: MeshNormals,
    /// Where it stands: once per entry, sharing its triangles; if left out, once where the file puts it.
    #[serde(default, rename = "instance")]
    pub instances: Vec<PlacementSpec>,
}

/// Meshes that the program makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BuiltInMesh {
    /// A unit sphere of 327,680 triangles with bumps of up to 7.5 %.
    DisplacedIcosphere,
    /// A disc of radius 1 about +y from y = 0 to y = 0.16, its upper edge rounded with radius 0.05; it has vertex normals.
    RoundedDisc,
    /// A backdrop: a floor at y = 0, 60 wide, from z = 30 to −2, which bends up with radius 6 to a wall at z = −8, 16 high; it
    /// has vertex normals.
    Cove,
}

/// Where a mesh stands: it is scaled, then turned about an axis through 0, then moved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlacementSpec {
    /// What lengths are multiplied by, above 0.
    pub scale: f64,
    /// The axis, of any length but 0.
    pub axis: [f64; 3],
    /// Angle about the axis, degrees, right-handed.
    pub rotate_deg: f64,
    /// The move, m.
    pub translate: [f64; 3],
}

impl Default for PlacementSpec {
    fn default() -> Self {
        Self { scale: 1.0, axis: [0.0, 1.0, 0.0], rotate_deg: 0.0, translate: [0.0; 3] }
    }
}

/// Which normals shade a mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MeshNormals {
    /// Each face is flat.
    #[default]
    Face,
    /// The vertex normals, interpolated.
    Vertex,
}

impl SceneSpec {
    /// Reads and validates a scene file.
    ///
    /// # Errors
    /// [`RenderError`] naming the file and the line or field.
    pub fn read(path: &Path) -> Result<Self, RenderError> {
        let text = std::fs::read_to_string(path).map_err(|source| RenderError::Io { path: path.into(), source })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Parses and validates the text of a scene file; `origin` names it in errors.
    ///
    /// # Errors
    /// [`RenderError::Toml`] with line and column, or [`RenderError::Field`] with field, value and constraint.
    pub fn parse(text: &str, origin: &str) -> Result<Self, RenderError> {
        let spec: Self = toml::from_str(text).map_err(|error| toml_error(text, origin, &error))?;
        spec.validate(origin)?;
        Ok(spec)
    }

    /// The names of the materials that are files, with those files as typed: the caller resolves them before building.
    pub fn material_files(&self) -> impl Iterator<Item = (&str, &Path)> {
        self.materials.iter().filter_map(|(name, spec)| Some((name.as_str(), spec.file.as_deref()?)))
    }

    /// All files that the scene is made of, as typed.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let materials = self.material_files().map(|(_, file)| file);
        let meshes = self.meshes.iter().filter_map(|mesh| mesh.file.as_deref());
        let lights = self.lights.mesh.iter().map(|light| light.file.as_path());
        let sky = self.lights.environment.iter().filter_map(|sky| sky.file.as_deref());
        materials.chain(meshes).chain(lights).chain(sky)
    }
}

fn toml_error(text: &str, origin: &str, error: &toml::de::Error) -> RenderError {
    let at = error.span().map_or(0, |span| span.start);
    let before = text.get(..at).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |tail| tail.chars().count()) + 1;
    RenderError::Toml { origin: origin.into(), line, column, message: error.message().trim().replace('\n', " ") }
}
