//! Householder QR with column pivoting: the rank-revealing solve behind every step and every standard error.

use nalgebra::{DMatrix, DVector};

/// A P = Q R with |r₁₁| ≥ |r₂₂| ≥ …, and Qᵀb for one right-hand side.
#[derive(Debug, Clone)]
pub(super) struct PivotedQr {
    r: DMatrix<f64>,
    rhs: DVector<f64>,
    /// Column of A that stands at each place of R.
    order: Vec<usize>,
    /// Diagonal entries above `tol` times the first.
    pub rank: usize,
}

impl PivotedQr {
    /// Factors `a`; a diagonal entry of at most `tol` times the largest counts as zero.
    pub fn new(mut a: DMatrix<f64>, mut b: DVector<f64>, tol: f64) -> Self {
        let (rows, columns) = a.shape();
        let mut order: Vec<usize> = (0..columns).collect();
        for k in 0..rows.min(columns) {
            let pivot = longest(&a, k);
            a.swap_columns(k, pivot);
            order.swap(k, pivot);
            reflect(&mut a, &mut b, k);
        }
        let largest = if a.is_empty() { 0.0 } else { a[(0, 0)].abs() };
        let rank = (0..rows.min(columns)).take_while(|&k| a[(k, k)].abs() > tol * largest).count();
        Self { r: a, rhs: b, order, rank }
    }

    /// The x that minimises |A x − b| and is 0 in the columns that the others already span.
    pub fn solve(&self) -> DVector<f64> {
        let y = self.back_substitute(self.rhs.rows(0, self.rank).into_owned());
        let mut x = DVector::zeros(self.order.len());
        (0..self.rank).for_each(|k| x[self.order[k]] = y[k]);
        x
    }

    /// Diagonal of (AᵀA)⁻¹; `None` for a column that has a share in A's null space.
    pub fn inverse_normal_diagonal(&self) -> Vec<Option<f64>> {
        let inverse = self.inverse();
        let free = self.null_space();
        let mut diagonal = vec![None; self.order.len()];
        for k in (0..self.rank).filter(|&k| !free.row(k).iter().any(|v| v.abs() > NULL_SHARE)) {
            diagonal[self.order[k]] = Some(inverse.row(k).norm_squared());
        }
        diagonal
    }

    /// (AᵀA)⁻¹ in the order of A's columns; `None` where A has a null space.
    pub fn inverse_normal(&self) -> Option<DMatrix<f64>> {
        let n = self.order.len();
        if self.rank < n {
            return None;
        }
        let inverse = self.inverse();
        let normal = &inverse * inverse.transpose();
        let mut place = vec![0; n];
        self.order.iter().enumerate().for_each(|(k, &j)| place[j] = k);
        Some(DMatrix::from_fn(n, n, |i, j| normal[(place[i], place[j])]))
    }

    /// R₁₁⁻¹.
    fn inverse(&self) -> DMatrix<f64> {
        let columns: Vec<_> = (0..self.rank).map(|k| self.back_substitute(unit(self.rank, k))).collect();
        DMatrix::from_fn(self.rank, self.rank, |i, j| columns[j][i])
    }

    /// −R₁₁⁻¹R₁₂: what the pivoted columns must do to undo each column beyond the rank.
    fn null_space(&self) -> DMatrix<f64> {
        let beyond = self.order.len() - self.rank;
        let columns: Vec<_> = (0..beyond)
            .map(|j| self.back_substitute(self.r.view((0, self.rank + j), (self.rank, 1)).column(0).into_owned()))
            .collect();
        DMatrix::from_fn(self.rank, beyond, |i, j| -columns[j][i])
    }

    fn back_substitute(&self, mut y: DVector<f64>) -> DVector<f64> {
        for k in (0..self.rank).rev() {
            let known: f64 = (k + 1..self.rank).map(|j| self.r[(k, j)] * y[j]).sum();
            y[k] = (y[k] - known) / self.r[(k, k)];
        }
        y
    }
}

/// A share of a null-space vector above this is no rounding (columns of A have length 1).
const NULL_SHARE: f64 = 1e-7;

fn unit(n: usize, k: usize) -> DVector<f64> {
    DVector::from_fn(n, |i, _| if i == k { 1.0 } else { 0.0 })
}

/// The column from `k` on whose part below row `k` is longest; the first of equals.
fn longest(a: &DMatrix<f64>, k: usize) -> usize {
    let length = |j: usize| a.view((k, j), (a.nrows() - k, 1)).norm();
    let mut best = (k, length(k));
    for j in k + 1..a.ncols() {
        let l = length(j);
        if l > best.1 {
            best = (j, l);
        }
    }
    best.0
}

/// Reflects rows `k..` so that column `k` ends at its diagonal.
fn reflect(a: &mut DMatrix<f64>, b: &mut DVector<f64>, k: usize) {
    let rows = a.nrows() - k;
    let mut v = a.view((k, k), (rows, 1)).column(0).into_owned();
    let norm = v.norm();
    if norm == 0.0 {
        return;
    }
    let diagonal = -norm.copysign(v[0]);
    v[0] -= diagonal;
    let half = 0.5 * v.norm_squared();
    for j in k + 1..a.ncols() {
        let mut column = a.view_mut((k, j), (rows, 1));
        let share = v.dot(&column.column(0)) / half;
        column.column_mut(0).axpy(-share, &v, 1.0);
    }
    let mut rest = b.rows_mut(k, rows);
    let share = v.dot(&rest) / half;
    rest.axpy(-share, &v, 1.0);
    a.view_mut((k, k), (rows, 1)).fill(0.0);
    a[(k, k)] = diagonal;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_rank_system_is_solved_and_inverted() {
        let a = DMatrix::from_row_slice(4, 3, &[1.0, 2.0, 0.5, -1.0, 3.0, 0.25, 0.7, 0.1, -2.0, 4.0, 1.0, 1.0]);
        let x = DVector::from_vec(vec![1.5, -0.25, 3.0]);
        let qr = PivotedQr::new(a.clone(), &a * &x, 1e-13);
        assert_eq!(qr.rank, 3);
        assert!((qr.solve() - x).norm() < 1e-14);
        let inverse = qr.inverse_normal().expect("full rank");
        let identity = a.transpose() * &a * &inverse;
        assert!((identity - DMatrix::<f64>::identity(3, 3)).norm() < 1e-13);
        for (j, d) in qr.inverse_normal_diagonal().iter().enumerate() {
            assert!((d.expect("determined") / inverse[(j, j)] - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn a_repeated_column_leaves_the_others_determined() {
        let a = DMatrix::from_row_slice(4, 3, &[1.0, 2.0, 1.0, -1.0, 3.0, -1.0, 0.7, 0.1, 0.7, 4.0, 1.0, 4.0]);
        let qr = PivotedQr::new(a.clone(), DVector::from_element(4, 1.0), 1e-13);
        assert_eq!(qr.rank, 2);
        let diagonal = qr.inverse_normal_diagonal();
        assert!(diagonal[0].is_none() && diagonal[2].is_none() && qr.inverse_normal().is_none());
        let pair = a.columns(0, 2).into_owned();
        let expected = (pair.transpose() * &pair).try_inverse().expect("regular")[(1, 1)];
        assert!((diagonal[1].expect("determined") / expected - 1.0).abs() < 1e-13);
    }
}
