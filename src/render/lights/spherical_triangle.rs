//! Uniform directions within a triangle as it is seen from a point (Arvo 1995, SIGGRAPH, 437–438).
//!
//! Arvo's construction (cut off a part of the area at a corner, then a height along the cut) in the form of Peters 2021 (ACM
//! Transactions on Graphics 40(4)), whose terms do not cancel for small triangles; the volume G0 comes from differences of corners.

use glam::{DVec2, DVec3};

use crate::numeric::float::sqrt_nonneg;

/// A triangle seen from a point.
#[derive(Debug, Clone, Copy)]
pub struct SphericalTriangle {
    /// Unit directions to the corners.
    corners: [DVec3; 3],
    /// Distances of the corners.
    lengths: DVec3,
    /// |det(v0, v1, v2)|, v0·v2 + v1·v2, 1 + v0·v1.
    g: DVec3,
    /// Solid angle, sr, below 2π; not a number from a corner itself.
    pub solid_angle: f64,
}

impl SphericalTriangle {
    /// The triangle with these corners seen from `p`.
    pub fn new(corners: &[DVec3; 3], p: DVec3) -> Self {
        let to = corners.map(|c| c - p);
        let lengths = DVec3::new(to[0].length(), to[1].length(), to[2].length());
        let [v0, v1, v2] = [to[0] / lengths.x, to[1] / lengths.y, to[2] / lengths.z];
        let volume = v0.dot((v1 - v0).cross(v2 - v0)).abs();
        let g = DVec3::new(volume, v0.dot(v2) + v1.dot(v2), 1.0 + v0.dot(v1));
        Self { corners: [v0, v1, v2], lengths, g, solid_angle: 2.0 * volume.atan2(g.y + g.z) }
    }

    /// Barycentric coordinates of the second and third corner of a point uniform in solid angle.
    pub fn sample(&self, u: DVec2) -> (f64, f64) {
        let [v0, v1, v2] = self.corners;
        let (sin, cos) = (0.5 * u.x * self.solid_angle).sin_cos();
        // The corner w = 2(m·v0)m/|m|² − v0 on the edge from v0 to v2, with which v0 and v1 span the share u.x of the area.
        let (a, b) = (self.g.x * cos - self.g.y * sin, self.g.z * sin);
        let m = a * v0 + b * v2;
        let twice = 2.0 * m.dot(v0) / m.length_squared();
        let w = twice * m - v0;
        // On the arc from v1 to w: 1 − cos of the angle from v1 is uniform.
        let height = 0.5 * (v1 - w).length_squared();
        let low = u.y * height;
        let t = sqrt_nonneg(u.y * (2.0 - low) / (2.0 - height));
        let along = (1.0 - low) - t * (1.0 - height);
        // The direction as a sum of the corners' directions, and so of the corners themselves.
        let share = |x: f64| x.clamp(0.0, f64::INFINITY);
        let parts = DVec3::new(share(t * (twice * a - 1.0)), share(along), share(t * twice * b)) / self.lengths;
        let parts = parts / parts.element_sum();
        (parts.y, parts.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};
    use crate::numeric::stats::chi_square_test;

    #[test]
    fn points_are_uniform_in_solid_angle() {
        let flat = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.5, 1.5, 0.0)];
        let needle = [DVec3::ZERO, DVec3::new(5.0, 0.0, 0.0), DVec3::new(2.0, 1e-3, 0.0)];
        let mut rng = stream(8, Purpose::Study, 0);
        for (triangle, p) in [
            (flat, DVec3::new(0.7, 0.4, 1.0)),
            (flat, DVec3::new(0.7, 0.4, 0.01)),
            (flat, DVec3::new(-3.0, 0.2, 0.05)),
            (flat, DVec3::new(40.0, -300.0, 1000.0)),
            (flat, DVec3::new(0.01, 0.01, 0.02)),
            (needle, DVec3::new(2.0, 0.1, 0.3)),
        ] {
            let seen = SphericalTriangle::new(&triangle, p);
            // 64 parts of equal shape: four times four times four.
            let parts = split(&split(&split(&[triangle])));
            let solid: Vec<f64> = parts.iter().map(|t| SphericalTriangle::new(t, p).solid_angle).collect();
            let whole: f64 = solid.iter().sum();
            assert!((whole / seen.solid_angle - 1.0).abs() < 1e-9, "{p}: {whole} vs {}", seen.solid_angle);
            let draws = 50_000;
            let mut counts = vec![0.0; 64];
            for _ in 0..draws {
                let (b1, b2) = seen.sample(DVec2::new(rng.random(), rng.random()));
                assert!(b1 >= 0.0 && b2 >= 0.0 && b1 + b2 <= 1.0 + 1e-12);
                counts[part(b1, b2)] += 1.0;
            }
            let expected: Vec<f64> = solid.iter().map(|s| f64::from(draws) * s / whole).collect();
            let (chi2, freedom, chance) = chi_square_test(&counts, &expected);
            assert!(chance > 1e-3, "{p}: chi2 {chi2} of {freedom}, p {chance}");
        }
    }

    /// Each triangle in four: at its three corners, and the middle.
    fn split(triangles: &[[DVec3; 3]]) -> Vec<[DVec3; 3]> {
        let four = |[a, b, c]: &[DVec3; 3]| {
            let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [bc, ca, ab]]
        };
        triangles.iter().flat_map(four).collect()
    }

    /// Which of the 64 parts holds a point.
    fn part(mut b1: f64, mut b2: f64) -> usize {
        let mut index = 0;
        for _ in 0..3 {
            let b0 = 1.0 - b1 - b2;
            let (k, c1, c2) = match () {
                () if b0 > 0.5 => (0, 2.0 * b1, 2.0 * b2),
                () if b1 > 0.5 => (1, 2.0 * b1 - 1.0, 2.0 * b2),
                () if b2 > 0.5 => (2, 2.0 * b1, 2.0 * b2 - 1.0),
                () => (3, 1.0 - 2.0 * b1, 1.0 - 2.0 * b2),
            };
            (index, b1, b2) = (4 * index + k, c1, c2);
        }
        index
    }
}
