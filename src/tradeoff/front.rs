//! The Pareto front: settings that no other beats in both time and error.

use serde::Serialize;

use crate::numeric::estimate::Estimate;

/// Where a setting stands among the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Standing {
    /// None found is better in both time and error.
    Front,
    /// Another one is better in both, but their 95 % intervals overlap.
    Undecided,
    /// Another one is better in both, beyond the intervals.
    Beaten,
    /// Too little is known of it.
    Unknown,
}

/// The standing of each setting, of its time and its error.
pub(super) fn standings(points: &[Option<(Estimate, Estimate)>]) -> Vec<Standing> {
    let of = |own: &Option<(Estimate, Estimate)>| {
        let Some((time, error)) = own else { return Standing::Unknown };
        let others = || points.iter().flatten();
        let surely = |o: &(Estimate, Estimate)| o.0.high < time.low && o.1.high < error.low;
        // As good in one and better in the other is better.
        let better = |o: &(Estimate, Estimate)| {
            let (t, e) = (o.0.value, o.1.value);
            t <= time.value && e <= error.value && (t < time.value || e < error.value)
        };
        if others().any(surely) {
            Standing::Beaten
        } else if others().any(better) {
            Standing::Undecided
        } else {
            Standing::Front
        }
    };
    points.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::Standing::{Beaten, Front, Undecided, Unknown};
    use super::*;

    fn point(time: f64, error: f64) -> (Estimate, Estimate) {
        let estimate = |value: f64| Estimate { value, low: value / 1.1, high: value * 1.1 };
        (estimate(time), estimate(error))
    }

    #[test]
    fn only_what_is_surely_worse_in_both_is_beaten() {
        let points = [
            Some(point(1.0, 8.0)),
            Some(point(2.0, 4.0)),
            Some(point(4.0, 9.0)), // later and worse than both
            Some(point(2.1, 4.1)), // within the intervals of the second
            Some(point(2.0, 3.9)), // as fast as the second, and better: which leaves the second open
            None,
        ];
        assert_eq!(standings(&points), [Front, Undecided, Beaten, Undecided, Front, Unknown]);
    }
}
