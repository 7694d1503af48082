//! Noise as repeats scatter (GUM type A).
//!
//! A few repeats tell little of their own noise, all of a log together much: their variances follow a + b S + c S² of the signal S above the blank
//! (electronics, shot noise, a source that flickers), a, b, c ≥ 0, most likely where each s² is a share of χ² with its own degrees of freedom (Janesick,
//! *Photon Transfer*, 2007, has the same curve for detectors). How well the curve is known at a signal says its Fisher information: intervals are as much wider as
//! Student's t of so many degrees of freedom asks for. Where that is too few, of signals unlike any that was repeated, an upper limit takes its
//! place: with a, b, c ≥ 0 the variance is convex, and grows as S² at most.

use super::curve::{Curve, has_strayed};
use super::stops::{Repeats, Summary, are_same};
use crate::control::counted;
use crate::gonio::effects::quantisation::step;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::reading::Kind;

/// Stops that read the same largest signal.
const CLIPPED: usize = 3;
/// How many times the largest repeated signal more than half of the sample's may be.
const FAR: f64 = 10.0;

/// The noise of all channels.
pub(super) struct Scatter(Vec<Channel>);

struct Channel {
    curve: Curve,
    /// Mean signal of blank or dark, by exposure.
    base: Vec<(f64, f64)>,
    /// The smallest step between two signals, or what is described.
    step: f64,
}

impl Scatter {
    /// What repeats tell.
    ///
    /// # Errors
    /// What is missing.
    pub fn of(raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Result<Self, String> {
        let of = |(c, name): (usize, &String)| {
            let base = base(summaries, c);
            let all: Vec<(f64, &Repeats)> =
                summaries.iter().filter_map(|s| s.repeats[c].as_ref()).map(|r| (net(&base, r), r)).collect();
            let described = step(&instrument.detector);
            let step = if described > 0.0 { described } else { smallest_step(raw, c) };
            let said = |why: String| format!("{why} in channel {name}");
            let curve = Curve::through(&all, step, instrument).map_err(said)?;
            // Repeats of such signals that never differ tell no noise, and no step does.
            let untold = all.iter().find(|(signal, _)| curve.at(*signal).is_none_or(|(noise, _)| noise + step <= 0.0));
            if let Some((signal, _)) = untold {
                return Err(said(format!("signals of {signal:.3e} above the blank have none")));
            }
            let far = FAR * curve.levels.iter().map(|l| l.0).fold(0.0, f64::max);
            let samples = || repeats_of(Kind::Sample, summaries, c).map(|r| net(&base, r));
            if 2 * samples().filter(|s| *s > far).count() > samples().count() {
                return Err(format!(
                    "most signals of the sample are above {far:.3e} in channel {name}, {FAR} times the largest that was repeated"
                ));
            }
            Ok(Channel { curve, base, step })
        };
        raw.channels.iter().enumerate().map(of).collect::<Result<_, _>>().map(Self)
    }

    /// Variance of one of these repeats, which the curve was made for.
    pub fn variance(&self, channel: usize, of: &Repeats, instrument: &Instrument) -> f64 {
        let Channel { curve, base, step } = &self.0[channel];
        let noise = curve.at(net(base, of)).map_or(f64::NAN, |found| found.0);
        if has_strayed(noise, *step, of, instrument) { of.scatter.max(noise) } else { noise }
    }

    /// Smallest step between signals.
    pub fn step(&self, channel: usize) -> f64 {
        self.0[channel].step
    }

    /// Degrees of freedom of the channel that has least.
    pub fn freedom(&self) -> f64 {
        self.0.iter().map(|c| c.curve.freedom).fold(f64::INFINITY, f64::min)
    }

    /// Where σ is an upper limit, and where repeats scatter as none of the others do.
    pub fn notes(&self, raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Vec<String> {
        let (mut limits, mut strayed, mut worst) = (0, 0, (0.0, String::new()));
        for summary in summaries {
            for (c, Channel { curve, base, step }) in self.0.iter().enumerate() {
                let Some((repeats, found)) =
                    summary.repeats[c].as_ref().and_then(|r| Some((r, curve.at(net(base, r))?)))
                else {
                    continue;
                };
                limits += usize::from(summary.kind == Kind::Sample && found.1);
                if has_strayed(found.0, *step, repeats, instrument) {
                    strayed += 1;
                    let ratio = repeats.scatter / found.0;
                    if ratio > worst.0 {
                        worst = (ratio, format!("{} s, channel {}", summary.time_s, raw.channels[c]));
                    }
                }
            }
        }
        let limit = (limits > 0).then(|| {
            format!(
                "σ of {} is an upper limit: no signal like theirs was repeated, and noise is taken to grow as the signal at most",
                counted(limits as u64, "reading")
            )
        });
        let stray = (strayed > 0).then(|| {
            format!(
                "repeats scatter far more than the others at {strayed} of the stops, most at {}, {:.1} times as far: their σ is their own scatter",
                worst.1,
                worst.0.sqrt()
            )
        });
        limit.into_iter().chain(stray).chain(clipped(raw, summaries)).collect()
    }
}

/// All repeats of a kind in one channel.
fn repeats_of(kind: Kind, summaries: &[Summary], c: usize) -> impl Iterator<Item = &Repeats> {
    summaries.iter().filter(move |s| s.kind == kind).filter_map(move |s| s.repeats[c].as_ref())
}

/// Says so where several stops read the largest signal of the log to its last digit: a detector that takes no more, most likely.
fn clipped(raw: &Raw, summaries: &[Summary]) -> Option<String> {
    let of = |c: usize| {
        let samples = || repeats_of(Kind::Sample, summaries, c);
        let most = samples().map(|r| r.signal).fold(f64::NEG_INFINITY, f64::max);
        let count = samples().filter(|r| r.signal == most && r.scatter == 0.0).count();
        (count >= CLIPPED).then(|| {
            format!(
                "{count} stops read {most}, the largest signal of channel {}: if the detector takes no more, say so (instrument.detector.full_well), or write inf",
                raw.channels[c]
            )
        })
    };
    (0..raw.channels.len()).find_map(of)
}

/// Mean signal of the blank, else of the dark, by exposure.
fn base(summaries: &[Summary], c: usize) -> Vec<(f64, f64)> {
    let of = |kind: Kind| {
        let mut sums: Vec<(f64, f64, f64)> = Vec::new();
        for r in repeats_of(kind, summaries, c) {
            let count = r.count as f64;
            match sums.iter_mut().find(|s| are_same(s.0, r.exposure_s)) {
                Some(sum) => (sum.1, sum.2) = (sum.1 + count * r.signal, sum.2 + count),
                None => sums.push((r.exposure_s, count * r.signal, count)),
            }
        }
        sums.into_iter().map(|(exposure, sum, count)| (exposure, sum / count)).collect::<Vec<_>>()
    };
    Some(of(Kind::Blank)).filter(|b| !b.is_empty()).unwrap_or_else(|| of(Kind::Dark))
}

/// The signal above the base of its exposure, else of the nearest; 0 at least.
fn net(base: &[(f64, f64)], of: &Repeats) -> f64 {
    let far = |b: &&(f64, f64)| (b.0 / of.exposure_s).ln().abs();
    let under = base.iter().min_by(|a, b| far(a).total_cmp(&far(b))).map_or(0.0, |b| b.1);
    (of.signal - under).max(0.0)
}

/// The smallest difference between two signals of a channel: the converter's step, or what the log's digits leave of it.
fn smallest_step(raw: &Raw, c: usize) -> f64 {
    let mut all: Vec<f64> = (0..raw.readings.len()).map(|i| raw.signals(i)[c]).filter(|s| s.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let largest = all.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    // Digits beyond those of a number don't tell.
    let apart = all.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-14 * largest);
    Some(apart.fold(f64::INFINITY, f64::min)).filter(|d| d.is_finite()).unwrap_or(0.0)
}
