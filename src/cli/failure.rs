//! A failed command: what to say, and which exit code.

use crate::chain::ChainError;
use crate::fit::FitError;
use crate::image::ImageError;
use crate::measurement::MeasurementError;
use crate::render::RenderError;

/// Why a command failed.
#[derive(Debug)]
pub(super) struct Failure {
    /// 1: the work failed; 2: the command line or an input file is wrong.
    pub code: u8,
    /// What to tell the user.
    pub message: String,
}

impl Failure {
    /// The command line or an input is wrong.
    pub fn usage(message: impl Into<String>) -> Self {
        Self { code: 2, message: message.into() }
    }

    /// The work failed.
    pub fn work(message: impl Into<String>) -> Self {
        Self { code: 1, message: message.into() }
    }

    /// An output could not be written.
    pub fn output(path: &std::path::Path, error: &std::io::Error) -> Self {
        Self::work(format!("{}: {error}", path.display()))
    }
}

impl From<MeasurementError> for Failure {
    fn from(error: MeasurementError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        Self::usage(error.to_string())
    }
}

impl From<FitError> for Failure {
    fn from(error: FitError) -> Self {
        let code = if matches!(error, FitError::Option { .. }) { 2 } else { 1 };
        Self { code, message: error.to_string() }
    }
}

impl From<ChainError> for Failure {
    fn from(error: ChainError) -> Self {
        match error {
            ChainError::Fit(error) => error.into(),
            ChainError::Write { .. } => Self::work(error.to_string()),
            other => Self::usage(other.to_string()),
        }
    }
}
