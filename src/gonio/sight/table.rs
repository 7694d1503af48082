//! Functions of one angle, interpolated: pieces as wide as the lobe's own scale, on each the polynomial through its Chebyshev nodes.

use std::f64::consts::PI;
use std::sync::LazyLock;

/// Nodes of a piece.
pub(super) const NODES: usize = 12;

/// `F` functions of an angle from 0 on, 0 beyond the last piece.
#[derive(Debug, Clone)]
pub(super) struct Table<const F: usize> {
    /// Ends of the pieces, from 0 on, ascending.
    ends: Vec<f64>,
    /// The piece that each of many equal steps of the whole range begins in.
    first: Vec<u32>,
    /// Steps over rad.
    per_rad: f64,
    /// Coefficients of each piece by powers of its own coordinate, −1 to 1. Those of a smooth function fall so fast by Chebyshev polynomials that their
    /// powers lose no digit that counts.
    pieces: Vec<[[f64; F]; NODES]>,
}

impl<const F: usize> Table<F> {
    /// Tabulates `f` between these ends (rad, ascending, the first 0, two at least).
    pub fn new(ends: Vec<f64>, f: impl Fn(f64) -> [f64; F]) -> Self {
        let pieces: Vec<_> = ends.windows(2).map(|e| coefficients(e[0], e[1], &f)).collect();
        let (steps, last) = (2 * pieces.len(), ends[pieces.len()]);
        let piece_at = |alpha: f64| ends.partition_point(|e| *e <= alpha).saturating_sub(1) as u32;
        let first = (0..steps).map(|k| piece_at(last * k as f64 / steps as f64)).collect();
        Self { first, per_rad: steps as f64 / last, ends, pieces }
    }

    /// The sum of these tables, which have the same ends, each times its weight.
    pub fn sum(tables: &[&Self; NODES], weights: &[f64; NODES]) -> Self {
        let mut sum = tables[0].clone();
        for (k, piece) in sum.pieces.iter_mut().enumerate() {
            *piece = std::array::from_fn(|j| {
                std::array::from_fn(|i| tables.iter().zip(weights).map(|(t, w)| w * t.pieces[k][j][i]).sum())
            });
        }
        sum
    }

    /// The functions at `alpha` ≥ 0.
    pub fn at(&self, alpha: f64) -> [f64; F] {
        let Some(first) = self.first.get((alpha * self.per_rad) as usize) else { return [0.0; F] };
        // Rounding may put an angle at a step's edge into the next step.
        let mut k = (*first as usize).saturating_sub(usize::from(self.ends[*first as usize] > alpha));
        while k + 1 < self.pieces.len() && self.ends[k + 1] <= alpha {
            k += 1;
        }
        let (from, to) = (self.ends[k], self.ends[k + 1]);
        polynomial(&self.pieces[k], (2.0 * alpha - from - to) / (to - from))
    }
}

/// cos(jθ) at the nodes' angles θ, and the nodes themselves at j = 1.
static COSINES: LazyLock<[[f64; NODES]; NODES]> = LazyLock::new(|| {
    let angle = |k: usize| PI * (k as f64 + 0.5) / NODES as f64;
    std::array::from_fn(|j| std::array::from_fn(|k| (j as f64 * angle(k)).cos()))
});

/// Where a function is asked for to be interpolated between `from` and `to`.
pub(super) fn nodes(from: f64, to: f64) -> [f64; NODES] {
    COSINES[1].map(|x| 0.5 * (from + to) + 0.5 * (to - from) * x)
}

/// What each node's value counts at `at`.
pub(super) fn weights(from: f64, to: f64, at: f64) -> [f64; NODES] {
    let angle = ((2.0 * at - from - to) / (to - from)).clamp(-1.0, 1.0).acos();
    let polynomials: [f64; NODES] = std::array::from_fn(|j| (j as f64 * angle).cos());
    std::array::from_fn(|k| {
        let terms = (1..NODES).map(|j| 2.0 * polynomials[j] * COSINES[j][k]);
        (1.0 + terms.sum::<f64>()) / NODES as f64
    })
}

/// Coefficients by powers of the Chebyshev polynomials: T₀ = 1, T₁ = x, Tⱼ₊₁ = 2x Tⱼ − Tⱼ₋₁.
static POWERS: LazyLock<[[f64; NODES]; NODES]> = LazyLock::new(|| {
    let mut all = [[0.0; NODES]; NODES];
    (all[0][0], all[1][1]) = (1.0, 1.0);
    for j in 2..NODES {
        all[j] = std::array::from_fn(|k| if k == 0 { 0.0 } else { 2.0 * all[j - 1][k - 1] } - all[j - 2][k]);
    }
    all
});

fn coefficients<const F: usize>(from: f64, to: f64, f: impl Fn(f64) -> [f64; F]) -> [[f64; F]; NODES] {
    let values = nodes(from, to).map(f);
    let by_polynomials: [[f64; F]; NODES] = std::array::from_fn(|j| {
        let scale = if j == 0 { 1.0 } else { 2.0 } / NODES as f64;
        std::array::from_fn(|i| scale * values.iter().zip(&COSINES[j]).map(|(v, cos)| v[i] * cos).sum::<f64>())
    });
    std::array::from_fn(|k| std::array::from_fn(|i| (k..NODES).map(|j| by_polynomials[j][i] * POWERS[j][k]).sum()))
}

/// The polynomial at x, in pairs of powers and pairs of pairs (Estrin), which wait for each other less than one sum after the other.
fn polynomial<const F: usize>(c: &[[f64; F]; NODES], x: f64) -> [f64; F] {
    const { assert!(NODES == 12, "three groups of four") };
    let (x2, x4) = (x * x, (x * x) * (x * x));
    std::array::from_fn(|i| {
        let four = |k: usize| (c[k][i] + x * c[k + 1][i]) + x2 * (c[k + 2][i] + x * c[k + 3][i]);
        four(0) + x4 * (four(4) + x4 * four(8))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_functions_come_back() {
        let table = Table::new(vec![0.0, 0.5, 1.5], |x| [(-x * x).exp(), x.sin()]);
        for k in 0..150 {
            let x = 0.01 * f64::from(k);
            let [a, b] = table.at(x);
            assert!((a - (-x * x).exp()).abs() < 1e-10 && (b - x.sin()).abs() < 1e-12, "{x}");
        }
        assert_eq!(table.at(1.5), [0.0; 2]);
    }
}
