//! Robust losses: the scale s and the parameters that go with it.
//!
//! s is a multiple of the residuals' own spread, which depends on the parameters, which depend on s. The way in is from above: the
//! plain fit's spread is too large where outliers pull it; as they let go it shrinks, and the parameters follow. There may be several such
//! pairs: of those found on a part of the samples the one of the smallest s is followed on all.

use nalgebra::DVector;

use super::joint::Digits;
use super::loss::Robust;
use super::options::{FitError, FitOptions};
use super::part::{SMALL, descend};
use super::passes::{Saturation, Scratch};
use super::reduced::{Problem, Solution};
use super::start;
use super::streamed::Streamed;

/// Rounds in which s settles at most.
const ROUNDS: usize = 60;
/// Relative change at which s has settled, on small tables, on others, where each round takes passes and the parameters' own errors are far
/// larger, and on the part of the samples that says where to begin.
const SETTLED: f64 = 1e-12;
const SETTLED_LARGE: f64 = 1e-7;
const SETTLED_PART: f64 = 1e-3;
/// Two scales that differ by no more, relatively, are alike on the part of the samples, and so are costs over s².
const ALIKE: f64 = 4.0 * SETTLED_PART;
/// Relative change beyond which s counts as not settled where the rounds ran out: far below what the parameters' errors tell apart.
const UNSETTLED: f64 = 1e-6;
/// Most that s shrinks in a round: the parameters must be able to follow.
const SHRINK: f64 = 0.25;

/// The parameters at the s that their residuals ask for, starting from the plain loss's fit, and whether the two met; sets the problem's
/// s. `few` and `more` are the same problem on parts of the samples, which say where to begin.
pub(super) fn settle(
    problem: &mut Problem<'_>,
    (few, more): (&Problem<'_>, &Problem<'_>),
    plain: Solution,
    options: &FitOptions,
) -> Result<(Solution, bool), FitError> {
    let Some(settling) = Settling::new(problem, &plain, options) else { return Ok((plain, true)) };
    let begun = settling.begin(few, more, plain)?;
    problem.saturation = begun.saturation;
    settling.follow(problem, begun.at, settled(problem))
}

/// As [`settle`], from a point and an s near the answer's; the point alone where the loss is not robust.
pub(super) fn resettle(
    problem: &mut Problem<'_>,
    near: Solution,
    options: &FitOptions,
) -> Result<(Solution, bool), FitError> {
    let Some(settling) = Settling::new(problem, &near, options) else { return Ok((near, true)) };
    let at = descend(problem, &near, options.max_iterations, Digits::Rough)?.0;
    settling.follow(problem, at, settled(problem))
}

/// Relative change at which s has settled on all samples.
fn settled(problem: &Problem<'_>) -> f64 {
    if problem.samples.residuals() <= SMALL { SETTLED } else { SETTLED_LARGE }
}

/// ln(the s that the residuals ask for / the problem's s), where that is worth a word.
pub(super) fn left(problem: &Problem<'_>, at: &Solution, options: &FitOptions) -> Option<f64> {
    let (settling, (_, s)) = Settling::new(problem, at, options).zip(problem.saturation)?;
    let left = (settling.asked(problem, at) / s).ln();
    Some(left).filter(|left| left.abs() > UNSETTLED)
}

/// Parameters and their s.
struct Settled {
    at: Solution,
    saturation: Saturation,
    /// Whether the two have met.
    met: bool,
}

impl Settled {
    fn s(&self) -> f64 {
        self.saturation.map_or(1.0, |(_, s)| s)
    }

    /// Whether it has settled at an s as small and, of two that are alike, with a cost as low.
    fn is_as_good_as(&self, other: &Self) -> bool {
        let grows = (self.s() / other.s()).ln();
        let costs = (self.at.cost / other.at.cost).ln() - 2.0 * grows;
        let as_good = if grows.abs() <= ALIKE { costs <= ALIKE } else { grows < 0.0 };
        if self.met == other.met { as_good } else { self.met }
    }
}

/// How s is looked for.
struct Settling {
    robust: Robust,
    /// Most steps of a descent.
    steps: u64,
    /// Least spread: rounding's share of the data.
    least: f64,
}

impl Settling {
    fn new(problem: &Problem<'_>, like: &Solution, options: &FitOptions) -> Option<Self> {
        let steps = options.max_iterations;
        options.robust.map(|robust| Self { robust, steps, least: least_spread(problem, like) })
    }

    /// Where to begin, from the parts of the samples: from the plain fit, or from the model with a lobe fewer.
    fn begin(&self, few: &Problem<'_>, more: &Problem<'_>, plain: Solution) -> Result<Settled, FitError> {
        let own = self.after_plain(few, more, plain)?;
        let Some(smaller) = self.smaller(few, more)? else { return Ok(own) };
        // Outliers may hold the plain fit of many lobes where that of few lets them go.
        let at = with_a_lobe_more(more, &smaller);
        let richer = self.settled(more, smaller.saturation, at)?;
        Ok(if richer.is_as_good_as(&own) { richer } else { own })
    }

    /// Beginning with the plain fit and its s.
    fn after_plain(&self, few: &Problem<'_>, more: &Problem<'_>, plain: Solution) -> Result<Settled, FitError> {
        let (mut few, mut more) = (few.on(few.samples), more.on(more.samples));
        let saturation = Some((self.robust.kind, self.asked(&more, &plain)));
        (few.saturation, more.saturation) = (saturation, saturation);
        // Outliers may have drawn the plain fit into another valley: the robust cost has the last word on where to go on.
        let other = start::search_streamed(&few, &more, self.steps)?;
        let other = Streamed::new(&more).solve(other.outcome.parameters.as_slice());
        let candidates = [plain, other].map(|start| descend(&more, &start, self.steps, Digits::Rough));
        let [plain, other] = candidates;
        let (plain, other) = (plain?.0, other?.0);
        self.settled(&more, saturation, if other.cost < plain.cost { other } else { plain })
    }

    /// The robust fit of the model without its last shaped lobe, if that has any lobes.
    fn smaller(&self, few: &Problem<'_>, more: &Problem<'_>) -> Result<Option<Settled>, FitError> {
        let Some(shapes) = more.layout.len().checked_sub(1) else { return Ok(None) };
        let (few, more) = (few.with_shapes(shapes), more.with_shapes(shapes));
        if more.kinds.is_empty() {
            return Ok(None);
        }
        let plain = start::search_plain(&more, (&few, &more), self.steps)?;
        let plain = Streamed::new(&more).solve(plain.outcome.parameters.as_slice());
        self.begin(&few, &more, plain).map(Some)
    }

    /// Follows s roughly.
    fn settled(&self, problem: &Problem<'_>, saturation: Saturation, at: Solution) -> Result<Settled, FitError> {
        let mut problem = problem.on(problem.samples);
        problem.saturation = saturation;
        let (at, met) = self.follow(&mut problem, at, SETTLED_PART)?;
        Ok(Settled { at, saturation: problem.saturation, met })
    }

    /// Brings ln(new s) − ln(old s) to 0 by secants, within the bracket that is known; the parameters follow. Says
    /// whether it got there within [`ROUNDS`].
    fn follow(&self, problem: &mut Problem<'_>, start: Solution, settled: f64) -> Result<(Solution, bool), FitError> {
        let mut at = start;
        let mut s = problem.saturation.map_or(1.0, |(_, s)| s);
        let mut way = Way::default();
        for _ in 0..ROUNDS {
            let excess = (self.asked(problem, &at) / s).ln();
            if excess.abs() <= settled {
                return Ok((at, true));
            }
            s = way.next(s.ln(), excess).exp();
            problem.saturation = Some((self.robust.kind, s));
            let digits = if settled <= SETTLED { Digits::All } else { Digits::Rough };
            at = descend(problem, &at, self.steps, digits)?.0;
        }
        Ok((at, false))
    }

    /// The s that the residuals ask for.
    fn asked(&self, problem: &Problem<'_>, at: &Solution) -> f64 {
        self.robust.scale * spread(problem, at).max(self.least)
    }
}

/// What is known of the root of excess(ln s).
struct Way {
    last: Option<(f64, f64)>,
    bracket: (f64, f64),
}

impl Default for Way {
    fn default() -> Self {
        Self { last: None, bracket: (f64::NEG_INFINITY, f64::INFINITY) }
    }
}

impl Way {
    /// The next ln s to try, where `here` asks for `excess` more.
    fn next(&mut self, here: f64, excess: f64) -> f64 {
        let wanted = here + excess;
        let (low, high) = self.bracket;
        if high - low < 1e-3 * excess.abs() {
            // The parameters jumped: what was known of the bracket no longer holds.
            *self = Self::default();
        }
        let (low, high) = self.bracket;
        let (low, high) = if excess > 0.0 { (low.max(here), high) } else { (low, high.min(here)) };
        let secant = self.last.map(|(x, e)| here - excess * (here - x) / (excess - e)).filter(|x| x.is_finite());
        let mut next = secant.filter(|x| (x - here).abs() < 4.0 * excess.abs()).unwrap_or(wanted);
        if next <= low || next >= high {
            next = if wanted > low && wanted < high { wanted } else { 0.5 * (low + high) };
        }
        *self = Self { last: Some((here, excess)), bracket: (low, high) };
        next.max(here + SHRINK.ln())
    }
}

/// A smaller model's robust fit with the last lobe added where that helps most at the same s.
fn with_a_lobe_more(problem: &Problem<'_>, smaller: &Settled) -> Solution {
    let mut problem = problem.on(problem.samples);
    problem.saturation = smaller.saturation;
    let added = problem.layout.last().map_or(0, |(lobe, _)| *lobe);
    let extended = |x: &DVector<f64>, ranges: &[(f64, f64)]| x.clone().insert_row(added, ranges[added].0);
    let weights = smaller.at.weights.iter().zip(&problem.ranges).map(|(x, ranges)| extended(x, ranges)).collect();
    let from = Solution { weights, ..smaller.at.clone() };
    let solve = |t: &[f64]| Streamed::rough(&problem).starting_at(&from).solve(t);
    solve(&start::extended(&problem, &smaller.at.t, |t| solve(t).cost))
}

/// σ of the residuals by their median absolute deviation from their median.
fn spread(problem: &Problem<'_>, at: &Solution) -> f64 {
    let samples = problem.samples;
    let start = || (Vec::new(), Scratch::default());
    let pieces = samples.map_pieces(start, |(list, scratch), block| {
        scratch.basis(&block.x, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            scratch.residuals(samples, block, c, x, None);
            list.extend(counting(scratch, block.weight(c)));
        }
    });
    let mut r: Vec<f64> = pieces.into_iter().flat_map(|p| p.0).collect();
    let centre = median(&mut r);
    r.iter_mut().for_each(|r| *r = (*r - centre).abs());
    MAD_TO_SIGMA * median(&mut r)
}

/// A spread below this is rounding, by the largest residual that there is without any lobe.
fn least_spread(problem: &Problem<'_>, like: &Solution) -> f64 {
    let samples = problem.samples;
    let nothing: Vec<_> = like.weights.iter().map(|x| x * 0.0).collect();
    let start = || (0.0f64, Scratch::default());
    let pieces = samples.map_pieces(start, |(largest, scratch), block| {
        scratch.basis(&block.x, &like.lobes);
        for (c, x) in nothing.iter().enumerate() {
            scratch.residuals(samples, block, c, x, None);
            *largest = counting(scratch, block.weight(c)).fold(*largest, |m, r| m.max(r.abs()));
        }
    });
    (ROUNDING * pieces.iter().map(|p| p.0).fold(0.0, f64::max)).max(SMALLEST)
}

/// The residuals of a block whose samples count.
fn counting(scratch: &Scratch, weight: &[f64]) -> impl Iterator<Item = f64> {
    scratch.r.iter().zip(weight).filter_map(|(r, w)| (*w > 0.0).then_some(*r))
}

/// Residuals below this share of the data are rounding, and no scale below this can be squared.
const ROUNDING: f64 = 1e-13;
const SMALLEST: f64 = 1e-140;

/// σ of normal noise over its median absolute deviation.
const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

fn median(list: &mut [f64]) -> f64 {
    if list.is_empty() {
        return 0.0;
    }
    let middle = list.len() / 2;
    let odd = list.len() % 2 == 1;
    let (below, upper, _) = list.select_nth_unstable_by(middle, f64::total_cmp);
    if odd { *upper } else { 0.5 * (*upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max)) }
}
