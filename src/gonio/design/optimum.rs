//! The best shares of the time: the weights on candidates that maximise the mean over the prior of ln det of the information.
//!
//! The multiplicative algorithm (Titterington 1976; Silvey, Titterington & Torsney 1978; monotone: Yu 2010): each weight times the mean over the
//! prior of its gᵀM⁻¹g over the number of parameters. The equivalence theorem (Kiefer & Wolfowitz 1960; averaged: Whittle 1973) tells how far the
//! optimum still is: mean ln det can rise by no more than max d − p, d being that mean.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// What each candidate tells a second, for every draw of the prior: vectors h with information h hᵀ.
#[derive(Debug, Clone)]
pub(super) struct Table {
    /// Number of parameters.
    pub parameters: usize,
    /// One list a draw: candidate by candidate `parameters` numbers.
    pub draws: Vec<Vec<f64>>,
}

/// Weights, and how far they are from the best.
#[derive(Debug, Clone)]
pub(super) struct Optimum {
    /// Shares of the time, adding up to 1.
    pub weights: Vec<f64>,
    /// Mean over the prior of ln det.
    pub mean_ln_det: f64,
    /// By how much it can rise at most.
    pub gap: f64,
}

/// Enough: the D-efficiency exp(−gap/p) is above this.
const EFFICIENCY: f64 = 0.99;
const ROUNDS: usize = 2000;
/// Rounds between which candidates of no weight are dropped.
const DROP_EVERY: usize = 20;
/// Share of the largest weight below which a candidate has none, if it does not ask for more either.
const NOTHING: f64 = 1e-6;

impl Table {
    /// Number of candidates.
    pub fn len(&self) -> usize {
        self.draws.first().map_or(0, |d| d.len() / self.parameters)
    }

    /// The candidates `kept` alone.
    pub fn picked(&self, kept: &[usize]) -> Self {
        let p = self.parameters;
        let of = |list: &Vec<f64>| kept.iter().flat_map(|&x| list[x * p..(x + 1) * p].iter().copied()).collect();
        Self { parameters: p, draws: self.draws.iter().map(of).collect() }
    }

    /// Leaves out the draws of which even all candidates together don't tell the parameters, and says how many.
    pub fn drop_undetermined(&mut self) -> usize {
        let before = self.draws.len();
        let even = vec![1.0; self.len()];
        let p = self.parameters;
        self.draws.retain(|draw| scaled_cholesky(&information(p, draw, &even)).is_some());
        before - self.draws.len()
    }

    /// Mean over the prior of ln det of the information of these weights, −∞ where one is singular.
    pub fn mean_ln_det(&self, weights: &[f64]) -> f64 {
        let of = |draw: &Vec<f64>| {
            let m = information(self.parameters, draw, weights);
            scaled_cholesky(&m).map_or(f64::NEG_INFINITY, |(factor, ln_scale)| {
                ln_scale + 2.0 * factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>()
            })
        };
        let all: Vec<f64> = self.draws.par_iter().map(of).collect();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    }

    /// Mean over the prior of hᵀM⁻¹h, candidate by candidate; `None` where M is singular.
    fn mean_variance(&self, weights: &[f64]) -> Option<Vec<f64>> {
        let p = self.parameters;
        let of = |draw: &Vec<f64>| -> Option<Vec<f64>> {
            let m = information(p, draw, weights);
            let inverse = m.clone().cholesky().map(|c| c.inverse()).filter(|i| i.iter().all(|x| x.is_finite()))?;
            Some(draw.chunks_exact(p).map(|h| quadratic(&inverse, h)).collect())
        };
        let lists: Vec<Option<Vec<f64>>> = self.draws.par_iter().map(of).collect();
        let mut sum = vec![0.0; self.len()];
        for list in lists {
            sum.iter_mut().zip(&list?).for_each(|(s, d)| *s += d);
        }
        let n = self.draws.len() as f64;
        sum.iter_mut().for_each(|s| *s /= n);
        Some(sum)
    }
}

fn quadratic(m: &DMatrix<f64>, h: &[f64]) -> f64 {
    let h = DVector::from_column_slice(h);
    h.dot(&(m * &h))
}

/// Σ w h hᵀ.
pub(super) fn information(p: usize, draw: &[f64], weights: &[f64]) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(p, p);
    for (h, w) in draw.chunks_exact(p).zip(weights).filter(|(_, w)| **w > 0.0) {
        for a in 0..p {
            for b in 0..=a {
                m[(a, b)] += w * h[a] * h[b];
            }
        }
    }
    m.fill_upper_triangle_with_lower_triangle();
    m
}

/// The factor of M scaled to a diagonal of ones, and the ln of what its determinant was divided by. `None` where M is singular to rounding.
fn scaled_cholesky(m: &DMatrix<f64>) -> Option<(nalgebra::Cholesky<f64, nalgebra::Dyn>, f64)> {
    let diagonal = m.diagonal();
    if !diagonal.iter().all(|d| *d > 0.0 && d.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |a, b| m[(a, b)] / (diagonal[a] * diagonal[b]).sqrt());
    let factor = scaled.cholesky()?;
    let least = factor.l_dirty().diagonal().iter().copied().fold(f64::INFINITY, f64::min);
    // Pivots are at most 1: below √ε nothing but rounding is left.
    (least > 1e-7).then(|| (factor, diagonal.iter().map(|d| d.ln()).sum()))
}

/// The best weights of the table's candidates, to the efficiency that is enough. `None` where the candidates don't tell the parameters.
pub(super) fn best(table: &Table) -> Option<Optimum> {
    let n = table.len();
    let p = table.parameters as f64;
    let mut kept: Vec<usize> = (0..n).collect();
    let mut active = table.clone();
    let mut weights = vec![1.0 / n as f64; n];
    for round in 1..=ROUNDS {
        let d = active.mean_variance(&weights)?;
        let most = d.iter().copied().fold(0.0, f64::max);
        if most - p <= -p * EFFICIENCY.ln() {
            break;
        }
        weights.iter_mut().zip(&d).for_each(|(w, d)| *w *= d / p);
        if round % DROP_EVERY == 0 {
            drop_nothing(&mut kept, &mut active, &mut weights, &d, p);
        }
    }
    let mut all = vec![0.0; n];
    kept.iter().zip(&weights).for_each(|(&x, w)| all[x] = *w);
    // Against all candidates, those dropped too.
    let d = table.mean_variance(&all)?;
    let gap = (d.iter().copied().fold(0.0, f64::max) - p).max(0.0);
    Some(Optimum { mean_ln_det: table.mean_ln_det(&all), weights: all, gap })
}

/// Drops candidates whose weight has gone and that don't ask for more.
fn drop_nothing(kept: &mut Vec<usize>, active: &mut Table, weights: &mut Vec<f64>, d: &[f64], p: f64) {
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let stays: Vec<usize> = (0..kept.len()).filter(|&x| weights[x] > NOTHING * largest || d[x] > p).collect();
    if stays.len() < kept.len() {
        *active = active.picked(&stays);
        *kept = stays.iter().map(|&x| kept[x]).collect();
        *weights = stays.iter().map(|&x| weights[x]).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parabola on [−1, 1]: a third of the readings at each end and in the middle (Smith 1918), det = 4/27.
    #[test]
    fn a_parabola_is_read_at_both_ends_and_in_the_middle() {
        let at: Vec<f64> = (-20..=20).map(|k| f64::from(k) / 20.0).collect();
        let table = Table { parameters: 3, draws: vec![at.iter().flat_map(|x| [1.0, *x, x * x]).collect()] };
        let best = best(&table).expect("determined");
        assert!(best.gap <= -3.0 * EFFICIENCY.ln() && best.weights.iter().sum::<f64>() - 1.0 < 1e-12);
        let want = (4.0f64 / 27.0).ln();
        assert!(best.mean_ln_det <= want + 1e-12 && want - best.mean_ln_det <= best.gap + 1e-12);
        let near =
            |x: f64| at.iter().zip(&best.weights).filter(|(a, _)| (*a - x).abs() < 0.16).map(|(_, w)| w).sum::<f64>();
        for x in [-1.0, 0.0, 1.0] {
            assert!((near(x) - 1.0 / 3.0).abs() < 0.02, "{x}: {}", near(x));
        }
    }

    #[test]
    fn what_no_candidate_tells_is_found() {
        let table = Table {
            parameters: 2,
            draws: vec![vec![1.0, 2.0, 2.0, 4.0, 3.0, 6.0], vec![1.0, 0.0, 0.0, 1.0, 1.0, 1.0]],
        };
        assert_eq!(table.clone().drop_undetermined(), 1);
        assert_eq!(table.mean_ln_det(&[1.0, 1.0, 1.0]), f64::NEG_INFINITY);
    }
}
