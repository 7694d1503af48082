//! The flat world's own Lambert and Phong lobes: BRDF values in 1/rad over (θi, θo) ∈ [−π/2, π/2)², angles from the normal.
//!
//! They are plain numbers of weight 1; a model multiplies them by its weight. 0 outside of the domain.

use std::f64::consts::{FRAC_PI_2, PI};

/// Lambert's lobe ½ (1/rad). `None` when an angle (rad) is not finite.
/// ```
/// use goniofit::radiometry::{Quadrature, flat::lambert2d};
/// let half = std::f64::consts::FRAC_PI_2;
/// let albedo = Quadrature::default().interval((-half, half), |to| lambert2d(0.7, to).unwrap() * to.cos()).unwrap();
/// assert!((albedo.value - 1.0).abs() <= albedo.error && albedo.converged);
/// assert_eq!(lambert2d(0.7, 1.6), Some(0.0));
/// assert_eq!(lambert2d(f64::NAN, 0.0), None);
/// ```
#[must_use]
pub fn lambert2d(theta_i: f64, theta_o: f64) -> Option<f64> {
    let finite = theta_i.is_finite() && theta_o.is_finite();
    finite.then(|| if in_domain(theta_i) && in_domain(theta_o) { 0.5 } else { 0.0 })
}

/// Phong's lobe Γ((n+3)/2)/(√π Γ((n+2)/2)) · cosⁿα (1/rad) for |α| < π/2, else 0, with α = θi + θo the angle between the
/// mirror direction −θi and θo (rad), and n = `exponent` ≥ 0. At normal incidence it reflects all light.
///
/// Relative error: a few 2⁻⁵³, times n tanα times the rounding of α. `None` unless n ≥ 0 and all is finite.
/// ```
/// use goniofit::radiometry::{Quadrature, flat::phong2d};
/// // Albedo 1 at normal incidence, whatever the exponent; less at grazing, where the lobe is cut off.
/// let half = std::f64::consts::FRAC_PI_2;
/// for n in [0.0, 1e-6, 0.5, 1.0, 10.0, 1e3, 1e6, 1e8] {
///     // The peak at θo = −θi is made a border, where the quadrature looks.
///     let part = |ti: f64, from, to| Quadrature::default()
///         .interval((from, to), |to| phong2d(n, ti, to).unwrap() * to.cos()).unwrap();
///     let albedo = |ti: f64| (part(ti, -half, -ti), part(ti, -ti, half));
///     let (left, right) = albedo(0.0);
///     let error = left.error + right.error;
///     assert!((left.value + right.value - 1.0).abs() <= error && error < 2e-9, "{n}: {left:?} {right:?}");
///     let (left, right) = albedo(1.2);
///     assert!(left.value + right.value < 1.0);
/// }
/// assert_eq!(phong2d(5.0, 0.3, -0.3), goniofit::radiometry::flat::phong2d_normalisation(5.0));
/// assert_eq!(phong2d(-1.0, 0.0, 0.0), None);
/// ```
#[must_use]
pub fn phong2d(exponent: f64, theta_i: f64, theta_o: f64) -> Option<f64> {
    let alpha = theta_i + theta_o;
    let normalisation = phong2d_normalisation(exponent).filter(|_| theta_i.is_finite() && theta_o.is_finite())?;
    let lit = in_domain(theta_i) && in_domain(theta_o) && alpha.abs() < FRAC_PI_2;
    Some(if lit { normalisation * (exponent * ln_cos(alpha)).exp() } else { 0.0 })
}

/// Γ((n+3)/2)/(√π Γ((n+2)/2)), the value of [`phong2d`] at its peak (1/rad), for n = `exponent` ≥ 0: ½ at n = 0, √(n/2π) for
/// large n. Relative error below 10⁻¹⁵ for every n up to 10³⁰⁰. `None` unless n ≥ 0 and finite.
///
/// The quotient of the gammas goes up by the recurrence Γ(x+½)/Γ(x) = x/(x+½) · Γ(x+3/2)/Γ(x+1) until x ≥ 16, where
/// its series in 1/(x − ¼)² (Tricomi & Erdélyi 1951; five terms leave 3·10⁻¹⁷) takes over. A difference of two ln Γ would
/// lose n ln n · 2⁻⁵³.
/// ```
/// use goniofit::radiometry::flat::phong2d_normalisation;
/// use std::f64::consts::{FRAC_2_PI, PI};
/// // 1/∫ cos^{n+1}: by Wallis' integrals 1/2, 2/π, 3/4, 8/(3π), …
/// for (n, want) in [(0.0, 0.5), (1.0, FRAC_2_PI), (2.0, 0.75), (3.0, 8.0 / (3.0 * PI)), (4.0, 15.0 / 16.0)] {
///     assert!((phong2d_normalisation(n).unwrap() / want - 1.0).abs() < 1e-15);
/// }
/// ```
#[must_use]
pub fn phong2d_normalisation(exponent: f64) -> Option<f64> {
    (exponent >= 0.0 && exponent.is_finite()).then(|| gamma_half_step(0.5 * exponent + 1.0) / PI.sqrt())
}

/// Γ(x + ½)/Γ(x) for x ≥ 1.
fn gamma_half_step(mut x: f64) -> f64 {
    let mut factor = 1.0;
    while x < 16.0 {
        factor *= x / (x + 0.5);
        x += 1.0;
    }
    let y = x - 0.25;
    let z = 1.0 / (y * y);
    let series = 1.0
        + z * (1.0 / 64.0
            + z * (-19.0 / 8192.0
                + z * (631.0 / 524_288.0 + z * (-174_317.0 / 134_217_728.0 + z * (20_491_783.0 / 8_589_934_592.0)))));
    factor * y.sqrt() * series
}

/// ln cosα for |α| < π/2, without cancellation near 0.
fn ln_cos(alpha: f64) -> f64 {
    let (sin, cos) = alpha.sin_cos();
    if alpha.abs() < 0.75 { 0.5 * f64::ln_1p(-sin * sin) } else { cos.ln() }
}

fn in_domain(theta: f64) -> bool {
    (-FRAC_PI_2..FRAC_PI_2).contains(&theta)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normalisation_keeps_its_digits_at_every_exponent() {
        // 60-digit values of exp(ln Γ((n+3)/2) − ln Γ((n+2)/2))/√π, rounded to f64.
        let values = [
            (1e-6, 0.5000001534263889),
            (0.5, 0.5720698226263599),
            (7.0, 1.164104726615006),
            (22.0, 1.9341630935668945),
            (23.5, 1.994910684274816),
            (100.0, 4.019256488052528),
            (1000.0, 12.625121598269581),
            (1e6, 398.9425796080557),
            (1e8, 3989.422833934998),
            (1e12, 398942.2804017319),
        ];
        for (n, want) in values {
            let got = phong2d_normalisation(n).expect("n ≥ 0");
            assert!((got / want - 1.0).abs() < 4.0 * f64::EPSILON, "n {n:e}: {got} {want}");
        }
        for n in [1e15, 1e100, 1e300] {
            let got = phong2d_normalisation(n).expect("n ≥ 0");
            assert!((got / (n / (2.0 * PI)).sqrt() - 1.0).abs() < 2e-15, "n {n:e}: {got}");
        }
    }

    #[test]
    fn the_lobe_keeps_its_digits_at_every_exponent_and_angle() {
        // 60-digit values of the normalisation times cosⁿα, rounded to f64, α the f64 nearest to the number.
        let values = [
            (1.0, 0.1, 0.6334393252040921),
            (1.0, 1.5, 0.04503270122361272),
            (1e3, 1e-4, 12.6250584728193),
            (1e3, 0.1, 0.0843595703385228),
            (1e3, 0.7, 4.710536584394806e-116),
            (1e3, 0.8, 1.416538617291172e-156),
            (1e6, 1e-9, 398.94257960785626),
            (1e6, 1e-4, 396.9528451880276),
            (1e8, 1e-9, 3989.4228337355266),
            (1e8, 1e-4, 2419.707261322815),
        ];
        for (n, alpha, want) in values {
            // exp(x) carries |x| rounding errors of x, here n ln cosα.
            let bound = f64::EPSILON * (6.0 + 2.0 * n * f64::ln(f64::cos(alpha)).abs());
            for got in [phong2d(n, alpha, 0.0), phong2d(n, 0.0, -alpha)] {
                let got = got.expect("finite");
                assert!((got / want - 1.0).abs() < bound, "n {n:e} α {alpha:e}: {got:e} {want:e}");
            }
        }
    }

    #[test]
    fn the_lobe_is_reciprocal_and_ends_at_the_borders() {
        for n in [0.0, 1.0, 50.0, 1e6] {
            for (ti, to) in [(0.3, -0.2), (1.5, -1.4), (-1.0, 0.9), (0.2, 1.0)] {
                assert_eq!(phong2d(n, ti, to), phong2d(n, to, ti));
            }
            // More than 90° from the mirror direction, even for n = 0; outside of the domain; its two ends.
            assert_eq!(phong2d(n, 1.0, 0.7), Some(0.0));
            assert_eq!(phong2d(n, FRAC_PI_2, -1.0), Some(0.0));
            assert_eq!(phong2d(n, -2.0, 1.9), Some(0.0));
            assert!(phong2d(n, -FRAC_PI_2, 1.57).is_some_and(|f| f > 0.0));
            assert_eq!(phong2d(n, f64::NAN, 0.0), None);
            assert_eq!(phong2d(n, 0.0, f64::INFINITY), None);
        }
        assert_eq!(phong2d(f64::NAN, 0.0, 0.0), None);
        assert_eq!(phong2d_normalisation(f64::INFINITY), None);
    }
}
