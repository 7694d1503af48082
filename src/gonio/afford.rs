//! Which accuracy a time allows: the cost of means over source and aperture, predicted from some of the readings.

use std::time::{Duration, Instant};

use super::effects;
use super::forward::Job;
use crate::control::Control;
use crate::numeric::sum::BLOCK;

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

/// When all readings have to be made, and how long one takes with the lowest orders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deadline {
    end: Instant,
    each_s: f64,
    readings: usize,
}

impl Deadline {
    /// Whether those from number `next` on are late unless they take the lowest orders.
    pub(super) fn presses(&self, next: usize) -> bool {
        let left = self.each_s * self.readings.saturating_sub(next) as f64;
        self.end.saturating_duration_since(Instant::now()).as_secs_f64() <= left
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
        let each_s = predicted_s / count.max(1) as f64;
        let deadline = Deadline { end: clock + time.min(LONGEST), each_s, readings: count };
        let mut best = Affordable { accuracy: COARSEST, predicted_s, fits: false, deadline };
        best.fits = best.predicted_s + clock.elapsed().as_secs_f64() <= budget;
        let mut accuracy = COARSEST * STEP;
        while best.fits && accuracy >= FINEST && clock.elapsed().as_secs_f64() < TRIALS * budget {
            let predicted_s = predict(accuracy);
            if predicted_s + clock.elapsed().as_secs_f64() > budget {
                break;
            }
            best = Affordable { accuracy, predicted_s, fits: true, deadline };
            accuracy *= STEP;
        }
        drop(kept);
        best
    }
}

/// Readings that one thread makes in a row: blocks are shared out whole.
fn in_a_row(readings: usize) -> f64 {
    let blocks = readings.div_ceil(BLOCK);
    let threads = rayon::current_num_threads().max(1);
    readings.min(blocks.div_ceil(threads) * BLOCK) as f64
}
