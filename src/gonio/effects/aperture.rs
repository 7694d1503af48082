//! The detector's aperture: a reading is the mean of f·cosθo over the cone that the detector takes in.
//!
//! As the aperture closes the mean goes to the value at its centre as α² (the mean of a smooth function over a disc is
//! the value there, and α²/8 of its Laplacian): the peak of a lobe cosⁿ falls by nα²/4. α, rad, is half of
//! `detector.aperture_deg`, the cone's full angle in degrees. The quadrature is in [`super::cone`].
//!
//! Realistic: 0.01° to 7°. CNAM's `ConDOR` resolves 0.014°, the BSDF bench of KU Leuven 1.8°; photodiodes of Janecek
//! and Moses (IEEE Trans. Nucl. Sci. 55, 2008) subtend 6.3°. In compact goniophotometers the finite solid angle brings
//! errors of 1 to 3 % (Applied Optics 53, 2014, 1212-1220).

use super::{Entry, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "detector aperture",
    calls: |i, _| stated(i.detector.aperture_deg, "detector.aperture_deg", "°"),
    remove: |i| i.detector.aperture_deg = 0.0,
    make: |_| None,
};
