//! Where a sharp lobe stands: the lean of the sample that readings show.
//!
//! Axes' zeros and the sample's tilt move a lobe's peak. A model whose lobe must stand at the mirror direction then fits a lobe that is broader and
//! lower than what is there, and too little would be made of what positions can do. So the lean is fitted too, against what the instrument says of it.

use glam::{DQuat, DVec3};
use nalgebra::{Matrix2, Vector2};

use super::surrogate::Surrogate;
use crate::gonio::{Instrument, lean};
use crate::measurement::{Directions, Measurement, Weights};

/// Fits of lean and material, one after the other.
const ROUNDS: usize = 5;
/// Steps of a difference quotient, and most of a step, in σ of the lean.
const STEP: f64 = 0.1;
const MOST: f64 = 1.5;
/// σ of the lean beyond which highest readings are something else.
const FARTHEST: f64 = 4.5;

/// 1 σ of the lean that the readings of this instrument may have, rad: half of what zeros, tilt and, at 45°, height move a peak by.
pub(super) fn sigma(instrument: &Instrument) -> f64 {
    let (zero, tilt) = (instrument.axes.zero_u_deg.to_radians(), instrument.sample.tilt_u_deg.to_radians());
    let seen_from = |distance: f64| if distance > 0.0 { instrument.sample.height_u_m / distance } else { 0.0 };
    let height = seen_from(instrument.source.distance_m).hypot(seen_from(instrument.detector.distance_m));
    (0.5 * zero * zero + tilt * tilt + 0.125 * height * height).sqrt()
}

/// The readings as a sample with this lean met them.
fn turned(readings: &Measurement, turn: DQuat) -> Measurement {
    let n = readings.len();
    let (wi, wo): (Vec<DVec3>, Vec<DVec3>) =
        (0..n).map(|i| readings.directions.pair(i)).map(|(i, o)| (turn * i, turn * o)).unzip();
    let mut values = readings.values.clone();
    for (k, value) in values.iter_mut().enumerate() {
        let i = k % n;
        if wi[i].z <= 0.0 || wo[i].z <= 0.0 {
            *value = f64::NAN;
        }
    }
    Measurement {
        weights: Weights::SolidAngle((0..n).map(|i| readings.weights.get(i)).collect()),
        sigma: readings.sigma.clone(),
        ..Measurement::new(readings.name.clone(), Directions::List { wi, wo }, readings.channels.clone(), values)
    }
}

/// The model of what is read that `fit` finds once the readings' lean is known; `upright` is the one without. Looked for from no lean and from where the
/// highest readings stand. `matters` says of a model whether a lean counts.
pub(super) fn found(
    readings: &Measurement,
    instrument: &Instrument,
    upright: Surrogate,
    fit: impl Fn(&Measurement) -> Option<Surrogate>,
    matters: impl Fn(&Surrogate) -> bool,
) -> Option<Surrogate> {
    let sigma = sigma(instrument);
    let fitted = |at: [f64; 2]| {
        let model = fit(&turned(readings, lean(at)))?;
        Some(Found { misfit: misfit(readings, &model, at), model, at })
    };
    let upright = Found { misfit: misfit(readings, &upright, [0.0; 2]), model: upright, at: [0.0; 2] };
    let highest = of_highest(readings).filter(|at| at[0].hypot(at[1]) < FARTHEST * sigma).and_then(fitted);
    let follow = |found: Found| found.followed(|found| fitted(stepped(readings, &found.model, found.at, sigma)));
    let starts = [Some(upright), highest].into_iter().flatten();
    let ends = starts.map(|found| if matters(&found.model) { follow(found) } else { found });
    ends.min_by(|a, b| a.misfit.total_cmp(&b.misfit)).map(|found| found.model)
}

/// A lean, the model that goes with it, and the sum of squares that they leave.
struct Found {
    at: [f64; 2],
    model: Surrogate,
    misfit: f64,
}

impl Found {
    /// After steps, as long as each is a better one.
    fn followed(mut self, step: impl Fn(&Self) -> Option<Self>) -> Self {
        for _ in 0..ROUNDS {
            match step(&self) {
                Some(next) if next.misfit < self.misfit => self = next,
                _ => break,
            }
        }
        self
    }
}

/// The lean of the directions half-way between source and detector at readings above half of the highest, by value.
fn of_highest(readings: &Measurement) -> Option<[f64; 2]> {
    let value = |i: usize| (0..readings.channels.len()).filter_map(|c| readings.value(c, i)).fold(0.0, f64::max);
    let highest = (0..readings.len()).map(value).fold(0.0, f64::max);
    let mut normal = DVec3::ZERO;
    for i in (0..readings.len()).filter(|i| value(*i) > 0.5 * highest) {
        let (wi, wo) = readings.directions.pair(i);
        normal += value(i) * (wi + wo).normalize_or_zero();
    }
    // The frame turns that direction to the pole.
    let normal = normal.try_normalize()?;
    Some([normal.x, normal.y])
}

/// What the model reads at a pair of directions; nothing below the horizon.
fn value(model: &Surrogate, (wi, wo): (DVec3, DVec3), width: usize) -> Vec<f64> {
    let mut out = vec![0.0; width];
    if wi.z > 0.0 && wo.z > 0.0 {
        model.write_value(wi, wo, &mut out);
    }
    out
}

/// Residual, and its slopes by the lean, of every valid value.
fn rows<'a>(
    readings: &'a Measurement,
    model: &'a Surrogate,
    at: [f64; 2],
    step: f64,
) -> impl Iterator<Item = (f64, Vector2<f64>)> + 'a {
    let width = readings.channels.len();
    let frames =
        [[0.0, 0.0], [step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]].map(|[x, y]| lean([at[0] + x, at[1] + y]));
    (0..readings.len()).flat_map(move |i| {
        let (wi, wo) = readings.directions.pair(i);
        let values = frames.map(|turn| value(model, (turn * wi, turn * wo), width));
        (0..width).filter_map(move |c| {
            let slope = |k: usize| (values[k][c] - values[k + 1][c]) / (2.0 * step);
            Some((readings.value(c, i)? - values[0][c], Vector2::new(slope(1), slope(3))))
        })
    })
}

/// Sum of squares.
fn misfit(readings: &Measurement, model: &Surrogate, at: [f64; 2]) -> f64 {
    let (width, turn) = (readings.channels.len(), lean(at));
    let of = |i: usize| {
        let (wi, wo) = readings.directions.pair(i);
        let read = value(model, (turn * wi, turn * wo), width);
        (0..width).filter_map(move |c| Some((readings.value(c, i)? - read[c]).powi(2)))
    };
    (0..readings.len()).flat_map(of).sum()
}

/// The lean after one Gauss–Newton step, with the prior that it is 0 ± σ.
fn stepped(readings: &Measurement, model: &Surrogate, at: [f64; 2], sigma: f64) -> [f64; 2] {
    let (mut normal, mut right, mut squares, mut count) = (Matrix2::zeros(), Vector2::zeros(), 0.0, 0.0);
    for (residual, slope) in rows(readings, model, at, STEP * sigma) {
        normal += slope * slope.transpose();
        right += slope * residual;
        squares += residual * residual;
        count += 1.0;
    }
    let prior = squares / f64::max(count - 4.0, 1.0) / (sigma * sigma);
    let system = normal + Matrix2::identity() * prior;
    let step = system.cholesky().map_or(Vector2::zeros(), |c| c.solve(&(right - prior * Vector2::from(at))));
    let shortened = step * (MOST * sigma / step.norm()).min(1.0);
    [at[0] + shortened.x, at[1] + shortened.y]
}
