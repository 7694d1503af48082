//! All sums over the samples that a fit by lobes c(n)·eⁿˣ needs, at any exponents.
//!
//! Such lobes (Phong: x = ln cosα) multiply to lobes of the same form, so every entry of the normal equations of every model,
//! whatever its exponents, is a value or a derivative of a few functions of one variable: S(s) = Σ ω e^{sx} for the Gram matrix
//! and T(s) = Σ ω y e^{sx} for each channel's data, the Laplace transforms of the weighted samples. Many samples are compressed
//! to [`Bins`] first, few are added up themselves. Either way a cost with all its derivatives takes microseconds, however many
//! samples there are: the search for the global minimum is free.

use super::bins::{Bins, Powers};
use crate::numeric::simd::{self, Eight, Kernel, LANES, Lanes, Simd, vectorised};

/// Laplace transforms of several measures (weights, weighted data) over the same samples.
#[derive(Debug)]
pub(super) struct Transform {
    measures: usize,
    /// Coordinates, falling from 0: of the samples, to whole vectors, or of the bins' centres.
    x: Vec<f64>,
    terms: Terms,
    /// Σ value over all samples, those where the lobes are 0 included.
    pub totals: Vec<f64>,
}

/// What stands at the coordinates.
#[derive(Debug)]
enum Terms {
    /// Values of eight samples, measure by measure.
    Samples(Vec<Eight>),
    /// Each bin's half width, and its moments measure by measure.
    Bins(Vec<f64>, Vec<Eight>),
}

/// Value, first and second derivative.
pub(super) type Jet = [f64; 3];

impl Transform {
    /// Whether adding up the samples themselves is quicker: eight of them take about as long as a bin.
    pub fn are_few(x: &[f64]) -> bool {
        x.len().div_ceil(LANES) <= Bins::needed(x)
    }

    /// Of few samples at coordinates `x` ≤ 0 (−∞ where the lobes are 0); `values` holds one list a measure.
    pub fn of_samples(x: &[f64], values: &[Vec<f64>]) -> Self {
        let (mut order, dark): (Vec<usize>, Vec<usize>) = (0..x.len()).partition(|&i| x[i] != f64::NEG_INFINITY);
        order.sort_by(|&a, &b| x[b].total_cmp(&x[a]));
        let last = order.last().map_or(0.0, |&i| x[i]);
        let padded = order.len().next_multiple_of(LANES);
        let place = |k: usize| order.get(k).map_or(last, |&i| x[i]);
        let value = |list: &[f64], k: usize| order.get(k).map_or(0.0, |&i| list[i]);
        let row = |k: usize| values.iter().map(move |list| std::array::from_fn(|lane| value(list, k + lane)));
        let terms = Terms::Samples((0..padded).step_by(LANES).flat_map(row).collect());
        let dark = values.iter().map(|list| dark.iter().map(|&i| list[i]).sum()).collect();
        Self::new((0..padded).map(place).collect(), terms, dark)
    }

    /// Of any number of samples in bins.
    pub fn of_bins(bins: &Bins) -> Self {
        let (mut x, mut half, mut moments) = (Vec::new(), Vec::new(), Vec::new());
        for ((centre, width), block) in bins.occupied() {
            x.push(-centre);
            half.push(width);
            moments.extend_from_slice(block);
        }
        Self::new(x, Terms::Bins(half, moments), bins.dark.clone())
    }

    fn new(x: Vec<f64>, terms: Terms, dark: Vec<f64>) -> Self {
        let measures = dark.len();
        let mut new = Self { measures, x, terms, totals: dark };
        let bright = new.at(0.0, 0..measures);
        new.totals.iter_mut().zip(&bright).for_each(|(total, jet)| *total += jet[0]);
        new
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

/// 1/k!, and the factors of its derivatives: 1/(k − 1)! and 1/(k − 2)!, 0 before they begin.
const INVERSE_FACTORIALS: [Eight; 3] = [
    [1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0],
    [0.0, 1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0],
    [0.0, 0.0, 1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0],
];

/// Exponentials worked out at once.
const BATCH: usize = 32 * LANES;

struct Evaluate<'a, const M: usize> {
    of: &'a Transform,
    s: f64,
    first: usize,
}

impl<const M: usize> Kernel for Evaluate<'_, M> {
    type Output = [Jet; M];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [Jet; M] {
        let s = self.s;
        let mut jets = [[Lanes::splat(simd, 0.0); 3]; M];
        // The coordinates fall: from here on e^{sx} is nothing. Samples come in whole vectors.
        let seen = self.of.x.partition_point(|x| s * x >= -708.0 || x.is_nan());
        let seen = seen.next_multiple_of(LANES).min(self.of.x.len());
        let mut peaks = [0.0; BATCH];
        for (batch, x) in self.of.x[..seen].chunks(BATCH).enumerate() {
            peaks.iter_mut().zip(x).for_each(|(peak, x)| *peak = simd::exp(s * x));
            let from = batch * BATCH;
            match &self.of.terms {
                Terms::Samples(values) => self.add_samples(simd, from, x.len(), &peaks, values, &mut jets),
                Terms::Bins(half, moments) => {
                    let places = x.iter().zip(&half[from..]).zip(&peaks);
                    let places = places.map(|((x, half), peak)| (*x, *half, *peak));
                    self.add_bins(simd, places, &moments[from * self.of.measures..], &mut jets);
                }
            }
        }
        jets.map(|jet| jet.map(Lanes::sum))
    }
}

impl<const M: usize> Evaluate<'_, M> {
    /// Adds the samples from number `from` on.
    #[inline(always)]
    fn add_samples<S: Simd>(
        &self,
        simd: S,
        from: usize,
        count: usize,
        peaks: &[f64; BATCH],
        values: &[Eight],
        jets: &mut [[Lanes<S>; 3]; M],
    ) {
        let rows = count.div_ceil(LANES);
        let (x, peaks) = (self.of.x[from..from + rows * LANES].as_chunks().0, peaks.as_chunks().0);
        let values = values[from / LANES * self.of.measures..].chunks_exact(self.of.measures);
        for ((x, peak), values) in x.iter().zip(peaks).zip(values) {
            let (x, peak) = (Lanes::load(simd, x), Lanes::load(simd, peak));
            let first = peak * x;
            let second = first * x;
            for (jet, values) in jets.iter_mut().zip(&values[self.first..self.first + M]) {
                let values = Lanes::load(simd, values);
                jet[0] = peak.mul_add(values, jet[0]);
                jet[1] = first.mul_add(values, jet[1]);
                jet[2] = second.mul_add(values, jet[2]);
            }
        }
    }

    /// Adds bins, each with minus its centre, its half width and e^{−s·centre}.
    #[inline(always)]
    fn add_bins<S: Simd>(
        &self,
        simd: S,
        places: impl Iterator<Item = (f64, f64, f64)>,
        moments: &[Eight],
        jets: &mut [[Lanes<S>; 3]; M],
    ) {
        let splat = |x: f64| Lanes::splat(simd, x);
        let (powers, factorials) = (Powers::new(simd), INVERSE_FACTORIALS.map(|list| Lanes::load(simd, &list)));
        for ((x, half, peak), moments) in places.zip(moments.chunks_exact(self.of.measures)) {
            // Coefficients of the moments in e^{sx}: a_k = e^{−sv} zᵏ/k!, and with one and two powers of z fewer.
            let z = powers.of(self.s * half);
            let a0 = splat(peak) * z * factorials[0];
            let a1 = splat(peak) * z.shifted(1) * factorials[1];
            let a2 = splat(peak) * z.shifted(2) * factorials[2];
            let (v, h) = (splat(-x), splat(half));
            // d/ds brings down h from a power of z and −v from the exponential.
            let first = h * a1 - v * a0;
            let second = h * (h * a2 - v * (a1 + a1)) + v * v * a0;
            for (jet, moments) in jets.iter_mut().zip(&moments[self.first..self.first + M]) {
                let moments = Lanes::load(simd, moments);
                jet[0] = a0.mul_add(moments, jet[0]);
                jet[1] = first.mul_add(moments, jet[1]);
                jet[2] = second.mul_add(moments, jet[2]);
            }
        }
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

    /// Coordinates over all sizes that occur, both ends, and where the lobe is 0, with four measures.
    fn samples(count: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
        let mut rng = stream(11, Purpose::Study, 1);
        let mut x: Vec<f64> = (0..count).map(|_| -(rng.random::<f64>() * 52.0 - 46.0).exp2()).collect();
        x.extend([0.0, -0.0, -f64::MIN_POSITIVE, -700.0, f64::NEG_INFINITY, -1.0, -0.5]);
        let value = |m: usize, r: f64| if m == 0 { r } else { r - 0.5 };
        let values = (0..4).map(|m| x.iter().map(|_| value(m, rng.random::<f64>())).collect()).collect();
        (x, values)
    }

    fn binned(x: &[f64], values: &[Vec<f64>]) -> Bins {
        let mut bins = Bins::new(values.len());
        bins.absorb(x, values);
        bins
    }

    fn compare(transform: &Transform, x: &[f64], values: &[Vec<f64>], bound: f64) {
        for s in [0.0, 0.01, 0.3, 1.0, 7.0, 123.0, 4e4, 1e6, 2e8] {
            let jets = [transform.at(s, 0..1), transform.at(s, 1..4)].concat();
            for (m, jet) in jets.iter().enumerate() {
                for (order, got) in jet.iter().enumerate() {
                    let term = |(x, v): (&f64, &f64)| {
                        if x.is_finite() { v * x.powi(order as i32) * (s * x).exp() } else { 0.0 }
                    };
                    let want = sum(x.iter().zip(&values[m]).map(term));
                    let size = sum(x.iter().zip(&values[m]).map(|(x, v)| {
                        // e^{sx} on its own octave: an error relative to what the samples nearby contribute.
                        if x.is_finite() { v.abs() * x.abs().powi(order as i32) * (s * x * 0.5).exp() } else { 0.0 }
                    }));
                    assert!(
                        (got - want).abs() <= bound * size + 1e-300, // exponentials end at 3e-308
                        "s {s} measure {m} order {order}: {got:e} {want:e} of {size:e}"
                    );
                }
            }
        }
        let total = sum(values[2].iter().copied());
        assert!((transform.totals[2] - total).abs() < 1e-11, "{:e} {total:e}", transform.totals[2]);
    }

    #[test]
    fn sums_over_bins_are_the_sums_over_samples() {
        let (x, values) = samples(20_000);
        compare(&Transform::of_bins(&binned(&x, &values)), &x, &values, 1e-12);
        let mut merged = Bins::new(4);
        for (piece, from) in x.chunks(1000).zip((0..).step_by(1000)) {
            let cut: Vec<Vec<f64>> = values.iter().map(|v| v[from..from + piece.len()].to_vec()).collect();
            merged.merge(&binned(piece, &cut));
        }
        compare(&Transform::of_bins(&merged), &x, &values, 1e-12);
    }

    #[test]
    fn few_samples_are_added_up_themselves() {
        for count in [0, 1, 2, 9, 250, 2000] {
            let (x, values) = samples(count);
            compare(&Transform::of_samples(&x, &values), &x, &values, 1e-14);
        }
        let dark = Transform::of_samples(&[f64::NEG_INFINITY; 3], &[vec![1.0, 2.0, 4.0]]);
        assert_eq!((dark.totals[0], dark.at(1.0, 0..1)[0]), (7.0, [0.0; 3]));
    }

    #[test]
    fn every_vector_unit_gives_the_same_bits() {
        let (x, values) = samples(999);
        for transform in [Transform::of_samples(&x, &values), Transform::of_bins(&binned(&x, &values))] {
            for s in [0.0, 3.7, 4e5] {
                let scalar = Evaluate::<3> { of: &transform, s, first: 1 }.run(pulp::Scalar512b);
                assert_eq!(transform.at(s, 1..4), scalar);
            }
        }
    }
}
