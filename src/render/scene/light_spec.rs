//! The lights of a scene file as typed: one struct per table, every field with its unit.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::spec::PlacementSpec;

/// All lights of a scene. A light shines on the side of its normal and is seen by the camera if it has a surface.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LightsSpec {
    /// Point lights.
    pub point: Vec<PointLightSpec>,
    /// Lights at infinity.
    pub directional: Vec<DirectionalLightSpec>,
    /// Points that shine into a cone.
    pub spot: Vec<SpotLightSpec>,
    /// Shining parallelograms.
    pub quad: Vec<QuadLightSpec>,
    /// Shining spheres.
    pub sphere: Vec<SphereLightSpec>,
    /// Shining meshes.
    pub mesh: Vec<MeshLightSpec>,
    /// Light from everywhere.
    pub environment: Option<EnvironmentSpec>,
}

/// A point that shines alike in all directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointLightSpec {
    /// Where, m.
    pub position: [f64; 3],
    /// Radiant intensity, W/sr, at least 0.
    pub intensity: [f64; 3],
}

/// Parallel light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionalLightSpec {
    /// Direction towards the light, of any length but 0.
    pub toward: [f64; 3],
    /// Irradiance on a surface that faces it, W/m², at least 0.
    pub irradiance: [f64; 3],
}

/// A parallelogram as in [`QuadSpec`](super::QuadSpec) whose front shines alike in all directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuadLightSpec {
    /// Centre, m.
    pub center: [f64; 3],
    /// First half-edge, m.
    pub u: [f64; 3],
    /// Second half-edge, m; not parallel to the first.
    pub v: [f64; 3],
    /// Radiance, W/(sr·m²), at least 0.
    pub radiance: [f64; 3],
}

/// A point that shines into a cone: with its whole `intensity` up to `inner_deg` from the axis, with none beyond `outer_deg`, and
/// between with the share x²(3 − 2x), x running from 0 at the outer angle to 1 at the inner one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpotLightSpec {
    /// Where, m.
    pub position: [f64; 3],
    /// Direction of the axis, away from the light, of any length but 0.
    pub direction: [f64; 3],
    /// Radiant intensity along the axis, W/sr, at least 0.
    pub intensity: [f64; 3],
    /// Angle from the axis, degrees, 0 to `outer_deg`.
    pub inner_deg: f64,
    /// Angle from the axis, degrees, above 0 and at most 180.
    pub outer_deg: f64,
}

/// A sphere whose outside shines alike in all directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SphereLightSpec {
    /// Centre, m.
    pub center: [f64; 3],
    /// Radius, m, above 0.
    pub radius: f64,
    /// Radiance, W/(sr·m²), at least 0.
    pub radiance: [f64; 3],
}

/// A mesh whose faces shine alike in all directions, on the side from which their vertices run counter-clockwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshLightSpec {
    /// An OBJ, PLY or glTF file, relative to the scene file.
    pub file: PathBuf,
    /// Radiance, W/(sr·m²), at least 0.
    pub radiance: [f64; 3],
    /// Where it stands; if left out, where the file puts it.
    #[serde(default)]
    pub place: PlacementSpec,
}

/// Light from all directions: of one `radiance`, or a picture (`file` or `builtin`).
///
/// A picture is in latitude and longitude: the direction (sinφ sinθ, cosθ, −cosφ sinθ), +y being up, has the column φ/2π·W − ½,
/// which wraps, and the row θ/π·(H − 1), row 0 on top; between pixels it is bilinear.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnvironmentSpec {
    /// Radiance, W/(sr·m²), at least 0.
    pub radiance: Option<[f64; 3]>,
    /// An OpenEXR picture of radiance in linear RGB, relative to the scene file; 2 rows at least, 2²⁵ pixels at most.
    pub file: Option<PathBuf>,
    /// A picture that the program makes.
    pub builtin: Option<BuiltInSky>,
    /// What the picture's radiance is multiplied by, at least 0; 1 if left out.
    pub scale: Option<f64>,
    /// Angle by which the picture is turned about +y, degrees, counter-clockwise seen from above; 0 if left out.
    pub rotate_deg: Option<f64>,
}

/// Pictures of environments that the program makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BuiltInSky {
    /// A bluish sky that is brighter above, with a sun of 3° radius at (1, √2, 1).
    SunAndSky,
}
