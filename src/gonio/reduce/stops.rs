//! Readings of one thing at one stop of the axes, put together.

use crate::gonio::effects::quantisation::step;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::reading::{Kind, Reading};

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
    let channel = |c: usize| {
        // The longest exposure of which no reading saturates.
        let exposures = run.chunk_by(|a, b| a.exposure_s == b.exposure_s);
        let mut begin = first;
        let mut best: Option<(f64, Rate)> = None;
        for list in exposures {
            let signals: Vec<f64> = (begin..begin + list.len()).map(|i| raw.signals(i)[c]).collect();
            begin += list.len();
            let exposure = list[0].exposure_s;
            if signals.iter().all(|s| *s < limit(instrument)) && best.is_none_or(|(longest, _)| exposure > longest) {
                best = Some((exposure, rate(&signals, exposure, instrument)));
            }
        }
        best.map(|(_, rate)| rate)
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
    let rounding = step(&instrument.detector).powi(2) / 12.0;
    let single = if instrument.is_noisy() { signal.max(1.0) + instrument.read_noise.powi(2) + rounding } else { 0.0 };
    Rate { mean: signal / exposure, variance: single / (count * exposure * exposure), signal }
}
