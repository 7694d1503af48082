//! Random streams keyed by (seed, purpose, index): who draws never depends on which thread runs.

use rand::SeedableRng;
pub use rand::{Rng, RngExt};
pub use rand_xoshiro::Xoshiro256PlusPlus as Stream;

/// What a stream is used for. Two purposes with the same seed and index give independent streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Light paths of a pixel.
    Pixel = 1,
    /// Photons that the simulated detector counts.
    ShotNoise = 2,
    /// Noise of the detector's electronics.
    ReadNoise = 3,
    /// Draws of a test or a study.
    Study = 4,
    /// Data sets redrawn by a bootstrap.
    Bootstrap = 5,
    /// Errors that one simulated instrument has in all its readings.
    Instrument = 6,
    /// Where an axis stops.
    Jitter = 7,
}

/// The stream of (seed, purpose, index).
#[must_use]
pub fn stream(seed: u64, purpose: Purpose, index: u64) -> Stream {
    let mut key = mix(mix(seed ^ 0x9e37_79b9_7f4a_7c15).wrapping_add(purpose as u64)).wrapping_add(index);
    let mut bytes = [0u8; 32];
    for chunk in bytes.chunks_exact_mut(8) {
        key = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
        chunk.copy_from_slice(&mix(key).to_le_bytes());
    }
    Stream::from_seed(bytes)
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a bijection in which every input bit moves every output bit.
#[inline(always)]
#[must_use]
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_keys_give_uncorrelated_streams() {
        let mean = |draw: &dyn Fn(u64) -> f64| (0..10_000).map(draw).sum::<f64>() / 1e4;
        // First draws over 10,000 indices: mean ½ ± 5σ, σ = 1/√(12·10⁴); product of neighbours: ¼ ± 5·√(7/144·10⁻⁴).
        let first = |i: u64| stream(7, Purpose::Pixel, i).random::<f64>();
        assert!((mean(&first) - 0.5).abs() < 5.0 / (12e4f64).sqrt());
        assert!((mean(&|i| first(i) * first(i + 1)) - 0.25).abs() < 5.0 * (7.0 / 144.0 / 1e4f64).sqrt());
        assert_ne!(stream(7, Purpose::Pixel, 0).random::<u64>(), stream(7, Purpose::Study, 0).random::<u64>());
    }
}
