//! How long the axes take from one pair of directions to the next.
//!
//! A move takes `axes.move_s` and, where `axes.degrees_per_s` says how fast axes turn, the largest angle that any of θi, φi, θo, φo travels over that
//! speed: all turn at once. φ turns the short way round, and an arm may swing through the pole, where φ does not matter: (θ, φ) and (−θ, φ ± 180°) are
//! one direction, and the nearer of the two is gone to.

use std::f64::consts::PI;

use glam::DVec3;

use super::effects::light::reference_pair;
use super::instrument::Instrument;
use crate::geometry::angles::{phi_of, theta_of};
use crate::measurement::Directions;

/// Where the axes stand: polar angle and azimuth of wi and of wo, rad.
pub(super) type Place = [(f64, f64); 2];

/// The time of every move of a scan.
pub(super) struct Moves<'a> {
    directions: &'a Directions,
    move_s: f64,
    /// 0 where the angle does not matter.
    s_per_rad: f64,
    /// Where each pair of directions is; empty where the angle does not matter.
    places: Vec<Place>,
    reference: Place,
}

impl<'a> Moves<'a> {
    /// Moves of this instrument between these pairs.
    pub fn new(instrument: &Instrument, directions: &'a Directions) -> Self {
        let axes = instrument.axes;
        let turns = axes.degrees_per_s > 0.0;
        let count = if turns && matches!(directions, Directions::List { .. }) { directions.len() } else { 0 };
        Self {
            directions,
            move_s: axes.move_s,
            s_per_rad: if turns { 1.0_f64.to_degrees() / axes.degrees_per_s } else { 0.0 },
            places: (0..count).map(|i| place(directions.pair(i))).collect(),
            reference: place(reference_pair(&instrument.reference)),
        }
    }

    /// Where a pair of directions is read.
    pub fn place(&self, entry: u32) -> Place {
        if self.s_per_rad == 0.0 {
            return Place::default();
        }
        // A large grid's places are not kept.
        self.places.get(entry as usize).copied().unwrap_or_else(|| place(self.directions.pair(entry as usize)))
    }

    /// Where the reference is read.
    pub fn reference(&self) -> Place {
        self.reference
    }

    /// Seconds from `from` to `to`; the first move of all, from wherever axes were, takes `move_s` alone.
    pub fn seconds(&self, from: Option<Place>, to: Place) -> f64 {
        match from {
            Some(from) if self.s_per_rad > 0.0 => self.move_s + self.s_per_rad * travel(from, to),
            _ => self.move_s,
        }
    }
}

/// Seconds of the move between two pairs of directions.
pub(super) fn move_s(instrument: &Instrument, from: (DVec3, DVec3), to: (DVec3, DVec3)) -> f64 {
    let speed = instrument.axes.degrees_per_s;
    let turning = if speed > 0.0 { travel(place(from), place(to)).to_degrees() / speed } else { 0.0 };
    instrument.axes.move_s + turning
}

fn place((wi, wo): (DVec3, DVec3)) -> Place {
    [wi, wo].map(|w| (theta_of(w), phi_of(w)))
}

/// The largest angle that an axis travels, rad.
fn travel(from: Place, to: Place) -> f64 {
    from.iter().zip(&to).map(|(a, b)| arm(*a, *b)).fold(0.0, f64::max)
}

/// The same of θ and φ of one direction.
fn arm(a: (f64, f64), b: (f64, f64)) -> f64 {
    let around = (a.1 - b.1).abs();
    let around = around.min(2.0 * PI - around);
    let tilt = (a.0 - b.0).abs();
    if a.0 == 0.0 || b.0 == 0.0 {
        return tilt;
    }
    tilt.max(around).min((a.0 + b.0).max(PI - around))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;
    use crate::gonio::parts::{Axes, Reference};

    /// Degrees from one pair to the next.
    fn degrees(from: [f64; 4], to: [f64; 4]) -> f64 {
        let pair = |a: [f64; 4]| (direction_deg(a[0], a[1]), direction_deg(a[2], a[3]));
        travel(place(pair(from)), place(pair(to))).to_degrees()
    }

    #[test]
    fn the_axis_that_turns_farthest_counts_the_short_way_round_and_through_the_pole() {
        for (from, to, want) in [
            ([10.0, 0.0, 20.0, 0.0], [15.0, 0.0, 60.0, 0.0], 40.0),
            ([10.0, 0.0, 60.0, 0.0], [50.0, 0.0, 60.0, 10.0], 40.0),
            ([10.0, 0.0, 80.0, 170.0], [10.0, 0.0, 80.0, -170.0], 20.0),
            // At the pole φ does not matter, neither of wi nor of wo.
            ([0.0, 0.0, 30.0, 0.0], [5.0, 90.0, 30.0, 0.0], 5.0),
            ([10.0, 0.0, 30.0, 77.0], [10.0, 0.0, 0.0, 0.0], 30.0),
            // From one side of the plane to the other; round the ring where that is nearer.
            ([10.0, 0.0, 1.0, 0.0], [10.0, 0.0, 1.5, 180.0], 2.5),
            ([10.0, 0.0, 80.0, 0.0], [10.0, 0.0, 80.0, 120.0], 120.0),
            ([10.0, 0.0, 5.0, 0.0], [10.0, 0.0, 5.0, 120.0], 60.0),
            ([10.0, 0.0, 80.0, 30.0], [10.0, 0.0, 80.0, 30.0], 0.0),
        ] {
            let got = [degrees(from, to), degrees(to, from)];
            assert!(got.iter().all(|g| (g - want).abs() < 1e-12), "{from:?} {to:?}: {got:?}, not {want}");
        }
    }

    #[test]
    fn a_move_takes_its_own_time_and_the_turning_s() {
        let directions = Directions::List { wi: vec![DVec3::Z; 2], wo: vec![DVec3::Z, direction_deg(30.0, 0.0)] };
        let of = |degrees_per_s: f64| {
            let axes = Axes { move_s: 2.0, degrees_per_s, ..Axes::default() };
            let instrument = Instrument { axes, reference: Reference::default(), ..Instrument::default() };
            let moves = Moves::new(&instrument, &directions);
            let pairs = move_s(&instrument, directions.pair(0), directions.pair(1));
            let between = |from, to| moves.seconds(Some(from), to);
            [
                moves.seconds(None, moves.place(1)),
                between(moves.place(0), moves.place(1)),
                pairs,
                between(moves.place(1), moves.reference()),
            ]
        };
        let close = |got: [f64; 4], want: [f64; 4]| got.iter().zip(want).all(|(g, w)| (g - w).abs() < 1e-12);
        assert!(close(of(0.0), [2.0; 4]), "{:?}", of(0.0));
        assert!(close(of(10.0), [2.0, 5.0, 5.0, 3.5]), "{:?}", of(10.0));
    }
}
