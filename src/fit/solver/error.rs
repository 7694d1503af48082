//! What keeps a least-squares problem from being solved.

use argmin::core::Error;

/// What keeps a least-squares problem from being solved. That the search ended early is no error: see [`Stop`](super::Stop).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// An option is out of its range.
    #[error("solver option {field} is {value}; it must be {constraint}")]
    Option {
        /// The option.
        field: &'static str,
        /// What it was.
        value: f64,
        /// What it must be.
        constraint: &'static str,
    },
    /// As many bounds as parameters are needed.
    #[error("{found} bounds were given for {expected} parameters")]
    BoundsCount {
        /// Bounds given.
        found: usize,
        /// Parameters.
        expected: usize,
    },
    /// A bound is NaN, or the lower one lies above the upper one.
    #[error("parameter {index} has the bounds [{low}, {high}]; the lower must not exceed the upper")]
    Bounds {
        /// The parameter.
        index: usize,
        /// Its lower bound.
        low: f64,
        /// Its upper bound.
        high: f64,
    },
    /// The start is not finite.
    #[error("parameter {index} starts at {value}; it must be finite")]
    Start {
        /// The parameter.
        index: usize,
        /// Its start.
        value: f64,
    },
    /// A residual or a derivative at the start is not finite.
    #[error("{what} is {value} at the start {start:?}")]
    NotFinite {
        /// Which number.
        what: String,
        /// What it was.
        value: f64,
        /// The start.
        start: Vec<f64>,
    },
    /// The Jacobian's shape does not fit the residuals and parameters.
    #[error("the Jacobian is {found:?}; {expected:?} (residuals × parameters) was expected")]
    JacobianShape {
        /// Rows and columns found.
        found: (usize, usize),
        /// Rows and columns expected.
        expected: (usize, usize),
    },
    /// The number of residuals changed from one point to the next.
    #[error("{found} residuals; there were {expected} at the start")]
    ResidualCount {
        /// Residuals found.
        found: usize,
        /// Residuals at the start.
        expected: usize,
    },
    /// The problem's own error.
    #[error("{0}")]
    Problem(Error),
}

impl From<Error> for SolveError {
    fn from(error: Error) -> Self {
        error.downcast::<Self>().unwrap_or_else(Self::Problem)
    }
}
