//! Scenes: the file ([`SceneSpec`], in TOML), the built-in ones, and the built [`Scene`] that the tracer walks through.

mod build;
mod builtin;
mod icosphere;
mod parts;
mod sky;
mod spec;
mod validate;
mod validate_lights;

pub use build::Scene;
pub use builtin::{BUILT_IN, BuiltIn, builtin};
pub use spec::{
    BuiltInMesh, BuiltInSky, CameraSpec, DirectionalLightSpec, EnvironmentSpec, EquationSpec, FilmSpec, LightsSpec,
    MaterialSpec, MeshLightSpec, MeshNormals, MeshSpec, PhongLobeSpec, PlacementSpec, PlaneSpec, PointLightSpec,
    QuadLightSpec, QuadSpec, SceneSpec, SphereLightSpec, SphereSpec, SpotLightSpec,
};
