//! The footprint: the share of the beam that falls on the sample and is seen by the detector.
//!
//! In the sample's plane the beam is an ellipse of semi-axes b/cosθi (towards wi) and b, the sample a disc, the field
//! of view an ellipse like the beam's with θo. The share is cosθi/(πb²) times the area that all three have in common: 1
//! while the beam is inside the others, ∝ cosθi where it overfills the sample, ∝ cosθi/cosθo where it overfills the
//! field. All are centred, so the common part is closed ([`crate::gonio::spot::outline`]).
//!
//! Diameters in m: `source.beam_diameter_m` (2b), `sample.diameter_m`, `detector.field_diameter_m`. Realistic: beams of
//! 1 to 40 mm (17 mm: the sampling aperture of NIST's STARR), samples of 20 to 300 mm (STARR: 50 to 300 mm), fields of
//! 5 to 100 mm (typical). A beam of 17 mm leaves a sample of 50 mm from θi = 70° on.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Block, Entry, Maker, Pass};
use crate::gonio::instrument::Instrument;
use crate::gonio::spot::outline::{Outline, Piece, common};
use crate::measurement::Dimension;

pub(super) const EFFECT: Entry = Entry {
    name: "footprint",
    calls: |i, _| match cut_by(i) {
        "" => {
            Err("nothing cuts the beam (source.beam_diameter_m, sample.diameter_m, detector.field_diameter_m)".into())
        }
        what => Ok(format!("a beam of {} m on {what}", i.source.beam_diameter_m)),
    },
    remove: |i| (i.sample.diameter_m, i.detector.field_diameter_m) = (0.0, 0.0),
    make: |maker: &Maker<'_>| Footprint::of(maker.instrument, maker.dimension).map(|f| Box::new(f) as Box<dyn Pass>),
};

fn cut_by(instrument: &Instrument) -> &'static str {
    let finite = [instrument.sample.diameter_m, instrument.detector.field_diameter_m].map(|d| d > 0.0);
    match finite {
        _ if instrument.source.beam_diameter_m == 0.0 => "",
        [false, false] => "",
        [true, false] => "a sample of finite size",
        [false, true] => "a field of view of finite size",
        [true, true] => "a sample and a field of view of finite size",
    }
}

/// Beam, sample and field of view; radii in m, infinite where there is no edge.
#[derive(Debug, Clone, Copy)]
pub(in crate::gonio) struct Footprint {
    beam: f64,
    sample: f64,
    field: f64,
    dimension: Dimension,
}

impl Footprint {
    /// The instrument's; `None` where nothing cuts its beam.
    pub fn of(instrument: &Instrument, dimension: Dimension) -> Option<Self> {
        (!cut_by(instrument).is_empty()).then(|| Self::of_beam(instrument, dimension))
    }

    /// The same, cut or not; the beam has a size.
    pub fn of_beam(instrument: &Instrument, dimension: Dimension) -> Self {
        let radius = |diameter: f64| if diameter > 0.0 { 0.5 * diameter } else { f64::INFINITY };
        Self {
            beam: 0.5 * instrument.source.beam_diameter_m,
            sample: radius(instrument.sample.diameter_m),
            field: radius(instrument.detector.field_diameter_m),
            dimension,
        }
    }

    /// The edge of what counts, over half a turn; in the flat world [`Self::length`] is what it is there.
    pub fn edge(&self, wi: DVec3, wo: DVec3) -> Vec<Piece> {
        common(&self.outlines(wi, wo))
    }

    /// In the flat world half of the length that counts.
    pub fn length(&self, wi: DVec3, wo: DVec3) -> f64 {
        (self.beam / wi.z).min(self.sample).min(self.field / wo.z)
    }

    fn outlines(&self, wi: DVec3, wo: DVec3) -> [Outline; 3] {
        [Outline::across(wi, self.beam), Outline::disc(self.sample), Outline::across(wo, self.field)]
    }

    /// The share of the beam that counts; 0 below the horizon.
    pub fn share(&self, wi: DVec3, wo: DVec3) -> f64 {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        if self.dimension == Dimension::Flat {
            // Three centred lengths of a line.
            return (wi.z * self.length(wi, wo) / self.beam).min(1.0);
        }
        let outlines = self.outlines(wi, wo);
        if outlines[1..].iter().all(|edge| outlines[0].lies_within(edge)) {
            return 1.0; // exactly, as without edges
        }
        let area = 2.0 * common(&outlines).iter().map(Piece::area).sum::<f64>();
        (wi.z * area / (PI * self.beam * self.beam)).min(1.0)
    }
}

impl Pass for Footprint {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            let share = self.share(block.wi[i], block.wo[i]);
            block.scale(i, share);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    fn share(sizes: [f64; 3], wi: (f64, f64), wo: (f64, f64)) -> f64 {
        let [beam, sample, field] = sizes;
        Footprint { beam, sample, field, dimension: Dimension::Space }
            .share(direction_deg(wi.0, wi.1), direction_deg(wo.0, wo.1))
    }

    #[test]
    fn the_closed_cases_are_met() {
        let none = f64::INFINITY;
        for (theta, phi) in [(0.0, 0.0), (30.0, 20.0), (60.0, 180.0), (85.0, -77.0)] {
            let cos = f64::to_radians(theta).cos();
            let near = |got: f64, want: f64| assert!((got - want).abs() < 1e-12, "{theta} {phi}: {got} {want}");
            near(share([1.0, none, none], (theta, phi), (10.0, 0.0)), 1.0);
            near(share([1.0, 1.0 / cos, none], (theta, phi), (10.0, 0.0)), 1.0);
            // Overfilled sample and overfilled field.
            near(share([1.0, 0.3, none], (theta, phi), (50.0, 10.0)), 0.09 * cos);
            near(share([1.0, none, 0.01], (theta, phi), (45.0, 123.0)), 1e-4 * cos / 0.5f64.sqrt());
            // Along one line the field of the beam's own size sees all of it, or cuts it where it is the flatter one.
            near(share([1.0, none, 1.0], (theta, phi), (theta, phi + 180.0)), 1.0);
            // The unit disc lies in the ellipse of area π/cosθi.
            near(share([1.0, none, 1.0], (theta, phi), (0.0, 0.0)), cos);
        }
    }

    #[test]
    fn what_three_outlines_share_is_what_a_fine_sum_finds() {
        let close = [1.0, 1.3, 0.9];
        for (wi, wo) in [
            ((60.0, 10.0), (50.0, 100.0)),
            ((80.0, 200.0), (20.0, 30.0)),
            ((45.0, 0.0), (45.0, 90.0)),
            ((0.0, 0.0), (70.0, 5.0)),
        ] {
            let [a, b] = [wi, wo].map(|(t, p): (f64, f64)| direction_deg(t, p));
            let outlines = [Outline::across(a, 1.0), Outline::disc(1.3), Outline::across(b, 0.9)];
            let steps = 200_000;
            let least = |k: usize| {
                let phi = PI * (k as f64 + 0.5) / steps as f64;
                0.5 / outlines.iter().map(|o| o.inverse_square(phi)).fold(0.0, f64::max)
            };
            let area = 2.0 * (0..steps).map(least).sum::<f64>() * PI / steps as f64;
            let got = share(close, wi, wo);
            assert!((got - (a.z * area / PI).min(1.0)).abs() < 1e-9, "{wi:?} {wo:?}: {got}");
        }
    }

    #[test]
    fn in_the_flat_world_the_shortest_length_counts() {
        let at = |sizes: [f64; 3], theta_i: f64, theta_o: f64| {
            let [beam, sample, field] = sizes;
            let footprint = Footprint { beam, sample, field, dimension: Dimension::Flat };
            footprint.share(direction_deg(theta_i, 0.0), direction_deg(theta_o, 180.0))
        };
        assert!((at([1.0, f64::INFINITY, 0.5], 60.0, 60.0) - 0.5).abs() < 1e-14);
        assert!((at([1.0, 0.5, f64::INFINITY], 60.0, 0.0) - 0.25).abs() < 1e-14);
        assert_eq!(at([1.0, 2.1, f64::INFINITY], 60.0, 0.0), 1.0);
    }

    #[test]
    fn a_beam_that_shrinks_is_cut_less_and_at_last_not_at_all() {
        let shares: Vec<f64> = [2.0, 1.0, 0.5, 0.2].map(|b| share([b, 0.5, 0.7], (60.0, 0.0), (60.0, 90.0))).to_vec();
        assert!(shares.is_sorted() && shares[3] == 1.0, "{shares:?}");
        assert_eq!(share([1.0, 1.0, 1.0], (90.0, 0.0), (0.0, 0.0)), 0.0);
    }
}
