//! Saturation: a full well takes no more electrons. Shorter exposures of the same pair tell what it can't.

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
