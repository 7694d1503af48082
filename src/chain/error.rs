//! What can go wrong when rooms are joined.

use std::path::PathBuf;

use crate::brdf::MaterialError;
use crate::fit::FitError;
use crate::image::ImageError;
use crate::measurement::MeasurementError;
use crate::render::RenderError;

/// Why a chain of work stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChainError {
    /// A measurement.
    #[error(transparent)]
    Measurement(#[from] MeasurementError),
    /// A fit.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A scene or render.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A picture.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A material file.
    #[error("{path}: {source}", path = path.display())]
    Material {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: MaterialError,
    },
    /// The operating system refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Raw readings can't be reduced.
    #[error("{name}: {source}")]
    Reduce {
        /// The file.
        name: String,
        /// Why.
        source: crate::gonio::ReduceError,
    },
    /// An output could not be written.
    #[error("{path}: {source}", path = path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Neither a built-in material nor a file.
    #[error("there is no material or file \"{name}\"; built-in materials are {known}")]
    NoSuchMaterial {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A measurement where a fitted material is needed.
    #[error("{path}: expected a fitted material (.json), found a measurement; fit it first", path = path.display())]
    NotAMaterial {
        /// The file.
        path: PathBuf,
    },
    /// Channels that can't be shown as they are.
    #[error("{name}: {reason}; its channels are {found}")]
    Channels {
        /// The material.
        name: String,
        /// Why.
        reason: String,
        /// Its channels.
        found: String,
    },
    /// A flat-world material in space.
    #[error("{name}: a material of the flat world can't be rendered; fit a measurement of space")]
    Flat {
        /// The material.
        name: String,
    },
    /// A scan with too many entries.
    #[error("scan {scan}: its step asks for more than 16 million direction pairs; choose a larger one")]
    ScanTooLarge {
        /// The scan.
        scan: String,
    },
    /// Tables of more directions than there is room for.
    #[error(
        "tables with steps of {steps} degrees: expected at most {most} million pairs of directions in all, found {found:.1} million; \
         choose fewer or larger steps"
    )]
    TooManyDirections {
        /// The steps, degrees.
        steps: String,
        /// Pairs of directions of all tables, millions.
        found: f64,
        /// What they may be.
        most: f64,
    },
    /// A simulation with too many raw readings.
    #[error("{0}")]
    TooManyReadings(String),
    /// A sweep of more or larger pictures than there is room for.
    #[error(
        "{settings} settings of {width}×{height} pixels: expected at most {most_gib:.1} GiB of sums of pictures, found {found_gib:.1}; \
         sweep fewer settings, or smaller pictures"
    )]
    TooManyPictures {
        /// Settings, each with a sum of its own.
        settings: usize,
        /// Width of a picture, pixels.
        width: u32,
        /// Its height.
        height: u32,
        /// What the sums would take, GiB.
        found_gib: f64,
        /// What they may take.
        most_gib: f64,
    },
    /// Two inputs that don't go together.
    #[error("{0}")]
    Mismatch(String),
}

impl ChainError {
    /// An [`ChainError::Io`].
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }

    /// A [`ChainError::Write`].
    pub fn write(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Write { path: path.into(), source }
    }
}
