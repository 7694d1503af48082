//! The source's divergence: light reaches the sample from a cone, all of the same flux, and a reading is the mean over it.
//!
//! As the cone closes the mean goes to the value at its centre as α². The quadrature is in [`super::cone`].

use super::{Entry, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "source divergence",
    calls: |i, _| stated(i.source.divergence_deg, "source.divergence_deg", "°"),
    remove: |i| i.source.divergence_deg = 0.0,
    make: |_| None,
};
