//! Non-negative least squares in a few unknowns, from normal equations.

use nalgebra::{DMatrix, DVector};

/// Eigenvalues of the scaled Gram matrix below this share of the largest count as 0: a few dozen roundings of its entries.
const RANK: f64 = 1e-14;

/// x ≥ 0 that minimises xᵀGx − 2bᵀx, for a symmetric positive semi-definite G of at most a handful of rows: every set of
/// positive unknowns is tried, so the minimum is global. Undetermined directions get the minimum-norm solution (columns
/// scaled to unit norm).
pub(super) fn solve(gram: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = b.len();
    // Where all may be positive that is the minimum; of equal minima it has the smallest norm.
    let free = solve_free(gram, b);
    if free.iter().all(|v| *v >= 0.0 || v.is_nan()) {
        return free; // NaN included: it must not turn into a number
    }
    let mut best = (0.0, DVector::zeros(n));
    for set in 1u32..(1 << n) - 1 {
        let active: Vec<usize> = (0..n).filter(|i| set >> i & 1 == 1).collect();
        let x = solve_free(&gram.select_rows(&active).select_columns(&active), &b.select_rows(&active));
        if x.iter().all(|v| *v >= 0.0) {
            // At the minimiser of a subset the value is −bᵀx.
            let value = -b.select_rows(&active).dot(&x);
            if value < best.0 {
                let mut full = DVector::zeros(n);
                active.iter().zip(x.iter()).for_each(|(&i, v)| full[i] = *v);
                best = (value, full);
            }
        }
    }
    best.1
}

/// Minimum-norm solution of G x = b after scaling columns to unit norm.
pub(super) fn solve_free(gram: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    if b.is_empty() {
        return DVector::zeros(0);
    }
    let scale = gram.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(b.len(), b.len(), |i, j| gram[(i, j)] * scale[i] * scale[j]);
    let rhs = b.component_mul(&scale);
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|l| if l > RANK * largest { 1.0 / l } else { 0.0 });
    let projected = (eigen.eigenvectors.transpose() * rhs).component_mul(&inverse);
    (eigen.eigenvectors * projected).component_mul(&scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    #[test]
    fn free_where_positive_and_on_the_boundary_where_not() {
        let g = dmatrix![2.0, 1.0; 1.0, 3.0];
        let x = solve(&g, &dvector![4.0, 7.0]);
        assert!((x - dvector![1.0, 2.0]).norm() < 1e-14);
        // Unconstrained: x₀ < 0; the boundary minimum is x₁ = b₁/G₁₁.
        let x = solve(&g, &dvector![-1.0, 6.0]);
        assert_eq!(x[0], 0.0);
        assert!((x[1] - 2.0).abs() < 1e-14);
        assert_eq!(solve(&g, &dvector![-1.0, -2.0]), dvector![0.0, 0.0]);
    }

    #[test]
    fn an_undetermined_direction_gets_the_minimum_norm() {
        let x = solve(&dmatrix![1.0, 1.0; 1.0, 1.0], &dvector![2.0, 2.0]);
        assert!((x - dvector![1.0, 1.0]).norm() < 1e-12);
        assert_eq!(solve(&dmatrix![0.0], &dvector![0.0]), dvector![0.0]);
    }

    #[test]
    fn columns_of_very_different_scale_keep_their_digits() {
        let (a, c, x, y) = (1e-20, 1e12, 3e10, 2e-6);
        let cross = 0.5 * f64::sqrt(a * c);
        let got = solve(&dmatrix![a, cross; cross, c], &dvector![a * x + cross * y, cross * x + c * y]);
        assert!((got[0] / x - 1.0).abs() < 1e-14 && (got[1] / y - 1.0).abs() < 1e-14, "{got}");
    }
}
