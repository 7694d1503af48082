//! The public face: any least-squares problem by its residuals and Jacobian, solved with its standard errors.

use std::cell::RefCell;

use argmin::core::Error;
use nalgebra::{DMatrix, DVector};

use super::error::SolveError;
use super::levenberg::LevenbergMarquardt;
use super::linearize::{Linearization, Linearize};
use super::options::SolverOptions;
use super::qr::PivotedQr;
use super::summary::{Iteration, Stop};
use super::{Outcome, minimize};

/// A least-squares problem: minimise Σ rᵢ(p)² over p, within bounds if there are any.
pub trait LeastSquares {
    /// The residuals r at `p`, always as many. A number that is not finite says that `p` can't be evaluated: the solver then tries
    /// a shorter step.
    ///
    /// # Errors
    /// What must end the search.
    fn residuals(&self, p: &DVector<f64>) -> Result<DVector<f64>, Error>;

    /// The Jacobian ∂rᵢ/∂pⱼ at `p`: a row for each residual, a column for each parameter.
    ///
    /// # Errors
    /// What must end the search.
    fn jacobian(&self, p: &DVector<f64>) -> Result<DMatrix<f64>, Error>;

    /// Inclusive range of each parameter, or `None` for no bounds; low = high pins a parameter.
    fn bounds(&self) -> Option<Vec<(f64, f64)>> {
        None
    }
}

/// Where a solve ended, and how sure of it one can be.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The parameters.
    pub parameters: DVector<f64>,
    /// Σ r² there.
    pub cost: f64,
    /// Why the search ended.
    pub stop: Stop,
    /// The start and every accepted step.
    pub history: Vec<Iteration>,
    /// Rank of the Jacobian, its columns scaled to length 1 and those of parameters at a bound left out.
    pub rank: usize,
    /// Standard error of each parameter, s √((JᵀJ)⁻¹)ⱼⱼ with s² = cost / (residuals − rank); `None` where the data do not determine it,
    /// where it stands at a bound, or where there are no more residuals than the rank.
    pub standard_errors: Vec<Option<f64>>,
    /// s² (JᵀJ)⁻¹ over all parameters; `None` where a standard error is missing.
    pub covariance: Option<DMatrix<f64>>,
    /// Residuals evaluated, each a full vector.
    pub residual_evaluations: u64,
    /// Jacobians evaluated.
    pub jacobian_evaluations: u64,
}

impl Solution {
    /// Whether the search came to an end of its own, not of its budget.
    #[must_use]
    pub fn converged(&self) -> bool {
        !matches!(self.stop, Stop::MaxIterations)
    }
}

/// Solves a problem from `start`.
///
/// # Errors
/// [`SolveError`] where options, bounds, start or Jacobian can't be used, or the problem returns an error.
pub fn solve<P: LeastSquares>(
    problem: &P,
    start: DVector<f64>,
    options: &SolverOptions,
) -> Result<Solution, SolveError> {
    let bounds = problem.bounds().unwrap_or_default();
    let adapter = Adapter::new(problem);
    let solver = LevenbergMarquardt::new(options.clone()).with_bounds(bounds.clone());
    let outcome = minimize(&adapter, solver, start, options.max_iterations)?;
    adapter.solution(outcome, &bounds, options)
}

/// A [`LeastSquares`] problem as the solver sees it, for argmin's executor (an example is in the [module's documentation](super)). The
/// problem's bounds are not part of it: the solver has them from [`LevenbergMarquardt::with_bounds`]. The last residuals are kept, for an
/// accepted trial is linearised where it was tried.
#[derive(Debug)]
pub struct Adapter<'a, P> {
    problem: &'a P,
    seen: RefCell<Seen>,
}

#[derive(Debug, Default)]
struct Seen {
    last: Option<(DVector<f64>, DVector<f64>)>,
    count: Option<usize>,
    residual_evaluations: u64,
    jacobian_evaluations: u64,
}

impl<'a, P: LeastSquares> Adapter<'a, P> {
    /// A view of `problem` that has not been evaluated yet.
    #[must_use]
    pub fn new(problem: &'a P) -> Self {
        Self { problem, seen: RefCell::default() }
    }

    fn residuals(&self, p: &DVector<f64>) -> Result<DVector<f64>, Error> {
        if let Some((at, r)) = &self.seen.borrow().last
            && at == p
        {
            return Ok(r.clone());
        }
        let r = self.problem.residuals(p)?;
        let mut seen = self.seen.borrow_mut();
        seen.residual_evaluations += 1;
        let expected = *seen.count.get_or_insert(r.len());
        if r.len() != expected {
            return Err(SolveError::ResidualCount { found: r.len(), expected }.into());
        }
        seen.last = Some((p.clone(), r.clone()));
        Ok(r)
    }

    fn jacobian(&self, p: &DVector<f64>, rows: usize) -> Result<DMatrix<f64>, Error> {
        let first = self.seen.borrow().jacobian_evaluations == 0;
        let j = self.problem.jacobian(p)?;
        self.seen.borrow_mut().jacobian_evaluations += 1;
        let expected = (rows, p.len());
        if j.shape() != expected {
            return Err(SolveError::JacobianShape { found: j.shape(), expected }.into());
        }
        if first && let Some(k) = j.iter().position(|x| !x.is_finite()) {
            let what = format!("the derivative of residual {} by parameter {}", k % rows, k / rows);
            return Err(SolveError::NotFinite { what, value: j[k], start: p.as_slice().to_vec() }.into());
        }
        Ok(j)
    }

    fn solution(
        self,
        outcome: Outcome,
        bounds: &[(f64, f64)],
        options: &SolverOptions,
    ) -> Result<Solution, SolveError> {
        let p = outcome.parameters;
        let r = self.residuals(&p)?;
        let j = self.jacobian(&p, r.len())?;
        let seen = self.seen.into_inner();
        let at_bound = |i: usize| bounds.get(i).is_some_and(|&(low, high)| p[i] <= low || p[i] >= high);
        let free: Vec<usize> = (0..p.len()).filter(|&i| !at_bound(i)).collect();
        let spread = Spread::new(&j, &free, r.norm_squared(), options.rank_tol);
        let mut standard_errors = vec![None; p.len()];
        free.iter().zip(spread.standard_errors).for_each(|(&i, e)| standard_errors[i] = e);
        Ok(Solution {
            cost: r.norm_squared(),
            stop: outcome.stop,
            history: outcome.history,
            rank: spread.rank,
            standard_errors,
            covariance: spread.covariance.filter(|_| free.len() == p.len()),
            residual_evaluations: seen.residual_evaluations,
            jacobian_evaluations: seen.jacobian_evaluations,
            parameters: p,
        })
    }
}

impl<P: LeastSquares> Linearize for Adapter<'_, P> {
    fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
        Ok(self.residuals(p)?.norm_squared())
    }

    fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
        let r = self.residuals(p)?;
        if self.seen.borrow().jacobian_evaluations == 0
            && let Some(k) = r.iter().position(|x| !x.is_finite())
        {
            let what = format!("residual {k}");
            return Err(SolveError::NotFinite { what, value: r[k], start: p.as_slice().to_vec() }.into());
        }
        Ok(Linearization::from_jacobian(&r, self.jacobian(p, r.len())?))
    }
}

/// Covariance and rank of the free parameters.
struct Spread {
    rank: usize,
    standard_errors: Vec<Option<f64>>,
    covariance: Option<DMatrix<f64>>,
}

impl Spread {
    fn new(jacobian: &DMatrix<f64>, free: &[usize], cost: f64, rank_tol: f64) -> Self {
        let rows = jacobian.nrows();
        let mut scaled = jacobian.select_columns(free);
        let lengths: Vec<f64> = scaled.column_iter().map(|c| c.norm()).collect();
        for (j, &l) in lengths.iter().enumerate().filter(|(_, l)| **l > 0.0) {
            scaled.column_mut(j).scale_mut(1.0 / l);
        }
        let qr = PivotedQr::new(scaled, DVector::zeros(rows), rank_tol);
        if rows <= qr.rank {
            return Self { rank: qr.rank, standard_errors: vec![None; free.len()], covariance: None };
        }
        let s2 = cost / (rows - qr.rank) as f64;
        let errors = qr.inverse_normal_diagonal().into_iter().zip(&lengths).map(|(d, l)| Some((s2 * d?).sqrt() / l));
        let unscaled = |c: DMatrix<f64>| c.map_with_location(|i, j, x| s2 * x / (lengths[i] * lengths[j]));
        Self { rank: qr.rank, standard_errors: errors.collect(), covariance: qr.inverse_normal().map(unscaled) }
    }
}
