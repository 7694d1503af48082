//! Which accuracy a time allows: the cost of means over source and aperture, predicted from some of the readings.

use std::time::{Duration, Instant};

use super::effects;
use super::forward::{Job, block_of};
use crate::control::{Control, Stop};

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
    /// When the first reading was begun.
    begun: Instant,
    end: Instant,
    /// Predicted seconds of a reading of one thread, with the accuracy that was chosen and with the lowest orders.
    chosen_s: f64,
    lowest_s: f64,
    readings: usize,
}

/// Share of the predicted time of all readings that their prediction counts for beside what was made so far, of which the beginning may be dear.
const PREDICTED: f64 = 0.1;

impl Deadline {
    /// The same for readings that begin now.
    pub(super) fn begun_now(self) -> Self {
        Self { begun: Instant::now(), ..self }
    }

    /// Whether those from number `next` on are late unless they take the lowest orders. Trials miss readings that take long, on sharp flanks, with any
    /// order: what was made so far says by how much.
    pub(super) fn presses(&self, next: usize) -> bool {
        let now = Instant::now();
        let (size, threads) = (block_of(self.readings), rayon::current_num_threads().max(1));
        let (block, blocks) = (next / size, self.readings.div_ceil(size));
        let made = block / threads * size + next % size;
        let left = ((block + 1) * size).min(self.readings).saturating_sub(next)
            + (blocks - 1).saturating_sub(block) / threads * size;
        let foreseen = self.chosen_s * PREDICTED * in_a_row(self.readings);
        let elapsed = now.duration_since(self.begun).as_secs_f64();
        let slower = (elapsed + foreseen) / (self.chosen_s * made as f64 + foreseen);
        let left_s = self.lowest_s * slower.max(1.0) * left as f64;
        self.end.saturating_duration_since(now).as_secs_f64() <= left_s
    }
}

impl Job<'_> {
    /// The best accuracy with which all readings fit into `time`, less what the trials took. Once `stop` is requested what it says means nothing.
    #[must_use]
    pub fn affordable(&self, time: Duration, stop: &Stop) -> Affordable {
        let quiet = Control { stop, ..Control::silent() };
        let clock = Instant::now();
        let budget = time.as_secs_f64();
        let (readings, actual) = self.prepare();
        let every = readings.len().div_ceil(TRIED).max(1);
        let some: Vec<_> = readings.iter().step_by(every).copied().collect();
        let first: Vec<_> = some.iter().step_by(some.len().div_ceil(BEFORE).max(1)).copied().collect();
        // Tables that passes share are kept as long as any pass is; what comes of these readings is not wanted.
        let kept = effects::passes(&self.maker(&actual), self.left_out);
        let _ = Job { accuracy: COARSEST, ..*self }.read(first, &actual, quiet);
        let predict = |accuracy: f64| {
            let trial = Job { accuracy, ..*self };
            let start = Instant::now();
            let read = on_one_thread(|| trial.read(some.clone(), &actual, quiet));
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
        best
    }
}

/// What `work` comes to on a thread alone, whose time is that of all it does; on all where the system has none to give.
fn on_one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(alone) => alone.install(work),
        Err(_) => work(),
    }
}

/// Readings that one thread makes in a row: blocks are shared out whole.
fn in_a_row(readings: usize) -> f64 {
    let (block, threads) = (block_of(readings), rayon::current_num_threads().max(1));
    readings.min(readings.div_ceil(block).div_ceil(threads) * block) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many blocks of a thread, of which ten are made.
    #[test]
    fn readings_that_take_longer_than_was_thought_press_sooner() {
        let threads = rayon::current_num_threads().max(1);
        let readings = 32 * threads * 4096;
        let now = Instant::now();
        let presses = |elapsed_s: f64, left_s: f64| {
            let begun = now.checked_sub(Duration::from_secs_f64(elapsed_s)).expect("a clock that is older");
            let end = now + Duration::from_secs_f64(left_s);
            Deadline { begun, end, chosen_s: 1e-5, lowest_s: 1e-6, readings }.presses(10 * threads * 4096)
        };
        // As predicted, 40,960 readings in 0.41 s: the lowest orders need 0.09 s for the 22 blocks that are left.
        assert!(!presses(0.41, 0.2) && presses(0.41, 0.05));
        // Five times as long: the prediction of 1.3 s counts for a tenth, so that they need four times as long, 0.36 s.
        assert!(presses(2.05, 0.3) && !presses(2.05, 0.5));
        // Sooner than predicted is no reason to count on it.
        assert!(presses(0.01, 0.08));
    }

    /// Blocks hold all readings once, and no stop is cut but one that is longer than a block may be.
    #[test]
    fn blocks_are_whole_stops() {
        use crate::gonio::forward::blocks_of;
        use crate::gonio::reading::{Kind, Reading};
        let reading =
            |stop: u32| Reading { kind: Kind::Sample, entry: None, stop, time_s: 0.0, exposure_s: 1.0, repeat: 0 };
        for (stops, each) in [(1u32, 1), (50, 7), (3000, 3), (2, 9000)] {
            let all: Vec<Reading> = (0..stops).flat_map(|stop| (0..each).map(move |_| reading(stop))).collect();
            let blocks = blocks_of(&all);
            assert!(blocks.windows(2).all(|b| b[0].end == b[1].start) && blocks[0].start == 0);
            assert_eq!(blocks.last().map(|b| b.end), Some(all.len()));
            let cut = |end: usize| end < all.len() && all[end].stop == all[end - 1].stop;
            assert!(each > 4096 || blocks.iter().all(|b| !cut(b.end)), "{stops} {each}");
            assert!(blocks.iter().all(|b| b.len() < 4096 + each));
        }
    }
}
