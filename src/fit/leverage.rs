//! B from residuals of small tables. A fit bends towards the samples that decide it, so that their residuals are too small:
//! E r² = (1 − h) σ², with the leverage h = w ρ′ (∂r/∂f)² Jᵀ A⁻¹ J. So each squared residual is divided by 1 − h (HC2: MacKinnon & White
//! 1985), and where few samples decide a parameter its interval is by Student's t with as many degrees of freedom as they have
//! (Bell & McCaffrey 2002).

use nalgebra::{DMatrix, DVector};

use super::covariance::stated_errors;
use super::passes::Scratch;
use super::reduced::{Problem, Solution};
use super::samples::Block;
use crate::numeric::stats::student_quantile;

/// Where 1 − h is not far above this the residual says little of its noise: the mean of the channel's counts instead.
const LEAST: f64 = 0.01;

/// B of the values whose error only their residuals tell, and what it is worth.
pub(super) struct Leveraged<'a> {
    bread: &'a DMatrix<f64>,
    spread: DMatrix<f64>,
    /// Of each parameter: variance by these values if the noise is the same everywhere, and variance of that.
    influence: Vec<(f64, f64)>,
}

/// Sums of one channel, of bare columns.
#[derive(Clone)]
struct ChannelSums {
    /// Σ pull² col·col/(1 − h).
    squares: DMatrix<f64>,
    /// Σ m col·col where the channel's mean counts, with m = (w ρ′ ∂r/∂f)²: a sample's share of B at a noise of 1.
    mean: DMatrix<f64>,
    /// Σ pull² and Σ m (1 − h), whose ratio is the noise's variance.
    noise: (f64, f64),
    /// Of each parameter: variance at a noise of 1, and variance of that.
    influence: Vec<(f64, f64)>,
}

impl<'a> Leveraged<'a> {
    /// The sums at a solution; `bread` is A⁻¹.
    pub fn new(problem: &Problem<'_>, at: &Solution, bread: &'a DMatrix<f64>) -> Self {
        let (channels, parameters) = (at.weights.len(), bread.nrows());
        let k = problem.kinds.len() + problem.layout.len();
        let zero = ChannelSums {
            squares: DMatrix::zeros(k, k),
            mean: DMatrix::zeros(k, k),
            noise: (0.0, 0.0),
            influence: vec![(0.0, 0.0); parameters],
        };
        let start = || (vec![zero.clone(); channels], Scratch::default());
        let parts = problem.samples.map_pieces(start, |(sums, scratch), block| {
            scratch.basis(&block.x, &at.lobes);
            for (sums, (c, x)) in sums.iter_mut().zip(at.weights.iter().enumerate()) {
                scratch.residuals(problem.samples, block, c, x, problem.saturation);
                sums.add(problem, at, block, c, scratch, bread);
            }
        });
        let spread = DMatrix::zeros(parameters, parameters);
        let mut found = Self { bread, spread, influence: vec![(0.0, 0.0); parameters] };
        for c in 0..channels {
            let mut sums = zero.clone();
            parts.iter().for_each(|(part, _)| sums.merge(&part[c]));
            found.add(problem, at, c, &sums);
        }
        found
    }

    /// Half width of each parameter's 95 % interval over its standard error, whose square is `variance`; `certain` is the part of the
    /// variance that is known, and `freedom` the residuals less the parameters.
    pub fn reach(&self, certain: &DVector<f64>, variance: &DVector<f64>, freedom: f64) -> Vec<f64> {
        let own = (self.bread * &self.spread * self.bread).diagonal();
        let of = |i: usize| {
            let (mean, scatter) = self.influence[i];
            // Satterthwaite 1946: what is known has no end of degrees of freedom.
            let few = if scatter > 0.0 { (mean + certain[i]).powi(2) / scatter } else { f64::INFINITY };
            let wider = ((own[i] + certain[i]) / variance[i]).sqrt();
            let t = student_quantile(0.975, few.min(freedom).max(1.0));
            if wider.is_finite() { t * wider } else { t }
        };
        (0..own.len()).map(of).collect()
    }

    fn add(&mut self, problem: &Problem<'_>, at: &Solution, channel: usize, sums: &ChannelSums) {
        let noise = if sums.noise.1 > 0.0 { sums.noise.0 / sums.noise.1 } else { 0.0 };
        let strength = problem.strength(&at.weights[channel]);
        let place = problem.place(at.weights.len(), channel);
        for (i, &a) in place.iter().enumerate() {
            for (j, &b) in place.iter().enumerate() {
                let (i, j) = (i.max(j), i.min(j));
                self.spread[(a, b)] += strength[i] * strength[j] * (sums.squares[(i, j)] + noise * sums.mean[(i, j)]);
            }
        }
        for (total, own) in self.influence.iter_mut().zip(&sums.influence) {
            *total = (total.0 + noise * own.0, total.1 + noise * noise * own.1);
        }
    }
}

impl ChannelSums {
    fn merge(&mut self, other: &Self) {
        self.squares += &other.squares;
        self.mean += &other.mean;
        self.noise = (self.noise.0 + other.noise.0, self.noise.1 + other.noise.1);
        self.influence.iter_mut().zip(&other.influence).for_each(|(s, o)| *s = (s.0 + o.0, s.1 + o.1));
    }

    fn add(
        &mut self,
        problem: &Problem<'_>,
        at: &Solution,
        block: &Block,
        channel: usize,
        scratch: &mut Scratch,
        bread: &DMatrix<f64>,
    ) {
        let place = problem.place(at.weights.len(), channel);
        let strength = DMatrix::from_diagonal(&problem.strength(&at.weights[channel]).into());
        // How far all parameters move with a pull of 1 on a bare column.
        let moves = bread.select_columns(&place) * strength.clone();
        let own = strength * moves.select_rows(&place);
        let (w, known) = (block.weight(channel), stated_errors(problem, block, channel, &scratch.f));
        let k = place.len();
        let (mut squares, mut mean) = (vec![0.0; block.len()], vec![0.0; block.len()]);
        let (mut column, mut moved) = (DVector::zeros(k), DVector::zeros(bread.nrows()));
        for i in 0..block.len() {
            let is_known = problem.saturation.is_none() && known.get(i).is_some_and(Option::is_some);
            if w[i] <= 0.0 || is_known || !scratch.pull[i].is_finite() {
                continue;
            }
            column.iter_mut().zip(&scratch.columns).for_each(|(to, from)| *to = from[i]);
            let trust = scratch.trust.get(i).copied().unwrap_or(1.0);
            let reference = (w[i] * trust * scratch.slope[i]).powi(2);
            let leverage = w[i] * trust * scratch.slope[i].powi(2) * column.dot(&(&own * &column));
            let rest = (1.0 - leverage).max(0.0);
            let by_itself = 1.0 / (rest + LEAST);
            squares[i] = scratch.pull[i].powi(2) * by_itself;
            mean[i] = reference * LEAST * by_itself;
            self.noise = (self.noise.0 + scratch.pull[i].powi(2), self.noise.1 + reference * rest);
            moved.gemv(1.0, &moves, &column, 0.0);
            for (to, moved) in self.influence.iter_mut().zip(moved.iter()) {
                let variance = reference * moved * moved;
                *to = (to.0 + variance, to.1 + (variance * rest * by_itself).powi(2));
            }
        }
        let mut nothing = DVector::zeros(k);
        scratch.weight = squares;
        scratch.tally(k, &mut nothing, &mut self.squares);
        scratch.weight = mean;
        scratch.tally(k, &mut nothing, &mut self.mean);
    }
}
