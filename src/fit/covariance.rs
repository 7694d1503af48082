//! How sure the parameters are: the sandwich covariance A⁻¹ B A⁻¹, shared error components, and what the data leave open.

use nalgebra::{DMatrix, DVector};

use super::passes::{dot, jacobian_block};
use super::varpro::{Profile, Solution};
use crate::measurement::Measurement;
use crate::numeric::stats::student_quantile;
use crate::numeric::sum::fold_blocks;

/// A 95 % interval.
pub type Interval = (f64, f64);

/// Uncertainty of every parameter; `None` where the data don't determine it.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// Standard error of each weight, `[channel][lobe]`, in the fit's own scale of the data.
    pub weights: Vec<Vec<Option<f64>>>,
    /// Standard error of each ln(shape).
    pub ln_shapes: Vec<Option<f64>>,
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
    normal: DMatrix<f64>,
    spread: DMatrix<f64>,
    common: Vec<DVector<f64>>,
}

/// Standard errors at a solution.
pub(super) fn uncertainty(problem: &Profile<'_>, at: &Solution, measurement: &Measurement) -> Uncertainty {
    let (channels, lobes, shapes) = (at.weights.len(), problem.kinds.len(), problem.layout.len());
    let n = problem.samples.residuals();
    let parameters = channels * lobes + shapes;
    let freedom = n as f64 - parameters as f64;
    let inflation = if freedom > 0.0 { n as f64 / freedom } else { f64::NAN };
    let mut normal = DMatrix::zeros(parameters, parameters);
    let mut spread = DMatrix::zeros(parameters, parameters);
    let mut common = vec![DVector::zeros(parameters); measurement.common.len()];
    for c in 0..channels {
        let sums = channel_sums(problem, at, measurement, c, inflation);
        let place: Vec<usize> = (c * lobes..(c + 1) * lobes).chain(channels * lobes..parameters).collect();
        for (i, &a) in place.iter().enumerate() {
            for (j, &b) in place.iter().enumerate() {
                normal[(a, b)] += sums.normal[(i, j)];
                spread[(a, b)] += sums.spread[(i, j)];
            }
            common.iter_mut().zip(&sums.common).for_each(|(total, part)| total[a] += part[i]);
        }
    }
    let errors = sandwich(&normal, &spread, &common);
    let weights = (0..channels).map(|c| errors[c * lobes..(c + 1) * lobes].to_vec()).collect();
    let quantile = student_quantile(0.975, freedom.max(1.0));
    Uncertainty { weights, ln_shapes: errors[channels * lobes..].to_vec(), quantile }
}

/// √diag(A⁻¹ (B + Σ g gᵀ) A⁻¹), `None` for parameters in a direction that A does not determine.
fn sandwich(normal: &DMatrix<f64>, spread: &DMatrix<f64>, common: &[DVector<f64>]) -> Vec<Option<f64>> {
    let scale = normal.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| normal[(i, j)] * scale[i] * scale[j]);
    let eigen = scaled.symmetric_eigen();
    let floor = UNDETERMINED * eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|l| if l > floor { 1.0 / l } else { 0.0 });
    let v = &eigen.eigenvectors;
    let pseudo = v * DMatrix::from_diagonal(&inverse) * v.transpose();
    let bread = DMatrix::from_fn(scale.len(), scale.len(), |i, j| pseudo[(i, j)] * scale[i] * scale[j]);
    let mut covariance = &bread * spread * &bread;
    for g in common {
        let moved = &bread * g;
        covariance += &moved * moved.transpose();
    }
    (0..scale.len())
        .map(|i| {
            let open: f64 = (0..inverse.len()).filter(|&k| inverse[k] == 0.0).map(|k| v[(i, k)].powi(2)).sum();
            let variance = covariance[(i, i)];
            (scale[i] > 0.0 && open < INVOLVED && variance.is_finite() && variance >= 0.0).then(|| variance.sqrt())
        })
        .collect()
}

/// A, B and the g_k of one channel. v is σ_r² where σ is known, else r² N/(N − p).
fn channel_sums(
    problem: &Profile<'_>,
    at: &Solution,
    measurement: &Measurement,
    channel: usize,
    inflation: f64,
) -> ChannelSums {
    let samples = problem.samples;
    let x = &at.weights[channel];
    let k = problem.kinds.len() + problem.layout.len();
    let zero = ChannelSums {
        normal: DMatrix::zeros(k, k),
        spread: DMatrix::zeros(k, k),
        common: vec![DVector::zeros(k); measurement.common.len()],
    };
    let sigma = measurement.sigma_plane(channel);
    fold_blocks(
        samples.len(),
        zero.clone(),
        |block| {
            let (phi, mut slope) = jacobian_block(samples, &at.lobes, block.clone());
            for (column, (lobe, _)) in slope.iter_mut().zip(&problem.layout) {
                column.iter_mut().for_each(|s| *s *= x[*lobe]);
            }
            let (w, g) = (&samples.weight(channel)[block.clone()], &samples.slope[block.clone()]);
            let y = &samples.data[channel][block.clone()];
            let index = &samples.index[block];
            let variance: Vec<f64> = (0..w.len())
                .map(|i| {
                    let model: f64 = phi.iter().zip(x.iter()).map(|(p, x)| x * p[i]).sum();
                    let r = model - g[i] * y[i];
                    match sigma.map(|s| g[i] * s[index[i] as usize] / samples.scale) {
                        Some(s) if s.is_finite() => w[i] * w[i] * s * s,
                        _ => w[i] * w[i] * r * r * inflation,
                    }
                })
                .collect();
            let columns: Vec<&Vec<f64>> = phi.iter().chain(&slope).collect();
            let mut sums = zero.clone();
            for (a, column) in columns.iter().enumerate() {
                let scaled = |by: &[f64]| column.iter().zip(by).map(|(x, w)| x * w).collect::<Vec<f64>>();
                let (weighted, spread) = (scaled(w), scaled(&variance));
                for (b, other) in columns.iter().enumerate() {
                    sums.normal[(a, b)] = dot(&weighted, other);
                    sums.spread[(a, b)] = dot(&spread, other);
                }
                for (component, total) in sums.common.iter_mut().enumerate() {
                    let u = measurement.common_plane(component, channel);
                    let moved = |(&i, g): (&u32, &f64)| {
                        if u[i as usize].is_finite() { g * u[i as usize] / samples.scale } else { 0.0 }
                    };
                    total[a] = weighted.iter().zip(index.iter().zip(g).map(moved)).map(|(w, u)| w * u).sum();
                }
            }
            sums
        },
        |total, part| {
            total.normal += part.normal;
            total.spread += part.spread;
            total.common.iter_mut().zip(&part.common).for_each(|(t, p)| *t += p);
        },
    )
}
