//! Levenberg–Marquardt as an argmin [`Solver`], for any problem that can linearise itself.
//!
//! Damping follows Nielsen (1999), with Marquardt's column scaling; bounds are kept by projection, with parameters that push
//! against a bound held there. Costs are Σ r² (no ½).

use argmin::core::{Error, Executor, IterState, KV, Problem, Solver, State, TerminationReason};
use nalgebra::{DMatrix, DVector};

use crate::numeric::float::larger;

/// A least-squares problem as the solver sees it.
pub trait Linearize {
    /// Σ r² at `p`.
    ///
    /// # Errors
    /// Whatever keeps the problem from being evaluated there.
    fn cost(&self, p: &DVector<f64>) -> Result<f64, Error>;

    /// The residuals' first-order model at `p`.
    ///
    /// # Errors
    /// Whatever keeps the problem from being evaluated there.
    fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error>;
}

/// Residuals r and Jacobian J at a point, reduced to as many rows as there are parameters: |r + Jδ|² = cost + 2 (Rδ)·q + |Rδ|².
#[derive(Debug, Clone)]
pub struct Linearization {
    /// Σ r².
    pub cost: f64,
    /// Any R with RᵀR = JᵀJ: the triangle of a QR factorisation, or a root of the normal matrix.
    pub factor: DMatrix<f64>,
    /// q with Rᵀq = Jᵀr.
    pub rhs: DVector<f64>,
}

impl Linearization {
    /// From residuals and Jacobian, by Householder QR (no squared condition number).
    #[must_use]
    pub fn from_jacobian(residuals: &DVector<f64>, jacobian: DMatrix<f64>) -> Self {
        let qr = jacobian.qr();
        let mut q = residuals.clone();
        qr.q_tr_mul(&mut q);
        let factor = qr.unpack_r();
        Self { cost: residuals.norm_squared(), rhs: q.rows(0, factor.nrows()).into_owned(), factor }
    }

    /// From the normal matrix JᵀJ and Jᵀr; directions in which JᵀJ is 0 to rounding don't move.
    #[must_use]
    pub fn from_normal(cost: f64, normal: DMatrix<f64>, gradient: &DVector<f64>) -> Self {
        let eigen = normal.symmetric_eigen();
        let floor = 1e-15 * eigen.eigenvalues.max().max(0.0);
        let root = eigen.eigenvalues.map(|l| if l > floor { l.sqrt() } else { 0.0 });
        let projected = eigen.eigenvectors.transpose() * gradient;
        let rhs = projected.zip_map(&root, |g, r| if r > 0.0 { g / r } else { 0.0 });
        Self { cost, factor: DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose(), rhs }
    }
}

impl<T: Linearize> Linearize for &T {
    fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
        (**self).cost(p)
    }

    fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
        (**self).linearize(p)
    }
}

/// Why the solver stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// The residuals are orthogonal to every column of the Jacobian that may move: the largest cosine is `cosine`.
    Gradient {
        /// Largest cosine.
        cosine: f64,
    },
    /// A step would lower the cost by less than the share `change` of it.
    Cost {
        /// Share predicted and found.
        change: f64,
    },
    /// No step longer than `length` (of |p| + 1) lowers the cost.
    Step {
        /// Relative length.
        length: f64,
    },
    /// The allowed number of steps was used up.
    MaxIterations,
}

/// One accepted step.
#[derive(Debug, Clone, PartialEq)]
pub struct Iteration {
    /// Cost after it.
    pub cost: f64,
    /// Parameters after it.
    pub parameters: Vec<f64>,
    /// Damping that it was taken with.
    pub damping: f64,
}

/// The solver and its tolerances.
#[derive(Debug, Clone)]
pub struct LevenbergMarquardt {
    /// Range of each parameter; empty for none.
    pub bounds: Vec<(f64, f64)>,
    /// Stop when predicted and actual relative reductions of the cost are below this.
    pub ftol: f64,
    /// Stop when a step is shorter than this share of |p| + 1.
    pub xtol: f64,
    /// Stop when the residuals' cosine with every free column is below this.
    pub gtol: f64,
    damping: f64,
    growth: f64,
    current: Option<Linearization>,
    stop: Option<Stop>,
    history: Vec<Iteration>,
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self {
            bounds: Vec::new(),
            ftol: 1e-15,
            xtol: 1e-13,
            gtol: 1e-15,
            damping: 1e-3,
            growth: 2.0,
            current: None,
            stop: None,
            history: Vec::new(),
        }
    }
}

type LmState = IterState<DVector<f64>, (), (), (), (), f64>;

impl LevenbergMarquardt {
    /// With the default tolerances, and a range for each parameter.
    #[must_use]
    pub fn bounded(bounds: Vec<(f64, f64)>) -> Self {
        Self { bounds, ..Self::default() }
    }

    fn bounds_of(&self, i: usize) -> (f64, f64) {
        self.bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY))
    }

    /// Whether parameter `i` stands at a bound that the descent direction pushes against.
    fn held(&self, i: usize, p: f64, gradient: f64) -> bool {
        let (low, high) = self.bounds_of(i);
        (p <= low && gradient > 0.0) || (p >= high && gradient < 0.0)
    }

    /// The point that the damped step leads to, projected into the bounds; held parameters stay. `None` where the damped
    /// equations have no solution in floating point.
    fn step(&self, at: &Linearization, p: &DVector<f64>, scale: &DVector<f64>, held: &[bool]) -> Option<DVector<f64>> {
        let (rows, n) = at.factor.shape();
        let mut stacked = DMatrix::zeros(rows + n, n);
        let mut rhs = DVector::zeros(rows + n);
        for j in 0..n {
            if held[j] {
                stacked[(rows + j, j)] = 1.0;
            } else {
                stacked.view_mut((0, j), (rows, 1)).copy_from(&at.factor.column(j));
                stacked[(rows + j, j)] = self.damping.sqrt() * scale[j];
            }
        }
        rhs.rows_mut(0, rows).copy_from(&-&at.rhs);
        let qr = stacked.qr();
        qr.q_tr_mul(&mut rhs);
        let delta = qr.r().solve_upper_triangular(&rhs.rows(0, n).into_owned())?;
        Some(DVector::from_fn(n, |i, _| {
            let (low, high) = self.bounds_of(i);
            if held[i] { p[i] } else { (p[i] + delta[i]).clamp(low, high) }
        }))
    }

    /// Largest cosine between the residuals and a free column.
    fn largest_cosine(at: &Linearization, gradient: &DVector<f64>, held: &[bool]) -> f64 {
        let norm = at.cost.sqrt();
        (0..gradient.len())
            .filter(|&j| !held[j])
            .map(|j| (gradient[j].abs(), at.factor.column(j).norm() * norm))
            .map(|(g, scale)| if g == 0.0 || scale == 0.0 { 0.0 } else { g / scale })
            .fold(0.0, larger)
    }

    fn finish(&mut self, state: LmState, stop: Stop) -> LmState {
        self.stop = Some(stop);
        state.terminate_with(TerminationReason::SolverConverged)
    }

    fn accept(&mut self, state: LmState, p: DVector<f64>, cost: f64, ratio: f64) -> LmState {
        self.history.push(Iteration { cost, parameters: p.as_slice().to_vec(), damping: self.damping });
        self.damping = (self.damping * (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0)).max(1e-20);
        self.growth = 2.0;
        state.param(p).cost(cost)
    }

    fn reject(&mut self) {
        self.damping *= self.growth;
        self.growth *= 2.0;
    }
}

impl<O: Linearize> Solver<O, LmState> for LevenbergMarquardt {
    fn name(&self) -> &'static str {
        "Levenberg-Marquardt"
    }

    fn init(&mut self, problem: &mut Problem<O>, mut state: LmState) -> Result<(LmState, Option<KV>), Error> {
        let mut p = state.take_param().ok_or_else(|| Error::msg("Levenberg-Marquardt needs a start"))?;
        for i in 0..p.len() {
            let (low, high) = self.bounds_of(i);
            p[i] = p[i].clamp(low, high);
        }
        let at = problem.problem("linearize_count", |o| o.linearize(&p))?;
        let cost = at.cost;
        self.history = vec![Iteration { cost, parameters: p.as_slice().to_vec(), damping: self.damping }];
        self.current = Some(at);
        Ok((state.param(p).cost(cost), None))
    }

    fn next_iter(&mut self, problem: &mut Problem<O>, mut state: LmState) -> Result<(LmState, Option<KV>), Error> {
        let p = state.take_param().ok_or_else(|| Error::msg("the solver lost its point"))?;
        let at = match self.current.take() {
            Some(at) => at,
            None => problem.problem("linearize_count", |o| o.linearize(&p))?,
        };
        let gradient = at.factor.transpose() * &at.rhs;
        // A column of zeros, a lobe without weight say, gives no direction: its parameter stays.
        let idle = |i: usize| at.factor.column(i).norm() == 0.0;
        let held: Vec<bool> = (0..p.len()).map(|i| idle(i) || self.held(i, p[i], gradient[i])).collect();
        let cosine = Self::largest_cosine(&at, &gradient, &held);
        if at.cost <= 0.0 || cosine <= self.gtol {
            let state = state.param(p).cost(at.cost);
            return Ok((self.finish(state, Stop::Gradient { cosine }), None));
        }
        let scale = DVector::from_fn(p.len(), |j, _| at.factor.column(j).norm());
        loop {
            let Some(next) = self.step(&at, &p, &scale, &held).filter(|next| next.iter().all(|x| x.is_finite())) else {
                return Err(Error::msg("a step is not finite: the problem's derivatives overflow"));
            };
            let delta = &next - &p;
            let length = delta.iter().zip(p.iter()).map(|(d, p)| d.abs() / (p.abs() + 1.0)).fold(0.0, larger);
            if length <= self.xtol {
                let state = state.param(p).cost(at.cost);
                return Ok((self.finish(state, Stop::Step { length }), None));
            }
            let cost = problem.problem("cost_count", |o| o.cost(&next))?;
            let predicted = -(2.0 * gradient.dot(&delta) + (&at.factor * &delta).norm_squared());
            let actual = at.cost - cost;
            if actual > 0.0 && predicted > 0.0 {
                let change = (actual / at.cost).max(predicted / at.cost);
                let state = self.accept(state, next, cost, actual / predicted);
                if change <= self.ftol {
                    return Ok((self.finish(state, Stop::Cost { change }), None));
                }
                return Ok((state, None));
            }
            self.reject();
        }
    }
}

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
    let result =
        Executor::new(problem, solver).configure(|state| state.param(start).max_iters(max_iterations)).run()?;
    let solver = result.solver;
    // The last accepted step is the best: the cost never rises.
    let last = solver.history.last().cloned().ok_or_else(|| Error::msg("no step was recorded"))?;
    Ok(Outcome {
        t: DVector::from_vec(last.parameters),
        cost: last.cost,
        stop: solver.stop.unwrap_or(Stop::MaxIterations),
        history: solver.history,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Rosenbrock;

    impl Linearize for Rosenbrock {
        fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
            Ok((10.0 * (p[1] - p[0] * p[0])).powi(2) + (1.0 - p[0]).powi(2))
        }

        fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
            let r = DVector::from_vec(vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]);
            let j = DMatrix::from_row_slice(2, 2, &[-20.0 * p[0], 10.0, -1.0, 0.0]);
            Ok(Linearization::from_jacobian(&r, j))
        }
    }

    #[test]
    fn the_curved_valley_is_followed_to_its_end() {
        let start = DVector::from_vec(vec![-1.2, 1.0]);
        let out = minimize(Rosenbrock, LevenbergMarquardt::default(), start, 200).expect("runs");
        assert!((out.t[0] - 1.0).abs() < 1e-12 && (out.t[1] - 1.0).abs() < 1e-12, "{out:?}");
        assert!(out.history.windows(2).all(|w| w[1].cost <= w[0].cost));
    }

    #[test]
    fn a_bound_holds_the_parameter_that_pushes_against_it() {
        let bounds = vec![(-2.0, 0.5), (-10.0, 10.0)];
        let lm = LevenbergMarquardt { bounds, ..LevenbergMarquardt::default() };
        let out = minimize(Rosenbrock, lm, DVector::from_vec(vec![-1.2, 1.0]), 200).expect("runs");
        // On x = ½ the minimum is y = x².
        assert!((out.t[0] - 0.5).abs() < 1e-15 && (out.t[1] - 0.25).abs() < 1e-9, "{out:?}");
    }

    #[test]
    fn a_column_of_zeros_does_not_stop_the_others() {
        struct Idle;
        impl Linearize for Idle {
            fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
                Ok((p[0] - 3.0).powi(2) + 1.0)
            }
            fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
                let r = DVector::from_vec(vec![p[0] - 3.0, 1.0]);
                Ok(Linearization::from_jacobian(&r, DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0])))
            }
        }
        let out = minimize(Idle, LevenbergMarquardt::default(), DVector::from_vec(vec![-7.0, 5.0]), 50).expect("runs");
        assert!((out.t[0] - 3.0).abs() < 1e-9 && out.t[1] == 5.0, "{out:?}");
    }

    #[test]
    fn the_step_budget_is_kept_and_said() {
        let out =
            minimize(Rosenbrock, LevenbergMarquardt::default(), DVector::from_vec(vec![-1.2, 1.0]), 3).expect("runs");
        assert_eq!(out.stop, Stop::MaxIterations);
    }

    #[test]
    fn both_ways_to_reduce_a_jacobian_give_the_same_model() {
        let j = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 0.5, -1.0, 3.0, 0.25]);
        let r = DVector::from_vec(vec![0.3, -0.7, 1.1]);
        let a = Linearization::from_jacobian(&r, j.clone());
        let b = Linearization::from_normal(r.norm_squared(), j.transpose() * &j, &(j.transpose() * &r));
        assert!((a.factor.transpose() * &a.factor - b.factor.transpose() * &b.factor).norm() < 1e-13);
        assert!((a.factor.transpose() * &a.rhs - b.factor.transpose() * &b.rhs).norm() < 1e-13);
    }
}
