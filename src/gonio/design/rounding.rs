//! Shares of the time to whole readings that a budget pays for, moves and visits included, in an order that keeps moves few.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::prior::Wrong;
use crate::gonio::cost::{seconds_of, visit_s};
use crate::gonio::instrument::Instrument;
use crate::gonio::travel::Moves;
use crate::measurement::Directions;

/// A candidate that is read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    /// Share of the time.
    pub weight: f64,
    /// Seconds of one row, its part of the moves and visits included where stops are short.
    pub row_s: f64,
    /// Rows of one stop at most: more tell less than another approach, whose jitter is a new one.
    pub rows_per_stop: u32,
}

/// Most rows a plan may have.
const MOST_ROWS: f64 = 1e6;

/// Rows (indices of `shares` and their `directions`, in the order in which they are read) that take no longer than `budget_s`. Each share is multiplied by the same number
/// and rounded up, as efficient rounding asks (Pukelsheim & Rieder 1992): the number is the largest that the budget pays for. What is left then, much where shares
/// are alike, pays for one row more each of those that come next.
///
/// # Errors
/// [`Wrong::Budget`] where it does not pay for one row each, [`Wrong::TooMany`].
pub(super) fn rows(
    shares: &[Share],
    directions: &Directions,
    instrument: &Instrument,
    budget_s: f64,
) -> Result<Vec<u32>, Wrong> {
    let moves = Moves::new(instrument, directions);
    let seconds = |counts: &[u32]| seconds_of(instrument, &moves, &in_order(shares, counts));
    let least_s = seconds(&counts(shares, 0.0));
    if least_s > budget_s {
        // Up to the next ms, so that the time that is asked for is enough.
        let least_s = (1e3 * least_s).ceil() / 1e3;
        return Err(Wrong::Budget { pairs: shares.len(), least_s, found_s: budget_s });
    }
    let cheapest = shares.iter().map(|s| s.row_s).fold(f64::INFINITY, f64::min);
    let found = (budget_s - 2.0 * visit_s(instrument)) / cheapest;
    if found > MOST_ROWS {
        return Err(Wrong::TooMany { found, most: MOST_ROWS });
    }
    // No more than the whole budget can be shared out.
    let (mut low, mut high) = (0.0, 2.0 * budget_s);
    while high - low > 1e-6 * budget_s {
        let middle = 0.5 * (low + high);
        let fits = seconds(&counts(shares, middle)) <= budget_s;
        if fits { low = middle } else { high = middle }
    }
    let sure = counts(shares, low);
    let mut next = next_in_turn(shares, low);
    next.truncate((MOST_ROWS - sure.iter().map(|n| f64::from(*n)).sum::<f64>()).max(0.0) as usize);
    let with = |more: usize| {
        let mut counts = sure.clone();
        next[..more].iter().for_each(|&x| counts[x] += 1);
        counts
    };
    // By halves: rows more take longer, but for a move that is saved here and there.
    let (mut more, mut too_many) = (0, next.len() + 1);
    while too_many - more > 1 {
        let middle = usize::midpoint(more, too_many);
        if seconds(&with(middle)) <= budget_s { more = middle } else { too_many = middle }
    }
    Ok(in_order(shares, &with(more)))
}

/// As many rows as `time_s` seconds shared out give, rounded up, one at least.
fn counts(shares: &[Share], time_s: f64) -> Vec<u32> {
    shares.iter().map(|s| ((time_s * s.weight / s.row_s).ceil() as u32).max(1)).collect()
}

/// Who gets a row more first: whose share is next to be rounded up, of equals every second, then every fourth between them and so on.
fn next_in_turn(shares: &[Share], time_s: f64) -> Vec<usize> {
    let due = |s: &Share| time_s * s.weight / s.row_s;
    let missing = |s: &Share| (due(s).ceil().max(1.0) - due(s)) / s.weight * s.row_s;
    let mut order: Vec<usize> = (0..shares.len()).collect();
    order.sort_by_key(|x| x.reverse_bits());
    let mut nearly: Vec<(f64, usize)> = order.into_iter().map(|x| (missing(&shares[x]), x)).collect();
    // Seconds to the next row, alike to a part in 10⁶ of all: the order above decides.
    let step = 1e-6 * nearly.iter().map(|of| of.0).filter(|s| s.is_finite()).fold(1e-300, f64::max);
    nearly.sort_by(|a, b| (a.0 / step).round().total_cmp(&(b.0 / step).round()));
    nearly.into_iter().map(|of| of.1).collect()
}

/// So many rows each in stops that are as even as they can be.
fn in_order(shares: &[Share], counts: &[u32]) -> Vec<u32> {
    let stops: Vec<u32> = counts.iter().zip(shares).map(|(n, s)| n.div_ceil(s.rows_per_stop)).collect();
    let mut taken = vec![0; shares.len()];
    let mut rows = Vec::new();
    for x in alternating(&stops) {
        // Whole rows of an even split: what is due after this stop less what was due before.
        let due = |k: u32| u64::from(counts[x]) * u64::from(k) / u64::from(stops[x]);
        let now = due(taken[x] + 1) - due(taken[x]);
        rows.extend(std::iter::repeat_n(x as u32, now as usize));
        taken[x] += 1;
    }
    rows
}

/// Each index as often as `left` says, none twice in a row while another is left: two stops in a row at one pair would be one, of one jitter. Next
/// comes whichever has most left, the first of equals.
fn alternating(left: &[u32]) -> Vec<usize> {
    let mut others: BinaryHeap<(u32, Reverse<usize>)> =
        left.iter().enumerate().filter(|(_, n)| **n > 0).map(|(x, n)| (*n, Reverse(x))).collect();
    let mut order: Vec<usize> = Vec::with_capacity(left.iter().map(|n| *n as usize).sum());
    // The one that came last waits until another has come.
    let mut last: Option<(u32, Reverse<usize>)> = None;
    while let Some((n, x)) = others.pop().or_else(|| last.take()) {
        order.push(x.0);
        others.extend(last.take());
        last = Some((n - 1, x)).filter(|(n, _)| *n > 0);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;
    use crate::gonio::parts::Axes;
    use crate::gonio::seconds;

    fn shares(rows_per_stop: u32) -> Vec<Share> {
        [0.4, 0.35, 0.25].map(|weight| Share { weight, row_s: 1.0, rows_per_stop }).to_vec()
    }

    fn directions() -> Directions {
        let wo = [0.0, 20.0, 40.0].map(|theta| direction_deg(theta, 0.0)).to_vec();
        Directions::List { wi: vec![direction_deg(30.0, 180.0); 3], wo }
    }

    fn moving(degrees_per_s: f64) -> Instrument {
        Instrument { axes: Axes { move_s: 7.0, degrees_per_s, ..Axes::default() }, ..Instrument::default() }
    }

    #[test]
    fn the_budget_is_kept_and_used_but_for_two_rows_and_their_moves() {
        for (budget, rows_per_stop, degrees_per_s) in
            [(25.0, 500, 0.0), (100.0, 500, 0.0), (1000.0, 500, 0.0), (1000.0, 20, 0.0), (1000.0, 20, 5.0)]
        {
            let instrument = moving(degrees_per_s);
            let rows = rows(&shares(rows_per_stop), &directions(), &instrument, budget).expect("enough");
            let used = seconds(&instrument, &directions(), &rows);
            let longest_move = if degrees_per_s > 0.0 { 7.0 + 40.0 / degrees_per_s } else { 7.0 };
            assert!(used <= budget && used > budget - 2.0 * (1.0 + longest_move), "{budget}: {used}");
            let longest = rows.chunk_by(|a, b| a == b).map(<[u32]>::len).max().unwrap_or(0);
            assert!(longest <= rows_per_stop as usize);
        }
        let many = rows(&shares(500), &directions(), &moving(0.0), 1e3).expect("enough");
        let count = |x: u32| many.iter().filter(|r| **r == x).count() as f64 / many.len() as f64;
        assert!((count(0) - 0.4).abs() < 0.01 && (count(2) - 0.25).abs() < 0.01);
    }

    /// Equal shares are not doubled by half of the time: what is left goes to every second one.
    #[test]
    fn what_is_left_is_spread_over_equals() {
        let shares = vec![Share { weight: 0.05, row_s: 8.0, rows_per_stop: 1 }; 20];
        let wo = (0..20).map(|k| direction_deg(4.0 * f64::from(k), 0.0)).collect();
        let directions = Directions::List { wi: vec![direction_deg(30.0, 180.0); 20], wo };
        let counts = |budget: f64| {
            let rows = rows(&shares, &directions, &moving(0.0), budget).expect("enough");
            (0..20).map(|x| rows.iter().filter(|r| **r == x).count()).collect::<Vec<_>>()
        };
        let least = seconds(&moving(0.0), &directions, &(0..20).collect::<Vec<_>>());
        assert_eq!(counts(least), [1; 20]);
        let found = counts(1.5 * least);
        assert!((28..=31).contains(&found.iter().sum::<usize>()), "{found:?}");
        assert!(found.windows(3).all(|w| (4..=5).contains(&w.iter().sum::<usize>())), "{found:?}");
    }

    #[test]
    fn stops_alternate_while_another_is_left() {
        assert_eq!(alternating(&[1, 1, 1]), [0, 1, 2]);
        let order = alternating(&[3, 5, 1]);
        assert!(order.len() == 9 && order.windows(2).all(|w| w[0] != w[1]), "{order:?}");
        assert_eq!(alternating(&[1, 4]), [1, 0, 1, 1, 1]);
    }

    #[test]
    fn too_little_says_the_least_that_is_needed() {
        let (instrument, directions) = (moving(0.0), directions());
        let error = rows(&shares(500), &directions, &instrument, 23.0).expect_err("too little").to_string();
        assert!(error.contains("24") && error.contains("23"), "{error}");
        assert!(rows(&shares(500), &directions, &instrument, 24.0).expect("just enough").len() == 3);
        assert!(matches!(rows(&shares(500), &directions, &instrument, 1e8), Err(Wrong::TooMany { .. })));
    }
}
