//! The source's divergence: light reaches the sample from a cone, all of the same flux, and a reading is the mean over
//! it.
//!
//! As the cone closes the mean goes to the value at its centre as α²: the peak of a lobe cosⁿ falls by nα²/4. α, rad,
//! is half of `source.divergence_deg`, the cone's full angle in degrees: of a collimated beam the divergence, of a lamp
//! its diameter over its distance. The quadrature is in [`super::cone`].
//!
//! Realistic: 0.01° to 5° (typical): a laser or the very collimated beam of CNAM's `ConDOR` (0.014°, its lens
//! included), a slit or a pinhole behind a collimator 0.1° to 1°, a bare lamp of 3 cm at 0.6 m 3°.

use super::{Entry, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "source divergence",
    calls: |i, _| stated(i.source.divergence_deg, "source.divergence_deg", "°"),
    remove: |i| i.source.divergence_deg = 0.0,
    make: |_| None,
};
