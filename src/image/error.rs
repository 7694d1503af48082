//! What can be wrong with a picture. *Invalid*: the file contradicts its format; *unsupported*: it holds something else than RGB;
//! *io*: the disk.

use std::path::PathBuf;

/// Why a picture could not be read, written or compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The operating system refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is broken.
    #[error("{path}: not a valid {format} file: {reason}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The format that it should have.
        format: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// The file is right, but not a picture of linear RGB.
    #[error("{path}: expected {expected}, found {found}", path = path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is needed.
        expected: String,
        /// What is there.
        found: String,
    },
    /// Two pictures have different sizes.
    #[error("the picture is {}x{} pixels, its reference {}x{}; only pictures of one size can be compared", .image.0, .image.1, .reference.0, .reference.1)]
    Sizes {
        /// Width and height of the picture.
        image: (usize, usize),
        /// Width and height of the reference.
        reference: (usize, usize),
    },
    /// A picture's layers disagree with its size.
    #[error("a picture of {width}x{height} pixels has a layer `{layer}` of {found} pixels")]
    Layer {
        /// The layer.
        layer: &'static str,
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
        /// Pixels in the layer.
        found: usize,
    },
    /// An encoder failed.
    #[error("the picture can't be encoded as {format}: {reason}")]
    Encode {
        /// The format.
        format: &'static str,
        /// What the encoder said.
        reason: String,
    },
    /// The embedded font can't be read.
    #[error("the font for labels can't be read: {0}")]
    Font(String),
}
