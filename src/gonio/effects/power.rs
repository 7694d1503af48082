//! The source's drift: a random walk of its power, relative, with a standard deviation that grows as the root of time.

use super::{Block, Entry, Maker, Pass, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "source drift",
    calls: |i, _| stated(i.source.drift_per_sqrt_hour, "source.drift_per_sqrt_hour", ""),
    remove: |i| i.source.drift_per_sqrt_hour = 0.0,
    make: |maker: &Maker<'_>| {
        let power = &maker.actual.power[..];
        (!power.is_empty()).then(|| Box::new(Power(power)) as Box<dyn Pass>)
    },
};

/// Power over its first, less 1, at each reading.
struct Power<'a>(&'a [f64]);

impl Pass for Power<'_> {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            block.scale(i, 1.0 + self.0[block.first + i]);
        }
    }
}
