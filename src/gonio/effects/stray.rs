//! Stray light: what the surroundings reflect to the detector whenever the shutter is open, whatever stands before it.

use super::{Block, Entry, Maker, Pass, stated};
use crate::gonio::reading::Kind;

pub(super) const EFFECT: Entry = Entry {
    name: "stray light",
    calls: |i, _| stated(i.surroundings.stray_per_sr, "surroundings.stray_per_sr", " 1/sr"),
    remove: |i| i.surroundings.stray_per_sr = 0.0,
    make: |maker: &Maker<'_>| {
        Some(Box::new(Stray(maker.instrument.gain() * maker.instrument.surroundings.stray_per_sr)))
    },
};

/// Electrons a second.
struct Stray(f64);

impl Pass for Stray {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            if block.readings[i].kind != Kind::Dark {
                block.add(i, self.0);
            }
        }
    }
}
