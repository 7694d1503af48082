//! 95 % intervals. Where a parameter is nonlinear or near the end of its range the interval is read off its profile: the values at which the
//! cost, minimised over everything else, has risen by as much as the standard error's own curvature says for 95 % (the
//! profile calibrated by the sandwich: Chandler & Bate 2007). Elsewhere it is estimate ± t·σ, for exponents in their logarithm.
//! A shape at an end of its range has an interval by profile alone, from that end inwards.

use nalgebra::DVector;

use super::covariance::{Interval, Uncertainty};
use super::reduced::{Problem, Search, Solution};
use super::solver::{self, LevenbergMarquardt, SolverOptions};

/// Intervals of all parameters, in the uncertainty's order: weights in the fit's scale, shapes as t = ln(shape).
pub(super) type Intervals = Vec<Option<Interval>>;

/// Below this half width of ln(shape) the profile is as good as a parabola.
const NARROW: f64 = 0.03;
/// A rise of the cost below this share of the data's energy is not resolved by a difference of sums.
const RESOLVED: f64 = 1e-11;
/// Steps of the search for each end.
const STEPS: usize = 40;

/// Whether parameter `i` is a shape that ended at an end of its range, though the data determine it: the cost falls on beyond that end, so that
/// no parabola, and no standard error, tells where the parameter may be.
pub(super) fn is_at_end(problem: &Problem<'_>, at: &Solution, uncertainty: &Uncertainty, i: usize) -> bool {
    let Some(shape) = i.checked_sub(at.weights.len() * problem.kinds.len()) else { return false };
    let ((low, high), lobe) = (problem.bounds[shape], problem.layout[shape].0);
    let determined = uncertainty.errors[i].is_some_and(|e| e < high - low);
    let ends = low < high && (at.t[shape] <= low || at.t[shape] >= high);
    ends && determined && at.weights.iter().any(|x| x[lobe] > 0.0)
}

/// Estimate ± t·σ of every parameter, cut to its range; none for a shape at an end of it.
pub(super) fn plain(problem: &Problem<'_>, at: &Solution, uncertainty: &Uncertainty) -> Intervals {
    let around = |i: usize| {
        let error = uncertainty.errors[i].filter(|_| !is_at_end(problem, at, uncertainty, i))?;
        let (value, (low, high)) = parameter(problem, at, i);
        let reach = uncertainty.reach[i] * error;
        Some(((value - reach).max(low), (value + reach).min(high)))
    };
    (0..uncertainty.errors.len()).map(around).collect()
}

/// [`plain`], by profile where that differs.
pub(super) fn profiled(search: &Search<'_>, at: &Solution, uncertainty: &Uncertainty) -> Intervals {
    let problem = search.problem;
    let mut intervals = plain(problem, at, uncertainty);
    let energy: f64 = search.energy.iter().sum();
    let weights = at.weights.len() * problem.kinds.len();
    for (i, interval) in intervals.iter_mut().enumerate() {
        let Some(error) = uncertainty.errors[i] else { continue };
        let (value, (low, high)) = parameter(problem, at, i);
        let reach = uncertainty.reach[i] * error;
        let at_end = is_at_end(problem, at, uncertainty, i);
        let near_end =
            i < weights && (value - low < 1.5 * reach || high - value < 1.5 * reach || is_capped(problem, at, i));
        let lopsided = near_end && !problem.layout.is_empty() || i >= weights && reach > NARROW;
        if low == high || !(lopsided || at_end) {
            continue;
        }
        let rise = reach * reach / uncertainty.bread[(i, i)];
        if rise.is_nan() || rise <= RESOLVED * energy {
            continue;
        }
        let profile = Profile { search, at, parameter: i, rise };
        let (below, above) = ((value - reach).max(low).min(value), (value + reach).min(high).max(value));
        *interval = Some((profile.end(value, below, low), profile.end(value, above, high)));
    }
    intervals
}

/// Whether the energy limit decides the channel that weight `i` belongs to.
fn is_capped(problem: &Problem<'_>, at: &Solution, i: usize) -> bool {
    let c = i / problem.kinds.len();
    problem.feasible(c).free_at(&at.weights[c]).1
}

/// Value and range of parameter `i`; a weight's reaches no farther than its channel's energy limit and the others' least leave it.
fn parameter(problem: &Problem<'_>, at: &Solution, i: usize) -> (f64, (f64, f64)) {
    let lobes = problem.kinds.len();
    let weights = at.weights.len() * lobes;
    if i < weights {
        let (c, l) = (i / lobes, i % lobes);
        let (low, high) = problem.ranges[c][l];
        let others: f64 = problem.ranges[c].iter().map(|r| r.0).sum::<f64>() - low;
        return (at.weights[c][l], (low, high.min(problem.cap.map_or(f64::INFINITY, |cap| cap - others))));
    }
    (at.t[i - weights], problem.bounds[i - weights])
}

/// The cost along one parameter.
struct Profile<'a> {
    search: &'a Search<'a>,
    at: &'a Solution,
    parameter: usize,
    /// Rise of the cost at the interval's ends.
    rise: f64,
}

impl Profile<'_> {
    /// Rise of the cost with the parameter held at `value`, over the wanted one, less 1.
    fn excess(&self, value: f64) -> f64 {
        let problem = self.search.problem;
        let lobes = problem.kinds.len();
        let weights = self.at.weights.len() * lobes;
        let mut held = problem.on(problem.samples);
        let mut start = DVector::from_column_slice(&self.at.t);
        if self.parameter < weights {
            held.ranges[self.parameter / lobes][self.parameter % lobes] = (value, value);
        } else {
            held.bounds[self.parameter - weights] = (value, value);
            start[self.parameter - weights] = value;
        }
        let search = self.search.of(&held);
        let options = SolverOptions { ftol: 1e-10, polish: 0, ..SolverOptions::default() };
        let lm = LevenbergMarquardt::new(options).with_bounds(held.bounds.clone());
        let found = solver::minimize(search.walk(), lm, start, 30);
        found.map_or(f64::NAN, |f| (f.cost - self.at.cost.max(0.0)) / self.rise - 1.0)
    }

    /// Where the profile has risen as wanted, between the estimate and `limit`; `guess` is where a parabola would have.
    fn end(&self, value: f64, guess: f64, limit: f64) -> f64 {
        let mut step = guess - value;
        if step == 0.0 {
            return value;
        }
        let upwards = step > 0.0;
        let inside = |x: f64| if upwards { x.min(limit) } else { x.max(limit) };
        let (mut near, mut far) = ((value, -1.0), value);
        for _ in 0..STEPS {
            far = inside(value + step);
            let excess = self.excess(far);
            if excess >= 0.0 {
                return self.root(near, (far, excess));
            }
            if far == limit || excess.is_nan() {
                return far;
            }
            near = (far, excess);
            step *= 1.6;
        }
        far
    }

    /// The root between two points of opposite sign, by the Illinois variant of regula falsi on √(excess + 1), which is nearly a
    /// straight line.
    fn root(&self, a: (f64, f64), b: (f64, f64)) -> f64 {
        let line = |(x, e): (f64, f64)| (x, (e + 1.0).max(0.0).sqrt() - 1.0);
        let (mut a, mut b) = (line(a), line(b));
        for _ in 0..STEPS {
            let x = b.0 - b.1 * (b.0 - a.0) / (b.1 - a.1);
            let e = line((x, self.excess(x))).1;
            if e.abs() < 1e-4 || !x.is_finite() {
                return x;
            }
            if e * b.1 < 0.0 {
                a = b;
            } else {
                a.1 *= 0.5;
            }
            b = (x, e);
        }
        b.0
    }
}
