//! The statistics that tests and reports use.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};
use statrs::function::gamma::ln_gamma;

/// Quantile of the standard normal distribution, `p` in (0, 1).
#[must_use]
pub fn normal_quantile(p: f64) -> f64 {
    Normal::standard().inverse_cdf(p)
}

/// Quantile of Student's t with `freedom` degrees of freedom (the normal quantile above 10⁶, NaN at 0 or below).
#[must_use]
pub fn student_quantile(p: f64, freedom: f64) -> f64 {
    if freedom > 1e6 {
        return normal_quantile(p);
    }
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::NAN, |t| t.inverse_cdf(p))
}

/// Two-sided probability that a standard normal value lies at least |z| from 0.
#[must_use]
pub fn two_sided_p(z: f64) -> f64 {
    2.0 * Normal::standard().sf(z.abs())
}

/// Probability that χ² with `freedom` degrees of freedom exceeds `chi2` (NaN for no freedom).
#[must_use]
pub fn chi_square_p(chi2: f64, freedom: f64) -> f64 {
    ChiSquared::new(freedom).map_or(f64::NAN, |d| d.sf(chi2))
}

/// The value that χ² with `freedom` > 0 degrees of freedom stays below with probability `p`.
#[must_use]
pub fn chi_square_quantile(p: f64, freedom: f64) -> f64 {
    let half = 0.5 * freedom;
    // Small ones from the first terms of the series P(a, y) = yᵃe⁻ʸ/Γ(a + 1)·(1 + y/(a + 1) + …): bisection ends at 1e-9 off 0.
    let ln_start = (p.ln() + ln_gamma(half + 1.0)) / half;
    if ln_start < SMALL.ln() {
        let (mut y, start) = (ln_start.exp(), ln_start);
        for _ in 0..4 {
            let sum = 1.0 + y / (half + 1.0) * (1.0 + y / (half + 2.0) * (1.0 + y / (half + 3.0)));
            y = (start + (y - sum.ln()) / half).exp();
        }
        return 2.0 * y;
    }
    ChiSquared::new(freedom).map_or(f64::NAN, |d| d.inverse_cdf(p))
}

/// Half a χ² that is small.
const SMALL: f64 = 1e-3;

/// Significance level of one test out of `tests` independent ones, so that all together have `level` (Šidák 1967).
#[must_use]
pub fn sidak(level: f64, tests: usize) -> f64 {
    -f64::exp_m1(f64::ln_1p(-level) / tests.max(1) as f64)
}

/// Pearson's χ² test of counts against expected counts: (χ², degrees of freedom, p). Neighbouring bins are pooled until
/// each expects at least 5.
#[must_use]
pub fn chi_square_test(observed: &[f64], expected: &[f64]) -> (f64, f64, f64) {
    let (mut chi2, mut bins) = (0.0, 0usize);
    let (mut pool_o, mut pool_e) = (0.0, 0.0);
    let (mut last_o, mut last_e) = (0.0, 0.0);
    for (&o, &e) in observed.iter().zip(expected) {
        pool_o += o;
        pool_e += e;
        if pool_e >= 5.0 {
            chi2 += (pool_o - pool_e).powi(2) / pool_e;
            bins += 1;
            (last_o, last_e) = (pool_o, pool_e);
            (pool_o, pool_e) = (0.0, 0.0);
        }
    }
    if bins > 0 && (pool_e > 0.0 || pool_o > 0.0) {
        // The rest joins the last pool.
        chi2 += (last_o + pool_o - last_e - pool_e).powi(2) / (last_e + pool_e) - (last_o - last_e).powi(2) / last_e;
    }
    let freedom = bins.saturating_sub(1) as f64;
    (chi2, freedom, chi_square_p(chi2, freedom))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// χ² of two degrees is exponential, that of one a squared normal value.
    #[test]
    fn small_quantiles_keep_their_digits() {
        for p in [1e-12, 1e-6, 2e-4, 1e-3, 0.02, 0.05, 0.5] {
            let (one, two) = (chi_square_quantile(p, 1.0), chi_square_quantile(p, 2.0));
            let exact = -2.0 * f64::ln_1p(-p);
            assert!((two / exact - 1.0).abs() < 1e-5, "{p}: {two} {exact}");
            assert!(p < 1e-6 || (one / normal_quantile(0.5 + 0.5 * p).powi(2) - 1.0).abs() < 1e-5, "{p}: {one}");
        }
        assert!((chi_square_quantile(0.025, 3.0) - 0.215_795).abs() < 1e-5);
        assert!((chi_square_p(chi_square_quantile(1e-4, 0.7), 0.7) - (1.0 - 1e-4)).abs() < 1e-9);
    }

    #[test]
    fn quantiles_match_published_values() {
        // Abramowitz & Stegun tables 26.5, 26.10; NIST handbook 1.3.6.7.
        assert!((normal_quantile(0.975) - 1.959_963_985).abs() < 1e-8);
        assert!((student_quantile(0.975, 5.0) - 2.570_582).abs() < 1e-5);
        assert!((chi_square_p(18.307, 10.0) - 0.05).abs() < 1e-5);
        assert!((chi_square_quantile(0.95, 10.0) - 18.307).abs() < 1e-3);
        assert!((two_sided_p(1.959_963_985) - 0.05).abs() < 1e-9);
        assert!((sidak(0.05, 1) - 0.05).abs() < 1e-15);
        assert!(sidak(0.01, 786_432) > 1.2e-8 && sidak(0.01, 786_432) < 1.3e-8);
    }

    #[test]
    fn chi_square_sees_a_wrong_die_and_accepts_a_fair_one() {
        let expected = [100.0; 6];
        assert!(chi_square_test(&[90.0, 110.0, 95.0, 105.0, 100.0, 100.0], &expected).2 > 0.1);
        assert!(chi_square_test(&[160.0, 40.0, 100.0, 100.0, 100.0, 100.0], &expected).2 < 1e-6);
        // A count where nothing is expected is never forgiven.
        assert!(chi_square_test(&[100.0, 100.0, 50.0], &[100.0, 100.0, 0.0]).2 < 1e-3);
    }
}
