//! Levenberg–Marquardt for any least-squares problem, as an argmin [`Solver`](argmin::core::Solver).
//!
//! In: a problem that gives its residuals and Jacobian ([`LeastSquares`]), or one that reduces both itself ([`Linearize`], for problems
//! too large to hold a Jacobian). Out: the parameters, why the search stopped, what each step did and, from [`solve`], rank and standard
//! errors. The one decision to know: the search (Moré's trust region, 1978) accepts steps by the cost, and the last digits, where the
//! cost no longer tells points apart, are won by undamped steps accepted by the length of the step that follows. Costs are Σ r² (no ½).
//!
//! ```
//! use goniofit::fit::solver::{Error, LeastSquares, SolverOptions, solve};
//! use nalgebra::{DMatrix, DVector};
//!
//! /// y = a exp(−b x)
//! struct Decay {
//!     x: Vec<f64>,
//!     y: Vec<f64>,
//! }
//!
//! impl LeastSquares for Decay {
//!     fn residuals(&self, p: &DVector<f64>) -> Result<DVector<f64>, Error> {
//!         let r = self.x.iter().zip(&self.y).map(|(x, y)| p[0] * (-p[1] * x).exp() - y);
//!         Ok(DVector::from_iterator(self.y.len(), r))
//!     }
//!
//!     fn jacobian(&self, p: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
//!         Ok(DMatrix::from_fn(self.x.len(), 2, |i, j| {
//!             let e = (-p[1] * self.x[i]).exp();
//!             if j == 0 { e } else { -p[0] * self.x[i] * e }
//!         }))
//!     }
//! }
//!
//! let data = Decay { x: vec![0.0, 1.0, 2.0, 3.0, 4.0], y: vec![2.03, 1.19, 0.75, 0.43, 0.28] };
//! let fit = solve(&data, DVector::from_vec(vec![1.0, 1.0]), &SolverOptions::default())?;
//! assert!(fit.converged() && fit.rank == 2);
//! for (value, error) in fit.parameters.iter().zip(&fit.standard_errors) {
//!     println!("{value} ± {}", error.unwrap_or(f64::NAN));
//! }
//! # assert!((fit.parameters[0] - 2.0).abs() < 0.1 && (fit.parameters[1] - 0.5).abs() < 0.05);
//! # Ok::<(), goniofit::fit::solver::SolveError>(())
//! ```
//!
//! With an [`Adapter`] argmin's own executor runs the same problem, with its observers, timers and limits:
//!
//! ```
//! use argmin::core::observers::{Observe, ObserverMode};
//! use argmin::core::{Executor, IterState, KV, State};
//! use goniofit::fit::solver::{Adapter, Error, LeastSquares, LevenbergMarquardt};
//! use nalgebra::{DMatrix, DVector};
//!
//! struct Rosenbrock;
//!
//! impl LeastSquares for Rosenbrock {
//!     fn residuals(&self, p: &DVector<f64>) -> Result<DVector<f64>, Error> {
//!         Ok(DVector::from_vec(vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]))
//!     }
//!
//!     fn jacobian(&self, p: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
//!         Ok(DMatrix::from_row_slice(2, 2, &[-20.0 * p[0], 10.0, -1.0, 0.0]))
//!     }
//! }
//!
//! type LmState = IterState<DVector<f64>, (), (), (), (), f64>;
//!
//! struct Print;
//!
//! impl Observe<LmState> for Print {
//!     fn observe_iter(&mut self, state: &LmState, _: &KV) -> Result<(), Error> {
//!         println!("{}: {:e}", state.get_iter(), state.get_cost());
//!         Ok(())
//!     }
//! }
//!
//! let start = DVector::from_vec(vec![-1.2, 1.0]);
//! let solver = LevenbergMarquardt::bounded(vec![(-2.0, 0.5), (-2.0, 2.0)]);
//! let result = Executor::new(Adapter::new(&Rosenbrock), solver)
//!     .configure(|state: LmState| state.param(start).max_iters(200))
//!     .add_observer(Print, ObserverMode::Always)
//!     .run()?;
//! println!("{:?} after {} steps", result.solver.stop(), result.solver.history().len() - 1);
//! let best = result.state().get_best_param().expect("a step was accepted");
//! assert!(result.solver.stop().is_some() && best[0] == 0.5 && (best[1] - 0.25).abs() < 1e-9);
//! # Ok::<(), Error>(())
//! ```

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
pub use least_squares::{Adapter, LeastSquares, Solution, solve};
pub use levenberg::LevenbergMarquardt;
pub use linearize::{Linearization, Linearize};
pub use options::SolverOptions;
pub use summary::{Iteration, Stop};

/// Where a minimisation ended.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The parameters.
    pub parameters: DVector<f64>,
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
/// A [`SolveError`] inside where options, bounds or start can't be used; else what the problem's evaluation returns.
pub fn minimize<O: Linearize>(
    problem: O,
    solver: LevenbergMarquardt,
    start: DVector<f64>,
    max_iterations: u64,
) -> Result<Outcome, Error> {
    solver.check(&start)?;
    if start.is_empty() {
        let cost = problem.cost(&start)?;
        return Ok(Outcome { parameters: start, cost, stop: Stop::Gradient { cosine: 0.0 }, history: Vec::new() });
    }
    let configure =
        |state: argmin::core::IterState<_, (), (), (), (), f64>| state.param(start).max_iters(max_iterations);
    let result = Executor::new(problem, solver).configure(configure).run()?;
    let (here, stop, history) = result.solver.into_parts();
    let here = here.ok_or_else(|| Error::msg("the solver lost its point"))?;
    Ok(Outcome { parameters: here.p, cost: here.at.cost, stop: stop.unwrap_or(Stop::MaxIterations), history })
}

/// The least cost within bounds, searched from the point of the box that is nearest to `from`; not to its last digits. `None` where the problem
/// can't be evaluated.
pub(super) fn least_cost<O: Linearize>(problem: O, bounds: &[(f64, f64)], from: &[f64]) -> Option<f64> {
    let options = SolverOptions { ftol: 1e-10, polish: 0, ..SolverOptions::default() };
    let lm = LevenbergMarquardt::new(options).with_bounds(bounds.to_vec());
    let start = from.iter().zip(bounds).map(|(t, (low, high))| t.clamp(*low, *high));
    let start = DVector::from_iterator(from.len(), start);
    minimize(problem, lm, start, LEAST_COST_STEPS).ok().map(|found| found.cost)
}

/// Steps that [`least_cost`] takes at most.
const LEAST_COST_STEPS: u64 = 30;
