//! Mesh lights: triangles that shine. One is picked by its area, a point of it by the solid angle that it fills.

use glam::{DVec2, DVec3};

use super::super::ray::{Ray, SurfacePoint};
use super::super::shapes::triangle;
use super::Arrival;
use super::pick::pick;
use super::spherical_triangle::SphericalTriangle;

/// Below this solid angle (sr) points are uniform in area: the difference no longer matters, and 2π − π is about to cancel.
const SMALL_SOLID_ANGLE: f64 = 1e-9;

/// Triangles whose front, from which their corners run counter-clockwise, shines alike in all directions.
#[derive(Debug)]
pub struct MeshLight {
    triangles: Vec<[DVec3; 3]>,
    /// Running sum of the areas, m².
    areas: Vec<f64>,
    /// Radiance, W/(sr·m²).
    pub radiance: DVec3,
}

impl MeshLight {
    /// Shining triangles, each with an area.
    pub fn new(triangles: Vec<[DVec3; 3]>, radiance: DVec3) -> Self {
        let sum = |total: &mut f64, t: &[DVec3; 3]| {
            *total += area(t);
            Some(*total)
        };
        let areas = triangles.iter().scan(0.0, sum).collect();
        Self { triangles, areas, radiance }
    }

    /// Its triangles.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// Light that arrives at a point from a point of a triangle; `None` where the point is behind that triangle.
    pub fn sample(&self, at: &SurfacePoint, u: DVec2) -> Option<Arrival> {
        let (part, ux) = pick(&self.areas, u.x);
        let corners = self.triangles.get(part)?;
        let seen = SphericalTriangle::new(corners, at.position);
        let (b1, b2) = if seen.solid_angle > SMALL_SOLID_ANGLE {
            seen.sample(DVec2::new(ux, u.y))
        } else {
            uniform_in_area(DVec2::new(ux, u.y))
        };
        let target = triangle::surface(corners, b1, b2);
        if target.normal.dot(at.position - target.position) <= 0.0 {
            return None; // behind it
        }
        let shadow = Ray::between(at.above(), target.above())?;
        let pdf = self.density(&seen, corners, at.position, target.position);
        let irradiance = self.radiance / pdf;
        irradiance.is_finite().then_some(Arrival { wi: shadow.direction, irradiance, pdf: Some(pdf), shadow })
    }

    /// Density (1/sr) of the direction from `from` to the point `to` of the triangle `part`.
    pub fn pdf(&self, part: usize, from: DVec3, to: DVec3) -> f64 {
        let Some(corners) = self.triangles.get(part) else { return 0.0 };
        self.density(&SphericalTriangle::new(corners, from), corners, from, to)
    }

    fn density(&self, seen: &SphericalTriangle, corners: &[DVec3; 3], from: DVec3, to: DVec3) -> f64 {
        let total = self.areas.last().copied().unwrap_or(0.0);
        if seen.solid_angle > SMALL_SOLID_ANGLE {
            return area(corners) / (total * seen.solid_angle);
        }
        let [a, b, c] = *corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let d = to - from;
        d.length_squared() * d.length() / (total * d.dot(normal).abs())
    }
}

fn area([a, b, c]: &[DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// Barycentric coordinates of the second and third corner of a point uniform in area.
fn uniform_in_area(u: DVec2) -> (f64, f64) {
    let root = u.x.sqrt();
    (root * (1.0 - u.y), root * u.y)
}
