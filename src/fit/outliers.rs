//! Gross outliers under a robust loss. Each still pulls a little, and where they have one cause they may all pull to one side: a bias
//! that no number of samples averages out. Their sum g of pulls has E g gᵀ = S + b bᵀ, S the sum of their squares, so what g has
//! beyond S is taken as a shared error.

use nalgebra::{DMatrix, DVector};

use super::loss::Robust;
use super::passes::{Scratch, project};
use super::reduced::spread_into;

/// Pulls of gross outliers, of one channel's bare columns or of all parameters.
#[derive(Clone)]
pub(super) struct Outliers {
    /// g.
    pull: DVector<f64>,
    /// S.
    squares: DMatrix<f64>,
    /// How many there are.
    pub count: usize,
}

impl Outliers {
    pub fn new(parameters: usize) -> Self {
        Self { pull: DVector::zeros(parameters), squares: DMatrix::zeros(parameters, parameters), count: 0 }
    }

    /// Adds those of a block, whose residuals and columns are there: residuals beyond `gross`.
    pub fn add(&mut self, scratch: &mut Scratch, gross: f64) {
        let outlier = |(r, pull): (&f64, &f64)| if r.abs() > gross { *pull } else { 0.0 };
        let pulls: Vec<f64> = scratch.r.iter().zip(&scratch.pull).map(outlier).collect();
        let found = pulls.iter().filter(|p| **p != 0.0).count();
        if found == 0 {
            return;
        }
        self.count += found;
        project(&scratch.columns, &pulls, &mut self.pull);
        scratch.weight = pulls.iter().map(|p| p * p).collect();
        scratch.tally(self.pull.len(), &mut self.pull.map(|_| 0.0), &mut self.squares);
    }

    /// Adds those of one channel, whose columns count `strength` times and stand at `place` among the parameters.
    pub fn add_channel(&mut self, channel: &Self, strength: &[f64], place: &[usize]) {
        self.count += channel.count;
        place.iter().enumerate().for_each(|(i, &a)| self.pull[a] += strength[i] * channel.pull[i]);
        spread_into(&mut self.squares, &channel.squares, strength, place);
    }

    /// By how much the pulls add up to more than if their signs were random, squared: 1 on average where they are.
    fn excess(&self, bread: &DMatrix<f64>) -> f64 {
        self.pull.dot(&(bread * &self.pull)) / (bread * &self.squares).trace()
    }

    /// The shared error: g, less what random signs explain.
    pub fn shared(&self, bread: &DMatrix<f64>) -> DVector<f64> {
        let excess = self.excess(bread);
        &self.pull * if excess > 1.0 { (1.0 - 1.0 / excess).sqrt() } else { 0.0 }
    }

    /// Whether they plainly lean to one side.
    pub fn lean(&self, bread: &DMatrix<f64>) -> bool {
        self.excess(bread) > LEANING
    }
}

/// A residual of more σ than this is a gross outlier: no noise reaches it.
const GROSS: f64 = 9.5;

/// The residual from which one is a gross outlier, where s has settled at a multiple of the residuals' σ.
pub(super) fn gross(robust: Option<Robust>, s: f64) -> f64 {
    robust.map_or(f64::INFINITY, |robust| GROSS * s / robust.scale)
}

/// Three standard deviations of pulls of random signs, in one direction; of many parameters the excess scatters less.
const LEANING: f64 = 9.0;
