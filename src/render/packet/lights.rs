//! Light that arrives at a packet of points: see [`super::super::lights`], whose densities these are.

use glam::DVec2;

use super::super::lights::{QuadLight, SMALL_SOLID_ANGLE};
use super::shapes::{Points3, Rays};
use crate::numeric::lanes::{Lanes, Mask, Vec3};
use crate::numeric::simd::Simd;

/// Light from one direction a lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrivals<S: Simd> {
    /// Where there is any.
    pub some: Mask<S>,
    /// The segments that must be free; their directions are those to the light.
    pub shadow: Rays<S>,
    /// What a surface facing the light has of the light's strength: 1/r² or 1/density.
    pub strength: Lanes<S>,
    /// 1/density of the direction, sr; 0 where there is only one direction.
    pub spread: Lanes<S>,
}

/// Segments between points.
#[inline(always)]
pub(super) fn between<S: Simd>(from: Vec3<S>, to: Vec3<S>) -> Rays<S> {
    let way = to - from;
    let distance = way.length_squared().sqrt();
    Rays { origin: from, direction: way * (distance.number(1.0) / distance), t_max: distance }
}

/// The complex number whose argument is the angle between the planes of two edges, x and y their distances from the foot point.
#[inline(always)]
fn corner<S: Simd>(x: Lanes<S>, y: Lanes<S>, height: Lanes<S>) -> (Lanes<S>, Lanes<S>) {
    (x * y, height * x.mul_add(x, y.mul_add(y, height * height)).sqrt())
}

/// The sum of two arguments.
#[inline(always)]
fn sum<S: Simd>(p: (Lanes<S>, Lanes<S>), q: (Lanes<S>, Lanes<S>)) -> Lanes<S> {
    (p.0 * q.1 + p.1 * q.0).angle_of(p.0 * q.0 - p.1 * q.1)
}

/// Where x lies between `low` and `high`, −1 to 1.
#[inline(always)]
fn share<S: Simd>(x: Lanes<S>, low: Lanes<S>, high: Lanes<S>, length: f64) -> Lanes<S> {
    let a = (x - x.number(0.5) * (low + high)) * x.number(2.0 / length);
    a.min(x.number(1.0)).max(x.number(-1.0))
}

/// A rectangle, seen from points where it fills more than a small solid angle ([`super::super::lights`]: Ureña et al. 2013).
struct View<S: Simd> {
    low: [Lanes<S>; 2],
    high: [Lanes<S>; 2],
    height: Lanes<S>,
    start: Lanes<S>,
    solid_angle: Lanes<S>,
}

impl<S: Simd> View<S> {
    #[inline(always)]
    fn new(light: &QuadLight, [x, y]: [glam::DVec3; 2], length: DVec2, from: Vec3<S>) -> Self {
        let quad = light.quad();
        let d = from.vector(quad.center) - from;
        let height = d.dot(d.vector(quad.normal)).abs();
        let (cx, cy) = (d.dot(d.vector(x)), d.dot(d.vector(y)));
        let half = [cx.number(0.5 * length.x), cx.number(0.5 * length.y)];
        let (low, high) = ([cx - half[0], cy - half[1]], [cx + half[0], cy + half[1]]);
        let right = sum(corner(high[0], low[1], height), corner(-high[0], high[1], height));
        let left = sum(corner(low[0], high[1], height), corner(-low[0], low[1], height));
        let start = height.number(std::f64::consts::TAU) - left;
        Self { low, high, height, start, solid_angle: right - start }
    }

    /// Coordinates along both edges from the foot point, uniform in solid angle. With few roots and quotients, which take longest.
    #[inline(always)]
    fn sample(&self, (u, v): (Lanes<S>, Lanes<S>)) -> (Lanes<S>, Lanes<S>) {
        let one = u.number(1.0);
        let h2 = self.height * self.height;
        let (y0, y1) = (self.low[1], self.high[1]);
        let turns = u.mul_add(self.solid_angle, self.start) * u.number(1.0 / std::f64::consts::TAU);
        // 2π itself is 0.
        let turns = turns.at_least(one).select(turns - one, turns);
        let (sin, cos) = turns.sin_cos_turns();
        let (q0, q1) = (y0.mul_add(y0, h2), y1.mul_add(y1, h2));
        let m = cos.mul_add(y0, y1 * (q0 / q1).sqrt());
        let rest = m.mul_add(m, -(h2 * sin * sin)).max(u.number(NOTHING));
        let x = (self.height * sin * (q0 / rest).sqrt()).with_sign(-(m * sin));
        let x = x.min(self.high[0]).max(self.low[0]);
        let d2 = x.mul_add(x, h2);
        let (r0, r1) = (y0.mul_add(y0, d2).sqrt(), y1.mul_add(y1, d2).sqrt());
        let per = one / (r0 * r1);
        let (a, b) = (y0 * r1 * per, y1 * r0 * per);
        let s = v.mul_add(b - a, a);
        let y = s * (d2 / (one - s * s)).sqrt();
        (x, y.min(y1).max(y0))
    }
}

/// So little that what is divided by it leaves the light, and is finite.
const NOTHING: f64 = 1e-250;

/// Light of a quad at points, by a point (u, v) of the unit square.
#[inline(always)]
pub(super) fn from_quad<S: Simd>(light: &QuadLight, at: &Points3<S>, u: (Lanes<S>, Lanes<S>)) -> Arrivals<S> {
    let quad = light.quad();
    let from = at.position;
    let to_centre = from.vector(quad.center) - from;
    let zero = u.0.number(0.0);
    let before = zero.above(to_centre.dot(from.vector(quad.normal)));
    let (one, two) = (zero.number(1.0), zero.number(2.0));
    let (mut a, mut b) = (two * u.0 - one, two * u.1 - one);
    let mut wide = zero.above(zero);
    let mut solid_angle = one;
    if let Some((axes, length)) = light.rectangle() {
        let view = View::new(light, axes, length, from);
        wide = view.solid_angle.above(zero.number(SMALL_SOLID_ANGLE));
        solid_angle = view.solid_angle;
        let (x, y) = view.sample(u);
        a = wide.select(share(x, view.low[0], view.high[0], length.x), a);
        b = wide.select(share(y, view.low[1], view.high[1], length.y), b);
    }
    let target = from.vector(quad.u).scaled_plus(a, from.vector(quad.v).scaled_plus(b, from.vector(quad.center)));
    let end = Points3 {
        position: target,
        error: Vec3::new(one, one, one) * zero.number(quad.error()),
        normal: from.vector(quad.normal),
    };
    let shadow = between(at.above(), end.above());
    let mut spread = solid_angle;
    if (before & !wide).any() {
        spread = wide.select(solid_angle, area_spread(light, from, target));
    }
    let finite = zero.number(f64::MAX).at_least(spread);
    Arrivals { some: before & finite, shadow, strength: spread, spread }
}

/// 1/density (sr) of directions from `from` to points `to` of the quad.
#[inline(always)]
pub(super) fn quad_spread<S: Simd>(light: &QuadLight, from: Vec3<S>, to: Vec3<S>) -> Lanes<S> {
    let by_area = area_spread(light, from, to);
    match light.rectangle() {
        None => by_area,
        Some((axes, length)) => {
            let solid_angle = View::new(light, axes, length, from).solid_angle;
            solid_angle.above(by_area.number(SMALL_SOLID_ANGLE)).select(solid_angle, by_area)
        }
    }
}

/// The same for points uniform in area.
#[inline(always)]
fn area_spread<S: Simd>(light: &QuadLight, from: Vec3<S>, to: Vec3<S>) -> Lanes<S> {
    let quad = light.quad();
    let d = to - from;
    let distance2 = d.length_squared();
    d.dot(d.vector(quad.normal)).abs() * distance2.number(quad.area) / (distance2 * distance2.sqrt())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::numeric::lanes::LANES;
    use crate::numeric::random::{Purpose, RngExt, stream};
    use crate::numeric::simd::{Kernel, vectorised};
    use crate::render::ray::SurfacePoint;
    use crate::render::shapes::Quad;

    /// Light of a quad at a point, by a point of the unit square: whether there is any, its direction and 1/density.
    struct Arrives<'a>(&'a QuadLight, &'a SurfacePoint, DVec2);

    impl Kernel for Arrives<'_> {
        type Output = (bool, DVec3, f64, f64);

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let at = Points3 {
                position: Vec3::splat(simd, self.1.position),
                error: Vec3::splat(simd, self.1.error),
                normal: Vec3::splat(simd, self.1.normal),
            };
            let u = (Lanes::splat(simd, self.2.x), Lanes::splat(simd, self.2.y));
            let found = from_quad(self.0, &at, u);
            let first = |lanes: Lanes<S>| {
                let mut all = [0.0; LANES];
                lanes.store(&mut all);
                all[0]
            };
            let d = found.shadow.direction;
            let direction = DVec3::new(first(d.x), first(d.y), first(d.z));
            let target = at.position + d * found.shadow.t_max;
            (found.some.any(), direction, first(found.spread), first(quad_spread(self.0, at.position, target)))
        }
    }

    /// Packets aim at the same points of a quad with the same densities as one path does: close to it, over an edge, behind it, far away, and where it is no
    /// rectangle.
    #[test]
    fn packets_aim_at_quads_as_single_paths_do() {
        let mut rng = stream(6, Purpose::Study, 0);
        let (mut lit, mut dark) = (0, 0);
        for case in 0..4000 {
            let mut point = || DVec3::new(rng.random(), rng.random(), rng.random()) - 0.5;
            let (u, skew, normal) = (point(), point(), point().normalize());
            let v = if case % 4 == 0 { skew } else { u.cross(skew) };
            let quad = Quad::new(point(), u, v);
            let light = QuadLight::new(quad, DVec3::ONE);
            let distance = [1e-3, 0.1, 1.0, 30.0][case / 4 % 4];
            let foot = quad.center + 3.0 * rng.random::<f64>() * quad.u + 1.2 * rng.random::<f64>() * quad.v;
            let position = foot + if case % 7 == 0 { -distance } else { distance } * quad.normal;
            let at = SurfacePoint { position, error: DVec3::splat(1e-15), normal };
            let u = DVec2::new(rng.random(), rng.random());
            let (some, direction, spread, again) = vectorised(Arrives(&light, &at, u));
            let Some(want) = light.sample(&at, u) else {
                assert!(!some, "case {case}: behind it");
                dark += 1;
                continue;
            };
            lit += 1;
            let pdf = want.pdf.expect("it has a surface");
            assert!(some && (direction - want.wi).length() < 1e-8, "case {case}: {direction} vs {}", want.wi);
            assert!((spread * pdf - 1.0).abs() < 1e-7, "case {case}: {spread} vs {}", 1.0 / pdf);
            assert!((again / spread - 1.0).abs() < 1e-6, "case {case}: {again} vs {spread}");
        }
        assert!(lit > 3000 && dark > 400, "{lit} lit, {dark} dark");
    }
}
