//! Which accuracy a time allows: the cost of means over source and aperture, predicted from some of the readings.

use std::time::{Duration, Instant};

use super::effects;
use super::forward::{BLOCK, Job};
use crate::control::Control;

/// Readings that are tried, and those before that make what all readings share: tables of lobes through cones.
const TRIED: usize = 256;
const BEFORE: usize = 8;
/// Share of the time that trials may take.
const TRIALS: f64 = 0.2;
/// Accuracies that are tried, each a step finer; the first takes the lowest orders that there are.
pub(super) const COARSEST: f64 = 0.3;
const STEP: f64 = 0.1f64;
const FINEST: f64 = 1e-12;

/// Times are no longer than that, so that they can be added.
const LONGEST: Duration = Duration::from_secs(u32::MAX as u64);

/// What a time allows.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Affordable {
    /// Relative error that means over source and aperture may have.
    pub accuracy: f64,
    /// Seconds that all readings are predicted to take with it.
    pub predicted_s: f64,
    /// Whether they fit; if not, the accuracy is the coarsest.
    pub fits: bool,
    /// When readings have to be done that trials mistake: from then on the rest takes the lowest orders.
    #[serde(skip)]
    pub deadline: Deadline,
}

/// When all readings have to be made, and how long one takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deadline {
    begun: Instant,
    end: Instant,
    /// Predicted seconds of a reading of one thread, with the accuracy that was chosen and with the lowest orders.
    chosen_s: f64,
    lowest_s: f64,
    readings: usize,
}

/// Readings of one thread from which on their time tells how far the prediction is off.
const TOLD: f64 = 32.0;

impl Deadline {
    /// Whether those from number `next` on are late unless they take the lowest orders. Trials that underrate a reading do so of all orders: what was
    /// made so far says by how much.
    pub(super) fn presses(&self, next: usize) -> bool {
        let now = Instant::now();
        let threads = rayon::current_num_threads().max(1);
        let made = (next / BLOCK / threads * BLOCK + next % BLOCK) as f64;
        let predicted = self.chosen_s * made;
        let slower = if made < TOLD { 1.0 } else { now.duration_since(self.begun).as_secs_f64() / predicted };
        let left = self.lowest_s * slower.max(1.0) * in_a_row(self.readings.saturating_sub(next));
        self.end.saturating_duration_since(now).as_secs_f64() <= left
    }
}

impl Job<'_> {
    /// The best accuracy with which all readings fit into `time`, less what the trials took.
    #[must_use]
    pub fn affordable(&self, time: Duration) -> Affordable {
        let clock = Instant::now();
        let budget = time.as_secs_f64();
        let (readings, actual) = self.prepare();
        let every = readings.len().div_ceil(TRIED).max(1);
        let some: Vec<_> = readings.iter().step_by(every).copied().collect();
        let first: Vec<_> = some.iter().step_by(some.len().div_ceil(BEFORE).max(1)).copied().collect();
        // Tables that passes share are kept as long as any pass is; what comes of these readings is not wanted.
        let kept = effects::passes(&self.maker(&actual), self.left_out);
        let _ = Job { accuracy: COARSEST, ..*self }.read(first, &actual, Control::silent());
        let predict = |accuracy: f64| {
            let trial = Job { accuracy, ..*self };
            let start = Instant::now();
            let read = trial.read(some.clone(), &actual, Control::silent());
            let each = start.elapsed().as_secs_f64() / read.readings.len().max(1) as f64;
            each * in_a_row(readings.len())
        };
        let (predicted_s, count) = (predict(COARSEST), readings.len());
        let each = |predicted_s: f64| predicted_s / in_a_row(count).max(1.0);
        let lowest_s = each(predicted_s);
        let end = clock + time.min(LONGEST);
        let deadline = Deadline { begun: clock, end, chosen_s: lowest_s, lowest_s, readings: count };
        let mut best = Affordable { accuracy: COARSEST, predicted_s, fits: false, deadline };
        best.fits = best.predicted_s + clock.elapsed().as_secs_f64() <= budget;
        let mut accuracy = COARSEST * STEP;
        while best.fits && accuracy >= FINEST && clock.elapsed().as_secs_f64() < TRIALS * budget {
            let predicted_s = predict(accuracy);
            if predicted_s + clock.elapsed().as_secs_f64() > budget {
                break;
            }
            let deadline = Deadline { chosen_s: each(predicted_s), ..deadline };
            best = Affordable { accuracy, predicted_s, fits: true, deadline };
            accuracy *= STEP;
        }
        drop(kept);
        best.deadline.begun = Instant::now();
        best
    }
}

/// Readings that one thread makes in a row: blocks are shared out whole.
fn in_a_row(readings: usize) -> f64 {
    let blocks = readings.div_ceil(BLOCK);
    let threads = rayon::current_num_threads().max(1);
    readings.min(blocks.div_ceil(threads) * BLOCK) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second for 1000 readings, by thread, of which 0.1 s is what the lowest orders take: late where the clock says so, and where readings took five
    /// times as long as was thought, for then the lowest orders will too.
    #[test]
    fn readings_that_take_longer_than_was_thought_press_sooner() {
        let threads = rayon::current_num_threads();
        let (now, readings) = (Instant::now(), 1000 * threads);
        let ago = |s: f64| now.checked_sub(Duration::from_secs_f64(s)).expect("a clock that is older");
        let at = |elapsed: f64| Deadline {
            begun: ago(elapsed),
            end: now + Duration::from_secs_f64(1.0 - elapsed),
            chosen_s: 8e-4,
            lowest_s: 1e-4,
            readings,
        };
        // 100 readings of a thread in 0.08 s, as predicted; in 0.8 s, when 0.1 s for the rest becomes 0.9 s.
        assert!(!at(0.08).presses(100));
        assert!(at(0.8).presses(100));
        // Five times too slow: 0.45 s are needed for the rest, 0.6 s and 0.4 s are there.
        assert!(!at(0.4).presses(100) && Deadline { end: now + Duration::from_secs_f64(0.4), ..at(0.4) }.presses(100));
        // Too few to tell.
        assert!(!at(0.4).presses(10));
    }
}
