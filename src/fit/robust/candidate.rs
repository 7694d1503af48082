//! Pairs of parameters and s that compare: which one is the fit.
//!
//! Of two fits of their own s neither the costs compare nor the s: a median deviation of N residuals scatters by 1.2/√N, and a fit that gives up
//! a lobe's few samples may well have the smaller one. So all are judged by one cost at one s, by a loss to which an outlier is no more than
//! one sample (as MM-estimates are: Yohai 1987).

use super::spread::bounded_cost;
use crate::fit::passes::Saturation;
use crate::fit::reduced::{Problem, Solution};
use crate::fit::start::SearchReport;

/// s of the judging loss over σ: 95 % as efficient as least squares where noise is normal.
pub(in crate::fit) const JUDGE_SCALE: f64 = 4.685;
/// Three standard deviations of the median deviation of normal noise, relative, times the root of its number.
const MARGIN: f64 = 3.5;
/// Two fits are alike whose judging costs differ by no more a residual: noise makes it about 0.12.
const ALIKE: f64 = 1e-5;

/// Parameters and their s, as far as they were followed.
pub(super) struct Candidate {
    pub at: Solution,
    pub saturation: Saturation,
    /// Whether the two have met.
    pub met: bool,
    /// σ by the median deviation of the residuals that say something.
    pub sigma: f64,
}

/// The candidates of one problem, to be taken best first.
pub(super) struct Ranking {
    /// With each one's cost.
    list: Vec<(Candidate, f64)>,
    /// Costs that differ by less are alike.
    tolerance: f64,
}

impl Ranking {
    /// Those whose residuals are all finite. `rounding` is the σ up to which they may be rounding.
    pub fn new(problem: &Problem<'_>, rounding: f64, list: Vec<Candidate>) -> Self {
        let list: Vec<Candidate> = list.into_iter().filter(|c| c.sigma.is_finite()).collect();
        let any_met = list.iter().any(|c| c.met);
        let counting = list.iter().filter(|c| c.met || !any_met).map(|c| c.sigma);
        let least = counting.fold(f64::INFINITY, f64::min).max(rounding);
        // The smallest of several is too small as a rule, by what a median deviation of so few scatters.
        let residuals = problem.samples.residuals() as f64;
        let margin = 1.0 + MARGIN / residuals.sqrt();
        let s = JUDGE_SCALE * margin * least;
        let costs = list.iter().map(|c| bounded_cost(problem.samples, &c.at, s)).collect::<Vec<f64>>();
        let judged = list.into_iter().zip(costs);
        let list = judged.filter(|(_, cost)| cost.is_finite()).collect();
        Self { list, tolerance: ALIKE * residuals }
    }

    /// Takes the best out, and all that are alike to it; says how many that were. Of alike ones the last is the best; one whose s has not settled
    /// loses to one whose has.
    pub fn take(&mut self) -> Option<(Candidate, usize)> {
        let met = self.list.iter().any(|(c, _)| c.met);
        let lowest =
            self.list.iter().filter(|(c, _)| c.met == met).map(|(_, cost)| *cost).fold(f64::INFINITY, f64::min);
        let is_alike = |(c, cost): &(Candidate, f64)| c.met == met && cost - lowest <= self.tolerance;
        let (alike, others) = std::mem::take(&mut self.list).into_iter().partition::<Vec<_>, _>(is_alike);
        self.list = others;
        let count = alike.len();
        alike.into_iter().next_back().map(|(best, _)| (best, count))
    }

    /// Takes the best, and tells where the others ended.
    pub fn settle(mut self) -> Option<(Candidate, SearchReport)> {
        let starts = self.list.len();
        let (best, reached) = self.take()?;
        let minima = 1 + std::iter::from_fn(|| self.take()).count();
        Some((best, SearchReport { starts, reached, minima, ..SearchReport::default() }))
    }
}
