//! The weights of given shapes: the smallest value of a quadratic in at most four unknowns, within their ranges and, on request,
//! with a bounded sum.

use nalgebra::{DMatrix, DVector};

/// Eigenvalues of the scaled matrix below this share of the largest count as 0: a few dozen roundings of its entries.
const RANK: f64 = 1e-14;

/// Where the unknowns may lie.
#[derive(Debug, Clone)]
pub(super) struct Feasible<'a> {
    /// Range of each.
    pub ranges: &'a [(f64, f64)],
    /// Largest sum of all, where there is one.
    pub cap: Option<f64>,
}

/// Where an unknown stands at the minimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stand {
    Free,
    Low,
    High,
}

/// The x within `feasible` that minimises xᵀGx − 2bᵀx, for a symmetric positive semi-definite G. Every set of unknowns at the
/// ends of their ranges is tried, so the minimum is global. Undetermined directions get the minimum-norm solution (columns
/// scaled to unit norm). NaN in, NaN out.
pub(super) fn minimise(gram: &DMatrix<f64>, b: &DVector<f64>, feasible: &Feasible<'_>) -> DVector<f64> {
    if gram.iter().chain(b).any(|v| v.is_nan()) {
        return DVector::repeat(b.len(), f64::NAN);
    }
    // Where all may be free that is the minimum; of equal minima it has the smallest norm.
    let free = solve_free(gram, b);
    if feasible.holds(&free) && !feasible.pinned() {
        return free;
    }
    let value = |x: &DVector<f64>| x.dot(&(gram * x)) - 2.0 * x.dot(b);
    let mut best: Option<(f64, DVector<f64>)> = None;
    for stands in feasible.stands() {
        for capped in [false, true] {
            let Some(x) = stationary(gram, b, feasible, &stands, capped).filter(|x| feasible.holds(x)) else {
                continue;
            };
            let value = value(&x);
            if best.as_ref().is_none_or(|(least, _)| value < *least) {
                best = Some((value, x));
            }
        }
    }
    // Rounding may leave no candidate exactly inside: the nearest point of the box serves.
    best.map_or_else(|| free.zip_map(&feasible.lows(), f64::max), |(_, x)| x)
}

impl Feasible<'_> {
    fn holds(&self, x: &DVector<f64>) -> bool {
        x.iter().zip(self.ranges).all(|(x, (low, high))| x >= low && x <= high)
            && self.cap.is_none_or(|cap| x.sum() <= cap * (1.0 + 4.0 * f64::EPSILON))
    }

    fn pinned(&self) -> bool {
        self.ranges.iter().any(|(low, high)| low == high)
    }

    fn lows(&self) -> DVector<f64> {
        DVector::from_iterator(self.ranges.len(), self.ranges.iter().map(|r| r.0))
    }

    /// All ways in which the unknowns can stand.
    fn stands(&self) -> Vec<Vec<Stand>> {
        let mut all = vec![Vec::new()];
        for (low, high) in self.ranges {
            let mut choices = vec![Stand::Low];
            if low < high {
                choices.push(Stand::Free);
                if high.is_finite() {
                    choices.push(Stand::High);
                }
            }
            all = all
                .into_iter()
                .flat_map(|set: Vec<Stand>| choices.iter().map(move |c| set.iter().copied().chain([*c]).collect()))
                .collect();
        }
        all
    }

    /// Whether an unknown may move either way from `x`, and whether the cap is reached: what a small change of the data can move.
    pub fn free_at(&self, x: &DVector<f64>) -> (Vec<usize>, bool) {
        let inside = |i: &usize| x[*i] > self.ranges[*i].0 && x[*i] < self.ranges[*i].1;
        let capped = self.cap.is_some_and(|cap| x.sum() >= cap * (1.0 - 1e-12));
        ((0..x.len()).filter(inside).collect(), capped)
    }
}

/// The stationary point with the unknowns where `stands` says, on the cap where `capped`.
fn stationary(
    gram: &DMatrix<f64>,
    b: &DVector<f64>,
    feasible: &Feasible<'_>,
    stands: &[Stand],
    capped: bool,
) -> Option<DVector<f64>> {
    let mut x = DVector::from_fn(b.len(), |i, _| match stands[i] {
        Stand::Low => feasible.ranges[i].0,
        Stand::High => feasible.ranges[i].1,
        Stand::Free => 0.0,
    });
    let free: Vec<usize> = (0..b.len()).filter(|&i| stands[i] == Stand::Free).collect();
    if capped && (feasible.cap.is_none() || free.is_empty()) {
        return None;
    }
    let rest = (b - gram * &x).select_rows(&free);
    let matrix = gram.select_rows(&free).select_columns(&free);
    let sum = capped.then(|| feasible.cap.unwrap_or(0.0) - x.sum());
    let solved = solve_on_plane(&matrix, &rest, sum)?;
    free.iter().zip(solved.iter()).for_each(|(&i, v)| x[i] = *v);
    Some(x)
}

/// Solution of G x = b; with `sum`, the minimiser among the x of that sum.
pub(super) fn solve_on_plane(gram: &DMatrix<f64>, b: &DVector<f64>, sum: Option<f64>) -> Option<DVector<f64>> {
    let plain = solve_free(gram, b);
    let Some(sum) = sum else { return Some(plain) };
    let along = solve_free(gram, &DVector::repeat(b.len(), 1.0));
    let weight = along.sum();
    (weight > 0.0).then(|| &plain - along * ((plain.sum() - sum) / weight))
}

/// Minimum-norm solution of G x = b after scaling columns to unit norm.
pub(super) fn solve_free(gram: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    if b.is_empty() {
        return DVector::zeros(0);
    }
    let (scaled, scale) = unit_columns(gram);
    let rhs = b.component_mul(&scale);
    if let Some(x) = cholesky(&scaled, &rhs) {
        return x.component_mul(&scale);
    }
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|l| if l > RANK * largest { 1.0 / l } else { 0.0 });
    let projected = (eigen.eigenvectors.transpose() * rhs).component_mul(&inverse);
    (eigen.eigenvectors * projected).component_mul(&scale)
}

/// A Gram matrix with its columns scaled to unit norm, and the scales; a column of zeros stays.
pub(super) fn unit_columns(gram: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let scale = gram.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| gram[(i, j)] * scale[i] * scale[j]);
    (scaled, scale)
}

/// The quick way, where no pivot of the scaled matrix says that it is nearly singular.
fn cholesky(scaled: &DMatrix<f64>, rhs: &DVector<f64>) -> Option<DVector<f64>> {
    let factor = scaled.clone().cholesky()?;
    let least = factor.l_dirty().diagonal().min();
    (least > 1e-4).then(|| factor.solve(rhs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    const ANY: [(f64, f64); 2] = [(0.0, f64::INFINITY); 2];

    fn solve(gram: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
        minimise(gram, b, &Feasible { ranges: &ANY, cap: None })
    }

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
        assert!((x - dvector![1.0, 1.0]).norm() < 1e-14);
        // A column of zeros has weight 0.
        let x = solve(&dmatrix![4.0, 0.0; 0.0, 0.0], &dvector![8.0, 0.0]);
        assert!((x - dvector![2.0, 0.0]).norm() < 1e-14);
    }

    #[test]
    fn nan_is_not_hidden() {
        assert!(solve(&dmatrix![f64::NAN, 0.0; 0.0, 1.0], &dvector![1.0, 1.0]).iter().any(|v| v.is_nan()));
    }

    #[test]
    fn boxes_and_caps_hold_and_no_feasible_point_is_lower() {
        let g = dmatrix![2.0, 0.7, 0.1; 0.7, 1.0, 0.3; 0.1, 0.3, 1.5];
        let b = dvector![1.0, 1.4, 0.2];
        let value = |x: &DVector<f64>| x.dot(&(&g * x)) - 2.0 * x.dot(&b);
        for (ranges, cap) in [
            ([(0.0, 0.3), (0.0, f64::INFINITY), (0.0, 1.0)], None),
            ([(0.2, 0.2), (0.0, 0.5), (0.0, 1.0)], None),
            ([(0.0, 2.0), (0.0, 2.0), (0.0, 2.0)], Some(1.0)),
            ([(0.1, 0.9), (0.0, 0.4), (0.3, 2.0)], Some(0.8)),
        ] {
            let feasible = Feasible { ranges: &ranges, cap };
            let x = minimise(&g, &b, &feasible);
            assert!(feasible.holds(&x), "{x}");
            let steps = 24;
            for k in 0..(steps + 1i32).pow(3) {
                let at =
                    |k: i32, (low, high): (f64, f64)| low + (high.min(2.0) - low) * f64::from(k) / f64::from(steps);
                let (i, j, l) = (k % 25, k / 25 % 25, k / 625);
                let other = dvector![at(i, ranges[0]), at(j, ranges[1]), at(l, ranges[2])];
                assert!(!feasible.holds(&other) || value(&other) >= value(&x) - 1e-12, "{other} below {x}");
            }
        }
    }
}
