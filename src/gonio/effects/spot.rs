//! The spot's extent: its points see source and detector in directions of their own, and a reading is the mean over it.
//!
//! As the beam closes the mean goes to the value in its middle as its diameter². From r a spot of diameter D is D/r rad
//! wide; a matte sample along the normal reads 1/(1 + D²/4r²) of what it would from afar. The geometry is in
//! [`crate::gonio::spot`].
//!
//! `source.beam_diameter_m` is D, `detector.distance_m` and `source.distance_m` are r, all m; r = 0 is far away.
//! Realistic: D from 1 to 40 mm (17 mm: NIST's STARR; 15 by 40 mm: J.-P. Rheault's bench), r from 0.1 to 2 m (0.345 m:
//! the ring of TUBITAK UME's robot; 0.5 m: Rheault's bench).

use super::{Entry, stated};

/// So many times as far away a spot has no extent left; a power of two, so that heights in proportion keep their bits.
const FAR: f64 = 1_048_576.0;

pub(super) const EFFECT: Entry = Entry {
    name: "spot extent",
    calls: |i, _| {
        let near = i.source.distance_m > 0.0 || i.detector.distance_m > 0.0;
        let beam = stated(i.source.beam_diameter_m, "source.beam_diameter_m", " m");
        beam.and_then(|why| if near { Ok(why) } else { Err("source and detector are far away".into()) })
    },
    remove: |i| {
        for length in [&mut i.source.distance_m, &mut i.detector.distance_m, &mut i.sample.height_u_m] {
            *length *= FAR;
        }
    },
    make: |_| None,
};
