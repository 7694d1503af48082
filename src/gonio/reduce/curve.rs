//! A curve through the variances of repeats, how well it is known at a signal, and limits where it is not.

use nalgebra::{Matrix3, Vector3};

use super::stops::Repeats;
use crate::gonio::instrument::Instrument;
use crate::numeric::stats::{chi_square_p, normal_quantile, student_quantile};

/// Degrees of freedom that a curve needs, and that it must have at a signal to be taken there.
const LEAST_FREEDOM: f64 = 12.0;
const DETERMINED: f64 = 8.0;
/// About how many steps of the signal repeats are put together in.
const BINS: f64 = 64.0;
/// Rounds of the ascent to the most likely curve; they take a millisecond.
const ROUNDS: usize = 4000;
/// Probability of repeats that belong to no curve, and rounds of leaving such out.
const STRAYED: f64 = 1e-9;
const SIEVES: usize = 5;
/// How many times its mean the square of a walk may be.
const WALKS: f64 = 25.0;
/// By which factor a signal may lie beside all that was repeated and still be like them.
const ALIKE: f64 = 1.5;
/// Eigenvalue of the scaled information below which a direction is open.
const OPEN: f64 = 1e-9;

/// Repeats about one signal.
#[derive(Debug, Clone, Copy)]
struct Point {
    signal: f64,
    variance: f64,
    /// What described drift has of it.
    walked: f64,
    freedom: f64,
}

/// Repeats put together by their signal, all steps about as sure.
fn binned(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_by(|a, b| a.signal.total_cmp(&b.signal));
    let most = points.iter().map(|p| p.freedom).sum::<f64>() / BINS;
    let mut bins: Vec<Point> = Vec::new();
    for point in points {
        match bins.last_mut() {
            Some(bin) if bin.freedom + point.freedom <= most => {
                let freedom = bin.freedom + point.freedom;
                let mean = |a: f64, b: f64| (bin.freedom * a + point.freedom * b) / freedom;
                *bin = Point {
                    signal: mean(bin.signal, point.signal),
                    variance: mean(bin.variance, point.variance),
                    walked: mean(bin.walked, point.walked),
                    freedom,
                };
            }
            _ => bins.push(point),
        }
    }
    bins
}

/// Variance of a reading over its signal above the blank.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    /// a, b and c, of the signal over `scale`.
    parts: Vector3<f64>,
    scale: f64,
    pub freedom: f64,
    /// Fisher information of a, b and c, scaled to a diagonal of ones: eigenvalues, eigenvectors, and the scale.
    information: (Vector3<f64>, Matrix3<f64>, Vector3<f64>),
    /// Upper limits of the variance at the signals that were repeated.
    pub levels: Vec<(f64, f64)>,
}

impl Curve {
    /// Through all repeats but those that stray.
    pub fn through(all: &[(f64, &Repeats)], step: f64, instrument: &Instrument) -> Result<Self, String> {
        let mut kept: Vec<(Point, &Repeats)> = all
            .iter()
            .filter(|(_, r)| r.count > 1)
            .map(|(signal, r)| {
                let (variance, walked) = (r.scatter, r.walked(instrument));
                (Point { signal: *signal, variance, walked, freedom: r.count as f64 - 1.0 }, *r)
            })
            .collect();
        let freedom = |kept: &[(Point, &Repeats)]| kept.iter().map(|k| k.0.freedom).fold(0.0, |a, b| a + b);
        for _ in 0..SIEVES {
            if freedom(&kept) < LEAST_FREEDOM {
                break;
            }
            let curve = Self::of(&binned(kept.iter().map(|k| k.0).collect()))?;
            let before = kept.len();
            kept.retain(|(point, r)| {
                curve.at(point.signal).is_some_and(|(noise, _)| !has_strayed(noise, step, r, instrument))
            });
            if kept.len() == before {
                return Ok(curve);
            }
        }
        let freedom = freedom(&kept);
        if freedom < LEAST_FREEDOM {
            return Err(format!(
                "expected {LEAST_FREEDOM} repeats at least beyond the first of their stop, found {freedom}"
            ));
        }
        Self::of(&binned(kept.iter().map(|k| k.0).collect()))
    }

    /// The most likely one, by steps that never make it less so (Dikmen, Yang & Oja 2015, β = 0: θ ← θ √(Σ ν x s²/m² ⁄ Σ ν x/m)).
    fn of(points: &[Point]) -> Result<Self, String> {
        let freedom: f64 = points.iter().map(|p| p.freedom).sum();
        let mean = points.iter().map(|p| p.freedom * p.variance).sum::<f64>() / freedom;
        if mean <= 0.0 {
            return Err("repeats are equal to their last digit".into());
        }
        if !mean.is_finite() {
            return Err("repeats scatter beyond any number".into());
        }
        let scale = points.iter().map(|p| p.signal).fold(0.0, f64::max);
        let information = (Vector3::zeros(), Matrix3::zeros(), Vector3::zeros());
        let start = if scale > 0.0 { Vector3::repeat(mean / 3.0) } else { Vector3::new(mean, 0.0, 0.0) };
        let mut curve = Self { parts: start, scale, freedom, information, levels: Vec::new() };
        for _ in 0..ROUNDS {
            let before = curve.parts;
            curve.step(points);
            if (curve.parts - before).amax() <= 1e-9 * curve.parts.amax() {
                break;
            }
        }
        curve.know(points);
        Ok(curve)
    }

    fn step(&mut self, points: &[Point]) {
        let (mut up, mut down) = (Vector3::zeros(), Vector3::zeros());
        for point in points {
            let (x, model) = (self.terms(point.signal), self.model(point.signal) + point.walked);
            if model > 0.0 {
                up += x * (point.freedom * (point.variance / model) / model);
                down += x * (point.freedom / model);
            }
        }
        for k in 0..3 {
            if down[k] > 0.0 {
                self.parts[k] *= (up[k] / down[k]).sqrt();
            }
        }
    }

    /// Works out how well it is known, and the limits at what was repeated.
    fn know(&mut self, points: &[Point]) {
        let mut all = Matrix3::zeros();
        for point in points {
            let (x, model) = (self.terms(point.signal), self.model(point.signal) + point.walked);
            if model > 0.0 {
                let x = x / model;
                all += x * x.transpose() * (0.5 * point.freedom);
            }
        }
        let scale = all.diagonal().map(|d: f64| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
        let scaled = Matrix3::from_fn(|a, b| all[(a, b)] * scale[a] * scale[b]).symmetric_eigen();
        self.information = (scaled.eigenvalues, scaled.eigenvectors, scale);
        let limit = |p: &Point| (p.signal, self.model(p.signal) + normal_quantile(0.95) * self.error(p.signal));
        self.levels = points.iter().map(limit).filter(|l| l.1.is_finite()).collect();
    }

    /// Standard error of the variance at a signal; infinite where the curve is open there.
    fn error(&self, signal: f64) -> f64 {
        let (values, vectors, scale) = &self.information;
        let x = self.terms(signal).component_mul(scale);
        let is_open = self.terms(signal).iter().zip(scale).any(|(term, scale)| *term > 0.0 && *scale == 0.0);
        let along = vectors.transpose() * x;
        let part = |k: usize| match values[k] > OPEN {
            true => along[k] * along[k] / values[k],
            false if along[k].abs() > OPEN.sqrt() * x.norm() => f64::INFINITY,
            false => 0.0,
        };
        if is_open { f64::INFINITY } else { (0..3).map(part).sum::<f64>().sqrt() }
    }

    fn terms(&self, signal: f64) -> Vector3<f64> {
        let x = if self.scale > 0.0 { signal / self.scale } else { 0.0 };
        Vector3::new(1.0, x, x * x)
    }

    fn model(&self, signal: f64) -> f64 {
        self.terms(signal).dot(&self.parts)
    }

    /// The variance that intervals of 1.96 σ need to hold 95 %, and whether it is an upper limit for a signal unlike any that was repeated; none where there
    /// is no number.
    pub fn at(&self, signal: f64) -> Option<(f64, bool)> {
        let (model, error) = (self.model(signal), self.error(signal));
        let freedom = 2.0 * (model / error).powi(2);
        if freedom >= DETERMINED {
            let wide = student_quantile(0.975, freedom) / normal_quantile(0.975);
            return Some((model * wide * wide, false)).filter(|(v, _)| v.is_finite());
        }
        let limit = self.limit(signal).min(model + normal_quantile(0.95) * error);
        let (least, most) = (self.levels.first().map_or(0.0, |l| l.0), self.levels.last().map_or(0.0, |l| l.0));
        let is_unlike = signal < least / ALIKE || signal > ALIKE * most;
        Some((limit, is_unlike)).filter(|(v, _)| v.is_finite())
    }

    /// The largest variance that limits at what was repeated leave a curve whose parts are 0 at least: it is convex, and grows as S² at most.
    fn limit(&self, signal: f64) -> f64 {
        let next = self.levels.partition_point(|l| l.0 < signal);
        match (next.checked_sub(1).map(|k| self.levels[k]), self.levels.get(next)) {
            (None, Some((_, limit))) => *limit,
            (Some((below, at_below)), Some((above, at_above))) => {
                at_below + (signal - below) / (above - below) * (at_above - at_below)
            }
            (_, None) => {
                let from = |(level, limit): &(f64, f64)| limit * (signal / level).powi(2);
                self.levels.iter().filter(|l| l.0 > 0.0).map(from).fold(f64::INFINITY, f64::min)
            }
        }
    }
}

/// Whether these repeats scatter as none by this noise would, by steps, between two of which they may fall either way, and by what walks meanwhile, whose
/// squares scatter widely.
pub(super) fn has_strayed(noise: f64, step: f64, of: &Repeats, instrument: &Instrument) -> bool {
    let count = of.count as f64;
    let (freedom, most) = (count - 1.0, noise + 0.25 * step * step * count / (count - 1.0));
    let scatter = of.scatter - WALKS * of.walked(instrument);
    freedom > 0.0 && scatter > most && chi_square_p(freedom * scatter / most, freedom) < STRAYED
}
