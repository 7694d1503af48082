//! Robust losses: the scale s and the parameters that go with it.
//!
//! s is a multiple of the residuals' own spread, which depends on the parameters, which depend on s. The way in is from above: the
//! plain fit's spread is too large where outliers pull it; as they let go it shrinks, and the parameters follow. There may be several such
//! pairs, and outliers may hide the right one from the plain fit: so there are other ways in ([`starts`]). Of the pairs found on a part of the
//! samples the best one ([`candidate`]) is followed on all.

mod candidate;
mod spread;
mod starts;
mod way;

use super::budget::Deadline;
use super::joint::Digits;
use super::loss::Robust;
use super::options::{FitError, FitOptions};
use super::part::descend;
use super::passes::Saturation;
use super::reduced::{Problem, Solution};
use super::start::SearchReport;
pub(super) use candidate::JUDGE_SCALE;
use candidate::{Candidate, Ranking};
pub(super) use spread::{bounded_cost, sizes};
use spread::{spread, telling_spread};
use way::Way;

/// Rounds in which s settles at most.
const ROUNDS: usize = 60;
/// Relative change beyond which s counts as not settled where the rounds ran out: far below what the parameters' errors tell apart.
const UNSETTLED: f64 = 1e-6;

/// How closely s is followed.
#[derive(Clone, Copy)]
struct Aim {
    /// Relative change at which it has settled.
    tolerance: f64,
    /// What the descents are good to.
    digits: Digits,
}

/// On small tables; on others and in the rounds of a budget, where each round takes passes and the parameters' own errors are far larger; on the
/// part of the samples that says where to begin.
const CLOSELY: Aim = Aim { tolerance: 1e-12, digits: Digits::All };
const LARGE: Aim = Aim { tolerance: 1e-7, digits: Digits::Rough };
const ROUGHLY: Aim = Aim { tolerance: 1e-3, digits: Digits::Rough };

/// The parameters at the s that their residuals ask for, starting from the plain loss's fit and from elsewhere, whether the two met, and how
/// they were looked for; sets the problem's s. `few` and `more` are the same problem on parts of the samples, which say where to begin. After
/// `deadline` only the way from the plain fit is gone, as far as one step leads.
pub(super) fn settle(
    problem: &mut Problem<'_>,
    (few, more): (&Problem<'_>, &Problem<'_>),
    plain: &Solution,
    (robust, options): (Robust, &FitOptions),
    deadline: Deadline,
) -> Result<(Solution, bool, SearchReport), FitError> {
    let settling = Settling::new(problem, plain, (robust, options), deadline);
    let (begun, mut report) = settling.begin(few, more, plain)?;
    problem.saturation = begun.saturation;
    let (at, met) = settling.follow(problem, begun.at, aim(problem))?;
    report.unsettled |= !met && deadline.is_past();
    Ok((at, met, report))
}

/// A robust fit on all samples.
pub(super) struct Robustly {
    pub at: Solution,
    pub saturation: Saturation,
    /// Whether the two have met.
    pub met: bool,
}

/// As [`settle`], from a point `near` a valley that is lower at the problem's s; the fit that `here` is where that is no better at an s of its
/// own, by [`Ranking`]. Without a robust loss the point alone. `None` stands for `here`.
pub(super) fn resettle(
    problem: &Problem<'_>,
    here: (&Solution, bool),
    near: Solution,
    options: &FitOptions,
    deadline: Deadline,
) -> Option<Robustly> {
    let Some(robust) = options.robust else { return Some(Robustly { at: near, saturation: None, met: true }) };
    let settling = Settling::new(problem, &near, (robust, options), deadline);
    let mut there = problem.on(problem.samples);
    there.saturation = problem.saturation;
    let at = descend(&there, &near, options.max_iterations, Digits::Rough).ok()?.0;
    let (at, met) = settling.follow(&mut there, at, aim(problem)).ok()?;
    let stays = settling.judged(problem, here.0.clone(), here.1);
    let goes = settling.judged(&there, at, met);
    let (best, alike) = Ranking::new(problem, settling.rounding, vec![stays, goes]).take()?;
    let moves = alike == 1 && best.saturation == there.saturation;
    moves.then_some(Robustly { at: best.at, saturation: best.saturation, met: best.met })
}

/// ln(the s that the residuals ask for / the problem's s), where that is worth a word.
pub(super) fn left(problem: &Problem<'_>, at: &Solution, options: &FitOptions) -> Option<f64> {
    let (robust, (_, s)) = options.robust.zip(problem.saturation)?;
    let left = (Settling::new(problem, at, (robust, options), Deadline::NEVER).asked(problem, at) / s).ln();
    Some(left).filter(|left| left.abs() > UNSETTLED)
}

/// How closely s is followed on all samples.
fn aim(problem: &Problem<'_>) -> Aim {
    if problem.samples.want_last_digits() { CLOSELY } else { LARGE }
}

/// How s is looked for.
#[derive(Clone, Copy)]
struct Settling {
    robust: Robust,
    /// Most steps of a descent.
    steps: u64,
    /// Median size of the data that are not 0, as residuals.
    typical: f64,
    /// A spread below this is rounding.
    rounding: f64,
    /// The value that a good part of the data have, if any.
    common: Option<f64>,
    /// When it has to end.
    deadline: Deadline,
}

impl Settling {
    fn new(
        problem: &Problem<'_>,
        like: &Solution,
        (robust, options): (Robust, &FitOptions),
        deadline: Deadline,
    ) -> Self {
        let (typical, rounding) = sizes(problem.samples, like);
        let values = spread::sorted_values(problem);
        let rounding = rounding.max(typical * spread::rounding_share(&values, problem));
        let common = spread::common_value(&values);
        Self { robust, steps: options.max_iterations, typical, rounding, common, deadline }
    }

    /// Follows s roughly.
    fn candidate(&self, problem: &Problem<'_>, saturation: Saturation, at: Solution) -> Result<Candidate, FitError> {
        let mut problem = problem.on(problem.samples);
        problem.saturation = saturation;
        let (at, met) = self.follow(&mut problem, at, ROUGHLY)?;
        Ok(self.judged(&problem, at, met))
    }

    /// A point of a problem with its s, to be compared.
    fn judged(&self, problem: &Problem<'_>, at: Solution, met: bool) -> Candidate {
        let sigma = telling_spread(problem.samples, &at, self.common, self.rounding);
        Candidate { at, saturation: problem.saturation, met, sigma }
    }

    /// Brings ln(new s) − ln(old s) to 0 by secants, within the bracket that is known; the parameters follow. Says
    /// whether it got there within [`ROUNDS`], none of which is begun after the deadline.
    fn follow(&self, problem: &mut Problem<'_>, start: Solution, aim: Aim) -> Result<(Solution, bool), FitError> {
        let mut at = start;
        let mut s = problem.saturation.map_or(1.0, |(_, s)| s);
        let mut way = Way::default();
        for _ in 0..ROUNDS {
            let excess = (self.asked(problem, &at) / s).ln();
            if excess.abs() > aim.tolerance {
                if self.deadline.is_past() {
                    break;
                }
                s = way.next(s.ln(), excess).exp();
                problem.saturation = Some((self.robust.kind, s));
                at = descend(problem, &at, self.steps, aim.digits)?.0;
                continue;
            }
            if !matches!(aim.digits, Digits::All) {
                return Ok((at, true));
            }
            // A descent may have ended short of the minimum, along a flat way: the s must hold at the end of the next one too.
            at = descend(problem, &at, self.steps, aim.digits)?.0;
            if (self.asked(problem, &at) / s).ln().abs() <= UNSETTLED {
                return Ok((at, true));
            }
        }
        let met = (self.asked(problem, &at) / s).ln().abs() <= UNSETTLED;
        Ok((at, met))
    }

    /// The s that the residuals ask for.
    fn asked(&self, problem: &Problem<'_>, at: &Solution) -> f64 {
        self.robust.scale * spread(problem.samples, at).clamp(self.rounding, f64::INFINITY)
    }
}
