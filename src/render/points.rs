//! Sample points: Owen-scrambled Sobol' points of two dimensions, a new scrambling and order for every pixel and every pair of dimensions.
//!
//! Pairs are the (0, 2)-sequence of Sobol's first two dimensions, padded: the n-th decision of a path has its own shuffling of the order
//! and scrambling of the digits (Burley 2020, J. Computer Graphics Techniques 9(4); the hash by Vegdahl 2021), so decisions are independent of
//! each other and each one's points are as even as can be. Digits are 32 bits.
//!
//! A pixel's samples are dealt to two halves in turn, each with its own scrambling: the halves are independent, so that their difference says how
//! far off the pixel is, which the scatter of points of one net can't ([`super::noise`]).

use glam::DVec2;

use crate::numeric::random::mix;

/// The points of some samples, side by side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Points<const N: usize> {
    /// Those of the samples' halves.
    keys: [u64; N],
    /// Their places in the halves' sequences.
    places: [u32; N],
}

/// The half to which a sample belongs.
#[inline(always)]
pub(super) fn half_of(sample: u32) -> usize {
    (sample & 1) as usize
}

/// The keys of both halves of a pixel's points.
#[inline(always)]
pub(super) fn keys_of(seed: u64, x: u32, y: u32) -> [u64; 2] {
    let key = mix(mix(seed ^ 0x51ed_270b_7a11_4e17).wrapping_add(u64::from(y) << 32 | u64::from(x)));
    [key, mix(key ^ 0x2545_f491_4f6c_dd1d)]
}

impl<const N: usize> Points<N> {
    /// The points of samples at these places of the halves with these keys.
    #[inline(always)]
    pub fn of(keys: [u64; N], places: [u32; N]) -> Self {
        Self { keys, places }
    }

    /// Both coordinates of the points of a decision, above 0 and below 1.
    #[inline(always)]
    pub fn pair(&self, decision: u32) -> ([f64; N], [f64; N]) {
        let (order, first, second) = self.seeds(decision);
        let shuffled = reversed(hashed(reversed(self.places), order));
        (unit(reversed(hashed(shuffled, first))), unit(reversed(hashed(second_dimension(shuffled), second))))
    }

    /// The first coordinate alone.
    #[inline(always)]
    pub fn single(&self, decision: u32) -> [f64; N] {
        let (order, first, _) = self.seeds(decision);
        unit(reversed(hashed(reversed(hashed(reversed(self.places), order)), first)))
    }

    /// Seeds of the order and of the digits of both coordinates.
    #[inline(always)]
    fn seeds(&self, decision: u32) -> ([u32; N], [u32; N], [u32; N]) {
        let step = u64::from(decision).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let (mut order, mut first, mut second) = ([0; N], [0; N], [0; N]);
        for k in 0..N {
            let key = mix(self.keys[k].wrapping_add(step));
            (order[k], first[k], second[k]) = (key as u32, (key >> 32) as u32, mix(key) as u32);
        }
        (order, first, second)
    }
}

/// What a number decides.
#[derive(Debug, Clone, Copy)]
pub(super) enum Decision {
    /// Where in the pixel the path begins.
    Pixel,
    /// Where on the lens.
    Lens,
    /// A direction of the environment.
    Environment,
    /// Where the path goes on.
    Direction,
    /// By which lobe it goes on.
    Lobe,
    /// Whether it goes on.
    Roulette,
    /// A point of the light of this index.
    Light(u32),
}

impl Decision {
    /// Its number at the scattering event after `bounce` others, in a scene of so many lights.
    #[inline(always)]
    pub fn number(self, bounce: u32, lights: usize) -> u32 {
        let which = match self {
            Self::Pixel => return 0,
            Self::Lens => return 1,
            Self::Environment => 0,
            Self::Direction => 1,
            Self::Lobe => 2,
            Self::Roulette => 3,
            Self::Light(k) => 4 + k,
        };
        2 + bounce * (4 + lights as u32) + which
    }
}

/// The numbers of one path, at one decision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Draws {
    points: Points<1>,
    decision: u32,
}

impl Draws {
    /// Those of a sample of the pixel with these keys, at the first decision.
    pub fn new(keys: [u64; 2], sample: u32) -> Self {
        Self { points: Points::of([keys[half_of(sample)]], [sample >> 1]), decision: 0 }
    }

    /// The same at another decision.
    pub fn at(self, decision: u32) -> Self {
        Self { decision, ..self }
    }

    /// A point of the unit square, without its borders.
    pub fn pair(self) -> DVec2 {
        let ([x], [y]) = self.points.pair(self.decision);
        DVec2::new(x, y)
    }

    /// A number above 0 and below 1.
    pub fn single(self) -> f64 {
        self.points.single(self.decision)[0]
    }

    /// A lobe's choice, and a point.
    pub fn direction(self) -> [f64; 3] {
        let point = self.pair();
        [self.at(self.decision + 1).single(), point.x, point.y]
    }
}

/// The middle of the digit's interval.
#[inline(always)]
fn unit<const N: usize>(digits: [u32; N]) -> [f64; N] {
    let mut points = [0.0; N];
    for k in 0..N {
        points[k] = (f64::from(digits[k]) + 0.5) * (1.0 / 4_294_967_296.0);
    }
    points
}

/// Owen's scrambling of digits that stand in reverse order.
#[inline(always)]
fn hashed<const N: usize>(mut words: [u32; N], seeds: [u32; N]) -> [u32; N] {
    for (x, seed) in words.iter_mut().zip(seeds) {
        *x ^= x.wrapping_mul(0x3d20_adea);
        *x = x.wrapping_add(seed);
        *x = x.wrapping_mul((seed >> 16) | 1);
        *x ^= x.wrapping_mul(0x0552_6c56);
        *x ^= x.wrapping_mul(0x53a2_2864);
    }
    words
}

#[inline(always)]
fn reversed<const N: usize>(mut words: [u32; N]) -> [u32; N] {
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
fn second_dimension<const N: usize>(mut words: [u32; N]) -> [u32; N] {
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

    /// The first 2ᵐ points of a half have one in every elementary interval of that area, whatever the scrambling: a (0, m, 2)-net.
    #[test]
    fn points_are_nets() {
        for key in [1u64, 77, 1 << 40] {
            let keys = keys_of(key, 3, 5);
            for decision in [0, 1, 9] {
                for m in [3u32, 6, 10] {
                    let n = 1u32 << m;
                    let point = |half: usize| move |k: u32| Points::of([keys[half]], [k]).pair(decision);
                    for list in [0, 1].map(|half| (0..n).map(point(half)).collect::<Vec<_>>()) {
                        for across in 0..=m {
                            let mut counts = vec![0; n as usize];
                            for ([x], [y]) in &list {
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
    }

    #[test]
    fn eight_abreast_are_those_of_one_at_a_time() {
        let keys: [_; 8] = std::array::from_fn(|k| keys_of(5, k as u32, 9));
        let sample = |k: usize| 16 + 3 * k as u32;
        let points = Points::<8>::of(
            std::array::from_fn(|k| keys[k][half_of(sample(k))]),
            std::array::from_fn(|k| sample(k) >> 1),
        );
        let (x, y) = points.pair(3);
        for k in 0..8 {
            let draws = Draws::new(keys[k], sample(k)).at(3);
            assert_eq!(draws.pair(), DVec2::new(x[k], y[k]));
            assert_eq!(draws.single(), x[k]);
        }
    }

    /// Points of one index over many keys are uniform; decisions and halves don't know of each other.
    #[test]
    fn scramblings_are_independent() {
        let n = 20_000;
        let draw = |key: u64| {
            let points = Points::of(keys_of(key, 0, 0), [3, 3]);
            let ((a, b), (c, _)) = (points.pair(0), points.pair(1));
            [a[0], b[0], c[0], a[1]]
        };
        let list: Vec<[f64; 4]> = (0..n).map(draw).collect();
        let mean = |f: &dyn Fn(&[f64; 4]) -> f64| list.iter().map(f).sum::<f64>() / n as f64;
        let sigma = (12.0 * n as f64).sqrt().recip();
        for k in 0..4 {
            assert!((mean(&|p| p[k]) - 0.5).abs() < 5.0 * sigma, "{k}");
        }
        let product = (7.0 / 144.0 / n as f64).sqrt();
        for (j, k) in [(0, 1), (0, 2), (1, 2), (0, 3)] {
            assert!((mean(&|p| p[j] * p[k]) - 0.25).abs() < 5.0 * product, "{j} {k}");
        }
    }
}
