//! What one more trial of a setting will be like, from those that were made.

use serde::Serialize;

use crate::numeric::estimate::LogScatter;
use crate::tradeoff::curve::{Curve, Point};

/// What is to be expected of one more trial, and what it stays below with probability 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Forecast {
    /// The mean of the logarithms' own.
    pub expected: f64,
    /// The limit.
    pub at_most: f64,
}

/// How trials of all settings of a curve scatter, where all their values are above 0.
pub(super) fn scatter(curve: &Curve, of: &dyn Fn(&Point) -> Vec<f64>) -> LogScatter {
    let mut scatter = LogScatter::default();
    for point in &curve.points {
        let values = of(point);
        if values.iter().all(|v| *v > 0.0) {
            scatter.add(&values.iter().map(|v| v.ln()).collect::<Vec<_>>());
        }
    }
    scatter
}

/// Of one more value like these; an error that is 0 throughout stays so.
pub(super) fn forecast(scatter: &LogScatter, values: &[f64]) -> Option<Forecast> {
    if !values.is_empty() && values.iter().all(|v| *v == 0.0) {
        return Some(Forecast { expected: 0.0, at_most: 0.0 });
    }
    let n = values.len();
    let mean = values.iter().map(|v| v.ln()).sum::<f64>() / n as f64;
    let at_most = scatter.upper_limit(mean, n).filter(|_| n > 0 && mean.is_finite())?;
    Some(Forecast { expected: mean.exp(), at_most })
}
