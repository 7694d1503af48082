//! How sure the parameters are: the sandwich covariance A⁻¹ B A⁻¹, shared error components, what the data leave open, and what the
//! residuals of neighbours say of the model's own error. One pass over the samples.

mod rows;
mod sandwich;
mod sums;

use nalgebra::{DMatrix, DVector};

use super::leverage::Leveraged;
use super::loss::Robust;
use super::offset;
use super::outliers;
use super::part::SMALL;
use super::passes::Moments;
use super::reduced::{Problem, Solution};
use super::structure::Neighbours;
use crate::numeric::stats::student_quantile;
use sandwich::Sandwich;
use sums::Totals;
pub(super) use sums::{data_slopes, stated_errors};

/// Share of structure in the residuals' variance from which it is warned of.
pub(super) const STRUCTURED: f64 = 0.25;
/// Share of A's least eigenvalue, scaled, below which it is lost.
const LOST: f64 = 0.5;
/// Half width of a normal variable's 95 % interval over its standard deviation.
const NORMAL_95: f64 = 1.959_963_984_540_054;
/// Standard errors from which it is worth a word that a fit is off the mean.
const MATERIAL: f64 = 0.5;

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
    /// Σ w u_r² over samples, channels and shared errors.
    pub common_noise: f64,
    /// By how many of its standard errors a parameter is off where a fit that follows the data's mean has it, where that matters.
    pub offset: Option<f64>,
    /// Gross outliers under a robust loss.
    pub outliers: outliers::Traits,
    /// Parameters whose error is for the most part that of samples which say nothing of their own noise.
    pub by_others: Vec<usize>,
    /// Half width of each parameter's 95 % interval over its standard error: Student's t, and what leverage asks for.
    pub reach: Vec<f64>,
    /// By how far weights that follow the noise, or a loss that bends, move each parameter, beyond what chance explains.
    pub moved: DVector<f64>,
}

/// Standard errors at a solution. `moments` are the sums of A where they are known.
pub(super) fn uncertainty(
    problem: &Problem<'_>,
    at: &Solution,
    moments: Option<&Moments>,
    robust: Option<Robust>,
) -> Uncertainty {
    let n = problem.samples.residuals();
    let pinned = pinned(problem, at.weights.len());
    let freedom = n as f64 - pinned.iter().filter(|p| !**p).count() as f64;
    let inflation = if freedom > 0.0 { n as f64 / freedom } else { f64::NAN };
    let gross = outliers::gross(robust, problem.saturation.map_or(1.0, |(_, s)| s));
    let mut totals = Totals::gathered(problem, at, moments, gross);
    if problem.saturation.is_some() && is_lost(&totals) {
        totals.normal = totals.bounded.clone();
    }
    let sandwich = Sandwich::new(&totals.normal, &pinned, &limited(problem, at, &pinned));
    let shared: Vec<_> = totals.common.iter().cloned().chain([totals.outliers.shared(&sandwich.bread)]).collect();
    let told_by_residuals = problem.saturation.is_some() || totals.stated.1 < n;
    // What is known, and between channels what a row's share.
    let stated = &totals.known + &totals.rows;
    let mut spread = stated.clone();
    if told_by_residuals {
        spread += &totals.by_residuals * inflation;
    }
    let leveraged =
        (n <= SMALL && freedom > 0.0 && told_by_residuals).then(|| Leveraged::new(problem, at, &sandwich.bread));
    if let Some(leveraged) = &leveraged {
        spread += &leveraged.lone;
    }
    let covariance = sandwich.covariance(&spread, &shared);
    let mut errors = sandwich.errors(&covariance);
    errors.iter_mut().zip(&pinned).filter(|(_, p)| **p).for_each(|(e, _)| *e = Some(0.0));
    let (reach, by_others) = match leveraged {
        Some(leveraged) => {
            let certain = sandwich.covariance(&stated, &shared).diagonal();
            (leveraged.reach(&certain, &covariance.diagonal(), freedom), leveraged.by_others(&certain))
        }
        None => (vec![student_quantile(0.975, freedom.max(1.0)); pinned.len()], Vec::new()),
    };
    // Model error, weighed otherwise, moves the parameters too, but is no offset.
    let alike = totals.neighbours.correlation().is_some_and(|(rho, error)| rho > STRUCTURED && rho > 3.0 * error);
    let offset = if alike { None } else { offset::offset(problem, at, gross) };
    let moved = offset.as_ref().map_or(DVector::zeros(pinned.len()), |offset| &sandwich.bread * &offset.pull);
    let shift = errors.iter().zip(&moved).filter_map(|(e, m)| e.filter(|e| *e > 0.0).map(|e| m.abs() / e));
    let shift = shift.fold(0.0, f64::max);
    let offset = offset.filter(|offset| offset.is_clear && shift >= MATERIAL).map(|_| shift);
    let (clusters, count) = (totals.clusters.0, totals.clusters.1 as f64);
    let grouped = sandwich.covariance(&(clusters * (count / (count - 1.0).max(1.0))), &[]);
    let drawn = sandwich.covariance(&totals.drawn, &[]);
    let design_effect = (&totals.normal * &grouped).trace() / (&totals.normal * &drawn).trace();
    let outliers = totals.outliers.traits(&sandwich.bread);
    Uncertainty {
        cost: totals.cost,
        dark: totals.dark,
        design_effect: if design_effect > 1.0 { design_effect } else { 1.0 },
        errors,
        structured: grouped.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect(),
        covariance,
        drawn,
        normal: totals.normal,
        bread: sandwich.bread,
        neighbours: totals.neighbours,
        stated: totals.stated,
        common_noise: totals.common_noise,
        offset,
        outliers,
        by_others,
        reach,
        moved,
    }
}

impl Uncertainty {
    /// Half width of the 95 % interval of parameter `i`: the noise, and by how far it moves the estimate off the mean. `None` where the data
    /// don't determine it.
    pub fn half_width(&self, i: usize) -> Option<f64> {
        self.errors[i].map(|error| (self.reach[i] * error).hypot(NORMAL_95 * self.moved[i]))
    }
}

/// Whether growths of pulls that are 0 or less, of residuals beyond s, leave a direction of A open or nearly so that is not: as where the model can't
/// follow the data that decide a parameter.
fn is_lost(totals: &Totals) -> bool {
    let scale = totals.bounded.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let least = |m: &DMatrix<f64>| {
        let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| scale[i] * scale[j] * m[(i, j)]);
        scaled.symmetric_eigenvalues().min()
    };
    least(&totals.normal) < LOST * least(&totals.bounded)
}

/// The weights of each channel that its energy limit ties together: they can move, but not their sum. A weight alone has nothing to be tied
/// to: it stands at the end of its range, and keeps its error as one at 0 does.
fn limited(problem: &Problem<'_>, at: &Solution, pinned: &[bool]) -> Vec<Vec<usize>> {
    let of = |(c, x): (usize, &DVector<f64>)| {
        let own: Vec<usize> = (c * x.len()..(c + 1) * x.len()).filter(|&i| !pinned[i]).collect();
        (problem.is_capped(c, x) && own.len() > 1).then_some(own)
    };
    at.weights.iter().enumerate().filter_map(of).collect()
}

/// Which parameters are held at a value.
pub(super) fn pinned(problem: &Problem<'_>, channels: usize) -> Vec<bool> {
    let ranges = problem.ranges[..channels].iter().flatten().chain(&problem.bounds);
    ranges.map(|(low, high)| low == high).collect()
}
