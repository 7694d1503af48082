//! Irradiance from a polygon of even radiance: Lambert's closed form (Photometria, 1760), kept accurate at every size.
//!
//! With the vectors `v_i` from the point to the vertices, `H = (L/2) Σ Θ_i n·Γ_i` over the edges, `Θ_i` the angle between `v_i`
//! and `v_{i+1}` and `Γ_i` the unit normal of their plane, after the polygon has been cut at the horizon. The terms are of the size s
//! of the polygon against its distance and their sum of the size s², or s³ at the horizon: for a small polygon all digits
//! would go. So below s = 1/10 the area integral L ∫ cosθ cosθ'/r² dA is taken by Gauss–Legendre quadrature instead, whose
//! terms are all of one sign and which is exact to rounding at that size.

use std::f64::consts::PI;

use glam::DVec3;

use super::flux::positive;
use super::irradiance::{towards, unit};
use super::quantity::{Irradiance, Quantity, Radiance};
use crate::geometry::Frame;
use crate::numeric::float::dot_compensated;
use crate::numeric::quadrature::gauss_legendre;

/// Below this ratio of size to distance the quadrature replaces the closed form.
const SMALL: f64 = 0.1;
/// Its order. The integrand's nearest pole lies at 9 half-edges from an edge's middle, so the relative error is about
/// (9 + √80)^(−2·8) < 10⁻¹⁹.
const ORDER: usize = 8;

/// Irradiance at the point `p` (m) with normal `n` from the plane polygon `vertices` (m, in order) of radiance L all over and
/// in all directions. It shines to the side from which its vertices run counter-clockwise; what lies below the horizon of
/// `n` is cut off. Its edges must not cross; it need not be convex.
///
/// Error: 10⁻¹⁴ of πL in the closed form; below a size of 1/10 of the distance about 10⁻¹⁴ of the value itself, as far as
/// the vertices, in their own rounding, determine it. 0 when `p` sees the polygon's back or edge, or it has no area.
/// `None` when `p` is on its border (where H jumps), `n` is 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec3;
/// // A square of side 2a at height h, shining down on the point below its middle:
/// // 4 L·(a/√(a² + h²))·atan(a/√(a² + h²)).
/// let (a, h) = (1.5, 0.8);
/// let square = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(a * x, a * y, h));
/// let l = Radiance::new(10.0);
/// let got = irradiance_from_polygon(&square, l, DVec3::ZERO, DVec3::Z).unwrap();
/// let x = a / f64::hypot(a, h);
/// assert!((got.value() / (4.0 * 10.0 * x * x.atan()) - 1.0).abs() < 1e-14);
/// // Tilted, and by the extended source: a ray from p meets the square when |wi.x|, |wi.y| < a wi.z/h.
/// let n = DVec3::new(0.3, 0.1, 1.0);
/// let closed = irradiance_from_polygon(&square, l, DVec3::ZERO, n).unwrap();
/// let sky = |wi: DVec3| if wi.x.abs().max(wi.y.abs()) * h < a * wi.z { l } else { Radiance::new(0.0) };
/// let rough = Quadrature { relative: 1e-3, ..Quadrature::default() };
/// let by_directions = irradiance_from_extended(n, sky, &rough).unwrap();
/// assert!((by_directions.value - closed).value().abs() <= by_directions.error.value() && by_directions.converged);
/// // From behind it is dark.
/// assert_eq!(irradiance_from_polygon(&square, l, DVec3::new(0.0, 0.0, 2.0), -DVec3::Z).unwrap(), Irradiance::new(0.0));
/// ```
#[must_use]
pub fn irradiance_from_polygon(vertices: &[DVec3], radiance: Radiance, p: DVec3, n: DVec3) -> Option<Irradiance> {
    let factor = projected_solid_angle(vertices, p, unit(n)?)?;
    Irradiance::new(radiance.value() * factor).finite()
}

/// A vertex in the frame of the point: z along the normal, lengths in units of the farthest coordinate.
#[derive(Clone, Copy)]
struct Vertex {
    /// From the point.
    from_p: DVec3,
    /// From the polygon's first vertex: keeps the digits of a small polygon far away.
    offset: DVec3,
}

/// ∫ cosθ dω over the part of the polygon above the horizon, 0 … π.
fn projected_solid_angle(vertices: &[DVec3], p: DVec3, n: DVec3) -> Option<f64> {
    let polygon = local_vertices(vertices, p, n)?;
    if touches_horizontally(&polygon) {
        return None;
    }
    let visible = above_horizon(&polygon);
    let Some(first) = visible.first() else { return Some(0.0) };
    let size = visible.iter().map(|v| (v.offset - first.offset).length()).fold(0.0, f64::max);
    if size < SMALL * first.from_p.length() { Some(by_area(&visible)) } else { by_edges(&visible) }
}

/// The vertices in the local frame, scaled so that the farthest coordinate is 1. Empty for fewer than 3.
fn local_vertices(vertices: &[DVec3], p: DVec3, n: DVec3) -> Option<Vec<Vertex>> {
    let Some((&first, true)) = vertices.first().map(|first| (first, vertices.len() >= 3)) else {
        return Some(Vec::new());
    };
    // Halved, so that a difference of two finite numbers is finite.
    let reach = |v: &DVec3| (0.5 * *v - 0.5 * p).abs().max_element();
    let finite = p.is_finite() && vertices.iter().all(|v| v.is_finite());
    let scale = positive(vertices.iter().map(reach).fold(0.0, f64::max)).filter(|_| finite)?;
    let frame = Frame::from_normal(n);
    let local = |v: DVec3| DVec3::new(frame.tangent.dot(v), frame.bitangent.dot(v), dot_compensated(n, v));
    let difference = |a: DVec3, b: DVec3| local((0.5 * a - 0.5 * b) / scale);
    let base = difference(first, p);
    let vertex = |v: &DVec3| {
        let offset = difference(*v, first);
        Vertex { from_p: base + offset, offset }
    };
    Some(vertices.iter().map(vertex).collect())
}

/// Whether the polygon lies in the plane of the horizon and has the point on it: then H jumps from 0 to πL.
fn touches_horizontally(polygon: &[Vertex]) -> bool {
    let flat = polygon.iter().all(|v| v.from_p.z == 0.0);
    let turn = |(a, b): (&Vertex, &Vertex)| a.from_p.cross(b.from_p).z.atan2(a.from_p.dot(b.from_p));
    let on_vertex = polygon.iter().any(|v| v.from_p == DVec3::ZERO);
    // The edges turn by ±2π in all round a point inside, by ±π round one on an edge, by 0 round one outside.
    flat && (on_vertex || edges(polygon).map(turn).sum::<f64>().abs() > 1.0)
}

/// The polygon cut at z = 0 (Sutherland & Hodgman 1974).
fn above_horizon(polygon: &[Vertex]) -> Vec<Vertex> {
    let mut kept = Vec::with_capacity(polygon.len() + 2);
    for (&a, &b) in edges(polygon) {
        if a.from_p.z >= 0.0 {
            kept.push(a);
        }
        if (a.from_p.z > 0.0 && b.from_p.z < 0.0) || (a.from_p.z < 0.0 && b.from_p.z > 0.0) {
            kept.push(at_horizon(a, b));
        }
    }
    if kept.iter().any(|v| v.from_p.z > 0.0) { kept } else { Vec::new() }
}

/// The point of the edge from `a` to `b` at z = 0, reckoned from its nearer end.
fn at_horizon(a: Vertex, b: Vertex) -> Vertex {
    if a.from_p.z.abs() > b.from_p.z.abs() {
        return at_horizon(b, a);
    }
    let step = (b.offset - a.offset) * (a.from_p.z / (a.from_p.z - b.from_p.z));
    Vertex { from_p: (a.from_p + step).with_z(0.0), offset: a.offset + step }
}

fn edges(polygon: &[Vertex]) -> impl Iterator<Item = (&Vertex, &Vertex)> {
    polygon.iter().zip(polygon.iter().cycle().skip(1))
}

/// Lambert's sum over the edges; `None` when an edge passes through the point.
fn by_edges(polygon: &[Vertex]) -> Option<f64> {
    let mut sum = 0.0;
    for (a, b) in edges(polygon) {
        if a.offset == b.offset {
            continue;
        }
        let (u, v) = (unit(a.from_p)?, unit(b.from_p)?);
        let cos = u.dot(v);
        if let Some((gamma, sin)) = towards(DVec3::ZERO, u.cross(v)) {
            // Seen from the side it shines to, the polygon runs counter-clockwise: v_i × v_{i+1} points away from n.
            sum -= sin.value().atan2(cos) * gamma.z;
        } else if cos < 0.0 {
            return None;
        }
    }
    Some((0.5 * sum).clamp(0.0, PI))
}

/// ∫ cosθ cosθ'/r² dA over the fan of triangles from the first vertex, where r is nearly constant.
fn by_area(polygon: &[Vertex]) -> f64 {
    let Some((apex, rest)) = polygon.split_first() else { return 0.0 };
    let triangles = rest.windows(2).map(|pair| match pair {
        [a, b] => triangle_by_area(apex, a, b),
        _ => 0.0,
    });
    triangles.sum::<f64>().clamp(0.0, PI)
}

/// One triangle, signed by the side it is seen from. On it c + u(a + w(b − a)), with a, b from the apex c, dA = u|a × b| du dw,
/// and (a × b)·v is the same for all its points v.
fn triangle_by_area(apex: &Vertex, a: &Vertex, b: &Vertex) -> f64 {
    let (c, rule) = (apex.from_p, gauss_legendre(ORDER));
    let (to_a, to_b) = (a.offset - apex.offset, b.offset - apex.offset);
    let mut sum = 0.0;
    for &(x, weight_x) in rule.iter() {
        let u = 0.5 * (1.0 + x);
        for &(y, weight_y) in rule.iter() {
            let w = 0.5 * (1.0 + y);
            let v = c + u * (to_a + w * (to_b - to_a));
            // A mean of the three heights: no cancellation where all are small.
            let z = (1.0 - u) * c.z + u * ((1.0 - w) * a.from_p.z + w * b.from_p.z);
            sum += 0.25 * weight_x * weight_y * u * z / v.length_squared().powi(2);
        }
    }
    -to_a.cross(to_b).dot(c) * sum
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // exact results are compared exactly
mod tests {
    use super::*;
    use crate::geometry::direction;
    use crate::radiometry::adaptive::Quadrature;

    /// ∫ (n·v)(−m·v)/|v|⁴ over the points v = corner + s a + t b, s, t ∈ [0, 1], with n·v > 0; s cut there exactly.
    fn by_quadrature(corner: DVec3, a: DVec3, b: DVec3, n: DVec3) -> (f64, f64) {
        let m = a.cross(b);
        let rule = Quadrature { relative: 1e-10, cells: 8, ..Quadrature::default() };
        let got = rule
            .rectangle((0.0, 1.0), (0.0, 1.0), |u, t| {
                let (start, slope) = (n.dot(corner + t * b), n.dot(a));
                let cut = (-start / slope).clamp(0.0, 1.0);
                let (from, to) = if slope > 0.0 { (cut, 1.0) } else { (0.0, cut) };
                let v = corner + (from + (to - from) * u) * a + t * b;
                (to - from) * n.dot(v) * -m.dot(v) / v.length_squared().powi(2)
            })
            .expect("finite");
        (got.value, got.error)
    }

    fn parallelogram(corner: DVec3, a: DVec3, b: DVec3) -> [DVec3; 4] {
        [corner, corner + a, corner + a + b, corner + b]
    }

    fn factor(vertices: &[DVec3], p: DVec3, n: DVec3) -> f64 {
        irradiance_from_polygon(vertices, Radiance::new(1.0), p, n).expect("lit or dark").value()
    }

    #[test]
    fn the_closed_form_is_the_area_integral_at_every_size_and_tilt() {
        for size in [3.0, 1.0, 0.3, 0.11, 0.09, 0.01, 1e-4] {
            for tilt in [0.0, 0.6, 1.2, 1.5, 1.62, 2.5] {
                let n = direction(tilt, 0.4);
                let (a, b) = (size * DVec3::new(-0.2, 1.0, 0.3), size * DVec3::new(1.0, 0.1, 0.2));
                let corner = DVec3::new(0.1, 0.2, 1.5) - 0.5 * (a + b);
                let closed = factor(&parallelogram(corner, a, b), DVec3::ZERO, n);
                let (value, error) = by_quadrature(corner, a, b, n);
                assert!(
                    (closed - value).abs() <= error + 1e-15,
                    "size {size} tilt {tilt}: {closed:e} {value:e} ± {error:e}"
                );
            }
        }
    }

    #[test]
    fn the_two_forms_agree_where_they_meet() {
        for tilt in [0.0, 0.7, 1.3, 1.55, 1.6] {
            let n = direction(tilt, 2.0);
            let (a, b) = (DVec3::new(0.0, 0.07, 0.02), DVec3::new(0.07, 0.0, 0.01));
            let square = parallelogram(DVec3::new(0.0, 0.0, 1.0) - 0.5 * (a + b), a, b);
            let visible = above_horizon(&local_vertices(&square, DVec3::ZERO, n).expect("finite"));
            let (edges, area) = (by_edges(&visible).expect("off the border"), by_area(&visible));
            assert!((edges - area).abs() <= 4e-16, "tilt {tilt}: {edges:e} {area:e}");
        }
    }

    #[test]
    fn tiny_polygons_tend_to_the_patch_with_all_digits() {
        // A square about a point q: odd terms of the expansion vanish, the next is O(size²).
        let q = DVec3::new(3.0, -1.0, 2.0);
        let (m, n) = (DVec3::new(-2.0, 1.0, -2.0) / 3.0, DVec3::new(2.0, -1.0, 2.0) / 3.0);
        let frame = Frame::from_normal(m);
        for size in [1e-3, 1e-6, 1e-8] {
            let (a, b) = (frame.tangent * size, frame.bitangent * size);
            let got = factor(&parallelogram(q - 0.5 * (a + b), a, b), DVec3::ZERO, n);
            let limit = size * size * n.dot(q) * -m.dot(q) / q.length_squared().powi(2);
            // Vertices near q are rounded to 2⁻⁵² of it: so is the side.
            let bound = size * size + 8.0 * f64::EPSILON * q.length() / size;
            assert!((got / limit - 1.0).abs() < bound, "size {size:e}: {got:e} {limit:e}");
        }
    }

    #[test]
    fn a_huge_polygon_fills_the_hemisphere_and_a_far_one_underflows_to_darkness() {
        let square = |side: f64, h: f64| {
            [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(side * x, side * y, h))
        };
        for side in [1e8, 1e100, 1e300, f64::MAX] {
            assert!((factor(&square(side, 1.0), DVec3::ZERO, DVec3::Z) / PI - 1.0).abs() < 1e-14, "side {side:e}");
            // Upright under half a plane of light.
            let half = factor(&square(side, 1.0), DVec3::ZERO, DVec3::X);
            assert!((half / (0.5 * PI) - 1.0).abs() < 1e-7, "side {side:e}: {half}");
        }
        assert_eq!(factor(&square(1.0, 1e200), DVec3::ZERO, DVec3::Z), 0.0);
    }

    #[test]
    fn a_polygon_that_touches_the_horizon_in_a_sliver_keeps_its_digits() {
        // A tiny square, half below the horizon: ∫ z dA over its upper half is size³/8, at distance 1, facing.
        for size in [1e-2, 1e-5, 1e-8] {
            let (a, b) = (DVec3::Z * size, DVec3::Y * size);
            let square = parallelogram(DVec3::X - 0.5 * (a + b), a, b);
            let got = factor(&square, DVec3::ZERO, DVec3::Z);
            let want = size.powi(3) / 8.0;
            assert!((got / want - 1.0).abs() < size * size + 1e-14, "size {size:e}: {got:e} {want:e}");
        }
    }

    #[test]
    fn parts_add_up_to_the_whole_and_notches_count() {
        // An L-shaped light and the two rectangles it consists of.
        let at = |x: f64, y: f64| DVec3::new(x, y, 1.0);
        let whole = [at(0.0, 0.0), at(0.0, 2.0), at(1.0, 2.0), at(1.0, 1.0), at(3.0, 1.0), at(3.0, 0.0)];
        let (one, two) = (
            [at(0.0, 0.0), at(0.0, 2.0), at(1.0, 2.0), at(1.0, 0.0)],
            [at(1.0, 0.0), at(1.0, 1.0), at(3.0, 1.0), at(3.0, 0.0)],
        );
        for i in 0..200 {
            let (p, n) = (direction(0.02 * f64::from(i), 1.0), direction(0.015 * f64::from(i), f64::from(i)));
            let p = p.with_z(p.z.min(0.99));
            let (sum, all) = (factor(&one, p, n) + factor(&two, p, n), factor(&whole, p, n));
            assert!((sum - all).abs() < 2e-14, "{i}: {sum} {all}");
        }
    }

    #[test]
    fn the_border_and_what_is_not_finite_give_none_and_no_area_gives_darkness() {
        let square = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
        let h = |vertices: &[DVec3], p, n| irradiance_from_polygon(vertices, Radiance::new(1.0), p, n);
        assert_eq!(h(&square, DVec3::new(1.0, 0.0, 1.0), DVec3::Z), None, "on an edge");
        assert_eq!(h(&square, DVec3::new(1.0, 1.0, 1.0), DVec3::Z), None, "on a vertex");
        assert_eq!(h(&square, DVec3::ZERO, DVec3::ZERO), None);
        assert_eq!(h(&square, DVec3::NAN, DVec3::Z), None);
        assert_eq!(h(&[DVec3::X, DVec3::Y, DVec3::INFINITY], DVec3::ZERO, DVec3::Z), None);
        assert_eq!(irradiance_from_polygon(&square, Radiance::new(f64::INFINITY), DVec3::ZERO, DVec3::Z), None);
        assert_eq!(h(&square[..2], DVec3::ZERO, DVec3::Z), Some(Irradiance::new(0.0)));
        assert_eq!(h(&square, DVec3::ZERO, -DVec3::Z), Some(Irradiance::new(0.0)), "below the horizon");
        assert_eq!(h(&square, DVec3::new(5.0, 0.0, 1.0), -DVec3::X), Some(Irradiance::new(0.0)), "edge-on");
        let line = [DVec3::new(0.0, 0.0, 1.0), DVec3::new(1.0, 0.0, 1.0), DVec3::new(2.0, 0.0, 1.0)];
        assert_eq!(h(&line, DVec3::ZERO, DVec3::Z), Some(Irradiance::new(0.0)), "no area");
    }
}
