//! What a pixel gathers: sums for the mean of its samples and for the error of that.

use glam::DVec3;

use super::integrator::PathResult;
use crate::numeric::float::sqrt_nonneg;
use crate::numeric::random::{Purpose, Stream, stream};

/// What one pixel has gathered. Sums are taken about the first sample, so that the variance of nearly equal samples, or of
/// samples of 10²⁰, keeps its digits.
#[derive(Debug, Clone)]
pub(super) struct Pixel {
    pub rng: Stream,
    pub samples: u32,
    /// Sum of the paths' unknown shares.
    pub unknown: f64,
    first: DVec3,
    sum: DVec3,
    squares: DVec3,
}

impl Pixel {
    pub fn new(seed: u64, index: u64) -> Self {
        let rng = stream(seed, Purpose::Pixel, index);
        Self { rng, samples: 0, unknown: 0.0, first: DVec3::ZERO, sum: DVec3::ZERO, squares: DVec3::ZERO }
    }

    pub fn add(&mut self, path: &PathResult) {
        if self.samples == 0 {
            self.first = path.radiance;
        }
        let d = path.radiance - self.first;
        self.sum += d;
        self.squares += d * d;
        self.samples += 1;
        self.unknown += path.unknown;
    }

    pub fn mean(&self) -> DVec3 {
        if self.samples == 0 { DVec3::ZERO } else { self.first + self.sum / f64::from(self.samples) }
    }

    pub fn standard_error(&self) -> DVec3 {
        let n = f64::from(self.samples);
        if n < 2.0 {
            return DVec3::INFINITY;
        }
        let mean = self.sum / n;
        let variance = (self.squares - n * mean * mean) / (n - 1.0);
        // Round-off of the squares can reach below 0; NaN stays NaN.
        DVec3::from_array(variance.to_array().map(|v| sqrt_nonneg(v.clamp(0.0, f64::INFINITY) / n)))
    }
}
