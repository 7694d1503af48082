//! Maps from the unit square to directions, with their densities (per sr) where the caller needs them.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_4, TAU};

use glam::{DVec2, DVec3};

use super::frame::Frame;
use crate::numeric::float::sqrt_nonneg;

/// Unit square to unit disc, area-preserving and continuous (Shirley & Chiu 1997).
#[must_use]
pub fn square_to_disc(u: DVec2) -> DVec2 {
    let p = 2.0 * u - DVec2::ONE;
    if p == DVec2::ZERO {
        return DVec2::ZERO;
    }
    let (r, phi) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (p.x / p.y))
    };
    r * DVec2::new(phi.cos(), phi.sin())
}

/// A direction of the upper hemisphere with density cosθ/π (Malley's method).
#[must_use]
pub fn cosine_hemisphere(u: DVec2) -> DVec3 {
    let d = square_to_disc(u);
    d.extend(sqrt_nonneg(1.0 - d.length_squared()))
}

/// Density of [`cosine_hemisphere`] at `w`, per sr; 0 below the horizon.
#[must_use]
pub fn cosine_hemisphere_pdf(w: DVec3) -> f64 {
    FRAC_1_PI * w.z.clamp(0.0, f64::INFINITY)
}

/// A direction uniform over the sphere.
#[must_use]
pub fn uniform_sphere(u: DVec2) -> DVec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = 2.0 * sqrt_nonneg(u.x * (1.0 - u.x));
    let (s, c) = (TAU * u.y).sin_cos();
    DVec3::new(r * c, r * s, z)
}

/// A direction about the unit vector `axis` with density (n + 1)/2π · cosⁿα, α the angle from the axis, n = `exponent` ≥ 0.
///
/// For large n sin α is formed from 1 − cos²α by `exp_m1`, so that it keeps its digits.
#[must_use]
pub fn cosine_power(axis: DVec3, exponent: f64, u: DVec2) -> DVec3 {
    // u in [0, 1) → 1 − u in (0, 1]: the logarithm is finite.
    let ln_cos = f64::ln_1p(-u.x) / (exponent + 1.0);
    let (cos_a, sin_a) = (ln_cos.exp(), sqrt_nonneg(-f64::exp_m1(2.0 * ln_cos)));
    let (s, c) = (TAU * u.y).sin_cos();
    Frame::from_normal(axis).to_world(DVec3::new(sin_a * c, sin_a * s, cos_a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::angle_between;
    use crate::numeric::random::{Purpose, RngExt, stream};
    use crate::numeric::stats::chi_square_test;

    /// χ² of samples against the density, binned by the angle from the axis (16 bins of equal probability).
    fn check(name: &str, draw: impl Fn(DVec2) -> f64) {
        let mut rng = stream(11, Purpose::Study, 0);
        let mut counts = [0.0; 16];
        for _ in 0..64_000 {
            let quantile = draw(DVec2::new(rng.random(), rng.random()));
            counts[((quantile * 16.0) as usize).min(15)] += 1.0;
        }
        let (chi2, _, p) = chi_square_test(&counts, &[4000.0; 16]);
        assert!(p > 1e-3, "{name}: chi2 {chi2}, p {p}");
    }

    #[test]
    fn samples_follow_their_densities() {
        check("cosine", |u| 1.0 - cosine_hemisphere(u).z.powi(2));
        check("disc, azimuth", |u| {
            let d = square_to_disc(u);
            0.5 + d.y.atan2(d.x) / TAU
        });
        check("sphere", |u| 0.5 * (1.0 - uniform_sphere(u).z));
        let axis = DVec3::new(0.6, 0.0, 0.8);
        for n in [0.0, 1.0, 50.0, 1e6] {
            check("cosine power", |u| {
                let half = 0.5 * angle_between(axis, cosine_power(axis, n, u));
                -f64::exp_m1((n + 1.0) * f64::ln_1p(-2.0 * half.sin().powi(2)))
            });
        }
    }
}
