//! Errors that the channels of a row share, as where axes stop moves all of them alike: what they add to B between channels.
//!
//! Of a row with pulls m_c on the parameters of channel c, B has m_a m_b for a ≠ b too. Stated σ know the m of the part that is shared; under a robust
//! loss σ says nothing of outliers, and the residuals' own pulls count, in rows that state such a part.

use nalgebra::{DMatrix, DVector};

use super::sums::data_slopes;
use crate::fit::passes::Scratch;
use crate::fit::reduced::{Problem, Solution};
use crate::fit::samples::Block;

/// The sums, by all parameters.
pub(super) struct Rows {
    pub sums: DMatrix<f64>,
    /// Pulls of the block at hand, channel by channel; none where no row states a part that is shared.
    pulls: Vec<Vec<f64>>,
}

impl Rows {
    pub fn new(parameters: usize) -> Self {
        Self { sums: DMatrix::zeros(parameters, parameters), pulls: Vec::new() }
    }

    /// Takes what the rows of a block share in one channel, whose residuals `scratch` holds.
    pub fn take(&mut self, problem: &Problem<'_>, block: &Block, channel: usize, scratch: &Scratch) {
        let samples = problem.samples;
        let Some(row) = samples.measurement.row_plane(samples.channels[channel]) else { return };
        let (w, slopes) = (block.weight(channel), data_slopes(problem, block, channel, &scratch.f));
        let of = |i: usize| {
            let part = row[block.index[i] as usize];
            let is_shared = w[i] > 0.0 && part.is_finite() && part != 0.0;
            match problem.saturation {
                _ if !is_shared => 0.0,
                Some(_) => scratch.pull[i],
                None => w[i] * scratch.slope[i] * slopes[i] * part,
            }
        };
        let finite = |pull: f64| if pull.is_finite() { pull } else { 0.0 }; // the cube root's ∂r/∂y is infinite at 0
        self.pulls.push((0..block.len()).map(|i| finite(of(i))).collect());
    }

    /// Adds the products of channels of the block, whose columns `scratch` holds.
    pub fn close(&mut self, problem: &Problem<'_>, at: &Solution, scratch: &mut Scratch) {
        let (pulls, channels, k) = (std::mem::take(&mut self.pulls), at.weights.len(), scratch.columns.len());
        let parts = |c: usize| (problem.strength(&at.weights[c]), problem.place(channels, c));
        for (a, of_a) in pulls.iter().enumerate() {
            for (b, of_b) in pulls.iter().enumerate().skip(a + 1) {
                scratch.weight = of_a.iter().zip(of_b).map(|(a, b)| a * b).collect();
                let mut products = DMatrix::zeros(k, k);
                scratch.tally(k, &mut DVector::zeros(k), &mut products);
                products.fill_upper_triangle_with_lower_triangle();
                self.add(&products, &parts(a), &parts(b));
            }
        }
    }

    /// Adds the products of bare columns of two channels, both ways.
    fn add(&mut self, products: &DMatrix<f64>, a: &(Vec<f64>, Vec<usize>), b: &(Vec<f64>, Vec<usize>)) {
        for (i, (strength_a, place_a)) in a.0.iter().zip(&a.1).enumerate() {
            for (j, (strength_b, place_b)) in b.0.iter().zip(&b.1).enumerate() {
                let more = strength_a * strength_b * products[(i, j)];
                self.sums[(*place_a, *place_b)] += more;
                self.sums[(*place_b, *place_a)] += more;
            }
        }
    }
}
