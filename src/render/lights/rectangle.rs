//! Quad lights. A rectangle is sampled uniformly in the solid angle that it fills (Ureña, Fajardo, King 2013, Computer Graphics
//! Forum 32(4)); where that is below 10⁻⁵ sr, or the quad is no rectangle, uniformly in area.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::super::ray::{Ray, SurfacePoint};
use super::super::shapes::Quad;
use super::Arrival;
use crate::numeric::float::sqrt_nonneg;

/// Below this solid angle (sr) the density over the solid angle is taken uniform in area: the sum of four angles less 2π holds
/// only 10⁻¹⁵ sr, and the difference between the two samplings no longer matters.
const SMALL_SOLID_ANGLE: f64 = 1e-5;

/// A quad whose front shines alike in all directions.
#[derive(Debug)]
pub struct QuadLight {
    quad: Quad,
    /// Radiance, W/(sr·m²).
    pub radiance: DVec3,
    /// Unit edges and full edge lengths; `None` where the edges are not at right angles.
    rectangle: Option<Edges>,
}

#[derive(Debug, Clone, Copy)]
struct Edges {
    x: DVec3,
    y: DVec3,
    length: DVec2,
}

impl QuadLight {
    /// A shining quad.
    pub fn new(quad: Quad, radiance: DVec3) -> Self {
        let (x, y) = (quad.u.normalize(), quad.v.normalize());
        let edges = Edges { x, y, length: 2.0 * DVec2::new(quad.u.length(), quad.v.length()) };
        Self { quad, radiance, rectangle: (x.dot(y).abs() < 1e-12).then_some(edges) }
    }

    /// Where it is.
    pub fn quad(&self) -> Quad {
        self.quad
    }

    /// Light that arrives at a point from a point of the quad.
    pub fn sample(&self, at: &SurfacePoint, u: DVec2) -> Option<Arrival> {
        let to_centre = self.quad.center - at.position;
        if self.quad.normal.dot(to_centre) >= 0.0 {
            return None; // behind the light
        }
        let (a, b, pdf) = match self.seen_from(at.position) {
            Some(view) => {
                let (a, b) = view.sample(u);
                (a, b, Some(1.0 / view.solid_angle))
            }
            None => (2.0 * u.x - 1.0, 2.0 * u.y - 1.0, None),
        };
        let target = self.quad.surface(a, b);
        let shadow = Ray::between(at.above(), target.above())?;
        let pdf = pdf.unwrap_or_else(|| self.area_pdf(at.position, target.position));
        let irradiance = self.radiance / pdf;
        irradiance.is_finite().then_some(Arrival { wi: shadow.direction, irradiance, pdf: Some(pdf), shadow })
    }

    /// Density (1/sr) of the direction from `from` to the point `to` of the quad.
    pub fn pdf(&self, from: DVec3, to: DVec3) -> f64 {
        self.seen_from(from).map_or_else(|| self.area_pdf(from, to), |view| 1.0 / view.solid_angle)
    }

    /// The segment from a point to the quad's centre.
    pub fn segment_to_centre(&self, at: &SurfacePoint) -> Option<Ray> {
        let centre = self.quad.surface(0.0, 0.0);
        let front = self.quad.normal.dot(at.position - centre.position) >= 0.0;
        let facing = SurfacePoint { normal: if front { centre.normal } else { -centre.normal }, ..centre };
        Ray::between(at.above(), facing.above())
    }

    /// r²/(A cosθ): uniform in area, as a density over directions.
    fn area_pdf(&self, from: DVec3, to: DVec3) -> f64 {
        let d = to - from;
        let distance2 = d.length_squared();
        distance2 * distance2.sqrt() / (self.quad.area * d.dot(self.quad.normal).abs())
    }

    fn seen_from(&self, p: DVec3) -> Option<RectangleView> {
        let view = RectangleView::new(&self.quad, self.rectangle.as_ref()?, p);
        (view.solid_angle > SMALL_SOLID_ANGLE).then_some(view)
    }
}

/// A rectangle seen from a point: its corners in the rectangle's own axes, the point being the origin, and the plane at −`height`.
#[derive(Debug, Clone, Copy)]
struct RectangleView {
    low: DVec2,
    high: DVec2,
    length: DVec2,
    height: f64,
    solid_angle: f64,
    /// 2π less the angles at the two corners of the upper edge: where the first coordinate's azimuth starts.
    start: f64,
    /// z of the unit normals of the planes through the lower and the upper edge.
    normal_z: DVec2,
}

impl RectangleView {
    fn new(quad: &Quad, edges: &Edges, p: DVec3) -> Self {
        let d = quad.center - p;
        let center = DVec2::new(d.dot(edges.x), d.dot(edges.y));
        let (low, high) = (center - 0.5 * edges.length, center + 0.5 * edges.length);
        let height = d.dot(quad.normal).abs();
        // The angle between the planes of two neighbouring edges is the argument of this complex number, x and y the edges'
        // distances from the foot point; arguments are added by multiplying.
        let corner = |x: f64, y: f64| DVec2::new(x * y, height * (height * height + x * x + y * y).sqrt());
        let sum = |p: DVec2, q: DVec2| {
            let angle = (p.x * q.y + p.y * q.x).atan2(p.x * q.x - p.y * q.y);
            if angle < 0.0 { angle + TAU } else { angle }
        };
        let right = sum(corner(high.x, low.y), corner(-high.x, high.y));
        let start = TAU - sum(corner(low.x, high.y), corner(-low.x, low.y));
        let of_plane = |y: f64| y / (height * height + y * y).sqrt();
        Self {
            low,
            high,
            length: edges.length,
            height,
            solid_angle: right - start,
            start,
            normal_z: DVec2::new(-of_plane(low.y), of_plane(high.y)),
        }
    }

    /// Coordinates (a, b) in [−1, 1]² of a point uniform in solid angle.
    fn sample(&self, u: DVec2) -> (f64, f64) {
        let (x, y) = self.sample_plane(u);
        let middle = 0.5 * (self.low + self.high);
        let a = (2.0 * (x - middle.x) / self.length.x).clamp(-1.0, 1.0);
        let b = (2.0 * (y - middle.y) / self.length.y).clamp(-1.0, 1.0);
        (a, b)
    }

    fn sample_plane(&self, u: DVec2) -> (f64, f64) {
        let h2 = self.height * self.height;
        let azimuth = u.x * self.solid_angle + self.start;
        let (sin, cos) = azimuth.sin_cos();
        let f = (cos * self.normal_z.x - self.normal_z.y) / sin;
        // x = height · c/√(1 − c²) with c = sign(f)/√(f² + b0²), and 1 − b0² = h²/(h² + y0²) without cancellation.
        let flat = sqrt_nonneg((f * f - h2 / (h2 + self.low.y * self.low.y)).clamp(0.0, f64::INFINITY));
        let x = (self.height.copysign(f) / flat).clamp(self.low.x, self.high.x);
        let d2 = x * x + h2;
        let sine = |y: f64| y / (d2 + y * y).sqrt();
        let s = sine(self.low.y) + u.y * (sine(self.high.y) - sine(self.low.y));
        let y = s * (d2 / (1.0 - s * s)).sqrt();
        (x, y.clamp(self.low.y, self.high.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};
    use crate::numeric::stats::chi_square_test;

    /// Solid angle of a triangle seen from the origin (van Oosterom, Strackee 1983).
    fn triangle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
        let (a, b, c) = (a.normalize(), b.normalize(), c.normalize());
        2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    }

    /// Solid angle of the part a in [a0, a1], b in [b0, b1] of the quad, seen from p.
    fn part(quad: &Quad, p: DVec3, a: (f64, f64), b: (f64, f64)) -> f64 {
        let at = |a, b| quad.surface(a, b).position - p;
        triangle(at(a.0, b.0), at(a.1, b.0), at(a.1, b.1)) + triangle(at(a.0, b.0), at(a.1, b.1), at(a.0, b.1))
    }

    #[test]
    fn points_are_uniform_in_solid_angle() {
        let quad = Quad::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, 0.0, 2.0));
        // Across from the middle, beside it, close to it, close to a corner, low over an edge, far away.
        let above = |a: f64, b: f64, h: f64| quad.center + a * quad.u + b * quad.v + h * quad.normal;
        for p in [
            above(0.0, 0.0, 1.0),
            above(2.0, 0.5, 0.7),
            above(0.1, 0.2, 0.01),
            above(1.0, -1.0, 0.05),
            above(0.0, 1.5, 0.02),
            above(3.0, 1.0, 60.0),
        ] {
            let light = QuadLight::new(quad, DVec3::ONE);
            let view = light.seen_from(p).expect("above 1e-5 sr");
            let whole = part(&quad, p, (-1.0, 1.0), (-1.0, 1.0));
            assert!((view.solid_angle / whole - 1.0).abs() < 1e-9, "{p}: {} vs {whole}", view.solid_angle);
            let draws = 40_000;
            let mut rng = stream(3, Purpose::Study, 0);
            let mut counts = [0.0; 64];
            for _ in 0..draws {
                let (a, b) = view.sample(DVec2::new(rng.random(), rng.random()));
                let cell = |x: f64| ((4.0 * (x + 1.0)) as usize).min(7);
                counts[8 * cell(b) + cell(a)] += 1.0;
            }
            let edge = |i: usize| (0.25 * i as f64 - 1.0, 0.25 * i as f64 - 0.75);
            let share = |i: usize| part(&quad, p, edge(i % 8), edge(i / 8)) / whole;
            let expected: Vec<f64> = (0..64).map(|i| f64::from(draws) * share(i)).collect();
            let (chi2, freedom, chance) = chi_square_test(&counts, &expected);
            assert!(chance > 1e-3, "{p}: chi2 {chi2} of {freedom}, p {chance}");
        }
    }

    #[test]
    fn the_two_samplings_meet_where_the_light_is_small() {
        let quad = Quad::new(DVec3::ZERO, DVec3::X, DVec3::Y);
        let light = QuadLight::new(quad, DVec3::ONE);
        for distance in [632.0, 632.9] {
            // 4 m² at 632.46 m are 10⁻⁵ sr; the densities differ by no more than (half diagonal / distance)² there.
            let p = DVec3::new(0.0, 0.0, distance);
            let density = light.pdf(p, DVec3::ZERO);
            assert!((density * 4.0 / (distance * distance) - 1.0).abs() < 2.0 * 2.0 / distance.powi(2), "{distance}");
        }
        assert!(light.seen_from(DVec3::new(0.0, 0.0, 632.0)).is_some());
        assert!(light.seen_from(DVec3::new(0.0, 0.0, 632.9)).is_none());
    }
}
