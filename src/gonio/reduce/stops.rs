//! Readings of one thing at one stop of the axes, put together.

use std::f64::consts::TAU;

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
}

/// All readings of a stop.
#[derive(Debug, Clone)]
pub(super) struct Stop {
    pub kind: Kind,
    pub entry: Option<u32>,
    /// The middle of its readings.
    pub time_s: f64,
    /// Channel by channel; `None` where every exposure saturated.
    pub rates: Vec<Option<Rate>>,
}

/// Readings by stop, in order of time.
pub(super) fn stops(raw: &Raw, instrument: &Instrument) -> Vec<Stop> {
    let mut first = 0;
    let runs = raw.readings.chunk_by(|a, b| a.stop == b.stop);
    runs.map(|run| {
        let stop = combined(raw, instrument, first, run);
        first += run.len();
        stop
    })
    .collect()
}

fn combined(raw: &Raw, instrument: &Instrument, first: usize, run: &[Reading]) -> Stop {
    let mut exposures: Vec<f64> = run.iter().map(|reading| reading.exposure_s).collect();
    exposures.sort_by(|a, b| b.total_cmp(a));
    exposures.dedup();
    let channel = |c: usize| {
        // The longest exposure of which no reading saturates; a repeat that was not read counts for nothing.
        exposures.iter().find_map(|exposure| {
            let of_exposure = run.iter().enumerate().filter(|(_, reading)| reading.exposure_s == *exposure);
            let all = of_exposure.map(|(i, _)| raw.signals(first + i)[c]);
            let signals: Vec<f64> = all.filter(|s| !s.is_nan()).collect();
            let usable = !signals.is_empty() && signals.iter().all(|s| *s < limit(instrument));
            usable.then(|| rate(&signals, *exposure, instrument))
        })
    };
    let end = run[run.len() - 1];
    Stop {
        kind: run[0].kind,
        entry: run[0].entry,
        time_s: 0.5 * (run[0].time_s + end.time_s + end.exposure_s),
        rates: (0..raw.channels.len()).map(channel).collect(),
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

/// The mean of readings of one exposure. Shot noise is that of the mean (at least one electron's worth), what the description says comes on top.
fn rate(signals: &[f64], exposure: f64, instrument: &Instrument) -> Rate {
    let count = signals.len() as f64;
    let signal = signals.iter().sum::<f64>() / count;
    let noise = if instrument.is_noisy() { signal.max(1.0) + instrument.read_noise.powi(2) } else { 0.0 };
    let variance = noise / count + rounding(noise, count, step(&instrument.detector));
    Rate { mean: signal / exposure, variance: variance / (exposure * exposure), signal }
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
