//! Electronic offset: what the electronics add to every reading, however short its exposure. Dark and blank of the same
//! exposure have it too.
//!
//! signal → signal + `detector.offset`, electrons; it takes part of the full well and has no shot noise.
//!
//! Realistic: 0 to a few per cent of the full well (typical: converters are set so that noise about 0 is not cut off).
//! The converter of an ATmega328PB alone is accurate to 2 of 1023 steps, 0.2 %.

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
