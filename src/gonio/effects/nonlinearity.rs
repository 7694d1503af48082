//! Nonlinearity: N electrons are read as N (1 + δ N/full_well), δ the instrument's own error.
//!
//! δ is one draw of σ = `detector.nonlinearity_u`, relative at `detector.full_well` (electrons).
//!
//! Realistic: 3e-5 to 1e-2. A silicon photodiode S1227 was linear to 3e-5 up to 7 mW ("Measurement of the absolute
//! linearity of photodetectors with a diode laser"), a photodetector to ±0.02 % from 0.2 nA to 0.2 mA (doi
//! 10.5768/JAO201940.0407001); a goniophotometer's budget has 0.2 % for uniformity and linearity (doi
//! 10.2478/msr-2025-0044). Array spectroradiometers may exceed 10 % where nobody corrects them (Applied Optics 56,
//! 2017, 3077).

use super::{Block, Entry, Maker, Pass, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "nonlinearity",
    calls: |i, _| stated(i.detector.nonlinearity_u, "detector.nonlinearity_u", ""),
    remove: |i| i.detector.nonlinearity_u = 0.0,
    make: |maker: &Maker<'_>| {
        Some(Box::new(Nonlinearity { error: maker.actual.nonlinearity / maker.instrument.detector.full_well }))
    },
};

struct Nonlinearity {
    /// δ over the full well.
    error: f64,
}

impl Pass for Nonlinearity {
    fn apply(&self, block: &mut Block<'_>) {
        block.signal.iter_mut().for_each(|s| *s *= 1.0 + self.error * *s);
    }
}
