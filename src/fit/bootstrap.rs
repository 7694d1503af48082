//! Standard errors by redrawing the data: every sample's weight times a Poisson number of mean 1, refitted from the optimum.

use std::time::{Duration, Instant};

use nalgebra::DVector;
use rand_distr::{Distribution, Poisson};

use super::limits::Ranges;
use super::options::{FitError, FitOptions};
use super::part::{self, Part};
use super::reduced::Solution;
use super::samples::Samples;
use crate::brdf::ModelSpec;
use crate::numeric::random::{Purpose, stream};

/// Drawings that are made however little time there is: fewer know a standard deviation worse than to 16 %.
pub(super) const LEAST: u32 = 20;

/// Standard deviation of every parameter, in the uncertainty's order and the fit's scale.
#[derive(Debug, Clone)]
pub(super) struct Redrawn {
    pub deviation: Vec<f64>,
    /// Data sets drawn.
    pub replicates: u32,
}

impl std::ops::Index<usize> for Redrawn {
    type Output = f64;

    fn index(&self, parameter: usize) -> &f64 {
        &self.deviation[parameter]
    }
}

/// What is redrawn, where that is asked for: all samples, in one list.
pub(super) fn listed<'a>(samples: &Samples<'a>, options: &FitOptions) -> Option<Samples<'a>> {
    options.bootstrap.map(|_| samples.listed(|_| true))
}

/// Standard deviation of every parameter over the redrawn data, where that is asked for. None is begun that would end after `deadline`, unless
/// there are fewer than [`LEAST`].
pub(super) fn bootstrap(
    listed: Option<&Samples<'_>>,
    part: &Part,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
    deadline: Option<Instant>,
) -> Result<Option<Redrawn>, FitError> {
    let Some((draws, all)) = options.bootstrap.zip(listed) else { return Ok(None) };
    let parameters = part.uncertainty.errors.len();
    let (mut sum, mut squares) = (DVector::<f64>::zeros(parameters), DVector::<f64>::zeros(parameters));
    let centre = flat(&part.solution);
    let is_late = |more: Duration| deadline.is_some_and(|deadline| Instant::now() + more >= deadline);
    let (mut drawn, mut last) = (0, Duration::ZERO);
    for replicate in 0..draws.replicates {
        if drawn >= LEAST && is_late(last) {
            break;
        }
        let began = Instant::now();
        let redrawn = redrawn(all, draws.seed, replicate)?;
        let solution = part::refit(&redrawn, part, model, ranges, options)?;
        let moved = flat(&solution) - &centre;
        squares += moved.component_mul(&moved);
        sum += moved;
        drawn += 1;
        last = began.elapsed();
    }
    let n = f64::from(drawn);
    let deviation = |(q, s): (&f64, &f64)| ((q - s * s / n) / (n - 1.0)).max(0.0).sqrt();
    Ok(Some(Redrawn { deviation: squares.iter().zip(sum.iter()).map(deviation).collect(), replicates: drawn }))
}

/// How long that would take, by the time of the first replicate.
pub(super) fn predicted(
    listed: Option<&Samples<'_>>,
    part: &Part,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
) -> Result<Duration, FitError> {
    let Some((draws, all)) = options.bootstrap.zip(listed) else { return Ok(Duration::ZERO) };
    let began = Instant::now();
    part::refit(&redrawn(all, draws.seed, 0)?, part, model, ranges, options)?;
    Ok(began.elapsed() * draws.replicates)
}

/// The data of one replicate.
fn redrawn<'a>(all: &Samples<'a>, seed: u64, replicate: u32) -> Result<Samples<'a>, FitError> {
    let poisson = Poisson::new(1.0).map_err(|e| FitError::Solver { reason: e.to_string() })?;
    let mut rng = stream(seed, Purpose::Bootstrap, u64::from(replicate));
    let factor: Vec<f64> = (0..all.len()).map(|_| poisson.sample(&mut rng)).collect();
    Ok(all.reweighted(&factor))
}

/// All parameters in a row: weights channel by channel, then t.
fn flat(solution: &Solution) -> DVector<f64> {
    let weights = solution.weights.iter().flat_map(|x| x.iter().copied());
    DVector::from_vec(weights.chain(solution.t.iter().copied()).collect())
}
