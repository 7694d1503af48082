//! What a pixel gathers: sums for the mean of its samples and for the error of that.

use glam::DVec3;

use super::integrator::PathResult;
use super::points::half_of;

/// What one pixel has gathered. Sums are taken about the first sample, so that the variance of nearly equal samples, or of
/// samples of 10²⁰, keeps its digits.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pixel {
    pub samples: u32,
    /// Sum of the paths' unknown shares.
    pub unknown: f64,
    first: DVec3,
    /// By halves, which know nothing of each other ([`super::points`]).
    sums: [DVec3; 2],
    squares: DVec3,
}

impl Pixel {
    pub fn add(&mut self, path: &PathResult) {
        if self.samples == 0 {
            self.first = path.radiance;
        }
        let d = path.radiance - self.first;
        self.sums[half_of(self.samples)] += d;
        self.squares += d * d;
        self.samples += 1;
        self.unknown += path.unknown;
    }

    pub fn mean(&self) -> DVec3 {
        if self.samples == 0 { DVec3::ZERO } else { self.first + self.sum() / f64::from(self.samples) }
    }

    /// Variance that the mean would have if samples knew nothing of each other; infinite below two samples.
    pub fn scatter(&self) -> DVec3 {
        let n = f64::from(self.samples);
        if n < 2.0 {
            return DVec3::INFINITY;
        }
        let mean = self.sum() / n;
        let variance = (self.squares - n * mean * mean) / (n - 1.0);
        // Round-off of the squares can reach below 0; NaN stays NaN.
        DVec3::from_array(variance.to_array().map(|v| v.clamp(0.0, f64::INFINITY) / n))
    }

    /// A number whose expected value is the mean's variance, whatever samples of one half know of each other: from the halves'
    /// difference, so it scatters as χ² of one degree of freedom. Infinite below two samples.
    pub fn disagreement(&self) -> DVec3 {
        let n = f64::from(self.samples);
        if n < 2.0 {
            return DVec3::INFINITY;
        }
        let second = f64::from(self.samples / 2);
        let d = self.sums[0] / (n - second) - self.sums[1] / second;
        // Var(d) = σ²/n₁ + σ²/n₂ where that of the mean is σ²/n.
        d * d * ((n - second) * second / (n * n))
    }

    fn sum(&self) -> DVec3 {
        self.sums[0] + self.sums[1]
    }
}
