//! The least cost with one parameter held, by passes over the samples: what the intervals of robust fits and of losses that are not linear in
//! the weights are read off. The robust scale stays as the fit has it.

use nalgebra::{DMatrix, DVector};

use super::joint::Digits;
use super::part::descend;
use super::reduced::{Problem, Solution};
use super::solver::Stop;

/// Steps of one descent at most; on a large table, where each takes passes. From the last point moved along one to three do as a rule.
const STEPS: u64 = 60;
const STEPS_LARGE: u64 = 10;
/// Least share of the cost that a descent can be asked to resolve.
const FINEST: f64 = 1e-14;

/// The way along one parameter, away from the minimum.
pub(super) struct Trail<'a> {
    problem: &'a Problem<'a>,
    parameter: usize,
    /// How far every parameter moves with the held one's unit, as the minimum's own curvature says.
    along: DVector<f64>,
    /// The last point.
    at: Solution,
    digits: Digits,
}

impl<'a> Trail<'a> {
    /// From the minimum `at`, costs good to `resolution`; `bread` is the inverse of its curvature.
    pub fn new(
        problem: &'a Problem<'a>,
        at: &Solution,
        bread: &DMatrix<f64>,
        parameter: usize,
        resolution: f64,
    ) -> Self {
        let along = bread.column(parameter) / bread[(parameter, parameter)];
        let digits = Digits::Cost((resolution / at.cost).clamp(FINEST, 1e-3));
        Self { problem, parameter, along, at: at.clone(), digits }
    }

    /// The last point.
    pub fn at(&self) -> &Solution {
        &self.at
    }

    /// The least cost with the parameter at `value`; NaN where no descent leads there.
    pub fn cost(&mut self, value: f64) -> f64 {
        let held = self.problem.holding(self.parameter, value);
        let start = self.moved(&held, value);
        let steps = if held.samples.want_last_digits() { STEPS } else { STEPS_LARGE };
        match descend(&held, &start, steps, self.digits) {
            Ok((found, outcome)) if found.cost.is_finite() && outcome.stop != Stop::MaxIterations => {
                self.at = found;
                self.at.cost
            }
            _ => f64::NAN,
        }
    }

    /// The last point moved along until the parameter is at `value`, everything within the ranges and below the cap.
    fn moved(&self, held: &Problem<'_>, value: f64) -> Solution {
        let lobes = held.kinds.len();
        let weights = held.ranges.len() * lobes;
        let from = self.at.weights.iter().flat_map(|x| x.iter()).chain(&self.at.t).nth(self.parameter);
        let step = value - from.copied().unwrap_or(value);
        let place = |i: usize, old: f64, (low, high): (f64, f64)| (old + step * self.along[i]).clamp(low, high);
        let shape = |(i, t): (usize, &f64)| place(weights + i, *t, held.bounds[i]);
        let t: Vec<f64> = self.at.t.iter().enumerate().map(shape).collect();
        let of = |(c, x): (usize, &DVector<f64>)| {
            held.within(c, &DVector::from_fn(lobes, |l, _| place(c * lobes + l, x[l], held.ranges[c][l])))
        };
        let weights = self.at.weights.iter().enumerate().map(of).collect();
        Solution { lobes: held.shaped(&t), t, weights, cost: f64::NAN }
    }
}

impl Problem<'_> {
    /// The same with parameter `i` (weights channel by channel, then every t) held at a value.
    pub fn holding(&self, i: usize, value: f64) -> Self {
        let (mut held, lobes) = (self.on(self.samples), self.kinds.len());
        match i.checked_sub(held.ranges.len() * lobes) {
            Some(shape) => held.bounds[shape] = (value, value),
            None => held.ranges[i / lobes][i % lobes] = (value, value),
        }
        held
    }
}
