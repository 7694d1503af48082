//! Scenes: the file ([`SceneSpec`], in TOML), the built-in ones, and the built [`Scene`] that the tracer walks through.

mod build;
mod builtin;
mod icosphere;
mod light_spec;
mod parts;
mod sky;
mod spec;
mod turned;
mod validate;
mod validate_lights;
mod variant;

pub use build::Scene;
pub use builtin::{BUILT_IN, BuiltIn, builtin};
pub use light_spec::{
    BuiltInSky, DirectionalLightSpec, EnvironmentSpec, LightsSpec, MeshLightSpec, PointLightSpec, QuadLightSpec,
    SphereLightSpec, SpotLightSpec,
};
pub use spec::{
    BuiltInMesh, CameraSpec, EquationSpec, FilmSpec, Filter, MaterialSpec, MeshNormals, MeshSpec, PhongLobeSpec,
    PlacementSpec, PlaneSpec, QuadSpec, SceneSpec, SphereSpec, VariantSpec,
};
