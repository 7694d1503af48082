//! Sample points: Owen-scrambled Sobol' points of two dimensions, a new scrambling and order for every pixel and every pair of dimensions.
//!
//! Pairs are the (0, 2)-sequence of Sobol's first two dimensions, padded: the n-th decision of a path has its own shuffling of the order
//! and scrambling of the digits (Burley 2020, J. Computer Graphics Techniques 9(4); the hash by Vegdahl 2021), so decisions are independent of
//! each other and each one's points are as even as can be. Digits are 32 bits.

use crate::numeric::random::mix;
use crate::numeric::simd::{Eight, LANES};

/// Indices or digits side by side.
type Words = [u32; LANES];

/// The points of one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Points {
    key: u64,
    /// The samples' indices.
    index: Words,
}

impl Points {
    /// The points of [`LANES`] samples from `first` on of the pixel with this key.
    #[inline(always)]
    pub fn new(key: u64, first: u32) -> Self {
        let mut index = [0; LANES];
        for (k, i) in index.iter_mut().enumerate() {
            *i = first.wrapping_add(k as u32);
        }
        Self { key, index }
    }

    /// Both coordinates of the points of a decision, above 0 and below 1.
    #[inline(always)]
    pub fn pair(&self, decision: u32) -> (Eight, Eight) {
        let key = mix(self.key.wrapping_add(u64::from(decision).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        let other = mix(key);
        let shuffled = reversed(hashed(reversed(self.index), key as u32));
        let first = reversed(hashed(shuffled, (key >> 32) as u32));
        let second = reversed(hashed(second_dimension(shuffled), other as u32));
        (unit(first), unit(second))
    }

    /// The first coordinate alone.
    #[inline(always)]
    pub fn single(&self, decision: u32) -> Eight {
        let key = mix(self.key.wrapping_add(u64::from(decision).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        let shuffled = reversed(hashed(reversed(self.index), key as u32));
        unit(reversed(hashed(shuffled, (key >> 32) as u32)))
    }
}

/// The middle of the digit's interval.
#[inline(always)]
fn unit(digits: Words) -> Eight {
    let mut points = [0.0; LANES];
    for k in 0..LANES {
        points[k] = (f64::from(digits[k]) + 0.5) * (1.0 / 4_294_967_296.0);
    }
    points
}

/// Owen's scrambling of digits that stand in reverse order.
#[inline(always)]
fn hashed(mut words: Words, seed: u32) -> Words {
    for x in &mut words {
        *x ^= x.wrapping_mul(0x3d20_adea);
        *x = x.wrapping_add(seed);
        *x = x.wrapping_mul((seed >> 16) | 1);
        *x ^= x.wrapping_mul(0x0552_6c56);
        *x ^= x.wrapping_mul(0x53a2_2864);
    }
    words
}

#[inline(always)]
fn reversed(mut words: Words) -> Words {
    for x in &mut words {
        *x = ((*x >> 1) & 0x5555_5555) | ((*x & 0x5555_5555) << 1);
        *x = ((*x >> 2) & 0x3333_3333) | ((*x & 0x3333_3333) << 2);
        *x = ((*x >> 4) & 0x0f0f_0f0f) | ((*x & 0x0f0f_0f0f) << 4);
        *x = x.swap_bytes();
    }
    words
}

/// The reversed digits of Sobol's second dimension: Pascal's triangle modulo 2 times the index (its first dimension's are the index itself).
#[inline(always)]
fn second_dimension(mut words: Words) -> Words {
    for x in &mut words {
        *x ^= *x >> 16;
        *x ^= (*x & 0xff00_ff00) >> 8;
        *x ^= (*x & 0xf0f0_f0f0) >> 4;
        *x ^= (*x & 0xcccc_cccc) >> 2;
        *x ^= (*x & 0xaaaa_aaaa) >> 1;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first 2ᵐ points have one in every elementary interval of that area, whatever the scrambling: a (0, m, 2)-net.
    #[test]
    fn points_are_nets() {
        for key in [1u64, 77, 1 << 40] {
            for decision in [0, 1, 9] {
                for m in [3u32, 6, 10] {
                    let n = 1usize << m;
                    let list: Vec<(f64, f64)> = (0..n / LANES)
                        .flat_map(|k| {
                            let (x, y) = Points::new(key, (k * LANES) as u32).pair(decision);
                            (0..LANES).map(move |j| (x[j], y[j])).collect::<Vec<_>>()
                        })
                        .collect();
                    for across in 0..=m {
                        let mut counts = vec![0; n];
                        for (x, y) in &list {
                            let column = (x * f64::from(1 << across)) as usize;
                            let row = (y * f64::from(1 << (m - across))) as usize;
                            counts[column * (1 << (m - across)) + row] += 1;
                        }
                        assert!(
                            counts.iter().all(|c| *c == 1),
                            "key {key}, decision {decision}, 2^{m} points, {across}"
                        );
                    }
                }
            }
        }
    }

    /// Points of one index over many keys are uniform, and decisions don't know of each other.
    #[test]
    fn scramblings_are_independent() {
        let n = 20_000;
        let draw = |key: u64| {
            let points = Points::new(mix(key), 0);
            let ((a, b), (c, _)) = (points.pair(0), points.pair(1));
            [a[3], b[3], c[3], a[4]]
        };
        let list: Vec<[f64; 4]> = (0..n).map(draw).collect();
        let mean = |f: &dyn Fn(&[f64; 4]) -> f64| list.iter().map(f).sum::<f64>() / n as f64;
        let sigma = (12.0 * n as f64).sqrt().recip();
        for k in 0..4 {
            assert!((mean(&|p| p[k]) - 0.5).abs() < 5.0 * sigma, "{k}");
        }
        let product = (7.0 / 144.0 / n as f64).sqrt();
        for (j, k) in [(0, 1), (0, 2), (1, 2)] {
            assert!((mean(&|p| p[j] * p[k]) - 0.25).abs() < 5.0 * product, "{j} {k}");
        }
    }
}
