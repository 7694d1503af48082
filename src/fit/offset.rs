//! Does the fit follow the mean of the data? A loss that is not linear in the measured value, or weights that follow its noise, pull a
//! fit off the mean, by more than its standard errors where the noise is not small. The residuals tell how far.
//!
//! Each residual is weighed anew by what knows nothing of its noise: in place of w its neighbours', which is about as good, and in place of the
//! loss's slope at both values that at the model's alone, squared, times f − y: what a fit would be pulled by that follows the mean and weighs
//! alike. By what that changes their sum over each parameter's slope tells how far such a fit is from this one; the noise itself cancels.
//! Gross outliers are left out: what they pull is told apart, as a shared error.

use nalgebra::DVector;

use super::loss::Datum;
use super::passes::Scratch;
use super::reduced::{Problem, Solution};
use super::samples::Block;

/// Standard deviations from which on a sum is not 0 by chance, among a dozen of them.
const CLEARLY_OFF: f64 = 3.5;

/// How a fit is off the mean of its data.
pub(super) struct Offset {
    /// Whether that is no chance.
    pub is_clear: bool,
    /// What weights that follow the noise, or the loss's bend, take from half the cost's gradient, by all parameters, less what chance does.
    pub pull: DVector<f64>,
}

/// How the fit is off the mean, residuals beyond `gross` being outliers; `None` for fits that follow the mean by construction.
pub(super) fn offset(problem: &Problem<'_>, at: &Solution, gross: f64) -> Option<Offset> {
    let samples = problem.samples;
    if !samples.loss.bends() && samples.weighting != "sigma" {
        return None;
    }
    let zero = vec![(0.0, 0.0); problem.parameters()];
    let parts = samples.map_pieces(
        || (zero.clone(), Scratch::default()),
        |(sums, scratch), block| {
            scratch.basis(samples, block, &at.lobes);
            for (c, x) in at.weights.iter().enumerate() {
                scratch.residuals(samples, block, c, x, problem.saturation);
                let changes = changes(problem, block, c, scratch, gross);
                let (place, strength) = (problem.place(at.weights.len(), c), problem.strength(x));
                for ((column, strength), place) in scratch.columns.iter().zip(&strength).zip(&place) {
                    for (change, slope) in changes.iter().zip(column) {
                        add(&mut sums[*place], change * strength * slope);
                    }
                }
            }
        },
    );
    let mut sums = zero;
    for (part, _) in &parts {
        sums.iter_mut().zip(part).for_each(|(to, from)| *to = (to.0 + from.0, to.1 + from.1));
    }
    let is_clear = sums.iter().any(|s| score(*s) > CLEARLY_OFF);
    Some(Offset { is_clear, pull: DVector::from_iterator(sums.len(), sums.iter().map(|s| beyond_chance(*s))) })
}

/// A sum and that of its terms' squares.
type Sum = (f64, f64);

fn add(to: &mut Sum, term: f64) {
    *to = (to.0 + term, to.1 + term * term);
}

fn score((sum, square): Sum) -> f64 {
    if square > 0.0 { sum.abs() / square.sqrt() } else { 0.0 }
}

/// A sum less what chance makes of it: of g with E g² = S + b², S the sum of the terms' squares, what is left is b.
fn beyond_chance((sum, square): Sum) -> f64 {
    if sum * sum > square { sum * (1.0 - square / (sum * sum)).sqrt() } else { 0.0 }
}

/// By what each residual of a channel pulls otherwise if it is weighed anew.
fn changes(problem: &Problem<'_>, block: &Block, channel: usize, scratch: &Scratch, gross: f64) -> Vec<f64> {
    let samples = problem.samples;
    let by_sigma = samples.weighting == "sigma";
    let (w, y) = (block.weight(channel), &block.y[channel]);
    let trust = |r: f64| problem.saturation.map_or(1.0, |(kind, s)| kind.rho((r / s).powi(2)).1);
    let change = |i: usize| {
        let other = if by_sigma { beside(block, w, i) } else { w[i] };
        let f = scratch.f[i];
        let as_modelled = Datum { value: f, cos_i: block.cos_i[i], epsilon: samples.epsilon[channel] };
        let slope = samples.loss.slope(f, as_modelled);
        let r = slope * (f - y[i]);
        // An infinite slope has no say, nor a sample without neighbours.
        if w[i] > 0.0 && other > 0.0 && slope.is_finite() && scratch.r[i].abs() <= gross && r.abs() <= gross {
            other * trust(r) * r * slope - scratch.pull[i]
        } else {
            0.0
        }
    };
    (0..block.len()).map(change).collect()
}

/// What the weight of sample `i` of a block should be by those of its two neighbours: their geometric mean, in which a trend cancels; 0 where one
/// is missing.
fn beside(block: &Block, w: &[f64], i: usize) -> f64 {
    let within = block.pairs[i] > 0.0 && i > 0 && block.pairs.get(i + 1).is_some_and(|pair| *pair > 0.0);
    if within { (w[i - 1] * w[i + 1]).sqrt() } else { 0.0 }
}
