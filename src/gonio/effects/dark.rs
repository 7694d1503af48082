//! Dark current: electrons that no light made, a mean and a random walk about it.

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
