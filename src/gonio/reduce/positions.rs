//! Errors of positions: what a reading changes by when axes, tilt or height are off by their uncertainties, by a model of what is read.
//!
//! Each error is moved by ± its σ. Half the difference is the component u, the same error in all readings (of jitter: each reading's own); the
//! average of both less the value in the middle, q, is what the error's square does: its mean square is 3 q². Jitter's mean is known, Σ q, and taken off
//! each reading: 2 q² is left. Squares of kept errors, and products of
//! two, have patterns that readings share, a lobe that is broader or lower: [`super::bend`]. Where they matter the errors' effect is no normal
//! distribution: there [`super::spread`] draws them all, and the variance is that of the normal distribution whose 95 % interval is as wide.
//!
//! The model is what is read, the mean over source and aperture in it: a fit to readings has seen that mean already.

use glam::DVec3;
use rayon::prelude::*;

use super::Table;
use super::bend::{Bend, pairs};
use super::effect::{Effect, draw, effects, is_bent, is_curved, kept, place_all, place_of_stop};
use super::shared::{HEIGHT, JITTER, Shared, TILT, ZEROS};
use super::spread::Heights;
use crate::geometry::angles::turned;
use crate::gonio::effects::footprint::Footprint;
use crate::gonio::effects::height::seen;
use crate::gonio::effects::light::{Standard, reference_pair};
use crate::gonio::effects::tilt::frame;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::simulate::Truth;
use crate::gonio::spot::Spot;
use crate::measurement::Dimension;

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
    spot: Option<Spot>,
}

impl<'a> Optics<'a> {
    fn new(instrument: &'a Instrument, dimension: Dimension) -> Self {
        let (footprint, spot) = (Footprint::of(instrument, dimension), Spot::of(instrument, dimension));
        Self { instrument, dimension, footprint, spot }
    }

    /// Those of a spot seen from its middle: enough to plan with. The precision that a plan states changes by 4 % at most by it (the classroom's
    /// instrument, whose detector is near; by 0.7 % for the commercial one), and is known in a ninth of the time.
    fn of_middle(instrument: &'a Instrument) -> Self {
        Self { spot: None, ..Self::new(instrument, Dimension::Space) }
    }

    /// cosθo, over the spot, times the share of the beam.
    fn light(&self, (wi, wo): (DVec3, DVec3)) -> f64 {
        let cosine = self.spot.as_ref().map_or(wo.z, |spot| spot.cosine((wi, wo)));
        cosine * self.footprint.map_or(1.0, |f| f.share(wi, wo))
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
            let factor = near_i * near_o * self.light((wi, wo));
            out.iter_mut().for_each(|out| *out *= factor);
        } else {
            out.fill(0.0);
        }
        out
    }

    /// BRDF over flux.
    pub fn scale(&self, pair: (DVec3, DVec3)) -> f64 {
        1.0 / self.light(pair)
    }

    /// u and q of every error: half the difference and the rest of the average, channel by channel, and the flux in the middle.
    pub fn moved(
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

    /// What every two of these errors do together beside what each does alone (`alone` are their q), pair by pair, channel by channel.
    pub fn products(
        &self,
        pair: (DVec3, DVec3),
        errors: &[Off],
        alone: &[Vec<f64>],
        f: &Truth<'_>,
        width: usize,
    ) -> Vec<Vec<f64>> {
        let middle = self.flux(pair, &Pose::default(), f, width);
        let together = |(a, b): (usize, usize)| {
            let [up, down] = [1.0, -1.0].map(|sign| {
                let pose = |k: usize| (errors[k].1)(sign * errors[k].2);
                self.flux(pair, &pose(a).plus(&pose(b)), f, width)
            });
            (0..width).map(|c| 0.5 * (up[c] + down[c]) - middle[c] - alone[a][c] - alone[b][c]).collect()
        };
        pairs(errors.len()).map(together).collect()
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

/// What an error does to a reading of this value, 1/sr: u and q of the flux at `scale`, less what it does to the reference, which the reading is divided by.
pub(super) fn net(scale: f64, value: f64, of: (f64, f64), of_reference: (f64, f64)) -> (f64, f64) {
    (scale * of.0 - value * of_reference.0, scale * of.1 - value * of_reference.1)
}

/// The errors of where axes stop, new at each.
fn jitter(instrument: &Instrument, dimension: Dimension) -> Vec<Off> {
    errors(instrument, dimension).into_iter().filter(|(family, _, _)| *family == JITTER).collect()
}

/// Where axes stop, as a source of noise that all readings of a stop share.
pub(in crate::gonio) struct Jitter<'a> {
    optics: Optics<'a>,
    errors: Vec<Off>,
}

impl<'a> Jitter<'a> {
    pub fn of(instrument: &'a Instrument) -> Self {
        Self { optics: Optics::of_middle(instrument), errors: jitter(instrument, Dimension::Space) }
    }

    /// Variance of what is read of `model` at a pair of directions, 1/sr².
    pub fn variance(&self, pair: (DVec3, DVec3), model: &Truth<'_>) -> f64 {
        if self.errors.is_empty() {
            return 0.0;
        }
        let scale = self.optics.scale(pair);
        let (_, list) = self.optics.moved(pair, &self.errors, model, 1);
        list.iter().map(|of| (scale * of[0].0).powi(2) + 3.0 * (scale * of[0].1).powi(2)).sum()
    }
}

/// Relative σ of the reference's reading by where the axes stop.
pub(super) fn of_reference(instrument: &Instrument, dimension: Dimension) -> f64 {
    let list = Optics::new(instrument, dimension).of_reference(&jitter(instrument, dimension));
    list.iter().map(|(u, q)| u * u + 3.0 * q * q).sum::<f64>().sqrt()
}

/// What an instrument's kept errors do to readings of a model: those of positions to first and second order, and the certificate's.
pub(in crate::gonio) struct Kept<'a> {
    optics: Optics<'a>,
    errors: Vec<Off>,
    reference: Vec<(f64, f64)>,
}

impl<'a> Kept<'a> {
    pub fn of(instrument: &'a Instrument) -> Self {
        let mut errors = errors(instrument, Dimension::Space);
        errors.retain(|(family, _, _)| *family != JITTER);
        let optics = Optics::of_middle(instrument);
        let reference = optics.of_reference(&errors);
        Self { optics, errors, reference }
    }

    /// 1 σ of each in a reading of value `f` at a pair of directions, 1/sr: the certificate's, every error's own, and the patterns of what their squares
    /// and products of two do.
    pub fn components(&self, pair: (DVec3, DVec3), f: f64, model: &Truth<'_>) -> Vec<f64> {
        let certificate = f * self.optics.instrument.reference.reflectance_u;
        if self.errors.is_empty() {
            return vec![certificate];
        }
        let scale = self.optics.scale(pair);
        let (_, list) = self.optics.moved(pair, &self.errors, model, 1);
        let of_errors = list.iter().zip(&self.reference);
        let (linear, squares): (Vec<f64>, Vec<f64>) =
            of_errors.map(|(of, of_reference)| net(scale, f, of[0], *of_reference)).unzip();
        let products = if is_curved(&linear, &squares) {
            let alone: Vec<Vec<f64>> = list.iter().map(|of| vec![of[0].1]).collect();
            let both = self.optics.products(pair, &self.errors, &alone, model, 1);
            both.iter().map(|of| scale * of[0]).collect()
        } else {
            vec![0.0; pairs(squares.len()).count()]
        };
        let bend = Bend { squares, products };
        std::iter::once(certificate).chain(linear).chain(bend.patterns()).collect()
    }

    /// Whether no reading shares anything.
    pub fn is_nothing(&self) -> bool {
        self.errors.is_empty() && self.optics.instrument.reference.reflectance_u == 0.0
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        let errors = self.errors.len();
        if errors == 0 { 1 } else { 2 + 2 * errors + pairs(errors).count() }
    }
}

/// How often the axes stopped at each pair of directions.
fn approaches(raw: &Raw) -> Vec<f64> {
    let mut count = vec![0.0; raw.directions.len()];
    let stops = raw.readings.chunk_by(|a, b| a.stop == b.stop);
    stops.filter_map(|stop| stop[0].entry).for_each(|entry| count[entry as usize] += 1.0);
    count
}

/// Adds what errors of positions do to every reading, and takes off what jitter does on average. `model` is what is read, about.
pub(super) fn add(raw: &Raw, instrument: &Instrument, model: &Truth<'_>, table: &mut Table, shared: &mut Shared<'_>) {
    let errors = errors(instrument, raw.dimension);
    if errors.is_empty() {
        return;
    }
    let (n, width) = (raw.directions.len(), raw.channels.len());
    let optics = Optics::new(instrument, raw.dimension);
    // Where the axes stop at the reference is noise of its visit.
    let mut reference = optics.of_reference(&errors);
    reference[kept(&errors)..].fill((0.0, 0.0));
    let values = |entry: usize| -> Vec<f64> { (0..width).map(|c| table.values[c * n + entry]).collect() };
    let valid: Vec<usize> = (0..n).filter(|e| values(*e).iter().any(|v| v.is_finite())).collect();
    let approaches = approaches(raw);
    let of = |entry: &usize| {
        let (pair, stops) = (raw.directions.pair(*entry), approaches[*entry]);
        effects(&optics, (pair, stops), &errors, &reference, model, &values(*entry))
    };
    let mut effects: Vec<Vec<Effect>> = valid.par_iter().map(of).collect();
    // Draws are of one stop.
    let bent = |(entry, list): (usize, &Vec<Effect>)| approaches[entry] == 1.0 && is_bent(list, &errors);
    if valid.iter().copied().zip(&effects).any(bent) {
        let pairs: Vec<(DVec3, DVec3)> = valid.iter().map(|e| raw.directions.pair(*e)).collect();
        let heights = Heights::new(&optics, &pairs, &errors[..kept(&errors)], model, width);
        let listed = valid.par_iter().zip(&mut effects).filter(|(entry, list)| bent((**entry, list)));
        listed.for_each(|(entry, list)| {
            let pair = raw.directions.pair(*entry);
            draw(list, &optics, pair, (&errors, &heights), &reference, model, &values(*entry));
        });
    }
    let (kept, mut placed) = (kept(&errors), Vec::with_capacity(n * width));
    for (entry, list) in valid.iter().zip(effects) {
        let of_channels = list.into_iter().enumerate().map(|(c, effect)| (c * n + entry, effect));
        let of_entry: Vec<(usize, Effect)> = of_channels.filter(|(p, _)| table.values[*p].is_finite()).collect();
        if of_entry.len() > 1 && kept < errors.len() {
            place_of_stop(&of_entry, kept, shared);
        }
        placed.extend(of_entry);
    }
    place_all(&placed, &errors, shared);
    for (place, effect) in &placed {
        let value = &mut table.values[*place];
        *value -= effect.shift(*value);
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::geometry::angles::direction_deg;
    use crate::geometry::half_diff::cos_alpha;
    use crate::numeric::random::{Purpose, stream};

    /// At a lobe's peak squares and products of errors lead. The mean square of what all of them do together, and the mean product over two readings, are those
    /// of the components. The mean of N squares of a squared normal number scatters by √((105/9 − 1)/N) = 3.3/√N of itself; the next order is about n/4
    /// times the variance of the angle from the peak, 10 σ², times 5: 1 %, of which twice is allowed.
    #[test]
    fn components_are_what_errors_do_together() {
        let mut instrument = Instrument::default();
        (instrument.axes.zero_u_deg, instrument.sample.tilt_u_deg) = (0.05, 0.05);
        let kept = Kept::of(&instrument);
        let model = |wi: DVec3, wo: DVec3, out: &mut [f64]| {
            out[0] = cos_alpha(wi, wo).max(0.0).powi(1000);
            true
        };
        let pairs = [30.0, 30.3].map(|theta_o| (direction_deg(30.0, 180.0), direction_deg(theta_o, 0.0)));
        let still = pairs.map(|pair| kept.optics.flux(pair, &Pose::default(), &model, 1)[0]);
        let value = |i: usize| kept.optics.scale(pairs[i]) * still[i];
        let components = [0, 1].map(|i| kept.components(pairs[i], value(i), &model));
        assert!(components.iter().all(|list| list.len() == kept.len()));
        let draws = 40_000u32;
        let mut found = [[0.0; 2]; 2];
        let mut rng = stream(1, Purpose::Study, 0);
        for _ in 0..draws {
            let pose = kept.errors.iter().fold(Pose::default(), |sum, (_, of, sigma)| {
                let z: f64 = StandardNormal.sample(&mut rng);
                sum.plus(&of(z * sigma))
            });
            let change = [0, 1].map(|i| {
                let moved = kept.optics.flux(pairs[i], &pose, &model, 1)[0];
                kept.optics.scale(pairs[i]) * (moved - still[i])
            });
            (0..4).for_each(|k| found[k / 2][k % 2] += change[k / 2] * change[k % 2] / f64::from(draws));
        }
        let product = |a: usize, b: usize| components[a].iter().zip(&components[b]).map(|(x, y)| x * y).sum::<f64>();
        let chance = 5.0 * 3.3 / f64::from(draws).sqrt() + 0.02;
        for (a, b) in [(0, 0), (1, 1), (0, 1)] {
            let off = (product(a, b) - found[a][b]).abs() / (found[a][a] * found[b][b]).sqrt();
            println!("readings {a} and {b}: components {:.4e}, draws {:.4e}", product(a, b), found[a][b]);
            assert!(off < chance, "{a} {b}: {} {}", product(a, b), found[a][b]);
        }
    }
}
