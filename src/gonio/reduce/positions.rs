//! Errors of positions: what a reading changes by when axes, tilt or height are off by their uncertainties, by a model of the material.
//!
//! Each error is moved by ± its σ. Half the difference is the component u, the same error in all readings (of jitter: each reading's own); the
//! average of both less the value in the middle, q, is what the error's square does: its mean square is 3 q², which counts as the reading's own.

use glam::DVec3;
use rayon::prelude::*;

use super::Table;
use super::shared::{HEIGHT, JITTER, Shared, TILT, ZEROS};
use crate::geometry::angles::turned;
use crate::gonio::effects::cone::Cones;
use crate::gonio::effects::footprint::Footprint;
use crate::gonio::effects::height::seen;
use crate::gonio::effects::light::{Standard, reference_pair};
use crate::gonio::effects::tilt::frame;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::simulate::Truth;

/// Relative error of means over cones that slopes may have.
const ACCURACY: f64 = 1e-3;

/// By how much everything is off.
#[derive(Debug, Clone, Copy, Default)]
struct Pose {
    zeros: [f64; 4],
    tilt: [f64; 2],
    height: f64,
}

/// One error: its line in the budget, and the pose that is off by its σ, times a sign.
type Off = (usize, fn(f64) -> Pose, f64);

/// Every error of positions that the instrument has.
fn errors(instrument: &Instrument) -> Vec<Off> {
    let (zero, jitter) = (instrument.axes.zero_u_deg.to_radians(), instrument.axes.jitter_deg.to_radians());
    let tilt = instrument.sample.tilt_u_deg.to_radians();
    let axes: [fn(f64) -> Pose; 4] = [
        |x| Pose { zeros: [x, 0.0, 0.0, 0.0], ..Pose::default() },
        |x| Pose { zeros: [0.0, x, 0.0, 0.0], ..Pose::default() },
        |x| Pose { zeros: [0.0, 0.0, x, 0.0], ..Pose::default() },
        |x| Pose { zeros: [0.0, 0.0, 0.0, x], ..Pose::default() },
    ];
    let tilts: [fn(f64) -> Pose; 2] =
        [|x| Pose { tilt: [x, 0.0], ..Pose::default() }, |x| Pose { tilt: [0.0, x], ..Pose::default() }];
    let height: fn(f64) -> Pose = |height| Pose { height, ..Pose::default() };
    let mut list: Vec<Off> = axes.iter().map(|of| (ZEROS, *of, zero)).collect();
    list.extend(tilts.iter().map(|of| (TILT, *of, tilt)));
    list.push((HEIGHT, height, instrument.sample.height_u_m));
    list.extend(axes.iter().map(|of| (JITTER, *of, jitter)));
    list.retain(|(_, _, sigma)| *sigma > 0.0);
    list
}

/// Whether the instrument has any.
pub(in crate::gonio) fn matter(instrument: &Instrument) -> bool {
    !errors(instrument).is_empty()
}

/// The optics with all that directions meet.
struct Optics<'a> {
    instrument: &'a Instrument,
    cones: Cones,
    footprint: Option<Footprint>,
}

impl<'a> Optics<'a> {
    fn new(instrument: &'a Instrument) -> Self {
        let half = |deg: f64| 0.5 * deg.to_radians();
        let cones =
            Cones::new(half(instrument.source.divergence_deg), half(instrument.detector.aperture_deg), ACCURACY);
        Self { instrument, cones, footprint: Footprint::of(instrument) }
    }

    /// Mean of f·cosθo times the share of the beam, all channels, with everything off by `pose`.
    fn flux(&self, (wi, wo): (DVec3, DVec3), pose: &Pose, f: &Truth<'_>, width: usize) -> Vec<f64> {
        let [theta_i, phi_i, theta_o, phi_o] = pose.zeros;
        let turn = frame(pose.tilt);
        let (wi, near_i) = seen(turn * turned(wi, theta_i, phi_i), pose.height, self.instrument.source.distance_m);
        let (wo, near_o) = seen(turn * turned(wo, theta_o, phi_o), pose.height, self.instrument.detector.distance_m);
        let share = near_i * near_o * self.footprint.map_or(1.0, |f| f.share(wi, wo));
        let (mut own, mut out) = (vec![0.0; width], vec![0.0; width]);
        let mut add = |wi: DVec3, wo: DVec3, weight: f64, out: &mut [f64]| {
            if wi.z > 0.0 && wo.z > 0.0 && f(wi, wo, &mut own) {
                out.iter_mut().zip(&own).for_each(|(to, f)| *to += weight * wo.z * f);
            }
        };
        self.cones.mean(wi, wo, &mut add, &mut out);
        out.iter_mut().for_each(|out| *out *= share);
        out
    }

    /// u and q of every error: half the difference and the rest of the average, channel by channel.
    fn moved(
        &self,
        pair: (DVec3, DVec3),
        errors: &[Off],
        f: &Truth<'_>,
        width: usize,
    ) -> (Vec<f64>, Vec<Vec<(f64, f64)>>) {
        let middle = self.flux(pair, &Pose::default(), f, width);
        let of = |(_, pose, sigma): &Off| {
            let [up, down] = [1.0, -1.0].map(|sign| self.flux(pair, &pose(sign * sigma), f, width));
            let parts = up.iter().zip(&down).zip(&middle);
            parts.map(|((a, b), m)| (0.5 * (a - b), 0.5 * (a + b) - m)).collect()
        };
        let list = errors.iter().map(of).collect();
        (middle, list)
    }

    /// u and q of every error at the reference, relative.
    fn of_reference(&self, errors: &[Off]) -> Vec<(f64, f64)> {
        if !self.instrument.has_reference() {
            return vec![(0.0, 0.0); errors.len()];
        }
        let standard = Standard::new(&self.instrument.reference, 0.0);
        let f = |wi: DVec3, wo: DVec3, out: &mut [f64]| {
            out.fill(standard.value(wi, wo));
            true
        };
        let (middle, list) = self.moved(reference_pair(&self.instrument.reference), errors, &f, 1);
        list.iter().map(|of| (of[0].0 / middle[0], of[0].1 / middle[0])).collect()
    }
}

/// Relative σ of the reference's reading by where the axes stop.
pub(super) fn of_reference(instrument: &Instrument) -> f64 {
    let jitter: Vec<Off> = errors(instrument).into_iter().filter(|(family, _, _)| *family == JITTER).collect();
    let list = Optics::new(instrument).of_reference(&jitter);
    list.iter().map(|(u, q)| u * u + 3.0 * q * q).sum::<f64>().sqrt()
}

/// How often the axes stopped at each pair of directions.
fn approaches(raw: &Raw) -> Vec<f64> {
    let mut count = vec![0.0; raw.directions.len()];
    let stops = raw.readings.chunk_by(|a, b| a.stop == b.stop);
    stops.filter_map(|stop| stop[0].entry).for_each(|entry| count[entry as usize] += 1.0);
    count
}

/// Adds what errors of positions do to every reading.
pub(super) fn add(raw: &Raw, instrument: &Instrument, model: &Truth<'_>, table: &Table, shared: &mut Shared<'_>) {
    let errors = errors(instrument);
    if errors.is_empty() {
        return;
    }
    let (n, width) = (raw.directions.len(), raw.channels.len());
    let optics = Optics::new(instrument);
    let reference = optics.of_reference(&errors);
    let is_valid = |entry: &usize| (0..width).any(|c| table.values[c * n + entry].is_finite());
    let valid: Vec<usize> = (0..n).filter(is_valid).collect();
    let moved: Vec<_> =
        valid.par_iter().map(|&e| optics.moved(raw.directions.pair(e), &errors, model, width).1).collect();
    let approaches = approaches(raw);
    for (&entry, list) in valid.iter().zip(&moved) {
        let (wi, wo) = raw.directions.pair(entry);
        let scale = 1.0 / (wo.z * optics.footprint.map_or(1.0, |f| f.share(wi, wo)));
        for (k, ((family, _, _), of)) in errors.iter().zip(list).enumerate() {
            for (c, (u, q)) in of.iter().enumerate() {
                let place = c * n + entry;
                let value = table.values[place];
                if !value.is_finite() {
                    continue;
                }
                let (shift, bend) = if *family == JITTER {
                    (scale * u, scale * q)
                } else {
                    (scale * u - value * reference[k].0, scale * q - value * reference[k].1)
                };
                if *family == JITTER {
                    // A mean over stops: what moves is divided by them, the mean of what bends is not.
                    let moves = (shift * shift + 2.0 * bend * bend) / approaches[entry];
                    shared.add_own(*family, place, moves + bend * bend);
                } else {
                    shared.add(*family, (k, 0), place, shift);
                    shared.add_own(*family, place, 3.0 * bend * bend);
                }
            }
        }
    }
}
