//! How sure the parameters are: the sandwich covariance A⁻¹ B A⁻¹, shared error components, what the data leave open, and what the
//! residuals of neighbours say of the model's own error. One pass over the samples.

use nalgebra::{DMatrix, DVector};

use super::folded::{OnLines, Products, Residuals};
use super::leverage::Leveraged;
use super::loss::{Datum, Robust};
use super::merl_lines::{Line, MerlLines};
use super::offset;
use super::outliers::{self, Outliers};
use super::part::SMALL;
use super::passes::{Moments, Projected, Scratch};
use super::reduced::{Problem, Solution};
use super::samples::Block;
use super::structure::Neighbours;
use super::tally::Tallied;
use crate::numeric::simd::{Kernel, Simd, dot_vectorised, vectorised};
use crate::numeric::stats::student_quantile;

/// A 95 % interval.
pub type Interval = (f64, f64);

/// Uncertainty of all parameters: the weights channel by channel, lobe by lobe, then every ln(shape); in the fit's scale.
#[derive(Debug, Clone)]
pub(super) struct Uncertainty {
    /// Σ w r² from true residuals (robust: Σ w s² ρ).
    pub cost: f64,
    /// Whether a channel has a sample where the lobes with a shape are 0 whatever it is.
    pub dark: Vec<bool>,
    /// Standard error of each parameter; `None` where the data don't determine it.
    pub errors: Vec<Option<f64>>,
    /// Covariance, rows and columns of undetermined parameters meaningless.
    pub covariance: DMatrix<f64>,
    /// Covariance by the residuals alone, whatever σ is stated: how far another drawing of the samples would move the parameters.
    pub drawn: DMatrix<f64>,
    /// A.
    pub normal: DMatrix<f64>,
    /// The inverse of A, pseudo where singular: the cost rises by δ²/Aⱼⱼ⁻¹ when parameter j alone is held off by δ.
    pub bread: DMatrix<f64>,
    /// Standard errors if the residuals of neighbours are taken as one error, not many: what model error does to the parameters.
    pub structured: Vec<f64>,
    /// How many samples are worth one independent one, at least 1: by how much the parameters scatter more than if residuals were independent
    /// (Kish's design effect).
    pub design_effect: f64,
    /// Products of neighbours' residuals.
    pub neighbours: Neighbours,
    /// Σ w σ_r² over samples and channels with a stated σ, and how many there are.
    pub stated: (f64, usize),
    /// How clearly the fit is off the data's mean, in standard deviations, where it is.
    pub offset: Option<f64>,
    /// Number of gross outliers, where they lean to one side.
    pub leaning: Option<usize>,
    /// Parameters whose error is for the most part that of samples which say nothing of their own noise.
    pub by_others: Vec<usize>,
    /// Half width of each parameter's 95 % interval over its standard error: Student's t, and what leverage asks for.
    pub reach: Vec<f64>,
}

/// An eigenvalue of the scaled normal matrix below this share of the largest means: not determined by the data.
const UNDETERMINED: f64 = 1e-13;
/// A parameter's share in an undetermined direction (squared) from which it counts as undetermined itself.
const INVOLVED: f64 = 1e-8;

/// Sums of one channel over [its lobes' weights, all shapes].
#[derive(Clone)]
struct ChannelSums {
    cost: f64,
    normal: DMatrix<f64>,
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
    residuals: Residuals,
}

/// Standard errors at a solution. `moments` are the sums of A where they are known.
pub(super) fn uncertainty(
    problem: &Problem<'_>,
    at: &Solution,
    moments: Option<&Moments>,
    robust: Option<Robust>,
) -> Uncertainty {
    let samples = problem.samples;
    let (channels, lobes, shapes) = (at.weights.len(), problem.kinds.len(), problem.layout.len());
    let n = samples.residuals();
    let parameters = channels * lobes + shapes;
    let pinned = pinned(problem, channels);
    let freedom = n as f64 - pinned.iter().filter(|p| !**p).count() as f64;
    let inflation = if freedom > 0.0 { n as f64 / freedom } else { f64::NAN };
    let start = || Piece::new(problem, at);
    let gross = outliers::gross(robust, problem.saturation.map_or(1.0, |(_, s)| s));
    let add = |part: &mut Piece, block: &Block| part.add(problem, at, block, moments.is_none(), gross);
    let add_lines = |part: &mut Piece, lines: &MerlLines, block: &[Line]| part.add_lines(problem, at, lines, block);
    let folded = moments.and_then(|_| samples.map_lines(start, add_lines));
    let mut parts = folded.unwrap_or_else(|| samples.map_pieces(start, add));
    parts.iter_mut().for_each(Piece::close);

    let has_sigma = samples.measurement.sigma.is_some() && problem.saturation.is_none();
    let (mut normal, mut known) = (DMatrix::zeros(parameters, parameters), DMatrix::zeros(parameters, parameters));
    let mut by_residuals = DMatrix::zeros(parameters, parameters);
    let mut clusters = DMatrix::zeros(parameters, parameters);
    let mut common = vec![DVector::zeros(parameters); samples.measurement.common.len()];
    let mut outliers = Outliers::new(parameters);
    let mut dark = vec![false; channels];
    let mut drawn = DMatrix::zeros(parameters, parameters);
    let (mut cost, mut stated, mut neighbours, mut count) = (0.0, (0.0, 0), Neighbours::default(), 0);
    for part in &parts {
        clusters += &part.clusters;
        count += part.count;
        for (c, sums) in part.channels.iter().enumerate() {
            let strength = problem.strength(&at.weights[c]);
            let place = problem.place(channels, c);
            for (i, &a) in place.iter().enumerate() {
                for (j, &b) in place.iter().enumerate() {
                    let both = strength[i] * strength[j];
                    let squares = if has_sigma { &sums.squares } else { &sums.spread };
                    normal[(a, b)] += both * sums.normal[(i.max(j), i.min(j))];
                    drawn[(a, b)] += both * squares[(i.max(j), i.min(j))];
                    known[(a, b)] += both * sums.known[(i.max(j), i.min(j))];
                    by_residuals[(a, b)] += both * sums.spread[(i.max(j), i.min(j))];
                }
                common.iter_mut().zip(&sums.common).for_each(|(total, part)| total[a] += strength[i] * part[i]);
            }
            outliers.add_channel(&sums.outliers, &strength, &place);
            cost += sums.cost;
            stated = (stated.0 + sums.stated.0, stated.1 + sums.stated.1);
            neighbours.add(&sums.neighbours);
            dark[c] |= sums.dark;
        }
    }
    if let Some(moments) = moments {
        for (c, x) in at.weights.iter().enumerate() {
            let (strength, place) = (problem.strength(x), problem.place(channels, c));
            for (i, &a) in place.iter().enumerate() {
                place.iter().enumerate().for_each(|(j, &b)| {
                    normal[(a, b)] += strength[i] * strength[j] * moments.gram(c)[(i, j)];
                });
            }
        }
    }
    let sandwich = Sandwich::new(&normal, &pinned, &limited(problem, at, &pinned));
    let shared: Vec<_> = common.iter().cloned().chain([outliers.shared(&sandwich.bread)]).collect();
    let mut spread = &known + by_residuals * inflation;
    let told_by_residuals = problem.saturation.is_some() || stated.1 < n;
    let leveraged =
        (n <= SMALL && freedom > 0.0 && told_by_residuals).then(|| Leveraged::new(problem, at, &sandwich.bread));
    if let Some(leveraged) = &leveraged {
        spread += &leveraged.lone;
    }
    let covariance = sandwich.covariance(&spread, &shared);
    let leaning = outliers.lean(&sandwich.bread).then_some(outliers.count);
    let mut errors = sandwich.errors(&covariance);
    errors.iter_mut().zip(&pinned).filter(|(_, p)| **p).for_each(|(e, _)| *e = Some(0.0));
    let (mut reach, by_others) = match leveraged {
        Some(leveraged) => {
            let certain = sandwich.covariance(&known, &shared).diagonal();
            (leveraged.reach(&certain, &covariance.diagonal(), freedom), leveraged.by_others(&certain))
        }
        None => (vec![student_quantile(0.975, freedom.max(1.0)); parameters], Vec::new()),
    };
    let offset = offset::offset(problem, at);
    if let Some(offset) = &offset {
        let moved = &sandwich.bread * &offset.pull;
        let wider = |i: usize| (1.0 + moved[i] * moved[i] / covariance[(i, i)]).sqrt();
        reach.iter_mut().enumerate().for_each(|(i, r)| *r *= if moved[i] == 0.0 { 1.0 } else { wider(i) });
    }
    let grouped = sandwich.covariance(&(clusters * (count as f64 / (count as f64 - 1.0).max(1.0))), &[]);
    let drawn = sandwich.covariance(&drawn, &[]);
    let design_effect = (&normal * &grouped).trace() / (&normal * &drawn).trace();
    Uncertainty {
        cost,
        dark,
        design_effect: if design_effect > 1.0 { design_effect } else { 1.0 },
        errors,
        structured: grouped.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect(),
        covariance,
        drawn,
        normal,
        bread: sandwich.bread,
        neighbours,
        stated,
        offset: offset.map(|offset| offset.score),
        leaning,
        by_others,
        reach,
    }
}

/// The weights of each channel that its energy limit ties together: they can move, but not their sum. A weight alone has nothing to be tied
/// to: it stands at the end of its range, and keeps its error as one at 0 does.
fn limited(problem: &Problem<'_>, at: &Solution, pinned: &[bool]) -> Vec<Vec<usize>> {
    let of = |(c, x): (usize, &DVector<f64>)| {
        let own: Vec<usize> = (c * x.len()..(c + 1) * x.len()).filter(|&i| !pinned[i]).collect();
        (problem.feasible(c).free_at(x).1 && own.len() > 1).then_some(own)
    };
    at.weights.iter().enumerate().filter_map(of).collect()
}

/// Which parameters are held at a value.
pub(super) fn pinned(problem: &Problem<'_>, channels: usize) -> Vec<bool> {
    let ranges = problem.ranges[..channels].iter().flatten().chain(&problem.bounds);
    ranges.map(|(low, high)| low == high).collect()
}

/// A⁻¹ where it exists.
struct Sandwich {
    bread: DMatrix<f64>,
    /// Share of each parameter in directions that A does not determine.
    open: Vec<f64>,
}

impl Sandwich {
    /// Of the parameters that are not pinned, those of each list in `sums` moving only so that their sum stays.
    fn new(normal: &DMatrix<f64>, pinned: &[bool], sums: &[Vec<usize>]) -> Self {
        let root = |i: usize| if normal[(i, i)] > 0.0 && !pinned[i] { 1.0 / normal[(i, i)].sqrt() } else { 0.0 };
        let scale = DVector::from_fn(pinned.len(), |i, _| root(i));
        let n = scale.len();
        let scaled = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j]);
        let tied: Vec<DVector<f64>> = sums
            .iter()
            .map(|sum| DVector::from_fn(n, |i, _| if sum.contains(&i) { scale[i] } else { 0.0 }))
            .filter_map(|v| v.try_normalize(0.0))
            .collect();
        let mut within = DMatrix::identity(n, n);
        tied.iter().for_each(|q| within.ger(-1.0, q, q, 1.0));
        let eigen = (&within * scaled * &within).symmetric_eigen();
        let floor = UNDETERMINED * eigen.eigenvalues.max();
        let inverse = eigen.eigenvalues.map(|l| if l > floor { 1.0 / l } else { 0.0 });
        let v = &within * &eigen.eigenvectors;
        let pseudo = &v * DMatrix::from_diagonal(&inverse) * v.transpose();
        let open = |i: usize| {
            let share: f64 = (0..n).filter(|&k| inverse[k] == 0.0).map(|k| v[(i, k)].powi(2)).sum();
            if scale[i] > 0.0 { share } else { 1.0 }
        };
        Self {
            open: (0..n).map(open).collect(),
            bread: DMatrix::from_fn(n, n, |i, j| pseudo[(i, j)] * scale[i] * scale[j]),
        }
    }

    /// A⁻¹ (B + Σ g gᵀ) A⁻¹.
    fn covariance(&self, spread: &DMatrix<f64>, common: &[DVector<f64>]) -> DMatrix<f64> {
        let mut covariance = &self.bread * spread * &self.bread;
        for g in common {
            let moved = &self.bread * g;
            covariance += &moved * moved.transpose();
        }
        covariance
    }

    fn errors(&self, covariance: &DMatrix<f64>) -> Vec<Option<f64>> {
        let error = |(i, open): (usize, &f64)| {
            let variance = covariance[(i, i)];
            (*open < INVOLVED && variance.is_finite() && variance >= 0.0).then(|| variance.sqrt())
        };
        self.open.iter().enumerate().map(error).collect()
    }
}

impl Piece {
    fn new(problem: &Problem<'_>, at: &Solution) -> Self {
        let (channels, k) = (at.weights.len(), problem.kinds.len() + problem.layout.len());
        let parameters = channels * problem.kinds.len() + problem.layout.len();
        let sums = ChannelSums {
            cost: 0.0,
            normal: DMatrix::zeros(k, k),
            spread: DMatrix::zeros(k, k),
            known: DMatrix::zeros(k, k),
            squares: DMatrix::zeros(k, k),
            common: vec![DVector::zeros(k); problem.samples.measurement.common.len()],
            outliers: Outliers::new(k),
            dark: false,
            stated: (0.0, 0),
            neighbours: Neighbours::default(),
            on_lines: OnLines::default(),
            tallied: Tallied::new(k),
        };
        let clusters = DMatrix::zeros(parameters, parameters);
        Self { channels: vec![sums; channels], clusters, count: 0, residuals: Residuals::default() }
    }

    /// Adds all sums over one block; `bread` says whether A is among them, `gross` from which residual one is an outlier.
    fn add(&mut self, problem: &Problem<'_>, at: &Solution, block: &Block, bread: bool, gross: f64) {
        let channels = at.weights.len();
        self.residuals.scratch.basis(&block.x, &at.lobes);
        let clusters: Vec<std::ops::Range<usize>> = problem.samples.clusters(block);
        let mut scores = vec![DVector::<f64>::zeros(self.clusters.nrows()); clusters.len()];
        for (c, x) in at.weights.iter().enumerate() {
            let (scratch, sums) = (&mut self.residuals.scratch, &mut self.channels[c]);
            sums.cost += scratch.residuals(problem.samples, block, c, x, problem.saturation);
            let (w, pairs) = (block.weight(c), &block.pairs);
            sums.neighbours.add(&Neighbours::of(&scratch.r, &scratch.trust, w, pairs));
            sums.dark |= vectorised(Dark(&block.x, w)) > 0.0;
            let gradient = sums.add(problem, block, c, scratch, bread);
            sums.outliers.add(scratch, gross);
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

/// Σ w where the lobes with a shape are 0.
struct Dark<'a>(&'a [f64], &'a [f64]);

impl Kernel for Dark<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> f64 {
        let ((x8, rest_x), (w8, rest_w)) = (self.0.as_chunks::<8>(), self.1.as_chunks::<8>());
        let mut lanes = [0.0f64; 8];
        let dark = |x: f64, w: f64| if x == f64::NEG_INFINITY { w } else { 0.0 };
        for (x, w) in x8.iter().zip(w8) {
            for k in 0..8 {
                lanes[k] += dark(x[k], w[k]);
            }
        }
        lanes.iter().sum::<f64>() + rest_x.iter().zip(rest_w).map(|(x, w)| dark(*x, *w)).sum::<f64>()
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
                let growth = |i: usize| w[i] * scratch.slope[i].powi(2) * kind.rho((scratch.r[i] / s).powi(2)).2;
                scratch.weight = (0..w.len()).map(growth).collect();
            }
            scratch.tally(k, &mut gradient, &mut self.normal);
            gradient.fill(0.0);
        }
        let data_slopes = data_slopes(problem, block, channel, &scratch.f);
        scratch.squared_pull();
        let known = stated_errors(problem, block, channel, &scratch.f);
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
            let moved: Vec<f64> = (0..block.len()).map(moved).collect();
            vectorised(Projected { columns: &scratch.columns, on: &moved, into: total.as_mut_slice() });
        }
        gradient
    }
}

/// σ_r of every value of a block that states its σ; empty where the measurement states none.
pub(super) fn stated_errors(problem: &Problem<'_>, block: &Block, channel: usize, f: &[f64]) -> Vec<Option<f64>> {
    let samples = problem.samples;
    let Some(sigma) = samples.measurement.sigma_plane(samples.channels[channel]) else { return Vec::new() };
    let (slopes, w) = (data_slopes(problem, block, channel, f), block.weight(channel));
    let of = |i: usize| {
        let s = slopes[i].abs() * sigma[block.index[i] as usize];
        (s.is_finite() && s > 0.0 && w[i] > 0.0).then_some(s)
    };
    (0..block.len()).map(of).collect()
}

/// ∂r/∂y in the fit's scale, for errors in the data's own unit; empty where the measurement states none.
fn data_slopes(problem: &Problem<'_>, block: &Block, channel: usize, f: &[f64]) -> Vec<f64> {
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
