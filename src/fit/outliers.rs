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
    /// How many there are, and of how many values that count.
    count: usize,
    of: usize,
    /// Neighbours that are both gross to the same side, less those to opposite ones, and how many pairs there are.
    together: (isize, usize),
}

impl Outliers {
    pub fn new(parameters: usize) -> Self {
        Self {
            pull: DVector::zeros(parameters),
            squares: DMatrix::zeros(parameters, parameters),
            count: 0,
            of: 0,
            together: (0, 0),
        }
    }

    /// Adds those of one channel of a block, whose residuals and columns are there: residuals beyond `gross`. With the samples' weights, and which
    /// are neighbours of the one before.
    pub fn add(&mut self, scratch: &mut Scratch, (w, pairs): (&[f64], &[f64]), gross: f64) {
        if gross == f64::INFINITY {
            return;
        }
        let outlier = |(r, pull): (&f64, &f64)| if r.abs() > gross { *pull } else { 0.0 };
        let pulls: Vec<f64> = scratch.r.iter().zip(&scratch.pull).map(outlier).collect();
        let paired = |i: &usize| pairs[*i] > 0.0 && w[i - 1] > 0.0 && w[*i] > 0.0;
        self.of += w.iter().filter(|w| **w > 0.0).count();
        self.together.1 += (1..w.len()).filter(paired).count();
        let found = pulls.iter().filter(|p| **p != 0.0).count();
        if found == 0 {
            return;
        }
        self.count += found;
        let alike = |i: usize| match pulls[i - 1] * pulls[i] {
            0.0 => 0,
            product if product > 0.0 => 1,
            _ => -1,
        };
        self.together.0 += (1..w.len()).filter(paired).map(alike).sum::<isize>();
        project(&scratch.columns, &pulls, &mut self.pull);
        scratch.weight = pulls.iter().map(|p| p * p).collect();
        scratch.tally(self.pull.len(), &mut self.pull.map(|_| 0.0), &mut self.squares);
    }

    /// Adds those of one channel, whose columns count `strength` times and stand at `place` among the parameters.
    pub fn add_channel(&mut self, channel: &Self, strength: &[f64], place: &[usize]) {
        self.count += channel.count;
        self.of += channel.of;
        self.together = (self.together.0 + channel.together.0, self.together.1 + channel.together.1);
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

    /// What they are like.
    pub fn traits(&self, bread: &DMatrix<f64>) -> Traits {
        let Self { count, of, together: (both, pairs), .. } = *self;
        let share = count as f64 / of.max(1) as f64;
        let alike = both as f64 / pairs.max(1) as f64 - share * share;
        let stand_together = both >= TOGETHER.0 && (alike > TOGETHER.1 * (share - share * share) || share > 0.5);
        Traits { count, of, lean: self.excess(bread) > LEANING, stand_together }
    }
}

/// What is worth a word of gross outliers.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Traits {
    /// How many there are, of how many values.
    pub count: usize,
    pub of: usize,
    /// Whether they plainly lean to one side.
    pub lean: bool,
    /// Whether they stand together, each beside others to the same side, as stray readings do not, or are the most: the model is off there, or
    /// a part of the scan is.
    pub stand_together: bool,
}

/// Gross outliers stand together from this many pairs of neighbours on, and from this correlation of being one on.
const TOGETHER: (isize, f64) = (10, 0.3);

/// A residual of more σ than this is a gross outlier: no noise reaches it.
const GROSS: f64 = 9.5;

/// The residual from which one is a gross outlier, where s has settled at a multiple of the residuals' σ.
pub(super) fn gross(robust: Option<Robust>, s: f64) -> f64 {
    robust.map_or(f64::INFINITY, |robust| GROSS * s / robust.scale)
}

/// Three standard deviations of pulls of random signs, in one direction; of many parameters the excess scatters less.
const LEANING: f64 = 9.0;
