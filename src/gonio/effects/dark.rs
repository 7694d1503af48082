//! Dark current: electrons that no light made, a mean and a random walk about it.
//!
//! A reading of t seconds has (d + w)·t of them, never less than 0: d is `detector.dark_per_s`, w a walk whose standard
//! deviation after an hour is `detector.dark_drift_per_sqrt_hour`, both electrons a second (1 pA is 6.2·10⁶).
//!
//! Realistic: d from 5e-4 (a cooled CCD: 2 electrons an hour and pixel, Keck's ESI) to 1e10; Hamamatsu's photodiode
//! S1133 has 10 pA at most at 1 V, 6e7; Thorlabs' FDS100 typically 1 nA at 20 V, 6e9. The drift is mostly the
//! temperature's, 1 to 50 % of d in an hour (typical): S1133's current grows 1.12-fold a degree.

use super::{Block, Entry, Maker, Pass};

pub(super) const EFFECT: Entry = Entry {
    name: "dark current",
    calls: |i, _| {
        let (mean, drift) = (i.detector.dark_per_s, i.detector.dark_drift_per_sqrt_hour);
        let said = format!("detector.dark_per_s = {mean}, dark_drift_per_sqrt_hour = {drift}");
        if mean > 0.0 || drift > 0.0 { Ok(said) } else { Err(said) }
    },
    remove: |i| (i.detector.dark_per_s, i.detector.dark_drift_per_sqrt_hour) = (0.0, 0.0),
    make: |maker: &Maker<'_>| {
        Some(Box::new(Dark { mean: maker.instrument.detector.dark_per_s, walk: &maker.actual.dark }))
    },
};

struct Dark<'a> {
    /// Electrons a second.
    mean: f64,
    /// What is added at each reading, empty for nothing.
    walk: &'a [f64],
}

impl Pass for Dark<'_> {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            let more = self.walk.get(block.first + i).copied().unwrap_or(0.0);
            block.add(i, (self.mean + more).max(0.0));
        }
    }
}
