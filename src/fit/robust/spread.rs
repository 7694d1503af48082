//! The spread of residuals, and what of it is rounding.

use crate::fit::passes::Scratch;
use crate::fit::reduced::{Problem, Solution};
use crate::fit::samples::Block;

/// Residuals below this share of the data are rounding, and no scale below this can be squared.
const ROUNDING: f64 = 1e-13;
const SMALLEST: f64 = 1e-140;

/// σ of normal noise over its median absolute deviation.
const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// σ of residuals by their median absolute deviation from their median.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    /// Of all.
    pub all: f64,
    /// Of those that say something: where the data are 0 and the model is too, they agree whatever the others are.
    pub telling: f64,
}

impl Spread {
    pub fn new(problem: &Problem<'_>, at: &Solution) -> Self {
        let (mut all, mut telling) = (Vec::new(), Vec::new());
        let pieces =
            gathered(problem, at, |scratch, block, c, i| (scratch.r[i], block.y[c][i] != 0.0 || scratch.f[i] != 0.0));
        for (r, tells) in pieces {
            all.push(r);
            if tells {
                telling.push(r);
            }
        }
        Self { all: sigma(&mut all), telling: sigma(&mut telling) }
    }
}

/// A spread that may be rounding, by the data alone, for all fits to them to be judged alike: a share of the median size of the residuals that
/// there are without any lobe and are not 0, which no gross outlier moves far.
pub(super) fn rounding(problem: &Problem<'_>, like: &Solution) -> f64 {
    let mut nothing = like.clone();
    nothing.weights.iter_mut().for_each(|x| x.fill(0.0));
    let mut sizes = gathered(problem, &nothing, |scratch, _, _, i| scratch.r[i].abs());
    sizes.retain(|size| *size > 0.0);
    (ROUNDING * median(&mut sizes)).max(SMALLEST)
}

/// Median size of the values, where that is not 0.
pub(super) fn typical(problem: &Problem<'_>) -> f64 {
    let samples = problem.samples;
    let pieces = samples.map_pieces(Vec::new, |list: &mut Vec<f64>, block| {
        for c in 0..problem.ranges.len() {
            list.extend(block.y[c].iter().zip(block.weight(c)).filter(|(_, w)| **w > 0.0).map(|(y, _)| y.abs()));
        }
    });
    let size = median(&mut pieces.into_iter().flatten().collect::<Vec<f64>>());
    if size > 0.0 { size } else { 1.0 }
}

/// What `of` makes of every residual that counts: it is given its block, its channel and its place there.
fn gathered<T: Send>(
    problem: &Problem<'_>,
    at: &Solution,
    of: impl Fn(&Scratch, &Block, usize, usize) -> T + Sync,
) -> Vec<T> {
    let start = || (Vec::new(), Scratch::default());
    let pieces = problem.samples.map_pieces(start, |(list, scratch), block| {
        scratch.basis(&block.x, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            scratch.residuals(problem.samples, block, c, x, None);
            let w = block.weight(c);
            list.extend((0..w.len()).filter(|&i| w[i] > 0.0).map(|i| of(scratch, block, c, i)));
        }
    });
    pieces.into_iter().flat_map(|p| p.0).collect()
}

fn sigma(r: &mut [f64]) -> f64 {
    let centre = median(r);
    r.iter_mut().for_each(|r| *r = (*r - centre).abs());
    MAD_TO_SIGMA * median(r)
}

fn median(list: &mut [f64]) -> f64 {
    if list.is_empty() {
        return 0.0;
    }
    let middle = list.len() / 2;
    let odd = list.len() % 2 == 1;
    let (below, upper, _) = list.select_nth_unstable_by(middle, f64::total_cmp);
    if odd { *upper } else { 0.5 * (*upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max)) }
}
