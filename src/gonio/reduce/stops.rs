//! Readings of one thing at one stop of the axes, put together.

use std::f64::consts::TAU;

use super::noise::Noise;
use crate::gonio::effects::quantisation::step;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::reading::{Kind, Reading};

/// Terms of the series of what rounding leaves in common.
const HARMONICS: i32 = 20;

/// A rate and its variance, from repeats of one exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rate {
    /// Signal a second.
    pub mean: f64,
    /// Of the mean.
    pub variance: f64,
    /// Signal of one reading.
    pub signal: f64,
    pub exposure_s: f64,
}

/// All readings of a stop; of blank and dark, all of one exposure.
#[derive(Debug, Clone)]
pub(super) struct Stop {
    pub kind: Kind,
    pub entry: Option<u32>,
    /// Its number in the log.
    pub number: u32,
    /// The middle of its readings.
    pub time_s: f64,
    /// Channel by channel; `None` where every exposure saturated.
    pub rates: Vec<Option<Rate>>,
}

/// Repeats of one exposure at a stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Repeats {
    pub exposure_s: f64,
    pub count: usize,
    /// Mean signal.
    pub signal: f64,
    /// Variance of one about it; 0 of a single one.
    pub scatter: f64,
}

/// What the readings of a stop come to.
#[derive(Debug, Clone)]
pub(super) struct Summary {
    kind: Kind,
    entry: Option<u32>,
    number: u32,
    pub time_s: f64,
    /// From the first reading's beginning to the last one's end.
    pub seconds: f64,
    /// Channel by channel: the longest exposure that does not saturate.
    pub repeats: Vec<Option<Repeats>>,
}

impl Summary {
    /// With the noise of its readings.
    pub fn stop(&self, noise: &Noise, instrument: &Instrument) -> Stop {
        let of = |(c, repeats): (usize, &Option<Repeats>)| {
            repeats.map(|r| rate(&r, noise.variance(c, r.signal), instrument))
        };
        let rates = self.repeats.iter().enumerate().map(of).collect();
        Stop { kind: self.kind, entry: self.entry, number: self.number, time_s: self.time_s, rates }
    }
}

/// Readings by stop, in order of time.
pub(super) fn summaries(raw: &Raw, instrument: &Instrument) -> Vec<Summary> {
    let (mut first, mut list) = (0, Vec::new());
    for run in raw.readings.chunk_by(|a, b| a.stop == b.stop) {
        let mut exposures: Vec<f64> = run.iter().map(|reading| reading.exposure_s).collect();
        exposures.sort_by(|a, b| b.total_cmp(a));
        exposures.dedup();
        // What is subtracted is wanted in the exposure of what it is subtracted from.
        let is_base = matches!(run[0].kind, Kind::Blank | Kind::Dark);
        let parts = exposures.chunks(if is_base { 1 } else { exposures.len() });
        list.extend(parts.map(|exposures| combined(raw, instrument, (first, run), exposures)));
        first += run.len();
    }
    list
}

/// Of the readings of a stop, from the `first` on, those of these exposures, descending.
fn combined(raw: &Raw, instrument: &Instrument, (first, run): (usize, &[Reading]), exposures: &[f64]) -> Summary {
    let limit = limit(instrument);
    let channel = |c: usize| {
        // The longest exposure of which no reading saturates; a repeat that was not read counts for nothing.
        exposures.iter().find_map(|exposure| {
            let of_exposure = run.iter().enumerate().filter(|(_, reading)| reading.exposure_s == *exposure);
            let all = of_exposure.map(|(i, _)| raw.signals(first + i)[c]);
            let signals: Vec<f64> = all.filter(|s| !s.is_nan()).collect();
            let usable = !signals.is_empty() && signals.iter().all(|s| *s < limit);
            usable.then(|| Repeats::of(&signals, *exposure))
        })
    };
    let end = run[run.len() - 1];
    let end_s = end.time_s + end.exposure_s;
    Summary {
        kind: run[0].kind,
        entry: run[0].entry,
        number: run[0].stop,
        time_s: 0.5 * (run[0].time_s + end_s),
        seconds: end_s - run[0].time_s,
        repeats: (0..raw.channels.len()).map(channel).collect(),
    }
}

impl Repeats {
    fn of(signals: &[f64], exposure_s: f64) -> Self {
        let count = signals.len();
        let signal = signals.iter().sum::<f64>() / count as f64;
        // From the first, so that equal ones scatter by nothing.
        let off = |s: &f64| s - signals[0];
        let mean_off = signals.iter().map(off).sum::<f64>() / count as f64;
        let squares: f64 = signals.iter().map(|s| (off(s) - mean_off).powi(2)).sum();
        Self { exposure_s, count, signal, scatter: squares / (count - 1).max(1) as f64 }
    }
}

/// Signals from here on may be saturated: noise and nonlinearity may lower them by no more than this.
pub(in crate::gonio) fn limit(instrument: &Instrument) -> f64 {
    let detector = &instrument.detector;
    if detector.full_well == 0.0 {
        return f64::INFINITY;
    }
    detector.full_well * (1.0 - 4.0 * detector.nonlinearity_u) - 5.0 * instrument.read_noise - step(detector)
}

/// The mean of readings of one exposure, each with a variance of `noise` and what rounding adds.
fn rate(of: &Repeats, noise: f64, instrument: &Instrument) -> Rate {
    let (count, exposure) = (of.count as f64, of.exposure_s);
    let variance = noise / count + rounding(noise, count, step(&instrument.detector));
    Rate {
        mean: of.signal / exposure,
        variance: variance / (exposure * exposure),
        signal: of.signal,
        exposure_s: exposure,
    }
}

/// Variance of the mean of `count` readings by their rounding to steps: of step²/12 the share that repeats have in common does not average out.
/// With normal noise of σ it is step² Σ exp(−(2πkσ/step)²)/(2π²k²), all of it without noise and 3e-5 of it at a σ of half a step.
fn rounding(noise: f64, count: f64, step: f64) -> f64 {
    if step == 0.0 {
        return 0.0;
    }
    let term = |k: i32| {
        let turn = TAU * f64::from(k);
        2.0 * (-turn * turn * noise / (step * step)).exp() / (turn * turn)
    };
    let whole = step * step / 12.0;
    let common = (step * step * (1..=HARMONICS).map(term).sum::<f64>()).min(whole);
    common + (whole - common) / count
}
