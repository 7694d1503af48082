//! Moments of a power of the cosine over a disc of directions: what a cone of light or an aperture makes of a Phong lobe.
//!
//! A disc D of half angle a about c, a pole r at the angle α from c, z = r·w. The mean of zⁿ w over D lies in the plane of c and r:
//! ⟨zⁿ w⟩ = P c + Q r. Where the disc is small beside the lobe (a√n below [`NARROW`]) the mean is a sum over arcs about r. Else by its rim, all
//! integrands periodic and smooth, so that equal steps converge faster than any power: with M(m) = ∫ z^m dA = ∮ (1 − z^{m+1})/(m + 1) dφ, φ the
//! azimuth about r (Stokes), dφ = (cosα − cos a z)/(1 − z²) dτ at the azimuth τ about the centre, and (n + 2) ∫ zⁿ w dA = n r M(n − 1) − ∮ zⁿ ν ds, ν the rim's outward normal (the divergence theorem of zⁿ w's
//! projection on the sphere), |D| (P, Q) follow from M and two more sums over the rim.

use std::f64::consts::{PI, TAU};

use crate::numeric::quadrature::gauss_legendre;

/// A value and its derivative by the exponent n.
pub(super) type Jet = [f64; 2];

/// Half angle times √n from which on the rim is integrated.
const NARROW: f64 = 1.5;
/// Distance of r from the rim, in widths 1/√n of the lobe, from which on dφ is slow enough.
const CLEAR: f64 = 3.0;
/// Steps on half of the rim, and the share of it, in widths of the lobe, on which most of them lie: enough for any n, disc and α.
const STEPS: usize = 40;
const NEAR: f64 = 3.0;
/// Shares and multiples of a softening e, so that powers of e up to the second cancel.
const SHARES: [(f64, f64); 3] = [(3.0, 1.0), (-3.0, 2.0), (1.0, 3.0)];

/// Width of a panel in units of that within which a function changes, and its nodes.
const PANEL: f64 = 2.5;
const PANEL_NODES: usize = 16;

/// A disc of directions.
#[derive(Debug, Clone, Copy, PartialEq)]
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
        let [(mean, p, q)] = self.means(alpha, n.sqrt(), (0.0, PI), |alpha| [power_of_alpha(n, alpha)]);
        Moments { p, q, mean }
    }

    /// Means over the disc of functions f of the angle from r, and P, Q of each one's ⟨f w⟩ = P c + Q r. In the `band` of angles f changes within
    /// one over `sharpness` (1/rad), nearer to r slowly, and beyond it is nothing.
    ///
    /// Directions at θ from r that lie in the disc are an arc |ψ| ≤ ψ₀ about r: the mean is ∫ f 2ψ₀ sinθ dθ/|D|, and that of f w has
    /// ∫ f cosθ 2ψ₀ sinθ dθ/|D| along r, ∫ f sinθ 2 sinψ₀ sinθ dθ/|D| across. ψ₀ has a root at both ends of its range; with θ the ends' middle less
    /// half their distance times cos u, the integrand is smooth in u.
    pub fn means<const F: usize>(
        self,
        alpha: f64,
        sharpness: f64,
        band: (f64, f64),
        f: impl Fn(f64) -> [Jet; F],
    ) -> [(Jet, Jet, Jet); F] {
        let (low, high) = (alpha.min(self.half), alpha.max(self.half));
        // Sums of f, f cosθ and f sinθ sinψ₀ over arcs.
        let mut sums = [[[0.0; 2]; 3]; F];
        let mut add = |theta: f64, half_arc: f64, weight: f64| {
            let (sin, cos) = theta.sin_cos();
            let weight = 2.0 * weight * sin;
            let weights = [weight * half_arc, weight * half_arc * cos, weight * half_arc.sin() * sin];
            for (sums, value) in sums.iter_mut().zip(f(theta)) {
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    (0..2).for_each(|j| sum[j] += weight * value[j]);
                }
            }
        };
        if alpha < self.half {
            let whole = [band.0, band.1].map(|theta| theta.clamp(0.0, self.half - alpha));
            panels((0.0, whole[0]), 0.0, |theta, weight| add(theta, PI, weight));
            panels((whole[0], whole[1]), sharpness, |theta, weight| add(theta, PI, weight));
        }
        let mut arc = |u: f64, weight: f64| {
            let (sin, cos) = (0.5 * u).sin_cos();
            let (x, y) = (low * cos * cos, low * sin * sin);
            let (inner, outer) = ((high - x).sin(), (high + y).sin());
            let (over, under) =
                if alpha < self.half { (inner * x.sin(), outer * y.sin()) } else { (y.sin() * x.sin(), outer * inner) };
            let half_arc = 2.0 * over.sqrt().atan2(under.sqrt());
            add(high - x + y, half_arc, 2.0 * weight * low * sin * cos);
        };
        let u_at = |theta: f64| (0.5 * (theta - high + low) / low).clamp(0.0, 1.0).sqrt().asin() * 2.0;
        let (from, to) = (u_at(band.0), u_at(band.1));
        panels((0.0, from), 0.0, &mut arc);
        panels((from, to), low * sharpness, &mut arc);
        let area = self.area();
        sums.map(|[mean, along, across]| {
            let per_c = if alpha == 0.0 { 0.0 } else { 1.0 / (area * alpha.sin()) };
            let p = across.map(|v| v * per_c);
            (mean.map(|v| v / area), p, [0, 1].map(|j| along[j] / area - alpha.cos() * p[j]))
        })
    }

    fn area(self) -> f64 {
        2.0 * TAU * (0.5 * self.half).sin().powi(2)
    }

    fn by_rim(self, n: f64, alpha: f64) -> Moments {
        let (sin, cos) = self.half.sin_cos();
        let area = self.area();
        let rim = Rim::new(self.half, alpha);
        let close = ((alpha - self.half) * n.sqrt()).abs() < CLEAR;
        // ∮ zⁿ dτ, ∮ z^{n−1} sin²τ dτ, M(n − 1) and M(n).
        let mut sums = [[0.0; 2], [0.0; 2], rim.of_constant(n, close), rim.of_constant(n + 1.0, close)];
        rim.walk(n, |fall, sin_squared, weight| {
            let ln = if fall < 1.0 { f64::ln_1p(-fall) } else { f64::NEG_INFINITY };
            let (z, at) = (1.0 - fall, jet((n * ln).exp(), ln));
            let below = if at[0] > 0.0 { at.map(|v| v / z) } else { at };
            let turn = rim.turn(fall);
            let of_area = |k: f64, of: Jet| rest((k, ln), of, fall, close).map(|g| g * turn);
            let terms = [at, below.map(|v| v * sin_squared), of_area(n, at), of_area(n + 1.0, at.map(|v| v * z))];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| (0..2).for_each(|j| sum[j] += weight * term[j]));
        });
        let [ring, bent, less, own] = sums;
        let (scale, slope) = (1.0 / (area * (n + 2.0)), 1.0 / (n + 2.0));
        // d/dn of n g(n)/(n + 2) and of g(n)/(n + 2).
        let whole = |g: Jet| [n * g[0] * scale, (g[0] + n * g[1] - n * g[0] * slope) * scale];
        let plain = |g: Jet| [g[0] * scale, (g[1] - g[0] * slope) * scale];
        let (bent, less, ring) = (whole(bent), whole(less), plain(ring));
        let squared = sin * sin;
        Moments {
            p: [0, 1].map(|j| squared * (cos * alpha.cos() * bent[j] + ring[j])),
            q: [0, 1].map(|j| less[j] - squared * cos * bent[j]),
            mean: own.map(|v| v / area),
        }
    }
}

/// A disc's rim as it is seen from r: at τ, the azimuth about the centre from the side of r on, 1 − z = depth + 2 swing sin²(τ/2).
struct Rim {
    /// Half angle and α.
    at: (f64, f64),
    depth: f64,
    swing: f64,
}

impl Rim {
    fn new(half: f64, alpha: f64) -> Self {
        Self { at: (half, alpha), depth: 2.0 * (0.5 * (alpha - half)).sin().powi(2), swing: half.sin() * alpha.sin() }
    }

    /// Calls `add` with 1 − z, sin²τ and the weight of nodes on the rim. Equal steps of s, tan(τ/2) = β tan(s/2): as many nodes as ever lie where zⁿ
    /// is anything, and the integrand stays smooth and periodic.
    fn walk(&self, n: f64, mut add: impl FnMut(f64, f64, f64)) {
        let beta = (NEAR / (n * self.swing).sqrt()).min(1.0);
        for k in 0..=STEPS {
            let weight = if k == 0 || k == STEPS { PI } else { TAU } / STEPS as f64;
            let (sin, cos) = (0.5 * PI * k as f64 / STEPS as f64).sin_cos();
            let (across, along) = ((beta * sin).powi(2), cos * cos);
            let stretch = 1.0 / (across + along);
            let half = across * stretch;
            add(self.depth + 2.0 * self.swing * half, 4.0 * half * along * stretch, weight * beta * stretch);
        }
    }

    /// sin²γ dφ/dτ, φ and γ polar about r.
    fn turn(&self, fall: f64) -> f64 {
        let (half, alpha) = self.at;
        2.0 * (0.5 * (half - alpha)).sin() * (0.5 * (half + alpha)).sin() + half.cos() * fall
    }

    /// What [`rest`] leaves out of ∮ (1 − zᵏ)/k dφ. Of 1/k that is all, once around or not at all; close to the rim, where dφ is too fast, that of
    /// [`SHARES`] of 1/((1 − z + e)(1 + z + e)), e a multiple of 1/k.
    fn of_constant(&self, k: f64, close: bool) -> Jet {
        let (half, alpha) = self.at;
        let whole = if close {
            SHARES.iter().map(|(share, e)| share * self.softened(e / k)).sum::<f64>()
        } else if alpha < half {
            TAU
        } else {
            0.0
        };
        [whole / k, -whole / (k * k)]
    }

    /// ∮ sin²γ/((1 − z + e)(1 + z + e)) dφ.
    fn softened(&self, e: f64) -> f64 {
        let (start, slope, far) = (self.turn(0.0), self.at.0.cos(), 2.0 + e - self.depth);
        let of_near = (start - slope * e) / ((self.depth + e) * (self.depth + e + 2.0 * self.swing)).sqrt();
        let of_far = (start + slope * (2.0 + e)) / (far * (far - 2.0 * self.swing)).sqrt();
        TAU * (of_near + of_far) / (2.0 + 2.0 * e)
    }
}

/// (1 − zᵏ)/(k sin²γ) without what [`Rim::of_constant`] takes, `of` = zᵏ, `ln` that of z.
fn rest((k, ln): (f64, f64), of: Jet, fall: f64, close: bool) -> Jet {
    let across = fall * (2.0 - fall);
    if !close {
        return [-of[0] / (k * across), (-of[1] + of[0] / k) / (k * across)];
    }
    let soft: f64 = SHARES.iter().map(|(share, e)| share / ((fall + e / k) * (2.0 - fall + e / k))).sum();
    if fall == 0.0 {
        return [0.5 - soft / k, -0.5 / k + soft / (k * k)];
    }
    let less = if of[0] > 0.5 { -(k * ln).exp_m1() } else { 1.0 - of[0] };
    [(less / across - soft) / k, (-of[1] / across - (less / across - soft) / k) / k]
}

/// zᵏ and its derivative by k.
fn jet(value: f64, ln: f64) -> Jet {
    [value, if value == 0.0 { 0.0 } else { value * ln }]
}

/// Calls `add` with nodes and weights of a composite Gauss–Legendre rule between `from` and `to`, for a function that changes within 1/`sharpness`.
fn panels((from, to): (f64, f64), sharpness: f64, mut add: impl FnMut(f64, f64)) {
    if to <= from {
        return;
    }
    let count = ((to - from) * sharpness / PANEL).ceil().max(1.0);
    let half = 0.5 * (to - from) / count;
    let rule = gauss_legendre(PANEL_NODES);
    for k in 0..count as usize {
        rule.iter().for_each(|(x, w)| add(from + half * (2.0 * k as f64 + 1.0 + x), half * w));
    }
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
    jet((m * ln).exp(), ln)
}

/// cosⁿα, 0 from a right angle on.
pub(super) fn power_of_alpha(n: f64, alpha: f64) -> Jet {
    power(n, 2.0 * (0.5 * alpha).sin().powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both ways agree where either can be used, and with a fine sum; derivatives with differences.
    #[test]
    fn rim_and_rule_agree_and_derivatives_are_those_of_the_values() {
        for (half, n) in
            [(0.02f64, 6000.0f64), (0.3, 30.0), (0.5, 9.0), (0.013, 2e5), (1e-3, 3e6), (0.026, 1e8), (0.3, 1e7)]
        {
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
            let [(mean, p, q)] = self.means(alpha, 4.0 * n.sqrt(), (0.0, PI), |alpha| [power_of_alpha(n, alpha)]);
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
