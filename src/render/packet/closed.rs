//! Light in closed form: where nothing can stand in the way, some integrals over lights need no samples.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use rayon::prelude::*;

use super::super::lights::QuadLight;
use super::flat::Lobes;
use super::shapes::Points3;
use crate::brdf::phong;
use crate::numeric::lanes::{LANES, Lanes, Row, Vec3};
use crate::numeric::simd::Simd;

/// ∫ cosθ dω over what is above the horizon of a quad that shines towards the points and that nothing hides: the irradiance
/// for radiance 1 (Lambert 1760: half the sum over edges of the angle that an edge fills times the cosine of its plane's normal).
#[inline(always)]
pub(super) fn projected_solid_angle<S: Simd>(light: &QuadLight, at: &Points3<S>) -> Lanes<S> {
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
    let zero = from_z.number(0.0);
    let mut sum = zero;
    // Where the outline dips below the horizon and where it comes up again: at most once each.
    let (mut dips, mut rises) = (normal.vector(DVec3::ZERO), normal.vector(DVec3::ZERO));
    for (corner, along) in corners {
        let to = normal.vector(corner) - at.position;
        let to_z = to.dot(normal);
        let (up, next_up) = (from_z.at_least(zero), to_z.at_least(zero));
        let along = normal.vector(along);
        let share = from_z / (from_z - to_z);
        let crossing = along.scaled_plus(share, from);
        let (begins, ends) = (up.select3(from, crossing), next_up.select3(to, crossing));
        let one = zero.number(1.0);
        let part = next_up.select(one, share) - up.select(zero, share);
        let cross = cross(from, along) * part;
        sum = sum + (up | next_up).keep(edge(cross, begins.dot(ends), normal));
        dips = (up & !next_up).select3(crossing, dips);
        rises = (!up & next_up).select3(crossing, rises);
        (from, from_z) = (to, to_z);
    }
    sum = sum + edge(cross(dips, rises), dips.dot(rises), normal);
    (sum * zero.number(0.5)).abs()
}

#[inline(always)]
fn cross<S: Simd>(a: Vec3<S>, b: Vec3<S>) -> Vec3<S> {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// The angle between two directions of this cross and dot product times the cosine between the normal and that of their plane; 0 for none.
#[inline(always)]
fn edge<S: Simd>(cross: Vec3<S>, dot: Lanes<S>, normal: Vec3<S>) -> Lanes<S> {
    let length = cross.length_squared().sqrt();
    let some = length.above(length.number(0.0));
    some.keep(length.angle_of(dot) * cross.dot(normal) / some.select(length, length.number(1.0)))
}

/// Steps of [`Surround`]'s table.
const STEPS: usize = 512;

/// A convex body alone in an even environment of radiance 1: what it reflects is the directional albedo of its material.
#[derive(Debug)]
pub(super) struct Surround {
    /// Albedo at cosθo = (k/[`STEPS`])², with one value beyond each end: near grazing it bends within a width of n^−½ in cosθo.
    table: Vec<DVec3>,
}

impl Surround {
    pub fn new(material: &Lobes) -> Self {
        let albedo = |k: usize| {
            // Beyond an end the table goes on like its mirror image through that end's value.
            let at = |k: usize| {
                let cos = (k as f64 / STEPS as f64).powi(2);
                let lobes = material
                    .phong
                    .iter()
                    .map(|(weight, n, _)| *weight * phong::directional_albedo(*n, cos.acos().min(FRAC_PI_2)));
                material.diffuse + lobes.sum::<DVec3>()
            };
            match k {
                0 => 2.0 * at(0) - at(1),
                k if k > STEPS + 1 => 2.0 * at(STEPS) - at(STEPS - 1),
                k => at(k - 1),
            }
        };
        Self { table: (0..STEPS + 3).into_par_iter().map(albedo).collect() }
    }

    /// The albedo for light towards directions of these cosines, above 0: cubic between four values (Catmull, Rom 1974).
    #[inline(always)]
    pub fn albedo<S: Simd>(&self, cos: Lanes<S>) -> Vec3<S> {
        let mut at: Row = [0.0; LANES];
        (cos.sqrt() * cos.number(STEPS as f64)).store(&mut at);
        let mut found = [[0.0; LANES]; 3];
        for (k, x) in at.iter().enumerate() {
            let first = (*x as usize).min(STEPS - 1);
            let t = x - first as f64;
            let p = &self.table[first..first + 4];
            let value = p[1]
                + 0.5
                    * t
                    * (p[2] - p[0]
                        + t * (2.0 * p[0] - 5.0 * p[1] + 4.0 * p[2] - p[3] + t * (3.0 * (p[1] - p[2]) + p[3] - p[0])));
            (found[0][k], found[1][k], found[2][k]) = (value.x, value.y, value.z);
        }
        let simd = cos.simd();
        Vec3::new(Lanes::load(simd, &found[0]), Lanes::load(simd, &found[1]), Lanes::load(simd, &found[2]))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::geometry::sampling::uniform_sphere;
    use crate::numeric::quadrature::integrate;
    use crate::numeric::random::{Purpose, RngExt, stream};
    use crate::numeric::simd::{Kernel, vectorised};
    use crate::render::shapes::Quad;

    struct Irradiance<'a>(&'a QuadLight, DVec3, DVec3);

    impl Kernel for Irradiance<'_> {
        type Output = f64;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            let at = Points3 {
                position: Vec3::splat(simd, self.1),
                error: Vec3::splat(simd, DVec3::ZERO),
                normal: Vec3::splat(simd, self.2),
            };
            let mut all = [0.0; LANES];
            projected_solid_angle(self.0, &at).store(&mut all);
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
            let got = vectorised(Irradiance(&light, from, normal));
            assert!((got - want).abs() <= 2e-5 * want.max(0.01), "case {case}: {got} vs {want}");
        }
        // Above the middle of a unit square at height 1: 4 of Lambert's corners, each (2/π)·(1/√5·atan(1/√5))·π/2.
        let light = QuadLight::new(Quad::new(DVec3::Z, 0.5 * DVec3::Y, 0.5 * DVec3::X), DVec3::ONE);
        let want = 4.0 * (0.5 / 1.25f64.sqrt()) * (0.5 / 1.25f64.sqrt()).atan();
        assert!((vectorised(Irradiance(&light, DVec3::ZERO, DVec3::Z)) - want).abs() < 1e-14);
    }

    /// Small lights far away: A·cosθ·cosθ'/r², where the sum over edges cancels most of its digits.
    #[test]
    fn small_lights_keep_their_digits() {
        for distance in [1e2, 1e4, 1e6, 1e8] {
            let light = QuadLight::new(Quad::new(distance * DVec3::Z, 0.5 * DVec3::Y, 0.5 * DVec3::X), DVec3::ONE);
            let normal = DVec3::new(0.6, 0.0, 0.8);
            let got = vectorised(Irradiance(&light, DVec3::ZERO, normal)) * distance * distance;
            assert!((got - 0.8).abs() < 1.0 / (distance * distance) + 1e-7, "{distance:e}: {got}");
        }
    }

    struct Albedo<'a>(&'a Surround, f64);

    impl Kernel for Albedo<'_> {
        type Output = f64;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            let mut all = [0.0; LANES];
            self.0.albedo(Lanes::splat(simd, self.1)).x.store(&mut all);
            all[0]
        }
    }

    #[test]
    fn a_body_in_an_even_surround_shows_its_albedo() {
        for n in [0.0, 0.5, 3.0, 60.0, 1e3, 2e4, 1e6] {
            let phong = vec![(DVec3::splat(0.7), n, 0.5)];
            let material = Lobes { diffuse: DVec3::splat(0.2), diffuse_share: 0.5, phong, black: false };
            let surround = Surround::new(&material);
            for k in 1..400 {
                let cos = (f64::from(k) / 399.0).powi(3);
                let want = 0.2 + 0.7 * phong::directional_albedo(n, cos.acos());
                let got = vectorised(Albedo(&surround, cos));
                assert!((got - want).abs() < 2e-6 * want, "n {n}, cos {cos}: {got} vs {want}");
            }
        }
    }
}
