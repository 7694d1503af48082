//! Raw readings: what the instrument wrote down, before anything is made of it.

use super::reading::Reading;
use crate::measurement::{Dimension, Directions, Weights};

/// Readings in order of time, all channels each.
#[derive(Debug, Clone, PartialEq)]
pub struct Raw {
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Flat world or space.
    pub dimension: Dimension,
    /// The pairs of directions that readings of the sample belong to.
    pub directions: Directions,
    /// What each of them stands for.
    pub weights: Weights,
    /// The readings.
    pub readings: Vec<Reading>,
    /// Signals, all channels of a reading together: electrons where the instrument is simulated, any unit where it is real. NaN where nothing
    /// was read.
    pub signal: Vec<f64>,
    /// Largest relative change that the last refinement of a mean over source and aperture brought; 0 where there was none, and for real readings.
    pub quadrature_error: f64,
}

impl Raw {
    /// Signals of reading `i`, channel by channel.
    #[must_use]
    pub fn signals(&self, i: usize) -> &[f64] {
        let width = self.channels.len();
        &self.signal[i * width..(i + 1) * width]
    }
}
