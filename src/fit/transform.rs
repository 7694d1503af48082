//! All sums over the samples that a fit by lobes c(n)·eⁿˣ needs, from one pass.
//!
//! Such lobes (Phong: x = ln cosα) multiply to lobes of the same form, so every entry of the normal equations of every model,
//! whatever its exponents, is a value or a derivative of a few functions of one variable: S(s) = Σ ω e^{sx} for the Gram matrix
//! and T(s) = Σ ω y e^{sx} for each channel's data, the Laplace transforms of the weighted samples. One pass sorts the samples
//! into bins of |x|, 16 to an octave, and keeps eight moments of each bin; e^{sx} about a bin's centre is then its Taylor series,
//! whose remainder is below 10⁻¹³ of Σ |ω| for any s, because e^{−s|x|} falls as fast as its derivatives rise. After that pass a cost with all
//! its derivatives takes microseconds, however many samples there are: the search for the global minimum is free.

use crate::numeric::simd::{self, Eight, Kernel, LANES, Lanes, Simd, vectorised};

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
pub(super) struct Transform {
    measures: usize,
    /// `[bin][measure][moment]`.
    moments: Vec<f64>,
    /// Mass of each measure where the lobes are 0.
    dark: Vec<f64>,
    /// First bin with a sample, and the one after the last.
    occupied: (usize, usize),
}

/// Value, first and second derivative.
pub(super) type Jet = [f64; 3];

impl Transform {
    /// Without a sample.
    pub fn new(measures: usize) -> Self {
        let moments = vec![0.0; BINS * measures * MOMENTS];
        Self { measures, moments, dark: vec![0.0; measures], occupied: (BINS, 0) }
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
                    let (first, last) = single.occupied;
                    for bin in first..last.max(first) {
                        let from = bin * MOMENTS..(bin + 1) * MOMENTS;
                        let to = (bin * measures + m) * MOMENTS;
                        let pairs = self.moments[to..to + MOMENTS].iter_mut().zip(&mut single.moments[from]);
                        pairs.for_each(|(to, from)| *to += std::mem::take(from));
                    }
                    self.dark[m] += std::mem::take(&mut single.dark[0]);
                    self.occupied = (self.occupied.0.min(first), self.occupied.1.max(last));
                    single.occupied = (BINS, 0);
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
        self.occupied = (self.occupied.0.min(bin), self.occupied.1.max(bin + 1));
    }

    /// Adds another's sums.
    pub fn merge(&mut self, other: &Self) {
        let (first, last) = other.occupied;
        let range = first * self.measures * MOMENTS..last.max(first) * self.measures * MOMENTS;
        self.moments[range.clone()].iter_mut().zip(&other.moments[range]).for_each(|(a, b)| *a += b);
        self.dark.iter_mut().zip(&other.dark).for_each(|(a, b)| *a += b);
        self.occupied = (self.occupied.0.min(first), self.occupied.1.max(last));
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

    /// Σ value over all samples, those where the lobes are 0 included.
    pub fn total(&self, measure: usize) -> f64 {
        let moments = self.moments.iter().skip(measure * MOMENTS).step_by(self.measures * MOMENTS);
        moments.sum::<f64>() + self.dark[measure]
    }

    /// Σ value·e^{sx} for s ≥ 0, with its derivatives by s, of the measures in `range`.
    pub fn at(&self, s: f64, range: std::ops::Range<usize>) -> Vec<Jet> {
        let first = range.start;
        match range.len() {
            1 => vectorised(Evaluate::<1> { of: self, s, first }).to_vec(),
            3 => vectorised(Evaluate::<3> { of: self, s, first }).to_vec(),
            4 => vectorised(Evaluate::<4> { of: self, s, first }).to_vec(),
            _ => range.flat_map(|m| vectorised(Evaluate::<1> { of: self, s, first: m })).collect(),
        }
    }
}

/// Adds samples. Those in a row mostly fall into one bin: its moments wait in registers until another bin comes.
struct Absorb<'a, const M: usize> {
    into: &'a mut Transform,
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
struct Powers<S: Simd> {
    simd: S,
    without: [Lanes<S>; 3],
    with: [Lanes<S>; 3],
}

impl<S: Simd> Powers<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let bits = |bit: usize, set: bool| {
            let lanes: Eight = std::array::from_fn(|k| if (k >> bit & 1 == 1) == set { 1.0 } else { 0.0 });
            Lanes::load(simd, &lanes)
        };
        Self { simd, without: [0, 1, 2].map(|b| bits(b, false)), with: [0, 1, 2].map(|b| bits(b, true)) }
    }

    #[inline(always)]
    fn of(&self, d: f64) -> Lanes<S> {
        let factor = |bit: usize, d: f64| self.with[bit].mul_add(Lanes::splat(self.simd, d), self.without[bit]);
        factor(0, d) * factor(1, d * d) * factor(2, d * d * (d * d))
    }
}

/// 1/k!, and the factors of its derivatives: 1/(k − 1)! and 1/(k − 2)!, 0 before they begin.
const INVERSE_FACTORIALS: [Eight; 3] = [
    [1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0],
    [0.0, 1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0],
    [0.0, 0.0, 1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0],
];

struct Evaluate<'a, const M: usize> {
    of: &'a Transform,
    s: f64,
    first: usize,
}

impl<const M: usize> Kernel for Evaluate<'_, M> {
    type Output = [Jet; M];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [Jet; M] {
        let splat = |x: f64| Lanes::splat(simd, x);
        let mut lanes = [[splat(0.0); 3]; M];
        let (stride, s) = (self.of.measures * MOMENTS, self.s);
        let bins = self.of.occupied.0..self.of.occupied.1.max(self.of.occupied.0);
        // e^{−s·centre} of all bins first, many at a time.
        let mut peaks = [0.0; BINS];
        let peaks = &mut peaks[bins.clone()];
        for (peak, bin) in peaks.iter_mut().zip(bins.clone()) {
            *peak = simd::exp(-s * bin_geometry(bin).0);
        }
        let (powers, factorials) = (Powers::new(simd), INVERSE_FACTORIALS.map(|list| Lanes::load(simd, &list)));
        for (bin, peak) in bins.zip(&*peaks) {
            let (centre, half) = bin_geometry(bin);
            if s * centre > 745.0 {
                break; // the bins ascend: all that follow are 0
            }
            // Coefficients of the moments in e^{sx}: a_k = e^{−sv} zᵏ/k!, and with one and two powers of z fewer.
            let z = powers.of(s * half);
            let a0 = splat(*peak) * z * factorials[0];
            let a1 = splat(*peak) * z.shifted(1) * factorials[1];
            let a2 = splat(*peak) * z.shifted(2) * factorials[2];
            let (v, h) = (splat(centre), splat(half));
            // d/ds brings down h from a power of z and −v from the exponential.
            let first = h * a1 - v * a0;
            let second = h * (h * a2 - v * (a1 + a1)) + v * v * a0;
            let start = bin * stride + self.first * MOMENTS;
            let (blocks, _) = self.of.moments[start..start + M * MOMENTS].as_chunks();
            for (lanes, moments) in lanes.iter_mut().zip(blocks) {
                let moments = Lanes::load(simd, moments);
                lanes[0] = a0.mul_add(moments, lanes[0]);
                lanes[1] = first.mul_add(moments, lanes[1]);
                lanes[2] = second.mul_add(moments, lanes[2]);
            }
        }
        lanes.map(|jet| jet.map(Lanes::sum))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};

    /// Compensated sum, so that the reference's own rounding is out of the way.
    fn sum(terms: impl Iterator<Item = f64>) -> f64 {
        let (mut total, mut lost) = (0.0f64, 0.0f64);
        for term in terms {
            let next = total + term;
            lost += if total.abs() >= term.abs() { (total - next) + term } else { (term - next) + total };
            total = next;
        }
        total + lost
    }

    #[test]
    fn sums_over_bins_are_the_sums_over_samples() {
        let mut rng = stream(11, Purpose::Study, 1);
        // Coordinates over all sizes that occur, both ends, and where the lobe is 0.
        let mut x: Vec<f64> = (0..20_000).map(|_| -(rng.random::<f64>() * 52.0 - 46.0).exp2()).collect();
        x.extend([0.0, -0.0, -f64::MIN_POSITIVE, -700.0, f64::NEG_INFINITY, -1.0, -0.5]);
        let values: Vec<Vec<f64>> =
            (0..4).map(|m| x.iter().map(|_| rng.random::<f64>() - if m == 0 { 0.0 } else { 0.5 }).collect()).collect();
        let mut whole = Transform::new(4);
        whole.absorb(&x, &values);
        let mut parts = Transform::new(4);
        for (piece, from) in x.chunks(1000).zip((0..).step_by(1000)) {
            let mut part = Transform::new(4);
            let cut: Vec<Vec<f64>> = values.iter().map(|v| v[from..from + piece.len()].to_vec()).collect();
            part.absorb(piece, &cut);
            parts.merge(&part);
        }
        for s in [0.0, 0.01, 0.3, 1.0, 7.0, 123.0, 4e4, 1e6, 2e8] {
            let (all, merged) = (whole.at(s, 1..4), parts.at(s, 1..4));
            let single = whole.at(s, 0..1)[0];
            for (m, jet) in std::iter::once(single).chain(all.iter().copied()).enumerate() {
                for (order, got) in jet.iter().enumerate() {
                    let term = |(x, v): (&f64, &f64)| {
                        if x.is_finite() { v * x.powi(order as i32) * (s * x).exp() } else { 0.0 }
                    };
                    let want = sum(x.iter().zip(&values[m]).map(term));
                    let size = sum(x.iter().zip(&values[m]).map(|(x, v)| {
                        // e^{sx} on its own octave: an error of 1e-13 relative to what the samples nearby contribute.
                        if x.is_finite() { v.abs() * x.abs().powi(order as i32) * (s * x * 0.5).exp() } else { 0.0 }
                    }));
                    assert!(
                        (got - want).abs() <= 1e-12 * size,
                        "s {s} measure {m} order {order}: {got:e} {want:e} of {size:e}"
                    );
                }
                if m > 0 {
                    assert!((merged[m - 1][0] - jet[0]).abs() <= 1e-12 * jet[0].abs().max(1.0), "s {s}");
                }
            }
        }
        let dark = x.iter().position(|x| *x == f64::NEG_INFINITY).expect("one");
        assert!((whole.total(2) - sum(values[2].iter().copied())).abs() < 1e-11, "{}", values[2][dark]);
    }

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
        let mut rng = stream(12, Purpose::Study, 1);
        let x: Vec<f64> = (0..999).map(|_| -(rng.random::<f64>() * 30.0 - 20.0).exp2()).collect();
        let values: Vec<Vec<f64>> = (0..2).map(|_| x.iter().map(|_| rng.random::<f64>() - 0.5).collect()).collect();
        let (mut widest, mut plain) = (Transform::new(2), Transform::new(2));
        widest.absorb(&x, &values);
        Absorb { into: &mut plain, x: &x, values: [&values[0], &values[1]] }.run(pulp::Scalar512b);
        assert_eq!(widest.moments, plain.moments);
        for s in [0.0, 3.7, 4e5] {
            let scalar = Evaluate::<1> { of: &plain, s, first: 1 }.run(pulp::Scalar512b);
            assert_eq!(widest.at(s, 1..2), scalar);
        }
    }
}
