//! Shot noise: electrons come by chance, a Poisson number of the mean that light and dark current ask for.

use super::{Block, Entry, Maker, Pass};
use crate::gonio::instrument::shot;

pub(super) const EFFECT: Entry = Entry {
    name: "shot noise",
    calls: |i, _| if i.is_noisy() { Ok(format!("electrons = {}", i.electrons)) } else { Err("electrons = 0".into()) },
    remove: |i| (i.electrons, i.read_noise) = (0.0, 0.0),
    make: |maker: &Maker<'_>| Some(Box::new(Shot { seed: maker.seed })),
};

struct Shot {
    seed: u64,
}

impl Pass for Shot {
    fn apply(&self, block: &mut Block<'_>) {
        let first = (block.first * block.width) as u64;
        for (k, signal) in block.signal.iter_mut().enumerate().filter(|(_, s)| s.is_finite()) {
            *signal = shot(*signal, self.seed, first + k as u64);
        }
    }
}
