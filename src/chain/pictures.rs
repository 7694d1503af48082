//! Rendering a material in a scene.

use std::path::PathBuf;

use super::error::ChainError;
use super::source::{load, render_material};
use crate::control::Control;
use crate::image::Image;
use crate::measurement::ReadOptions;
use crate::render::scene::builtin;
use crate::render::{Material, Materials, Options, Scene, SceneSpec, render};

/// A scene to render materials in.
#[derive(Debug, Clone)]
pub struct Stage {
    /// Its description.
    pub spec: SceneSpec,
    /// The folder to which its files are relative.
    pub base: PathBuf,
}

impl Stage {
    /// The built-in scene of this name.
    ///
    /// # Errors
    /// [`ChainError`], listing the names that there are.
    pub fn built_in(name: &str) -> Result<Self, ChainError> {
        Ok(Self { spec: builtin(name)?, base: PathBuf::new() })
    }
}

/// Renders a stage with `subject` in the place of its replaceable material.
///
/// # Errors
/// [`ChainError`] where the scene has none, or can't be built.
pub fn picture(
    stage: &Stage,
    subject: Option<Material>,
    options: &Options,
    control: Control<'_>,
) -> Result<Image, ChainError> {
    let (scene, _) = scene_of(stage, subject)?;
    Ok(render(&scene, options, control)?.to_image())
}

/// The stage's scene with `subject` in the place of its replaceable material.
///
/// # Errors
/// As [`picture`].
pub fn scene(stage: &Stage, subject: Option<Material>) -> Result<Scene, ChainError> {
    scene_of(stage, subject).map(|found| found.0)
}

/// The stage's scene with `subject` in the place of its replaceable material, and the materials that were given to it.
pub(super) fn scene_of(stage: &Stage, subject: Option<Material>) -> Result<(Scene, Materials), ChainError> {
    let mut materials = Materials::new();
    if let Some(subject) = subject {
        let Some(slot) = &stage.spec.subject else {
            let name = &stage.spec.name;
            return Err(ChainError::Mismatch(format!(
                "scene {name} has no `subject`: no material in it can be replaced"
            )));
        };
        materials.insert(slot.clone(), subject);
    }
    for (name, file) in stage.spec.material_files() {
        if !materials.contains_key(name) {
            let path = stage.base.join(file).to_string_lossy().into_owned();
            materials.insert(name.to_owned(), render_material(&path, &load(&path, &ReadOptions::default())?, None)?);
        }
    }
    Ok((Scene::build(&stage.spec, &stage.base, &materials)?, materials))
}

/// Renders what a name or file stands for.
///
/// # Errors
/// [`ChainError`] where it can't be loaded or rendered.
pub fn picture_of(
    name: &str,
    rgb: Option<&[String; 3]>,
    stage: &Stage,
    options: &Options,
    control: Control<'_>,
) -> Result<Image, ChainError> {
    let subject = render_material(name, &load(name, &ReadOptions::default())?, rgb)?;
    picture(stage, Some(subject), options, control)
}
