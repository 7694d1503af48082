//! Second order of what kept errors of positions do: squares and products of errors z of σ 1 each.
//!
//! A reading changes by Σ q_k z_k² + Σ h_jk z_j z_k. Its mean square over readings a and b is 2 Σ q_k(a) q_k(b) + m(a) m(b) + Σ h_jk(a) h_jk(b), with
//! m = Σ q_k: what components √2 q_k, m and h_jk give. Though they are many, they differ little, for a lobe that stands off is one pattern whichever
//! axis moved it: a few of their combinations carry all but a small share, which counts as each reading's own.

use nalgebra::{DMatrix, SymmetricEigen};

/// Most combinations that are kept, and the share of the variance that may be left to readings of their own.
const MOST: usize = 6;
const LEFT: f64 = 1e-3;

/// Second order of one reading of one channel, 1/sr.
#[derive(Debug, Clone, Default)]
pub(super) struct Bend {
    /// Of every error's square.
    pub squares: Vec<f64>,
    /// Of every product of two, (0, 1), (0, 2), … (1, 2) …
    pub products: Vec<f64>,
}

impl Bend {
    /// What readings have in common of them, 1 σ each.
    pub fn patterns(&self) -> impl Iterator<Item = f64> {
        let mean: f64 = self.squares.iter().sum();
        let squares = self.squares.iter().map(|q| std::f64::consts::SQRT_2 * q);
        squares.chain([mean]).chain(self.products.iter().copied())
    }

    /// The same with every change times `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        let times = |list: &[f64]| list.iter().map(|v| v * factor).collect();
        Self { squares: times(&self.squares), products: times(&self.products) }
    }

    /// The mean square of the change.
    pub fn variance(&self) -> f64 {
        self.patterns().map(|p| p * p).sum()
    }

    /// The share of the variance that is put down to error `k`: its own square, and half of what it does with others.
    pub fn variance_of(&self, k: usize) -> f64 {
        let (mean, q): (f64, f64) = (self.squares.iter().sum(), self.squares[k]);
        let pairs = pairs(self.squares.len()).zip(&self.products).filter(|((a, b), _)| *a == k || *b == k);
        (2.0 * q * q + q * mean + pairs.map(|(_, h)| 0.5 * h * h).sum::<f64>()).max(0.0)
    }
}

/// Pairs of so many errors, in the order of [`Bend::products`].
pub(super) fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (a + 1..count).map(move |b| (a, b)))
}

/// The components that carry a list of readings' second order, component by component, and what each reading has besides, as variance. Readings are
/// weighed by what else positions do to them, `first`, as variance.
pub(super) fn components(list: &[(&Bend, f64)]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let Some((bend, _)) = list.first() else { return (Vec::new(), Vec::new()) };
    let size = bend.patterns().count();
    let mut gram = DMatrix::zeros(size, size);
    for (bend, first) in list {
        let weight = 1.0 / (first + bend.variance());
        if weight.is_finite() {
            let row = DMatrix::from_iterator(size, 1, bend.patterns());
            gram.ger(weight, &row.column(0), &row.column(0), 1.0);
        }
    }
    let vectors = strongest(gram);
    let project = |bend: &Bend, vector: &[f64]| bend.patterns().zip(vector).map(|(p, v)| p * v).sum::<f64>();
    let planes: Vec<Vec<f64>> =
        vectors.iter().map(|vector| list.iter().map(|(bend, _)| project(bend, vector)).collect()).collect();
    let carried = |i: usize| planes.iter().map(|plane| plane[i] * plane[i]).sum::<f64>();
    let own = list.iter().enumerate().map(|(i, (bend, _))| (bend.variance() - carried(i)).max(0.0)).collect();
    (planes, own)
}

/// The unit vectors of the largest eigenvalues, until next to nothing is left.
fn strongest(gram: DMatrix<f64>) -> Vec<Vec<f64>> {
    let all = gram.trace();
    let eigen = SymmetricEigen::new(gram);
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let mut left = all;
    let mut vectors = Vec::new();
    for k in order.into_iter().take(MOST) {
        if left <= LEFT * all {
            break;
        }
        left -= eigen.eigenvalues[k];
        vectors.push(eigen.eigenvectors.column(k).iter().copied().collect());
    }
    vectors
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lobe's readings shifted by a sum of errors: one pattern carries all of them, and variances are those of the square of the sum.
    #[test]
    fn errors_that_do_the_same_are_one_pattern() {
        let slopes = [0.5, 1.0, -0.7];
        let bend = |curvature: f64| Bend {
            squares: slopes.iter().map(|s| 0.5 * curvature * s * s).collect(),
            products: pairs(3).map(|(a, b)| curvature * slopes[a] * slopes[b]).collect(),
        };
        let all: Vec<Bend> = [1.0, -0.4, 0.2, 2.0].map(bend).to_vec();
        let (planes, own) = components(&all.iter().map(|b| (b, 1.0)).collect::<Vec<_>>());
        assert_eq!(planes.len(), 1);
        let sum: f64 = slopes.iter().map(|s| s * s).sum();
        for (i, curvature) in [1.0, -0.4, 0.2, 2.0].into_iter().enumerate() {
            // ⟨(½ c s²)²⟩ of a normal s.
            let whole = 3.0 * (0.5 * curvature * sum).powi(2);
            assert!((all[i].variance() / whole - 1.0).abs() < 1e-12);
            assert!((planes[0][i].powi(2) / whole - 1.0).abs() < 1e-9 && own[i] < 1e-9 * whole);
            let shares: f64 = (0..3).map(|k| all[i].variance_of(k)).sum();
            assert!((shares / whole - 1.0).abs() < 1e-12);
        }
        assert!(planes[0][0] * planes[0][1] < 0.0 && planes[0][0] * planes[0][3] > 0.0);
    }

    /// Two patterns with rounding between: both are kept, and no variance is lost.
    #[test]
    fn nothing_is_lost() {
        let bends: Vec<Bend> = (0..20)
            .map(|i| Bend { squares: vec![(f64::from(i)).sin(), (1.3 * f64::from(i)).cos()], products: vec![0.3] })
            .collect();
        let (planes, own) = components(&bends.iter().map(|b| (b, 0.0)).collect::<Vec<_>>());
        for (i, bend) in bends.iter().enumerate() {
            let sum = planes.iter().map(|p| p[i] * p[i]).sum::<f64>() + own[i];
            assert!((sum / bend.variance() - 1.0).abs() < 1e-9, "{i}");
        }
        assert!(components(&[]).0.is_empty());
    }
}
