//! Pairs of parameters and s that compare: which one is the fit.

use crate::fit::passes::Saturation;
use crate::fit::reduced::Solution;
use crate::fit::start::SearchReport;

/// Two scales that differ by no more, relatively, are alike on a part of the samples, and so are costs over s².
pub(super) const ALIKE: f64 = 4e-3;

/// Parameters and their s, as far as they were followed.
pub(super) struct Candidate {
    pub at: Solution,
    pub saturation: Saturation,
    /// Whether the two have met.
    pub met: bool,
    /// The s that residuals which say something ask for.
    pub rank: f64,
    /// The cost over s², that of rounding at least.
    pub height: f64,
}

impl Candidate {
    /// Whether neither of two is better than the other.
    fn is_alike(&self, other: &Self) -> bool {
        let close = |a: f64, b: f64| a == b || (a / b).ln().abs() <= ALIKE;
        self.met == other.met && close(self.rank, other.rank) && close(self.height, other.height)
    }
}

/// The best of several, taken out: of those that have met, and have an s as small as the smallest, the lowest; of alike ones the last. `None`
/// of none.
pub(super) fn take_best(list: &mut Vec<Candidate>) -> Option<Candidate> {
    let any_met = list.iter().any(|c| c.met);
    let counts = |c: &&Candidate| c.met || !any_met;
    let limit = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min) * (1.0 + ALIKE);
    let rank = limit(&mut list.iter().filter(counts).map(|c| c.rank));
    let near = |c: &&Candidate| counts(c) && c.rank <= rank;
    let height = limit(&mut list.iter().filter(near).map(|c| c.height));
    let best = list.iter().rposition(|c| near(&c) && c.height <= height).or_else(|| list.len().checked_sub(1))?;
    Some(list.remove(best))
}

/// The best of several, and where the others ended. `None` of none.
pub(super) fn best_of(mut list: Vec<Candidate>) -> Option<(Candidate, SearchReport)> {
    let starts = list.len();
    let best = take_best(&mut list)?;
    let reached = 1 + list.extract_if(.., |other| other.is_alike(&best)).count();
    let mut minima = 1;
    while let Some(next) = take_best(&mut list) {
        list.retain(|other| !other.is_alike(&next));
        minima += 1;
    }
    let report = SearchReport { starts, reached, minima, ..SearchReport::default() };
    Some((best, report))
}

/// Takes out those that are alike to one.
pub(super) fn without_like(list: &mut Vec<Candidate>, one: &Candidate) {
    list.retain(|other| !other.is_alike(one));
}
