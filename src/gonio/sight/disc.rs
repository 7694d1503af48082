//! Moments of a power of the cosine over a disc of directions: what a cone of light or an aperture makes of a Phong lobe.
//!
//! A disc D of half angle a about c, a pole r at the angle α from c, z = r·w. The mean of zⁿ w over D lies in the plane of c and r:
//! ⟨zⁿ w⟩ = P c + Q r. Where the disc is small beside the lobe (a√n below [`NARROW`]) the mean is by Gauss–Legendre rules. Else by its rim, all
//! integrands periodic and smooth, so that equal steps converge faster than any power: with M(m) = ∫ z^m dA = ∮ (1 − z^{m+1})/(m + 1) dφ, φ the
//! azimuth about r (Stokes), and (n + 2) ∫ zⁿ w dA = n r M(n − 1) − ∮ zⁿ ν ds, ν the rim's outward normal (the divergence theorem of zⁿ w's
//! projection on the sphere), |D| (P, Q) follow from M and two more sums over the rim.

use std::f64::consts::{PI, TAU};

use crate::numeric::quadrature::gauss_legendre;

/// A value and its derivative by the exponent n.
pub(super) type Jet = [f64; 2];

/// Half angle times √n from which on the rim is integrated.
const NARROW: f64 = 1.5;
/// Distance of r outside the rim, in widths 1/√n of the lobe, from which on no constant is carried along that cancels.
const CLEAR: f64 = 3.0;

/// A disc of directions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    /// Half angle, rad; 0 is a single direction.
    pub half: f64,
}

/// P and Q, and the mean of zⁿ itself.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    pub p: Jet,
    pub q: Jet,
    pub mean: Jet,
}

impl Disc {
    /// The moments of zⁿ for a pole `alpha` (rad) from the disc's centre.
    pub fn moments(self, n: f64, alpha: f64) -> Moments {
        if self.half == 0.0 {
            let direct = power(n, versine(alpha, 0.0, 0.0));
            return Moments { p: direct, q: [0.0; 2], mean: direct };
        }
        if self.half * n.sqrt() < NARROW { self.by_rule(n, alpha) } else { self.by_rim(n, alpha) }
    }

    fn by_rule(self, n: f64, alpha: f64) -> Moments {
        let width = self.half * n.sqrt();
        let f = |alpha: f64| -> [Jet; 1] { [power_of_alpha(n, alpha)] };
        let [(mean, along, across)] = self.mean_of(alpha, (4.0 + 8.0 * width, 6.0 + 10.0 * width), f);
        let (p, q) = split(alpha, along, across);
        Moments { p, q, mean }
    }

    /// Means over the disc of functions of the angle from r: of f, of f cosγ and of f sinγ cos t, (γ, t) polar about the centre, t = π towards r.
    /// `orders` of the rule: rings, and azimuths on half a turn.
    pub fn mean_of<const F: usize>(
        self,
        alpha: f64,
        orders: (f64, f64),
        f: impl Fn(f64) -> [Jet; F],
    ) -> [(Jet, Jet, Jet); F] {
        let (rings, around) = (orders.0.ceil() as usize, orders.1.ceil() as usize);
        let depth = 2.0 * (0.5 * self.half).sin().powi(2);
        let cosines: Vec<f64> = (0..around).map(|k| (PI * (k as f64 + 0.5) / around as f64).cos()).collect();
        let mut sums = [([0.0; 2], [0.0; 2], [0.0; 2]); F];
        for &(x, w) in gauss_legendre(rings).iter() {
            let fall = depth * 0.5 * (1.0 + x);
            let (sin, cos) = ((fall * (2.0 - fall)).sqrt(), 1.0 - fall);
            let gamma = 2.0 * (0.5 * fall).sqrt().asin();
            let (nearest, slope) = (versine(alpha, gamma, -1.0), sin * alpha.sin());
            for &cos_t in &cosines {
                let values = f(2.0 * (0.5 * (nearest + slope * (1.0 + cos_t))).sqrt().min(1.0).asin());
                let weight = 0.5 * w / around as f64;
                for ((mean, along, across), value) in sums.iter_mut().zip(values) {
                    for j in 0..2 {
                        mean[j] += weight * value[j];
                        along[j] += weight * value[j] * cos;
                        across[j] += weight * value[j] * sin * cos_t;
                    }
                }
            }
        }
        sums
    }

    fn by_rim(self, n: f64, alpha: f64) -> Moments {
        let (sin, cos) = self.half.sin_cos();
        let area = 2.0 * TAU * (0.5 * self.half).sin().powi(2);
        let steps = (24.0 + 6.0 * (n * sin * alpha.sin()).sqrt()).ceil() as usize;
        let outside = (alpha - self.half) * n.sqrt() > CLEAR;
        // Sums over the rim: ∮ zⁿ dt, ∮ z^{n−1} sin²t dt, M(n − 1) and M(n).
        let mut sums = [[0.0; 2]; 4];
        for k in 0..=steps {
            let t = PI * k as f64 / steps as f64;
            let (sin_t, cos_t) = t.sin_cos();
            let weight = if k == 0 || k == steps { PI } else { TAU } / steps as f64;
            let fall = versine(alpha, self.half, cos_t);
            let turn = sin * (cos * alpha.sin() * cos_t + sin * alpha.cos());
            let [below, at, above] = [n - 1.0, n, n + 1.0].map(|m| power(m, fall));
            let area_of = |m: f64, next: Jet| primitive(m, next, fall, outside).map(|g| g * turn);
            let terms = [at, below.map(|v| v * sin_t * sin_t), area_of(n - 1.0, at), area_of(n, above)];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| (0..2).for_each(|j| sum[j] += weight * term[j]));
        }
        let [ring, bent, less, own] = sums;
        let (scale, slope) = (1.0 / (area * (n + 2.0)), 1.0 / (n + 2.0));
        // d/dn of n g(n)/(n + 2) and of g(n)/(n + 2).
        let whole = |g: Jet| [n * g[0] * scale, (g[0] + n * g[1] - n * g[0] * slope) * scale];
        let plain = |g: Jet| [g[0] * scale, (g[1] - g[0] * slope) * scale];
        let (bent, less, ring) = (whole(bent), whole(less), plain(ring));
        let rim = sin * sin;
        Moments {
            p: [0, 1].map(|j| rim * (cos * alpha.cos() * bent[j] + ring[j])),
            q: [0, 1].map(|j| less[j] - rim * cos * bent[j]),
            mean: own.map(|v| v / area),
        }
    }
}

/// P and Q from the means along the centre and across it: w = cosγ c + sinγ cos t (cosα c − r)/sinα + what cancels.
pub(super) fn split(alpha: f64, along: Jet, across: Jet) -> (Jet, Jet) {
    let q = across.map(|v| if v == 0.0 { 0.0 } else { -v / alpha.sin() });
    ([0, 1].map(|j| along[j] - alpha.cos() * q[j]), q)
}

/// 1 − z of the direction at (γ, t) about a centre `alpha` from the pole.
fn versine(alpha: f64, gamma: f64, cos_t: f64) -> f64 {
    2.0 * (0.5 * (alpha - gamma)).sin().powi(2) + gamma.sin() * alpha.sin() * (1.0 + cos_t)
}

/// zᵐ for 1 − z = `fall`; 0 where z ≤ 0.
fn power(m: f64, fall: f64) -> Jet {
    if fall >= 1.0 {
        return [0.0; 2];
    }
    let ln = f64::ln_1p(-fall);
    let value = (m * ln).exp();
    [value, value * ln]
}

/// cosⁿα, 0 from a right angle on.
fn power_of_alpha(n: f64, alpha: f64) -> Jet {
    power(n, 2.0 * (0.5 * alpha).sin().powi(2))
}

/// The area integral's primitive over sin²γ: (1 − z^{m+1})/((m + 1)(1 − z²)), `next` = z^{m+1}; without its 1 where r is `outside` the disc, for
/// the constant's integral is 0 there.
fn primitive(m: f64, next: Jet, fall: f64, outside: bool) -> Jet {
    let k = m + 1.0;
    let across = fall * (2.0 - fall);
    if outside {
        return [-next[0] / (k * across), (-next[1] + next[0] / k) / (k * across)];
    }
    if fall == 0.0 {
        return [0.5, 0.0];
    }
    let rest = if fall < 1.0 { -(k * f64::ln_1p(-fall)).exp_m1() } else { 1.0 };
    [rest / (k * across), (-next[1] - rest / k) / (k * across)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both ways agree where either can be used, and with a fine sum; derivatives with differences.
    #[test]
    fn rim_and_rule_agree_and_derivatives_are_those_of_the_values() {
        for (half, n) in [(0.02f64, 6000.0f64), (0.3, 30.0), (0.5, 9.0), (0.013, 2e5), (1e-3, 3e6)] {
            let disc = Disc { half };
            let width = 1.0 / n.sqrt();
            for alpha in [
                0.01 * half,
                0.3 * half,
                0.999 * half,
                half,
                half + 0.5 * width,
                half + 2.9 * width,
                half + 4.0 * width,
            ] {
                let peak = disc.by_rim(n, 0.0).mean[0];
                let (rim, rule) = (disc.by_rim(n, alpha), disc.by_fine_rule(n, alpha));
                let near = |a: Jet, b: Jet, what: &str| {
                    assert!((a[0] - b[0]).abs() < 3e-10 * peak, "{what} {half} {n} {alpha}: {a:?} {b:?}");
                    assert!(
                        (a[1] - b[1]).abs() < 3e-9 * peak / n.min(1e4) + 3e-10 * b[1].abs(),
                        "{what} slope {half} {n} {alpha}: {a:?} {b:?}"
                    );
                };
                near(rim.mean, rule.mean, "mean");
                near(rim.p, rule.p, "p");
                near(rim.q, rule.q, "q");
                // The mean along the pole: ⟨z^{n+1}⟩ = P cosα + Q.
                let along = disc.by_rim(n + 1.0, alpha).mean[0];
                assert!((rim.p[0] * alpha.cos() + rim.q[0] - along).abs() < 1e-12 * peak, "{half} {n} {alpha}");
            }
        }
    }

    impl Disc {
        fn by_fine_rule(self, n: f64, alpha: f64) -> Moments {
            let f = |alpha: f64| -> [Jet; 1] { [power_of_alpha(n, alpha)] };
            let width = self.half * n.sqrt();
            let [(mean, along, across)] = self.mean_of(alpha, (40.0 + 20.0 * width, 60.0 + 40.0 * width), f);
            let (p, q) = split(alpha, along, across);
            Moments { p, q, mean }
        }
    }

    #[test]
    fn a_disc_that_closes_leaves_the_power() {
        for n in [0.5, 3.0, 1e4] {
            let alpha = 0.7 / f64::sqrt(n).max(1.0);
            let m = Disc { half: 1e-7 }.moments(n, alpha);
            let want = power_of_alpha(n, alpha);
            let along = m.p[0] + m.q[0] * alpha.cos();
            assert!((m.mean[0] - want[0]).abs() < 1e-9 && (along - want[0]).abs() < 1e-9, "{n}: {m:?} {want:?}");
        }
    }
}
