//! What residuals say of small tables' errors. A fit bends towards the samples that decide it, so that their residuals are too small:
//! E r² = (1 − h) σ², with the leverage h = w ρ′ (∂r/∂f)² jᵀ A⁻¹ j of ∂f/∂p = j. So each squared residual is divided by 1 − h (HC2: MacKinnon
//! & White 1985), and where few samples decide a parameter its interval is by Student's t with as many degrees of freedom as they have (after
//! Bell & McCaffrey 2002).

use nalgebra::{DMatrix, DVector};

use super::covariance::{data_slopes, stated_errors};
use super::passes::Scratch;
use super::reduced::{Problem, Solution, spread_into};
use super::samples::Block;
use crate::numeric::stats::student_quantile;

/// Where 1 − h is not far above this the residual says little of its noise: the mean of the channel's counts instead.
const LEAST: f64 = 0.01;
/// Degrees of freedom that a channel must have for a noise of its own; else that of all channels counts.
const OWN: f64 = 1.0;

/// B of the values whose error only their residuals tell, and what it is worth.
pub(super) struct Leveraged<'a> {
    bread: &'a DMatrix<f64>,
    /// By all of them, of leverage freed.
    spread: DMatrix<f64>,
    /// By those that are all leverage, at the others' noise.
    pub lone: DMatrix<f64>,
    influence: Vec<Influence>,
}

/// Of one parameter.
#[derive(Debug, Clone, Copy, Default)]
struct Influence {
    /// Variance if the noise is the same in the whole channel.
    variance: f64,
    /// Half the variance of that.
    scatter: f64,
    /// The part of the variance that the channel's noise stands for.
    filled: f64,
}

/// Sums of one channel, of bare columns at a noise of 1.
#[derive(Clone)]
struct Sums {
    /// Σ pull² col·col/(1 − h), this one at the residuals' own noise.
    squares: DMatrix<f64>,
    /// Σ m col·col where the channel's noise counts, with m = (w ρ′ ∂r/∂f)²: a sample's share of B at a noise of 1.
    filled: DMatrix<f64>,
    /// Σ m col·col of samples that are all leverage.
    lone: DMatrix<f64>,
    noise: Noise,
    influence: Vec<Influence>,
}

/// What residuals tell of a channel's noise.
#[derive(Debug, Clone, Copy, Default)]
struct Noise {
    /// Σ pull².
    squares: f64,
    /// Σ m (1 − h), what that is on average at a noise of 1.
    expected: f64,
    /// Σ (1 − h).
    freedom: f64,
}

impl Noise {
    fn add(&mut self, other: Self) {
        self.squares += other.squares;
        self.expected += other.expected;
        self.freedom += other.freedom;
    }

    /// The variance.
    fn variance(self) -> f64 {
        if self.expected > 0.0 { self.squares / self.expected } else { 0.0 }
    }
}

impl<'a> Leveraged<'a> {
    /// The sums at a solution; `bread` is A⁻¹.
    pub fn new(problem: &Problem<'_>, at: &Solution, bread: &'a DMatrix<f64>) -> Self {
        let (channels, parameters) = (at.weights.len(), bread.nrows());
        let zero = Sums::new(problem.kinds.len() + problem.layout.len(), parameters);
        let start = || (vec![zero.clone(); channels], Scratch::default());
        let parts = problem.samples.map_pieces(start, |(sums, scratch), block| {
            scratch.basis(problem.samples, block, &at.lobes);
            for (sums, (c, x)) in sums.iter_mut().zip(at.weights.iter().enumerate()) {
                scratch.residuals(problem.samples, block, c, x, problem.saturation);
                sums.add(problem, at, block, c, scratch, bread);
            }
        });
        let mut all = vec![zero; channels];
        for (part, _) in &parts {
            all.iter_mut().zip(part).for_each(|(all, part)| all.merge(part));
        }
        let mut pooled = Noise::default();
        all.iter().for_each(|sums| pooled.add(sums.noise));
        let nothing = DMatrix::zeros(parameters, parameters);
        let influence = vec![Influence::default(); parameters];
        let mut found = Self { bread, spread: nothing.clone(), lone: nothing, influence };
        for (c, sums) in all.iter().enumerate() {
            let noise = if sums.noise.freedom >= OWN { sums.noise } else { pooled };
            found.add(problem, at, c, sums, noise);
        }
        found
    }

    fn add(&mut self, problem: &Problem<'_>, at: &Solution, channel: usize, sums: &Sums, noise: Noise) {
        let (strength, place) = (problem.strength(&at.weights[channel]), problem.place(at.weights.len(), channel));
        let q = noise.variance();
        spread_into(&mut self.spread, &(&sums.squares + &sums.filled * q), &strength, &place);
        spread_into(&mut self.lone, &(&sums.lone * q), &strength, &place);
        for (total, own) in self.influence.iter_mut().zip(&sums.influence) {
            total.variance += q * own.variance;
            total.filled += q * own.filled;
            total.scatter += q * q * (own.scatter + own.filled * own.filled / noise.freedom.max(f64::MIN_POSITIVE));
        }
    }

    /// Half width of each parameter's 95 % interval over its standard error, whose square is `variance`; `certain` is the part of the
    /// variance that is known, and `freedom` the residuals less the parameters.
    pub fn reach(&self, certain: &DVector<f64>, variance: &DVector<f64>, freedom: f64) -> Vec<f64> {
        let own = (self.bread * &self.spread * self.bread).diagonal();
        let of = |i: usize| {
            let Influence { variance: mean, scatter, .. } = self.influence[i];
            // Satterthwaite 1946: what is known has no end of degrees of freedom.
            let few = if scatter > 0.0 { (mean + certain[i]).powi(2) / scatter } else { f64::INFINITY };
            let wider = ((own[i] + certain[i]) / variance[i]).sqrt();
            let t = student_quantile(0.975, few.min(freedom).max(1.0));
            if wider.is_finite() { t * wider } else { t }
        };
        (0..own.len()).map(of).collect()
    }

    /// The parameters whose error is for the most part that of samples which say nothing of their noise.
    pub fn by_others(&self, certain: &DVector<f64>) -> Vec<usize> {
        let mostly = |i: &usize| self.influence[*i].filled > 0.5 * (self.influence[*i].variance + certain[*i]);
        (0..self.influence.len()).filter(mostly).collect()
    }
}

impl Sums {
    fn new(columns: usize, parameters: usize) -> Self {
        let nothing = DMatrix::zeros(columns, columns);
        Self {
            squares: nothing.clone(),
            filled: nothing.clone(),
            lone: nothing,
            noise: Noise::default(),
            influence: vec![Influence::default(); parameters],
        }
    }

    fn merge(&mut self, other: &Self) {
        self.squares += &other.squares;
        self.filled += &other.filled;
        self.lone += &other.lone;
        self.noise.add(other.noise);
        for (own, other) in self.influence.iter_mut().zip(&other.influence) {
            own.variance += other.variance;
            own.scatter += other.scatter;
            own.filled += other.filled;
        }
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
        // How far all parameters, and the channel's own, move with a pull of 1 on a bare column.
        let moves = bread.select_columns(&place) * &strength;
        let own = &strength * moves.select_rows(&place);
        let slopes = data_slopes(problem, block, channel, &scratch.f);
        let (w, known) = (block.weight(channel), stated_errors(problem, block, channel, &slopes));
        let k = place.len();
        let [mut squares, mut filled, mut lone] = std::array::from_fn(|_| vec![0.0; block.len()]);
        let (mut column, mut moved, mut back) = (DVector::zeros(k), DVector::zeros(bread.nrows()), DVector::zeros(k));
        for i in 0..block.len() {
            let is_known = problem.saturation.is_none() && known.get(i).is_some_and(Option::is_some);
            if w[i] <= 0.0 || is_known || !scratch.pull[i].is_finite() {
                continue;
            }
            column.iter_mut().zip(&scratch.columns).for_each(|(to, from)| *to = from[i]);
            back.gemv(1.0, &own, &column, 0.0);
            moved.gemv(1.0, &moves, &column, 0.0);
            let pull_slope = w[i] * scratch.trust.get(i).copied().unwrap_or(1.0) * scratch.slope[i];
            let m = pull_slope * pull_slope;
            let rest = (1.0 - pull_slope * scratch.slope[i] * column.dot(&back)).max(0.0);
            let square = scratch.pull[i].powi(2);
            self.noise.add(Noise { squares: square, expected: m * rest, freedom: rest });
            squares[i] = square / (rest + LEAST);
            filled[i] = m * LEAST / (rest + LEAST);
            lone[i] = if rest < LEAST { m } else { 0.0 };
            for (to, moved) in self.influence.iter_mut().zip(moved.iter()) {
                let variance = m * moved * moved;
                to.variance += variance;
                to.filled += variance * LEAST / (rest + LEAST);
                to.scatter += (variance * rest / (rest + LEAST)).powi(2) / (rest + LEAST);
            }
        }
        let mut nothing = DVector::zeros(k);
        for (weight, sum) in [(squares, &mut self.squares), (filled, &mut self.filled), (lone, &mut self.lone)] {
            scratch.weight = weight;
            scratch.tally(k, &mut nothing, sum);
        }
    }
}
