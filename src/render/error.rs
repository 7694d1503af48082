//! What can be wrong with a scene. *Invalid* input names its file, field or line; *io* is the disk.

use std::path::PathBuf;

use crate::image::ImageError;

/// Why a scene could not be read, built or rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The operating system refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A scene file is not the TOML of a scene.
    #[error("{origin}, line {line}, column {column}: {message}")]
    Toml {
        /// The file, or the name of a built-in scene.
        origin: String,
        /// Line, counted from 1.
        line: usize,
        /// Column in characters, counted from 1.
        column: usize,
        /// What is wrong there.
        message: String,
    },
    /// A value lies outside of what it may be.
    #[error("{origin}: `{field}` is {value}, but must be {constraint}")]
    Field {
        /// The file, or the name of a built-in scene.
        origin: String,
        /// The field with its path, such as `camera.fov_deg` or `sphere[1].radius`.
        field: String,
        /// The value found.
        value: String,
        /// What it must be.
        constraint: String,
    },
    /// A mesh file can't be used.
    #[error("{path}{place}: {message}", path = path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Where, such as `, line 7`; empty where it concerns the file as a whole.
        place: String,
        /// What is wrong.
        message: String,
    },
    /// The picture of an environment can't be used.
    #[error("{path}{place}: {message}", path = path.display())]
    Environment {
        /// The file, or the name of a built-in environment.
        path: PathBuf,
        /// Where, such as `, column 3, row 7, red`; empty where it concerns the file as a whole.
        place: String,
        /// What is wrong.
        message: String,
    },
    /// A picture can't be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A material can't be used by the tracer.
    #[error("{origin}: material `{name}`: {reason}")]
    Material {
        /// The file, or the name of a built-in scene.
        origin: String,
        /// The material's name in the scene.
        name: String,
        /// Why not, and what would work.
        reason: String,
    },
    /// The picture does not fit into memory.
    #[error(
        "a picture of {width}x{height} pixels takes {gigabytes:.1} GB while it is rendered, which there is not; choose a smaller one"
    )]
    Memory {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// What was asked for, 10⁹ bytes.
        gigabytes: f64,
    },
    /// No built-in scene has this name.
    #[error("there is no built-in scene `{name}`; the built-in scenes are {known}")]
    UnknownScene {
        /// The name asked for.
        name: String,
        /// The names that there are.
        known: String,
    },
}
