//! Does the fit follow the mean of the data? A loss that is not linear in the measured value, or weights that follow its noise, pull a
//! fit off the mean, by more than its standard errors where the noise is not small. The residuals tell.
//!
//! *Weights by σ:* each residual is weighed anew by its neighbours' w, which is about as good as its own and knows nothing of its noise. By what
//! the weighted residuals change their sum over each parameter's slope is off 0: that is chance of both signs, unless w follows the noise.
//! *Losses that bend:* if the model can describe the data the sums Σ W φ (f − y) are 0 within their own scatter for any W that knows
//! nothing of the noise: the neighbours' w c², and w times the loss's squared slope at the model's value, which is what the fit itself would
//! weigh by if there were no noise. Under a robust loss errors count as little as it lets them, by the slope at the model's value, and gross
//! outliers not at all: what is 0 then is the sum of noise that is as likely to be high as low.

use nalgebra::DVector;

use super::loss::{Datum, Loss};
use super::passes::Scratch;
use super::reduced::{Problem, Solution};
use super::samples::Block;

/// Standard deviations from which on a sum is not 0 by chance, among a dozen of them.
const CLEARLY_OFF: f64 = 3.5;

/// How a fit is off the mean of its data.
pub(super) struct Offset {
    /// By how many standard deviations, where that is no chance.
    pub score: Option<f64>,
    /// What weights that follow the noise add to half the cost's gradient, by all parameters, less what chance does.
    pub pull: DVector<f64>,
}

/// How the fit is off the mean, residuals beyond `gross` being outliers; `None` for fits that follow the mean by construction or are not meant to.
pub(super) fn offset(problem: &Problem<'_>, at: &Solution, gross: f64) -> Option<Offset> {
    let samples = problem.samples;
    let bends = !samples.loss.is_linear() || samples.loss == Loss::Relative;
    let by_sigma = samples.weighting == "sigma";
    if !(bends || by_sigma) {
        return None;
    }
    let channels = at.weights.len();
    let parameters = problem.parameters();
    let zero =
        Sums { follow: vec![(0.0, 0.0); parameters], mean: vec![[(0.0, 0.0); 2]; channels * problem.kinds.len()] };
    let parts = samples.map_pieces(
        || (zero.clone(), Scratch::default()),
        |(sums, scratch), block| {
            scratch.basis(&block.x, &at.lobes);
            for c in 0..channels {
                scratch.residuals(samples, block, c, &at.weights[c], problem.saturation);
                if by_sigma {
                    sums.follow(problem, at, block, c, scratch);
                }
                if bends {
                    sums.mean(problem, block, c, scratch, gross);
                }
            }
        },
    );
    let mut sums = zero;
    parts.iter().for_each(|(part, _)| sums.merge(part));
    // A weight that stands at an end of its range leaves a sum over its lobe, rightly.
    let lobes = problem.kinds.len();
    let free = |k: &usize| {
        let (low, high) = problem.ranges[k / lobes][k % lobes];
        let x = at.weights[k / lobes][k % lobes];
        low < x && x < high
    };
    let follow = sums.follow.iter().map(|s| score(*s)).fold(0.0, f64::max);
    let mean = (0..sums.mean.len()).filter(free).flat_map(|k| sums.mean[k].map(score)).fold(0.0, f64::max);
    let score = Some(follow.max(mean)).filter(|score| *score > CLEARLY_OFF);
    Some(Offset { score, pull: DVector::from_iterator(parameters, sums.follow.iter().map(|s| beyond_chance(*s))) })
}

/// A sum less what chance makes of it: of g with E g² = S + b², S the sum of the terms' squares, what is left is b.
fn beyond_chance((sum, square): Sum) -> f64 {
    if sum * sum > square { sum * (1.0 - square / (sum * sum)).sqrt() } else { 0.0 }
}

/// A sum and that of its terms' squares.
type Sum = (f64, f64);

fn score((sum, square): Sum) -> f64 {
    if square > 0.0 { sum.abs() / square.sqrt() } else { 0.0 }
}

#[derive(Clone)]
struct Sums {
    /// By each parameter: Σ (w′/w − 1) · pull · slope, w′ the neighbours'.
    follow: Vec<Sum>,
    /// Of each channel's lobes: Σ W φ (f − y) for two kinds of W.
    mean: Vec<[Sum; 2]>,
}

impl Sums {
    fn merge(&mut self, other: &Self) {
        let add = |(to, from): (&mut Sum, &Sum)| *to = (to.0 + from.0, to.1 + from.1);
        self.follow.iter_mut().zip(&other.follow).for_each(add);
        self.mean.iter_mut().flatten().zip(other.mean.iter().flatten()).for_each(add);
    }

    fn follow(&mut self, problem: &Problem<'_>, at: &Solution, block: &Block, channel: usize, scratch: &Scratch) {
        let (place, strength) = (problem.place(at.weights.len(), channel), problem.strength(&at.weights[channel]));
        let w = block.weight(channel);
        for i in (0..block.len()).filter(|&i| w[i] > 0.0) {
            let other = beside(block, w, i);
            if other == 0.0 {
                continue;
            }
            let more = (other / w[i] - 1.0) * scratch.pull[i];
            for ((column, strength), place) in scratch.columns.iter().zip(&strength).zip(&place) {
                add(&mut self.follow[*place], more * strength * column[i]);
            }
        }
    }

    fn mean(&mut self, problem: &Problem<'_>, block: &Block, channel: usize, scratch: &Scratch, gross: f64) {
        let (samples, lobes) = (problem.samples, problem.kinds.len());
        let trust = |r: f64| match problem.saturation {
            Some((kind, s)) if r.abs() <= gross => kind.rho((r / s).powi(2)).1,
            Some(_) => 0.0,
            None => 1.0,
        };
        let (w, y) = (block.weight(channel), &block.y[channel]);
        for i in (0..block.len()).filter(|&i| w[i] > 0.0) {
            let (f, cos_i) = (scratch.f[i], block.cos_i[i]);
            let as_modelled = Datum { value: f, cos_i, epsilon: samples.epsilon[channel] };
            let slope = samples.loss.slope(f, as_modelled);
            let (own, others) = (w[i] * slope * slope, beside(block, w, i) * cos_i * cos_i);
            let trusted = trust(slope * (f - y[i])) * (f - y[i]);
            for (l, sums) in self.mean[channel * lobes..(channel + 1) * lobes].iter_mut().enumerate() {
                let term = scratch.columns[l][i] * trusted;
                add(&mut sums[0], others * term);
                // An infinite slope has no say.
                add(&mut sums[1], if own.is_finite() { own * term } else { 0.0 });
            }
        }
    }
}

fn add(to: &mut Sum, term: f64) {
    *to = (to.0 + term, to.1 + term * term);
}

/// What the weight of sample `i` of a block should be by those of its two neighbours: their geometric mean, in which a trend cancels; 0 where one
/// is missing.
fn beside(block: &Block, w: &[f64], i: usize) -> f64 {
    let within = block.pairs[i] > 0.0 && i > 0 && block.pairs.get(i + 1).is_some_and(|pair| *pair > 0.0);
    if within { (w[i - 1] * w[i + 1]).sqrt() } else { 0.0 }
}
