//! Functions of one angle, interpolated: pieces as wide as the lobe's own scale, a Chebyshev polynomial on each.

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
    /// Chebyshev coefficients of each piece.
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
        clenshaw(&self.pieces[k], (2.0 * alpha - from - to) / (to - from))
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

fn coefficients<const F: usize>(from: f64, to: f64, f: impl Fn(f64) -> [f64; F]) -> [[f64; F]; NODES] {
    let values = nodes(from, to).map(f);
    std::array::from_fn(|j| {
        let scale = if j == 0 { 1.0 } else { 2.0 } / NODES as f64;
        std::array::from_fn(|i| scale * values.iter().zip(&COSINES[j]).map(|(v, cos)| v[i] * cos).sum::<f64>())
    })
}

fn clenshaw<const F: usize>(piece: &[[f64; F]; NODES], x: f64) -> [f64; F] {
    let (mut next, mut after) = ([0.0; F], [0.0; F]);
    for c in piece[1..].iter().rev() {
        for i in 0..F {
            (next[i], after[i]) = (c[i] + 2.0 * x * next[i] - after[i], next[i]);
        }
    }
    std::array::from_fn(|i| piece[0][i] + x * next[i] - after[i])
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
