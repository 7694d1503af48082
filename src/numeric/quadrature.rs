//! Gauss–Legendre quadrature on intervals and over directions.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use glam::DVec3;

type Rule = Arc<Vec<(f64, f64)>>;

/// Nodes and weights of the `order`-point Gauss–Legendre rule on [−1, 1]; exact for polynomials of degree 2·order − 1.
/// `order` 0 counts as 1.
pub fn gauss_legendre(order: usize) -> Rule {
    static RULES: OnceLock<Mutex<HashMap<usize, Rule>>> = OnceLock::new();
    let order = std::num::NonZeroUsize::new(order).unwrap_or(std::num::NonZeroUsize::MIN);
    let mut rules = RULES.get_or_init(Mutex::default).lock().unwrap_or_else(PoisonError::into_inner);
    Arc::clone(rules.entry(order.get()).or_insert_with(|| {
        let rule = gauss_quad::GaussLegendre::new(order);
        Arc::new(rule.iter().map(|(x, w)| (*x, *w)).collect())
    }))
}

/// ∫ f(x) dx over [a, b] by an `order`-point Gauss–Legendre rule.
pub fn integrate(a: f64, b: f64, order: usize, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    half * gauss_legendre(order).iter().map(|&(x, w)| w * f(middle + half * x)).sum::<f64>()
}

/// ∫ f(ω) dω over the polar patch θ ∈ [theta.0, theta.1], φ ∈ [phi.0, phi.1] (rad), dω = sinθ dθ dφ,
/// by `order` Gauss–Legendre points each way.
pub fn integrate_directions(theta: (f64, f64), phi: (f64, f64), order: usize, mut f: impl FnMut(DVec3) -> f64) -> f64 {
    integrate(theta.0, theta.1, order, |t| {
        let (sin_t, cos_t) = t.sin_cos();
        sin_t * integrate(phi.0, phi.1, order, |p| f(DVec3::new(sin_t * p.cos(), sin_t * p.sin(), cos_t)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn polynomials_up_to_the_rule_s_degree_are_exact() {
        for order in [1usize, 2, 5, 16, 64] {
            let degree = 2 * order as i32 - 1;
            let (got, want) =
                (integrate(0.0, 2.0, order, |x| x.powi(degree)), 2f64.powi(degree + 1) / f64::from(degree + 1));
            assert!((got / want - 1.0).abs() < 1e-12, "order {order}: {got} vs {want}");
        }
    }

    #[test]
    fn the_sphere_has_four_pi_steradians() {
        let sphere = integrate_directions((0.0, PI), (0.0, 2.0 * PI), 24, |_| 1.0);
        assert!((sphere - 4.0 * PI).abs() < 1e-12, "{sphere}");
    }
}
