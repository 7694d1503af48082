//! Scenes: the file ([`SceneSpec`], in TOML), the built-in ones, and the built [`Scene`] that the tracer walks through.

mod build;
mod builtin;
mod spec;
mod validate;

pub use build::Scene;
pub use builtin::{BUILT_IN, BuiltIn, builtin};
pub use spec::{
    CameraSpec, DirectionalLightSpec, EnvironmentSpec, EquationSpec, FilmSpec, LightsSpec, MaterialSpec, MeshNormals,
    MeshSpec, PhongLobeSpec, PlaneSpec, PointLightSpec, QuadLightSpec, QuadSpec, SceneSpec, SphereSpec,
};
