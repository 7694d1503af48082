//! Stray light: what the surroundings reflect to the detector whenever the shutter is open, whatever stands before it.
//!
//! It adds `electrons`·s electrons a second to all readings but the dark: s, `surroundings.stray_per_sr`, is the BRDF
//! in 1/sr of a sample that reflects as much at cosθo = 1. Blank readings measure it. Geometry and sample do not change
//! it here.
//!
//! Realistic: 1e-5 to 1e-2 1/sr (typical: a baffled black room to a dim one; a white has 1/π). To measure reflectance
//! factors down to 0.001, as NIST's STARR does, it must be known to much less than 3e-4. The spectrometer's own stray
//! light is another thing.

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
