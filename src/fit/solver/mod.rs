//! Levenberg–Marquardt.

mod error;
mod least_squares;
mod levenberg;
mod linearize;
mod local;
mod options;
mod polish;
mod qr;
mod radius;
mod summary;
#[cfg(test)]
mod tests;

use argmin::core::Executor;
use nalgebra::DVector;

pub use argmin::core::Error;
pub use error::SolveError;
pub use least_squares::{LeastSquares, Solution, solve};
pub use levenberg::LevenbergMarquardt;
pub use linearize::{Linearization, Linearize};
pub use options::SolverOptions;
pub use summary::{Iteration, Stop};

/// Where a minimisation ended.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The parameters.
    pub t: DVector<f64>,
    /// Σ r² there.
    pub cost: f64,
    /// Why it ended.
    pub stop: Stop,
    /// The start and every accepted step.
    pub history: Vec<Iteration>,
}

/// Runs the solver from `start` for at most `max_iterations` steps. With no parameters there is nothing to search.
///
/// # Errors
/// What the problem's evaluation returns.
pub fn minimize<O: Linearize>(
    problem: O,
    solver: LevenbergMarquardt,
    start: DVector<f64>,
    max_iterations: u64,
) -> Result<Outcome, Error> {
    if start.is_empty() {
        let cost = problem.cost(&start)?;
        return Ok(Outcome { t: start, cost, stop: Stop::Gradient { cosine: 0.0 }, history: Vec::new() });
    }
    let configure =
        |state: argmin::core::IterState<_, (), (), (), (), f64>| state.param(start).max_iters(max_iterations);
    let result = Executor::new(problem, solver).configure(configure).run()?;
    let (here, stop, history) = result.solver.into_parts();
    let here = here.ok_or_else(|| Error::msg("the solver lost its point"))?;
    Ok(Outcome { t: here.p, cost: here.at.cost, stop: stop.unwrap_or(Stop::MaxIterations), history })
}
