//! Errors of positions: what a reading changes by when axes, tilt or height are off by their uncertainties, by a model of what is read.
//!
//! Each error is moved by ± its σ. Half the difference is the component u, the same error in all readings (of jitter: each reading's own); the
//! average of both less the value in the middle, q, is what the error's square does: its mean square is 3 q². Where squares matter the errors' effect
//! is no normal distribution: there [`super::spread`] draws them all, and the variance is that of the normal distribution whose 95 % interval is as
//! wide. What squares of kept errors do there is a component too, for it has a pattern, a lobe that is broader or narrower; elsewhere it counts as
//! the reading's own.
//!
//! The model is what is read, the mean over source and aperture in it: a fit to readings has seen that mean already.

use glam::DVec3;
use rayon::prelude::*;

use super::Table;
use super::shared::{HEIGHT, JITTER, Shared, TILT, ZEROS};
use super::spread;
use crate::geometry::angles::turned;
use crate::gonio::effects::footprint::Footprint;
use crate::gonio::effects::height::seen;
use crate::gonio::effects::light::{Standard, reference_pair};
use crate::gonio::effects::tilt::frame;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::simulate::Truth;
use crate::measurement::Dimension;

/// Share of the variance from which on squares of errors call for draws: a normal interval then holds 94.6 % of an exponential flank.
const BENT: f64 = 0.02;

/// By how much everything is off.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pose {
    zeros: [f64; 4],
    tilt: [f64; 2],
    height: f64,
}

impl Pose {
    /// Both together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            zeros: std::array::from_fn(|i| self.zeros[i] + other.zeros[i]),
            tilt: std::array::from_fn(|i| self.tilt[i] + other.tilt[i]),
            height: self.height + other.height,
        }
    }
}

/// One error: its line in the budget, the pose that is off by it, and its σ.
pub(super) type Off = (usize, fn(f64) -> Pose, f64);

/// Every error of positions that the instrument has.
fn errors(instrument: &Instrument, dimension: Dimension) -> Vec<Off> {
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
    // The flat world has no azimuth, and leans one way only.
    let step = if dimension == Dimension::Flat { 2 } else { 1 };
    let (axes, tilts) = (|| axes.iter().step_by(step), tilts.iter().step_by(step));
    let mut list: Vec<Off> = axes().map(|of| (ZEROS, *of, zero)).collect();
    list.extend(tilts.map(|of| (TILT, *of, tilt)));
    list.push((HEIGHT, height, instrument.sample.height_u_m));
    list.extend(axes().map(|of| (JITTER, *of, jitter)));
    list.retain(|(_, _, sigma)| *sigma > 0.0);
    list
}

/// Whether the instrument has any.
pub(in crate::gonio) fn matter(instrument: &Instrument) -> bool {
    !errors(instrument, Dimension::Space).is_empty()
}

/// The optics with all that directions meet.
pub(super) struct Optics<'a> {
    instrument: &'a Instrument,
    dimension: Dimension,
    footprint: Option<Footprint>,
}

impl<'a> Optics<'a> {
    fn new(instrument: &'a Instrument, dimension: Dimension) -> Self {
        Self { instrument, dimension, footprint: Footprint::of(instrument, dimension) }
    }

    /// f·cosθo times the share of the beam, all channels, with everything off by `pose`.
    pub fn flux(&self, (wi, wo): (DVec3, DVec3), pose: &Pose, f: &Truth<'_>, width: usize) -> Vec<f64> {
        let [theta_i, phi_i, theta_o, phi_o] = pose.zeros;
        let turn = frame(pose.tilt);
        let from_spot = |w: DVec3, theta: f64, phi: f64, distance: f64| {
            seen(turn * turned(w, theta, phi), pose.height, distance, self.dimension)
        };
        let (wi, near_i) = from_spot(wi, theta_i, phi_i, self.instrument.source.distance_m);
        let (wo, near_o) = from_spot(wo, theta_o, phi_o, self.instrument.detector.distance_m);
        let mut out = vec![0.0; width];
        if wi.z > 0.0 && wo.z > 0.0 && f(wi, wo, &mut out) {
            let factor = wo.z * near_i * near_o * self.footprint.map_or(1.0, |f| f.share(wi, wo));
            out.iter_mut().for_each(|out| *out *= factor);
        } else {
            out.fill(0.0);
        }
        out
    }

    /// BRDF over flux.
    pub fn scale(&self, (wi, wo): (DVec3, DVec3)) -> f64 {
        1.0 / (wo.z * self.footprint.map_or(1.0, |f| f.share(wi, wo)))
    }

    /// u and q of every error: half the difference and the rest of the average, channel by channel, and the flux in the middle.
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
        let standard = Standard::new(&self.instrument.reference, 0.0, self.dimension);
        let f = |wi: DVec3, wo: DVec3, out: &mut [f64]| {
            out.fill(standard.value(wi, wo));
            true
        };
        let (middle, list) = self.moved(reference_pair(&self.instrument.reference), errors, &f, 1);
        list.iter().map(|of| (of[0].0 / middle[0], of[0].1 / middle[0])).collect()
    }
}

/// Relative σ of the reference's reading by where the axes stop.
pub(super) fn of_reference(instrument: &Instrument, dimension: Dimension) -> f64 {
    let jitter: Vec<Off> =
        errors(instrument, dimension).into_iter().filter(|(family, _, _)| *family == JITTER).collect();
    let list = Optics::new(instrument, dimension).of_reference(&jitter);
    list.iter().map(|(u, q)| u * u + 3.0 * q * q).sum::<f64>().sqrt()
}

/// What every error does to one reading of one channel, 1/sr: u and q; and the variance of all together where squares matter.
struct Effect {
    parts: Vec<(f64, f64)>,
    whole: Option<f64>,
}

impl Effect {
    fn variances(&self) -> (f64, f64) {
        self.parts.iter().fold((0.0, 0.0), |(linear, bent), (u, q)| (linear + u * u, bent + 3.0 * q * q))
    }

    /// Factors of all u² and all 3 q², so that they add up to the whole.
    fn factors(&self) -> (f64, f64) {
        let (linear, bent) = self.variances();
        match self.whole {
            Some(whole) if whole < linear => (whole / linear, 0.0),
            Some(whole) if bent > 0.0 => (1.0, (whole - linear) / bent),
            _ => (1.0, 1.0),
        }
    }
}

/// How often the axes stopped at each pair of directions.
fn approaches(raw: &Raw) -> Vec<f64> {
    let mut count = vec![0.0; raw.directions.len()];
    let stops = raw.readings.chunk_by(|a, b| a.stop == b.stop);
    stops.filter_map(|stop| stop[0].entry).for_each(|entry| count[entry as usize] += 1.0);
    count
}

/// Adds what errors of positions do to every reading. `model` is what is read, about.
pub(super) fn add(raw: &Raw, instrument: &Instrument, model: &Truth<'_>, table: &Table, shared: &mut Shared<'_>) {
    let errors = errors(instrument, raw.dimension);
    if errors.is_empty() {
        return;
    }
    let (n, width) = (raw.directions.len(), raw.channels.len());
    let optics = Optics::new(instrument, raw.dimension);
    let reference = optics.of_reference(&errors);
    let values = |entry: usize| -> Vec<f64> { (0..width).map(|c| table.values[c * n + entry]).collect() };
    let valid: Vec<usize> = (0..n).filter(|e| values(*e).iter().any(|v| v.is_finite())).collect();
    let approaches = approaches(raw);
    let of = |entry: &usize| {
        let (pair, stops) = (raw.directions.pair(*entry), approaches[*entry]);
        effects(&optics, (pair, stops), &errors, &reference, model, &values(*entry))
    };
    let effects: Vec<Vec<Effect>> = valid.par_iter().map(of).collect();
    for (&entry, list) in valid.iter().zip(&effects) {
        for (c, effect) in list.iter().enumerate() {
            if table.values[c * n + entry].is_finite() {
                place(effect, &errors, c * n + entry, shared);
            }
        }
    }
}

/// The effects on one reading, the mean over `stops` at a pair of directions, channel by channel.
fn effects(
    optics: &Optics<'_>,
    (pair, stops): ((DVec3, DVec3), f64),
    errors: &[Off],
    reference: &[(f64, f64)],
    model: &Truth<'_>,
    values: &[f64],
) -> Vec<Effect> {
    let scale = optics.scale(pair);
    let (_, list) = optics.moved(pair, errors, model, values.len());
    // Where the axes stop at the reference is noise of its visit.
    let at_reference = |k: usize| if errors[k].0 == JITTER { (0.0, 0.0) } else { reference[k] };
    let part = |c: usize, value: f64, k: usize| {
        let ((u, q), (of_u, of_q)) = (list[k][c], at_reference(k));
        if errors[k].0 == JITTER {
            // What moves is divided by the stops, and so is the scatter of what bends, but not its mean.
            return (scale * u / stops.sqrt(), scale * q * ((2.0 / stops + 1.0) / 3.0).sqrt());
        }
        (scale * u - value * of_u, scale * q - value * of_q)
    };
    let parts = |(c, value): (usize, &f64)| (0..errors.len()).map(|k| part(c, *value, k)).collect();
    let mut effects: Vec<Effect> =
        values.iter().enumerate().map(|of| Effect { parts: parts(of), whole: None }).collect();
    let is_bent = |e: &Effect| {
        let (linear, bent) = e.variances();
        bent > BENT * linear
    };
    // Draws are of one stop.
    if stops == 1.0 && effects.iter().any(is_bent) {
        let relative: Vec<f64> = (0..errors.len()).map(|k| at_reference(k).0).collect();
        let whole = spread::variances(optics, pair, errors, &relative, model, values);
        effects.iter_mut().zip(whole).filter(|(e, _)| is_bent(e)).for_each(|(e, v)| e.whole = Some(v));
    }
    effects
}

/// Puts an effect where it belongs: shared errors into components, the rest into the reading's own.
fn place(effect: &Effect, errors: &[Off], place: usize, shared: &mut Shared<'_>) {
    let (of_linear, of_bent) = effect.factors();
    for (k, ((family, _, _), (u, q))) in errors.iter().zip(&effect.parts).enumerate() {
        if *family == JITTER {
            shared.add_own(*family, place, of_linear * u * u);
        } else {
            shared.add(*family, (k, 0), place, of_linear.sqrt() * u);
        }
        if *family == JITTER || effect.whole.is_none() {
            shared.add_own(*family, place, of_bent * 3.0 * q * q);
        } else {
            shared.add(*family, (k, 1), place, (3.0 * of_bent).sqrt() * q);
        }
    }
}
