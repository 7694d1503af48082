//! Where a robust fit begins: at the plain fit, at the model with a lobe fewer, on a lattice of exponents.

use std::cell::Cell;

use nalgebra::DVector;
use rayon::prelude::*;

use super::Settling;
use super::candidate::{Candidate, Ranking};
use super::spread::typical;
use super::way::SHRINK;
use crate::fit::covariance::pinned;
use crate::fit::joint::Digits;
use crate::fit::loss::{Robust, RobustKind};
use crate::fit::options::FitError;
use crate::fit::part::descend;
use crate::fit::passes::Saturation;
use crate::fit::reduced::{Problem, Solution};
use crate::fit::start::{self, SearchReport};
use crate::fit::streamed::Streamed;

/// The lattice's own loss, at its usual scale: an outlier's pull on it fades, so that none is too large.
const GENTLE: RobustKind = RobustKind::Cauchy;
/// Rounds in which the s of a node settles at most, and the relative change at which it has.
const NODE_ROUNDS: usize = 12;
const SETTLED_NODE: f64 = 0.02;
/// Valleys of the lattice followed on the first part of the samples at most, and of them on the second.
const MOST_VALLEYS: usize = 6;
const MOST_FOLLOWED: usize = 2;
/// Residuals per free parameter below which the middle half of them can be met by chance, so that the smallest s says little.
const FEWEST_RESIDUALS: usize = 5;

impl Settling {
    /// Where to begin, from the parts of the samples: from the plain fit, from a lattice, or from the model with a lobe fewer. One of them
    /// must lead somewhere. What would be begun after the deadline is left out, the way from the plain fit last.
    pub(super) fn begin(
        &self,
        few: &Problem<'_>,
        more: &Problem<'_>,
        plain: &Solution,
    ) -> Result<(Candidate, SearchReport), FitError> {
        let plain = self.after_plain(few, more, plain);
        // As long as there is no answer the time is not over.
        let may_end = plain.as_ref().is_ok_and(|candidate| candidate.sigma.is_finite());
        let cut = Cell::new(false);
        let is_late = || {
            let late = may_end && self.deadline.is_past();
            cut.set(cut.get() || late);
            late
        };
        let smaller = if is_late() { None } else { self.smaller(few, more) };
        let mut found = if is_late() { Vec::new() } else { self.by_lattice(few, more, smaller.as_ref(), &is_late) };
        // Outliers may hold the plain fit of many lobes where that of few lets them go; of alike ones it is the one to go on from, for its
        // lobes are not two that stand in one place.
        let smaller = smaller.filter(|_| !is_late());
        let richer = smaller.and_then(|s| self.candidate(more, s.saturation, with_a_lobe_more(more, &s)).ok());
        match plain {
            Ok(plain) => found.insert(0, plain),
            Err(error) if found.is_empty() && richer.is_none() => return Err(error),
            Err(_) => {}
        }
        found.extend(richer);
        let ranking = Ranking::new(more, self.rounding, found);
        let settled = ranking.settle().map(|(best, report)| (best, SearchReport { cut: cut.get(), ..report }));
        settled.ok_or_else(|| FitError::Solver { reason: "no robust fit has finite residuals".into() })
    }

    /// Beginning with the plain fit and its s.
    fn after_plain(&self, few: &Problem<'_>, more: &Problem<'_>, plain: &Solution) -> Result<Candidate, FitError> {
        let (mut few, mut more) = (few.on(few.samples), more.on(more.samples));
        let saturation = Some((self.robust.kind, self.asked(&more, plain)));
        (few.saturation, more.saturation) = (saturation, saturation);
        let plain = descend(&more, plain, self.steps, Digits::Rough);
        if self.deadline.is_past() {
            return self.candidate(&more, saturation, plain?.0);
        }
        // Outliers may have drawn the plain fit into another valley: the robust cost has the last word on where to go on.
        let other = start::search_streamed(&few, &more, self.steps, self.deadline)?;
        let other = Streamed::new(&more).solve(other.outcome.parameters.as_slice());
        let other = descend(&more, &other, self.steps, Digits::Rough);
        let (plain, other) = (plain?.0, other?.0);
        self.candidate(&more, saturation, if other.cost < plain.cost { other } else { plain })
    }

    /// The robust fit of the model without its last shaped lobe, if that has any lobes and a fit.
    fn smaller(&self, few: &Problem<'_>, more: &Problem<'_>) -> Option<Candidate> {
        let shapes = more.layout.len().checked_sub(1)?;
        let (few, more) = (few.with_shapes(shapes), more.with_shapes(shapes));
        if more.kinds.is_empty() {
            return None;
        }
        let plain = start::search_plain(&more, (&few, &more), self.steps, self.deadline).ok()?;
        let plain = Streamed::new(&more).solve(plain.outcome.parameters.as_slice());
        self.begin(&few, &more, &plain).ok().map(|begun| begun.0)
    }

    /// Beginning with a lattice of the last shape, the others as the model with a lobe fewer has them: its valleys, followed. It knows nothing of
    /// the plain fit; without a smaller model weights and s begin with the data's own size and spread.
    fn by_lattice(
        &self,
        few: &Problem<'_>,
        more: &Problem<'_>,
        smaller: Option<&Candidate>,
        is_late: &dyn Fn() -> bool,
    ) -> Vec<Candidate> {
        if smaller.is_none() && few.layout.len() > 1 {
            return Vec::new(); // there is one, but it has no fit
        }
        let free = pinned(few, few.ranges.len()).iter().filter(|held| !**held).count();
        if few.samples.residuals() < FEWEST_RESIDUALS * free {
            return Vec::new();
        }
        let gentle = Self { robust: Robust { kind: GENTLE, scale: GENTLE.default_scale() }, ..*self };
        let (from, s) = match smaller {
            Some(smaller) => (with_room(few, &smaller.at), gentle.asked(few, &smaller.at)),
            None => gentle.start_by_data(few),
        };
        let at_node = |last: &Option<f64>| {
            let t: Vec<f64> = from.t.iter().copied().chain(*last).collect();
            gentle.at_node(few, s, &from, &t)
        };
        let profile: Vec<Candidate> = start::last_nodes(few).par_iter().map(at_node).collect();
        if is_late() {
            return Vec::new();
        }
        let follow = |valley: Candidate| gentle.descended(few, valley.saturation, &valley.at).ok();
        let ends: Vec<Option<Candidate>> = self.valleys(few, profile).into_par_iter().map(follow).collect();
        let mut ends = Ranking::new(few, self.rounding, ends.into_iter().flatten().collect());
        let mut found = Vec::new();
        for _ in 0..MOST_FOLLOWED {
            let Some((best, _)) = ends.take().filter(|_| !is_late()) else { break };
            let Ok(own) = gentle.descended(more, best.saturation, &best.at) else { continue };
            let saturation = Some((self.robust.kind, self.asked(more, &own.at)));
            found.extend(self.descended(more, saturation, &own.at));
        }
        found
    }

    /// The nodes below their neighbours in σ or in cost, the best ones.
    fn valleys(&self, problem: &Problem<'_>, profile: Vec<Candidate>) -> Vec<Candidate> {
        let heights: Vec<[f64; 2]> = profile.iter().map(|node| [node.sigma, node.at.cost]).collect();
        let is_low = |i: usize, of: usize| {
            let here = heights[i][of];
            let left = i.checked_sub(1).is_none_or(|j| here < heights[j][of]);
            left && heights.get(i + 1).is_none_or(|next| here <= next[of])
        };
        let low = |(i, node): (usize, Candidate)| (is_low(i, 0) || is_low(i, 1)).then_some(node);
        let list: Vec<Candidate> = profile.into_iter().enumerate().filter_map(low).collect();
        let mut ranking = Ranking::new(problem, self.rounding, list);
        (0..MOST_VALLEYS).map_while(|_| ranking.take().map(|(best, _)| best)).collect()
    }

    /// Weights of the data's own size, and the s of the residuals that there are with weights as small as they may be.
    fn start_by_data(&self, problem: &Problem<'_>) -> (Solution, f64) {
        let lobes = problem.kinds.len();
        let share = typical(problem).min(problem.cap.map_or(f64::INFINITY, |cap| cap / lobes as f64));
        let of = |ranges: &Vec<(f64, f64)>, x: f64| {
            DVector::from_iterator(lobes, ranges.iter().map(|(low, high)| x.clamp(*low, *high)))
        };
        // Shapes are only there for the weights to have columns: the nodes bring their own.
        let t: Vec<f64> = problem.bounds.iter().map(|b| b.0).collect();
        let weights = |x: f64| problem.ranges.iter().map(|ranges| of(ranges, x)).collect();
        let at = |x: f64| Solution { lobes: problem.shaped(&t), t: Vec::new(), weights: weights(x), cost: f64::NAN };
        // Where most values are 0 their own deviation is none: those that are not say from where to come down.
        let s = self.asked(problem, &at(0.0));
        (at(share), if s > 1.01 * self.robust.scale * self.rounding { s } else { self.robust.scale * self.typical })
    }

    /// Weights and s of given shapes, from above, as far as a few rounds go.
    fn at_node(&self, problem: &Problem<'_>, s: f64, from: &Solution, t: &[f64]) -> Candidate {
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
        self.judged(&problem, at, true)
    }

    /// Descends, then follows s roughly.
    fn descended(&self, problem: &Problem<'_>, saturation: Saturation, from: &Solution) -> Result<Candidate, FitError> {
        let mut here = problem.on(problem.samples);
        here.saturation = saturation;
        let at = descend(&here, from, self.steps, Digits::Rough)?.0;
        self.candidate(problem, saturation, at)
    }
}

/// A smaller model's robust fit with the last lobe added where that helps most at the same s.
fn with_a_lobe_more(problem: &Problem<'_>, smaller: &Candidate) -> Solution {
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
