//! The spread of residuals, and what of it is rounding.

use crate::fit::passes::Scratch;
use crate::fit::reduced::{Problem, Solution};
use crate::fit::samples::Samples;

/// Residuals below this share of the data are rounding, and no scale below this can be squared.
const ROUNDING: f64 = 1e-13;
const SMALLEST: f64 = 1e-140;

/// σ of normal noise over its median absolute deviation.
const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// σ of the residuals by their median absolute deviation from their median.
pub(super) fn spread(samples: &Samples<'_>, at: &Solution) -> f64 {
    deviation(&mut residuals(samples, at))
}

/// As [`spread`], of the values that are not `common` if one is, `rounding` at least.
pub(super) fn telling_spread(samples: &Samples<'_>, at: &Solution, common: Option<f64>, rounding: f64) -> f64 {
    let pieces = of_residuals(samples, at, Vec::new(), |list, y, _, r| {
        if common != Some(y) {
            list.push(r);
        }
    });
    deviation(&mut pieces.concat()).clamp(rounding, f64::INFINITY)
}

/// The value that a quarter of the (sorted) values have or more, if any: what is clipped at 0, or rounded to one step. It agrees with a fit that has it,
/// whatever that makes of the others.
pub(super) fn common_value(values: &[f64]) -> Option<f64> {
    let longest = values.chunk_by(|a, b| a == b).max_by_key(|run| run.len())?;
    (4 * longest.len() >= values.len() && longest.len() < values.len()).then(|| longest[0])
}

/// σ of the rounding of (sorted) values that are all multiples of one step, over their median size; 0 where they are not. Residuals of such values can't
/// tell a smaller σ, even where a fit meets the most of them: they share few values.
pub(super) fn rounding_share(values: &[f64], problem: &Problem<'_>) -> f64 {
    let mut values = values.to_vec();
    let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    values.dedup_by(|a, b| (*a - *b).abs() <= 1e-12 * largest);
    let step = values.windows(2).map(|p| p[1] - p[0]).fold(f64::INFINITY, f64::min);
    let is_multiple = |v: &f64| ((v / step) - (v / step).round()).abs() < 1e-3;
    if values.len() < 3 || !values.iter().all(is_multiple) {
        return 0.0;
    }
    step / 12f64.sqrt() / typical(problem)
}

/// Values of a part of the samples, ascending.
pub(super) fn sorted_values(problem: &Problem<'_>) -> Vec<f64> {
    let step = problem.samples.len().div_ceil(ENOUGH).max(1);
    let mut values = values(&problem.samples.listed(|i| i % step == 0));
    values.sort_by(f64::total_cmp);
    values
}

/// Samples that tell how often a value occurs.
const ENOUGH: usize = 10_000;

/// σ by the median absolute deviation from the median; leaves the absolute deviations.
fn deviation(r: &mut [f64]) -> f64 {
    let centre = median(r);
    r.iter_mut().for_each(|r| *r = (*r - centre).abs());
    MAD_TO_SIGMA * median(r)
}

/// Median size of the residuals that there are without any lobe and are not 0, which no gross outlier moves far, and the spread up to which it
/// may be rounding: by the data alone, for all fits to them to be judged alike.
pub(in crate::fit) fn sizes(samples: &Samples<'_>, like: &Solution) -> (f64, f64) {
    let mut nothing = like.clone();
    nothing.weights.iter_mut().for_each(|x| x.fill(0.0));
    let mut sizes = residuals(samples, &nothing);
    sizes.retain(|r| *r != 0.0);
    sizes.iter_mut().for_each(|r| *r = r.abs());
    let typical = median(&mut sizes);
    (typical, (ROUNDING * typical).max(SMALLEST))
}

/// Median size of the values, where that is not 0.
pub(super) fn typical(problem: &Problem<'_>) -> f64 {
    let mut sizes = values(problem.samples);
    sizes.iter_mut().for_each(|y| *y = y.abs());
    let size = median(&mut sizes);
    if size > 0.0 { size } else { 1.0 }
}

/// The values that count.
fn values(samples: &Samples<'_>) -> Vec<f64> {
    let pieces = samples.map_pieces(Vec::new, |list: &mut Vec<f64>, block| {
        for c in 0..samples.channels.len() {
            list.extend(block.y[c].iter().zip(block.weight(c)).filter(|(_, w)| **w > 0.0).map(|(y, _)| *y));
        }
    });
    pieces.concat()
}

/// Σ w ρ(r/s) with Tukey's bisquare, 1 − (1 − r²/s²)³ up to s and 1 beyond: however far off a residual is, it costs its weight at most.
pub(in crate::fit) fn bounded_cost(samples: &Samples<'_>, at: &Solution, s: f64) -> f64 {
    let pieces = of_residuals(samples, at, 0.0, |sum, _, w, r| {
        let inside = (1.0 - (r / s) * (r / s)).max(0.0);
        *sum += if r.is_nan() { f64::NAN } else { w * (1.0 - inside * inside * inside) };
    });
    pieces.iter().sum()
}

/// The residuals that count.
fn residuals(samples: &Samples<'_>, at: &Solution) -> Vec<f64> {
    of_residuals(samples, at, Vec::new(), |list, _, _, r| list.push(r)).concat()
}

/// What `add` makes of the data, weights and residuals of each piece of the samples, in order.
fn of_residuals<T: Clone + Send + Sync>(
    samples: &Samples<'_>,
    at: &Solution,
    empty: T,
    add: impl Fn(&mut T, f64, f64, f64) + Sync,
) -> Vec<T> {
    let start = || (empty.clone(), Scratch::default());
    let pieces = samples.map_pieces(start, |(sum, scratch), block| {
        scratch.basis(samples, block, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            scratch.residuals(samples, block, c, x, None);
            let (w, y) = (block.weight(c), &block.y[c]);
            (0..w.len()).filter(|&i| w[i] > 0.0).for_each(|i| add(sum, y[i], w[i], scratch.r[i]));
        }
    });
    pieces.into_iter().map(|(sum, _)| sum).collect()
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
