//! 95 % intervals. Where a parameter is nonlinear or near the end of its range the interval is read off its profile: the values at which the
//! cost, minimised over everything else, has risen by as much as the standard error's own curvature says for 95 % (the
//! profile calibrated by the sandwich: Chandler & Bate 2007). Elsewhere it is estimate ± t·σ, for exponents in their logarithm: also where the
//! profile can't be followed.
//! A shape at an end of its range has an interval by profile alone, from that end inwards.

use std::cell::RefCell;

use super::budget::Deadline;
use super::covariance::{Interval, Uncertainty};
use super::joint;
use super::part::{ROUNDING, SMALL};
use super::profile::Trail;
use super::reduced::{Problem, Search, Solution};
use super::solver;

/// Intervals of all parameters, in the uncertainty's order: weights in the fit's scale, shapes as t = ln(shape).
pub(super) type Intervals = Vec<Option<Interval>>;

/// Intervals, and what profiles met on the way.
pub(super) struct Profiled {
    pub intervals: Intervals,
    /// A point lower than the estimate, and so of another valley.
    pub lower: Option<Solution>,
    /// Whether the time left out profiles that intervals should have been read off.
    pub is_cut: bool,
}

impl Profiled {
    /// [`plain`] ones.
    pub fn plain(problem: &Problem<'_>, at: &Solution, uncertainty: &Uncertainty) -> Self {
        Self { intervals: plain(problem, at, uncertainty), lower: None, is_cut: false }
    }
}

/// Below this half width of ln(shape) the profile is as good as a parabola.
const NARROW: f64 = 0.03;
/// A rise of the cost below this share of the data's energy is not resolved by a difference of sums.
const RESOLVED: f64 = 1e-11;
/// How far the root of the rise may be off, and steps of the search for each end; on a large table, where each takes passes, and in the
/// rounds of a budget.
const CLOSE: f64 = 1e-4;
const TRIES: usize = 40;
const CLOSE_LARGE: f64 = 1e-2;
const TRIES_LARGE: usize = 8;
/// An end that is nearer to the estimate than this share of where a parabola has it is no end.
const JUMP: f64 = 1e-3;
/// A cost that is lower than the estimate's by this share of the wanted rise is another valley's, not the tolerance of a descent.
const LOWER: f64 = 0.01;

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
        let reach = uncertainty.half_width(i).filter(|_| !is_at_end(problem, at, uncertainty, i))?;
        let (value, (low, high)) = parameter(problem, at, i);
        Some(((value - reach).max(low), (value + reach).min(high)))
    };
    (0..uncertainty.errors.len()).map(around).collect()
}

/// [`plain`], by profile where that differs, the transforms knowing the cost.
pub(super) fn by_search(search: &Search<'_>, at: &Solution, uncertainty: &Uncertainty) -> Intervals {
    let resolved = RESOLVED * search.energy.iter().sum::<f64>();
    let fine = Fineness { resolved, tolerance: CLOSE, tries: TRIES, deadline: Deadline::NEVER };
    profiled(search.problem, at, uncertainty, fine, |i, _| Box::new(move |value| least_cost(search, at, i, value))).0
}

/// [`plain`], by profile where that differs, by passes over the samples: few on a large table. Where a profile meets a point lower than the
/// estimate, and so another valley, that point too, and the other profiles are left out; all are followed unless `stops_at_lower`. None is begun after
/// `deadline`.
pub(super) fn by_passes(
    problem: &Problem<'_>,
    at: &Solution,
    uncertainty: &Uncertainty,
    stops_at_lower: bool,
    deadline: Deadline,
) -> Profiled {
    let residuals = problem.samples.residuals();
    let is_large = residuals > SMALL;
    let is_rounding = at.cost <= ROUNDING * ROUNDING * residuals as f64;
    if is_rounding || is_large && (problem.cap.is_some() || !joint::has_few_parameters(problem)) {
        return Profiled::plain(problem, at, uncertainty);
    }
    let (tolerance, tries) =
        if problem.samples.want_last_digits() { (CLOSE, TRIES) } else { (CLOSE_LARGE, TRIES_LARGE) };
    let fine = Fineness { resolved: RESOLVED * at.cost, tolerance, tries, deadline };
    let lower = RefCell::new(None);
    let (intervals, is_cut) = profiled(problem, at, uncertainty, fine, |i, rise| {
        let mut trail = Trail::new(problem, at, &uncertainty.bread, i, 0.1 * tolerance * rise);
        let lower = &lower;
        Box::new(move |value| {
            let cost = if lower.borrow().is_some() { f64::NAN } else { trail.cost(value) };
            if stops_at_lower && cost < at.cost - LOWER * rise {
                lower.replace(Some(trail.at().clone()));
                return f64::NAN;
            }
            cost
        })
    });
    Profiled { intervals, lower: lower.into_inner(), is_cut }
}

/// The least cost as a function of one parameter's value.
type Along<'a> = Box<dyn FnMut(f64) -> f64 + 'a>;

/// [`plain`], by profile where that differs, and whether some of those were too late. `along` is given a parameter and the rise that is looked for, and
/// begins at the estimate.
fn profiled<'a>(
    problem: &Problem<'_>,
    at: &Solution,
    uncertainty: &Uncertainty,
    fine: Fineness,
    along: impl Fn(usize, f64) -> Along<'a>,
) -> (Intervals, bool) {
    let mut intervals = plain(problem, at, uncertainty);
    let mut is_cut = false;
    for (i, interval) in intervals.iter_mut().enumerate() {
        let Some(reach) = uncertainty.half_width(i) else { continue };
        let (value, (low, high)) = parameter(problem, at, i);
        let rise = reach * reach / uncertainty.bread[(i, i)];
        let is_resolved = rise.is_finite() && rise > fine.resolved;
        if low == high || !is_resolved || !differs(problem, at, uncertainty, i) {
            continue;
        }
        if fine.deadline.is_past() {
            is_cut = true;
            break;
        }
        let end = |guess: f64, limit: f64| {
            Profile { cost: along(i, rise), least: at.cost.max(0.0), rise, fine }.end(value, guess, limit)
        };
        let below = end((value - reach).max(low).min(value), low);
        let above = end((value + reach).min(high).max(value), high);
        *interval = below.zip(above).or(*interval);
    }
    (intervals, is_cut)
}

/// Whether the profile of parameter `i` may differ from a parabola.
fn differs(problem: &Problem<'_>, at: &Solution, uncertainty: &Uncertainty, i: usize) -> bool {
    let (value, (low, high)) = parameter(problem, at, i);
    let reach = uncertainty.half_width(i).unwrap_or(0.0);
    if i >= at.weights.len() * problem.kinds.len() {
        return reach > NARROW || is_at_end(problem, at, uncertainty, i);
    }
    let near_end = value - low < 1.5 * reach || high - value < 1.5 * reach || is_capped(problem, at, i);
    let straight = problem.layout.is_empty() && problem.is_transformable();
    near_end && !straight
}

/// Whether the energy limit decides the channel that weight `i` belongs to.
fn is_capped(problem: &Problem<'_>, at: &Solution, i: usize) -> bool {
    let c = i / problem.kinds.len();
    problem.is_capped(c, &at.weights[c])
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

/// The least cost with parameter `i` held at `value`, from the transforms.
fn least_cost(search: &Search<'_>, at: &Solution, i: usize, value: f64) -> f64 {
    let held = search.problem.holding(i, value);
    let search = search.of(&held);
    solver::least_cost(search.walk(), &held.bounds, &at.t).unwrap_or(f64::NAN)
}

/// How finely ends are looked for.
#[derive(Clone, Copy)]
struct Fineness {
    /// Least rise of the cost that can be told.
    resolved: f64,
    /// How far the root of the rise, over that of the wanted one, may be off 1.
    tolerance: f64,
    /// Steps outwards, and then inwards, at most.
    tries: usize,
    /// None is begun after that.
    deadline: Deadline,
}

/// The cost along one parameter.
struct Profile<'a> {
    cost: Along<'a>,
    least: f64,
    /// Rise of the cost at the interval's ends.
    rise: f64,
    fine: Fineness,
}

impl Profile<'_> {
    /// Rise of the cost with the parameter held at `value`, over the wanted one, less 1.
    fn excess(&mut self, value: f64) -> f64 {
        ((self.cost)(value) - self.least) / self.rise - 1.0
    }

    /// Where the profile has risen as wanted, between the estimate and `limit`; `guess` is where a parabola would have. `None` where it can't be
    /// followed as far.
    fn end(&mut self, value: f64, guess: f64, limit: f64) -> Option<f64> {
        let mut step = guess - value;
        if step == 0.0 {
            return Some(value);
        }
        let upwards = step > 0.0;
        let inside = |x: f64| if upwards { x.min(limit) } else { x.max(limit) };
        let (mut near, mut growth) = ((value, -1.0), 1.6);
        for _ in 0..self.fine.tries {
            let far = inside(value + step);
            let excess = self.excess(far);
            if excess.is_nan() {
                return None;
            }
            if excess >= 0.0 {
                // A cost that jumps right beside the estimate belongs to another valley: the way along this one was lost.
                return self.root(near, (far, excess)).filter(|x| (x - value).abs() > JUMP * (guess - value).abs());
            }
            if far == limit {
                return Some(far);
            }
            near = (far, excess);
            // A loss whose slope is infinite at 0 has errors there that are far too small.
            step *= growth;
            growth *= 1.1;
        }
        None
    }

    /// The root between two points of opposite sign, by the Illinois variant of regula falsi on √(excess + 1), which is nearly a
    /// straight line.
    fn root(&mut self, a: (f64, f64), b: (f64, f64)) -> Option<f64> {
        let line = |(x, e): (f64, f64)| (x, (e + 1.0).max(0.0).sqrt() - 1.0);
        let (mut a, mut b) = (line(a), line(b));
        for _ in 0..self.fine.tries {
            if b.1.abs() < self.fine.tolerance {
                return Some(b.0);
            }
            let x = b.0 - b.1 * (b.0 - a.0) / (b.1 - a.1);
            let e = line((x, self.excess(x))).1;
            if e.is_nan() {
                return None;
            }
            if e * b.1 < 0.0 {
                a = b;
            } else {
                a.1 *= 0.5;
            }
            b = (x, e);
        }
        Some(b.0)
    }
}
