//! Standard errors by redrawing the data: every sample's weight times a Poisson number of mean 1, refitted from the optimum.

use nalgebra::DVector;
use rand_distr::{Distribution, Poisson};

use super::limits::Ranges;
use super::options::{Bootstrap, FitError, FitOptions};
use super::part::{self, Part};
use super::reduced::Solution;
use super::samples::Samples;
use crate::brdf::ModelSpec;
use crate::numeric::random::{Purpose, stream};

/// Standard deviation of every parameter over the redrawn data.
pub(super) fn bootstrap(
    samples: &Samples<'_>,
    part: &Part,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
    draws: Bootstrap,
) -> Result<Vec<f64>, FitError> {
    let failed = |reason: String| FitError::Solver { reason };
    let poisson = Poisson::new(1.0).map_err(|e| failed(e.to_string()))?;
    let all = samples.listed(|_| true);
    let parameters = part.uncertainty.errors.len();
    let (mut sum, mut squares) = (DVector::<f64>::zeros(parameters), DVector::<f64>::zeros(parameters));
    let centre = flat(&part.solution);
    for replicate in 0..draws.replicates {
        let mut rng = stream(draws.seed, Purpose::Bootstrap, u64::from(replicate));
        let factor: Vec<f64> = (0..all.len()).map(|_| poisson.sample(&mut rng)).collect();
        let redrawn = all.reweighted(&factor);
        let solution = part::refit(&redrawn, part, model, ranges, options)?;
        let moved = flat(&solution) - &centre;
        squares += moved.component_mul(&moved);
        sum += moved;
    }
    let n = f64::from(draws.replicates);
    Ok(squares.iter().zip(sum.iter()).map(|(q, s)| ((q - s * s / n) / (n - 1.0)).max(0.0).sqrt()).collect())
}

/// All parameters in a row: weights channel by channel, then t.
fn flat(solution: &Solution) -> DVector<f64> {
    let weights = solution.weights.iter().flat_map(|x| x.iter().copied());
    DVector::from_vec(weights.chain(solution.t.iter().copied()).collect())
}
