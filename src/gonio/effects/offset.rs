//! Electronic offset: what the electronics add to every reading, however short its exposure. Dark and blank of the same exposure have it too.

use super::{Block, Entry, Maker, Pass, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "electronic offset",
    calls: |i, _| stated(i.detector.offset, "detector.offset", " electrons"),
    remove: |i| i.detector.offset = 0.0,
    make: |maker: &Maker<'_>| Some(Box::new(Offset(maker.instrument.detector.offset))),
};

/// Electrons of each reading.
struct Offset(f64);

impl Pass for Offset {
    fn apply(&self, block: &mut Block<'_>) {
        block.signal.iter_mut().for_each(|signal| *signal += self.0);
    }
}
