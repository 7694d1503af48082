//! The source's drift: a random walk of its power, relative, with a standard deviation that grows as the root of time.
//!
//! P(t) = P(0) (1 + w(t)), σ of w(t) = `source.drift_per_sqrt_hour`·√(t/1 h), relative; stray light drifts with it.
//!
//! Realistic: 5e-5 to 0.03. An LED under optical feedback drifts by 0.007 % an hour (doi 10.1371/journal.pone.0029822);
//! the source's instability is 0.23 % of a budget (doi 10.2478/msr-2025-0044); a stabilised dc arc stays within 1 %
//! ("Optical output stabilization method for direct current arc lamps", Rev. Sci. Instrum.). A halogen lamp's flux goes
//! as its current's 6.5th power (SPIE Field Guide to Illumination, 2007): 0.3 % of current are 2 %.

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
