//! Readings of one thing at one stop of the axes, put together.

use std::f64::consts::TAU;

use super::noise::Noise;
use crate::gonio::effects::quantisation::step;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::reading::{Kind, Reading};

/// By which share exposures may differ that are called the same.
const SAME: f64 = 1e-3;
/// Terms of the series of what rounding leaves in common, and halvings that find the noise behind it.
const HARMONICS: i32 = 20;
const HALVINGS: u32 = 30;

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
    /// Channel by channel; `None` where every exposure saturated, or nothing was read.
    pub rates: Vec<Option<Rate>>,
    /// Whether even the shortest exposure of it saturated, channel by channel.
    pub saturated: Vec<bool>,
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
    /// Seconds by which two of them are apart, half the mean: what a random walk makes of their scatter.
    apart_s: f64,
}

/// What the readings of a stop come to.
#[derive(Debug, Clone)]
pub(super) struct Summary {
    pub kind: Kind,
    entry: Option<u32>,
    number: u32,
    pub time_s: f64,
    /// Channel by channel: the longest exposure that does not saturate.
    pub repeats: Vec<Option<Repeats>>,
    /// Whether even the shortest exposure of it saturated, channel by channel.
    saturated: Vec<bool>,
}

impl Summary {
    /// With the noise of its readings.
    pub fn stop(&self, noise: &Noise, instrument: &Instrument) -> Stop {
        let of = |(c, repeats): (usize, &Option<Repeats>)| repeats.map(|r| r.rate(noise.variance(c, &r, instrument)));
        let rates = self.repeats.iter().enumerate().map(of).collect();
        let saturated = self.saturated.clone();
        Stop { kind: self.kind, entry: self.entry, number: self.number, time_s: self.time_s, rates, saturated }
    }
}

/// Exposures that are not the same, descending.
pub(super) fn distinct(all: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut list: Vec<f64> = all.collect();
    list.sort_by(|a, b| b.total_cmp(a));
    list.dedup_by(|next, kept| are_same(*next, *kept));
    list
}

/// Whether two exposures are the same but for the clock's last digits.
pub(super) fn are_same(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < SAME
}

/// Readings by stop, in order of time.
pub(super) fn summaries(raw: &Raw, instrument: &Instrument) -> Vec<Summary> {
    let (mut first, mut list) = (0, Vec::new());
    for run in raw.readings.chunk_by(|a, b| a.stop == b.stop) {
        let exposures = distinct(run.iter().map(|reading| reading.exposure_s));
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
            let of_exposure = run.iter().enumerate().filter(|(_, reading)| are_same(reading.exposure_s, *exposure));
            let all = of_exposure.map(|(i, reading)| (reading.time_s, raw.signals(first + i)[c]));
            let signals: Vec<(f64, f64)> = all.filter(|(_, s)| !s.is_nan()).collect();
            let usable = !signals.is_empty() && signals.iter().all(|(_, s)| *s < limit);
            usable.then(|| Repeats::of(&signals, *exposure))
        })
    };
    let shortest = exposures.last().copied().unwrap_or(0.0);
    let saturated = |c: usize| {
        let mut of_shortest = run.iter().enumerate().filter(|(_, reading)| are_same(reading.exposure_s, shortest));
        of_shortest.any(|(i, _)| raw.signals(first + i)[c] >= limit)
    };
    let end = run[run.len() - 1];
    let end_s = end.time_s + end.exposure_s;
    Summary {
        kind: run[0].kind,
        entry: run[0].entry,
        number: run[0].stop,
        time_s: 0.5 * (run[0].time_s + end_s),
        repeats: (0..raw.channels.len()).map(channel).collect(),
        saturated: (0..raw.channels.len()).map(saturated).collect(),
    }
}

impl Repeats {
    /// From times, ascending, and signals.
    fn of(signals: &[(f64, f64)], exposure_s: f64) -> Self {
        let count = signals.len();
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| signals.iter().map(of).sum::<f64>() / count as f64;
        // From the first, so that equal ones scatter by nothing.
        let off = |s: &(f64, f64)| s.1 - signals[0].1;
        let mean_off = mean(&off);
        let pairs = (count * (count - 1)).max(1) as f64;
        let squares: f64 = signals.iter().map(|s| (off(s) - mean_off).powi(2)).sum();
        let apart = |(k, s): (usize, &(f64, f64))| (2.0 * k as f64 + 1.0 - count as f64) * (s.0 - signals[0].0);
        Self {
            exposure_s,
            count,
            signal: mean(&|s| s.1),
            scatter: squares / (count - 1).max(1) as f64,
            apart_s: signals.iter().enumerate().map(apart).sum::<f64>() / pairs,
        }
    }

    /// The variance that source and dark bring to their scatter as they walk.
    pub fn walked(&self, instrument: &Instrument) -> f64 {
        let an_hour = (self.signal * instrument.source.drift_per_sqrt_hour).powi(2)
            + (self.exposure_s * instrument.detector.dark_drift_per_sqrt_hour).powi(2);
        an_hour * self.apart_s / 3600.0
    }

    /// Their rate, whose mean has this variance in signals².
    fn rate(&self, variance: f64) -> Rate {
        let exposure_s = self.exposure_s;
        Rate {
            mean: self.signal / exposure_s,
            variance: variance / (exposure_s * exposure_s),
            signal: self.signal,
            exposure_s,
        }
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

/// Variances that rounding to steps brings to a reading whose noise has this variance: what repeats have in common and does not average out, and each
/// one's own. Of step²/12 together the common part is, with normal noise of σ, step² Σ exp(−(2πkσ/step)²)/(2π²k²), all of it without noise and 3e-5 of
/// it at a σ of half a step.
pub(super) fn rounding(noise: f64, step: f64) -> (f64, f64) {
    if step == 0.0 {
        return (0.0, 0.0);
    }
    let term = |k: i32| {
        let turn = TAU * f64::from(k);
        2.0 * (-turn * turn * noise / (step * step)).exp() / (turn * turn)
    };
    let whole = step * step / 12.0;
    let common = (step * step * (1..=HARMONICS).map(term).sum::<f64>()).min(whole);
    (common, whole - common)
}

/// The variance of the noise of readings that scatter with this variance after rounding: rounding's own part on top makes it.
pub(super) fn before_rounding(shown: f64, step: f64) -> f64 {
    let (mut low, mut high) = (0.0, shown);
    if shown > 0.5 * step * step {
        return shown - step * step / 12.0;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if middle + rounding(middle, step).1 < shown { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The two parts of rounding, of noise known before, by a sum over all phases of the mean and all steps.
    #[test]
    fn noise_before_rounding_comes_back_from_the_scatter_after_it() {
        for sigma in [0.03, 0.1, 0.2, 0.4, 0.7, 2.0] {
            let phases = 400;
            let (mut own, mut common) = (0.0, 0.0);
            for k in 0..phases {
                let phase = (f64::from(k) + 0.5) / f64::from(phases) - 0.5;
                // Midpoint rule over the noise.
                let (mut weight, mut mean, mut square) = (0.0, 0.0, 0.0);
                for j in -4000..4000 {
                    let x = (f64::from(j) + 0.5) / 500.0;
                    let (w, read) = ((-0.5 * x * x).exp(), (phase + sigma * x).round());
                    (weight, mean, square) = (weight + w, mean + w * read, square + w * read * read);
                }
                let (mean, square) = (mean / weight, square / weight);
                own += (square - mean * mean) / f64::from(phases);
                common += (mean - phase).powi(2) / f64::from(phases);
            }
            let (found_common, found_own) = rounding(sigma * sigma, 1.0);
            assert!((found_common - common).abs() < 2e-4, "{sigma}: {found_common} {common}");
            assert!((sigma * sigma + found_own - own).abs() < 2e-3 * own.max(0.1), "{sigma}: {found_own} {own}");
            let back = before_rounding(own, 1.0).sqrt();
            assert!((back / sigma - 1.0).abs() < 0.02, "{sigma}: {back}");
        }
    }
}
