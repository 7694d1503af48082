//! The noise of readings: as the description says it, or as repeats scatter (GUM type A).
//!
//! A few repeats tell little of their own noise, all of a log together much: their variances follow a + b S + c S² of the signal S (electronics, shot
//! noise, a source that flickers), a, b, c ≥ 0, most likely where each s² is a share of χ² with its own degrees of freedom (Janesick, *Photon
//! Transfer*, 2007, has the same curve for detectors).

use std::fmt::Write as _;

use crate::gonio::effects::quantisation::step;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::numeric::stats::{normal_quantile, student_quantile};

use super::stops::{Repeats, Summary};

/// Degrees of freedom that a curve needs, and steps of the signal that repeats are put together in.
const LEAST_FREEDOM: f64 = 12.0;
const BINS: usize = 64;
/// Rounds of the ascent to the most likely curve, each of 64 steps at most; they take a millisecond.
const ROUNDS: usize = 4000;
/// By how much repeats may scatter more than described, and of that scatter's own σ, before it is said.
const TOLERATED: f64 = 1.2;
const SURE: f64 = 5.0;

/// What is known of the noise of one reading.
pub(super) enum Noise {
    /// Shot noise of what is above the electronics' offset, at least one electron's worth, and the electronics' variance.
    Described { read: f64, offset: f64 },
    /// Curves of the channels, and the degrees of freedom behind the least sure one.
    Scattered { curves: Vec<Curve>, freedom: f64 },
    /// Nothing, and why.
    Unknown(String),
}

impl Noise {
    /// What description and repeats tell.
    pub fn of(raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Self {
        if instrument.is_noisy() {
            return Self::Described { read: instrument.read_noise.powi(2), offset: instrument.detector.offset };
        }
        let (mut curves, mut least) = (Vec::new(), f64::INFINITY);
        for (c, channel) in raw.channels.iter().enumerate() {
            let points = binned(summaries.iter().filter_map(|s| s.repeats[c].as_ref()));
            let freedom = points.iter().map(|p| p.freedom).fold(0.0, |a, b| a + b);
            if freedom < LEAST_FREEDOM {
                return Self::Unknown(format!(
                    "expected {LEAST_FREEDOM} repeats at least beyond the first of their stop, found {freedom} in channel {channel}"
                ));
            }
            let Some(curve) = Curve::through(&points, freedom) else {
                return Self::Unknown(format!("repeats of channel {channel} are equal to their last digit"));
            };
            curves.push(curve);
            least = least.min(freedom);
        }
        Self::Scattered { curves, freedom: least }
    }

    /// Variance of one reading; 0 where nothing is known.
    pub fn variance(&self, channel: usize, signal: f64) -> f64 {
        match self {
            Self::Described { read, offset } => (signal - offset).max(1.0) + read,
            Self::Scattered { curves, .. } => curves[channel].at(signal),
            Self::Unknown(_) => 0.0,
        }
    }

    /// Whether there is anything to state.
    pub fn is_known(&self) -> bool {
        !matches!(self, Self::Unknown(_))
    }

    /// Where it comes from, for the measurement's origin; nothing where it was described.
    pub fn said(&self) -> String {
        match self {
            Self::Scattered { freedom, .. } => {
                format!(", their noise from the scatter of repeats ({freedom} degrees of freedom)")
            }
            _ => String::new(),
        }
    }

    /// What a user must know of it.
    pub fn note(&self, raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Option<String> {
        match self {
            Self::Described { .. } => self.excess(raw, summaries, instrument),
            Self::Scattered { .. } => None,
            Self::Unknown(why) => Some(format!(
                "σ is not stated: the detector's noise is not described (instrument.electrons = 0) and repeats don't tell it: {why}"
            )),
        }
    }

    /// Says so where repeats scatter clearly more than described.
    fn excess(&self, raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Option<String> {
        let (mut sum, mut freedom, mut worst) = (0.0, 0.0, (0.0, 0, 0.0));
        for summary in summaries {
            for (c, of) in summary.repeats.iter().enumerate().filter_map(|(c, r)| Some((c, r.as_ref()?))) {
                let own = of.count as f64 - 1.0;
                let ratio = of.scatter / self.expected(c, of, summary.seconds, instrument);
                sum += own * ratio;
                freedom += own;
                if own > 0.0 && ratio > worst.0 {
                    worst = (ratio, c, summary.time_s);
                }
            }
        }
        let ratio = sum / freedom;
        let is_sure = ratio > TOLERATED * TOLERATED && ratio - 1.0 > SURE * (2.0 / freedom).sqrt();
        is_sure.then(|| {
            let mut text = format!(
                "repeats scatter {:.1} times as far as the description says (electrons, read_noise, drift): σ is too small by that where noise leads",
                ratio.sqrt()
            );
            // Writing to a String can't fail.
            let _ = write!(text, "; most at {} s, channel {}, {:.1} times", worst.2, raw.channels[worst.1], worst.0.sqrt());
            text
        })
    }

    /// Variance that repeats of a stop of so many seconds should scatter by: noise, rounding, and at most what source and dark walk meanwhile.
    fn expected(&self, channel: usize, of: &Repeats, seconds: f64, instrument: &Instrument) -> f64 {
        let hours = seconds / 3600.0;
        let walk = (of.signal * instrument.source.drift_per_sqrt_hour).powi(2)
            + (of.exposure_s * instrument.detector.dark_drift_per_sqrt_hour).powi(2);
        self.variance(channel, of.signal) + step(&instrument.detector).powi(2) / 12.0 + walk * hours
    }
}

/// Repeats about one signal.
#[derive(Debug, Clone, Copy)]
struct Point {
    signal: f64,
    variance: f64,
    freedom: f64,
}

/// Repeats put together by their signal, all steps about as sure.
fn binned<'a>(all: impl Iterator<Item = &'a Repeats>) -> Vec<Point> {
    let mut points: Vec<Point> = all
        .filter(|r| r.count > 1)
        .map(|r| Point { signal: r.signal.max(0.0), variance: r.scatter, freedom: r.count as f64 - 1.0 })
        .collect();
    points.sort_by(|a, b| a.signal.total_cmp(&b.signal));
    let most = points.iter().map(|p| p.freedom).sum::<f64>() / BINS as f64;
    let mut bins: Vec<Point> = Vec::new();
    for point in points {
        match bins.last_mut() {
            Some(bin) if bin.freedom + point.freedom <= most => {
                let freedom = bin.freedom + point.freedom;
                let mean = |a: f64, b: f64| (bin.freedom * a + point.freedom * b) / freedom;
                let (signal, variance) = (mean(bin.signal, point.signal), mean(bin.variance, point.variance));
                *bin = Point { signal, variance, freedom };
            }
            _ => bins.push(point),
        }
    }
    bins
}

/// Variance of a reading over its signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Curve {
    /// a, b and c, of the signal over `scale`.
    parts: [f64; 3],
    scale: f64,
}

impl Curve {
    /// The most likely one, by steps that never make it less so (Dikmen, Yang & Oja 2015, β = 0: θ ← θ √(Σ ν x s²/m² ⁄ Σ ν x/m)). Its variances are as much
    /// larger as Student's quantile of a third of the degrees of freedom is than the normal one: intervals of 1.96 σ then hold 95 %.
    fn through(points: &[Point], freedom: f64) -> Option<Self> {
        let mean = points.iter().map(|p| p.freedom * p.variance).sum::<f64>() / freedom;
        if mean <= 0.0 {
            return None;
        }
        let scale = Some(points.iter().map(|p| p.signal).fold(0.0, f64::max)).filter(|s| *s > 0.0).unwrap_or(1.0);
        let mut curve = Self { parts: [mean / 3.0; 3], scale };
        for _ in 0..ROUNDS {
            let before = curve.parts;
            let (mut up, mut down) = ([0.0; 3], [0.0; 3]);
            for point in points {
                let model = curve.at(point.signal);
                for (k, x) in curve.terms(point.signal).into_iter().enumerate() {
                    up[k] += point.freedom * x * (point.variance / model) / model;
                    down[k] += point.freedom * x / model;
                }
            }
            for k in 0..3 {
                if down[k] > 0.0 {
                    curve.parts[k] *= (up[k] / down[k]).sqrt();
                }
            }
            let largest = curve.parts.iter().fold(0.0, |a, b| f64::max(a, *b));
            if curve.parts.iter().zip(before).all(|(a, b)| (a - b).abs() <= 1e-9 * largest) {
                break;
            }
        }
        let wide = (student_quantile(0.975, freedom / 3.0) / normal_quantile(0.975)).powi(2);
        curve.parts.iter_mut().for_each(|p| *p *= wide);
        Some(curve)
    }

    fn terms(&self, signal: f64) -> [f64; 3] {
        let x = signal.max(0.0) / self.scale;
        [1.0, x, x * x]
    }

    fn at(&self, signal: f64) -> f64 {
        // A part that fell to nothing leaves no variance at all at the signal 0.
        let of: f64 = self.terms(signal).into_iter().zip(self.parts).map(|(x, part)| x * part).sum();
        of.max(f64::MIN_POSITIVE)
    }
}
