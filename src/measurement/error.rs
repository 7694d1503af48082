//! What can be wrong with a measurement file. *Invalid*: the file contradicts its format. *Unsupported*: it may be right, but
//! goniofit can't use it. *Io*: the disk.

use std::path::{Path, PathBuf};

/// Why a measurement could not be read, written or used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasurementError {
    /// The operating system refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A binary file's length disagrees with its header.
    #[error("{path}: the header says {header}, so the file must hold {expected} bytes; it holds {found}", path = path.display())]
    Length {
        /// The file.
        path: PathBuf,
        /// What the header promises, in words.
        header: String,
        /// Bytes that the header calls for, in all.
        expected: u64,
        /// Bytes that there are.
        found: u64,
    },
    /// A place in the file does not hold what its format calls for.
    #[error("{path}, {place}: expected {expected}, found {found}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Where: a line and column, a byte offset, a field's name.
        place: String,
        /// What the format calls for.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The content can't be used for this.
    #[error("{path}: {reason}", path = path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Why, and what would work instead.
        reason: String,
    },
}

impl MeasurementError {
    /// `path` could not be read or written because of `source`.
    pub(crate) fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }

    /// At `place` of `path` stands `found` where `expected` belongs.
    pub(crate) fn invalid(
        path: &Path,
        place: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Invalid { path: path.into(), place: place.into(), expected: expected.into(), found: found.into() }
    }

    /// `path` may be right, but can't be used because of `reason`.
    pub(crate) fn unsupported(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unsupported { path: path.into(), reason: reason.into() }
    }
}
