//! Saturation: a full well takes no more electrons. Shorter exposures of the same pair tell what it can't.
//!
//! signal → min(signal, `detector.full_well`), electrons. `detector.exposures_s`, s, are the times that a pair is read
//! in: the longest that does not saturate counts.
//!
//! Realistic: 4e4 to 5e5 for a CCD's pixel (Spectral Instruments' Series 800 manual; 1.05e5: Keck's ESI), 1e7 to 1e10
//! for an integrating amplifier (typical: 10 pF at 10 V are 6e8). Two or three exposures, 10 to 1000 apart, span the 10⁶
//! to 10⁷ of signals that coloured samples need (NIST's five-axis goniospectrometer; Podobedov, Nadal and Miller).

use super::{Block, Entry, Maker, Pass, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "saturation",
    calls: |i, _| stated(i.detector.full_well, "detector.full_well", " electrons"),
    remove: |i| (i.detector.full_well, i.detector.bits, i.detector.nonlinearity_u) = (0.0, 0, 0.0),
    make: |maker: &Maker<'_>| Some(Box::new(Saturation(maker.instrument.detector.full_well))),
};

/// Electrons that the well holds.
struct Saturation(f64);

impl Pass for Saturation {
    fn apply(&self, block: &mut Block<'_>) {
        for signal in block.signal.iter_mut().filter(|s| **s > self.0) {
            *signal = self.0;
        }
    }
}
