//! A failed command: what to say, and which exit code.

use crate::chain::ChainError;
use crate::fit::FitError;
use crate::image::ImageError;
use crate::measurement::{MeasurementError, STOPPED};
use crate::render::RenderError;

/// Why a command failed.
#[derive(Debug)]
pub(super) struct Failure {
    /// 1: the work failed; 2: the command line or an input file is wrong; 130: stopped.
    pub code: u8,
    /// What to tell the user.
    pub message: String,
    /// What was found all the same: as text, and as a JSON object that the error joins.
    pub found: Option<Box<(String, serde_json::Value)>>,
}

impl Failure {
    /// The command line or an input is wrong.
    pub fn usage(message: impl Into<String>) -> Self {
        Self { code: 2, message: message.into(), found: None }
    }

    /// The work failed.
    pub fn work(message: impl Into<String>) -> Self {
        Self { code: 1, message: message.into(), found: None }
    }

    /// The work was stopped before there was anything to show.
    pub fn stopped(message: impl Into<String>) -> Self {
        Self { code: 130, message: message.into(), found: None }
    }

    /// The same, of work that was asked to stop and so had no chance to succeed.
    pub fn while_stopping(self) -> Self {
        let is_said = self.message.starts_with(STOPPED.trim_end());
        let message = if is_said { self.message } else { format!("stopped: {}", self.message) };
        Self { code: 130, message, ..self }
    }

    /// With results that were found all the same, as text and as a JSON object.
    pub fn beside(self, text: String, object: serde_json::Value) -> Self {
        Self { found: Some(Box::new((text, object))), ..self }
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
        if matches!(error, RenderError::Memory { .. }) {
            return Self::work(error.to_string());
        }
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
        let message = error.to_string();
        match error {
            FitError::Option { .. } => Self::usage(format!("--{message}")),
            FitError::Infeasible { .. } => Self::usage(format!("--conserve-energy: {message}")),
            FitError::Channels { .. }
            | FitError::Limit { .. }
            | FitError::LimitTwice { .. }
            | FitError::Overflow { .. }
            | FitError::Underflow { .. } => Self::usage(message),
            FitError::OutOfTime { .. } => Self::work(format!("--{message}")),
            _ => Self::work(message),
        }
    }
}

impl From<ChainError> for Failure {
    fn from(error: ChainError) -> Self {
        match error {
            ChainError::Fit(error) => error.into(),
            ChainError::Render(error) => error.into(),
            ChainError::Write { .. } => Self::work(error.to_string()),
            other => Self::usage(other.to_string()),
        }
    }
}
