//! Means over cones of directions: what a source of some size lights and an aperture takes in.
//!
//! Directions are even in solid angle within a half angle α: 1 − cosγ = u (1 − cosα) with u even in [0, 1]. The rule is Gauss–Legendre in u times
//! equal steps in azimuth, exact for polynomials of degree 2m − 1 in the plane across; m doubles until the mean moves by no more than asked. So
//! that a narrow lobe does not fall between the directions of low orders, the lobe's width is felt for at the mirror direction first.

use std::sync::OnceLock;

use glam::DVec3;

use crate::geometry::angles::angle_between;
use crate::geometry::frame::Frame;
use crate::geometry::mirror;
use crate::measurement::Dimension;
use crate::numeric::quadrature::gauss_legendre;

/// Largest m for any reading, and where a peak needs it.
const USUAL: usize = 32;
const FINEST: usize = 512;
/// A peak matters for cones whose middle is this many times their reach from it, at most.
const NEAR: f64 = 2.0;

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

/// Directions of both cones, the source's and the detector's, with their weights.
type Rules = [Vec<(DVec3, f64)>; 2];

/// Rules of both cones by order.
pub(in crate::gonio) struct Cones {
    /// Half angles of the source's and the detector's, rad.
    half: [f64; 2],
    /// For m = 1, 2, 4, …, made when they are first asked for.
    rules: Vec<OnceLock<Rules>>,
    /// Levels that any reading may take; the rest is for those that a peak needs.
    usual: usize,
    accuracy: f64,
    /// The only one, where it is set.
    fixed: Option<Rules>,
    dimension: Dimension,
}

/// What a doubling leaves of a move where there are kinks, on average; one move alone may be small by chance.
const LEFT: f64 = 0.25;

/// Directions that one rule of both cones may have: for any reading, and where a peak needs them.
const MANY: usize = 300_000;
const MOST: usize = 5_000_000;

impl Cones {
    /// Rules for half angles `source` and `detector` (rad), for means as good as `accuracy` (relative).
    pub fn new(source: f64, detector: f64, accuracy: f64, dimension: Dimension) -> Self {
        let half = [source, detector];
        let mut cones = Self { half, rules: Vec::new(), usual: 0, accuracy, fixed: None, dimension };
        let levels = |m: usize, most: usize| {
            (0..usize::BITS as usize).take_while(|level| 1 << level <= m && cones.size(*level) <= most).count()
        };
        let (all, usual) = (levels(FINEST, MOST), levels(USUAL, MANY));
        cones.rules = (0..all).map(|_| OnceLock::new()).collect();
        cones.usual = usual;
        cones
    }

    /// The same with one order of both cones' rules, and nothing known of what it leaves.
    pub fn fixed(mut self, order: u32) -> Self {
        self.fixed = Some(self.made([order as usize; 2]));
        self
    }

    /// Orders of both cones' rules where the wider one's is `m`: as fine in angle.
    fn orders(&self, m: u32) -> [usize; 2] {
        let largest = self.half[0].max(self.half[1]);
        self.half.map(|half| ((f64::from(m) * half / largest).ceil() as usize).max(1))
    }

    /// Pairs of directions at a level.
    fn size(&self, level: usize) -> usize {
        let one = |m: usize| if self.dimension == Dimension::Flat { 2 * m } else { m * (2 * m + 2) };
        let of = |(m, half): (usize, f64)| if half == 0.0 { 1 } else { one(m) };
        self.orders(1 << level).into_iter().zip(self.half).map(of).product()
    }

    fn rules(&self, level: usize) -> &Rules {
        self.rules[level].get_or_init(|| self.made(self.orders(1 << level)))
    }

    fn made(&self, orders: [usize; 2]) -> Rules {
        let rule = if self.dimension == Dimension::Flat { flat_rule } else { rule };
        [0, 1].map(|k| rule(orders[k], self.half[k]))
    }

    /// Writes the mean of `f`, all channels, over both cones about (wi, wo), and returns by which share it may be off: the largest relative change
    /// that the last doubling brought; where it is `kinked`, as a table is that is linear between its values, a quarter of the one before if that is more. `f`
    /// adds its values times a weight.
    pub fn mean(
        &self,
        wi: DVec3,
        wo: DVec3,
        kinked: bool,
        f: &mut impl FnMut(DVec3, DVec3, f64, &mut [f64]),
        out: &mut [f64],
    ) -> f64 {
        if self.half == [0.0; 2] {
            out.fill(0.0);
            f(wi, wo, 1.0, out);
            return 0.0;
        }
        let about = (frame_about(wi, self.dimension), frame_about(wo, self.dimension));
        if let Some(rules) = &self.fixed {
            sum(rules, &about, f, out);
            return f64::INFINITY;
        }
        let mut before = vec![0.0; out.len()];
        let last = self.rules.len() - 1;
        let needed = self.peak(wi, wo, self.reach(), f, out).map_or(0, |width| self.level_for(width));
        // Two levels at least: their difference is what is known of the error.
        let (first, end) = (needed.min(last.saturating_sub(1)), (needed + 2).max(self.usual - 1).min(last));
        let (mut change, mut earlier) = (f64::INFINITY, f64::INFINITY);
        for level in first..=end {
            sum(self.rules(level), &about, f, out);
            if out.iter().any(|mean| mean.is_nan()) {
                return 0.0; // not known somewhere within the cones: no order tells it
            }
            if level > first {
                earlier = LEFT * change;
                change = largest_move(out, &before);
                if change <= self.accuracy && (!kinked || earlier <= self.accuracy) {
                    break;
                }
            }
            before.copy_from_slice(out);
        }
        if kinked && earlier < f64::INFINITY {
            change = change.max(earlier);
        }
        // A peak between the directions of the finest rule is not known at all.
        if needed > last { change.max(1.0) } else { change }
    }

    /// How far from the middle both cones see together, rad.
    pub fn reach(&self) -> f64 {
        self.half[0] + self.half[1]
    }

    /// Half width (rad), within a factor of two, of a peak about the mirror direction that is within `reach` and that low orders might miss between
    /// their directions. Nothing is known of other peaks, and of none where `f` is not known at the foot, on top or between.
    pub fn peak(
        &self,
        wi: DVec3,
        wo: DVec3,
        reach: f64,
        f: &mut impl FnMut(DVec3, DVec3, f64, &mut [f64]),
        scratch: &mut [f64],
    ) -> Option<f64> {
        let top = mirror(wi);
        if angle_between(top, wo) > NEAR * reach {
            return None;
        }
        let frame = frame_about(top, self.dimension);
        // Across the plane of incidence, where lobes are narrowest; in the flat world there is no such way.
        let across = if self.dimension == Dimension::Flat {
            frame.tangent
        } else {
            DVec3::Z.cross(top).try_normalize().unwrap_or(frame.tangent)
        };
        let mut at = |angle: f64| {
            scratch.fill(0.0);
            f(wi, top * angle.cos() + across * angle.sin(), 1.0, scratch);
            scratch.iter().copied().fold(0.0, largest)
        };
        let (foot, peak) = (at(reach), at(0.0));
        let half = 0.5 * (foot + peak);
        // Without one that is lower than the error that a mean may have nothing is missed.
        if peak.is_nan() || peak - foot <= self.accuracy * peak {
            return None;
        }
        let known = (1..=40).map(|k| reach * 0.5f64.powi(k)).map(|angle| (angle, at(angle)));
        let mut known = known.take_while(|(_, value)| !value.is_nan());
        known.find(|(_, value)| *value >= half).map(|(angle, _)| angle)
    }

    /// The level whose outer directions are no farther apart than three half widths, so that doubling shows what is missing.
    fn level_for(&self, width: f64) -> usize {
        let m = 2.0 * self.half[0].max(self.half[1]) / width;
        m.max(1.0).log2().ceil() as usize
    }
}

/// The mean over both cones by these rules.
fn sum(
    [source, detector]: &Rules,
    about: &(Frame, Frame),
    f: &mut impl FnMut(DVec3, DVec3, f64, &mut [f64]),
    out: &mut [f64],
) {
    out.fill(0.0);
    for (i, w_i) in source {
        let i = about.0.to_world(*i);
        for (o, w_o) in detector {
            f(i, about.1.to_world(*o), w_i * w_o, out);
        }
    }
}

/// The larger number; not a number where one is none, which `f64::max` passes over.
fn largest(a: f64, b: f64) -> f64 {
    if a.is_nan() || b <= a { a } else { b }
}

/// The largest relative change between values of two rules.
pub(super) fn largest_move(new: &[f64], old: &[f64]) -> f64 {
    new.iter().zip(old).map(|(new, old)| moved(*new, *old)).fold(0.0, largest)
}

/// Relative change between two values.
fn moved(new: f64, old: f64) -> f64 {
    if new == old { 0.0 } else { (new - old).abs() / new.abs().max(old.abs()) }
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
