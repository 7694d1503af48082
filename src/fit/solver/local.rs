//! A point of the search with its linear model, and the steps that model proposes inside the bounds.

use nalgebra::{DMatrix, DVector};

use super::error::SolveError;
use super::linearize::Linearization;
use super::qr::PivotedQr;
use crate::numeric::float::larger;

/// Range of each parameter; a parameter beyond the list has none.
#[derive(Debug, Clone, Default)]
pub(super) struct Bounds(pub Vec<(f64, f64)>);

impl Bounds {
    pub fn of(&self, i: usize) -> (f64, f64) {
        self.0.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY))
    }

    /// Whether there are as many as parameters, or none at all, and each has its ends in order.
    pub fn check(&self, parameters: usize) -> Result<(), SolveError> {
        let bounds = &self.0;
        if !bounds.is_empty() && bounds.len() != parameters {
            return Err(SolveError::BoundsCount { found: bounds.len(), expected: parameters });
        }
        match bounds.iter().enumerate().find(|(_, (low, high))| low.is_nan() || high.is_nan() || low > high) {
            Some((index, &(low, high))) => Err(SolveError::Bounds { index, low, high }),
            None => Ok(()),
        }
    }

    /// The point of the box that is nearest to `p`, parameter by parameter.
    pub fn project(&self, p: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(p.len(), |i, _| {
            let (low, high) = self.of(i);
            if p[i] < low {
                low
            } else if p[i] > high {
                high
            } else {
                p[i]
            } // NaN stays, where `clamp` would too
        })
    }
}

/// A proposed step.
#[derive(Debug, Clone)]
pub(super) struct Step {
    /// Where it leads: inside the bounds.
    pub to: DVector<f64>,
    /// What it adds.
    pub delta: DVector<f64>,
    /// Rank of the system that it solves.
    pub rank: usize,
}

/// A point, its linear model and what follows from both.
#[derive(Debug, Clone)]
pub(super) struct Local {
    pub p: DVector<f64>,
    pub at: Linearization,
    /// Jᵀr.
    pub gradient: DVector<f64>,
    /// Length of each column of J.
    pub lengths: DVector<f64>,
    /// Parameters that stay: pinned, without influence, or pushed against a bound.
    held: Vec<bool>,
}

impl Local {
    pub fn new(p: DVector<f64>, at: Linearization, bounds: &Bounds) -> Self {
        let gradient = at.factor.transpose() * &at.rhs;
        let lengths = DVector::from_iterator(p.len(), at.factor.column_iter().map(|c| c.norm()));
        let held = (0..p.len()).map(|i| lengths[i] == 0.0 || pushes_out(bounds.of(i), p[i], gradient[i])).collect();
        Self { p, at, gradient, lengths, held }
    }

    /// Largest cosine between the residuals and a column that may move.
    pub fn largest_cosine(&self) -> f64 {
        let norm = self.at.cost.sqrt();
        (0..self.p.len())
            .filter(|&j| !self.held[j] && self.gradient[j] != 0.0)
            .map(|j| self.gradient[j].abs() / (self.lengths[j] * norm))
            .fold(0.0, larger)
    }

    /// The minimiser of |r + Jδ|² + damping |Dδ|² inside the bounds, with D = diag(`scale`): a parameter that would cross a bound is put
    /// on it and the others are solved for again.
    pub fn step(&self, damping: f64, scale: &DVector<f64>, bounds: &Bounds, rank_tol: f64) -> Step {
        let n = self.p.len();
        let mut target: Vec<Option<f64>> = (0..n).map(|i| self.held[i].then_some(self.p[i])).collect();
        loop {
            let free: Vec<usize> = (0..n).filter(|&i| target[i].is_none()).collect();
            let fixed = DVector::from_fn(n, |i, _| target[i].map_or(0.0, |t| t - self.p[i]));
            let (part, rank) = self.solve_free(&free, &fixed, damping, scale, rank_tol);
            let mut crossed = false;
            for (k, &i) in free.iter().enumerate() {
                let (low, high) = bounds.of(i);
                let to = self.p[i] + part[k];
                if to < low || to > high {
                    target[i] = Some(if to < low { low } else { high });
                    crossed = true;
                }
            }
            if !crossed {
                let mut to = DVector::from_fn(n, |i, _| target[i].unwrap_or(self.p[i]));
                free.iter().enumerate().for_each(|(k, &i)| to[i] += part[k]);
                return Step { delta: &to - &self.p, to, rank };
            }
        }
    }

    /// Steps of the `free` parameters, the others moving by `fixed`.
    fn solve_free(
        &self,
        free: &[usize],
        fixed: &DVector<f64>,
        damping: f64,
        scale: &DVector<f64>,
        rank_tol: f64,
    ) -> (DVector<f64>, usize) {
        let rows = self.at.factor.nrows();
        let damped = if damping > 0.0 { free.len() } else { 0 };
        let mut a = DMatrix::zeros(rows + damped, free.len());
        for (k, &j) in free.iter().enumerate() {
            a.view_mut((0, k), (rows, 1)).copy_from(&(self.at.factor.column(j) / scale[j]));
            if damped > 0 {
                a[(rows + k, k)] = damping.sqrt();
            }
        }
        let mut b = DVector::zeros(rows + damped);
        b.rows_mut(0, rows).copy_from(&-(&self.at.rhs + &self.at.factor * fixed));
        let qr = PivotedQr::new(a, b, rank_tol);
        let z = qr.solve();
        (DVector::from_fn(free.len(), |k, _| z[k] / scale[free[k]]), qr.rank)
    }

    /// What the model promises: cost − |r + Jδ|².
    pub fn predicted(&self, delta: &DVector<f64>) -> f64 {
        -(2.0 * self.gradient.dot(delta) + (&self.at.factor * delta).norm_squared())
    }

    /// |Jδ| / |r|: the share of the residuals that a step changes (Bates and Watts's relative offset, for an undamped step).
    pub fn offset(&self, delta: &DVector<f64>) -> f64 {
        let changed = (&self.at.factor * delta).norm();
        if changed == 0.0 { 0.0 } else { changed / self.at.cost.sqrt() }
    }
}

/// Whether a parameter is pinned, or stands at a bound that the descent direction pushes against.
fn pushes_out((low, high): (f64, f64), p: f64, gradient: f64) -> bool {
    low >= high || (p <= low && gradient > 0.0) || (p >= high && gradient < 0.0)
}

/// |Dδ| / |Dp|: the length of a step as a share of the parameters, independent of their units.
pub(super) fn relative_length(delta: &DVector<f64>, p: &DVector<f64>, scale: &DVector<f64>) -> f64 {
    let length = delta.component_mul(scale).norm();
    if length == 0.0 { 0.0 } else { length / p.component_mul(scale).norm() }
}
