//! Triangles: the watertight test of Woop, Benthin and Wald (JCGT 2(1), 2013), in f64.

use glam::DVec3;

use super::super::ray::{Ray, SurfacePoint, gamma};
use crate::numeric::float::diff_of_products;

/// A ray sheared so that it runs along +z: what the test needs of it, computed once a ray.
#[derive(Debug, Clone, Copy)]
pub struct ShearedRay {
    origin: DVec3,
    direction: DVec3,
    /// Its longest axis, which becomes z.
    axis: usize,
    shear: DVec3,
}

impl ShearedRay {
    /// The shear of a ray.
    pub fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let axis = d.abs().max_position();
        let along = turned(d, axis);
        let shear = DVec3::new(along.x / along.z, along.y / along.z, 1.0 / along.z);
        Self { origin: ray.origin, direction: d, axis, shear }
    }

    /// Which of the triangles may be met, as bits: all that [`ShearedRay::hit`] meets are among them, for the edges' functions are worked out as there, and
    /// two of opposite signs rule a triangle out.
    #[inline(always)]
    pub fn may_meet(&self, four: &Four) -> u32 {
        let (a, b, c) = (self.sheared(four, 0), self.sheared(four, 1), self.sheared(four, 2));
        let mut bits = [0; SIDE_BY_SIDE];
        for k in 0..SIDE_BY_SIDE {
            let u = c[0][k] * b[1][k] - c[1][k] * b[0][k];
            let v = a[0][k] * c[1][k] - a[1][k] * c[0][k];
            let w = b[0][k] * a[1][k] - b[1][k] * a[0][k];
            let (least, most) = (lesser(lesser(u, v), w), -lesser(lesser(-u, -v), -w));
            bits[k] = if least * most < 0.0 { 0 } else { BITS[k] };
        }
        bits.iter().fold(0, |all, bit| all | bit) & ((1 << four.count) - 1)
    }

    /// x and y of [`ShearedRay::apply`] of a corner of each.
    #[inline(always)]
    fn sheared(&self, four: &Four, corner: usize) -> [[f64; SIDE_BY_SIDE]; 2] {
        let (x, y, z) = match self.axis {
            0 => (1, 2, 0),
            1 => (2, 0, 1),
            _ => (0, 1, 2),
        };
        let at = &four.corners[corner];
        let mut sheared = [[0.0; SIDE_BY_SIDE]; 2];
        for k in 0..SIDE_BY_SIDE {
            let along = at[z][k] - self.origin[z];
            sheared[0][k] = at[x][k] - self.origin[x] - self.shear.x * along;
            sheared[1][k] = at[y][k] - self.origin[y] - self.shear.y * along;
        }
        sheared
    }

    #[inline]
    fn apply(&self, p: DVec3) -> DVec3 {
        let q = turned(p - self.origin, self.axis);
        DVec3::new(q.x - self.shear.x * q.z, q.y - self.shear.y * q.z, self.shear.z * q.z)
    }

    /// Where in (0, `t_max`) the ray meets the triangle, from either side: (t, b1, b2) with the barycentric coordinates of the
    /// second and third corner. A ray through a shared edge or corner meets at least one of the triangles that share it: an
    /// edge's function changes only its sign between its two triangles.
    pub fn hit(&self, corners: &[DVec3; 3], t_max: f64) -> Option<(f64, f64, f64)> {
        let [a, b, c] = [self.apply(corners[0]), self.apply(corners[1]), self.apply(corners[2])];
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
        let met = t > 0.0 && t < t_max && (t > t_error([a, b, c], [u, v, w], determinant) || self.nears(corners));
        met.then_some((t, b1, b2))
    }

    /// Whether the plane of the triangle lies ahead: tells a hit close to the start from the neighbour of a surface that the ray leaves.
    fn nears(&self, [a, b, c]: &[DVec3; 3]) -> bool {
        let (p, q) = (*b - *a, *c - *a);
        let normal = DVec3::new(
            diff_of_products(p.y, q.z, p.z, q.y),
            diff_of_products(p.z, q.x, p.x, q.z),
            diff_of_products(p.x, q.y, p.y, q.x),
        );
        let (ahead, along) = (normal.dot(*a - self.origin), normal.dot(self.direction));
        (ahead > 0.0 && along > 0.0) || (ahead < 0.0 && along < 0.0)
    }
}

/// Triangles of a [`Four`].
pub const SIDE_BY_SIDE: usize = 4;

/// A bit for each.
const BITS: [u32; SIDE_BY_SIDE] = [1, 2, 4, 8];

/// Up to four triangles side by side.
#[derive(Debug, Clone)]
pub struct Four {
    /// By corner and axis.
    corners: [[[f64; SIDE_BY_SIDE]; 3]; 3],
    count: usize,
}

impl Four {
    /// Of four triangles at most.
    pub fn new(triangles: &[[DVec3; 3]]) -> Self {
        assert!(triangles.len() <= SIDE_BY_SIDE, "{} triangles in a leaf", triangles.len());
        let mut four = Self { corners: Default::default(), count: triangles.len() };
        for (lane, triangle) in triangles.iter().enumerate() {
            for (corner, p) in triangle.iter().enumerate() {
                (0..3).for_each(|axis| four.corners[corner][axis][lane] = p[axis]);
            }
        }
        four
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Corners of one of them.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> [DVec3; 3] {
        let [a, b, c] = &self.corners;
        [self::at(a, lane), self::at(b, lane), self::at(c, lane)]
    }
}

/// The lesser of two, in one instruction.
#[inline(always)]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn at(axes: &[[f64; SIDE_BY_SIDE]; 3], lane: usize) -> DVec3 {
    DVec3::new(axes[0][lane], axes[1][lane], axes[2][lane])
}

/// The axes in turn, so that this one becomes z. The winding stays; a ray that runs backwards sees it reversed, and both sides are met.
#[inline]
fn turned(v: DVec3, axis: usize) -> DVec3 {
    match axis {
        0 => DVec3::new(v.y, v.z, v.x),
        1 => DVec3::new(v.z, v.x, v.y),
        _ => v,
    }
}

/// Bound on the rounding error of t (Pharr, Jakob, Humphreys 2023, section 6.8.7): nothing to speak of for most triangles, and more than
/// what a ray is lifted off its surface by where a needle's area cancels. Nearer hits may be the needle's neighbour, which the ray leaves.
fn t_error(corners: [DVec3; 3], edges: [f64; 3], determinant: f64) -> f64 {
    let [a, b, c] = corners.map(DVec3::abs);
    let most = a.max(b).max(c);
    let error = DVec3::new(gamma(5) * (most.x + most.z), gamma(5) * (most.y + most.z), gamma(3) * most.z);
    let edge_error = 2.0 * (gamma(2) * most.x * most.y + error.y * most.x + error.x * most.y);
    let edge = edges.iter().fold(0.0, |m: f64, e| m.max(e.abs()));
    3.0 * (gamma(3) * edge * most.z + edge_error * most.z + error.z * edge) / determinant.abs()
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
