//! Float repair: forms that keep their digits where the plain ones cancel.

/// √x for an `x` that is non-negative but for round-off. NaN stays NaN.
#[must_use]
pub fn sqrt_nonneg(x: f64) -> f64 {
    debug_assert!(x.is_nan() || x >= -1e-9, "sqrt_nonneg({x}) is not round-off");
    x.clamp(0.0, f64::INFINITY).sqrt() // clamp keeps NaN; max(0.0) would hide it
}

/// The larger of two values; NaN wins, where `f64::max` would hide it.
#[must_use]
pub fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// a·b − c·d with one rounding error of the result instead of a cancellation (Kahan; Jeannerod, Louvet, Muller 2013).
#[must_use]
pub fn diff_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let (ab, ab_low) = two_product(a, b);
    let (cd, cd_low) = two_product(c, d);
    (ab - cd) + (ab_low - cd_low)
}

/// Dot product of two 3-vectors as if computed in twice the precision and rounded once (Ogita, Rump, Oishi 2005, Dot2).
#[must_use]
pub fn dot_compensated(a: glam::DVec3, b: glam::DVec3) -> f64 {
    let (mut high, mut low) = two_product(a.x, b.x);
    for (x, y) in [(a.y, b.y), (a.z, b.z)] {
        let (p, p_low) = two_product(x, y);
        let (s, s_low) = two_sum(high, p);
        high = s;
        low += p_low + s_low;
    }
    high + low
}

/// a·b as a rounded product and its exact error. With fused multiply-add where the machine has it compiled in; else by
/// Dekker's split (1971), for a call into software is ten times as slow.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    if cfg!(target_feature = "fma") {
        return (p, a.mul_add(b, -p));
    }
    let ((a1, a0), (b1, b0)) = (split(a), split(b));
    let error = ((a1 * b1 - p) + a1 * b0 + a0 * b1) + a0 * b0;
    // The split overflows beyond 2⁹⁹⁶, far from anything that is squared here; the fused form does not.
    if error.is_finite() { (p, error) } else { (p, a.mul_add(b, -p)) }
}

/// a as the sum of two halves of at most 26 bits.
fn split(a: f64) -> (f64, f64) {
    let c = 134_217_729.0 * a; // 2²⁷ + 1
    let high = c - (c - a);
    (high, a - high)
}

fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let bb = s - a;
    (s, (a - (s - bb)) + (b - bb))
}

/// Real roots t0 ≤ t1 of a t² + b t + c = 0 in the sign-safe form; `None` when there is none or a = b = 0.
#[must_use]
pub fn quadratic_roots(a: f64, b: f64, c: f64) -> Option<(f64, f64)> {
    let discriminant = diff_of_products(b, b, 4.0 * a, c);
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    if q == 0.0 {
        return (a != 0.0).then_some((0.0, 0.0));
    }
    if a == 0.0 {
        return Some((c / q, c / q));
    }
    let (t0, t1) = (q / a, c / q);
    Some(if t0 <= t1 { (t0, t1) } else { (t1, t0) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compensated_forms_keep_the_digits_that_plain_ones_lose() {
        let (a, b) = (1.0 + 2f64.powi(-30), 1.0 - 2f64.powi(-30));
        // a·b = 1 − 2⁻⁶⁰ rounds to 1: the plain difference is 0.
        assert_eq!(a * b - 1.0, 0.0);
        assert_eq!(diff_of_products(a, b, 1.0, 1.0), -(2f64.powi(-60)));
        let u = glam::DVec3::new(a, 1.0, 0.0);
        let v = glam::DVec3::new(b, -1.0, 0.0);
        assert_eq!(dot_compensated(u, v), -(2f64.powi(-60)));
    }

    #[test]
    fn quadratic_roots_survive_cancellation() {
        // Roots 1e-9 and 1e9: the textbook form loses the small one.
        let (t0, t1) = quadratic_roots(1.0, -(1e9 + 1e-9), 1.0).expect("two roots");
        assert!((t0 / 1e-9 - 1.0).abs() < 1e-15 && (t1 / 1e9 - 1.0).abs() < 1e-15, "{t0:e} {t1:e}");
        assert_eq!(quadratic_roots(1.0, 0.0, 1.0), None);
        assert_eq!(quadratic_roots(0.0, 2.0, -4.0), Some((2.0, 2.0)));
        assert!(quadratic_roots(f64::NAN, 1.0, 1.0).is_none());
    }

    #[test]
    fn sqrt_repairs_round_off_and_keeps_nan() {
        assert_eq!(sqrt_nonneg(-1e-17), 0.0);
        assert_eq!(sqrt_nonneg(4.0), 2.0);
        assert!(sqrt_nonneg(f64::NAN).is_nan());
        assert!(larger(f64::NAN, 1.0).is_nan() && larger(1.0, f64::NAN).is_nan());
        assert_eq!(larger(1.0, 2.0), 2.0);
    }
}
