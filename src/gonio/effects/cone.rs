//! Means over cones of directions: what a source of some size lights and an aperture takes in.
//!
//! Directions are even in solid angle within a half angle α: 1 − cosγ = u (1 − cosα) with u even in [0, 1]. The rule is Gauss–Legendre in u times
//! equal steps in azimuth, exact for polynomials of degree 2m − 1 in the plane across; m doubles until the mean moves by no more than asked.

use glam::DVec3;

use crate::geometry::frame::Frame;
use crate::measurement::Dimension;
use crate::numeric::quadrature::gauss_legendre;

/// Largest m.
const FINEST: usize = 32;

/// The rule of order m: directions about +z of a cone of half angle `alpha`, and their weights, which add up to 1.
fn rule(m: usize, alpha: f64) -> Vec<(DVec3, f64)> {
    if alpha == 0.0 {
        return vec![(DVec3::Z, 1.0)];
    }
    // 1 − cosα without cancellation.
    let depth = 2.0 * (0.5 * alpha).sin().powi(2);
    let around = 2 * m + 2;
    let mut list = Vec::with_capacity(m * around);
    for (ring, &(x, w)) in gauss_legendre(m).iter().enumerate() {
        let fall = depth * 0.5 * (1.0 + x);
        let sin = (fall * (2.0 - fall)).sqrt();
        for k in 0..around {
            // Rings are turned against each other.
            let phi = std::f64::consts::TAU * (k as f64 + 0.5 * (ring % 2) as f64) / around as f64;
            list.push((DVec3::new(sin * phi.cos(), sin * phi.sin(), 1.0 - fall), 0.5 * w / around as f64));
        }
    }
    list
}

/// As [`rule`], in the flat world: directions of the xz plane, even in angle.
fn flat_rule(m: usize, alpha: f64) -> Vec<(DVec3, f64)> {
    if alpha == 0.0 {
        return vec![(DVec3::Z, 1.0)];
    }
    let at = |&(x, w): &(f64, f64)| {
        let (sin, cos) = (alpha * x).sin_cos();
        (DVec3::new(sin, 0.0, cos), 0.5 * w)
    };
    gauss_legendre(2 * m).iter().map(at).collect()
}

/// A frame about `w`; in the flat world its first tangent lies in the xz plane.
fn frame_about(w: DVec3, dimension: Dimension) -> Frame {
    match dimension {
        Dimension::Space => Frame::from_normal(w),
        Dimension::Flat => Frame { tangent: DVec3::new(w.z, 0.0, -w.x), bitangent: DVec3::Y, normal: w },
    }
}

/// Rules of both cones by order.
pub(in crate::gonio) struct Cones {
    /// For m = 1, 2, 4, …: the source's and the detector's.
    rules: Vec<[Vec<(DVec3, f64)>; 2]>,
    accuracy: f64,
    dimension: Dimension,
}

impl Cones {
    /// Rules for half angles `source` and `detector` (rad), for means as good as `accuracy` (relative).
    pub fn new(source: f64, detector: f64, accuracy: f64, dimension: Dimension) -> Self {
        let rule = if dimension == Dimension::Flat { flat_rule } else { rule };
        let orders = std::iter::successors(Some(1), |m| (2 * m <= FINEST).then_some(2 * m));
        Self { rules: orders.map(|m| [rule(m, source), rule(m, detector)]).collect(), accuracy, dimension }
    }

    /// Writes the mean of `f`, all channels, over both cones about (wi, wo), and returns the largest relative change that the last doubling
    /// brought. `f` adds its values times a weight.
    pub fn mean(
        &self,
        wi: DVec3,
        wo: DVec3,
        f: &mut impl FnMut(DVec3, DVec3, f64, &mut [f64]),
        out: &mut [f64],
    ) -> f64 {
        let (about_i, about_o) = (frame_about(wi, self.dimension), frame_about(wo, self.dimension));
        let mut before = vec![0.0; out.len()];
        let mut change = f64::INFINITY;
        for (level, [source, detector]) in self.rules.iter().enumerate() {
            out.fill(0.0);
            for (i, w_i) in source {
                let i = about_i.to_world(*i);
                for (o, w_o) in detector {
                    f(i, about_o.to_world(*o), w_i * w_o, out);
                }
            }
            let moved =
                |(new, old): (&f64, &f64)| if new == old { 0.0 } else { (new - old).abs() / new.abs().max(old.abs()) };
            change = out.iter().zip(&before).map(moved).fold(0.0, f64::max);
            if level > 0 && (change.is_nan() || change <= self.accuracy) {
                break;
            }
            before.copy_from_slice(out);
        }
        change
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments of an even cone: mean of cosγ is (1 + cosα)/2, of sin²γ cos²φ half the mean of 1 − cos²γ.
    #[test]
    fn a_rule_of_order_m_has_the_moments_of_the_cone() {
        for alpha in [1e-6f64, 0.01, 0.5] {
            let a = 2.0 * (0.5 * alpha).sin().powi(2);
            let want = (1.0 - 0.5 * a, 0.5 * (a - a * a / 3.0));
            for m in [2, 4, 32] {
                let list = rule(m, alpha);
                let mean = |f: fn(DVec3) -> f64| list.iter().map(|(w, share)| share * f(*w)).sum::<f64>();
                assert!((mean(|_| 1.0) - 1.0).abs() < 1e-14);
                assert!((mean(|w| w.z) - want.0).abs() < 1e-14, "{alpha} {m}");
                assert!((mean(|w| w.x * w.x) - want.1).abs() < 1e-14 * alpha * alpha + 1e-10 * want.1, "{alpha} {m}");
                assert!(mean(|w| w.x).abs() < 1e-15 && mean(|w| w.x * w.y).abs() < 1e-15);
            }
        }
    }
}
