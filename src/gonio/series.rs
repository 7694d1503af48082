//! The order of readings: blocks of pairs of directions, with visits to the reference, the blank and the dark between them.

use super::instrument::Instrument;
use super::reading::{Kind, Reading};
use super::travel::{Moves, Place};
use crate::control::counted;
use crate::measurement::Directions;

/// The readings that measure these of the pairs of directions, in order of time. A pair that follows itself is one stop, read as often.
#[must_use]
pub fn series(instrument: &Instrument, directions: &Directions, entries: &[u32]) -> Vec<Reading> {
    let moves = Moves::new(instrument, directions);
    let mut list = Series { instrument, moves, at: None, clock: 0.0, stop: 0, readings: Vec::new() };
    for block in entries.chunks(instrument.protocol.block as usize) {
        list.visit();
        for same in block.chunk_by(|a, b| a == b) {
            same.iter().take(1).for_each(|&entry| list.go(list.moves.place(entry)));
            let times = instrument.readings.saturating_mul(same.len() as u32);
            for &exposure_s in &instrument.detector.exposures_s {
                list.read(Kind::Sample, same.first().copied(), exposure_s, times);
            }
        }
    }
    list.visit();
    list.readings
}

/// Most raw readings of a simulation: with three channels they take some 5 GB, as much again as text.
pub const MOST_READINGS: f64 = 5e7;

/// How many readings [`series`] lists of so many pairs of directions, counted as often as they are read.
#[must_use]
pub fn readings(instrument: &Instrument, pairs: usize) -> f64 {
    let exposures = instrument.detector.exposures_s.len() as f64;
    let once = |present: bool, count: f64| if present { count } else { 0.0 };
    let of_base = instrument.base_exposures_s().len() as f64;
    let of_visit = once(instrument.has_reference(), exposures)
        + once(instrument.surroundings.stray_per_sr > 0.0, of_base)
        + once(instrument.has_dark(), of_base);
    let visits = pairs.div_ceil(instrument.protocol.block.max(1) as usize) as f64 + 1.0;
    pairs as f64 * exposures * f64::from(instrument.readings)
        + visits * of_visit * f64::from(instrument.protocol.repeats)
}

/// Says that so many pairs of directions ask for more than [`MOST_READINGS`], where they do.
#[must_use]
pub fn too_many(instrument: &Instrument, pairs: usize) -> Option<String> {
    let asked = readings(instrument, pairs);
    let (block, repeats) = (instrument.protocol.block, instrument.protocol.repeats);
    let exposures = instrument.detector.exposures_s.len();
    (asked > MOST_READINGS).then(|| {
        format!(
            "instrument.readings = {}, instrument.protocol.block = {block}, instrument.protocol.repeats = {repeats} and {} ask for \
             {asked:.3e} raw readings at {}: expected at most {MOST_READINGS:e}",
            instrument.readings,
            counted(exposures as u64, "exposure"),
            counted(pairs as u64, "pair") + " of directions"
        )
    })
}

struct Series<'a> {
    instrument: &'a Instrument,
    moves: Moves<'a>,
    /// Where the axes stand; not known before the first move.
    at: Option<Place>,
    clock: f64,
    stop: u32,
    readings: Vec<Reading>,
}

impl Series<'_> {
    /// Moves the axes.
    fn go(&mut self, to: Place) {
        self.clock += self.moves.seconds(self.at.replace(to), to);
        self.stop += 1;
    }

    fn read(&mut self, kind: Kind, entry: Option<u32>, exposure_s: f64, repeats: u32) {
        for repeat in 0..repeats {
            self.readings.push(Reading { kind, entry, time_s: self.clock, exposure_s, repeat, stop: self.stop });
            self.clock += exposure_s;
        }
    }

    /// Reads what readings of the sample are compared with, as far as the instrument needs it.
    fn visit(&mut self) {
        let instrument = self.instrument;
        if instrument.has_reference() {
            self.go(self.moves.reference());
            self.all(Kind::Reference, &instrument.detector.exposures_s);
        }
        if instrument.surroundings.stray_per_sr > 0.0 {
            self.stop += 1;
            self.all(Kind::Blank, instrument.base_exposures_s());
        }
        if instrument.has_dark() {
            self.stop += 1;
            self.all(Kind::Dark, instrument.base_exposures_s());
        }
    }

    /// Reads one thing in these exposures, as often as a visit does.
    fn all(&mut self, kind: Kind, exposures: &[f64]) {
        exposures.iter().for_each(|&exposure| self.read(kind, None, exposure, self.instrument.protocol.repeats));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::Scan;
    use crate::gonio::parts::{Detector, Protocol, Reference};

    #[test]
    fn pairs_come_in_order_between_visits_and_time_never_runs_back() {
        let instrument = Instrument {
            reference: Reference { reflectance: 0.99, ..Reference::default() },
            detector: Detector { dark_per_s: 3.0, exposures_s: vec![0.1, 1.0], ..Detector::default() },
            protocol: Protocol { block: 4, repeats: 3 },
            readings: 2,
            ..Instrument::default()
        };
        let pairs: Vec<u32> = (0..10).collect();
        let directions = Scan::InPlane { step_deg: 45.0 }.directions().expect("small").0;
        let list = series(&instrument, &directions, &pairs);
        let count = |kind| list.iter().filter(|r| r.kind == kind).count();
        // Three blocks and the end: four visits, the reference in both exposures, the dark in the longer one.
        assert_eq!(Kind::ALL.map(count), [40, 0, 24, 12]);
        assert!(list.windows(2).all(|r| r[0].time_s < r[1].time_s));
        let entries: Vec<u32> = list.iter().filter_map(|r| r.entry).collect();
        assert!(entries.is_sorted() && entries.last() == Some(&9));
        assert_eq!(readings(&instrument, pairs.len()), list.len() as f64);
        let all = series(&Instrument::noiseless(), &directions, &pairs);
        assert!(all.iter().all(|r| r.kind == Kind::Sample));
        assert_eq!(readings(&Instrument::noiseless(), pairs.len()), all.len() as f64);
        // Of three in a row one lies in the next block, behind a visit and another move.
        let stops = |rows: &[u32]| {
            let list = series(&instrument, &directions, rows);
            let mut stops: Vec<u32> = list.iter().filter(|r| r.kind == Kind::Sample).map(|r| r.stop).collect();
            stops.dedup();
            (stops.len(), list.iter().filter(|r| r.kind == Kind::Sample).count())
        };
        assert_eq!(stops(&[1, 1, 1]), (1, 12));
        assert_eq!(stops(&[0, 0, 1, 1, 1]), (3, 20));
    }
}
