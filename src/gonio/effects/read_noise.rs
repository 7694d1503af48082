//! Read noise: the electronics add normal noise of σ = `read_noise` electrons to each reading.
//!
//! It is the same for any exposure and signal; EMVA 1288 has it in the variance of the dark noise.
//!
//! Realistic: 2 to 30 electrons for a cooled CCD (2.7: Keck's ESI; 27 measured of a KAF-0400, TASS note 18), 100 to 1e6
//! for a photodiode and its amplifier: the lowest noise at room temperature was 0.1 fA over 400 s, which is 2.5e5
//! electrons (Eppeldauer and Hardis, "Fourteen-decade photocurrent measurements", Applied Optics 30, 1991).

use super::{Block, Entry, Maker, Pass, stated};
use crate::gonio::instrument::normal;

pub(super) const EFFECT: Entry = Entry {
    name: "read noise",
    calls: |i, _| match stated(i.read_noise, "read_noise", " electrons") {
        Ok(_) if !i.is_noisy() => Err("electrons = 0".into()),
        said => said,
    },
    remove: |i| i.read_noise = 0.0,
    make: |maker: &Maker<'_>| Some(Box::new(ReadNoise { sigma: maker.instrument.read_noise, seed: maker.seed })),
};

struct ReadNoise {
    sigma: f64,
    seed: u64,
}

impl Pass for ReadNoise {
    fn apply(&self, block: &mut Block<'_>) {
        let first = (block.first * block.width) as u64;
        for (k, signal) in block.signal.iter_mut().enumerate() {
            *signal += self.sigma * normal(self.seed, first + k as u64);
        }
    }
}
