//! What the data leave open although the cost curves where the search ended: other ends of the range that are as good.

use super::covariance::{Uncertainty, pinned};
use super::passes::Scratch;
use super::reduced::{Problem, Search, Solution};
use super::solver;
use super::streamed::Streamed;
use crate::numeric::stats::chi_square_quantile;

/// Cost that a difference of sums does not resolve, as a share of the data's energy.
const RESOLVED: f64 = 1e-13;
/// Distinct coordinates that are counted at most.
const MANY: usize = 64;

/// Marks what the data leave open, the transforms knowing the cost.
pub(super) fn by_search(search: &Search<'_>, at: &Solution, uncertainty: &mut Uncertainty) {
    let resolved = RESOLVED * search.energy.iter().sum::<f64>();
    let cost = |held: &Problem<'_>| {
        let search = search.of(held);
        solver::least_cost(search.walk(), &held.bounds, &at.t).unwrap_or(f64::INFINITY)
    };
    let least = search.solve(&at.t).cost.max(0.0);
    mark(search.problem, at, uncertainty, &Least { cost: least, noise: least, resolved }, cost);
}

/// Marks what the data leave open, by passes over `part`, the same problem on few samples.
pub(super) fn by_passes(part: &Problem<'_>, at: &Solution, uncertainty: &mut Uncertainty) {
    let cost = |held: &Problem<'_>| {
        let streamed = Streamed::new(held).starting_at(at);
        solver::least_cost(&streamed, &held.bounds, &at.t).unwrap_or(f64::INFINITY)
    };
    let least = cost(part);
    let noise = bounded_noise(part, at).map_or(least, |noise| noise.min(least));
    mark(part, at, uncertainty, &Least { cost: least, noise, resolved: RESOLVED * least }, cost);
}

/// The cost where the search ended.
struct Least {
    cost: f64,
    /// As much of it as is noise: without what gross outliers add, which no shape changes.
    noise: f64,
    /// What of it can be told.
    resolved: f64,
}

/// Σ w ψ² Σ w / Σ w ψ′, ψ = ρ′ r: what the cost would be if the pulls were residuals, each as steep as they are on the average. `None` without a
/// robust loss, and where the pulls fall as residuals grow, for s is too small for them.
fn bounded_noise(problem: &Problem<'_>, at: &Solution) -> Option<f64> {
    let (kind, s) = problem.saturation?;
    let start = || ([0.0; 3], Scratch::default());
    let pieces = problem.samples.map_pieces(start, |(sums, scratch), block| {
        scratch.basis(problem.samples, block, &at.lobes);
        for (c, x) in at.weights.iter().enumerate() {
            scratch.residuals(problem.samples, block, c, x, problem.saturation);
            for ((w, r), trust) in block.weight(c).iter().zip(&scratch.r).zip(&scratch.trust) {
                sums[0] += w * (trust * r).powi(2);
                sums[1] += w;
                sums[2] += w * kind.rho((r / s).powi(2)).2;
            }
        }
    });
    let [squares, weight, growth] = pieces.iter().fold([0.0; 3], |sum, (own, _)| [0, 1, 2].map(|i| sum[i] + own[i]));
    (growth > 0.0).then(|| squares * weight / growth)
}

/// A shape that may as well stand at an end of its range is open, and so is what can't be told apart there: at n → 0 a Phong lobe is the diffuse
/// one on all samples before the mirror direction's horizon; at large n it shows on no sample beside the peak, whatever its weight.
fn mark(
    problem: &Problem<'_>,
    at: &Solution,
    uncertainty: &mut Uncertainty,
    least: &Least,
    cost: impl Fn(&Problem<'_>) -> f64,
) {
    let (channels, lobes) = (at.weights.len(), problem.kinds.len());
    let freedom = problem.samples.residuals() as f64 - uncertainty.errors.len() as f64;
    // A lobe brings a weight a channel and a shape; the factor is for noise that is not the same everywhere.
    let rise = 1.5 * chi_square_quantile(0.95, channels as f64 + 1.0) * least.noise / freedom.max(1.0) + least.resolved;
    let as_good = |i: usize, end: f64| cost(&problem.holding(channels * lobes + i, end)) <= least.cost + rise;
    // A lobe whose weights may all be 0 may stand anywhere.
    let unproved = |lobe: usize| {
        let may_be_0 = |c: usize| {
            let reach = uncertainty.half_width(c * lobes + lobe).unwrap_or(f64::INFINITY);
            problem.ranges[c][lobe].0 == 0.0 && at.weights[c][lobe] <= reach
        };
        (0..channels).all(may_be_0)
    };
    let diffuse = problem.kinds.iter().position(|k| k.lobe().parameters().is_empty());
    let mut open = Vec::new();
    for (i, (lobe, parameter)) in problem.layout.iter().enumerate() {
        let (low, high) = problem.bounds[i];
        let shape = channels * lobes + i;
        if let Some(diffuse) = diffuse
            && low < high
            && low <= parameter.bounds.0.ln()
            && uncertainty.dark.contains(&false)
            && (unproved(*lobe) || as_good(i, low))
        {
            let free = |c: usize, l: usize| problem.ranges[c][l].0 < problem.ranges[c][l].1;
            for c in (0..channels).filter(|&c| !uncertainty.dark[c] && free(c, diffuse) && free(c, *lobe)) {
                open.extend([c * lobes + diffuse, c * lobes + lobe, shape]);
            }
        }
        // Where a sharper one than can be searched does as well, on samples right at the peak, only weight × exponent is known.
        let searched = high >= parameter.bounds.1.ln();
        let unseen = problem.is_invisible(*lobe, high);
        let dim = unproved(*lobe);
        if low < high && (unseen && dim || (unseen || searched && !dim) && as_good(i, high)) {
            open.push(shape);
            open.extend((0..channels).map(|c| c * lobes + lobe));
        }
    }
    if too_few_places(problem, channels) {
        open.extend(0..uncertainty.errors.len());
    }
    // What is held is known, whatever the data say.
    let pinned = pinned(problem, channels);
    for i in open.into_iter().filter(|&i| !pinned[i]) {
        uncertainty.errors[i] = None;
    }
}

/// Whether the samples stand at so few distinct coordinates that weights alone reproduce them whatever the shapes.
fn too_few_places(problem: &Problem<'_>, channels: usize) -> bool {
    let shapes = problem.bounds.iter().filter(|(low, high)| low < high).count();
    let places = problem.samples.distinct_coordinates(MANY);
    shapes > 0 && places < MANY && channels * places.saturating_sub(problem.kinds.len()) < shapes
}

impl Problem<'_> {
    /// Whether a lobe of shape eᵗ is 0 on all samples.
    fn is_invisible(&self, lobe: usize, t: f64) -> bool {
        self.samples.are_dark(self.kinds[lobe], &[t.exp()])
    }
}
