//! The solver's options.

use super::error::SolveError;

/// Tolerances and budgets of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct SolverOptions {
    /// Stop when the best step of the linear model lowers the cost by no more than this share of it.
    pub ftol: f64,
    /// Stop when a step that is still to be tried is no longer than this share of the parameters.
    pub xtol: f64,
    /// Stop when the residuals' cosine with every free column of the Jacobian is at most this.
    pub gtol: f64,
    /// Accepted steps and polishing trials allowed.
    pub max_iterations: u64,
    /// Length |Dδ| of the first step at most, as a share of |Dp| (D: lengths of the Jacobian's columns; where Dp = 0, the length itself).
    pub radius: f64,
    /// Most trials of one polish; 0 leaves it out.
    pub polish: u32,
    /// Relative offset |Jδ| / |r| of the undamped step from which on polishing is tried.
    pub polish_below: f64,
    /// A column of the scaled Jacobian that the others span to this share of its length counts as spanned by them.
    pub rank_tol: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            ftol: 1e-15,
            xtol: 1e-15,
            gtol: 1e-15,
            max_iterations: 1000,
            radius: 0.3,
            polish: 60,
            polish_below: 1e-3,
            rank_tol: 1e-13,
        }
    }
}

impl SolverOptions {
    /// # Errors
    /// [`SolveError::Option`] with the first field that is out of its range.
    pub fn validate(&self) -> Result<(), SolveError> {
        let share = |x: f64| (0.0..1.0).contains(&x);
        let checks = [
            ("ftol", self.ftol, share(self.ftol), "in [0, 1)"),
            ("xtol", self.xtol, share(self.xtol), "in [0, 1)"),
            ("gtol", self.gtol, share(self.gtol), "in [0, 1)"),
            ("radius", self.radius, self.radius > 0.0 && self.radius.is_finite(), "positive and finite"),
            ("polish_below", self.polish_below, share(self.polish_below), "in [0, 1)"),
            ("rank_tol", self.rank_tol, share(self.rank_tol), "in [0, 1)"),
        ];
        match checks.into_iter().find(|(_, _, ok, _)| !ok) {
            Some((field, value, _, constraint)) => Err(SolveError::Option { field, value, constraint }),
            None => Ok(()),
        }
    }
}
