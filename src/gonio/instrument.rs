//! The instrument: what a reading of a known BRDF comes out as.

use rand_distr::{Distribution, Normal, Poisson};

use super::effects::quantisation::step;
use super::parts::{Axes, Detector, Holder, Protocol, Reference, Source, Surroundings, shown};
use super::reduce::{positions, saturation_limit};
use crate::numeric::random::{Purpose, stream};

/// Standard uncertainty of the sample's height over the distance of source or detector, at most.
const HIGHEST: f64 = 0.1;

/// A gonioreflectometer. As it stands by default it is ideal but for a noisy detector; parts that are described bring their effects
/// (`docs/instrument.md`).
///
/// The source lights a spot on the sample, the detector sees all of it: the flux it receives is ∝ f·cosθo, and so is the mean
/// number of photoelectrons, N = f·cosθo·`electrons`, in a second. Photoelectrons are Poisson-distributed (shot noise); the electronics add
/// normal noise of `read_noise` electrons to each reading. The BRDF comes back as signal/(cosθo·`electrons`).
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Instrument {
    /// Photoelectrons a second (in one reading, if no exposures are given) of a BRDF of 1/sr at cosθo = 1; 0 means a detector without noise.
    pub electrons: f64,
    /// Standard deviation of the electronics' noise in one reading, electrons.
    pub read_noise: f64,
    /// Readings averaged at each pair of directions.
    pub readings: u32,
    /// The source and its beam.
    pub source: Source,
    /// The sample on its holder.
    pub sample: Holder,
    /// The detector.
    pub detector: Detector,
    /// The reference standard.
    pub reference: Reference,
    /// The axes.
    pub axes: Axes,
    /// Stray light and shadow.
    pub surroundings: Surroundings,
    /// The order of readings.
    pub protocol: Protocol,
}

impl Default for Instrument {
    /// A cooled detector at a bright source: 10⁵ electrons per 1/sr, 10 electrons of read noise, one reading.
    fn default() -> Self {
        Self {
            electrons: 1e5,
            read_noise: 10.0,
            readings: 1,
            source: Source::default(),
            sample: Holder::default(),
            detector: Detector::default(),
            reference: Reference::default(),
            axes: Axes::default(),
            surroundings: Surroundings::default(),
            protocol: Protocol::default(),
        }
    }
}

impl Instrument {
    /// Without any noise: readings are the truth.
    #[must_use]
    pub fn noiseless() -> Self {
        Self { electrons: 0.0, read_noise: 0.0, ..Self::default() }
    }

    /// Whether the detector adds noise.
    #[must_use]
    pub fn is_noisy(&self) -> bool {
        self.electrons > 0.0
    }

    /// What is wrong with the numbers, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<String> {
        let said = |name: &str, range: &str, found: f64| Some(format!("{name}: expected {range}, found {found:e}"));
        if self.electrons != 0.0 && !(1e-3..=1e15).contains(&self.electrons) {
            return said("instrument.electrons", "0 (no noise) or a number from 1e-3 to 1e15", self.electrons);
        }
        if !(self.read_noise >= 0.0 && self.read_noise <= 1e15) {
            return said("instrument.read_noise", "a number from 0 to 1e15", self.read_noise);
        }
        let none = || (self.readings == 0).then(|| "instrument.readings: expected at least 1, found 0".to_owned());
        let detector = &self.detector;
        let counts = detector.dark_per_s + detector.dark_drift_per_sqrt_hour + detector.offset > 0.0;
        let unit = (!self.is_noisy() && counts).then(|| {
            "instrument.electrons: what counts electrons (dark, offset) needs a number above 0, found 0".into()
        });
        let parts = [
            unit,
            self.source.fault(),
            self.sample.fault(),
            self.detector.fault(),
            self.reference.fault(),
            self.axes.fault(),
            self.surroundings.fault(),
            self.protocol.fault(),
            self.height_fault(),
            self.beam_fault(),
            self.well_fault(),
        ];
        none().or_else(|| parts.into_iter().flatten().next())
    }

    /// A height of the surface that is no small part of the shortest distance would put it into source or detector.
    fn height_fault(&self) -> Option<String> {
        let height = self.sample.height_u_m;
        let far = [("source", self.source.distance_m), ("detector", self.detector.distance_m)];
        let (part, distance) = far.into_iter().find(|(_, distance)| *distance > 0.0 && height > HIGHEST * distance)?;
        Some(format!(
            "instrument.sample.height_u_m: expected a tenth of instrument.{part}.distance_m = {} at most, found {}",
            shown(distance),
            shown(height)
        ))
    }

    /// A beam as wide as source or detector are far would reach up to them.
    fn beam_fault(&self) -> Option<String> {
        let beam = self.source.beam_diameter_m;
        let far = [("source", self.source.distance_m), ("detector", self.detector.distance_m)];
        let (part, distance) = far.into_iter().find(|(_, distance)| *distance > 0.0 && beam > *distance)?;
        Some(format!(
            "instrument.source.beam_diameter_m: expected instrument.{part}.distance_m = {} at most, found {}",
            shown(distance),
            shown(beam)
        ))
    }

    /// A full well that noise and rounding fill would leave no reading that is safe from saturation.
    fn well_fault(&self) -> Option<String> {
        let Detector { full_well, offset, nonlinearity_u, .. } = self.detector;
        (full_well > 0.0 && saturation_limit(self) <= offset).then(|| {
            let left = 1.0 - 4.0 * nonlinearity_u - step(&self.detector) / full_well;
            if left <= 0.0 {
                return "instrument.detector.bits: a step of the converter and 4 nonlinearity_u leave no signal that is safe from saturation".into();
            }
            format!(
                "instrument.detector.full_well: expected more than {} (offset and five times read_noise, over 1 − 4 nonlinearity_u less a step of the \
                 converter), or no reading is safe from saturation; found {}",
                shown((offset + 5.0 * self.read_noise) / left),
                shown(full_well)
            )
        })
    }

    /// Whether nothing but the detector's noise is described, so that no raw readings are needed to know what comes back.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        let Self { electrons, read_noise, readings, .. } = *self;
        *self == Self { electrons, read_noise, readings, axes: self.axes, protocol: self.protocol, ..Self::default() }
            && self.axes.zero_u_deg == 0.0
            && self.axes.jitter_deg == 0.0
    }

    /// Whether readings are compared with a reference standard.
    #[must_use]
    pub fn has_reference(&self) -> bool {
        self.reference.reflectance > 0.0
    }

    /// Whether positions of axes or sample are uncertain.
    #[must_use]
    pub fn has_positions(&self) -> bool {
        positions::matter(self)
    }

    /// Whether the closed shutter must be read.
    #[must_use]
    pub fn has_dark(&self) -> bool {
        let Detector { dark_per_s, dark_drift_per_sqrt_hour, offset, .. } = self.detector;
        dark_per_s > 0.0 || dark_drift_per_sqrt_hour > 0.0 || offset > 0.0
    }

    /// Exposures in which blank and dark are read: the longest, whose rates are known best, and all where each has an offset of its own.
    #[must_use]
    pub fn base_exposures_s(&self) -> &[f64] {
        let all = &self.detector.exposures_s;
        if self.detector.offset > 0.0 { all } else { &all[all.len().saturating_sub(1)..] }
    }

    /// Electrons a second of a BRDF of 1/sr at cosθo = 1: 1 where the detector is without noise and its signal in no unit.
    #[must_use]
    pub fn gain(&self) -> f64 {
        if self.is_noisy() { self.electrons } else { 1.0 }
    }

    /// One reduced reading (f, σ) of the true value `f` (1/sr) at cosθo = `cos_o` > 0. σ is what an experimenter would state: shot
    /// noise estimated from the reading itself (at least one electron's worth), read noise as specified.
    #[must_use]
    pub fn read(&self, f: f64, cos_o: f64, seed: u64, index: u64) -> (f64, f64) {
        if !self.is_noisy() {
            return (f, 0.0);
        }
        let gain = self.electrons * cos_o;
        let readings = f64::from(self.readings);
        // Poisson counts of several readings add up to one Poisson count.
        let signal = shot(f * gain * readings, seed, index) + self.read_noise * readings.sqrt() * normal(seed, index);
        let variance = signal.max(1.0) + self.read_noise * self.read_noise * readings;
        (signal / (gain * readings), variance.sqrt() / (gain * readings))
    }
}

pub(super) fn shot(mean: f64, seed: u64, index: u64) -> f64 {
    let mut rng = stream(seed, Purpose::ShotNoise, index);
    if mean <= 0.0 {
        return 0.0; // a table's noise as the truth: no photons
    }
    // Beyond 10⁹ counts a Poisson distribution is normal to all digits that are drawn; not a number stays so.
    match Poisson::new(mean).ok().filter(|_| mean < 1e9) {
        Some(poisson) => poisson.sample(&mut rng),
        None => mean + mean.sqrt() * Normal::new(0.0, 1.0).map_or(f64::NAN, |n| n.sample(&mut rng)),
    }
}

pub(super) fn normal(seed: u64, index: u64) -> f64 {
    Normal::new(0.0, 1.0).map_or(f64::NAN, |n| n.sample(&mut stream(seed, Purpose::ReadNoise, index)))
}

#[cfg(test)]
mod tests {
    use super::*;

    type Change = fn(&mut Instrument);

    #[test]
    fn readings_scatter_round_the_truth_by_the_sigma_they_state() {
        for (f, electrons, readings) in
            [(0.2, 1e5, 1), (5.0, 1e4, 4), (1e-3, 1e4, 1), (0.0, 1e4, 2), (2400.0, 1e15, 100)]
        {
            let instrument = Instrument { electrons, read_noise: 20.0, readings, ..Instrument::default() };
            let (cos_o, draws) = (0.5, 20_000u64);
            let gain = electrons * cos_o * f64::from(readings);
            let truth = (f * gain + 400.0 * f64::from(readings)).sqrt() / gain;
            let all: Vec<(f64, f64)> = (0..draws).map(|i| instrument.read(f, cos_o, 9, i)).collect();
            let n = draws as f64;
            let mean = all.iter().map(|r| r.0).sum::<f64>() / n;
            assert!((mean - f).abs() < 5.0 * truth / n.sqrt(), "mean {mean} vs {f}");
            let variance = all.iter().map(|r| (r.0 - f).powi(2)).sum::<f64>() / n;
            // A variance of n normal draws scatters by √(2/n).
            assert!((variance / truth.powi(2) - 1.0).abs() < 6.0 * (2.0 / n).sqrt(), "f {f}: {variance}");
            let stated = all.iter().map(|r| r.1 * r.1).sum::<f64>() / n;
            // Never less than the truth on average; the floor of one electron adds at most a share of read noise.
            assert!(
                stated > truth * truth * 0.98 && stated < truth * truth * 1.05,
                "f {f}: {stated} vs {}",
                truth * truth
            );
        }
    }

    #[test]
    fn without_noise_the_reading_is_the_truth_and_wrong_numbers_are_named() {
        assert_eq!(Instrument::noiseless().read(0.37, 0.2, 1, 2), (0.37, 0.0));
        assert_eq!(Instrument::default().fault(), None);
        let wrong = Instrument { read_noise: -1.0, ..Instrument::default() };
        assert!(wrong.fault().is_some_and(|f| f.contains("read_noise") && f.contains("-1e0")));
        let of = |change: fn(&mut Instrument)| {
            let mut instrument = Instrument::default();
            change(&mut instrument);
            instrument.fault().unwrap_or_default()
        };
        let cases: [(Change, &str); 12] = [
            (
                |i| i.electrons = 1e-300,
                "instrument.electrons: expected 0 (no noise) or a number from 1e-3 to 1e15, found 1e-300",
            ),
            (|i| i.electrons = f64::NAN, "found NaN"),
            (
                |i| i.reference.reflectance = 2.0,
                "instrument.reference.reflectance: expected a number from 0 to 1.2, found 2",
            ),
            (
                |i| (i.sample.height_u_m, i.detector.distance_m) = (1.0, 0.5),
                "a tenth of instrument.detector.distance_m = 0.5 at most, found 1",
            ),
            (
                |i| i.sample.diameter_m = 1e-200,
                "expected 0 (it catches every beam) or a number from 1e-6 to 100, found 1e-200",
            ),
            (
                |i| i.source.distance_m = 1e-9,
                "expected 0 (a collimated beam) or a number from 0.001 to 1e6, found 1e-9",
            ),
            (|i| i.source.beam_diameter_m = -1.0, "instrument.source.beam_diameter_m"),
            (
                |i| i.detector.full_well = 1e-13,
                "instrument.detector.full_well: expected 0 (never saturates) or a number from 1e-12 to 1e18",
            ),
            // Five times a read noise of 10 over 1 − 4/8.
            (
                |i| (i.detector.full_well, i.detector.nonlinearity_u) = (80.0, 0.125),
                "instrument.detector.full_well: expected more than 100 (offset",
            ),
            (
                |i| i.detector.nonlinearity_u = 0.3,
                "instrument.detector.nonlinearity_u: expected a number from 0 to 0.2",
            ),
            (
                |i| i.detector.exposure_u = -0.1,
                "instrument.detector.exposure_u: expected a number from 0 to 0.2, found -0.1",
            ),
            (
                |i| i.detector.exposures_s = vec![1e-12],
                "one or more times from 1e-9 to 1e6 s, ascending, found [1e-12]",
            ),
        ];
        for (change, says) in cases {
            assert!(of(change).contains(says), "{} lacks {says}", of(change));
        }
    }

    /// Raw files say what made them: those of instruments without errors of exposure times are what they were before there were such.
    #[test]
    fn descriptions_have_errors_of_exposure_times_where_there_are_any() {
        let mut instrument = Instrument::default();
        let written = |i: &Instrument| serde_json::to_string(i).expect("plain data");
        assert!(!written(&instrument).contains("exposure_u"));
        instrument.detector.exposure_u = 1e-3;
        assert_eq!(serde_json::from_str::<Instrument>(&written(&instrument)).expect("reads"), instrument);
    }
}
