//! How sure the parameters are: the sandwich covariance A⁻¹ B A⁻¹, shared error components, what the data leave open, and what the
//! residuals of neighbours say of the model's own error. One pass over the samples.

use nalgebra::{DMatrix, DVector};

use super::loss::Datum;
use super::passes::{Columns, Residuals, Weighted};
use super::reduced::{Problem, Solution};
use super::samples::Block;
use super::structure::Neighbours;
use crate::numeric::simd::{Kernel, dot, vectorised};
use crate::numeric::stats::student_quantile;

/// A 95 % interval.
pub type Interval = (f64, f64);

/// Uncertainty of all parameters: the weights channel by channel, lobe by lobe, then every ln(shape); in the fit's scale.
#[derive(Debug, Clone)]
pub(super) struct Uncertainty {
    /// Σ w r² from true residuals (robust: Σ w s² ρ).
    pub cost: f64,
    /// Standard error of each parameter; `None` where the data don't determine it.
    pub errors: Vec<Option<f64>>,
    /// Covariance, rows and columns of undetermined parameters meaningless.
    pub covariance: DMatrix<f64>,
    /// The inverse of A, pseudo where singular: the cost rises by δ²/Aⱼⱼ⁻¹ when parameter j alone is held off by δ.
    pub bread: DMatrix<f64>,
    /// Standard errors if the residuals of neighbours are taken as one error, not many: what model error does to the parameters.
    pub structured: Vec<f64>,
    /// Products of neighbours' residuals.
    pub neighbours: Neighbours,
    /// Σ w σ_r² over samples and channels with a stated σ, and how many there are.
    pub stated: (f64, usize),
    /// Quantile of Student's t for 95 %, two-sided.
    pub quantile: f64,
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
    spread: DMatrix<f64>,
    common: Vec<DVector<f64>>,
    /// Whether a sample lies where the lobes with a shape are 0 whatever it is.
    dark: bool,
    stated: (f64, usize),
    neighbours: Neighbours,
}

/// What one block adds.
struct Part {
    channels: Vec<ChannelSums>,
    /// Σ over clusters of neighbours of the outer product of their pull on the parameters.
    clusters: DMatrix<f64>,
    count: usize,
}

/// Standard errors at a solution.
pub(super) fn uncertainty(problem: &Problem<'_>, at: &Solution) -> Uncertainty {
    let samples = problem.samples;
    let (channels, lobes, shapes) = (at.weights.len(), problem.kinds.len(), problem.layout.len());
    let n = samples.residuals();
    let parameters = channels * lobes + shapes;
    let freedom = n as f64 - parameters as f64;
    let inflation = if freedom > 0.0 { n as f64 / freedom } else { f64::NAN };
    let parts = samples.map_blocks(|block| part(problem, at, block, inflation));

    let (mut normal, mut spread) = (DMatrix::zeros(parameters, parameters), DMatrix::zeros(parameters, parameters));
    let mut clusters = DMatrix::zeros(parameters, parameters);
    let mut common = vec![DVector::zeros(parameters); samples.measurement.common.len()];
    let mut dark = vec![false; channels];
    let (mut cost, mut stated, mut neighbours, mut count) = (0.0, (0.0, 0), Neighbours::default(), 0);
    for part in &parts {
        clusters += &part.clusters;
        count += part.count;
        for (c, sums) in part.channels.iter().enumerate() {
            let place: Vec<usize> = (c * lobes..(c + 1) * lobes).chain(channels * lobes..parameters).collect();
            for (i, &a) in place.iter().enumerate() {
                for (j, &b) in place.iter().enumerate() {
                    normal[(a, b)] += sums.normal[(i.max(j), i.min(j))];
                    spread[(a, b)] += sums.spread[(i.max(j), i.min(j))];
                }
                common.iter_mut().zip(&sums.common).for_each(|(total, part)| total[a] += part[i]);
            }
            cost += sums.cost;
            stated = (stated.0 + sums.stated.0, stated.1 + sums.stated.1);
            neighbours.add(&sums.neighbours);
            dark[c] |= sums.dark;
        }
    }
    let sandwich = Sandwich::new(&normal);
    let covariance = sandwich.covariance(&spread, &common);
    let mut errors = sandwich.errors(&covariance);
    for i in confounded(problem, at, &dark) {
        errors[i] = None;
    }
    let grouped = sandwich.covariance(&(clusters * (count as f64 / (count as f64 - 1.0).max(1.0))), &[]);
    Uncertainty {
        cost,
        errors,
        structured: grouped.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect(),
        covariance,
        bread: sandwich.bread,
        neighbours,
        stated,
        quantile: student_quantile(0.975, freedom.max(1.0)),
    }
}

/// Parameters that a lobe at n → 0 shares with the diffuse lobe. A Phong lobe of exponent 0 is diffuse on all samples where it is not 0; where
/// the search ends at that end, or the lobe has no weight and so could stand there, the two can be told apart only by samples behind
/// the mirror direction.
fn confounded(problem: &Problem<'_>, at: &Solution, dark: &[bool]) -> Vec<usize> {
    let lobes = problem.kinds.len();
    let Some(diffuse) = problem.kinds.iter().position(|k| k.lobe().parameters().is_empty()) else { return Vec::new() };
    let mut list = Vec::new();
    for (i, (lobe, parameter)) in problem.layout.iter().enumerate() {
        let own = problem.bounds[i];
        let searched = own.0 < own.1 && own.0 <= parameter.bounds.0.ln();
        let unlit = at.weights.iter().all(|x| x[*lobe] == 0.0);
        if !searched || !(unlit || at.t[i] <= own.0) {
            continue;
        }
        let same = (0..at.weights.len()).filter(|&c| !dark[c]).filter(|&c| {
            [diffuse, *lobe].iter().all(|&l| problem.ranges[c][l].0 < problem.ranges[c][l].1)
        });
        for c in same {
            list.extend([c * lobes + diffuse, c * lobes + lobe, at.weights.len() * lobes + i]);
        }
    }
    list
}

/// A⁻¹ where it exists.
struct Sandwich {
    bread: DMatrix<f64>,
    /// Share of each parameter in directions that A does not determine.
    open: Vec<f64>,
}

impl Sandwich {
    fn new(normal: &DMatrix<f64>) -> Self {
        let scale = normal.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
        let n = scale.len();
        let scaled = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] * scale[i] * scale[j]);
        let eigen = scaled.symmetric_eigen();
        let floor = UNDETERMINED * eigen.eigenvalues.max();
        let inverse = eigen.eigenvalues.map(|l| if l > floor { 1.0 / l } else { 0.0 });
        let v = &eigen.eigenvectors;
        let pseudo = v * DMatrix::from_diagonal(&inverse) * v.transpose();
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

/// All sums over one block.
fn part(problem: &Problem<'_>, at: &Solution, block: &Block, inflation: f64) -> Part {
    let (channels, lobes) = (at.weights.len(), problem.kinds.len());
    let parameters = channels * lobes + problem.layout.len();
    let basis = Columns::fill(block, &at.lobes);
    let pairs = Neighbours::pairs(problem.samples.measurement, block);
    let clusters: Vec<std::ops::Range<usize>> = problem.samples.clusters(block);
    let mut scores = vec![DVector::<f64>::zeros(parameters); clusters.len()];
    let mut all = Vec::new();
    for (c, x) in at.weights.iter().enumerate() {
        let f = basis.model(x);
        let residuals = Residuals::at(problem.samples, block, c, &f, problem.saturation);
        let mut columns = basis.all.clone();
        for (column, (lobe, _)) in columns[lobes..].iter_mut().zip(&problem.layout) {
            column.iter_mut().for_each(|s| *s *= x[*lobe]);
        }
        for (score, cluster) in scores.iter_mut().zip(&clusters) {
            for (i, column) in columns.iter().enumerate() {
                let place = if i < lobes { c * lobes + i } else { channels * lobes + i - lobes };
                score[place] += vectorised(Dot(&residuals.pull[cluster.clone()], &column[cluster.clone()]));
            }
        }
        all.push(channel_sums(problem, block, c, &f, &residuals, &columns, inflation, &pairs));
    }
    let mut sum = DMatrix::zeros(parameters, parameters);
    scores.iter().for_each(|s| sum.ger(1.0, s, s, 1.0));
    Part { channels: all, clusters: sum, count: clusters.len() }
}

struct Dot<'a>(&'a [f64], &'a [f64]);

impl Kernel for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        dot(self.0, self.1)
    }
}

/// A, B and the g_k of one channel. v is σ_r² where σ is known, else r² N/(N − p); under a robust loss always the latter, for a stated σ says nothing
/// of outliers.
#[allow(clippy::too_many_arguments)] // the parts of one sum
fn channel_sums(
    problem: &Problem<'_>,
    block: &Block,
    channel: usize,
    f: &[f64],
    residuals: &Residuals,
    columns: &[Vec<f64>],
    inflation: f64,
    pairs: &[bool],
) -> ChannelSums {
    let samples = problem.samples;
    let measurement = samples.measurement;
    let own = samples.channels[channel];
    let (k, n) = (columns.len(), block.len());
    let w = block.weight(channel);
    let sigma = measurement.sigma_plane(own);
    // |∂r/∂y| in the fit's scale, for errors in the data's own unit.
    let data_slope = |i: usize| {
        let datum = Datum { value: block.y[channel][i], cos_i: block.cos_i[i], epsilon: samples.epsilon[channel] };
        samples.loss.data_slope(f[i], datum) / samples.scale
    };
    let needs_slopes = sigma.is_some() || !measurement.common.is_empty();
    let data_slopes: Vec<f64> = if needs_slopes { (0..n).map(data_slope).collect() } else { Vec::new() };
    let mut stated = (0.0, 0);
    let mut bread = residuals.curvature.clone();
    if let Some((kind, s)) = problem.saturation {
        let growth = |i: usize| w[i] * residuals.slope[i].powi(2) * kind.rho((residuals.r[i] / s).powi(2)).2;
        bread.iter_mut().enumerate().for_each(|(i, b)| *b = growth(i));
    }
    let mut variance: Vec<f64> = residuals.pull.iter().map(|p| p * p * inflation).collect();
    if let Some(sigma) = sigma {
        for i in 0..n {
            let s = data_slopes[i] * sigma[block.index[i] as usize];
            if s.is_finite() && w[i] > 0.0 {
                stated = (stated.0 + w[i] * s * s, stated.1 + 1);
                if problem.saturation.is_none() {
                    variance[i] = (w[i] * residuals.slope[i] * s).powi(2);
                }
            }
        }
    }
    let mut sums = ChannelSums {
        cost: residuals.cost,
        normal: DMatrix::zeros(k, k),
        spread: DMatrix::zeros(k, k),
        common: vec![DVector::zeros(k); measurement.common.len()],
        dark: (0..n).any(|i| w[i] > 0.0 && block.x[i] == f64::NEG_INFINITY),
        stated,
        neighbours: Neighbours::of(&residuals.r, &residuals.trust, w, pairs),
    };
    vectorised(Weighted { columns, weight: &bread, into: &mut sums.normal });
    vectorised(Weighted { columns, weight: &variance, into: &mut sums.spread });
    for (component, total) in sums.common.iter_mut().enumerate() {
        let u = measurement.common_plane(component, own);
        let moved = |i: usize| {
            let shift = u[block.index[i] as usize];
            if shift.is_finite() { w[i] * residuals.trust[i] * residuals.slope[i] * data_slopes[i] * shift } else { 0.0 }
        };
        let moved: Vec<f64> = (0..n).map(moved).collect();
        total.iter_mut().zip(columns).for_each(|(t, column)| *t = vectorised(Dot(&moved, column)));
    }
    sums
}
