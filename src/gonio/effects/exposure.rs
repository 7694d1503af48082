//! Errors of exposure times: a shutter that is open for longer or shorter than it says, a range whose gain is not the one that it is taken for.
//!
//! signal → signal (1 + ε): ε is one draw for each of `detector.exposures_s`, of σ = `detector.exposure_u`, relative, the same in all readings of that
//! exposure. Light and dark current count for that time, an electronic offset does not. What is read of sample and reference in one exposure has one
//! error, which cancels; the ratio of two exposures is off by √2 σ.
//!
//! Realistic: 1e-4 (typical: a clock's; gains as they are calibrated by Larason and Miller, NIST 2018) to 1e-2. A telescope's shutter scatters by less
//! than 0.1 % at 1 s (earthshine.thejll.com, 2011); IMACS' is linear to 1 % at 2 s; an iris shutter's 30 ms to open and close are 7 % of half a second
//! and 0.6 % of five (AAO's CCD imaging manual).

use super::{Block, Entry, Maker, Pass, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "exposure times",
    calls: |i, _| stated(i.detector.exposure_u, "detector.exposure_u", ""),
    remove: |i| i.detector.exposure_u = 0.0,
    make: |maker: &Maker<'_>| {
        let (nominal_s, errors) = (&maker.instrument.detector.exposures_s[..], &maker.actual.exposures[..]);
        (!errors.is_empty()).then(|| Box::new(Times { nominal_s, errors }) as Box<dyn Pass>)
    },
};

/// Exposures as they are meant, s, and the relative error of each.
struct Times<'a> {
    nominal_s: &'a [f64],
    errors: &'a [f64],
}

impl Pass for Times<'_> {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            let exposure_s = block.readings[i].exposure_s;
            let of = self.nominal_s.iter().zip(self.errors).find(|(nominal, _)| **nominal == exposure_s);
            of.into_iter().for_each(|(_, error)| block.scale(i, 1.0 + error));
        }
    }
}
