//! Starts without a guess: the reduced cost on a lattice of shapes one octave apart, from a single pass over the samples.

use nalgebra::{DMatrix, DVector};

use super::nnls;
use super::options::FitError;
use super::passes::{basis, dot};
use super::samples::Samples;
use super::solver::Linearize;
use super::varpro::Profile;
use crate::brdf::LobeKind;
use crate::brdf::lobe::octave;
use crate::numeric::sum::fold_blocks;

/// Starts polished at most.
const MOST_STARTS: usize = 3;
/// Lattice combinations kept while lobes are added one by one.
const BEAM: usize = 24;

/// Starts for the solver, the most promising first. One empty start where there is nothing to search.
///
/// Every lobe of the model with a shape has one shape parameter and they are of one kind (the closed set of lobes sees to it),
/// so one lattice serves all of them.
pub(super) fn starts(problem: &Profile<'_>) -> Vec<Vec<f64>> {
    match problem.layout.len() {
        0 => vec![Vec::new()],
        1 => single(problem),
        many => several(problem, many),
    }
}

/// A smaller model's optimum with one lobe more, where that lobe helps most among shapes an octave apart.
pub(super) fn extended(problem: &Profile<'_>, smaller: &DVector<f64>) -> Result<Vec<f64>, FitError> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    for node in nodes(problem) {
        let t = smaller.push(node.ln());
        let cost = problem.cost(&t).map_err(|e| FitError::Solver { reason: e.to_string() })?;
        if best.as_ref().is_none_or(|(lowest, _)| cost < *lowest) {
            best = Some((cost, t.as_slice().to_vec()));
        }
    }
    best.map(|(_, t)| t).ok_or_else(|| FitError::Solver { reason: "no start".into() })
}

/// Shapes an octave apart over the range that is searched.
fn nodes(problem: &Profile<'_>) -> Vec<f64> {
    let (low, high) = problem.layout[0].1.bounds;
    let octaves = (high / low).log2().floor() as usize + 1;
    (0..octaves).map(|k| octave(low, k)).collect()
}

/// Sums over the lattice: column 0 … base−1 the lobes without a shape, then one column a node, then one slope a node.
struct Lattice {
    /// ln(shape) at the nodes.
    t: Vec<f64>,
    base: usize,
    gram: Vec<DMatrix<f64>>,
    data: Vec<DVector<f64>>,
    energy: f64,
}

impl Lattice {
    fn node(&self, k: usize) -> usize {
        self.base + k
    }

    fn slope(&self, k: usize) -> usize {
        self.base + self.t.len() + k
    }

    fn gram(&self, channel: usize) -> &DMatrix<f64> {
        if self.gram.len() == 1 { &self.gram[0] } else { &self.gram[channel] }
    }

    /// Reduced cost with the lobes at these nodes, and the weights of each channel.
    fn cost(&self, nodes: &[usize]) -> (f64, Vec<DVector<f64>>) {
        let columns: Vec<usize> = (0..self.base).chain(nodes.iter().map(|&k| self.node(k))).collect();
        let mut cost = self.energy;
        let weights = (0..self.data.len())
            .map(|c| {
                let b = self.data[c].select_rows(&columns);
                let x = nnls::solve(&self.gram(c).select_rows(&columns).select_columns(&columns), &b);
                cost -= b.dot(&x);
                x
            })
            .collect();
        (cost, weights)
    }

    /// dC/dt of the one-lobe cost at node `k`.
    fn derivative(&self, k: usize, weights: &[DVector<f64>]) -> f64 {
        let along = |c: usize, x: &DVector<f64>| {
            let gram = self.gram(c);
            let model: f64 = (0..self.base).map(|l| x[l] * gram[(self.slope(k), l)]).sum::<f64>()
                + x[self.base] * gram[(self.slope(k), self.node(k))];
            2.0 * x[self.base] * (model - self.data[c][self.slope(k)])
        };
        weights.iter().enumerate().map(|(c, x)| along(c, x)).sum()
    }
}

/// Every bracketed minimum of the one-lobe cost, and the ends where it falls outwards.
fn single(problem: &Profile<'_>) -> Vec<Vec<f64>> {
    let lattice = tabulate(problem, false);
    let nodes: Vec<(f64, f64, f64)> = (0..lattice.t.len())
        .map(|k| {
            let (cost, weights) = lattice.cost(&[k]);
            (lattice.t[k], cost, lattice.derivative(k, &weights))
        })
        .collect();
    let mut found: Vec<(f64, f64)> = nodes.windows(2).filter_map(|pair| hermite_minimum(pair[0], pair[1])).collect();
    if let (Some(&(t0, c0, d0)), Some(&(t1, c1, d1))) = (nodes.first(), nodes.last()) {
        found.extend((d0 > 0.0).then_some((c0, t0)));
        found.extend((d1 < 0.0).then_some((c1, t1)));
    }
    // A node below both neighbours whose slopes don't show it (rounding), or a flat cost: the lowest node serves.
    let lowest = nodes.iter().map(|&(t, c, _)| (c, t)).min_by(|a, b| a.0.total_cmp(&b.0));
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((cost, t)) = lowest {
        found.retain(|f| f.0 <= cost);
        if found.is_empty() {
            found.push((cost, t));
        }
    }
    found.into_iter().take(MOST_STARTS).map(|(_, t)| vec![t]).collect()
}

/// Minimum (cost, t) of the cubic through two (t, cost, slope), where the slopes bracket one.
fn hermite_minimum(a: (f64, f64, f64), b: (f64, f64, f64)) -> Option<(f64, f64)> {
    if !(a.2 < 0.0 && b.2 > 0.0) {
        return None;
    }
    let h = b.0 - a.0;
    // c(s) = c0 + m0 s + q s² + p s³ on s in [0, 1]
    let (m0, m1) = (a.2 * h, b.2 * h);
    let q = 3.0 * (b.1 - a.1) - 2.0 * m0 - m1;
    let p = m0 + m1 - 2.0 * (b.1 - a.1);
    let root = q.mul_add(q, -3.0 * p * m0).max(0.0).sqrt();
    let s = (-m0 / (q + root)).clamp(0.0, 1.0);
    Some((a.1 + s * (m0 + s * (q + s * p)), a.0 + s * h))
}

/// The best combinations of nodes for several lobes, found by adding one at a time and keeping the best few.
fn several(problem: &Profile<'_>, lobes: usize) -> Vec<Vec<f64>> {
    let lattice = tabulate(problem, true);
    let mut beam: Vec<(f64, Vec<usize>)> = vec![(0.0, Vec::new())];
    for _ in 0..lobes {
        let mut next: Vec<(f64, Vec<usize>)> = Vec::new();
        for (_, nodes) in &beam {
            for k in (0..lattice.t.len()).filter(|k| !nodes.contains(k)) {
                let mut set = nodes.clone();
                set.push(k);
                set.sort_unstable();
                if next.iter().all(|(_, other)| *other != set) {
                    next.push((lattice.cost(&set).0, set));
                }
            }
        }
        next.sort_by(|a, b| a.0.total_cmp(&b.0));
        next.truncate(BEAM);
        beam = next;
    }
    beam.into_iter().take(MOST_STARTS).map(|(_, nodes)| nodes.iter().map(|&k| lattice.t[k]).collect()).collect()
}

/// One pass over the samples for the whole lattice; `pairs` also sums products of different nodes.
fn tabulate(problem: &Profile<'_>, pairs: bool) -> Lattice {
    let low = problem.layout[0].1.bounds.0;
    let t: Vec<f64> = nodes(problem).into_iter().map(f64::ln).collect();
    let plain: Vec<_> = problem.kinds.iter().filter(|k| k.lobe().parameters().is_empty()).copied().collect();
    let shaped = problem.kinds[problem.layout[0].0];
    let samples = problem.samples;
    let width = plain.len() + t.len() * if pairs { 1 } else { 2 };
    let zero = (
        vec![DMatrix::<f64>::zeros(width, width); samples.weight_lists()],
        vec![DVector::<f64>::zeros(width); samples.data.len()],
        0.0,
    );
    let (gram, data, energy) = fold_blocks(
        samples.len(),
        zero.clone(),
        |block| {
            let columns = lattice_columns(samples, &plain, (shaped, low, t.len()), !pairs, block.clone());
            let (mut gram, mut data, mut energy) = zero.clone();
            let g = &samples.slope[block.clone()];
            for c in 0..samples.data.len() {
                let w = &samples.weight(c)[block.clone()];
                let wg: Vec<f64> = w.iter().zip(g).map(|(w, g)| w * g * g).collect();
                let y = &samples.data[c][block.clone()];
                let wy: Vec<f64> = wg.iter().zip(y).map(|(w, y)| w * y).collect();
                energy += dot(&wy, y);
                for (a, column) in columns.iter().enumerate() {
                    data[c][a] = dot(&wy, column);
                }
                if c < samples.weight_lists() {
                    fill_gram(&mut gram[c], &columns, &wg, plain.len(), t.len(), pairs);
                }
            }
            (gram, data, energy)
        },
        |total, part| {
            total.0.iter_mut().zip(&part.0).for_each(|(t, p)| *t += p);
            total.1.iter_mut().zip(&part.1).for_each(|(t, p)| *t += p);
            total.2 += part.2;
        },
    );
    Lattice { t, base: plain.len(), gram, data, energy }
}

/// Columns of one block: the lobes without a shape, the nodes of `shaped` (lobe, first shape, octaves), their slopes.
fn lattice_columns(
    samples: &Samples,
    plain: &[LobeKind],
    shaped: (LobeKind, f64, usize),
    slopes: bool,
    block: std::ops::Range<usize>,
) -> Vec<Vec<f64>> {
    let (kind, low, octaves) = shaped;
    let mut columns: Vec<Vec<f64>> = plain.iter().map(|kind| basis(samples, *kind, &[], block.clone()).0).collect();
    let (values, mut derivatives) = kind.lobe().fill_octaves(low, octaves, &samples.coordinate(kind)[block]);
    columns.extend(values);
    for (k, list) in derivatives.iter_mut().enumerate() {
        list.iter_mut().for_each(|d| *d *= octave(low, k));
    }
    if slopes {
        columns.extend(derivatives);
    }
    columns
}

/// The products that are asked of the lattice, as a symmetric matrix with zeros elsewhere.
fn fill_gram(gram: &mut DMatrix<f64>, columns: &[Vec<f64>], wg: &[f64], base: usize, nodes: usize, pairs: bool) {
    for a in 0..columns.len() {
        let weighted: Vec<f64> = wg.iter().zip(&columns[a]).map(|(w, x)| w * x).collect();
        for b in 0..=a {
            let same_node = b >= base && (a - base) % nodes == (b - base) % nodes;
            if b < base || same_node || pairs {
                gram[(a, b)] = dot(&weighted, &columns[b]);
                gram[(b, a)] = gram[(a, b)];
            }
        }
    }
}
