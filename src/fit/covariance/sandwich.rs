//! A⁻¹ B A⁻¹, and what A leaves open.

use nalgebra::{DMatrix, DVector};

/// An eigenvalue of the scaled normal matrix below this share of the largest means: not determined by the data.
const UNDETERMINED: f64 = 1e-13;
/// A parameter's share in an undetermined direction (squared) from which it counts as undetermined itself.
const INVOLVED: f64 = 1e-8;

/// A⁻¹ where it exists.
pub(super) struct Sandwich {
    pub bread: DMatrix<f64>,
    /// Share of each parameter in directions that A does not determine.
    open: Vec<f64>,
}

impl Sandwich {
    /// Of the parameters that are not pinned, those of each list in `sums` moving only so that their sum stays.
    pub fn new(normal: &DMatrix<f64>, pinned: &[bool], sums: &[Vec<usize>]) -> Self {
        let root = |i: usize| if normal[(i, i)] > 0.0 && !pinned[i] { 1.0 / normal[(i, i)].sqrt() } else { 0.0 };
        let scale = DVector::from_fn(pinned.len(), |i, _| root(i));
        let n = scale.len();
        let scaled = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j]);
        let tied: Vec<DVector<f64>> = sums
            .iter()
            .map(|sum| DVector::from_fn(n, |i, _| if sum.contains(&i) { scale[i] } else { 0.0 }))
            .filter_map(|v| v.try_normalize(0.0))
            .collect();
        let mut within = DMatrix::identity(n, n);
        tied.iter().for_each(|q| within.ger(-1.0, q, q, 1.0));
        let eigen = (&within * scaled * &within).symmetric_eigen();
        let floor = UNDETERMINED * eigen.eigenvalues.max();
        let inverse = eigen.eigenvalues.map(|l| if l > floor { 1.0 / l } else { 0.0 });
        let v = &within * &eigen.eigenvectors;
        let pseudo = &v * DMatrix::from_diagonal(&inverse) * v.transpose();
        let open = |i: usize| {
            let share: f64 = (0..n).filter(|&k| inverse[k] == 0.0).map(|k| v[(i, k)].powi(2)).sum();
            if scale[i] > 0.0 { share } else { 1.0 }
        };
        Self {
            open: (0..n).map(open).collect(),
            bread: DMatrix::from_fn(n, n, |i, j| pseudo[(i, j)] * scale[i] * scale[j]),
        }
    }

    /// A⁻¹ (B + Σ g gᵀ) A⁻¹.
    pub fn covariance(&self, spread: &DMatrix<f64>, common: &[DVector<f64>]) -> DMatrix<f64> {
        let mut covariance = &self.bread * spread * &self.bread;
        for g in common {
            let moved = &self.bread * g;
            covariance += &moved * moved.transpose();
        }
        covariance
    }

    pub fn errors(&self, covariance: &DMatrix<f64>) -> Vec<Option<f64>> {
        let error = |(i, open): (usize, &f64)| {
            let variance = covariance[(i, i)];
            (*open < INVOLVED && variance.is_finite() && variance >= 0.0).then(|| variance.sqrt())
        };
        self.open.iter().enumerate().map(error).collect()
    }
}
