//! Noise or model error? Residuals of neighbouring directions are independent where they are noise, and alike where the model can't
//! bend as the material does.

use crate::numeric::simd::{Eight, Kernel, LANES, Lanes, Simd, dot, dot3, map, vectorised};

/// Sums over pairs of neighbours.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Neighbours {
    /// Σ w r r′.
    product: f64,
    /// Σ w (r² + r′²)/2.
    square: f64,
    /// Σ (w r r′)²: the product's variance, were the residuals independent.
    variance: f64,
    /// Pairs of which both count.
    count: usize,
}

impl Neighbours {
    /// Sums over one channel of a block; `trust` is the robust weight of each residual, empty for 1.
    pub fn of(r: &[f64], trust: &[f64], w: &[f64], pairs: &[f64]) -> Self {
        vectorised(Sum { r, trust, w, pairs })
    }

    pub fn add(&mut self, other: &Self) {
        self.product += other.product;
        self.square += other.square;
        self.variance += other.variance;
        self.count += other.count;
    }

    /// Correlation of neighbours' residuals, and its standard error were they independent; `None` for too few pairs.
    pub fn correlation(&self) -> Option<(f64, f64)> {
        let enough = self.count >= 30 && self.square > 0.0;
        enough.then(|| (self.product / self.square, self.variance.sqrt() / self.square))
    }
}

/// [`Neighbours`] of many rows, in lanes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PairSums {
    product: Eight,
    square: Eight,
    variance: Eight,
    count: usize,
}

impl PairSums {
    /// Adds a row of residuals, each the neighbour of the one before, so many `vectors` long and one more; those of weight 0 are none.
    #[inline(always)]
    pub fn add_row<S: Simd, const N: usize>(&mut self, simd: S, r: &[f64; N], w: &[f64; N], vectors: usize) {
        let load = |from: &[f64; N], at: usize| {
            from[at..].first_chunk().map_or(Lanes::splat(simd, 0.0), |chunk| Lanes::load(simd, chunk))
        };
        let sum = |from: &Eight| Lanes::load(simd, from);
        let half = Lanes::splat(simd, 0.5);
        let (mut product, mut square) = (sum(&self.product), sum(&self.square));
        let (mut variance, mut count) = (sum(&self.variance), Lanes::splat(simd, 0.0));
        let one = Lanes::splat(simd, 1.0);
        for i in 0..vectors {
            let (before, after) = (load(r, i * LANES), load(r, i * LANES + 1));
            let pair = load(w, i * LANES).min(load(w, i * LANES + 1));
            let own = pair * before * after;
            product = product + own;
            variance = own.mul_add(own, variance);
            square = (pair * half).mul_add(before.mul_add(before, after * after), square);
            count = count + one.where_positive(pair);
        }
        product.store(&mut self.product);
        square.store(&mut self.square);
        variance.store(&mut self.variance);
        self.count += count.sum() as usize;
    }

    pub fn total(&self) -> Neighbours {
        let total = |lanes: &Eight| lanes.iter().sum();
        Neighbours {
            product: total(&self.product),
            square: total(&self.square),
            variance: total(&self.variance),
            count: self.count,
        }
    }
}

struct Sum<'a> {
    r: &'a [f64],
    trust: &'a [f64],
    w: &'a [f64],
    pairs: &'a [f64],
}

impl Kernel for Sum<'_> {
    type Output = Neighbours;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> Neighbours {
        let n = self.r.len();
        if n < 2 {
            return Neighbours::default();
        }
        // r where it counts, under a robust loss as far as it does.
        let mut u = vec![0.0; n];
        map(self.r, self.w, &mut u, |r, w| if w > 0.0 { r } else { 0.0 });
        u.iter_mut().zip(self.trust).for_each(|(u, t)| *u *= t);
        // A pair weighs as much as the lighter of the two: nothing where one is masked.
        let mut weight = vec![0.0; n - 1];
        map(&self.w[..n - 1], &self.w[1..], &mut weight, |a, b| if a < b { a } else { b });
        weight.iter_mut().zip(&self.pairs[1..]).for_each(|(w, p)| *w *= p);
        let count = weight.iter().filter(|w| **w > 0.0).count();
        let (weight, before, after) = (&weight[..], &u[..n - 1], &u[1..]);
        let mut product = vec![0.0; n - 1];
        map(before, after, &mut product, |a, b| a * b);
        let mut weighted = product.clone();
        weighted.iter_mut().zip(weight).for_each(|(p, w)| *p *= w);
        let square = 0.5 * (dot3(weight, before, before) + dot3(weight, after, after));
        Neighbours { product: dot(weight, &product), square, variance: dot(&weighted, &weighted), count }
    }
}

/// What the residuals are made of, in the loss's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Structure {
    /// rmse that noise explains.
    pub noise: f64,
    /// rmse of the model's own error.
    pub model: f64,
    /// Whether the noise is from stated σ, not from the residuals of neighbours.
    pub from_sigma: bool,
    /// Share of the residuals' variance that is structured, where it can be told.
    pub share: f64,
    /// How many independent samples the residuals are worth.
    pub effective_samples: f64,
}

/// Splits an rmse. `stated` is the rmse that stated σ explain; `samples` residuals are worth `effective_samples`.
pub(super) fn structure(
    rmse: f64,
    stated: Option<f64>,
    neighbours: &Neighbours,
    samples: usize,
    effective_samples: f64,
) -> Option<Structure> {
    let correlation = neighbours.correlation();
    // A correlation within its own noise is none.
    let real = correlation.map(|(rho, error)| if rho > 3.0 * error { rho.min(1.0) } else { 0.0 });
    let noise = match (stated, real) {
        // An excess over the stated noise that its own scatter explains is none.
        (Some(noise), _) if rmse * rmse <= noise * noise * (1.0 + 4.0 * (2.0 / samples.max(1) as f64).sqrt()) => {
            return Some(Structure { noise, model: 0.0, from_sigma: true, share: 0.0, effective_samples });
        }
        (Some(noise), _) => noise,
        (None, Some(rho)) => rmse * (1.0 - rho).sqrt(),
        (None, None) => return None,
    };
    let model = (rmse * rmse - noise * noise).max(0.0).sqrt();
    let share = if rmse > 0.0 { (model / rmse).powi(2) } else { 0.0 };
    Some(Structure { noise, model, from_sigma: stated.is_some(), share, effective_samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};

    #[test]
    fn independent_residuals_are_noise_and_slow_ones_model_error() {
        let mut rng = stream(3, Purpose::Study, 9);
        let n = 20_000;
        let noise: Vec<f64> = (0..n).map(|_| rng.random::<f64>() - 0.5).collect();
        let slow: Vec<f64> = (0..n).map(|i| 0.5 * (0.01 * f64::from(i)).sin()).collect();
        let both: Vec<f64> = noise.iter().zip(&slow).map(|(a, b)| a + b).collect();
        let (one, pairs) = (vec![1.0; n as usize], vec![1.0; n as usize]);
        let split = |r: &[f64]| {
            let rmse = (r.iter().map(|r| r * r).sum::<f64>() / f64::from(n)).sqrt();
            structure(rmse, None, &Neighbours::of(r, &one, &one, &pairs), n as usize, 7.0).expect("pairs")
        };
        let (a, b, c) = (split(&noise), split(&slow), split(&both));
        assert_eq!((a.share, a.effective_samples), (0.0, 7.0));
        assert!(b.share > 0.999, "{b:?}");
        assert!((c.noise / (1.0f64 / 12.0).sqrt() - 1.0).abs() < 0.02, "{c:?}");
        assert!((c.model / 0.125f64.sqrt() - 1.0).abs() < 0.02, "{c:?}");
        assert!(structure(1.0, None, &Neighbours::default(), 5, 5.0).is_none());
    }

    /// Half of the residuals' variance is slow; an outlier among twenty hides none of it, whichever of a pair it is.
    #[test]
    fn outliers_do_not_hide_that_residuals_are_alike() {
        let mut rng = stream(5, Purpose::Study, 9);
        let n = 2000;
        let mut r: Vec<f64> = (0..n).map(|i| rng.random::<f64>() - 0.5 + 0.41 * (0.03 * f64::from(i)).sin()).collect();
        for k in (7..r.len()).step_by(20) {
            r[k] = if k % 3 == 0 { 40.0 } else { -30.0 };
        }
        let trust: Vec<f64> = r.iter().map(|r| 1.0 / (1.0 + r * r)).collect();
        let ones = vec![1.0; r.len()];
        let (rho, error) = Neighbours::of(&r, &trust, &ones, &ones).correlation().expect("pairs");
        r.reverse();
        let trust: Vec<f64> = trust.into_iter().rev().collect();
        let (back, _) = Neighbours::of(&r, &trust, &ones, &ones).correlation().expect("pairs");
        assert!((0.35..0.6).contains(&rho) && rho > 3.0 * error && (rho - back).abs() < 1e-12, "{rho} {error} {back}");
    }

    /// A row of a table, so many vectors long and one more.
    const VECTORS: usize = 3;
    const ROW: usize = VECTORS * LANES + 1;

    struct Row<'a>(&'a [f64; ROW], &'a [f64; ROW]);

    impl Kernel for Row<'_> {
        type Output = Neighbours;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Neighbours {
            let mut sums = PairSums::default();
            sums.add_row(simd, self.0, self.1, VECTORS);
            sums.total()
        }
    }

    #[test]
    fn a_pair_with_a_masked_value_is_none_however_the_row_is_summed() {
        let mut rng = stream(4, Purpose::Study, 9);
        let r: [f64; ROW] = std::array::from_fn(|_| rng.random::<f64>() - 0.5);
        let mut w: [f64; ROW] = std::array::from_fn(|_| 0.5 + rng.random::<f64>());
        // Masked: the first, two in a row, the last.
        [0, 7, 8, ROW - 1].iter().for_each(|&i| w[i] = 0.0);
        let listed = Neighbours::of(&r, &[], &w, &[1.0; ROW]);
        let folded = vectorised(Row(&r, &w));
        // 24 pairs, less 0–1, 6–7, 7–8, 8–9 and the last.
        assert_eq!((listed.count, folded.count), (19, 19));
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-14 * b.abs().max(folded.square);
        assert!(near(listed.product, folded.product), "{listed:?} {folded:?}");
        assert!(near(listed.square, folded.square), "{listed:?} {folded:?}");
        assert!(near(listed.variance, folded.variance), "{listed:?} {folded:?}");
    }
}
