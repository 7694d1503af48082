//! What is minimised: the residual of one value, and how large residuals count.

use crate::measurement::Dimension;
use crate::numeric::simd::{exp, ln, ln_1p};

/// The residual r of one sample and channel, of the model's value f, the measured value y and c = cosθi.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Loss {
    /// r = f − y.
    L2,
    /// r = c (f − y) (Ngan, Durand, Matusik 2005).
    #[default]
    CosineL2,
    /// r = ln(1 + c f) − ln(1 + c y) (Löw et al. 2012); needs c y > −1.
    Log,
    /// r = ∛(c f) − ∛(c y).
    CubeRoot,
    /// r = (f − y)/(|y| + ε), ε = 10⁻³ × the channel's weighted mean of |y|.
    Relative,
}

/// One measured value as a loss sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Datum {
    /// Measured value y.
    pub value: f64,
    /// cosθi > 0.
    pub cos_i: f64,
    /// The channel's ε of [`Loss::Relative`], in the value's unit; any number for the others.
    pub epsilon: f64,
}

/// ε of [`Loss::Relative`] as a share of the channel's weighted mean of |y|.
pub(super) const RELATIVE_EPSILON: f64 = 1e-3;

impl Loss {
    /// All losses.
    pub const ALL: [Self; 5] = [Self::L2, Self::CosineL2, Self::Log, Self::CubeRoot, Self::Relative];

    /// Its name in options and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::L2 => "l2",
            Self::CosineL2 => "cosine-l2",
            Self::Log => "log",
            Self::CubeRoot => "cuberoot",
            Self::Relative => "relative",
        }
    }

    /// The loss with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|l| l.name() == name)
    }

    /// Whether r is linear in f, so that the weights of given shapes come from one linear solve.
    #[must_use]
    pub fn is_linear(self) -> bool {
        matches!(self, Self::L2 | Self::CosineL2 | Self::Relative)
    }

    /// Whether r is not linear in the measured value, so that noise pulls a fit off its mean.
    #[must_use]
    pub fn bends(self) -> bool {
        !matches!(self, Self::L2 | Self::CosineL2)
    }

    /// Whether the residual is defined for this value.
    #[must_use]
    pub fn accepts(self, datum: Datum) -> bool {
        self != Self::Log || datum.cos_i * datum.value > -1.0
    }

    /// r at the model's value `f` ≥ 0.
    #[must_use]
    pub fn residual(self, f: f64, datum: Datum) -> f64 {
        let Datum { value: y, cos_i: c, epsilon } = datum;
        match self {
            Self::L2 => f - y,
            Self::CosineL2 => c * (f - y),
            Self::Log => (c * f).ln_1p() - (c * y).ln_1p(),
            Self::CubeRoot => (c * f).cbrt() - (c * y).cbrt(),
            Self::Relative => (f - y) / (y.abs() + epsilon),
        }
    }

    /// ∂r/∂f at the model's value `f` ≥ 0; infinite for [`Loss::CubeRoot`] at 0.
    #[must_use]
    pub fn slope(self, f: f64, datum: Datum) -> f64 {
        let Datum { value: y, cos_i: c, epsilon } = datum;
        match self {
            Self::L2 => 1.0,
            Self::CosineL2 => c,
            Self::Log => c / (1.0 + c * f),
            Self::CubeRoot => c / (3.0 * (c * f).cbrt().powi(2)),
            Self::Relative => 1.0 / (y.abs() + epsilon),
        }
    }

    /// ∂²r/∂f² where ∂r/∂f is `slope`.
    #[inline(always)]
    pub(super) fn second_slope(self, slope: f64, cos_i: f64) -> f64 {
        match self {
            Self::L2 | Self::CosineL2 | Self::Relative => 0.0,
            Self::Log => -slope * slope,
            // The slope is c/(3 ∛(c f)²).
            Self::CubeRoot => -2.0 * slope * slope / (cos_i / (3.0 * slope)).sqrt(),
        }
    }

    /// ∂r/∂y at the model's value `f`: how far, and which way, an error of the measured value moves the residual. ε counts as a constant.
    #[must_use]
    pub fn data_slope(self, f: f64, datum: Datum) -> f64 {
        let Datum { value: y, cos_i: c, epsilon } = datum;
        match self {
            Self::L2 => -1.0,
            Self::CosineL2 => -c,
            Self::Log => -c / (1.0 + c * y),
            Self::CubeRoot => -c / (3.0 * (c * y).cbrt().powi(2)),
            // Where y < 0 both the numerator and |y| shrink as y rises, so the sign is that of f − ε.
            Self::Relative if y < 0.0 => (f - epsilon) / (epsilon - y).powi(2),
            Self::Relative => -(f + epsilon) / (y + epsilon).powi(2),
        }
    }

    /// The unit of r in words, empty where it has none.
    #[must_use]
    pub fn unit(self, dimension: Dimension) -> &'static str {
        match (self, dimension) {
            (Self::L2 | Self::CosineL2, Dimension::Space) => "1/sr",
            (Self::L2 | Self::CosineL2, Dimension::Flat) => "1/rad",
            (Self::CubeRoot, Dimension::Space) => "sr^(-1/3)",
            (Self::CubeRoot, Dimension::Flat) => "rad^(-1/3)",
            (Self::Log | Self::Relative, _) => "",
        }
    }

    /// The unit of r², when values are divided by `scale` first: the cost in the data's own unit is this times the scaled one.
    pub(super) fn cost_unit(self, scale: f64) -> f64 {
        match self {
            Self::L2 | Self::CosineL2 => scale * scale,
            Self::CubeRoot => scale.cbrt().powi(2),
            Self::Log | Self::Relative => 1.0,
        }
    }

    /// Whether the values may be divided by a common factor without changing the fit.
    pub(super) fn is_homogeneous(self) -> bool {
        self != Self::Log
    }

    /// (r, ∂r/∂f) in vectorisable arithmetic; `gain` is the ∂r/∂f of a linear loss. Where `f` is 0 the cube root's slope is that of the
    /// smallest f that matters.
    #[inline(always)]
    pub(super) fn evaluate(self, f: f64, cos_i: f64, gain: f64, y: f64) -> (f64, f64) {
        match self {
            Self::Log => {
                let u = cos_i * f;
                (ln_1p(u) - ln_1p(cos_i * y), cos_i / (1.0 + u))
            }
            Self::CubeRoot => {
                let root = cube_root(cos_i * f);
                let u = cos_i * f;
                let steep = cube_root(if u > CUBE_FLOOR { u } else { CUBE_FLOOR });
                (root - cube_root(cos_i * y), cos_i / (3.0 * steep * steep))
            }
            Self::L2 | Self::CosineL2 | Self::Relative => (gain * (f - y), gain),
        }
    }
}

/// ∛u to a unit in the last place; of values below 10⁻³⁰⁰, ±10⁻¹⁰⁰.
#[inline(always)]
fn cube_root(u: f64) -> f64 {
    let size = u.abs();
    let size = if size > 1e-300 { size } else { 1e-300 };
    let root = exp(ln(size) * (1.0 / 3.0));
    // One Newton step on root³ = u takes the last digits.
    let root = root - (root * root).mul_add(root, -size) / (3.0 * root * root);
    root.copysign(u)
}

/// Smallest c·f (in the fit's scale, where the largest value is about 1) whose cube root's slope is told apart.
const CUBE_FLOOR: f64 = 1e-18;

/// How residuals beyond the noise count: Σ w s² ρ(r²/s²) in place of Σ w r².
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RobustKind {
    /// ρ(u) = u up to 1, then 2√u − 1 (Huber 1964): an outlier pulls with constant force.
    Huber,
    /// ρ(u) = ln(1 + u): an outlier's pull fades.
    Cauchy,
}

/// Scales that a robust loss can have: below, everything is an outlier, and beyond, nothing is.
pub(super) const ROBUST_SCALES: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// A robust loss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Robust {
    /// Which.
    pub kind: RobustKind,
    /// s as a multiple of the residuals' σ, which is 1.4826 × their median absolute deviation from their median. From 10⁻³ to
    /// 10⁶.
    pub scale: f64,
}

impl RobustKind {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Huber, Self::Cauchy];

    /// Its name in options.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Huber => "huber",
            Self::Cauchy => "cauchy",
        }
    }

    /// The usual multiple of σ: 95 % efficiency for normal noise.
    #[must_use]
    pub fn default_scale(self) -> f64 {
        match self {
            Self::Huber => 1.345,
            Self::Cauchy => 2.385,
        }
    }

    /// (ρ, ρ′, ρ′ + 2uρ″) at u = r²/s²: the cost over s², the weight of a residual, and how its pull grows with it.
    #[inline(always)]
    #[must_use]
    pub fn rho(self, u: f64) -> (f64, f64, f64) {
        match self {
            Self::Huber if u <= 1.0 => (u, 1.0, 1.0),
            Self::Huber => {
                let root = u.sqrt();
                (2.0 * root - 1.0, 1.0 / root, 0.0)
            }
            Self::Cauchy => {
                let v = 1.0 / (1.0 + u);
                (ln_1p(u), v, v * (1.0 - 2.0 * u * v))
            }
        }
    }
}

impl std::str::FromStr for Robust {
    type Err = String;

    /// `huber`, `cauchy`, or either with `:SCALE`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (name, scale) = text.split_once(':').map_or((text, None), |(n, s)| (n, Some(s)));
        let kind = RobustKind::ALL.into_iter().find(|k| k.name() == name);
        let kind = kind.ok_or_else(|| "expected huber or cauchy, with :SCALE if you like".to_owned())?;
        let scale = match scale {
            None => kind.default_scale(),
            Some(text) => text.parse().map_err(|_| format!("the scale \"{text}\" is not a number"))?,
        };
        if ROBUST_SCALES.contains(&scale) {
            Ok(Self { kind, scale })
        } else {
            Err(format!("expected a scale from 1e-3 to 1e6, found {scale:e}"))
        }
    }
}

impl std::fmt::Display for Robust {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.kind.name(), self.scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::LobeKind;
    use nalgebra::Complex;

    type C = Complex<f64>;

    /// The residual in complex arithmetic, from the formulas of the docs.
    fn complex_residual(loss: Loss, f: C, y: C, c: f64, epsilon: f64) -> C {
        let one = C::new(1.0, 0.0);
        match loss {
            Loss::L2 => f - y,
            Loss::CosineL2 => (f - y) * c,
            Loss::Log => (one + f * c).ln() - (one + y * c).ln(),
            Loss::CubeRoot => ((f * c).ln() / 3.0).exp() - ((y * c).ln() / 3.0).exp(),
            Loss::Relative => (f - y) / (y + epsilon),
        }
    }

    /// ∂r/∂f likewise.
    fn complex_slope(loss: Loss, f: C, y: f64, c: f64, epsilon: f64) -> C {
        let one = C::new(1.0, 0.0);
        match loss {
            Loss::L2 => one,
            Loss::CosineL2 => one * c,
            Loss::Log => one * c / (one + f * c),
            Loss::CubeRoot => ((f * c).ln() * (-2.0 / 3.0)).exp() * (c / 3.0),
            Loss::Relative => one / (y + epsilon),
        }
    }

    const STEP: f64 = 1e-30;

    #[test]
    fn residuals_and_slopes_match_complex_steps() {
        for loss in Loss::ALL {
            for f in [1e-9, 1e-3, 0.2, 1.0, 37.0, 1e6] {
                for (y, c) in [(1e-6, 0.2), (0.3, 0.9), (12.0, 0.5), (1e5, 1.0)] {
                    let datum = Datum { value: y, cos_i: c, epsilon: 1e-4 };
                    let (real, h) = (C::new(f, 0.0), C::new(0.0, STEP));
                    let at = |f: C, y: C| complex_residual(loss, f, y, c, datum.epsilon);
                    let r = at(real, C::new(y, 0.0)).re;
                    // The complex logarithm rounds 1 + u, and large values cancel.
                    let size = r.abs().max(loss.residual(0.0, datum).abs()) + 3e-3;
                    assert!((loss.residual(f, datum) - r).abs() <= 1e-13 * size, "{loss:?} {f} {y}");
                    let slope = at(real + h, C::new(y, 0.0)).im / STEP;
                    assert!((loss.slope(f, datum) / slope - 1.0).abs() < 1e-9, "{loss:?} {f} {y}");
                    let second = complex_slope(loss, real + h, y, c, datum.epsilon).im / STEP;
                    let got = loss.second_slope(loss.slope(f, datum), c);
                    assert!((got - second).abs() <= 1e-9 * second.abs(), "{loss:?} {f} {y}: {got:e} {second:e}");
                    let data = at(real, C::new(y, STEP)).im / STEP;
                    // The complex quotient cancels where f ≪ y.
                    let bound = 1e-9 * data.abs() + 1e-15 / (y + 1e-4);
                    assert!((loss.data_slope(f, datum) - data).abs() < bound, "{loss:?} {f} {y}");
                    let (r2, s2) = loss.evaluate(f, c, loss.slope(f, datum), y);
                    let size = size + loss.slope(f, datum) * y; // what cancels
                    assert!((r2 - r).abs() <= 1e-13 * size && (s2 / slope - 1.0).abs() < 1e-9, "{loss:?} {f} {y}");
                }
            }
        }
    }

    /// Of y < 0, where |y| falls as y rises; the sign of `relative` then depends on the model's value.
    #[test]
    fn data_slopes_of_negative_values_match_complex_steps() {
        for loss in [Loss::L2, Loss::CosineL2, Loss::Relative] {
            for f in [1e-9, 1e-4, 1e-3, 0.2, 37.0] {
                for (y, c) in [(-1e-6, 0.2), (-1e-3, 1.0), (-0.3, 0.9), (-12.0, 0.5)] {
                    let datum = Datum { value: y, cos_i: c, epsilon: 1e-4 };
                    let at = |y: C| match loss {
                        Loss::Relative => (C::new(f, 0.0) - y) / (C::new(datum.epsilon, 0.0) - y),
                        other => complex_residual(other, C::new(f, 0.0), y, c, datum.epsilon),
                    };
                    let want = at(C::new(y, STEP)).im / STEP;
                    let got = loss.data_slope(f, datum);
                    // The quotient's two terms cancel where f is near ε.
                    let bound = 1e-9 * want.abs() + 1e-13 / (datum.epsilon - y);
                    assert!((got - want).abs() <= bound, "{loss:?} {f} {y}: {got:e} {want:e}");
                }
            }
        }
    }

    /// ∂r/∂n and ∂r/∂weight of every loss through every lobe, against complex steps of the written-out formula.
    #[test]
    fn derivatives_of_every_loss_through_every_lobe() {
        for loss in Loss::ALL {
            for kind in LobeKind::ALL {
                for n in [0.5, 3.0, 40.0, 3e3, 1e6] {
                    for x in [-1e-7, -1e-4, -0.02, -0.7, -4.0] {
                        let x = if n * x < -200.0 { -200.0 / n } else { x };
                        let (c, y, weight, diffuse) = (0.6, 0.21, 0.3, 0.05);
                        let datum = Datum { value: y, cos_i: c, epsilon: 1e-4 };
                        let lobe = kind.lobe();
                        let mut gradient = vec![0.0; lobe.parameters().len()];
                        let shape = vec![n; gradient.len()];
                        let phi = lobe.value(&shape, x, &mut gradient);
                        let slope = loss.slope(diffuse + weight * phi, datum);
                        let model = |w: C, n: C| w * complex_lobe(kind, n, x) + diffuse;
                        let derivative = |f: C| complex_residual(loss, f, C::new(y, 0.0), c, 1e-4).im / STEP;
                        let by_weight = derivative(model(C::new(weight, STEP), C::new(n, 0.0)));
                        let size = slope * phi.max(1e-3);
                        assert!((slope * phi - by_weight).abs() <= 1e-9 * size, "{loss:?} {kind:?} n {n} x {x}");
                        if let Some(g) = gradient.first() {
                            let by_n = derivative(model(C::new(weight, 0.0), C::new(n, STEP)));
                            let got = slope * weight * g;
                            let size = slope * weight * phi * (1.0 / n + x.abs());
                            assert!(
                                (got - by_n).abs() <= 1e-9 * size.max(1e-12),
                                "{loss:?} {kind:?} n {n} x {x}: {got:e} {by_n:e}"
                            );
                        }
                    }
                }
            }
        }
    }

    fn complex_lobe(kind: LobeKind, n: C, x: f64) -> C {
        use std::f64::consts::{PI, TAU};
        match kind {
            LobeKind::Lambert => C::new(1.0 / PI, 0.0),
            LobeKind::Lambert2d => C::new(0.5, 0.0),
            LobeKind::Phong => (n + 2.0) / TAU * (n * x).exp(),
            LobeKind::Phong2d => {
                ((ln_gamma((n + 3.0) / 2.0) - ln_gamma((n + 2.0) / 2.0)).exp() / PI.sqrt()) * (n * x).exp()
            }
        }
    }

    /// Stirling's series after lifting the argument; complex, so that a step along i differentiates it.
    fn ln_gamma(mut z: C) -> C {
        let mut shift = C::new(0.0, 0.0);
        while z.re < 30.0 {
            shift -= z.ln();
            z += 1.0;
        }
        let one = C::new(1.0, 0.0);
        let series = one / (z * 12.0) - one / (z.powi(3) * 360.0) + one / (z.powi(5) * 1260.0);
        shift + (z - 0.5) * z.ln() - z + 0.5 * std::f64::consts::TAU.ln() + series
    }

    #[test]
    fn robust_weights_are_the_slopes_of_rho() {
        for kind in RobustKind::ALL {
            for u in [0.0, 1e-9, 0.3, 0.999, 1.001, 7.0, 1e8] {
                let (rho, weight, pull) = kind.rho(u);
                let h = 1e-6 * u.max(1e-6);
                let slope = (kind.rho(u + h).0 - kind.rho((u - h).max(0.0)).0) / (h + u.min(h));
                assert!((weight - slope).abs() < 1e-5 * weight, "{kind:?} {u}: {weight} vs {slope}");
                assert!(rho <= u && pull <= 1.0);
                // d(ρ′ r)/dr over s.
                let r = u.sqrt();
                let (a, b) = (r + 1e-6, (r - 1e-6).max(0.0));
                let growth = (kind.rho(a * a).1 * a - kind.rho(b * b).1 * b) / (a - b);
                assert!((pull - growth).abs() < 1e-5, "{kind:?} {u}: {pull} vs {growth}");
            }
        }
        assert_eq!("huber".parse(), Ok(Robust { kind: RobustKind::Huber, scale: 1.345 }));
        assert_eq!("cauchy:3".parse(), Ok(Robust { kind: RobustKind::Cauchy, scale: 3.0 }));
        for wrong in ["tukey", "huber:", "cauchy:-1", "cauchy:inf", "cauchy:NaN", "huber:9e-4", "huber:1e300"] {
            assert!(wrong.parse::<Robust>().is_err(), "{wrong}");
        }
    }
}
