//! Triangles: the watertight test of Woop, Benthin and Wald (JCGT 2(1), 2013), in f64.

use glam::DVec3;

use super::super::ray::{Ray, SurfacePoint, gamma};
use crate::numeric::float::diff_of_products;

/// A ray sheared so that it runs along +z: what the test needs of it, computed once a ray.
#[derive(Debug, Clone, Copy)]
pub struct ShearedRay {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

impl ShearedRay {
    /// The shear of a ray.
    pub fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let z = d.abs().max_position();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        // The two other axes change places where d runs backwards, which keeps the winding.
        let axes = if d[z] < 0.0 { [y, x, z] } else { [x, y, z] };
        let shear = DVec3::new(d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]);
        Self { origin: ray.origin, axes, shear }
    }

    fn apply(&self, p: DVec3) -> DVec3 {
        let q = p - self.origin;
        let [x, y, z] = self.axes;
        DVec3::new(q[x] - self.shear.x * q[z], q[y] - self.shear.y * q[z], self.shear.z * q[z])
    }

    /// Where in (0, `t_max`) the ray meets the triangle, from either side: (t, b1, b2) with the barycentric coordinates of the
    /// second and third corner. A ray through a shared edge or corner meets at least one of the triangles that share it: an
    /// edge's function changes only its sign between its two triangles.
    pub fn hit(&self, corners: &[DVec3; 3], t_max: f64) -> Option<(f64, f64, f64)> {
        let [a, b, c] = corners.map(|p| self.apply(p));
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let (b0, b1, b2) = (u / determinant, v / determinant, w / determinant);
        let t = b0 * a.z + b1 * b.z + b2 * c.z;
        (t > 0.0 && t < t_max).then_some((t, b1, b2))
    }
}

/// Twice the signed area of the origin, p and q in the plane; where products cancel to 0, by the exact form.
fn edge(p: DVec3, q: DVec3) -> f64 {
    let area = p.x * q.y - p.y * q.x;
    if area == 0.0 { diff_of_products(p.x, q.y, p.y, q.x) } else { area }
}

/// The point with barycentric coordinates (1 − b1 − b2, b1, b2) and the normal of the corners' winding.
pub fn surface(corners: &[DVec3; 3], b1: f64, b2: f64) -> SurfacePoint {
    let [p0, p1, p2] = *corners;
    let b0 = 1.0 - b1 - b2;
    let position = b0 * p0 + b1 * p1 + b2 * p2;
    // 32 rounded operations cover the point and what a later ray's own intersection rounds off.
    let reach = p0.abs().max(p1.abs()).max(p2.abs()).max_element();
    let normal = (p1 - p0).cross(p2 - p0).normalize_or_zero();
    SurfacePoint { position, error: DVec3::splat(gamma(32) * reach), normal }
}
