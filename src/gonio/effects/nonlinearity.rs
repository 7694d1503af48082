//! Nonlinearity: N electrons are read as N (1 + δ N/full_well), δ the instrument's own error.

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
