//! What a reading tells: derivatives of the model by its parameters, and the reading's own noise.

use glam::DVec3;

use super::pair::Pair;
use super::prior::Prior;
use crate::brdf::lobe::MAX_PARAMETERS;
use crate::brdf::{LobeKind, MAX_LOBES};
use crate::gonio::effects::footprint::Footprint;
use crate::gonio::effects::quantisation::step;
use crate::gonio::instrument::Instrument;
use crate::gonio::reduce::positions::Jitter;
use crate::gonio::reduce::saturation_limit;
use crate::measurement::Dimension;

/// Most parameters of a model.
const MOST: usize = MAX_LOBES * (1 + MAX_PARAMETERS);

/// A model's value and its derivatives.
pub(super) struct Model {
    lobes: Vec<LobeKind>,
    parameters: usize,
}

impl Model {
    pub fn of(prior: &Prior) -> Self {
        Self { lobes: prior.model().lobes().to_vec(), parameters: prior.ranges().len() }
    }

    /// How many parameters it has.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// f (1/sr) and, in `gradient`, df/d ln(parameter): what makes errors relative.
    pub fn value(&self, parameters: &[f64], (wi, wo): Pair, gradient: &mut [f64]) -> f64 {
        let (mut sum, mut at) = (0.0, 0);
        let mut slopes = [0.0; MAX_PARAMETERS];
        for kind in &self.lobes {
            let lobe = kind.lobe();
            let shapes = lobe.parameters().len();
            let (weight, shape) = (parameters[at], &parameters[at + 1..=at + shapes]);
            let basis = lobe.value(shape, lobe.coordinate(wi, wo), &mut slopes[..shapes]);
            sum += weight * basis;
            gradient[at] = weight * basis;
            for (k, shape) in shape.iter().enumerate() {
                gradient[at + 1 + k] = weight * shape * slopes[k];
            }
            at += 1 + shapes;
        }
        sum
    }

    /// The model at these parameters, as a reading meets it.
    pub fn truth<'a>(&'a self, parameters: &'a [f64]) -> impl Fn(DVec3, DVec3, &mut [f64]) -> bool + 'a {
        |wi, wo, out| {
            out[0] = self.value(parameters, (wi, wo), &mut [0.0; MOST][..self.parameters]);
            true
        }
    }
}

/// The noise of readings by an instrument.
pub(super) struct Noise<'a> {
    instrument: &'a Instrument,
    footprint: Option<Footprint>,
    stops: Jitter<'a>,
    /// Read noise and rounding of one reading, electrons².
    fixed: f64,
}

impl<'a> Noise<'a> {
    pub fn of(instrument: &'a Instrument) -> Self {
        let fixed = instrument.read_noise.powi(2) + step(&instrument.detector).powi(2) / 12.0;
        let footprint = Footprint::of(instrument, Dimension::Space);
        Self { instrument, footprint, stops: Jitter::of(instrument), fixed }
    }

    /// Variance of f from the readings of one row (all its repeats), by photons, dark current, stray light and electronics, in the longest exposure
    /// that does not saturate; `None` where even the shortest does, or no light counts.
    pub fn variance(&self, f: f64, (wi, wo): Pair) -> Option<f64> {
        let instrument = self.instrument;
        let rate = instrument.gain() * wo.z * self.footprint.map_or(1.0, |p| p.share(wi, wo));
        let more = instrument.gain() * instrument.surroundings.stray_per_sr + instrument.detector.dark_per_s;
        if !(rate > 0.0 && wi.z > 0.0) {
            return None;
        }
        let most = saturation_limit(instrument) - instrument.detector.offset;
        // Half of what chance puts above the limit would be lost at it: five σ below it nothing is.
        let fits = |t: &&f64| {
            let signal = (f * rate + more) * **t;
            signal + 5.0 * (signal + self.fixed).sqrt() < most
        };
        let time = *instrument.detector.exposures_s.iter().rev().find(fits)?;
        let electrons = ((f * rate + more) * time).max(1.0) + self.fixed;
        Some(electrons / (f64::from(instrument.readings) * (rate * time).powi(2)))
    }

    /// Variance of f by where four axes stop, the same for all readings of a stop, as the reduction counts it.
    pub fn jitter(&self, model: &Model, parameters: &[f64], pair: Pair) -> f64 {
        self.stops.variance(pair, &model.truth(parameters))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;
    use crate::gonio::parts::{Axes, Detector};

    fn pair(theta_i: f64, theta_o: f64) -> Pair {
        (direction_deg(theta_i, 180.0), direction_deg(theta_o, 0.0))
    }

    fn model(spec: &str) -> Model {
        Model::of(&Prior::usual(&spec.parse().expect("a model")).expect("space"))
    }

    #[test]
    fn gradients_are_differences() {
        let (model, at) = (model("lambert+phong+phong"), [0.3, 0.1, 40.0, 0.05, 700.0]);
        for pair in [pair(30.0, 30.0), pair(30.0, 33.0), pair(10.0, -40.0), pair(70.0, 60.0)] {
            let mut gradient = [0.0; 5];
            let f = model.value(&at, pair, &mut gradient);
            for k in 0..5 {
                let h = 1e-5f64;
                let of = |sign: f64| {
                    let mut moved = at;
                    moved[k] *= (sign * h).exp();
                    model.value(&moved, pair, &mut [0.0; 5])
                };
                let difference = (of(1.0) - of(-1.0)) / (2.0 * h);
                // Central differences: h² times a third derivative, here below 10³ f.
                assert!((gradient[k] - difference).abs() < 1e3 * h * h * f, "{k}: {} {difference}", gradient[k]);
            }
        }
    }

    #[test]
    fn noise_is_what_a_reading_states_and_a_full_well_ends_it() {
        let instrument = Instrument { readings: 3, ..Instrument::default() };
        let (f, pair) = (0.2, pair(20.0, 40.0));
        let variance = Noise::of(&instrument).variance(f, pair).expect("light");
        let stated: f64 = (0..4000).map(|i| instrument.read(f, pair.1.z, 3, i).1.powi(2)).sum::<f64>() / 4000.0;
        // σ² follows the counts: 46,000 electrons scatter by 0.5 %, the mean of 4,000 by 7·10⁻⁵.
        assert!((variance / stated - 1.0).abs() < 5e-4, "{variance} {stated}");
        let detector = Detector { full_well: 2e4, exposures_s: vec![0.1, 1.0], ..Detector::default() };
        let small = Instrument { detector, ..Instrument::default() };
        let of = |f: f64| Noise::of(&small).variance(f, pair);
        let gain = 1e5 * pair.1.z;
        assert!((of(0.1).expect("long") * gain * gain / (0.1 * gain + 100.0) - 1.0).abs() < 1e-12);
        assert!((of(1.0).expect("short") * (0.1 * gain).powi(2) / (0.1 * gain + 100.0) - 1.0).abs() < 1e-12);
        assert_eq!(of(10.0), None);
    }

    #[test]
    fn jitter_is_a_slope_and_on_the_peak_a_curvature() {
        let axes = Axes { jitter_deg: 0.1, ..Axes::default() };
        let instrument = Instrument { axes, ..Instrument::default() };
        let (noise, model, at) = (Noise::of(&instrument), model("lambert+phong"), [0.3, 0.1, 100.0]);
        let of = |pair: Pair| {
            let f = model.value(&at, pair, &mut [0.0; 3]);
            (noise.jitter(&model, &at, pair).sqrt(), f)
        };
        let (flank, f) = of(pair(30.0, 35.0));
        let sigma = 0.1f64.to_radians();
        let lobe = f - 0.3 * std::f64::consts::FRAC_1_PI;
        // Both polar angles: source |df/dα|, detector |df/dα + f tanθo|.
        let slope = 100.0 * 5f64.to_radians().tan() * lobe;
        let want = sigma * (slope.powi(2) + (slope + f * 35f64.to_radians().tan()).powi(2)).sqrt();
        assert!((flank / want - 1.0).abs() < 0.02, "{flank} {want}");
        let (peak, f) = of(pair(30.0, 30.0));
        assert!(peak > 0.0 && peak < 0.3 * flank * f / lobe, "{peak} {flank}");
    }
}
