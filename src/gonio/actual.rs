//! What one simulated instrument is really like: a draw of everything that its description leaves uncertain.

use rand_distr::{Distribution, StandardNormal};

use super::instrument::Instrument;
use super::reading::Reading;
use crate::measurement::Dimension;
use crate::numeric::random::{Purpose, Stream, stream};

/// Errors of one instrument, the same in all its readings, and the walks of what drifts.
#[derive(Debug, Clone, PartialEq)]
pub struct Actual {
    /// Errors of the zeros of θi, φi, θo, φo, rad.
    pub zeros: [f64; 4],
    /// Tilt of the normal towards +x and +y, rad.
    pub tilt: [f64; 2],
    /// Height of the surface over the axes' crossing, m.
    pub height_m: f64,
    /// Relative error of the reference's certificate: its true reflectance over the stated one, less 1.
    pub certificate: f64,
    /// Relative nonlinearity at full well.
    pub nonlinearity: f64,
    /// Relative errors of the exposure times, in their order; empty for none.
    pub exposures: Vec<f64>,
    /// Source power over its first, less 1, at each reading; empty where it does not drift.
    pub power: Vec<f64>,
    /// Dark current less its mean, electrons a second, at each reading; empty where it does not drift.
    pub dark: Vec<f64>,
}

/// Indices of the draws of [`Purpose::Instrument`].
const FIXED: u64 = 0;
const POWER: u64 = 1;
const DARK: u64 = 2;

impl Actual {
    /// Draws one.
    #[must_use]
    pub fn draw(instrument: &Instrument, readings: &[Reading], seed: u64) -> Self {
        let rng = &mut stream(seed, Purpose::Instrument, FIXED);
        let zero = instrument.axes.zero_u_deg.to_radians();
        let tilt = instrument.sample.tilt_u_deg.to_radians();
        // All are drawn, whatever is on: switching one leaves the others' bits.
        let mut draw = |u: f64| u * normal(rng);
        Self {
            zeros: [zero; 4].map(&mut draw),
            tilt: [tilt; 2].map(&mut draw),
            height_m: draw(instrument.sample.height_u_m),
            certificate: draw(instrument.reference.reflectance_u),
            nonlinearity: draw(instrument.detector.nonlinearity_u),
            exposures: instrument.detector.exposures_s.iter().map(|_| draw(instrument.detector.exposure_u)).collect(),
            power: walk(instrument.source.drift_per_sqrt_hour, readings, stream(seed, Purpose::Instrument, POWER)),
            dark: walk(instrument.detector.dark_drift_per_sqrt_hour, readings, stream(seed, Purpose::Instrument, DARK)),
        }
    }

    /// The same errors as far as they leave directions in the world that is measured: of the flat one its plane.
    #[must_use]
    pub fn within(mut self, dimension: Dimension) -> Self {
        if dimension == Dimension::Flat {
            (self.zeros[1], self.zeros[3], self.tilt[1]) = (0.0, 0.0, 0.0);
        }
        self
    }

    /// The instrument as described, without any error.
    #[must_use]
    pub fn nominal() -> Self {
        Self {
            zeros: [0.0; 4],
            tilt: [0.0; 2],
            height_m: 0.0,
            certificate: 0.0,
            nonlinearity: 0.0,
            exposures: Vec::new(),
            power: Vec::new(),
            dark: Vec::new(),
        }
    }
}

/// A random walk from 0 at the times of the readings.
fn walk(per_sqrt_hour: f64, readings: &[Reading], mut rng: Stream) -> Vec<f64> {
    if per_sqrt_hour == 0.0 {
        return Vec::new();
    }
    let (mut place, mut before) = (0.0, 0.0);
    let mut step = |reading: &Reading| {
        place += per_sqrt_hour * ((reading.time_s - before) / 3600.0).max(0.0).sqrt() * normal(&mut rng);
        before = reading.time_s;
        place
    };
    readings.iter().map(&mut step).collect()
}

fn normal(rng: &mut Stream) -> f64 {
    StandardNormal.sample(rng)
}
