//! A scan that is denser where the signal bends, chosen by the readings themselves while they are made.
//!
//! In: how many pairs of directions, an instrument, and a way to read. Out: the pairs in the order in which they are read. A first look takes the plane
//! of incidence every 5°, the mirror direction of every incidence among them. Then come rounds: where a reading lies off the line between its neighbours
//! by more than its noise explains, the gaps beside it are halved, those first that interpolation is worst in, in σ of a reading; what is left over
//! halves the widest gaps. The one decision to know: all readings count, those of the first look too, and the scan is read in the order of the
//! choices, so that its clock, its drift and its hours are those of the whole run. That readings decide where the next is made does not bias a fit: the
//! likelihood of a sequential design is that of the same design fixed beforehand. No choice sees a reading that comes later: a prefix of the scan is
//! read to the same bits as the whole ([`Job::look`]).

mod bend;
mod chosen;

use self::bend::{Bends, Gap};
use self::chosen::Chosen;
pub(super) use self::chosen::FIRST_PAIRS;
use super::forward::Job;
use super::instrument::Instrument;
use super::reading::Kind;
use super::reduce::reduce;
use super::scan::Scan;
use crate::control::{Control, Quiet};
use crate::measurement::{Dimension, Measurement};

/// Most pairs of an adaptive scan.
pub(super) const MOST_PAIRS: u32 = 100_000;
/// Rounds after the first look: more choose better and move more. A gap of 5° is halved five times down to the least step.
const ROUNDS: u32 = 10;
/// Degrees between directions at least, for any instrument.
const LEAST_STEP_DEG: f64 = 0.1;

/// Readings so far, reduced.
#[derive(Debug)]
pub struct Look {
    /// BRDF, σ and what readings share, of all pairs so far.
    pub table: Measurement,
    /// When each pair was read, s; empty where nothing drifts.
    pub time_s: Vec<f64>,
}

/// What an adaptive scan is made for.
#[derive(Debug, Clone, Copy)]
pub struct Adaptive<'a> {
    /// Pairs of directions, those of the first look included.
    pub pairs: u32,
    /// Flat world or space.
    pub dimension: Dimension,
    /// What reads them.
    pub instrument: &'a Instrument,
}

/// Chooses a scan by what `look` reads; it gets the pairs so far, in the order in which they are read. Fewer than were asked for come back
/// where there is nothing left to halve, where a look fails, and where the work was stopped.
pub fn adapt(wish: &Adaptive<'_>, control: Control<'_>, look: impl Fn(&Scan, Control<'_>) -> Option<Look>) -> Scan {
    let mut chosen = Chosen::first_look();
    let pairs = wish.pairs as usize;
    let a_round = wish.pairs.saturating_sub(FIRST_PAIRS).div_ceil(ROUNDS) as usize;
    let silent = Control { progress: &Quiet, stop: control.stop };
    control.progress.start("choosing directions", u64::from(wish.pairs));
    while chosen.len() < pairs && !control.stop.requested() {
        control.progress.advance(a_round as u64);
        let Some(seen) = look(&chosen.scan(wish), silent) else { break };
        let gaps = Bends { look: &seen, instrument: wish.instrument }.gaps(&chosen, least_step_deg(wish.instrument));
        let next = worst(gaps, a_round.min(pairs - chosen.len()));
        if next.is_empty() {
            break;
        }
        chosen.halve(&next);
    }
    control.progress.finish();
    chosen.scan(wish)
}

/// The step that the instrument can resolve, degrees: its cones hide what is finer than a quarter of them, its jitter what is finer than itself.
#[must_use]
pub fn least_step_deg(instrument: &Instrument) -> f64 {
    let cone = instrument.detector.aperture_deg.max(instrument.source.divergence_deg);
    LEAST_STEP_DEG.max(0.25 * cone).max(instrument.axes.jitter_deg)
}

/// So many gaps at most: by what interpolation is off there, then by width; among equals spread over all of them.
fn worst(mut gaps: Vec<Gap>, count: usize) -> Vec<Gap> {
    // Multiples of the golden ratio, less their whole part, fill [0, 1) evenly.
    let spread = |k: usize| (k as f64 * 0.618_033_988_749_894_9).fract();
    let mut order: Vec<usize> = (0..gaps.len()).collect();
    order.sort_by(|a, b| {
        let (x, y) = (&gaps[*a], &gaps[*b]);
        let by_width = || y.width_deg().total_cmp(&x.width_deg()).then(spread(*a).total_cmp(&spread(*b)));
        y.off.total_cmp(&x.off).then_with(by_width)
    });
    order.truncate(count);
    // In the order of incidences and angles, so that axes move least.
    order.sort_unstable();
    let mut taken = order.into_iter().peekable();
    let mut k = 0;
    gaps.retain(|_| {
        k += 1;
        taken.next_if_eq(&(k - 1)).is_some()
    });
    gaps
}

impl Job<'_> {
    /// What is known when the last pair of directions has just been read: reduced without the visit that would close the scan. `None` where nothing
    /// can be reduced, and where the work is stopped.
    #[must_use]
    pub fn look(&self, control: Control<'_>) -> Option<Look> {
        let (mut readings, actual) = self.prepare();
        let samples = readings.iter().rposition(|r| r.kind == Kind::Sample).map_or(0, |last| last + 1);
        readings.truncate(samples);
        let raw = self.read(readings, &actual, control);
        if !raw.notes.is_empty() {
            return None; // stopped
        }
        let table = reduce("look", &raw, self.instrument, None).ok()?.measurement;
        let mut time_s = vec![0.0; table.len()];
        for reading in &raw.readings {
            let Some(entry) = reading.entry else { continue };
            time_s[entry as usize] = reading.time_s;
        }
        Some(Look { table, time_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::parts::{Axes, Detector};

    fn gap(left_deg: f64, right_deg: f64, off: f64) -> Gap {
        Gap { line: 0, left_deg, right_deg, off }
    }

    #[test]
    fn the_worst_gaps_come_first_then_the_widest_in_the_order_of_angles() {
        let list = vec![gap(0.0, 1.0, 0.0), gap(1.0, 4.0, 0.0), gap(4.0, 5.0, 7.0), gap(5.0, 6.0, 9.0)];
        let taken = |count| worst(list.clone(), count).iter().map(|g| g.left_deg).collect::<Vec<_>>();
        assert_eq!(taken(1), [5.0]);
        assert_eq!(taken(3), [1.0, 4.0, 5.0]);
        assert_eq!(taken(9), [0.0, 1.0, 4.0, 5.0]);
    }

    #[test]
    fn no_step_is_finer_than_the_instrument_resolves() {
        let step = |aperture_deg: f64, jitter_deg: f64| {
            let detector = Detector { aperture_deg, ..Detector::default() };
            let axes = Axes { jitter_deg, ..Axes::default() };
            least_step_deg(&Instrument { detector, axes, ..Instrument::default() })
        };
        assert_eq!([step(0.0, 0.0), step(4.0, 0.1), step(0.5, 0.3)], [0.1, 1.0, 0.3]);
    }
}
