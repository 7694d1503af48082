//! Sphere lights, sampled uniformly in the cone of directions that they fill.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::super::ray::{Ray, SurfacePoint, gamma};
use super::super::shapes::Sphere;
use super::Arrival;
use crate::geometry::Frame;
use crate::numeric::float::sqrt_nonneg;

/// A sphere whose outside shines alike in all directions. From inside it is black.
#[derive(Debug, Clone, Copy)]
pub struct SphereLight {
    /// Where it is.
    pub sphere: Sphere,
    /// Radiance, W/(sr·m²).
    pub radiance: DVec3,
}

/// The directions from a point to a sphere.
#[derive(Debug, Clone, Copy)]
struct Cone {
    /// From the point to the sphere's centre, m.
    to_center: DVec3,
    distance: f64,
    /// 1 − cosσ, σ the half-angle: sin²σ/(1 + cosσ), which does not cancel for small spheres.
    height: f64,
}

impl Cone {
    /// `None` from inside, and from the sphere itself.
    fn new(sphere: &Sphere, from: DVec3) -> Option<Self> {
        let to_center = sphere.center - from;
        let distance = to_center.length();
        // (d − r)(d + r) keeps the digits of a point close to the sphere.
        let outside = (distance - sphere.radius) * (distance + sphere.radius);
        let sin = sphere.radius / distance;
        let cos = outside.clamp(0.0, f64::INFINITY).sqrt() / distance;
        (outside > 0.0).then_some(Self { to_center, distance, height: sin * sin / (1.0 + cos) })
    }

    /// Density of a direction in the cone, 1/sr.
    fn pdf(&self) -> f64 {
        1.0 / (TAU * self.height)
    }
}

impl SphereLight {
    /// Light that arrives at a point from the part of the sphere that it sees.
    pub fn sample(&self, at: &SurfacePoint, u: DVec2) -> Option<Arrival> {
        let cone = Cone::new(&self.sphere, at.position)?;
        let below = u.x * cone.height; // 1 − cosθ
        let sin = sqrt_nonneg(below * (2.0 - below));
        let (sin_p, cos_p) = (TAU * u.y).sin_cos();
        let frame = Frame::from_normal(cone.to_center / cone.distance);
        let wi = frame.to_world(DVec3::new(sin * cos_p, sin * sin_p, 1.0 - below)).normalize();
        let shadow = self.segment(at, &cone, wi, 1.0 - below, sin);
        let pdf = cone.pdf();
        let irradiance = self.radiance / pdf;
        irradiance.is_finite().then_some(Arrival { wi, irradiance, pdf: Some(pdf), shadow })
    }

    /// Density (1/sr) of any direction from `from` to the sphere; 0 from inside.
    pub fn pdf(&self, from: DVec3) -> f64 {
        Cone::new(&self.sphere, from).map_or(0.0, |cone| cone.pdf())
    }

    /// The segment from a point to the sphere, towards its centre.
    pub fn segment_to_centre(&self, at: &SurfacePoint) -> Option<Ray> {
        let cone = Cone::new(&self.sphere, at.position)?;
        Some(self.segment(at, &cone, cone.to_center / cone.distance, 1.0, 0.0))
    }

    /// The segment along `wi`, at the angle (cos, sin) from the centre's direction, up to a shell round the sphere: thick enough that
    /// the ray, which starts off the surface and not in its point, can't meet the sphere itself, however flat it comes in.
    fn segment(&self, at: &SurfacePoint, cone: &Cone, wi: DVec3, cos: f64, sin: f64) -> Ray {
        let origin = at.above();
        let reach = cone.distance + self.sphere.radius + self.sphere.center.length();
        let shell = self.sphere.radius + (origin - at.position).length() + gamma(32) * reach;
        let aside = cone.distance * sin;
        let half_chord = sqrt_nonneg(((shell - aside) * (shell + aside)).clamp(0.0, f64::INFINITY));
        Ray { t_max: cone.distance * cos - half_chord, ..Ray::new(origin, wi) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};

    #[test]
    fn all_directions_of_the_cone_meet_the_sphere_and_none_outside_does() {
        let mut rng = stream(1, Purpose::Study, 0);
        for (radius, gap) in [(1.0, 2.0), (1.0, 1e-9), (1e-6, 1.0), (1e-9, 1e3), (1e3, 1e-3), (1e-4, 1e4)] {
            let center = DVec3::new(0.3, 2.0, -1.0);
            let light = SphereLight { sphere: Sphere { center, radius }, radiance: DVec3::ONE };
            let normal = DVec3::new(0.36, 0.48, 0.8);
            let position = center + (radius + gap) * normal;
            let at = SurfacePoint { position, error: DVec3::ZERO, normal: -normal };
            let solid = 1.0 / light.pdf(position);
            let half = (radius / (radius + gap)).asin();
            let want = 4.0 * std::f64::consts::PI * (0.5 * half).sin().powi(2);
            // The gap is what the coordinates left of it.
            let bound = 1e-12 + 20.0 * f64::EPSILON * (radius + 3.0) / gap;
            assert!((solid / want - 1.0).abs() < bound, "radius {radius:e}, gap {gap:e}: {solid} vs {want}");
            let mut met = 0;
            for _ in 0..2000 {
                let u = DVec2::new(rng.random(), rng.random());
                let arrival = light.sample(&at, u).expect("outside");
                // The shadow ray ends before the sphere.
                assert!(light.sphere.hit(&arrival.shadow, arrival.shadow.t_max).is_none(), "{radius:e} {gap:e} {u}");
                met += u32::from(light.sphere.hit(&Ray::new(position, arrival.wi), f64::INFINITY).is_some());
            }
            // But for directions within rounding of the rim.
            assert!(met >= 1995, "radius {radius:e}, gap {gap:e}: {met} of 2000 meet the sphere");
        }
    }

    #[test]
    fn from_inside_there_is_no_light() {
        let light = SphereLight { sphere: Sphere { center: DVec3::ONE, radius: 2.0 }, radiance: DVec3::ONE };
        for position in [DVec3::ONE, DVec3::new(1.0, 2.5, 1.0), DVec3::new(1.0, 3.0, 1.0)] {
            let at = SurfacePoint { position, error: DVec3::ZERO, normal: DVec3::Y };
            assert!(light.sample(&at, DVec2::splat(0.3)).is_none() && light.segment_to_centre(&at).is_none());
            assert_eq!(light.pdf(position), 0.0);
        }
    }
}
