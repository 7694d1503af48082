//! Robust losses: the scale s and the parameters that go with it.
//!
//! s is a multiple of the residuals' own spread, which depends on the parameters, which depend on s. The way in is from above: the
//! plain fit's spread is too large where outliers pull it; as they let go it shrinks, and the parameters follow.

use super::joint::Digits;
use super::loss::Robust;
use super::options::{FitError, FitOptions};
use super::part::{SMALL, descend};
use super::passes::Scratch;
use super::reduced::{Problem, Solution, Streamed};
use super::start;

/// Rounds in which s settles at most.
const ROUNDS: usize = 60;
/// Relative change at which s has settled, on small tables, on others, where each round takes passes and the parameters' own errors are far
/// larger, and on the part of the samples that says where to begin.
const SETTLED: f64 = 1e-12;
const SETTLED_LARGE: f64 = 1e-7;
const SETTLED_PART: f64 = 1e-3;
/// Relative change beyond which s counts as not settled where the rounds ran out: far below what the parameters' errors tell apart.
const UNSETTLED: f64 = 1e-6;
/// Most that s shrinks in a round: the parameters must be able to follow.
const SHRINK: f64 = 0.25;

/// The parameters at the s that their residuals ask for, starting from the plain loss's fit; sets the problem's s. With them, where the
/// rounds ran out, ln(the s asked for / s). `parts` are the same problem on thinned-out samples, for the search for other starts.
pub(super) fn settle(
    problem: &mut Problem<'_>,
    parts: (Problem<'_>, Problem<'_>),
    plain: Solution,
    options: &FitOptions,
) -> Result<(Solution, Option<f64>), FitError> {
    let Some(robust) = options.robust else { return Ok((plain, None)) };
    let steps = options.max_iterations;
    let (mut few, mut more) = parts;
    let saturation = Some((robust.kind, robust.scale * spread(&more, &plain)));
    (few.saturation, more.saturation) = (saturation, saturation);
    // Outliers may have drawn the plain fit into another valley: the robust cost has the last word on where to go on.
    let other = start::search_streamed(&few, &more, steps)?;
    let other = Streamed::new(&more).solve(other.outcome.parameters.as_slice());
    let candidates = [plain, other].map(|start| descend(&more, &start, steps, Digits::Rough));
    let [plain, other] = candidates;
    let (plain, other) = (plain?.0, other?.0);
    let at = if other.cost < plain.cost { other } else { plain };
    let whole = more.samples.len() == problem.samples.len();
    let at = if whole { at } else { follow(&mut more, at, robust, steps, SETTLED_PART)?.0 };
    problem.saturation = more.saturation;
    follow(problem, at, robust, steps, settled(problem))
}

/// As [`settle`], from a point and an s near the answer's; the point alone where the loss is not robust.
pub(super) fn resettle(
    problem: &mut Problem<'_>,
    near: Solution,
    options: &FitOptions,
) -> Result<(Solution, Option<f64>), FitError> {
    let Some(robust) = options.robust else { return Ok((near, None)) };
    let at = descend(problem, &near, options.max_iterations, Digits::Rough)?.0;
    follow(problem, at, robust, options.max_iterations, settled(problem))
}

/// Relative change at which s has settled on all samples.
fn settled(problem: &Problem<'_>) -> f64 {
    if problem.samples.residuals() <= SMALL { SETTLED } else { SETTLED_LARGE }
}

/// Brings ln(new s) − ln(old s) to 0 by secants, within the bracket that is known; the parameters follow. Says what is
/// left of it after [`ROUNDS`], where that is worth a word.
fn follow(
    problem: &mut Problem<'_>,
    start: Solution,
    robust: Robust,
    steps: u64,
    settled: f64,
) -> Result<(Solution, Option<f64>), FitError> {
    let asked = |problem: &Problem<'_>, at: &Solution| (robust.scale * spread(problem, at)).ln();
    let mut at = start;
    let mut s = problem.saturation.map_or(1.0, |(_, s)| s);
    let (mut last, mut bracket): (Option<(f64, f64)>, (f64, f64)) = (None, (f64::NEG_INFINITY, f64::INFINITY));
    for _ in 0..ROUNDS {
        let (here, wanted) = (s.ln(), asked(problem, &at));
        let excess = wanted - here;
        if excess.abs() <= settled {
            return Ok((at, None));
        }
        if bracket.1 - bracket.0 < 1e-3 * excess.abs() {
            // The parameters jumped: what was known of the bracket no longer holds.
            (bracket, last) = ((f64::NEG_INFINITY, f64::INFINITY), None);
        }
        bracket = if excess > 0.0 { (bracket.0.max(here), bracket.1) } else { (bracket.0, bracket.1.min(here)) };
        let secant = last.map(|(x, e): (f64, f64)| here - excess * (here - x) / (excess - e)).filter(|x| x.is_finite());
        let mut next = secant.filter(|x| (x - here).abs() < 4.0 * excess.abs()).unwrap_or(wanted);
        if next <= bracket.0 || next >= bracket.1 {
            let inside = wanted > bracket.0 && wanted < bracket.1;
            next = if inside { wanted } else { 0.5 * (bracket.0 + bracket.1) };
        }
        last = Some((here, excess));
        s = next.max(here + SHRINK.ln()).exp();
        problem.saturation = Some((robust.kind, s));
        let digits = if settled <= SETTLED { Digits::All } else { Digits::Rough };
        at = descend(problem, &at, steps, digits)?.0;
    }
    let left = asked(problem, &at) - s.ln();
    Ok((at, Some(left).filter(|left| left.abs() > UNSETTLED)))
}

/// σ of the residuals by their median absolute deviation from their median; at least rounding's share of the data.
fn spread(problem: &Problem<'_>, at: &Solution) -> f64 {
    let samples = problem.samples;
    let nothing: Vec<_> = at.weights.iter().map(|x| x * 0.0).collect();
    let start = || (Vec::new(), 0.0f64, Scratch::default());
    let pieces = samples.map_pieces(start, |(list, largest, scratch), block| {
        scratch.basis(&block.x, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            let counts = |(r, w): (&f64, &f64)| (*w > 0.0).then_some(*r);
            scratch.residuals(samples, block, c, x, None);
            list.extend(scratch.r.iter().zip(block.weight(c)).filter_map(counts));
            scratch.residuals(samples, block, c, &nothing[c], None);
            *largest = scratch.r.iter().zip(block.weight(c)).filter_map(counts).fold(*largest, |m, r| m.max(r.abs()));
        }
    });
    let largest = pieces.iter().map(|p| p.1).fold(0.0, f64::max);
    let mut r: Vec<f64> = pieces.into_iter().flat_map(|p| p.0).collect();
    let centre = median(&mut r);
    r.iter_mut().for_each(|r| *r = (*r - centre).abs());
    (MAD_TO_SIGMA * median(&mut r)).max(ROUNDING * largest).max(SMALLEST)
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
