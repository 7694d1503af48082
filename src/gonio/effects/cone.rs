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
fn rule(m: usize, alpha: f64) -> Rule {
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
fn flat_rule(m: usize, alpha: f64) -> Rule {
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

/// Directions of a cone about +z, with their weights.
type Rule = Vec<(DVec3, f64)>;

/// Rules of both cones by order.
pub(in crate::gonio) struct Cones {
    /// Half angles of the source's and the detector's, rad.
    half: [f64; 2],
    /// Of each cone by order, made when they are first asked for.
    rules: [Vec<OnceLock<Rule>>; 2],
    /// Levels there are: the wider cone's order is 2 to the level.
    levels: usize,
    /// Levels that any reading may take; the rest is for those that a peak needs.
    usual: usize,
    accuracy: f64,
    /// The only one, where it is set.
    fixed: Option<usize>,
    dimension: Dimension,
}

/// What a doubling leaves of a move where there are kinks, on average; one move alone may be small by chance.
const LEFT: f64 = 0.25;

/// Share of the accuracy asked for that a mean over what has kinks is said to be off by at least: some fall between all directions.
const UNSEEN: f64 = 0.01;

/// Directions that one rule of both cones may have: for any reading, and where a peak needs them.
const MANY: usize = 300_000;
const MOST: usize = 5_000_000;

impl Cones {
    /// Rules for half angles of the source's and the detector's cone (rad), for means as good as `accuracy` (relative).
    pub fn new(half: [f64; 2], accuracy: f64, dimension: Dimension) -> Self {
        let rules = [(); 2].map(|()| (0..=FINEST).map(|_| OnceLock::new()).collect());
        let mut cones = Self { half, rules, levels: 0, usual: 0, accuracy, fixed: None, dimension };
        let levels = |m: usize, most: usize| {
            (0..usize::BITS as usize)
                .take_while(|level| 1 << level <= m && cones.size(cones.orders(*level)) <= most)
                .count()
        };
        (cones.levels, cones.usual) = (levels(FINEST, MOST), levels(USUAL, MANY));
        cones
    }

    /// The same with one order of both cones' rules, and nothing known of what it leaves.
    pub fn fixed(mut self, order: u32) -> Self {
        self.fixed = Some(order as usize);
        self
    }

    /// Orders of both cones' rules at a level: as fine in angle.
    fn orders(&self, level: usize) -> [usize; 2] {
        let (m, largest) = ((1u64 << level) as f64, self.half[0].max(self.half[1]));
        self.half.map(|half| ((m * half / largest).ceil() as usize).max(1))
    }

    /// Pairs of directions of rules of these orders.
    fn size(&self, orders: [usize; 2]) -> usize {
        let one = |m: usize| if self.dimension == Dimension::Flat { 2 * m } else { m * (2 * m + 2) };
        let of = |(m, half): (usize, f64)| if half == 0.0 { 1 } else { one(m) };
        orders.into_iter().zip(self.half).map(of).product()
    }

    /// The rule of a cone.
    fn rule(&self, k: usize, order: usize) -> &Rule {
        let rule = if self.dimension == Dimension::Flat { flat_rule } else { rule };
        self.rules[k][order].get_or_init(|| rule(order, self.half[k]))
    }

    /// Writes the mean of `f`, all channels, over both cones about (wi, wo), and returns by which share it may be off: the largest relative change
    /// that the last doubling brought; where it is `kinked`, as a table is that is linear between its values, a quarter of the one before if that is more, and
    /// what the narrower cone's rule leaves. `f` adds its values times a weight.
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
        if let Some(order) = self.fixed {
            self.sum([order; 2], &about, f, out);
            return f64::INFINITY;
        }
        let last = self.levels - 1;
        let needed = self.peak(wi, wo, self.reach(), f, out).map_or(0, |width| self.level_for(width));
        // Two levels at least: their difference is what is known of the error.
        let (first, end) = (needed.min(last.saturating_sub(1)), (needed + 2).max(self.usual - 1).min(last));
        let mut before = vec![0.0; out.len()];
        let (mut level, mut change, mut earlier) = (first, f64::INFINITY, f64::INFINITY);
        loop {
            self.sum(self.orders(level), &about, f, out);
            if out.iter().any(|mean| mean.is_nan()) {
                return 0.0; // not known somewhere within the cones: no order tells it
            }
            if level > first {
                earlier = LEFT * change;
                change = largest_move(out, &before);
            }
            if level == end || change <= self.accuracy && (!kinked || earlier <= self.accuracy) {
                break;
            }
            before.copy_from_slice(out);
            level += 1;
        }
        if kinked && level > first {
            if earlier < f64::INFINITY {
                change = change.max(earlier);
            }
            change = (change + self.refine_narrower(level, &about, f, &mut before, out)).max(UNSEEN * self.accuracy);
        }
        // A peak between the directions of the finest rule is not known at all.
        if needed > last { change.max(1.0) } else { change }
    }

    /// The narrower cone's rule may have had the same order at level after level, so that no move told what it leaves of kinks: doubles it until twice
    /// what that moves is no more than asked, by sums of the level below, whose mean by the usual orders is `before`; writes the mean anew where it needs
    /// more, and returns what is left.
    fn refine_narrower(
        &self,
        level: usize,
        about: &(Frame, Frame),
        f: &mut impl FnMut(DVec3, DVec3, f64, &mut [f64]),
        before: &mut [f64],
        out: &mut [f64],
    ) -> f64 {
        let narrower = usize::from(self.half[1] < self.half[0]);
        let (mut orders, mut wanted) = (self.orders(level - 1), self.orders(level));
        if self.half[narrower] == 0.0 || wanted[narrower] >= 2 * orders[narrower] {
            return 0.0; // one direction, or the last move was of both
        }
        let most = if level < self.usual { MANY } else { MOST };
        let mut finer = vec![0.0; out.len()];
        loop {
            orders[narrower] *= 2;
            self.sum(orders, about, f, &mut finer);
            if finer.iter().any(|mean| mean.is_nan()) {
                out.copy_from_slice(&finer);
                return 0.0; // not known, as above
            }
            let left = 2.0 * largest_move(&finer, before);
            let next = [wanted[1 - narrower], orders[narrower]];
            if left <= self.accuracy || next[1] >= orders[1 - narrower] || self.size(next) > most {
                if orders[narrower] > 2 * wanted[narrower] {
                    wanted[narrower] = orders[narrower] / 2;
                    self.sum(wanted, about, f, out);
                }
                return left;
            }
            before.copy_from_slice(&finer);
        }
    }

    /// Writes the mean over both cones by rules of these orders.
    fn sum(
        &self,
        orders: [usize; 2],
        about: &(Frame, Frame),
        f: &mut impl FnMut(DVec3, DVec3, f64, &mut [f64]),
        out: &mut [f64],
    ) {
        out.fill(0.0);
        for (i, w_i) in self.rule(0, orders[0]) {
            let i = about.0.to_world(*i);
            for (o, w_o) in self.rule(1, orders[1]) {
                f(i, about.1.to_world(*o), w_i * w_o, out);
            }
        }
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
    use std::f64::consts::{FRAC_PI_2, TAU};

    use super::*;
    use crate::numeric::quadrature::integrate;
    use crate::numeric::random::{Purpose, RngExt, stream};

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

    /// What is linear between knots, across a cone's axis and at random to it, is a product over two cones of different widths: so is its mean.
    struct Kinks {
        half: [f64; 2],
        across: [DVec3; 2],
        knots: [(f64, f64); 2],
        heights: [Vec<f64>; 2],
    }

    impl Kinks {
        const MANY: usize = 200;

        /// Cones of 0.1° to 10°, one up to 20 times the other; knots a tenth of the wider one to three times it apart; steep or flat.
        fn random(index: u64) -> Self {
            let rng = &mut stream(1, Purpose::Study, index);
            let mut uniform = |a: f64, b: f64| a + (b - a) * rng.random::<f64>();
            let widest = (0.05 * 100f64.powf(uniform(0.0, 1.0))).to_radians();
            let narrow = widest / 20f64.powf(uniform(0.0, 1.0));
            let half = if index.is_multiple_of(2) { [widest, narrow] } else { [narrow, widest] };
            let mut turned = || uniform(0.0, TAU).sin_cos();
            let across = [turned(), turned()].map(|(sin, cos)| DVec3::new(sin, cos, 0.0));
            let step = widest * uniform(0.1, 3.0);
            let steep = 10f64.powf(uniform(-3.0, -0.3));
            let knots = [(uniform(0.0, step), step), (uniform(0.0, step), step)];
            let heights = [(); 2].map(|()| (0..Self::MANY).map(|_| 1.0 + steep * uniform(-1.0, 1.0)).collect());
            Self { half, across, knots, heights }
        }

        fn at(&self, k: usize, w: DVec3) -> f64 {
            let (from, step) = self.knots[k];
            let place = (w.dot(self.across[k]) - from) / step + 0.5 * Self::MANY as f64;
            let (i, part) = (place.floor(), place - place.floor());
            self.heights[k][i as usize] * (1.0 - part) + self.heights[k][i as usize + 1] * part
        }

        fn mean(&self) -> f64 {
            [0, 1].map(|k| self.mean_over(k)).iter().product()
        }

        /// Where w·e = t there is an arc of 2ψ in the cone, tanψ = √(sin²α − t²)/cosα, each as much of its solid angle: a sum of integrals between knots, and
        /// t = sinα sinτ against the roots at its ends.
        fn mean_over(&self, k: usize) -> f64 {
            let (sin, cos) = self.half[k].sin_cos();
            let (from, step) = self.knots[k];
            let inner = (0..Self::MANY).map(|i| (from + step * (i as f64 - 0.5 * Self::MANY as f64)) / sin);
            let mut ends: Vec<f64> = inner.filter(|t| t.abs() < 1.0).map(f64::asin).collect();
            ends.insert(0, -FRAC_PI_2);
            ends.push(FRAC_PI_2);
            let arc = |tau: f64| {
                let value = self.at(k, self.across[k] * (sin * tau.sin()));
                2.0 * (sin * tau.cos()).atan2(cos) * sin * tau.cos() * value
            };
            let sum: f64 = ends.windows(2).map(|end| integrate(end[0], end[1], 32, arc)).sum();
            sum / (TAU * 2.0 * (0.5 * self.half[k]).sin().powi(2))
        }

        fn read(&self, accuracy: f64) -> (f64, f64) {
            let cones = Cones::new(self.half, accuracy, Dimension::Space);
            let mut out = [0.0];
            let mut f =
                |wi: DVec3, wo: DVec3, weight: f64, out: &mut [f64]| out[0] += weight * self.at(0, wi) * self.at(1, wo);
            let error = cones.mean(DVec3::Z, DVec3::Z, true, &mut f, &mut out);
            (out[0], error)
        }
    }

    /// Directions are as many as any reading may take, so that the last digits of steep kinks can't be reached in all cases.
    #[test]
    fn stated_errors_over_two_cones_hold_for_what_has_kinks() {
        let cases: Vec<Kinks> = (0..100).map(Kinks::random).collect();
        for (accuracy, enough) in [(1e-2, 95), (1e-3, 90), (1e-4, 85), (1e-5, 60)] {
            let (mut held, mut reached) = (0, 0);
            for case in &cases {
                let (got, stated) = case.read(accuracy);
                let off = (got / case.mean() - 1.0).abs();
                held += i32::from(off <= stated);
                reached += i32::from(stated <= accuracy);
            }
            println!("accuracy {accuracy:e}: stated errors hold in {held}, and are no more in {reached} of 100");
            assert!(held >= 95 && reached >= enough, "{accuracy:e}: {held} {reached}");
        }
    }
}
