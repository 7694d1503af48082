//! The detector's aperture: a reading is the mean of f·cosθo over the cone that the detector takes in.
//!
//! As the aperture closes the mean goes to the value at its centre as α² (the mean of a smooth function over a disc is the value there, and α²/8 of
//! its Laplacian). The quadrature is in [`super::cone`].

use super::{Entry, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "detector aperture",
    calls: |i, _| stated(i.detector.aperture_deg, "detector.aperture_deg", "°"),
    remove: |i| i.detector.aperture_deg = 0.0,
    make: |_| None,
};
