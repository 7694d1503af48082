//! Any number of samples compressed to a few hundred sums, from which their Laplace transforms follow.
//!
//! One pass sorts the samples into bins of |x|, 16 to an octave, and keeps eight moments of each bin; e^{sx} about a bin's centre is
//! then its Taylor series, whose remainder is below 10⁻¹³ of Σ |ω| for any s, because e^{−s|x|} falls as fast as its derivatives
//! rise.

use crate::numeric::simd::{Eight, Kernel, LANES, Lanes, Simd, vectorised};

/// Moments kept of a bin.
const MOMENTS: usize = LANES;
/// Bins an octave, as a power of two.
const SPLIT: u32 = 4;
/// |x| from 2^LOWEST on is told apart; below, e^{sx} is 1 to rounding for any exponent that is searched.
const LOWEST: i32 = -44;
/// Octaves above 2^LOWEST: up to |x| = 1024, beyond the logarithm of any number.
const OCTAVES: usize = 54;
/// Bins in all; the first is for |x| < 2^LOWEST.
const BINS: usize = (OCTAVES << SPLIT) + 1;
/// The bits of 2^LOWEST down to the bin's number.
const BASE: u64 = ((1023 + LOWEST) as u64) << SPLIT;
/// Bits of an f64 below the bin's number.
const BELOW: u32 = 52 - SPLIT;

/// The bin that |x| falls into.
#[inline(always)]
fn bin_number(x: f64) -> usize {
    ((x.abs().to_bits() >> BELOW).saturating_sub(BASE - 1) as usize).min(BINS - 1)
}

/// Centre and half width of a bin.
#[inline(always)]
fn bin_geometry(bin: usize) -> (f64, f64) {
    if bin == 0 {
        let half = f64::from_bits(((1023 + LOWEST - 1) as u64) << 52);
        return (half, half);
    }
    let low = f64::from_bits((BASE - 1 + bin as u64) << BELOW);
    let high = f64::from_bits((BASE + bin as u64) << BELOW);
    (0.5 * (low + high), 0.5 * (high - low))
}

/// Sums of several measures (weights, weighted data) over the same samples.
#[derive(Debug, Clone)]
pub(super) struct Bins {
    pub measures: usize,
    /// `[bin][measure][moment]`.
    moments: Vec<f64>,
    /// Mass of each measure where the lobes are 0.
    pub dark: Vec<f64>,
    /// First bin with a sample, and the one after the last.
    range: (usize, usize),
}

impl Bins {
    /// Without a sample.
    pub fn new(measures: usize) -> Self {
        let moments = vec![0.0; BINS * measures * MOMENTS];
        Self { measures, moments, dark: vec![0.0; measures], range: (BINS, 0) }
    }

    /// How many bins samples at these coordinates fall into.
    pub fn needed(x: &[f64]) -> usize {
        let mut seen = [false; BINS];
        x.iter().filter(|x| **x != f64::NEG_INFINITY).for_each(|x| seen[bin_number(*x)] = true);
        seen.iter().filter(|s| **s).count()
    }

    /// Adds samples at coordinates `x` ≤ 0 (−∞ where the lobes are 0); `values` holds one list a measure.
    pub fn absorb<V: AsRef<[f64]>>(&mut self, x: &[f64], values: &[V]) {
        let values: Vec<&[f64]> = values.iter().map(AsRef::as_ref).collect();
        match values[..] {
            [a, b] => vectorised(Absorb { into: self, x, values: [a, b] }),
            [a, b, c, d] => vectorised(Absorb { into: self, x, values: [a, b, c, d] }),
            [a, b, c, d, e, f] => vectorised(Absorb { into: self, x, values: [a, b, c, d, e, f] }),
            ref many => {
                // Any other number of channels: one at a time.
                let (measures, mut single) = (self.measures, Self::new(1));
                for (m, values) in many.iter().enumerate() {
                    vectorised(Absorb { into: &mut single, x, values: [values] });
                    let (first, last) = single.range;
                    for bin in first..last.max(first) {
                        let from = bin * MOMENTS..(bin + 1) * MOMENTS;
                        let to = (bin * measures + m) * MOMENTS;
                        let pairs = self.moments[to..to + MOMENTS].iter_mut().zip(&mut single.moments[from]);
                        pairs.for_each(|(to, from)| *to += std::mem::take(from));
                    }
                    self.dark[m] += std::mem::take(&mut single.dark[0]);
                    self.range = (self.range.0.min(first), self.range.1.max(last));
                    single.range = (BINS, 0);
                }
            }
        }
    }

    /// Adds moments to a bin.
    #[inline(always)]
    fn flush<S: Simd, const M: usize>(&mut self, simd: S, bin: usize, held: &[Lanes<S>; M]) {
        let (blocks, _) = self.moments[bin * M * MOMENTS..(bin + 1) * M * MOMENTS].as_chunks_mut();
        for (moments, held) in blocks.iter_mut().zip(held) {
            (Lanes::load(simd, moments) + *held).store(moments);
        }
        self.range = (self.range.0.min(bin), self.range.1.max(bin + 1));
    }

    /// Adds another's sums.
    pub fn merge(&mut self, other: &Self) {
        let (first, last) = other.range;
        let range = first * self.measures * MOMENTS..last.max(first) * self.measures * MOMENTS;
        self.moments[range.clone()].iter_mut().zip(&other.moments[range]).for_each(|(a, b)| *a += b);
        self.dark.iter_mut().zip(&other.dark).for_each(|(a, b)| *a += b);
        self.range = (self.range.0.min(first), self.range.1.max(last));
    }

    /// Multiplies the sums of each measure by a factor.
    pub fn scale(&mut self, factors: &[f64]) {
        for block in self.moments.chunks_exact_mut(self.measures * MOMENTS) {
            for (moments, factor) in block.chunks_exact_mut(MOMENTS).zip(factors) {
                moments.iter_mut().for_each(|m| *m *= factor);
            }
        }
        self.dark.iter_mut().zip(factors).for_each(|(d, f)| *d *= f);
    }

    /// What holds samples: each such bin's centre and half width, and its moments measure by measure.
    pub fn occupied(&self) -> impl Iterator<Item = ((f64, f64), &[Eight])> {
        let bins = self.moments.as_chunks().0.chunks_exact(self.measures).enumerate();
        let holds = |moments: &[Eight]| moments.iter().flatten().any(|m| *m != 0.0);
        bins.filter(move |(_, moments)| holds(moments)).map(|(bin, moments)| (bin_geometry(bin), moments))
    }
}

/// Adds samples. Those in a row mostly fall into one bin: its moments wait in registers until another bin comes.
struct Absorb<'a, const M: usize> {
    into: &'a mut Bins,
    x: &'a [f64],
    values: [&'a [f64]; M],
}

impl<const M: usize> Kernel for Absorb<'_, M> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { into, x, values } = self;
        let n = x.len();
        let values: [&[f64]; M] = std::array::from_fn(|m| &values[m][..n]);
        let (zero, powers) = (Lanes::splat(simd, 0.0), Powers::new(simd));
        let mut held = [zero; M];
        // No bin is held at first.
        let (mut bin, mut centre, mut inverse) = (usize::MAX, 0.0, 0.0);
        for i in 0..n {
            if x[i] == f64::NEG_INFINITY {
                (0..M).for_each(|m| into.dark[m] += values[m][i]);
                continue;
            }
            let own = bin_number(x[i]);
            if own != bin {
                if bin != usize::MAX {
                    into.flush(simd, bin, &held);
                }
                held = [zero; M];
                bin = own;
                let half;
                (centre, half) = bin_geometry(bin);
                inverse = 1.0 / half;
            }
            let powers = powers.of((centre + x[i]) * inverse);
            for m in 0..M {
                held[m] = Lanes::splat(simd, values[m][i]).mul_add(powers, held[m]);
            }
        }
        if bin != usize::MAX {
            into.flush(simd, bin, &held);
        }
    }
}

/// 1, d, d², … d⁷, by the bits of the exponent: 1 or d, times 1 or d², times 1 or d⁴.
pub(super) struct Powers<S: Simd> {
    simd: S,
    without: [Lanes<S>; 3],
    with: [Lanes<S>; 3],
}

impl<S: Simd> Powers<S> {
    #[inline(always)]
    pub fn new(simd: S) -> Self {
        let bits = |bit: usize, set: bool| {
            let lanes: Eight = std::array::from_fn(|k| if (k >> bit & 1 == 1) == set { 1.0 } else { 0.0 });
            Lanes::load(simd, &lanes)
        };
        Self { simd, without: [0, 1, 2].map(|b| bits(b, false)), with: [0, 1, 2].map(|b| bits(b, true)) }
    }

    #[inline(always)]
    pub fn of(&self, d: f64) -> Lanes<S> {
        let factor = |bit: usize, d: f64| self.with[bit].mul_add(Lanes::splat(self.simd, d), self.without[bit]);
        factor(0, d) * factor(1, d * d) * factor(2, d * d * (d * d))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_what_falls_into_them() {
        for v in [0.0, 1e-20, 6e-14, 1e-9, 0.37, 1.0, 1.0625, 63.9, 745.0, 1e4] {
            let bin = bin_number(v);
            let (centre, half) = bin_geometry(bin);
            assert!(bin < BINS && ((v - centre).abs() <= half || v > 1024.0), "{v}: {centre} ± {half}");
            assert!(bin == 0 || half <= centre / 30.0);
        }
    }

    #[test]
    fn every_vector_unit_gives_the_same_bits() {
        let x: Vec<f64> = (0..999).map(|i| -(f64::from(i) * 0.03 - 20.0).exp2()).collect();
        let values: Vec<Vec<f64>> = [1.0, 1.3].map(|k| x.iter().map(|x| (k * x).sin()).collect()).to_vec();
        let (mut widest, mut plain) = (Bins::new(2), Bins::new(2));
        widest.absorb(&x, &values);
        Absorb { into: &mut plain, x: &x, values: [&values[0], &values[1]] }.run(pulp::Scalar512b);
        assert_eq!(widest.moments, plain.moments);
    }
}
