//! Robust losses: the scale s and the parameters that go with it.
//!
//! s is a multiple of the residuals' own spread, which depends on the parameters, which depend on s. The way in is from above: the
//! plain fit's spread is too large where outliers pull it; as they let go it shrinks, and the parameters follow. There may be several such
//! pairs, and outliers may hide the right one from the plain fit: so a lattice of shapes is another way in, which begins with the data's
//! own median deviation. Of the pairs found on a part of the samples the one of the smallest s is followed on all.

use nalgebra::DVector;
use rayon::prelude::*;

use super::joint::Digits;
use super::loss::{Robust, RobustKind};
use super::options::{FitError, FitOptions};
use super::part::{SMALL, descend};
use super::passes::{Saturation, Scratch};
use super::reduced::{Problem, Solution};
use super::start::{self, SearchReport};
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

/// The lattice's own loss: an outlier's pull on it fades, so that none is too large.
const GENTLE: RobustKind = RobustKind::Cauchy;
/// Rounds in which the s of a node settles at most, and the relative change at which it has.
const NODE_ROUNDS: usize = 12;
const SETTLED_NODE: f64 = 0.02;
/// Valleys of the lattice followed on the first part of the samples at most, and of them on the second.
const MOST_VALLEYS: usize = 6;
const MOST_FOLLOWED: usize = 2;
/// Residuals per parameter below which the middle half of them can be met by chance, so that the smallest s says little.
const FEWEST_RESIDUALS: usize = 5;

/// The parameters at the s that their residuals ask for, starting from the plain loss's fit and from a lattice, whether the two met, and how
/// they were looked for; sets the problem's s. `few` and `more` are the same problem on parts of the samples, which say where to begin.
pub(super) fn settle(
    problem: &mut Problem<'_>,
    (few, more): (&Problem<'_>, &Problem<'_>),
    plain: Solution,
    options: &FitOptions,
) -> Result<(Solution, bool, SearchReport), FitError> {
    let Some(settling) = Settling::new(problem, &plain, options) else {
        return Ok((plain, true, SearchReport::default()));
    };
    let (begun, report) = settling.begin(few, more, plain)?;
    problem.saturation = begun.saturation;
    let (at, met) = settling.follow(problem, begun.at, settled(problem))?;
    Ok((at, met, report))
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

/// Whether one s is clearly larger than another.
pub(super) fn grows(from: Saturation, to: Saturation) -> bool {
    from.zip(to).is_some_and(|((_, from), (_, to))| (to / from).ln() > ALIKE)
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
    /// Least s that rounding allows there.
    floor: f64,
}

impl Settled {
    fn s(&self) -> f64 {
        self.saturation.map_or(1.0, |(_, s)| s)
    }

    /// Whether it has settled at an s as small and, of two that are alike, with a cost as low.
    fn is_as_good_as(&self, other: &Self) -> bool {
        let grows = (self.s() / other.s()).ln();
        let costs = (self.at.cost / other.at.cost).ln() - 2.0 * grows;
        let as_good = if self.s().max(other.s()) <= (1.0 + ALIKE) * self.floor.max(other.floor) {
            // The s are rounding and say nothing.
            self.at.cost <= other.at.cost
        } else if grows.abs() <= ALIKE {
            costs <= ALIKE
        } else {
            grows < 0.0
        };
        if self.met == other.met { as_good } else { self.met }
    }

    /// Whether neither is better than the other.
    fn is_alike(&self, other: &Self) -> bool {
        self.is_as_good_as(other) && other.is_as_good_as(self)
    }

    /// ln s and the logarithm of the cost, both of which a valley may show in.
    fn heights(&self) -> [f64; 2] {
        [self.s().ln(), self.at.cost.ln()]
    }
}

/// The best of several and how many others there were. `None` of none.
fn best_of(mut list: Vec<Settled>) -> Option<(Settled, SearchReport)> {
    let starts = list.len();
    let mut minima: Vec<Settled> = Vec::new();
    let mut reached = 0;
    while let Some(best) = take_best(&mut list) {
        let alike = 1 + list.extract_if(.., |other| other.is_alike(&best)).count();
        reached = if minima.is_empty() { alike } else { reached };
        minima.push(best);
    }
    let report = SearchReport { starts, reached, minima: minima.len(), ..SearchReport::default() };
    minima.into_iter().next().map(|best| (best, report))
}

/// Takes the best out of a list; of alike ones the last.
fn take_best(list: &mut Vec<Settled>) -> Option<Settled> {
    let better = |best: usize, i: usize| if list[i].is_as_good_as(&list[best]) { i } else { best };
    let best = (0..list.len()).reduce(better)?;
    Some(list.remove(best))
}

/// How s is looked for.
struct Settling {
    robust: Robust,
    /// Most steps of a descent.
    steps: u64,
    /// A spread below this may be rounding, by the largest residual that there is without any lobe.
    suspect: f64,
}

impl Settling {
    fn new(problem: &Problem<'_>, like: &Solution, options: &FitOptions) -> Option<Self> {
        let robust = options.robust?;
        let mut nothing = like.clone();
        nothing.weights.iter_mut().for_each(|x| x.fill(0.0));
        let largest = largest(problem, &nothing, |r0, _| r0.abs());
        Some(Self { robust, steps: options.max_iterations, suspect: ROUNDING * largest })
    }

    /// As the lattice has it.
    fn gentle(&self) -> Self {
        Self { robust: Robust { kind: GENTLE, scale: GENTLE.default_scale() }, ..*self }
    }

    /// Where to begin, from the parts of the samples: from the plain fit, from the model with a lobe fewer, or from the lattice.
    fn begin(
        &self,
        few: &Problem<'_>,
        more: &Problem<'_>,
        plain: Solution,
    ) -> Result<(Settled, SearchReport), FitError> {
        let smaller = self.smaller(few, more)?;
        let mut found = vec![self.after_plain(few, more, plain)?];
        found.extend(self.by_lattice(few, more, smaller.as_ref())?);
        if let Some(smaller) = &smaller {
            // Outliers may hold the plain fit of many lobes where that of few lets them go; of alike ones it is the one to go on from, for
            // its lobes are not two that stand in one place.
            found.push(self.settled(more, smaller.saturation, with_a_lobe_more(more, smaller))?);
        }
        best_of(found).ok_or_else(|| FitError::Solver { reason: "no start".into() })
    }

    /// Beginning with a lattice of the last shape, the others as the model with a lobe fewer has them: its valleys, followed.
    fn by_lattice(
        &self,
        few: &Problem<'_>,
        more: &Problem<'_>,
        smaller: Option<&Settled>,
    ) -> Result<Vec<Settled>, FitError> {
        let parameters = few.ranges.len() * few.kinds.len() + few.layout.len();
        if few.samples.residuals() < FEWEST_RESIDUALS * parameters {
            return Ok(Vec::new());
        }
        let gentle = self.gentle();
        let (from, s) = match smaller {
            Some(smaller) => (with_room(few, &smaller.at), gentle.asked(few, &smaller.at)),
            None => gentle.start_by_data(few),
        };
        let nodes = start::last_nodes(few);
        let settle = |last: &Option<f64>| {
            let t: Vec<f64> = from.t.iter().copied().chain(*last).collect();
            gentle.at_node(few, s, &from, &t)
        };
        let profile = nodes.par_iter().map(settle).collect::<Vec<Settled>>();
        let follow = |valley: Settled| gentle.descended(few, valley.saturation, &valley.at);
        let mut list = valleys(profile).into_par_iter().map(follow).collect::<Result<Vec<Settled>, FitError>>()?;
        let mut found = Vec::new();
        while found.len() < MOST_FOLLOWED
            && let Some(best) = take_best(&mut list)
        {
            list.retain(|other| !other.is_alike(&best));
            let own = gentle.descended(more, best.saturation, &best.at)?;
            found.push(self.descended(more, Some((self.robust.kind, self.asked(more, &own.at))), &own.at)?);
        }
        // A long descent may step over the limit of energy, which a fit of low s beyond it must not decide.
        found.retain(|found: &Settled| is_within_cap(more, &found.at));
        Ok(found)
    }

    /// Weights of the data's own size, and the s of the data's own spread.
    fn start_by_data(&self, problem: &Problem<'_>) -> (Solution, f64) {
        let lobes = problem.kinds.len();
        let share = typical(problem).min(problem.cap.map_or(f64::INFINITY, |cap| cap / lobes as f64));
        let of = |ranges: &Vec<(f64, f64)>, x: f64| {
            DVector::from_iterator(lobes, ranges.iter().map(|(low, high)| x.clamp(*low, *high)))
        };
        let t: Vec<f64> = problem.bounds.iter().map(|b| b.0).collect();
        let weights = |x: f64| problem.ranges.iter().map(|ranges| of(ranges, x)).collect();
        let at = |x: f64| Solution { lobes: problem.shaped(&t), t: Vec::new(), weights: weights(x), cost: f64::NAN };
        (at(share), self.asked(problem, &at(0.0)))
    }

    /// Weights and s of given shapes, from above, roughly.
    fn at_node(&self, problem: &Problem<'_>, s: f64, from: &Solution, t: &[f64]) -> Settled {
        let mut problem = problem.on(problem.samples);
        let (mut s, mut at) = (s, from.clone());
        for _ in 0..NODE_ROUNDS {
            problem.saturation = Some((self.robust.kind, s));
            at = Streamed::rough(&problem).starting_at(&at).solve(t);
            let asked = self.asked(&problem, &at).max(SHRINK * s);
            if (asked / s).ln().abs() <= SETTLED_NODE {
                break;
            }
            s = asked;
        }
        let floor = self.floor(&problem, &at);
        Settled { at, saturation: problem.saturation, met: true, floor }
    }

    /// Descends, then follows s roughly.
    fn descended(&self, problem: &Problem<'_>, saturation: Saturation, from: &Solution) -> Result<Settled, FitError> {
        let mut here = problem.on(problem.samples);
        here.saturation = saturation;
        let at = descend(&here, from, self.steps, Digits::Rough)?.0;
        self.settled(problem, saturation, at)
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
        self.begin(&few, &more, plain).map(|begun| Some(begun.0))
    }

    /// Follows s roughly.
    fn settled(&self, problem: &Problem<'_>, saturation: Saturation, at: Solution) -> Result<Settled, FitError> {
        let mut problem = problem.on(problem.samples);
        problem.saturation = saturation;
        let (at, met) = self.follow(&mut problem, at, SETTLED_PART)?;
        let floor = self.floor(&problem, &at);
        Ok(Settled { at, saturation: problem.saturation, met, floor })
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
                // A descent may have ended short of the minimum, along a flat way: the s must hold at the end of the next one too.
                let again = if settled <= SETTLED { descend(problem, &at, self.steps, Digits::All)?.0 } else { at };
                if (self.asked(problem, &again) / s).ln().abs() <= settled.max(UNSETTLED) {
                    return Ok((again, true));
                }
                at = again;
                continue;
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
        let spread = self.robust.scale * spread(problem, at);
        if spread > self.robust.scale * self.suspect { spread } else { spread.max(self.floor(problem, at)) }
    }

    /// The s of rounding. Of a gross outlier's size nothing follows for that of the others: the model's values that the data bear out say
    /// what it is.
    fn floor(&self, problem: &Problem<'_>, at: &Solution) -> f64 {
        let borne_out = largest(problem, at, |r0, r| r0.abs().min((r0 - r).abs()));
        self.robust.scale * (ROUNDING * borne_out).max(SMALLEST)
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
    let from = with_room(&problem, &smaller.at);
    let solve = |t: &[f64]| Streamed::rough(&problem).starting_at(&from).solve(t);
    solve(&start::extended(&problem, &smaller.at.t, |t| solve(t).cost))
}

/// A smaller model's solution with the last lobe's weights as small as they may be.
fn with_room(problem: &Problem<'_>, smaller: &Solution) -> Solution {
    let added = problem.layout.last().map_or(0, |(lobe, _)| *lobe);
    let extended = |x: &DVector<f64>, ranges: &[(f64, f64)]| x.clone().insert_row(added, ranges[added].0);
    let weights = smaller.weights.iter().zip(&problem.ranges).map(|(x, ranges)| extended(x, ranges)).collect();
    Solution { weights, ..smaller.clone() }
}

/// Whether every channel's weights keep to the limit of their sum, to rounding.
fn is_within_cap(problem: &Problem<'_>, at: &Solution) -> bool {
    problem.cap.is_none_or(|cap| at.weights.iter().all(|x| x.sum() <= cap * (1.0 + 1e-12)))
}

/// The nodes below their neighbours in s or in cost, the lowest ones.
fn valleys(profile: Vec<Settled>) -> Vec<Settled> {
    let heights: Vec<[f64; 2]> = profile.iter().map(Settled::heights).collect();
    let is_low = |i: usize, of: usize| {
        let here = heights[i][of];
        let left = i.checked_sub(1).is_none_or(|j| here < heights[j][of]);
        left && heights.get(i + 1).is_none_or(|next| here <= next[of])
    };
    let low = |(i, node): (usize, Settled)| (is_low(i, 0) || is_low(i, 1)).then_some(node);
    let mut list: Vec<Settled> = profile.into_iter().enumerate().filter_map(low).collect();
    let mut lowest = Vec::new();
    while lowest.len() < MOST_VALLEYS
        && let Some(best) = take_best(&mut list)
    {
        lowest.push(best);
    }
    lowest
}

/// Median size of the values, where that is not 0.
fn typical(problem: &Problem<'_>) -> f64 {
    let samples = problem.samples;
    let pieces = samples.map_pieces(Vec::new, |list: &mut Vec<f64>, block| {
        for c in 0..problem.ranges.len() {
            list.extend(block.y[c].iter().zip(block.weight(c)).filter(|(_, w)| **w > 0.0).map(|(y, _)| y.abs()));
        }
    });
    let size = median(&mut pieces.into_iter().flatten().collect::<Vec<f64>>());
    if size > 0.0 { size } else { 1.0 }
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

/// The largest size that a sample has by its residuals without any lobe and as it is.
fn largest(problem: &Problem<'_>, at: &Solution, size: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
    let samples = problem.samples;
    let start = || (0.0f64, Vec::new(), Scratch::default());
    let pieces = samples.map_pieces(start, |(largest, without, scratch), block| {
        scratch.basis(&block.x, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            scratch.residuals(samples, block, c, &(x * 0.0), None);
            without.clear();
            without.extend(counting(scratch, block.weight(c)));
            scratch.residuals(samples, block, c, x, None);
            let both = without.iter().zip(counting(scratch, block.weight(c)));
            *largest = both.fold(*largest, |m, (r0, r)| m.max(size(*r0, r)));
        }
    });
    pieces.iter().map(|p| p.0).fold(0.0, f64::max)
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
