//! The footprint: the share of the beam that falls on the sample and is seen by the detector.
//!
//! In the sample's plane the beam is an ellipse of semi-axes b/cosθi (towards wi) and b, the sample a disc, the field of view an ellipse like the beam's
//! with θo. The share is cosθi/(πb²) times the area that all three have in common: 1 while the beam is inside the others, ∝ cosθi where it
//! overfills the sample, ∝ cosθi/cosθo where it overfills the field. All are centred, so the common part is ½∫ min r² dφ, and 1/r² of each
//! is c₀ + c₁ cos2φ + s₁ sin2φ: two cross where that is one equation in 2φ, and between crossings the integral is an ellipse's sector, closed.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::{Block, Entry, Maker, Pass};
use crate::gonio::instrument::Instrument;
use crate::measurement::Dimension;

pub(super) const EFFECT: Entry = Entry {
    name: "footprint",
    calls: |i, _| match cut_by(i) {
        "" => {
            Err("nothing cuts the beam (source.beam_diameter_m, sample.diameter_m, detector.field_diameter_m)".into())
        }
        what => Ok(format!("a beam of {} m on {what}", i.source.beam_diameter_m)),
    },
    remove: |i| i.source.beam_diameter_m = 0.0,
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
        let radius = |diameter: f64| if diameter > 0.0 { 0.5 * diameter } else { f64::INFINITY };
        (!cut_by(instrument).is_empty()).then(|| Self {
            beam: 0.5 * instrument.source.beam_diameter_m,
            sample: radius(instrument.sample.diameter_m),
            field: radius(instrument.detector.field_diameter_m),
            dimension,
        })
    }

    /// The share of the beam that counts; 0 below the horizon.
    pub fn share(&self, wi: DVec3, wo: DVec3) -> f64 {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        if self.dimension == Dimension::Flat {
            // Three centred lengths of a line.
            let length = (self.beam / wi.z).min(self.sample).min(self.field / wo.z);
            return (wi.z * length / self.beam).min(1.0);
        }
        let outlines = [Outline::across(wi, self.beam), Outline::disc(self.sample), Outline::across(wo, self.field)];
        if outlines[1..].iter().all(|edge| outlines[0].lies_within(edge)) {
            return 1.0; // exactly, as without edges
        }
        let mut ends: Vec<f64> = vec![0.0, PI];
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            ends.extend(outlines[a].crossings(&outlines[b]));
        }
        ends.sort_by(f64::total_cmp);
        // Each outline is its own image about the centre: half a turn holds half of the area.
        let area = 2.0 * ends.windows(2).map(|e| sector(&outlines, e[0], e[1])).sum::<f64>();
        (wi.z * area / (PI * self.beam * self.beam)).min(1.0)
    }
}

/// The area of what all outlines have in common, between two azimuths that no crossing lies between.
fn sector(outlines: &[Outline; 3], from: f64, to: f64) -> f64 {
    let middle = 0.5 * (from + to);
    let nearest = outlines.iter().max_by(|a, b| a.inverse_square(middle).total_cmp(&b.inverse_square(middle)));
    nearest.map_or(0.0, |outline| outline.sector(from, to))
}

/// A centred ellipse, 1/r² = u cos²(φ − φ₀) + v sin²(φ − φ₀).
#[derive(Debug, Clone, Copy)]
struct Outline {
    u: f64,
    v: f64,
    phi: f64,
}

impl Outline {
    fn disc(radius: f64) -> Self {
        let v = radius.powi(-2);
        Self { u: v, v, phi: 0.0 }
    }

    /// What a beam of this radius along `w` covers of the plane.
    fn across(w: DVec3, radius: f64) -> Self {
        let v = radius.powi(-2);
        Self { u: v * w.z * w.z, v, phi: w.y.atan2(w.x) }
    }

    /// c₀, c₁ and s₁ of 1/r².
    fn harmonics(&self) -> [f64; 3] {
        let (mean, half) = (0.5 * (self.u + self.v), 0.5 * (self.u - self.v));
        let (sin, cos) = (2.0 * self.phi).sin_cos();
        [mean, half * cos, half * sin]
    }

    fn inverse_square(&self, phi: f64) -> f64 {
        let (sin, cos) = (phi - self.phi).sin_cos();
        self.u * cos * cos + self.v * sin * sin
    }

    /// Azimuths in (0, π) where both have the same radius.
    fn crossings(&self, other: &Self) -> Vec<f64> {
        let (a, b) = (self.harmonics(), other.harmonics());
        let [mean, cos, sin] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let size = cos.hypot(sin);
        if size == 0.0 || mean.abs() >= size {
            return Vec::new();
        }
        let (towards, away) = (sin.atan2(cos), (-mean / size).acos());
        [towards + away, towards - away].map(|twice| 0.5 * twice.rem_euclid(TAU)).to_vec()
    }

    /// Whether nothing of it is outside of the other.
    fn lies_within(&self, other: &Self) -> bool {
        self.inverse_square(0.0) >= other.inverse_square(0.0) && self.crossings(other).is_empty()
    }

    /// ½∫ r² dφ: 1/(2√(uv)) times what the ellipse's own angle, tan⁻¹(√(v/u) tan(φ − φ₀)), advances by.
    fn sector(&self, from: f64, to: f64) -> f64 {
        let angle = |phi: f64| {
            let t = phi - self.phi;
            let quarters = (t / FRAC_PI_2).round();
            let (sin, cos) = t.sin_cos();
            let own = (self.v.sqrt() * sin).atan2(self.u.sqrt() * cos);
            // The own angle is within a quarter of a turn of t: the branch of the arctangent follows.
            own + TAU * ((quarters * FRAC_PI_2 - own) / TAU).round()
        };
        0.5 * (angle(to) - angle(from)) / (self.u * self.v).sqrt()
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
