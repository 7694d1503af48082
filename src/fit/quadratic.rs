//! The weights of given shapes: the smallest value of a quadratic in at most four unknowns, within their ranges and, on request,
//! with a bounded sum. A search solves some hundred thousands of them, so they stand on the stack.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

use crate::brdf::MAX_LOBES;

/// Eigenvalues of the scaled matrix below this share of the largest count as 0: a few dozen roundings of its entries.
const RANK: f64 = 1e-14;
/// A matrix of columns of length 1 with a pivot below this is nearly singular.
const LEAST_PIVOT: f64 = 1e-8;

/// A column whose Gram entry is below this counts as 0: data of about 1, as samples are scaled, would take a weight of 10¹³.
const INVISIBLE: f64 = 1e-26;

/// A number for each unknown, 0 beyond the last.
pub(super) type Row = [f64; MAX_LOBES];

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
    Low,
    Free,
    High,
}

/// xᵀGx − 2bᵀx, for a symmetric positive semi-definite G.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quadratic {
    n: usize,
    gram: [Row; MAX_LOBES],
    b: Row,
}

impl Quadratic {
    /// In `n` unknowns; those of columns that are 0, or as good as that, don't count.
    pub fn new(n: usize, gram: impl Fn(usize, usize) -> f64, b: impl Fn(usize) -> f64) -> Self {
        // NaN is visible, so that it is not hidden.
        let visible: [bool; MAX_LOBES] =
            std::array::from_fn(|i| i < n && (gram(i, i) >= INVISIBLE || gram(i, i).is_nan()));
        let row = |of: &dyn Fn(usize) -> f64| -> Row { std::array::from_fn(|j| if visible[j] { of(j) } else { 0.0 }) };
        let gram = std::array::from_fn(|i| if visible[i] { row(&|j| gram(i, j)) } else { Row::default() });
        Self { n, gram, b: row(&b) }
    }

    /// xᵀGx − 2bᵀx.
    pub fn value(&self, x: &Row) -> f64 {
        (0..self.n).map(|i| x[i] * (dot(&self.gram[i], x) - 2.0 * self.b[i])).sum()
    }

    /// The x within `feasible` that minimises it. Every set of unknowns at the ends of their ranges is tried, so the minimum is
    /// global. Undetermined directions get the minimum-norm solution (columns scaled to unit norm). NaN in, NaN out; NaN too where nothing
    /// is feasible.
    pub fn minimise(&self, feasible: &Feasible<'_>) -> Row {
        if self.gram.iter().flatten().chain(&self.b).any(|v| v.is_nan()) {
            return [f64::NAN; MAX_LOBES];
        }
        // Where all may be free that is the minimum; of equal minima it has the smallest norm.
        let free = self.solve();
        if feasible.holds(&free) && !feasible.pinned() {
            return free;
        }
        let mut best: Option<(f64, Row)> = None;
        let mut stands = [Stand::Low; MAX_LOBES];
        loop {
            for sum in [None, feasible.cap].into_iter().take(if feasible.cap.is_some() { 2 } else { 1 }) {
                // A point made for the largest sum has it, but for rounding that may be larger than a test would pass.
                let fits = |x: &Row| if sum.is_some() { feasible.holds_each(x) } else { feasible.holds(x) };
                let Some(x) = self.stationary(feasible, stands, sum).filter(fits) else { continue };
                let value = self.value(&x);
                if best.as_ref().is_none_or(|(least, _)| value < *least) {
                    best = Some((value, x));
                }
            }
            if !feasible.next(&mut stands) {
                break;
            }
        }
        best.map_or([f64::NAN; MAX_LOBES], |(_, x)| x)
    }

    /// The stationary point with the unknowns where `stands` says, and of that `sum` on request.
    fn stationary(&self, feasible: &Feasible<'_>, stands: [Stand; MAX_LOBES], sum: Option<f64>) -> Option<Row> {
        let mut x = Row::default();
        for (i, (low, high)) in feasible.ranges.iter().enumerate() {
            x[i] = match stands[i] {
                Stand::Low => *low,
                Stand::High => *high,
                Stand::Free => 0.0,
            };
        }
        let is_free = |i: usize| stands[i] == Stand::Free;
        if sum.is_some() && !(0..self.n).any(is_free) {
            return None;
        }
        let rest = |i: usize| self.b[i] - dot(&self.gram[i], &x);
        let solved = self.with(rest).solve_on_plane(is_free, sum.map(|sum| sum - x.iter().sum::<f64>()))?;
        (0..self.n).filter(|&i| is_free(i)).for_each(|i| x[i] = solved[i]);
        Some(x)
    }

    /// The same matrix with another b.
    pub fn with(&self, b: impl Fn(usize) -> f64) -> Self {
        Self { b: std::array::from_fn(|i| if i < self.n { b(i) } else { 0.0 }), ..*self }
    }

    /// The x that is 0 where not `free` and minimises over the others; with `sum`, among the x of that sum.
    pub fn solve_on_plane(&self, free: impl Fn(usize) -> bool, sum: Option<f64>) -> Option<Row> {
        let mut places = [0; MAX_LOBES];
        let mut n = 0;
        for i in (0..self.n).filter(|&i| free(i)) {
            places[n] = i;
            n += 1;
        }
        let part = Self::new(n, |i, j| self.gram[places[i]][places[j]], |i| self.b[places[i]]);
        let mut x = part.solve();
        if let Some(sum) = sum {
            let along = part.with(|_| 1.0).solve();
            let weight: f64 = along.iter().sum();
            if weight.is_nan() || weight <= 0.0 {
                return None;
            }
            let excess = (x.iter().sum::<f64>() - sum) / weight;
            x.iter_mut().zip(&along).for_each(|(x, a)| *x -= a * excess);
        }
        let mut all = Row::default();
        (0..n).for_each(|i| all[places[i]] = x[i]);
        Some(all)
    }

    /// Minimum-norm solution of G x = b after scaling columns to unit norm.
    pub fn solve(&self) -> Row {
        let scale: Row = std::array::from_fn(|i| {
            let d = self.gram[i][i];
            if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
        });
        let scaled = Self::new(self.n, |i, j| self.gram[i][j] * scale[i] * scale[j], |i| self.b[i] * scale[i]);
        let x = scaled.cholesky().unwrap_or_else(|| scaled.by_eigenvalues());
        std::array::from_fn(|i| x[i] * scale[i])
    }

    /// The quick way, where no pivot says that the matrix is nearly singular.
    fn cholesky(&self) -> Option<Row> {
        let (n, mut l, mut x) = (self.n, self.gram, self.b);
        for j in 0..n {
            let pivot = l[j][j] - (0..j).map(|k| l[j][k] * l[j][k]).sum::<f64>();
            if pivot.is_nan() || pivot <= LEAST_PIVOT {
                return None;
            }
            l[j][j] = pivot.sqrt();
            for i in j + 1..n {
                l[i][j] = (l[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>()) / l[j][j];
            }
            x[j] = (x[j] - (0..j).map(|k| l[j][k] * x[k]).sum::<f64>()) / l[j][j];
        }
        for j in (0..n).rev() {
            x[j] = (x[j] - (j + 1..n).map(|k| l[k][j] * x[k]).sum::<f64>()) / l[j][j];
        }
        Some(x)
    }

    /// The sure way; the rows beyond the last unknown are 0 and count as undetermined.
    fn by_eigenvalues(&self) -> Row {
        let eigen = Matrix4::from_fn(|i, j| self.gram[i][j]).symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let inverse = eigen.eigenvalues.map(|l| if l > RANK * largest { 1.0 / l } else { 0.0 });
        let projected = (eigen.eigenvectors.transpose() * Vector4::from(self.b)).component_mul(&inverse);
        (eigen.eigenvectors * projected).into()
    }
}

/// a·b.
fn dot(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Feasible<'_> {
    /// Whether every unknown is within its range.
    fn holds_each(&self, x: &Row) -> bool {
        x.iter().zip(self.ranges).all(|(x, (low, high))| x >= low && x <= high)
    }

    fn holds(&self, x: &Row) -> bool {
        self.holds_each(x) && self.cap.is_none_or(|cap| x.iter().sum::<f64>() <= cap * (1.0 + 4.0 * f64::EPSILON))
    }

    fn pinned(&self) -> bool {
        self.ranges.iter().any(|(low, high)| low == high)
    }

    /// Goes on to the next way in which the unknowns can stand; false after the last.
    fn next(&self, stands: &mut [Stand; MAX_LOBES]) -> bool {
        for (stand, (low, high)) in stands.iter_mut().zip(self.ranges).rev() {
            *stand = match *stand {
                Stand::Low if low < high => Stand::Free,
                Stand::Free if high.is_finite() => Stand::High,
                _ => Stand::Low,
            };
            if *stand != Stand::Low {
                return true;
            }
        }
        false
    }

    /// Whether an unknown may move either way from `x`, and whether the cap is reached: what a small change of the data can move.
    pub fn free_at(&self, x: &DVector<f64>) -> (Vec<usize>, bool) {
        let inside = |i: &usize| x[*i] > self.ranges[*i].0 && x[*i] < self.ranges[*i].1;
        let capped = self.cap.is_some_and(|cap| x.sum() >= cap * (1.0 - 1e-12));
        ((0..x.len()).filter(inside).collect(), capped)
    }
}

/// A Gram matrix with its columns scaled to unit norm, and the scales; a column of zeros stays.
pub(super) fn unit_columns(gram: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let scale = gram.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| gram[(i, j)] * scale[i] * scale[j]);
    (scaled, scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    fn minimise(gram: &DMatrix<f64>, b: &DVector<f64>, feasible: &Feasible<'_>) -> DVector<f64> {
        let quadratic = Quadratic::new(b.len(), |i, j| gram[(i, j)], |i| b[i]);
        DVector::from_column_slice(&quadratic.minimise(feasible)[..b.len()])
    }

    fn holds(feasible: &Feasible<'_>, x: &DVector<f64>) -> bool {
        feasible.holds(&std::array::from_fn(|i| x.get(i).copied().unwrap_or(0.0)))
    }

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
        // A column of zeros has weight 0, and so has one that is next to nothing.
        let x = solve(&dmatrix![4.0, 1e-150; 1e-150, 1e-300], &dvector![8.0, 1e-151]);
        assert_eq!(x[1], 0.0);
        let x = solve(&dmatrix![4.0, 0.0; 0.0, 0.0], &dvector![8.0, 0.0]);
        assert!((x - dvector![2.0, 0.0]).norm() < 1e-14);
    }

    /// Of nearly equal columns the free solution is large, and so is the rounding of a sum that is brought down to the cap.
    #[test]
    fn the_optimum_on_the_cap_is_found_whatever_its_rounding() {
        let mut rng = crate::numeric::random::stream(4, crate::numeric::random::Purpose::Study, 2);
        let mut draw = || crate::numeric::random::RngExt::random::<f64>(&mut rng);
        for _ in 0..2000 {
            let apart = 10f64.powf(-2.0 - 1.5 * draw());
            let g = dmatrix![1.0, 1.0 - apart; 1.0 - apart, 1.0];
            let b = dvector![1.0 + draw(), 1.0 + draw()];
            let cap = 0.2 + 0.5 * draw();
            let x = minimise(&g, &b, &Feasible { ranges: &ANY, cap: Some(cap) });
            // On the edge x₀ + x₁ = cap the cost is a parabola in x₀.
            let slope = b[0] - b[1] + cap * apart;
            let best = (slope / (2.0 * apart)).clamp(0.0, cap);
            assert!((x[0] - best).abs() < 1e-9 && (x.sum() - cap).abs() < 1e-12, "{apart:e} {b} {cap}: {x} {best}");
        }
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
            assert!(holds(&feasible, &x), "{x}");
            let steps = 24;
            for k in 0..(steps + 1i32).pow(3) {
                let at =
                    |k: i32, (low, high): (f64, f64)| low + (high.min(2.0) - low) * f64::from(k) / f64::from(steps);
                let (i, j, l) = (k % 25, k / 25 % 25, k / 625);
                let other = dvector![at(i, ranges[0]), at(j, ranges[1]), at(l, ranges[2])];
                assert!(!holds(&feasible, &other) || value(&other) >= value(&x) - 1e-12, "{other} below {x}");
            }
        }
    }
}
