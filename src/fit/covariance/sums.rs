//! The sums that the covariance is made of, from one pass over the samples.

use nalgebra::{DMatrix, DVector};

use super::rows::Rows;
use crate::fit::folded::{OnLines, Products, Residuals};
use crate::fit::loss::Datum;
use crate::fit::merl_lines::{Line, MerlLines};
use crate::fit::outliers::Outliers;
use crate::fit::passes::{Moments, Scratch, project};
use crate::fit::reduced::{Problem, Solution, spread_into};
use crate::fit::samples::Block;
use crate::fit::structure::Neighbours;
use crate::fit::tally::Tallied;
use crate::numeric::simd::dot_vectorised;

/// Least growth of a robust pull over its weight, where a growth of less tells nothing.
const LEAST_GROWTH: f64 = 0.05;

/// The sums over all samples, by all parameters.
pub(super) struct Totals {
    pub cost: f64,
    pub dark: Vec<bool>,
    /// A.
    pub normal: DMatrix<f64>,
    /// A of a robust loss with every growth a little of its residual's weight at least; 0 without.
    pub bounded: DMatrix<f64>,
    /// B of the values with a stated σ.
    pub known: DMatrix<f64>,
    /// B of the values without one, before the factor N/(N − p).
    pub by_residuals: DMatrix<f64>,
    /// B of all values by their residuals.
    pub drawn: DMatrix<f64>,
    /// Σ g gᵀ over clusters of neighbours, and how many there are.
    pub clusters: (DMatrix<f64>, usize),
    /// What errors that the channels of a row share add to B: its products of different channels.
    pub rows: DMatrix<f64>,
    pub common: Vec<DVector<f64>>,
    pub outliers: Outliers,
    pub neighbours: Neighbours,
    pub stated: (f64, usize),
    /// Σ w u_r² of the shared errors.
    pub common_noise: f64,
}

impl Totals {
    fn new(problem: &Problem<'_>, channels: usize) -> Self {
        let parameters = problem.parameters();
        let zero = DMatrix::zeros(parameters, parameters);
        Self {
            cost: 0.0,
            dark: vec![false; channels],
            normal: zero.clone(),
            bounded: zero.clone(),
            known: zero.clone(),
            by_residuals: zero.clone(),
            drawn: zero.clone(),
            clusters: (zero.clone(), 0),
            rows: zero,
            common: vec![DVector::zeros(parameters); problem.samples.measurement.common.len()],
            outliers: Outliers::new(parameters),
            neighbours: Neighbours::default(),
            stated: (0.0, 0),
            common_noise: 0.0,
        }
    }

    /// All of them. `moments` are the sums of A where they are known; a residual beyond `gross` is a gross outlier.
    pub fn gathered(problem: &Problem<'_>, at: &Solution, moments: Option<&Moments>, gross: f64) -> Self {
        let start = || Piece::new(problem, at);
        let add = |piece: &mut Piece, block: &Block| piece.add(problem, at, block, moments.is_none(), gross);
        let add_lines =
            |piece: &mut Piece, lines: &MerlLines, block: &[Line]| piece.add_lines(problem, at, lines, block);
        let folded = moments.and_then(|_| problem.samples.map_lines(start, add_lines));
        let mut pieces = folded.unwrap_or_else(|| problem.samples.map_pieces(start, add));
        let mut totals = Self::new(problem, at.weights.len());
        for piece in &mut pieces {
            piece.close();
            totals.clusters.0 += &piece.clusters;
            totals.clusters.1 += piece.count;
            totals.rows += &piece.rows.sums;
            for (c, sums) in piece.channels.iter().enumerate() {
                totals.add(problem, at, c, sums);
            }
        }
        let Some(moments) = moments else { return totals };
        for (c, x) in at.weights.iter().enumerate() {
            let place = problem.place(at.weights.len(), c);
            spread_into(&mut totals.normal, moments.gram(c), &problem.strength(x), &place);
        }
        totals
    }

    fn add(&mut self, problem: &Problem<'_>, at: &Solution, channel: usize, sums: &ChannelSums) {
        let has_sigma = problem.samples.measurement.sigma.is_some() && problem.saturation.is_none();
        let strength = problem.strength(&at.weights[channel]);
        let place = problem.place(at.weights.len(), channel);
        let squares = if has_sigma { &sums.squares } else { &sums.spread };
        spread_into(&mut self.normal, &sums.normal, &strength, &place);
        spread_into(&mut self.bounded, &sums.bounded, &strength, &place);
        spread_into(&mut self.drawn, squares, &strength, &place);
        spread_into(&mut self.known, &sums.known, &strength, &place);
        spread_into(&mut self.by_residuals, &sums.spread, &strength, &place);
        for (total, part) in self.common.iter_mut().zip(&sums.common) {
            place.iter().enumerate().for_each(|(i, &a)| total[a] += strength[i] * part[i]);
        }
        self.outliers.add_channel(&sums.outliers, &strength, &place);
        self.cost += sums.cost;
        self.common_noise += sums.common_noise;
        self.stated = (self.stated.0 + sums.stated.0, self.stated.1 + sums.stated.1);
        self.neighbours.add(&sums.neighbours);
        self.dark[channel] |= sums.dark;
    }
}

/// Sums of one channel over [its lobes' weights, all shapes].
#[derive(Clone)]
struct ChannelSums {
    cost: f64,
    normal: DMatrix<f64>,
    bounded: DMatrix<f64>,
    /// B of the values without a stated σ, before the factor N/(N − p).
    spread: DMatrix<f64>,
    /// B of the values with one.
    known: DMatrix<f64>,
    /// B of all values by their residuals; the same as `spread` where no σ is stated.
    squares: DMatrix<f64>,
    common: Vec<DVector<f64>>,
    outliers: Outliers,
    /// Whether a sample lies where the lobes with a shape are 0 whatever it is.
    dark: bool,
    stated: (f64, usize),
    common_noise: f64,
    neighbours: Neighbours,
    /// What lines of a table have added to cost, darkness and neighbours, and to the spread.
    on_lines: OnLines,
    tallied: Tallied,
}

/// What a piece of the samples adds.
struct Piece {
    channels: Vec<ChannelSums>,
    /// Σ over clusters of neighbours of the outer product of their pull on the parameters.
    clusters: DMatrix<f64>,
    count: usize,
    rows: Rows,
    residuals: Residuals,
}

impl Piece {
    fn new(problem: &Problem<'_>, at: &Solution) -> Self {
        let (channels, k) = (at.weights.len(), problem.kinds.len() + problem.layout.len());
        let parameters = problem.parameters();
        let sums = ChannelSums {
            cost: 0.0,
            normal: DMatrix::zeros(k, k),
            bounded: DMatrix::zeros(k, k),
            spread: DMatrix::zeros(k, k),
            known: DMatrix::zeros(k, k),
            squares: DMatrix::zeros(k, k),
            common: vec![DVector::zeros(k); problem.samples.measurement.common.len()],
            outliers: Outliers::new(k),
            dark: false,
            stated: (0.0, 0),
            common_noise: 0.0,
            neighbours: Neighbours::default(),
            on_lines: OnLines::default(),
            tallied: Tallied::new(k),
        };
        let clusters = DMatrix::zeros(parameters, parameters);
        let (rows, residuals) = (Rows::new(parameters), Residuals::default());
        Self { channels: vec![sums; channels], clusters, count: 0, rows, residuals }
    }

    /// Adds all sums over one block; `bread` says whether A is among them, `gross` from which residual one is an outlier.
    fn add(&mut self, problem: &Problem<'_>, at: &Solution, block: &Block, bread: bool, gross: f64) {
        let channels = at.weights.len();
        self.residuals.scratch.basis(problem.samples, block, &at.lobes);
        let clusters: Vec<std::ops::Range<usize>> = problem.samples.clusters(block);
        let mut scores = vec![DVector::<f64>::zeros(self.clusters.nrows()); clusters.len()];
        for (c, x) in at.weights.iter().enumerate() {
            let (scratch, sums) = (&mut self.residuals.scratch, &mut self.channels[c]);
            sums.cost += scratch.residuals(problem.samples, block, c, x, problem.saturation);
            let (w, pairs) = (block.weight(c), &block.pairs);
            sums.neighbours.add(&Neighbours::of(&scratch.r, &scratch.trust, w, pairs));
            sums.dark |= block.x.iter().zip(w).any(|(x, w)| *x == f64::NEG_INFINITY && *w > 0.0);
            let gradient = sums.add(problem, block, c, scratch, bread);
            sums.outliers.add(scratch, (w, pairs), gross);
            self.rows.take(problem, block, c, scratch);
            let (strength, place) = (problem.strength(x), problem.place(channels, c));
            if clusters.len() == 1 {
                place.iter().enumerate().for_each(|(i, p)| scores[0][*p] += strength[i] * gradient[i]);
                continue;
            }
            for (score, cluster) in scores.iter_mut().zip(&clusters) {
                for (i, column) in scratch.columns.iter().enumerate() {
                    let sum = dot_vectorised(&scratch.pull[cluster.clone()], &column[cluster.clone()]);
                    score[place[i]] += strength[i] * sum;
                }
            }
        }
        self.rows.close(problem, at, &mut self.residuals.scratch);
        scores.iter().for_each(|s| self.clusters.ger(1.0, s, s, 1.0));
        self.count += clusters.len();
    }

    /// Adds all sums over a block of a table's lines, A aside; its samples are one cluster.
    fn add_lines(&mut self, problem: &Problem<'_>, at: &Solution, lines: &MerlLines, block: &[Line]) {
        for line in block {
            self.residuals.set(lines, line, problem.samples, &at.lobes);
            for (sums, (c, x)) in self.channels.iter_mut().zip(at.weights.iter().enumerate()) {
                self.residuals.fill(problem.samples, c, x, Products::Scatter, &mut sums.on_lines);
                sums.tallied.add(&self.residuals.scratch);
            }
        }
        if block.is_empty() {
            return;
        }
        let mut score = DVector::<f64>::zeros(self.clusters.nrows());
        let mut gradient = DVector::zeros(problem.kinds.len() + problem.layout.len());
        for (sums, (c, x)) in self.channels.iter_mut().zip(at.weights.iter().enumerate()) {
            sums.tallied.take_gradient(&mut gradient);
            let (strength, place) = (problem.strength(x), problem.place(at.weights.len(), c));
            place.iter().enumerate().for_each(|(i, p)| score[*p] += strength[i] * gradient[i]);
        }
        self.clusters.ger(1.0, &score, &score, 1.0);
        self.count += 1;
    }

    /// Brings what lines left in lanes to the other sums.
    fn close(&mut self) {
        for sums in &mut self.channels {
            let mut gradient = DVector::zeros(sums.spread.nrows());
            sums.tallied.add_to(&mut gradient, &mut sums.spread);
            sums.cost += sums.on_lines.cost();
            sums.dark |= sums.on_lines.is_dark();
            sums.neighbours.add(&sums.on_lines.neighbours.total());
        }
    }
}

impl ChannelSums {
    /// Adds A, B and the g_k over a block, of the bare columns, and returns Σ pull·col. v is σ_r² where σ is known, else r²; under a robust loss
    /// always the latter, for a stated σ says nothing of outliers.
    fn add(
        &mut self,
        problem: &Problem<'_>,
        block: &Block,
        channel: usize,
        scratch: &mut Scratch,
        bread: bool,
    ) -> DVector<f64> {
        let measurement = problem.samples.measurement;
        let own = problem.samples.channels[channel];
        let (k, w) = (scratch.columns.len(), block.weight(channel));
        let mut gradient = DVector::zeros(k);
        if bread {
            scratch.curvature(block, channel);
            if let Some((kind, s)) = problem.saturation {
                // How the pull itself grows with the residual.
                let rho = |i: usize| kind.rho((scratch.r[i] / s).powi(2));
                let scale = |i: usize| w[i] * scratch.slope[i].powi(2);
                let bounded = |i: usize| scale(i) * rho(i).2.max(LEAST_GROWTH * rho(i).1);
                let growth: Vec<f64> = (0..w.len()).map(|i| scale(i) * rho(i).2).collect();
                scratch.weight = (0..w.len()).map(bounded).collect();
                scratch.tally(k, &mut gradient, &mut self.bounded);
                scratch.weight = growth;
            }
            scratch.tally(k, &mut gradient, &mut self.normal);
            gradient.fill(0.0);
        }
        let data_slopes = data_slopes(problem, block, channel, &scratch.f);
        scratch.squared_pull();
        let known = stated_errors(problem, block, channel, &data_slopes);
        if !known.is_empty() {
            for (s, w) in known.iter().zip(w) {
                self.stated.0 += s.map_or(0.0, |s| w * s * s);
                self.stated.1 += usize::from(s.is_some());
            }
            if problem.saturation.is_none() {
                scratch.tally(k, &mut gradient, &mut self.squares);
                let mut rest = std::mem::take(&mut scratch.weight);
                let spread = |(i, s): (usize, &Option<f64>)| s.map_or(0.0, |s| (w[i] * scratch.slope[i] * s).powi(2));
                scratch.weight = known.iter().enumerate().map(spread).collect();
                scratch.tally(k, &mut gradient, &mut self.known);
                rest.iter_mut().zip(&known).filter(|(_, s)| s.is_some()).for_each(|(v, _)| *v = 0.0);
                scratch.weight = rest;
                gradient.fill(0.0);
            }
        }
        scratch.tally(k, &mut gradient, &mut self.spread);
        for (component, total) in self.common.iter_mut().enumerate() {
            let u = measurement.common_plane(component, own);
            let trust = |i: usize| scratch.trust.get(i).copied().unwrap_or(1.0);
            let moved = |i: usize| {
                // The cube root's ∂r/∂y is infinite at 0.
                let shift = data_slopes[i] * u[block.index[i] as usize];
                if w[i] > 0.0 && shift.is_finite() { w[i] * trust(i) * scratch.slope[i] * shift } else { 0.0 }
            };
            let squares = (0..block.len()).map(|i| w[i] * (data_slopes[i] * u[block.index[i] as usize]).powi(2));
            self.common_noise += squares.filter(|s| s.is_finite()).sum::<f64>();
            let moved: Vec<f64> = (0..block.len()).map(moved).collect();
            project(&scratch.columns, &moved, total);
        }
        gradient
    }
}

/// σ_r of every value of a block that states its σ, by the [`data_slopes`]; empty where the measurement states none.
pub(in crate::fit) fn stated_errors(
    problem: &Problem<'_>,
    block: &Block,
    channel: usize,
    slopes: &[f64],
) -> Vec<Option<f64>> {
    let samples = problem.samples;
    let Some(sigma) = samples.measurement.sigma_plane(samples.channels[channel]) else { return Vec::new() };
    let w = block.weight(channel);
    let of = |i: usize| {
        let s = slopes[i].abs() * sigma[block.index[i] as usize];
        (s.is_finite() && s > 0.0 && w[i] > 0.0).then_some(s)
    };
    (0..block.len()).map(of).collect()
}

/// ∂r/∂y in the fit's scale, for errors in the data's own unit; empty where the measurement states none.
pub(in crate::fit) fn data_slopes(problem: &Problem<'_>, block: &Block, channel: usize, f: &[f64]) -> Vec<f64> {
    let samples = problem.samples;
    if samples.measurement.sigma.is_none() && samples.measurement.common.is_empty() {
        return Vec::new();
    }
    let slope = |i: usize| {
        let datum = Datum { value: block.y[channel][i], cos_i: block.cos_i[i], epsilon: samples.epsilon[channel] };
        samples.loss.data_slope(f[i], datum) / samples.scale
    };
    (0..block.len()).map(slope).collect()
}
