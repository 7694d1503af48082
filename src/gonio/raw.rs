//! Raw readings: what the instrument wrote down, before anything is made of it.

use super::instrument::Instrument;
use super::reading::{Kind, Reading};
use super::reduce::saturation_limit;
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
    /// What a user must know: where the readings end before all were made.
    pub notes: Vec<String>,
}

impl Raw {
    /// Whether the reference was read, and no reading of it by this instrument is safe from saturation.
    #[must_use]
    pub fn reference_saturates(&self, instrument: &Instrument) -> bool {
        let limit = saturation_limit(instrument);
        let of_reference = |i: &usize| self.readings[*i].kind == Kind::Reference;
        let mut signals = (0..self.readings.len()).filter(of_reference).flat_map(|i| self.signals(i)).peekable();
        signals.peek().is_some() && signals.all(|signal| *signal >= limit)
    }

    /// Signals of reading `i`, channel by channel.
    #[must_use]
    pub fn signals(&self, i: usize) -> &[f64] {
        let width = self.channels.len();
        &self.signal[i * width..(i + 1) * width]
    }
}

#[cfg(test)]
impl Raw {
    /// One channel, and no reading.
    pub(in crate::gonio) fn nothing_read() -> Self {
        Self {
            channels: vec!["y".into()],
            dimension: Dimension::Space,
            directions: Directions::List { wi: vec![], wo: vec![] },
            weights: Weights::Uniform,
            readings: vec![],
            signal: vec![],
            quadrature_error: 0.0,
            notes: vec![],
        }
    }
}
