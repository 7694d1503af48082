//! The reduced cost by passes over the samples, for losses that are not linear in the weights.

use std::cell::RefCell;

use argmin::core::Error;
use nalgebra::DVector;

use super::passes::{self, ShapedLobe, Sums, Want};
use super::quadratic::Quadratic;
use super::reduced::{Problem, Solution};
use super::solver::{Linearization, Linearize};

/// The problem evaluated by passes over the samples; the weights come from an inner Newton iteration on the loss's own curvature, damped
/// where it overshoots (a linear loss needs one step).
#[derive(Debug)]
pub(super) struct Streamed<'a> {
    problem: &'a Problem<'a>,
    /// Weights that are known from elsewhere: where the first point's start.
    first: Option<Vec<DVector<f64>>>,
    /// The last point solved: where the next one's weights start.
    last: RefCell<Option<Solution>>,
    /// Predicted share of the cost at which the inner iteration ends.
    tolerance: f64,
}

/// Steps of the inner iteration at most, and the predicted share of the cost at which it ends.
const INNER_STEPS: usize = 60;
const INNER_TOLERANCE: f64 = 1e-15;
const ROUGH_TOLERANCE: f64 = 1e-7;
/// Weight of every lobe, in the samples' scale, where the inner iteration begins: not 0, for slopes there may be infinite.
const FIRST_WEIGHT: f64 = 0.1;

impl<'a> Streamed<'a> {
    pub fn new(problem: &'a Problem<'a>) -> Self {
        Self { problem, first: None, last: RefCell::new(None), tolerance: INNER_TOLERANCE }
    }

    /// Good enough to tell valleys apart.
    pub fn rough(problem: &'a Problem<'a>) -> Self {
        Self { tolerance: ROUGH_TOLERANCE, ..Self::new(problem) }
    }

    /// Starting at weights known from elsewhere.
    pub fn starting_at(self, weights: &Solution) -> Self {
        Self { first: Some(weights.weights.clone()), ..self }
    }

    /// The weights that minimise the cost at `t`.
    pub fn solve(&self, t: &[f64]) -> Solution {
        let last = self.last.borrow().clone();
        if let Some(known) = last.as_ref().filter(|s| s.t == t) {
            return known.clone();
        }
        let lobes = self.problem.shaped(t);
        let start = last.map(|s| s.weights).or_else(|| self.first.clone()).unwrap_or_else(|| self.first_weights());
        let solution = self.descend(t, lobes, &start);
        *self.last.borrow_mut() = Some(solution.clone());
        solution
    }

    /// Weights to begin with: [`FIRST_WEIGHT`] each, where the ranges and the cap let it be.
    fn first_weights(&self) -> Vec<DVector<f64>> {
        vec![DVector::from_element(self.problem.kinds.len(), FIRST_WEIGHT); self.problem.ranges.len()]
    }

    fn descend(&self, t: &[f64], lobes: Vec<ShapedLobe>, start: &[DVector<f64>]) -> Solution {
        let problem = self.problem;
        let evaluate = |x: &[DVector<f64>]| passes::sums(problem.samples, &lobes, x, problem.saturation, Want::Weights);
        let mut x: Vec<_> = start.iter().enumerate().map(|(c, x)| problem.within(c, x)).collect();
        let mut at = evaluate(&x);
        let mut damping = vec![0.0f64; x.len()];
        for _ in 0..INNER_STEPS {
            let total: f64 = at.iter().map(|s| s.cost).sum();
            let trial: Vec<(DVector<f64>, f64)> =
                (0..x.len()).map(|c| self.inner_step(c, &x[c], &at[c], damping[c])).collect();
            if trial.iter().map(|(_, gain)| gain).sum::<f64>() <= self.tolerance * total || total == 0.0 {
                break;
            }
            let next: Vec<DVector<f64>> = trial.iter().map(|(x, _)| x.clone()).collect();
            let found = evaluate(&next);
            let mut moved = false;
            for c in 0..x.len() {
                if found[c].cost <= at[c].cost {
                    damping[c] = if damping[c] > 1e-6 { damping[c] / 16.0 } else { 0.0 };
                    moved |= found[c].cost < at[c].cost;
                    x[c].clone_from(&next[c]);
                    at[c] = found[c].clone();
                } else {
                    damping[c] = (8.0 * damping[c]).max(0.03);
                }
            }
            let hopeless = damping.iter().all(|d| *d == 0.0 || *d > 1e12);
            if !moved && hopeless {
                break;
            }
        }
        let cost = at.iter().map(|s| s.cost).sum();
        Solution { t: t.to_vec(), lobes, weights: x, cost }
    }

    /// The minimum of one channel's quadratic model, with damping as a share of its diagonal, and how much it promises.
    fn inner_step(&self, channel: usize, x: &DVector<f64>, at: &Sums, damping: f64) -> (DVector<f64>, f64) {
        let k = x.len();
        let mut gram = at.normal.view((0, 0), (k, k)).into_owned();
        for i in 0..k {
            gram[(i, i)] *= 1.0 + damping;
        }
        let gradient = at.gradient.rows(0, k);
        let b = &gram * x - gradient;
        let quadratic = Quadratic::new(k, |i, j| gram[(i, j)], |i| b[i]);
        let next = DVector::from_column_slice(&quadratic.minimise(&self.problem.feasible(channel))[..k]);
        let step = &next - x;
        let gain = -(2.0 * step.dot(&gradient) + step.dot(&(&gram * &step)));
        (next, gain.max(0.0))
    }
}

impl Linearize for Streamed<'_> {
    fn cost(&self, t: &DVector<f64>) -> Result<f64, Error> {
        Ok(self.solve(t.as_slice()).cost)
    }

    fn linearize(&self, t: &DVector<f64>) -> Result<Linearization, Error> {
        let k = self.problem.kinds.len();
        let solution = self.solve(t.as_slice());
        let problem = self.problem;
        let all = passes::sums(problem.samples, &solution.lobes, &solution.weights, problem.saturation, Want::All);
        let pull = |c: usize, i: usize| all[c].gradient[k + i];
        let (normal, gradient) = problem.reduce(&solution.weights, |c| &all[c].normal, pull);
        Ok(Linearization::from_normal(solution.cost, normal, &gradient))
    }
}
