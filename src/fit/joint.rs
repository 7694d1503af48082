//! The fit in weights and shapes together, on true residuals: where the last digits are won.
//!
//! Small tables give their Jacobian row by row, so that its condition number is not squared; large ones its normal matrix.

use argmin::core::Error;
use nalgebra::{DMatrix, DVector};

use super::passes::{self, Scratch, Want};
use super::reduced::{Problem, Solution, spread_into};
use super::samples::Block;
use super::solver::{self, LevenbergMarquardt, Linearization, Linearize, Outcome, SolverOptions};

/// Entries of the largest Jacobian that is formed: 32 MB.
const LARGEST: usize = 4_000_000;
/// More parameters than this are not searched together.
const MOST: usize = 60;

/// Least eigenvalue of Newton's matrix, its diagonal scaled to 1, at which its step is trusted.
const CLEARLY_POSITIVE: f64 = 1e-9;

/// How far a descent goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Digits {
    /// Until the cost hardly tells points apart.
    Rough,
    /// Until the cost is known to this share of it, never by the Jacobian.
    Cost(f64),
    /// To the last.
    All,
}

/// The problem by all its parameters: weights channel by channel, lobe by lobe, then every t.
#[derive(Debug)]
struct Joint<'a> {
    problem: &'a Problem<'a>,
    dense: bool,
}

/// Polishes a solution in all parameters at once. `None` where that can't be: a bound on the weights' sum is no range, and very many
/// parameters take too long.
pub(super) fn polish(
    problem: &Problem<'_>,
    start: &Solution,
    steps: u64,
    digits: Digits,
) -> Option<Result<(Solution, Outcome), Error>> {
    let parameters = problem.parameters();
    let only_cost = matches!(digits, Digits::Cost(_));
    if !has_few_parameters(problem)
        || only_cost && problem.cap.is_some()
        || start.weights.iter().enumerate().any(|(c, x)| problem.is_capped(c, x))
    {
        return None;
    }
    let dense = !only_cost && !problem.samples.are_drawn && problem.samples.residuals() * parameters <= LARGEST;
    let joint = Joint { problem, dense };
    let ranges = problem.ranges.iter().flatten().chain(&problem.bounds).copied().collect();
    let (ftol, polish) = match digits {
        Digits::Rough => (1e-9, 0),
        Digits::Cost(share) => (share, 0),
        // On large tables a step takes a pass, and Newton's doubles the digits.
        Digits::All => (1e-15, if dense { 60 } else { 12 }),
    };
    let options = SolverOptions { rank_tol: 1e-14, ftol, polish, ..SolverOptions::default() };
    let lm = LevenbergMarquardt::new(options).with_bounds(ranges);
    let p = start.weights.iter().flat_map(|x| x.iter().copied()).chain(start.t.iter().copied());
    let found = solver::minimize(&joint, lm, DVector::from_iterator(parameters, p), steps);
    let found = found.map(|outcome| (joint.solution(&outcome.parameters, outcome.cost), outcome));
    // The ranges know nothing of the cap: a step may have gone beyond it.
    let within = |x: &DVector<f64>| problem.cap.is_none_or(|cap| x.sum() <= cap);
    Some(found).filter(|found| found.as_ref().map_or(true, |(at, _)| at.weights.iter().all(within)))
}

/// Whether the parameters are few enough to be searched together.
pub(super) fn has_few_parameters(problem: &Problem<'_>) -> bool {
    problem.parameters() <= MOST
}

impl Joint<'_> {
    fn solution(&self, p: &DVector<f64>, cost: f64) -> Solution {
        let (channels, lobes) = (self.problem.ranges.len(), self.problem.kinds.len());
        let weights = (0..channels).map(|c| p.rows(c * lobes, lobes).into_owned()).collect();
        let t = p.rows(channels * lobes, self.problem.layout.len()).as_slice().to_vec();
        Solution { lobes: self.problem.shaped(&t), t, weights, cost }
    }

    /// By Newton's matrix, which follows a loss's own curvature, where it is positive; else by Gauss and Newton's, which always is.
    fn by_normal(&self, at: &Solution) -> Linearization {
        let (cost, normal, gradient) = self.newton(at).unwrap_or_else(|| self.assembled(at, Want::All));
        Linearization::from_normal(cost, normal, &gradient)
    }

    /// Cost, Newton's matrix without the lobes' own second slopes by their shapes, and half the gradient. `None` for a linear loss, which
    /// has nothing to gain, and where the matrix is not clearly positive.
    fn newton(&self, at: &Solution) -> Option<(f64, DMatrix<f64>, DVector<f64>)> {
        let problem = self.problem;
        if problem.samples.loss.is_linear() && problem.saturation.is_none() {
            return None;
        }
        let sums = self.assembled(at, Want::Newton);
        let diagonal = sums.1.diagonal();
        let root = diagonal.map(f64::sqrt);
        let scaled = sums.1.map_with_location(|i, j, x| x / (root[i] * root[j]));
        let positive = diagonal.iter().all(|d| *d > 0.0) && scaled.iter().all(|x| x.is_finite());
        (positive && scaled.symmetric_eigenvalues().min() > CLEARLY_POSITIVE).then_some(sums)
    }

    /// Cost, normal matrix and half the gradient from one pass.
    fn assembled(&self, at: &Solution, want: Want) -> (f64, DMatrix<f64>, DVector<f64>) {
        let problem = self.problem;
        let (channels, lobes) = (at.weights.len(), problem.kinds.len());
        let parameters = problem.parameters();
        let sums = passes::sums(problem.samples, &at.lobes, &at.weights, problem.saturation, want);
        let (mut normal, mut gradient) = (DMatrix::zeros(parameters, parameters), DVector::zeros(parameters));
        for (c, sums) in sums.iter().enumerate() {
            let (place, strength) = (problem.place(channels, c), problem.strength(&at.weights[c]));
            place.iter().enumerate().for_each(|(i, &a)| gradient[a] += strength[i] * sums.gradient[i]);
            spread_into(&mut normal, &sums.normal, &strength, &place);
            if want == Want::Newton {
                // A lobe's slope is times its weight: ∂²f by both is the bare slope.
                for (i, (lobe, _)) in problem.layout.iter().enumerate() {
                    let (a, b) = (c * lobes + lobe, channels * lobes + i);
                    normal[(a, b)] += sums.gradient[lobes + i];
                    normal[(b, a)] += sums.gradient[lobes + i];
                }
            }
        }
        (sums.iter().map(|s| s.cost).sum(), normal, gradient)
    }

    /// Residuals and Jacobian of every value, robust weights as of here.
    fn by_rows(&self, at: &Solution) -> Linearization {
        let samples = self.problem.samples;
        let parameters = self.problem.parameters();
        let (mut rows, mut residuals, mut cost): (Vec<f64>, Vec<f64>, f64) = (Vec::new(), Vec::new(), 0.0);
        let parts = samples.map_pieces(
            || (Vec::new(), Vec::new(), 0.0, Scratch::default()),
            |(rows, residuals, cost, scratch), block| {
                *cost += self.rows(at, block, scratch, rows, residuals, parameters);
            },
        );
        for (part, r, c, _) in parts {
            rows.extend(part);
            residuals.extend(r);
            cost += c;
        }
        let (rows, mut residuals) = largest_first(&rows, &residuals, parameters);
        let jacobian = DMatrix::from_row_iterator(residuals.len().max(parameters), parameters, {
            let missing = residuals.len().max(parameters) * parameters - rows.len();
            rows.into_iter().chain(std::iter::repeat_n(0.0, missing))
        });
        residuals.resize(jacobian.nrows(), 0.0);
        Linearization { cost, ..Linearization::from_jacobian(&DVector::from_vec(residuals), jacobian) }
    }

    /// Appends the rows of a block, and returns its cost.
    fn rows(
        &self,
        at: &Solution,
        block: &Block,
        scratch: &mut Scratch,
        rows: &mut Vec<f64>,
        residuals: &mut Vec<f64>,
        parameters: usize,
    ) -> f64 {
        let mut cost = 0.0;
        scratch.basis(self.problem.samples, block, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            cost += scratch.residuals(self.problem.samples, block, c, x, self.problem.saturation);
            let (place, strength) = (self.problem.place(at.weights.len(), c), self.problem.strength(&at.weights[c]));
            for (i, w) in block.weight(c).iter().enumerate().filter(|(_, w)| **w > 0.0) {
                let root = (w * scratch.trust.get(i).copied().unwrap_or(1.0)).sqrt();
                let mut row = vec![0.0; parameters];
                for (k, column) in scratch.columns.iter().enumerate() {
                    row[place[k]] = root * scratch.slope[i] * strength[k] * column[i];
                }
                rows.extend(row);
                residuals.push(root * scratch.r[i]);
            }
        }
        cost
    }
}

/// Rows by falling size: Householder's QR keeps the digits of small rows, the samples far from a sharp peak, only when it meets the large
/// ones first (Powell & Reid 1969).
fn largest_first(rows: &[f64], residuals: &[f64], width: usize) -> (Vec<f64>, Vec<f64>) {
    let size = |i: usize| rows[i * width..(i + 1) * width].iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let mut order: Vec<(f64, usize)> = (0..residuals.len()).map(|i| (size(i), i)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let sorted = order.iter().flat_map(|(_, i)| rows[i * width..(i + 1) * width].iter().copied()).collect();
    (sorted, order.iter().map(|(_, i)| residuals[*i]).collect())
}

impl Linearize for Joint<'_> {
    fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
        let at = self.solution(p, f64::NAN);
        let sums = passes::sums(self.problem.samples, &at.lobes, &at.weights, self.problem.saturation, Want::Gradient);
        Ok(sums.iter().map(|s| s.cost).sum())
    }

    fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
        let at = self.solution(p, f64::NAN);
        Ok(if self.dense { self.by_rows(&at) } else { self.by_normal(&at) })
    }
}
