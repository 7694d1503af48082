//! The Phong lobe as a BRDF: reciprocal, normalised to reflect `weight` at normal incidence (Phong 1975; Lewis 1994;
//! Lafortune & Willems 1994), and its twin in the flat world.
//!
//! f = weight·(n + 2)/(2π)·(r·wo)ⁿ where r·wo > 0, r the mirror image of wi about the normal, else 0, for n = 0 too.
//! Its directional albedo falls towards grazing, to weight·cosθ for large n, because part of the lobe sinks below the horizon.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::lobe::{Lobe, Parameter, above_horizon, ln_cos_alpha};
use crate::numeric::quadrature::integrate;
use crate::numeric::simd::{Kernel, Simd, exp, vectorised};
use crate::radiometry::flat::phong2d_normalisation;

/// The exponent n; the fit searches this range.
const EXPONENT: [Parameter; 1] = [Parameter { name: "exponent", unit: "1", bounds: (0.01, 1e8) }];

/// The Phong lobe. Its coordinate is ln cosα.
#[derive(Debug, Clone, Copy)]
pub struct Phong;

/// The Phong lobe of the flat world, Γ((n+3)/2)/(√π·Γ((n+2)/2))·cosⁿα.
#[derive(Debug, Clone, Copy)]
pub struct Phong2d;

fn coordinate(wi: DVec3, wo: DVec3) -> f64 {
    if above_horizon(wi, wo) { ln_cos_alpha(wi, wo) } else { f64::NEG_INFINITY }
}

/// cosⁿα = exp(n ln cosα); 0 where the coordinate is −∞, for n = 0 too.
fn power(exponent: f64, ln_cos: f64) -> f64 {
    if ln_cos == f64::NEG_INFINITY { 0.0 } else { (exponent * ln_cos).exp() }
}

impl Lobe for Phong {
    fn name(&self) -> &'static str {
        "phong"
    }

    fn parameters(&self) -> &'static [Parameter] {
        &EXPONENT
    }

    fn coordinate(&self, wi: DVec3, wo: DVec3) -> f64 {
        coordinate(wi, wo)
    }

    fn value(&self, shape: &[f64], coordinate: f64, gradient: &mut [f64]) -> f64 {
        let n = shape[0];
        let p = power(n, coordinate) / TAU;
        gradient[0] = if p == 0.0 { 0.0 } else { p * ((n + 2.0) * coordinate + 1.0) };
        p * (n + 2.0)
    }

    fn fill(&self, shape: &[f64], coordinates: &[f64], values: &mut [f64], derivatives: &mut [Vec<f64>]) {
        fill((shape[0], (shape[0] + 2.0) / TAU, 1.0 / TAU), coordinates, values, derivatives);
    }

    fn power(&self, n: f64) -> Option<(f64, f64)> {
        Some(((n + 2.0) / TAU, 1.0 / TAU))
    }
}

impl Lobe for Phong2d {
    fn name(&self) -> &'static str {
        "phong2d"
    }

    fn parameters(&self) -> &'static [Parameter] {
        &EXPONENT
    }

    fn coordinate(&self, wi: DVec3, wo: DVec3) -> f64 {
        coordinate(wi, wo)
    }

    fn value(&self, shape: &[f64], coordinate: f64, gradient: &mut [f64]) -> f64 {
        let n = shape[0];
        let (norm, slope) = flat_normalization(n);
        let p = power(n, coordinate);
        gradient[0] = if p == 0.0 { 0.0 } else { p * (norm * coordinate + slope) };
        p * norm
    }

    fn fill(&self, shape: &[f64], coordinates: &[f64], values: &mut [f64], derivatives: &mut [Vec<f64>]) {
        let (norm, slope) = flat_normalization(shape[0]);
        fill((shape[0], norm, slope), coordinates, values, derivatives);
    }

    fn power(&self, n: f64) -> Option<(f64, f64)> {
        Some(flat_normalization(n))
    }
}

/// Values norm·cosⁿα and derivatives (norm·ln cosα + slope)·cosⁿα of many coordinates.
fn fill(
    (exponent, norm, slope): (f64, f64, f64),
    coordinates: &[f64],
    values: &mut [f64],
    derivatives: &mut [Vec<f64>],
) {
    let mut unused = Vec::new();
    let derivatives = derivatives.first_mut().unwrap_or(&mut unused);
    derivatives.resize(coordinates.len(), 0.0);
    vectorised(Fill { exponent, norm, slope, coordinates, values, derivatives });
}

struct Fill<'a> {
    exponent: f64,
    norm: f64,
    slope: f64,
    coordinates: &'a [f64],
    values: &'a mut [f64],
    derivatives: &'a mut [f64],
}

impl Kernel for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) {
        let n = self.coordinates.len();
        let (values, derivatives) = (&mut self.values[..n], &mut self.derivatives[..n]);
        for i in 0..n {
            let x = self.coordinates[i];
            let lit = x > f64::NEG_INFINITY;
            let x = if lit { x } else { 0.0 };
            let p = exp(self.exponent * x);
            values[i] = if lit { p * self.norm } else { 0.0 };
            derivatives[i] = if lit { p * self.norm.mul_add(x, self.slope) } else { 0.0 };
        }
    }
}

/// c(n) = Γ((n+3)/2)/(√π·Γ((n+2)/2)), which makes ∫ c cosⁿα cosα dα = 1 over [−π/2, π/2], and its derivative by n, c/2 times the
/// difference of two digammas.
fn flat_normalization(n: f64) -> (f64, f64) {
    let value = phong2d_normalisation(n).unwrap_or(f64::NAN);
    let x = 0.5 * (n + 2.0);
    (value, 0.5 * value * digamma_half_step(x))
}

/// ψ(x + ½) − ψ(x) for x ≥ 1, by its recurrence and, for large x, the derivative of the series of ln Γ(x + ½)/Γ(x).
fn digamma_half_step(mut x: f64) -> f64 {
    let mut sum = 0.0;
    while x < 24.0 {
        sum += 0.5 / (x * (x + 0.5)); // 1/x − 1/(x + ½)
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    sum + 0.5 / x + y * (1.0 / 8.0 - y * (1.0 / 64.0 - y * (1.0 / 128.0 - y * (17.0 / 2048.0))))
}

/// Density (1/sr) of the directions that [`crate::geometry::sampling::cosine_power`] draws about the mirror direction.
#[must_use]
pub fn sampling_pdf(exponent: f64, wi: DVec3, wo: DVec3) -> f64 {
    (exponent + 1.0) / TAU * power(exponent, ln_cos_alpha(wi, wo))
}

/// [`directional_albedo`] at cosθ = `cos`, within some 15 %: how often a lobe is worth drawing. Head on it is 1, at grazing angles half a Gaussian of variance
/// 1/n is left above the horizon.
#[must_use]
pub fn seen(exponent: f64, cos: f64) -> f64 {
    let least = SEEN_GRAZING / (exponent + SEEN_OFFSET);
    (cos * cos * (1.0 - least) + least).sqrt()
}

/// Of [`seen`]: 1/2π of a Gaussian, and what makes it right for n = 1.
pub(crate) const SEEN_GRAZING: f64 = 0.16;
/// The second of these.
pub(crate) const SEEN_OFFSET: f64 = 0.6;

/// Share of the light from polar angle `theta` (rad, [0, π/2]) that a Phong lobe of weight 1 reflects, to about 1e-12;
/// at most 1. By reciprocity also the radiance towards `theta` in a uniform surround of radiance 1.
///
/// Rings about the mirror direction lie wholly above the horizon up to α₀ = π/2 − θ: their part is closed,
/// cosθ (1 − sinⁿ⁺²θ). The clipped rings' integrals over azimuth are closed too; the integral over α is left, graded towards
/// α₀ where the integrand bends at every scale.
#[must_use]
pub fn directional_albedo(exponent: f64, theta: f64) -> f64 {
    let n = exponent;
    let (sin_t, cos_t) = theta.sin_cos();
    let whole = if sin_t > 0.0 { -cos_t * f64::exp_m1((n + 2.0) * sin_t.ln()) } else { cos_t };
    whole + clipped_rings(n, theta)
}

/// The rings from α₀ = π/2 − θ to π/2, in β = α − α₀ from 0 to θ. Panels double in width away from α₀, where the integrand bends
/// at every scale, and halve towards π/2, where cosⁿα has a root's end for small n.
fn clipped_rings(n: f64, theta: f64) -> f64 {
    let (sin_t, cos_t) = theta.sin_cos();
    let total = (negligible_beyond(n) - (FRAC_PI_2 - theta)).min(theta);
    if sin_t <= 0.0 || total <= 0.0 {
        return 0.0;
    }
    // A clipped ring is 2 [ψ cosθ cosα + sinθ sinα sinψ], with cosψ and sinψ both times sinθ sinα here.
    let ring = |beta: f64, left: f64| {
        let (cos_a, sin_a) = left.sin_cos();
        let (cos_psi, sin_psi) = (-cos_t * cos_a, (beta.sin() * (theta + left).sin()).max(0.0).sqrt());
        2.0 * (sin_psi.atan2(cos_psi) * cos_t * cos_a + sin_psi) * sin_a * power(n, cos_a.max(0.0).ln())
    };
    let spread = 1.0 / (n + 1.0).sqrt();
    let middle = 0.5 * total;
    let first = (0.25 * (FRAC_PI_2 - theta)).min(0.25 * total).min(spread).max(1e-14 * total);
    // The first panel in √β, where sinψ starts like a root.
    let mut sum = integrate(0.0, first.sqrt(), 24, |s| 2.0 * s * ring(s * s, theta - s * s));
    let (mut low, mut width) = (first, first);
    while low < middle {
        let high = (low + width).min(middle);
        sum += integrate(low, high, 24, |beta| ring(beta, theta - beta));
        low = high;
        width = (2.0 * width).min(2.0 * spread);
    }
    // The second half from its far end, where `left` = π/2 − α starts at 0 or where the lobe is negligible.
    let nearest = theta - total;
    // cosⁿα there is a power of what is left, so that the first panel may be the wider the higher it is.
    let (mut near, mut width) = (0.0, total * f64::powf(1e-14, 1.0 / (n + 1.0)));
    while near < total - low {
        let far = (near + width).min(total - low);
        sum += integrate(near, far, 24, |left| ring(total - left, nearest + left));
        near = far;
        width = (2.0 * near).min(2.0 * spread);
    }
    (n + 2.0) / TAU * sum
}

/// The angle beyond which cosⁿα < e⁻⁴⁵, π/2 at most.
fn negligible_beyond(n: f64) -> f64 {
    let ln_cos = -45.0 / n.max(1e-300);
    (-f64::exp_m1(2.0 * ln_cos)).sqrt().atan2(ln_cos.exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::direction;
    use crate::numeric::quadrature::integrate_directions;
    use std::f64::consts::PI;

    fn phong(n: f64, wi: DVec3, wo: DVec3) -> f64 {
        Phong.value(&[n], Phong.coordinate(wi, wo), &mut [0.0])
    }

    #[test]
    fn the_lobe_is_reciprocal() {
        for n in [0.0, 1.0, 1e3, 1e6] {
            for k in 0..50 {
                let wi = direction(0.03 * f64::from(k), 0.2);
                let wo = direction(0.03 * f64::from(k) + 1e-3, 0.2 + PI + 1e-3);
                let (f, g) = (phong(n, wi, wo), phong(n, wo, wi));
                assert!((f - g).abs() <= 1e-12 * f, "n {n}: {f:e} vs {g:e}");
            }
        }
    }

    #[test]
    fn directional_albedo_matches_brute_quadrature() {
        for n in [0.0, 1.0, 7.3, 100.0] {
            for theta in [0.0, 0.3, 0.9, 1.3, 1.5] {
                // About the mirror direction, finely: an integral that shares nothing with the closed one.
                let wi = direction(theta, PI);
                let frame = crate::geometry::Frame::from_normal(direction(theta, 0.0));
                let brute = (0..40)
                    .map(|i| {
                        let a = FRAC_PI_2 / 40.0;
                        integrate_directions((a * f64::from(i), a * f64::from(i + 1)), (0.0, TAU), 300, |w| {
                            let wo = frame.to_world(w);
                            phong(n, wi, wo) * wo.z.max(0.0)
                        })
                    })
                    .sum::<f64>();
                let got = directional_albedo(n, theta);
                assert!((got - brute).abs() < 3e-5, "n {n} theta {theta}: {got} vs {brute}");
                assert!(got <= 1.0 + 1e-12);
            }
        }
    }

    #[test]
    fn published_albedos() {
        // By quadrature, independently: rows n, columns cosθ = 1, .9, .75, .5, .25, .1.
        let cosines = [1.0f64, 0.9, 0.75, 0.5, 0.25, 0.1];
        for (n, row) in [
            (1.0, [1.0, 0.90954, 0.78800, 0.60900, 0.45331, 0.36990]),
            (10.0, [1.0, 0.90000, 0.75011, 0.50474, 0.28496, 0.17916]),
            (100.0, [1.0, 0.9, 0.75, 0.5, 0.25017, 0.10821]),
            (1000.0, [1.0, 0.9, 0.75, 0.5, 0.25, 0.10001]),
        ] {
            for (c, want) in cosines.iter().zip(row) {
                let got = directional_albedo(n, c.acos());
                assert!((got - want).abs() <= 6e-6, "n {n} cos {c}: {got} vs {want}");
            }
        }
    }

    #[test]
    fn the_flat_lobe_conserves_energy_at_normal_incidence() {
        for n in [0.0, 0.5, 3.0, 57.9, 58.1, 1e3, 1e6, 1e8] {
            let end = negligible_beyond(n);
            let (norm, slope) = flat_normalization(n);
            let panels = 64;
            let sum: f64 = (0..panels)
                .map(|i| {
                    let (a, b) = (end * f64::from(i) / f64::from(panels), end * f64::from(i + 1) / f64::from(panels));
                    integrate(a, b, 20, |t| 2.0 * norm * power(n, f64::ln_1p(-2.0 * (0.5 * t).sin().powi(2))) * t.cos())
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-10, "n {n}: {sum}");
            let h = 1e-5 * (n + 1.0);
            let difference =
                (flat_normalization(n + h).0 - flat_normalization((n - h).max(0.0)).0) / (h + n - (n - h).max(0.0));
            assert!((slope / difference - 1.0).abs() < 3e-5, "n {n}: {slope:e} vs {difference:e}");
        }
    }

    #[test]
    fn many_coordinates_at_once_are_the_lobes_themselves() {
        let coordinates: Vec<f64> =
            [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 3.0, 30.0, f64::INFINITY].map(|x: f64| -x).to_vec();
        for lobe in [&Phong as &dyn Lobe, &Phong2d] {
            for n in [1e-300, 0.01, 1.0, 7.0, 123.0, 5e4, 1e8] {
                let (mut values, mut derivatives) = (vec![0.0; 10], vec![vec![0.0; 10]]);
                lobe.fill(&[n], &coordinates, &mut values, &mut derivatives);
                let (norm, _) = lobe.power(n).expect("a power");
                for (i, x) in coordinates.iter().enumerate() {
                    let mut slope = [0.0];
                    let value = lobe.value(&[n], *x, &mut slope);
                    let bound = 4e-16 * (1.0 + (n * x).abs().min(750.0)) * value + 1e-290;
                    assert!((values[i] - value).abs() <= bound, "n {n} x {x}: {} vs {value}", values[i]);
                    // The two terms of the slope cancel near its root: judge by their size.
                    let size = value * (1.0 / (n + 2.0) + if x.is_finite() { x.abs() } else { 0.0 });
                    let near = (derivatives[0][i] - slope[0]).abs()
                        <= 1e-13 * (1.0 + (n * x).abs().min(750.0)) * size + 1e-280;
                    assert!(near, "n {n} x {x}: {} vs {}", derivatives[0][i], slope[0]);
                    if x.is_finite() {
                        assert!((norm * (n * x).exp() - value).abs() <= 1e-15 * value);
                    }
                }
            }
        }
    }

    #[test]
    fn zero_for_any_exponent_where_the_mirror_direction_is_behind() {
        let (wi, wo) = (direction(1.2, 0.0), direction(1.2, 0.3));
        assert_eq!(phong(0.0, wi, wo), 0.0);
        assert_eq!(phong(0.0, DVec3::Z, -DVec3::Z), 0.0);
        assert_eq!(phong(5.0, DVec3::X, DVec3::Z), 0.0);
    }
}
