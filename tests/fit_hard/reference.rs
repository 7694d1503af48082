//! Residuals, weights, costs, gradients and covariances written out from the formulas of the documentation, slowly and without the library.

use std::f64::consts::{PI, TAU};

use goniofit::brdf::Material;
use goniofit::fit::{FitOptions, Loss, Robust, RobustKind, WeightMode};
use goniofit::measurement::Measurement;
use goniofit::numeric::stats::student_quantile;
use nalgebra::{DMatrix, DVector};

use crate::support::{cos_alpha, parameters};

/// One value that counts.
pub struct Value {
    pub entry: usize,
    pub channel: usize,
    pub cos_i: f64,
    pub cos_alpha: f64,
    pub y: f64,
    pub w: f64,
}

/// All values that count, and each channel's ε.
pub struct Reference {
    pub values: Vec<Value>,
    pub epsilon: Vec<f64>,
    pub loss: Loss,
    channels: usize,
    glossy: usize,
}

impl Reference {
    pub fn new(m: &Measurement, o: &FitOptions) -> Self {
        let channels = m.channels.len();
        let mut values = Vec::new();
        let mut epsilon = Vec::new();
        for channel in 0..channels {
            let mut own: Vec<Value> = (0..m.len()).step_by(o.stride).filter_map(|e| value(m, o, channel, e)).collect();
            let sum: f64 = own.iter().map(|v| v.w).sum();
            let count = own.len() as f64;
            own.iter_mut().for_each(|v| v.w *= count / sum);
            epsilon.push(1e-3 * own.iter().map(|v| v.w * v.y.abs()).sum::<f64>() / count);
            values.extend(own);
        }
        Self { values, epsilon, loss: o.loss, channels, glossy: o.model.lobes().len() - 1 }
    }

    /// Weight and shape numbers of a value's channel: (kd, [(ks, n)]).
    fn lobes(&self, p: &[f64], channel: usize) -> (f64, Vec<(f64, f64)>) {
        let k = 1 + self.glossy;
        let own = &p[channel * k..(channel + 1) * k];
        (own[0], (0..self.glossy).map(|l| (own[1 + l], p[self.channels * k + l])).collect())
    }

    pub fn model(&self, p: &[f64], v: &Value) -> f64 {
        let (kd, glossy) = self.lobes(p, v.channel);
        kd / PI + glossy.iter().map(|(ks, n)| ks * lobe(*n, v.cos_alpha)).sum::<f64>()
    }

    /// r at the parameters (weights channel by channel, then exponents).
    pub fn residual(&self, p: &[f64], v: &Value) -> f64 {
        let (f, c, y) = (self.model(p, v), v.cos_i, v.y);
        match self.loss {
            Loss::L2 => f - y,
            Loss::CosineL2 => c * (f - y),
            Loss::Log => (c * f).ln_1p() - (c * y).ln_1p(),
            Loss::CubeRoot => (c * f).cbrt() - (c * y).cbrt(),
            Loss::Relative => (f - y) / (y.abs() + self.epsilon[v.channel]),
        }
    }

    /// ∂r/∂f.
    fn slope(&self, p: &[f64], v: &Value) -> f64 {
        let (f, c, y) = (self.model(p, v), v.cos_i, v.y);
        match self.loss {
            Loss::L2 => 1.0,
            Loss::CosineL2 => c,
            Loss::Log => c / (1.0 + c * f),
            Loss::CubeRoot => c.cbrt() / (3.0 * f.cbrt().powi(2)),
            Loss::Relative => 1.0 / (y.abs() + self.epsilon[v.channel]),
        }
    }

    /// ∂r/∂f_meas, ε held.
    fn data_slope(&self, p: &[f64], v: &Value) -> f64 {
        let (f, c, y) = (self.model(p, v), v.cos_i, v.y);
        match self.loss {
            Loss::L2 => -1.0,
            Loss::CosineL2 => -c,
            Loss::Log => -c / (1.0 + c * y),
            Loss::CubeRoot => -c.cbrt() / (3.0 * y.cbrt().powi(2)),
            Loss::Relative => {
                let d = y.abs() + self.epsilon[v.channel];
                -1.0 / d - (f - y) * y.signum() / (d * d)
            }
        }
    }

    /// ∂f/∂parameter, for exponents by ln n.
    fn columns(&self, p: &[f64], v: &Value) -> DVector<f64> {
        let k = 1 + self.glossy;
        let (_, glossy) = self.lobes(p, v.channel);
        let mut j = DVector::zeros(p.len());
        j[v.channel * k] = 1.0 / PI;
        for (l, (ks, n)) in glossy.iter().enumerate() {
            let phi = lobe(*n, v.cos_alpha);
            j[v.channel * k + 1 + l] = phi;
            if v.cos_alpha > 0.0 {
                j[self.channels * k + l] = ks * phi * n * (1.0 / (n + 2.0) + v.cos_alpha.ln());
            }
        }
        j
    }

    pub fn jacobian(&self, p: &[f64], v: &Value) -> DVector<f64> {
        self.columns(p, v) * self.slope(p, v)
    }

    /// Σ w r², or Σ w s² ρ.
    pub fn cost(&self, p: &[f64], robust: Option<(RobustKind, f64)>) -> f64 {
        let term = |v: &Value| {
            let r = self.residual(p, v);
            v.w * match robust {
                None => r * r,
                Some((kind, s)) => s * s * rho(kind, r * r / (s * s)).0,
            }
        };
        self.values.iter().map(term).sum()
    }

    /// Half the gradient of the cost, each entry over √(cost · Aⱼⱼ): the cosine between the residuals and the column.
    pub fn gradient(&self, p: &[f64], robust: Option<(RobustKind, f64)>) -> Vec<f64> {
        let mut g = DVector::zeros(p.len());
        let mut a: DVector<f64> = DVector::zeros(p.len());
        let mut energy = 0.0;
        for v in &self.values {
            let (r, j) = (self.residual(p, v), self.jacobian(p, v));
            let trust = robust.map_or(1.0, |(kind, s)| rho(kind, r * r / (s * s)).1);
            g += v.w * trust * r * &j;
            a += v.w * trust * j.component_mul(&j);
            energy += v.w * trust * r * r;
        }
        g.iter().zip(a.iter()).map(|(g, a)| if *a > 0.0 { g / (a * energy).sqrt() } else { 0.0 }).collect()
    }

    /// A = Σ w J Jᵀ, robust: Σ w (ρ′ + 2uρ″) J Jᵀ; exponents by ln n.
    pub fn normal(&self, p: &[f64], robust: Option<(RobustKind, f64)>) -> DMatrix<f64> {
        let mut a = DMatrix::zeros(p.len(), p.len());
        for v in &self.values {
            let (r, j) = (self.residual(p, v), self.jacobian(p, v));
            let growth = |(kind, s): (RobustKind, f64)| match (kind, (r / s).powi(2)) {
                (RobustKind::Huber, u) => f64::from(u <= 1.0),
                (RobustKind::Cauchy, u) => (1.0 - u) / (1.0 + u).powi(2),
            };
            a += v.w * robust.map_or(1.0, growth) * &j * j.transpose();
        }
        a
    }

    /// Standard errors, exponents in their own unit: √diag A⁻¹ (B + Σ g gᵀ) A⁻¹.
    pub fn errors(&self, m: &Measurement, p: &[f64]) -> Vec<f64> {
        let k = p.len();
        let (mut a, mut b) = (DMatrix::zeros(k, k), DMatrix::zeros(k, k));
        let mut common = vec![DVector::zeros(k); m.common.len()];
        let n = self.values.len() as f64;
        for v in &self.values {
            let (r, j, to) = (self.residual(p, v), self.jacobian(p, v), self.data_slope(p, v));
            let square = match m.sigma_plane(v.channel) {
                Some(sigma) => (to * sigma[v.entry]).powi(2),
                None => r * r * n / (n - k as f64),
            };
            a += v.w * &j * j.transpose();
            b += v.w * v.w * square * &j * j.transpose();
            for (i, g) in common.iter_mut().enumerate() {
                let shift = to * m.common_plane(i, v.channel)[v.entry];
                *g += v.w * &j * if shift.is_finite() { shift } else { 0.0 };
            }
        }
        for g in common {
            b += &g * g.transpose();
        }
        let inverse = a.try_inverse().expect("every parameter is determined");
        let covariance = &inverse * b * &inverse;
        let weights = self.channels * (1 + self.glossy);
        (0..k).map(|i| covariance[(i, i)].sqrt() * if i < weights { 1.0 } else { p[i] }).collect()
    }

    /// t σ of an interval of one channel without a stated σ, without gross outliers, exponents by ln n: A⁻¹ B A⁻¹ with v = (r² + 0.01 q)/(1.01 − h),
    /// q = Σ pull²/Σ m (1 − h) the noise of the channel, and as many degrees of freedom as the samples that decide a parameter have.
    pub fn half_widths(&self, p: &[f64], robust: Option<(RobustKind, f64)>) -> Vec<f64> {
        let inverse = self.normal(p, robust).try_inverse().expect("determined");
        let rows: Vec<(f64, DVector<f64>, f64, f64)> =
            self.values.iter().map(|v| self.leverage(p, v, robust, &inverse)).collect();
        let (squares, expected) =
            rows.iter().fold((0.0, 0.0), |sum, (pull, _, m, rest)| (sum.0 + pull * pull, sum.1 + m * rest));
        let (q, freedom) = (squares / expected, rows.iter().map(|row| row.3).sum::<f64>());
        let bent = inverse * self.bent(p, robust);
        let half_width = |j: usize| {
            let (mut variance, mut mean, mut scatter, mut filled) = (0.0, 0.0, 0.0, 0.0);
            for (pull, moved, m, rest) in &rows {
                let far = moved[j] * moved[j];
                variance += far * (pull * pull + 0.01 * q * m) / (rest + 0.01);
                mean += far * q * m;
                scatter += (far * q * m * rest / (rest + 0.01)).powi(2) / (rest + 0.01);
                filled += far * q * m * 0.01 / (rest + 0.01);
            }
            scatter += filled * filled / freedom;
            let freedom = (mean * mean / scatter).min((self.values.len() - p.len()) as f64);
            (student_quantile(0.975, freedom) * variance.sqrt()).hypot(1.959_963_984_540_054 * bent[j])
        };
        (0..p.len()).map(half_width).collect()
    }

    /// By what the pulls add up otherwise with the loss's slope at the model's value in place of that between model and data, less what chance does.
    fn bent(&self, p: &[f64], robust: Option<(RobustKind, f64)>) -> DVector<f64> {
        let trust = |r: f64| robust.map_or(1.0, |(kind, s)| rho(kind, (r / s).powi(2)).1);
        let (mut sum, mut squares) = (DVector::<f64>::zeros(p.len()), DVector::<f64>::zeros(p.len()));
        for v in &self.values {
            let (r, slope) = (self.residual(p, v), self.slope(p, v));
            let straight = slope * (self.model(p, v) - v.y);
            let term = v.w * slope * (trust(straight) * straight - trust(r) * r) * self.columns(p, v);
            squares += term.component_mul(&term);
            sum += term;
        }
        sum.zip_map(&squares, |g, s| if g * g > s { g * (1.0 - s / (g * g)).sqrt() } else { 0.0 })
    }

    /// Of a value: w ρ′ r ∂r/∂f, A⁻¹ ∂f, (w ρ′ ∂r/∂f)², 1 − h.
    fn leverage(
        &self,
        p: &[f64],
        v: &Value,
        robust: Option<(RobustKind, f64)>,
        inverse: &DMatrix<f64>,
    ) -> (f64, DVector<f64>, f64, f64) {
        let (r, slope, column) = (self.residual(p, v), self.slope(p, v), self.columns(p, v));
        let w = v.w * robust.map_or(1.0, |(kind, s)| rho(kind, (r / s).powi(2)).1);
        let moved = inverse * &column;
        let rest = (1.0 - w * slope * slope * column.dot(&moved)).max(0.0);
        (w * r * slope, moved, (w * slope).powi(2), rest)
    }

    /// SCALE × 1.4826 × the median absolute deviation of the residuals from their median.
    pub fn robust_scale(&self, p: &[f64], robust: Robust) -> f64 {
        let mut r: Vec<f64> = self.values.iter().map(|v| self.residual(p, v)).collect();
        let centre = median(&mut r);
        let mut off: Vec<f64> = r.iter().map(|r| (r - centre).abs()).collect();
        robust.scale * 1.482_602_218_505_602 * median(&mut off)
    }

    pub fn rmse(&self, cost: f64) -> f64 {
        (cost / self.values.len() as f64).sqrt()
    }
}

fn value(m: &Measurement, o: &FitOptions, channel: usize, entry: usize) -> Option<Value> {
    let (wi, wo) = m.directions.pair(entry);
    let least = o.max_angle_deg.to_radians().cos() - 1e-12;
    let y = m.value(channel, entry)?;
    let lit = wi.z > 0.0 && wo.z > 0.0 && wi.z >= least && wo.z >= least;
    if !lit || (o.loss == Loss::Log && wi.z * y <= -1.0) {
        return None;
    }
    let solid_angle = o.weights == WeightMode::SolidAngle && !o.use_sigma;
    let mut w = if solid_angle { m.weights.get(entry) } else { 1.0 };
    if o.use_sigma {
        let sigma = m.sigma_plane(channel).expect("a stated sigma")[entry];
        let shared = (0..m.common.len()).map(|k| m.common_plane(k, channel)[entry].powi(2)).sum::<f64>();
        let c = wi.z;
        let to = match o.loss {
            Loss::L2 => 1.0,
            Loss::CosineL2 => c,
            Loss::Log => c / (1.0 + c * y),
            Loss::CubeRoot => c.cbrt() / (3.0 * y.cbrt().powi(2)),
            Loss::Relative => 1.0 / (y.abs() + plain_epsilon(m, channel)),
        };
        w = (to * to * (sigma * sigma + shared)).recip();
    }
    (w > 0.0).then(|| Value { entry, channel, cos_i: wi.z, cos_alpha: cos_alpha(wi, wo), y, w })
}

/// ε of the relative loss if every valid value counted for one: weights by σ can't wait for weights.
fn plain_epsilon(m: &Measurement, channel: usize) -> f64 {
    let known: Vec<f64> = m.plane(channel).iter().copied().filter(|v| !v.is_nan()).collect();
    1e-3 * known.iter().map(|v| v.abs()).sum::<f64>() / known.len() as f64
}

/// (n + 2)/(2π) cosⁿα, 0 where cosα ≤ 0.
fn lobe(n: f64, cos_alpha: f64) -> f64 {
    if cos_alpha > 0.0 { (n + 2.0) / TAU * cos_alpha.powf(n) } else { 0.0 }
}

/// (ρ, ρ′).
fn rho(kind: RobustKind, u: f64) -> (f64, f64) {
    match kind {
        RobustKind::Huber if u <= 1.0 => (u, 1.0),
        RobustKind::Huber => (2.0 * u.sqrt() - 1.0, 1.0 / u.sqrt()),
        RobustKind::Cauchy => (u.ln_1p(), 1.0 / (1.0 + u)),
    }
}

fn median(list: &mut [f64]) -> f64 {
    list.sort_by(f64::total_cmp);
    let n = list.len();
    if n % 2 == 1 { list[n / 2] } else { 0.5 * (list[n / 2 - 1] + list[n / 2]) }
}

/// The reference at a fit's own optimum.
pub fn at(m: &Measurement, o: &FitOptions, got: &Material) -> (Reference, Vec<f64>) {
    (Reference::new(m, o), parameters(got))
}
