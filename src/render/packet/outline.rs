//! Outlines of quad lights as points see them, and the integrals over lights that these tell (Lambert 1760, Arvo 1995).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::super::lights::QuadLight;
use super::shapes::Points3;
use crate::numeric::lanes::{LANES, Lanes, Mask, Row, Vec3};
use crate::numeric::quadrature::gauss_legendre;
use crate::numeric::simd::Simd;

/// An arc of a great circle.
#[derive(Debug, Clone, Copy)]
struct Arc<S: Simd> {
    /// Where there is any.
    some: Mask<S>,
    /// Unit direction in which it begins.
    begins: Vec3<S>,
    /// Unit normal of its plane, which it turns about counterclockwise.
    pole: Vec3<S>,
    /// How far it goes, below π.
    angle: Lanes<S>,
}

/// The outline of what is above the horizon of a quad: its four edges, and the horizon where that cuts it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outline<S: Simd> {
    arcs: [Arc<S>; 5],
    normal: Vec3<S>,
}

impl<S: Simd> Outline<S> {
    /// As points see a quad that shines towards them and that nothing hides.
    #[inline(always)]
    pub fn new(light: &QuadLight, at: &Points3<S>) -> Self {
        let quad = light.quad();
        let to = |a: f64, b: f64| quad.center + a * quad.u + b * quad.v;
        // Corners, each with the edge that leads to it: as differences of corners far away edges would lose their digits.
        let corners = [
            (to(-1.0, -1.0), -2.0 * quad.v),
            (to(1.0, -1.0), 2.0 * quad.u),
            (to(1.0, 1.0), 2.0 * quad.v),
            (to(-1.0, 1.0), -2.0 * quad.u),
        ];
        let normal = at.normal;
        let mut from = normal.vector(corners[3].0) - at.position;
        let mut from_z = from.dot(normal);
        let (zero, one) = (from_z.number(0.0), from_z.number(1.0));
        let nothing = normal.vector(DVec3::ZERO);
        let none = Arc { some: zero.above(zero), begins: nothing, pole: nothing, angle: zero };
        let mut arcs = [none; 5];
        // Where the outline dips below the horizon and where it comes up again: at most once each.
        let (mut dips, mut rises) = (nothing, nothing);
        for (arc, (corner, along)) in arcs.iter_mut().zip(corners) {
            let to = normal.vector(corner) - at.position;
            let to_z = to.dot(normal);
            let (up, next_up) = (from_z.at_least(zero), to_z.at_least(zero));
            let along = normal.vector(along);
            let share = from_z / (from_z - to_z);
            let crossing = along.scaled_plus(share, from);
            let (begins, ends) = (up.select3(from, crossing), next_up.select3(to, crossing));
            let part = next_up.select(one, share) - up.select(zero, share);
            *arc = Arc::new(up | next_up, begins, begins.dot(ends), cross(from, along) * part);
            dips = (up & !next_up).select3(crossing, dips);
            rises = (!up & next_up).select3(crossing, rises);
            (from, from_z) = (to, to_z);
        }
        arcs[4] = Arc::new(zero.at_least(zero), dips, dips.dot(rises), cross(dips, rises));
        Self { arcs, normal }
    }

    /// ∫ cosθ dω: the irradiance for radiance 1 (Lambert 1760: half the sum over edges of the angle that an edge fills times the cosine of its
    /// plane's normal).
    #[inline(always)]
    pub fn projected_solid_angle(&self) -> Lanes<S> {
        let zero = self.normal.x.number(0.0);
        let sum = self.arcs.iter().fold(zero, |sum, arc| sum + arc.some.keep(arc.angle * arc.pole.dot(self.normal)));
        (sum * zero.number(0.5)).abs()
    }

    /// (n + 2) ∫ max(c, 0)ⁿ cosθ dω, c being the cosine between the direction and `axis`, a unit vector above the horizon: what a Phong lobe reflects of
    /// radiance 1 is its weight/2π times that.
    ///
    /// By Stokes' theorem it is (axis·N) ∮ (1 − c₊ⁿ) dφ + Σ (p·N) ∫ c₊ⁿ dt over the outline, φ being the azimuth about the axis, t the angle along an arc and
    /// p its pole (Arvo 1995, "Applications of irradiance tensors": his recurrence over whole n, summed for any n ≥ 0); the sign of both is that in which the
    /// outline turns.
    #[inline(always)]
    pub fn phong_moment(&self, axis: Vec3<S>, exponent: Lanes<S>, rules: &Rules) -> Lanes<S> {
        let zero = exponent.number(0.0);
        let (mut round, mut along) = (zero, zero);
        for arc in self.arcs.iter().filter(|arc| arc.some.any()) {
            let (turn, length) = arc.about(axis, exponent, rules);
            round = round + arc.some.keep(turn);
            along = along + arc.some.keep(length * arc.pole.dot(self.normal));
        }
        axis.dot(self.normal).mul_add(round, along).abs()
    }
}

/// Numbers of nodes of a panel, and up to which angle times √(n + 1) they do: cosⁿ falls like a Gaussian of width 1/√n, which they integrate to 1e-8.
const PANELS: [(usize, f64); 3] = [(8, 1.5), (12, 3.5), (16, 7.0)];
const MOST_NODES: usize = 16;

/// Places in [0, 1] and weights of Gauss–Legendre rules, for each of [`PANELS`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules([[(f64, f64); MOST_NODES]; PANELS.len()]);

impl Default for Rules {
    fn default() -> Self {
        let rule = |(nodes, _): (usize, f64)| {
            let mut rule = [(0.0, 0.0); MOST_NODES];
            for (to, (x, w)) in rule.iter_mut().zip(gauss_legendre(nodes).iter()) {
                *to = (0.5 + 0.5 * x, 0.5 * w);
            }
            rule
        };
        Self(PANELS.map(rule))
    }
}

impl Rules {
    /// A rule for an angle times √(n + 1), and how many panels of it; `most` asks for all nodes.
    fn of(&self, width: f64, most: bool) -> (&[(f64, f64)], f64) {
        let enough = if most { None } else { PANELS.iter().position(|(_, enough)| width <= *enough) };
        let k = enough.unwrap_or(PANELS.len() - 1);
        let (nodes, enough) = PANELS[k];
        (&self.0[k][..nodes], (width / enough).ceil().max(1.0))
    }
}

impl<S: Simd> Arc<S> {
    /// From the cross product and the dot product of its ends, neither being a unit vector; none where `some` says no, or the ends are the same direction.
    #[inline(always)]
    fn new(some: Mask<S>, begins: Vec3<S>, dot: Lanes<S>, cross: Vec3<S>) -> Self {
        let length = cross.length_squared().sqrt();
        let (zero, one) = (length.number(0.0), length.number(1.0));
        let some = some & length.above(zero);
        let pole = cross * (one / some.select(length, one));
        let size = begins.length_squared().sqrt();
        let begins = begins * (one / size.above(zero).select(size, one));
        Self { some, begins, pole, angle: length.angle_of(dot) }
    }

    /// ∫ (1 − c₊ⁿ) dφ and ∫ c₊ⁿ dt. With m = axis·pole and t counted from where the circle comes nearest to the axis, c² = 1 − q where
    /// q = m² + (1 − m²) sin²t, and dφ = m/q dt.
    #[inline(always)]
    fn about(&self, axis: Vec3<S>, exponent: Lanes<S>, rules: &Rules) -> (Lanes<S>, Lanes<S>) {
        let m = axis.dot(self.pole);
        let nearest = axis.dot(cross(self.pole, self.begins)).angle_of(axis.dot(self.begins));
        let number = |x: f64| m.number(x);
        let half = number(FRAC_PI_2);
        // The turn for which its middle lies within half a circle of the nearest point.
        let middle = self.angle.mul_add(number(0.5), -nearest);
        let start = number(-PI).above(middle).select(number(TAU) - nearest, -nearest);
        let end = start + self.angle;
        // Below the axis's own horizon, which an arc enters or leaves once at most, the azimuth is known.
        let before = (-half).above(start);
        let (from, to) = (before.select(start, start.max(half)), before.select(end.min(-half), end));
        // Lengths as what is left of the whole: of small lights the differences of ends would lose their digits.
        let left = |from: Lanes<S>, to: Lanes<S>| self.angle - (from - start) - (end - to);
        let span = left(from, to);
        let cut = span.above(number(0.0));
        let below = if cut.any() { cut.keep(azimuth(m, (from, to), span)) } else { number(0.0) };
        let (low, high) = (start.max(-half).min(half), end.max(-half).min(half));
        let length = left(low, high).max(number(0.0));
        let (turn, along) = above_axis(m, (low, length), exponent, (rules, cut.any()));
        (below + turn, along)
    }
}

/// The angle about the axis that an arc fills between two of its points, at `from` and `to`, a `span` apart.
#[inline(always)]
fn azimuth<S: Simd>(m: Lanes<S>, (from, to): (Lanes<S>, Lanes<S>), span: Lanes<S>) -> Lanes<S> {
    let ((s0, c0), (s1, c1)) = (sin_cos(from), sin_cos(to));
    let dot = (m * m * c0).mul_add(c1, s0 * s1);
    let cross = m.abs() * sin_cos(span).0;
    cross.angle_of(dot).with_sign(m)
}

/// Of an angle from −2π to 2π.
#[inline(always)]
fn sin_cos<S: Simd>(angle: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    let turns = angle * angle.number(1.0 / TAU);
    let negative = turns.number(0.0).above(turns);
    (turns + negative.keep(turns.number(1.0))).sin_cos_turns()
}

/// The same integrals over a part of the arc where c ≥ 0, from `low` over `length`, by panels of a rule. The nodes gather at the ends: c has a root there where it
/// is `cut`, and powers of it that are not whole, or below 4, are not smooth.
#[inline(always)]
fn above_axis<S: Simd>(
    m: Lanes<S>,
    (low, length): (Lanes<S>, Lanes<S>),
    exponent: Lanes<S>,
    (rules, cut): (&Rules, bool),
) -> (Lanes<S>, Lanes<S>) {
    let number = |x: f64| m.number(x);
    let (zero, one) = (number(0.0), number(1.0));
    let (m2, half_n) = (m * m, exponent * number(0.5));
    let rest = one - m2;
    let mut widths: Row = [0.0; LANES];
    (length * (exponent + one).sqrt()).store(&mut widths);
    // In the middle nodes lie half as far again from each other.
    let (rule, panels) = rules.of(1.5 * widths.iter().fold(0.0, |most: f64, w| most.max(*w)), cut);
    let (mut turn, mut along) = (zero, zero);
    for panel in 0..panels as u32 {
        for (x, w) in rule {
            let u = (f64::from(panel) + x) / panels;
            let t = length.mul_add(number(u * u * (3.0 - 2.0 * u)), low);
            let sin = (t.abs() * number(1.0 / TAU)).sin_cos_turns().0;
            let q = rest.mul_add(sin * sin, m2).max(number(1e-300)).min(number(1.0 - f64::EPSILON));
            let ln = (half_n * (-q).ln_1p()).max(number(-700.0));
            let power = ln.exp();
            let series = number(1.0 / 5.0).mul_add(ln, one) * number(1.0 / 4.0);
            let series = series.mul_add(ln, one) * number(1.0 / 3.0);
            let series = series.mul_add(ln, one) * number(0.5);
            let lack = ln.above(number(-1e-2)).select(-ln * series.mul_add(ln, one), one - power);
            let weight = number(w * 6.0 * u * (1.0 - u) / panels);
            turn = weight.mul_add(lack / q, turn);
            along = weight.mul_add(power, along);
        }
    }
    (turn * m * length, along * length)
}

#[inline(always)]
fn cross<S: Simd>(a: Vec3<S>, b: Vec3<S>) -> Vec3<S> {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::geometry::sampling::uniform_sphere;
    use crate::numeric::quadrature::integrate;
    use crate::numeric::random::{Purpose, RngExt, Stream, stream};
    use crate::numeric::simd::{Kernel, vectorised};
    use crate::render::shapes::Quad;

    /// Irradiance at a point with a normal, or the moment about an axis of an exponent.
    struct Of<'a>(&'a QuadLight, DVec3, DVec3, Option<(DVec3, f64)>);

    impl Kernel for Of<'_> {
        type Output = f64;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            let at = Points3 {
                position: Vec3::splat(simd, self.1),
                error: Vec3::splat(simd, DVec3::ZERO),
                normal: Vec3::splat(simd, self.2),
            };
            let outline = Outline::new(self.0, &at);
            let mut all = [0.0; LANES];
            let found = match self.3 {
                None => outline.projected_solid_angle(),
                Some((axis, n)) => {
                    outline.phong_moment(Vec3::splat(simd, axis), Lanes::splat(simd, n), &Rules::default())
                }
            };
            found.store(&mut all);
            assert!(all.iter().all(|x| *x == all[0]));
            all[0]
        }
    }

    #[test]
    fn polygons_shine_as_their_points_together_do() {
        let mut rng = stream(3, Purpose::Study, 0);
        for case in 0..60 {
            let mut point = || DVec3::new(rng.random(), rng.random(), rng.random()) - 0.5;
            let quad = Quad::new(2.0 * point(), point(), point());
            let light = QuadLight::new(quad, DVec3::ONE);
            let mut from = 4.0 * point();
            if (quad.center - from).dot(quad.normal) > 0.0 {
                from = 2.0 * quad.center - from; // now before it
            }
            let normal = uniform_sphere(DVec2::new(rng.random(), rng.random()));
            let integrand = |a: f64, b: f64| {
                let d = quad.center + a * quad.u + b * quad.v - from;
                let r2 = d.length_squared();
                (d.dot(normal) / r2).max(0.0) * (-d.dot(quad.normal) / r2).max(0.0) * quad.area / 4.0
            };
            // The horizon cuts the quad: panels small enough for the kink.
            let strip = |a: f64| {
                (0..24)
                    .map(|k| {
                        integrate(-1.0 + f64::from(k) / 12.0, -1.0 + f64::from(k + 1) / 12.0, 12, |b| integrand(a, b))
                    })
                    .sum::<f64>()
            };
            let want: f64 =
                (0..24).map(|k| integrate(-1.0 + f64::from(k) / 12.0, -1.0 + f64::from(k + 1) / 12.0, 12, strip)).sum();
            let got = vectorised(Of(&light, from, normal, None));
            assert!((got - want).abs() <= 2e-5 * want.max(0.01), "case {case}: {got} vs {want}");
        }
        // Above the middle of a unit square at height 1: 4 of Lambert's corners, each (2/π)·(1/√5·atan(1/√5))·π/2.
        let light = QuadLight::new(Quad::new(DVec3::Z, 0.5 * DVec3::Y, 0.5 * DVec3::X), DVec3::ONE);
        let want = 4.0 * (0.5 / 1.25f64.sqrt()) * (0.5 / 1.25f64.sqrt()).atan();
        assert!((vectorised(Of(&light, DVec3::ZERO, DVec3::Z, None)) - want).abs() < 1e-14);
    }

    /// Small lights far away: A·cosθ·cosθ'/r², where the sum over edges cancels most of its digits; of a lobe (n + 2) cosⁿ times that.
    #[test]
    fn small_lights_keep_their_digits() {
        for distance in [1e2, 1e4, 1e6, 1e8] {
            let light = QuadLight::new(Quad::new(distance * DVec3::Z, 0.5 * DVec3::Y, 0.5 * DVec3::X), DVec3::ONE);
            let normal = DVec3::new(0.6, 0.0, 0.8);
            let of = |lobe| vectorised(Of(&light, DVec3::ZERO, normal, lobe)) * distance * distance;
            let sure = 1.0 / (distance * distance) + 1e-7;
            assert!((of(None) - 0.8).abs() < sure, "{distance:e}: {}", of(None));
            for (n, tilt) in
                [0.0, 1.0, 30.0, 300.0].into_iter().flat_map(|n| [0.0, 0.05, 0.5, 2.0].map(|tilt| (n, tilt)))
            {
                let axis = DVec3::new(f64::sin(tilt), 0.0, f64::cos(tilt));
                let want = if axis.z > 0.0 { (n + 2.0) * axis.z.powf(n) * 0.8 } else { 0.0 };
                let got = of(Some((axis, n)));
                // The lobe bends over the light, and each of its terms is rounded.
                let sure = (n + 2.0) * (0.8 * (n * (n + 1.0) + 2.0) / (distance * distance) + 1e-15 * distance + 1e-9);
                assert!((got - want).abs() < sure, "{distance:e}, n {n}, tilt {tilt}: {got} vs {want} ± {sure:e}");
            }
        }
    }

    const EXPONENTS: [f64; 8] = [0.0, 0.3, 1.0, 2.0, 3.7, 12.0, 80.0, 1000.0];

    /// A quad before a point with a normal, and an axis above its horizon.
    fn view(rng: &mut Stream) -> (QuadLight, DVec3, DVec3, DVec3) {
        let mut point = || DVec3::new(rng.random(), rng.random(), rng.random()) - 0.5;
        let quad = Quad::new(2.0 * point(), point(), point());
        let mut from = 4.0 * point();
        if (quad.center - from).dot(quad.normal) > 0.0 {
            from = 2.0 * quad.center - from; // now before it
        }
        let mut direction = || uniform_sphere(DVec2::new(rng.random(), rng.random()));
        let (normal, axis) = (direction(), direction());
        (QuadLight::new(quad, DVec3::ONE), from, normal, axis * axis.dot(normal).signum())
    }

    #[test]
    fn lobes_reflect_what_the_points_of_a_polygon_send_together() {
        let mut rng = stream(4, Purpose::Study, 0);
        for case in 0..48 {
            let (light, from, normal, axis) = view(&mut rng);
            let (quad, n) = (*light.quad(), EXPONENTS[case % EXPONENTS.len()]);
            let integrand = |a: f64, b: f64| {
                let d = quad.center + a * quad.u + b * quad.v - from;
                let r2 = d.length_squared();
                let c = d.dot(axis) / r2.sqrt();
                let power = if c > 0.0 { c.powf(n) } else { 0.0 };
                power * (d.dot(normal) / r2).max(0.0) * (-d.dot(quad.normal) / r2).max(0.0) * quad.area / 4.0
            };
            // Panels small enough for the kinks and for the lobe.
            let panels = |f: &dyn Fn(f64) -> f64| -> f64 {
                let at = |k: i32| f64::from(k) / 24.0 - 1.0;
                (0..48).map(|k| integrate(at(k), at(k + 1), 8, f)).sum()
            };
            let want = (n + 2.0) * panels(&|a| panels(&|b| integrand(a, b)));
            let got = vectorised(Of(&light, from, normal, Some((axis, n))));
            // Where the power jumps at c = 0 the panels tell less.
            let sure = if n < 1.0 { 3e-3 } else { 3e-5 };
            assert!((got - want).abs() <= sure * want.max(0.01), "case {case}, n {n}: {got} vs {want}");
        }
    }

    /// The inner edges of a quad cut into four must cancel.
    #[test]
    fn parts_of_a_polygon_shine_as_the_whole() {
        let mut rng = stream(5, Purpose::Study, 0);
        for case in 0..400 {
            let (light, from, normal, axis) = view(&mut rng);
            let n = EXPONENTS[case % EXPONENTS.len()];
            let of = |light: &QuadLight| vectorised(Of(light, from, normal, Some((axis, n))));
            let quad = light.quad();
            let quarters = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)].map(|(a, b)| {
                let center = quad.center + a * quad.u + b * quad.v;
                of(&QuadLight::new(Quad::new(center, 0.5 * quad.u, 0.5 * quad.v), DVec3::ONE))
            });
            let (whole, parts) = (of(&light), quarters.iter().sum::<f64>());
            // The root of c at the ends is not wholly smoothed.
            let sure = if n < 1.0 { 1e-6 } else { 1e-8 };
            assert!((whole - parts).abs() < sure, "case {case}, n {n}: {whole} vs {parts}");
        }
    }

    /// A lobe that looks into a light as wide as the sky shows its albedo: 1 head on, and at every angle what its closed form says.
    #[test]
    fn a_light_as_wide_as_the_sky_shows_the_albedo() {
        let sky = QuadLight::new(Quad::new(1e-7 * DVec3::Z, DVec3::Y, DVec3::X), DVec3::ONE);
        for n in EXPONENTS {
            for tilt in [0.0f64, 0.3, 1.0, 1.5, 1.57] {
                let axis = DVec3::new(tilt.sin(), 0.0, tilt.cos());
                let got = vectorised(Of(&sky, DVec3::ZERO, DVec3::Z, Some((axis, n)))) / TAU;
                let want = crate::brdf::phong::directional_albedo(n, tilt);
                assert!((got - want).abs() < 2e-6, "n {n}, {tilt}: {got} vs {want}");
            }
        }
    }
}
