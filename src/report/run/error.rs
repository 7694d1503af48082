//! Why there is no report.

use std::path::PathBuf;

use crate::chain::ChainError;

/// Why a folder can't be reported on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// No folder.
    #[error("{path}: expected the folder that demo, validate, fit or tradeoff wrote to, found no such folder", path = path.display())]
    NoFolder {
        /// What was named.
        path: PathBuf,
    },
    /// A file in place of a folder.
    #[error("{path}: expected the folder that demo, validate, fit or tradeoff wrote to, found a file", path = path.display())]
    NotFolder {
        /// What was named.
        path: PathBuf,
    },
    /// Nothing in it.
    #[error("{path}: expected numbers.json of demo or validate, fits (.json) or a sweep (tradeoff.json), found none of them", path = path.display())]
    Nothing {
        /// The folder.
        path: PathBuf,
    },
    /// A numbers.json of neither command.
    #[error("{path}: expected what demo or validate write, found an object with neither `truth` nor `reference`", path = path.display())]
    Numbers {
        /// The file.
        path: PathBuf,
    },
    /// A tradeoff.json of something else.
    #[error("{path}: expected what goniofit wrote there, found {source}", path = path.display())]
    Sweep {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// A file's JSON is broken.
    #[error("{path}: {source}", path = path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// The disk refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file of the run can't be read.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The page can't be put together.
    #[error("the page: {0}")]
    Page(String),
}
