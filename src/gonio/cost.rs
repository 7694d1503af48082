//! What a scan costs: the time it takes the instrument, from its description.
//!
//! A stop at a pair of directions takes the move to it ([`super::travel`]) and, for each of its readings, the sum of the exposures; visits to
//! reference, blank and dark stand before every block and at the end ([`super::series`]).

use super::instrument::Instrument;
use super::travel::{Moves, Place};
use crate::measurement::Directions;

/// Hours that reading these of the pairs of directions takes, in this order; equal ones in a row are one stop.
#[must_use]
pub fn hours(instrument: &Instrument, directions: &Directions, rows: &[u32]) -> f64 {
    seconds(instrument, directions, rows) / 3600.0
}

/// The same in seconds.
#[must_use]
pub fn seconds(instrument: &Instrument, directions: &Directions, rows: &[u32]) -> f64 {
    seconds_of(instrument, &Moves::new(instrument, directions), rows)
}

/// The same, the moves being at hand.
pub(super) fn seconds_of(instrument: &Instrument, moves: &Moves<'_>, rows: &[u32]) -> f64 {
    let blocks = rows.chunks(instrument.protocol.block as usize);
    let visits = blocks.len() as f64 + 1.0;
    visits * still_s(instrument) + moving_s(instrument, moves, blocks) + rows.len() as f64 * dwell_s(instrument)
}

/// Seconds of all moves: to every stop, and to the reference before every block and at the end.
fn moving_s<'r>(instrument: &Instrument, moves: &Moves<'_>, blocks: impl Iterator<Item = &'r [u32]>) -> f64 {
    let (mut at, mut sum): (Option<Place>, f64) = (None, 0.0);
    let mut go = |to: Place| sum += moves.seconds(at.replace(to), to);
    for block in blocks {
        if instrument.has_reference() {
            go(moves.reference());
        }
        block.chunk_by(|a, b| a == b).for_each(|same| same.iter().take(1).for_each(|row| go(moves.place(*row))));
    }
    if instrument.has_reference() {
        go(moves.reference());
    }
    sum
}

/// Seconds of one reading of a pair of directions: all exposures, all repeats.
pub(super) fn dwell_s(instrument: &Instrument) -> f64 {
    f64::from(instrument.readings) * instrument.detector.exposures_s.iter().sum::<f64>()
}

/// Seconds of a visit to all that readings are compared with, how far the reference is not counted.
pub(super) fn visit_s(instrument: &Instrument) -> f64 {
    let moved = if instrument.has_reference() { instrument.axes.move_s } else { 0.0 };
    moved + still_s(instrument)
}

/// Seconds of the readings of a visit.
fn still_s(instrument: &Instrument) -> f64 {
    let exposures = &instrument.detector.exposures_s;
    let of_base = || instrument.base_exposures_s().iter().sum();
    let once =
        |present: bool, seconds: f64| if present { f64::from(instrument.protocol.repeats) * seconds } else { 0.0 };
    once(instrument.has_reference(), exposures.iter().sum())
        + once(instrument.surroundings.stray_per_sr > 0.0, of_base())
        + once(instrument.has_dark(), of_base())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::parts::{Axes, Detector, Protocol, Reference, Surroundings};
    use crate::gonio::{Scan, series};

    /// The clock of the readings says the same, with every part and without.
    #[test]
    fn hours_are_those_of_the_readings_clock() {
        let full = Instrument {
            readings: 2,
            axes: Axes { move_s: 3.0, ..Axes::default() },
            reference: Reference { reflectance: 0.99, ..Reference::default() },
            detector: Detector { dark_per_s: 3.0, exposures_s: vec![0.1, 1.0], ..Detector::default() },
            surroundings: Surroundings { stray_per_sr: 1e-3, shadow_deg: 0.0 },
            protocol: Protocol { block: 4, repeats: 3 },
            ..Instrument::default()
        };
        let turning = |i: &Instrument| Instrument { axes: Axes { degrees_per_s: 7.0, ..i.axes }, ..i.clone() };
        let directions = Scan::Hemisphere { step_deg: 30.0 }.directions().expect("small").0;
        for instrument in [turning(&full), turning(&Instrument::default()), full, Instrument::default()] {
            for rows in
                [vec![0, 1, 2, 3, 4, 5], vec![0, 0, 0, 1, 1, 1, 1, 1, 2], vec![7], vec![3, 70, 17, 0, 60, 61, 8]]
            {
                let list = series(&instrument, &directions, &rows);
                let end = list.last().map_or(0.0, |r| r.time_s + r.exposure_s);
                let said = seconds(&instrument, &directions, &rows);
                assert!((said - end).abs() < 1e-9 * end, "{rows:?}: {said} vs {end}");
            }
        }
    }
}
