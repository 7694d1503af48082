//! Shot noise: electrons come by chance, a Poisson number of the mean that light and dark current ask for.
//!
//! The variance is the mean N: of a BRDF f read for t seconds N = `electrons`·f·cosθo·t, and the relative σ is 1/√N
//! (the photon noise of EMVA 1288). `electrons` is the photoelectrons a second of f = 1/sr at cosθo = 1.
//!
//! Realistic: 1e5 to 1e11 (typical): 1 pA of photocurrent is 6.2e6, 1 nA 6.2e9. A noise of 0.35 % of a white's reading,
//! as in the budget of doi 10.2478/msr-2025-0044, is that of 8e4 electrons.

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
