//! Does the fit follow the mean of the data? A loss that is not linear in the measured value, or weights that follow its noise, pull a
//! fit off the mean, by more than its standard errors where the noise is not small. The residuals tell: if the model can
//! describe the data their sums over each lobe are 0 within their own scatter, whatever weights the fit has used. Each residual is weighed
//! by its neighbour's weight, which is about as good as its own and knows nothing of its noise.

use super::loss::Loss;
use super::passes::Scratch;
use super::reduced::{Problem, Solution};
use super::samples::Block;

/// Standard deviations from which on a sum is not 0 by chance, among a dozen of them.
const CLEARLY_OFF: f64 = 3.5;

/// How many standard deviations Σ w c² φ (f − y) is off 0, for the lobe and channel where that is most; `None` where it may be chance, and for
/// fits that follow the mean by construction or are not meant to.
pub(super) fn offset(problem: &Problem<'_>, at: &Solution) -> Option<f64> {
    let samples = problem.samples;
    let bends = !samples.loss.is_linear() || samples.loss == Loss::Relative;
    if problem.saturation.is_some() || !(bends || samples.weighting == "sigma") {
        return None;
    }
    let lobes = problem.kinds.len();
    let zero = vec![(0.0, 0.0); at.weights.len() * lobes];
    let add = |(sums, scratch): &mut (Vec<(f64, f64)>, Scratch), block: &Block| {
        scratch.basis(&block.x, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            scratch.model(x);
            let (w, y) = (block.weight(c), &block.y[c]);
            for i in (0..block.len()).filter(|&i| w[i] > 0.0) {
                let Some(neighbour) = neighbour(block, i).map(|k| w[k]) else { continue };
                let residual = neighbour * block.cos_i[i] * block.cos_i[i] * (scratch.f[i] - y[i]);
                for (l, (sum, square)) in sums[c * lobes..(c + 1) * lobes].iter_mut().enumerate() {
                    let term = residual * scratch.columns[l][i];
                    *sum += term;
                    *square += term * term;
                }
            }
        }
    };
    let parts = samples.map_pieces(|| (zero.clone(), Scratch::default()), add);
    let total = |k: usize| parts.iter().fold((0.0, 0.0), |(a, b), (sums, _)| (a + sums[k].0, b + sums[k].1));
    // A weight that stands at an end of its range leaves a sum over its lobe, rightly.
    let free = |k: &usize| {
        let (low, high) = problem.ranges[k / lobes][k % lobes];
        let x = at.weights[k / lobes][k % lobes];
        low < x && x < high
    };
    let score = |(sum, square): (f64, f64)| if square > 0.0 { f64::abs(sum) / f64::sqrt(square) } else { 0.0 };
    let most = (0..zero.len()).filter(free).map(|k| score(total(k))).fold(0.0, f64::max);
    (most > CLEARLY_OFF).then_some(most)
}

/// A sample beside sample `i` of a block.
fn neighbour(block: &Block, i: usize) -> Option<usize> {
    if block.pairs[i] > 0.0 && i > 0 {
        return Some(i - 1);
    }
    block.pairs.get(i + 1).filter(|pair| **pair > 0.0).map(|_| i + 1)
}
