//! The built-in scenes, embedded as the TOML that a user would write.

use super::super::RenderError;
use super::SceneSpec;

/// A scene that comes with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuiltIn {
    /// Its name.
    pub name: &'static str,
    /// Its scene file.
    pub toml: &'static str,
}

/// All built-in scenes.
pub const BUILT_IN: [BuiltIn; 7] = [
    BuiltIn { name: "sphere", toml: include_str!("../../../data-fixtures/scenes/sphere.toml") },
    BuiltIn { name: "sphere-on-plane", toml: include_str!("../../../data-fixtures/scenes/sphere-on-plane.toml") },
    BuiltIn { name: "cornell", toml: include_str!("../../../data-fixtures/scenes/cornell.toml") },
    BuiltIn { name: "mesh-env", toml: include_str!("../../../data-fixtures/scenes/mesh-env.toml") },
    BuiltIn { name: "preview", toml: include_str!("../../../data-fixtures/scenes/preview.toml") },
    BuiltIn { name: "gradient-sweep", toml: include_str!("../../../data-fixtures/scenes/gradient-sweep.toml") },
    BuiltIn { name: "furnace", toml: include_str!("../../../data-fixtures/scenes/furnace.toml") },
];

/// The built-in scene of this name.
///
/// # Errors
/// [`RenderError::UnknownScene`], listing the names that there are.
pub fn builtin(name: &str) -> Result<SceneSpec, RenderError> {
    let Some(scene) = BUILT_IN.iter().find(|scene| scene.name == name) else {
        let known = BUILT_IN.iter().map(|scene| format!("`{}`", scene.name)).collect::<Vec<_>>().join(", ");
        return Err(RenderError::UnknownScene { name: name.into(), known });
    };
    SceneSpec::parse(scene.toml, scene.name)
}
