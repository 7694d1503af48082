//! Flux, intensity and irradiance in the flat world.

use std::f64::consts::FRAC_PI_2;

use glam::DVec2;

use super::quantity::{Angle, Intensity, Irradiance, Radiance};
use crate::radiometry::adaptive::{Integral, Quadrature};
use crate::radiometry::flux::positive;
use crate::radiometry::irradiance::above_horizon;
use crate::radiometry::quantity::{Flux, Length, Quantity};

/// Intensity Φ/2π of a point source that sends the flux Φ evenly into all directions of the plane.
/// ```
/// # use goniofit::radiometry::*;
/// assert_eq!(flat::uniform_intensity(Flux::new(5.0)) * flat::Angle::CIRCLE, Flux::new(5.0));
/// ```
#[must_use]
pub fn uniform_intensity(total: Flux) -> Intensity {
    total / Angle::CIRCLE
}

/// Flux ωΦ/2π of a uniform source through an arc of the angle ω.
/// ```
/// # use goniofit::radiometry::*;
/// let bulb = Flux::new(60.0);
/// let arc = flat::flux_through_arc((-0.3, 1.1), |_| flat::uniform_intensity(bulb), &Quadrature::default()).unwrap();
/// assert!((flat::flux_uniform(bulb, flat::Angle::new(1.4)) / arc.value - 1.0).abs() < 1e-14);
/// ```
#[must_use]
pub fn flux_uniform(total: Flux, angle: Angle) -> Flux {
    total * (angle / Angle::CIRCLE)
}

/// Flux ∫ I(ω) dω of a source through the arc from `arc.0` to `arc.1` (rad). `None` when something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // I = I₀ cos²ω over a quarter turn: I₀ π/4.
/// let i = |omega: f64| flat::Intensity::new(8.0 * omega.cos().powi(2));
/// let flux = flat::flux_through_arc((0.0, std::f64::consts::FRAC_PI_2), i, &Quadrature::default()).unwrap();
/// assert!((flux.value.value() - 2.0 * std::f64::consts::PI).abs() <= flux.error.value() && flux.converged);
/// ```
#[must_use]
pub fn flux_through_arc(
    arc: (f64, f64),
    intensity: impl Fn(f64) -> Intensity,
    quadrature: &Quadrature,
) -> Option<Integral<Flux>> {
    quadrature.interval(arc, |omega| intensity(omega).value()).map(Integral::as_quantity)
}

/// Angle length/r of an arc of the circle of radius r, or of any patch that faces the eye and is small against r. `None` for
/// r ≤ 0 or what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// let r = Length::new(3.0);
/// let circle = flat::angle_facing(r * (2.0 * std::f64::consts::PI), r).unwrap();
/// assert!((circle / flat::Angle::CIRCLE - 1.0).abs() < 1e-15);
/// assert_eq!(flat::angle_facing(r, Length::new(0.0)), None);
/// ```
#[must_use]
pub fn angle_facing(length: Length, distance: Length) -> Option<Angle> {
    Angle::new(length / Length::new(positive(distance.value())?)).finite()
}

/// Irradiance I/r of a patch that faces a point source. `None` for r ≤ 0 or what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // The flux of a uniform source over the length of a circle round it.
/// let (bulb, r) = (Flux::new(60.0), Length::new(2.0));
/// let irradiance = flat::irradiance_facing(flat::uniform_intensity(bulb), r).unwrap();
/// assert!((irradiance / (bulb / (r * (2.0 * std::f64::consts::PI))) - 1.0).abs() < 1e-15);
/// ```
#[must_use]
pub fn irradiance_facing(intensity: Intensity, distance: Length) -> Option<Irradiance> {
    irradiance_tilted(intensity, 1.0, distance)
}

/// Irradiance I cosθ/r of a patch tilted by θ; 0 where the source is below its horizon. `None` for r ≤ 0 or what is not
/// finite.
/// ```
/// # use goniofit::radiometry::*;
/// // A lamp at height h over a line sends half of its flux into it: ∫ I cosθ/r dx, x = h tanθ, r = h/cosθ.
/// let (i, h) = (flat::Intensity::new(1.0), 0.7);
/// let half = std::f64::consts::FRAC_PI_2;
/// let line = Quadrature::default().interval((-half, half), |theta| {
///     let (r, dx) = (Length::new(h / theta.cos()), h / theta.cos().powi(2));
///     flat::irradiance_tilted(i, theta.cos(), r).unwrap().value() * dx
/// }).unwrap();
/// assert!((line.value - (i * flat::Angle::HALF_CIRCLE).value()).abs() < 1e-12);
/// ```
#[must_use]
pub fn irradiance_tilted(intensity: Intensity, cos_theta: f64, distance: Length) -> Option<Irradiance> {
    let r = positive(distance.value())?;
    Irradiance::new(above_horizon(cos_theta) * (intensity.value() / r)).finite()
}

/// A point source at `position` (m) with the intensity that it sends along a unit direction away from itself.
#[derive(Debug, Clone, Copy)]
pub struct PointSource<F> {
    /// Where it is, m.
    pub position: DVec2,
    /// Direction (unit, away from the source) → intensity.
    pub intensity: F,
}

/// Irradiance `H(p) = Σ I_k · max(0, n·(e_k − p))/|e_k − p|²` of the point `p` (m) with normal `n`, of any length, from point
/// sources at `e_k`. `None` when `p` is on a source, `n` is 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec2;
/// // A row of K lamps of I = L dx cosθ over the line y = h is a lit segment: 2 L sinθ_max.
/// let (k, h, half) = (20_000, 0.5, 2.0);
/// let dx = 2.0 * half / f64::from(k);
/// let lamps: Vec<_> = (0..k).map(|i| flat::PointSource {
///     position: DVec2::new(dx * (f64::from(i) + 0.5) - half, h),
///     intensity: move |w: DVec2| flat::Intensity::new(3.0 * dx * -w.y),
/// }).collect();
/// let got = flat::irradiance_at(DVec2::ZERO, DVec2::Y, &lamps).unwrap();
/// assert!((got.value() / (2.0 * 3.0 * half / half.hypot(h)) - 1.0).abs() < 1e-7); // midpoint rule, (dx/h)²/24
/// ```
#[must_use]
pub fn irradiance_at<F: Fn(DVec2) -> Intensity>(p: DVec2, n: DVec2, sources: &[PointSource<F>]) -> Option<Irradiance> {
    let normal = unit(n)?;
    let mut total = Irradiance::default();
    for source in sources {
        let (wi, distance) = towards(p, source.position)?;
        total += irradiance_tilted((source.intensity)(-wi), normal.dot(wi), distance)?;
    }
    total.finite()
}

/// Irradiance ∫ L(θ) cosθ dθ, θ ∈ [−π/2, π/2] rad from the normal, from an extended source. `None` when a value of L is not
/// finite.
/// ```
/// # use goniofit::radiometry::*;
/// // An even surrounding gives 2L; L = cosθ gives π/2.
/// let even = flat::irradiance_from_extended(|_| flat::Radiance::new(3.0), &Quadrature::default()).unwrap();
/// assert!((even.value.value() - 6.0).abs() <= even.error.value() && even.converged);
/// let cosine = flat::irradiance_from_extended(|t| flat::Radiance::new(t.cos()), &Quadrature::default()).unwrap();
/// assert!((cosine.value.value() - std::f64::consts::FRAC_PI_2).abs() <= cosine.error.value());
/// ```
#[must_use]
pub fn irradiance_from_extended(
    radiance: impl Fn(f64) -> Radiance,
    quadrature: &Quadrature,
) -> Option<Integral<Irradiance>> {
    over_half_circle(|theta| radiance(theta).value(), quadrature).map(Integral::as_quantity)
}

/// Irradiance at the point `p` (m) with normal `n` from the segment `a`–`b` (m) of even radiance L: L (sinθ₂ − sinθ₁), the flat
/// polygon. It shines to its left, going from `a` to `b`; what lies below the horizon is cut off. A difference of sines
/// as a product, so that a small segment keeps its digits.
///
/// 0 from its back, or when seen end-on. `None` when `p` is on the segment, `n` is 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec2;
/// let l = flat::Radiance::new(3.0);
/// let (a, b) = (DVec2::new(2.0, 0.5), DVec2::new(-1.0, 1.5));
/// let got = flat::irradiance_from_segment(a, b, l, DVec2::ZERO, DVec2::Y).unwrap();
/// // The sum of its patches: ∫ L cosθ cosθ'/r ds.
/// let (along, left) = (b - a, (b - a).perp());
/// let patches = Quadrature::default().interval((0.0, 1.0), |s| {
///     let v = a + s * along;
///     3.0 * v.y * -left.dot(v) / v.length_squared().powf(1.5)
/// }).unwrap();
/// assert!((patches.value - got.value()).abs() <= patches.error && patches.converged);
/// assert_eq!(flat::irradiance_from_segment(b, a, l, DVec2::ZERO, DVec2::Y).unwrap().value(), 0.0);
/// ```
#[must_use]
pub fn irradiance_from_segment(a: DVec2, b: DVec2, radiance: Radiance, p: DVec2, n: DVec2) -> Option<Irradiance> {
    let normal = unit(n)?;
    if !(a.is_finite() && b.is_finite() && p.is_finite()) {
        return None;
    }
    let scale = positive((0.5 * a - 0.5 * p).abs().max((0.5 * b - 0.5 * p).abs()).max_element())?;
    let local = |v: DVec2| DVec2::new(v.perp_dot(normal), v.dot(normal));
    let difference = |to: DVec2, from: DVec2| local((0.5 * to - 0.5 * from) / scale);
    let (start, along) = (difference(a, p), difference(b, a));
    let Some((start, along)) = cut_at_horizon(start, along) else { return Some(Irradiance::default()) };
    let end = start + along;
    let (cross, dot) = (start.perp_dot(along), start.dot(end));
    if cross == 0.0 && dot <= 0.0 {
        return None;
    }
    let factor = sine_difference(unit(start)?, unit(end)?, cross.atan2(dot));
    Irradiance::new(radiance.value() * factor.clamp(0.0, 2.0)).finite()
}

/// sinθ of `from` less sinθ of `to`, unit vectors `opening` apart. Where they are close, as
/// 2 cos((θ₁ + θ₂)/2) sin(opening/2), the middle angle being that of the sum of the vectors.
fn sine_difference(from: DVec2, to: DVec2, opening: f64) -> f64 {
    if opening.abs() > 1.0 {
        return from.x - to.x;
    }
    2.0 * (from + to).normalize().y * (0.5 * opening).sin()
}

/// The part of a segment (start, along) with y ≥ 0; `None` when there is none.
fn cut_at_horizon(start: DVec2, along: DVec2) -> Option<(DVec2, DVec2)> {
    let end = start + along;
    let t = start.y / (start.y - end.y);
    match (start.y >= 0.0, end.y >= 0.0) {
        (false, false) => None,
        (true, false) => Some((start, (along * t).with_y(-start.y))),
        (false, true) => Some(((start + along * t).with_y(0.0), (along * (1.0 - t)).with_y(end.y))),
        _ => Some((start, along)),
    }
}

/// A piece of a curve, small against its distance from what it lights or is lit by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// Its middle, m.
    pub position: DVec2,
    /// Its normal, of any length but 0, on the side that counts.
    pub normal: DVec2,
    /// Its length.
    pub length: Length,
}

/// Irradiance L · s cosθq cosθp/r that the patch `q` of length s and radiance L towards `p` causes at the point `p` with normal
/// `n`; 0 when either turns its back. `None` when they coincide or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec2;
/// // The limit of a short segment.
/// let (q, m) = (DVec2::new(1.0, 2.0), DVec2::new(0.6, -0.8));
/// let l = flat::Radiance::new(2.0);
/// for size in [1e-2, 1e-4] {
///     let along = m.perp() * (-0.5 * size); // the left of the way from a to b is m
///     let segment = flat::irradiance_from_segment(q - along, q + along, l, DVec2::ZERO, DVec2::Y).unwrap();
///     let patch = flat::Patch { position: q, normal: m, length: Length::new(size) };
///     let small = flat::irradiance_from_patch(&patch, l, DVec2::ZERO, DVec2::Y).unwrap();
///     assert!((segment / small - 1.0).abs() < size * size, "{segment} {small}");
/// }
/// ```
#[must_use]
pub fn irradiance_from_patch(q: &Patch, leaving: Radiance, p: DVec2, n: DVec2) -> Option<Irradiance> {
    let (wi, distance) = towards(p, q.position)?;
    let intensity = leaving * q.length * above_horizon(unit(q.normal)?.dot(-wi));
    irradiance_tilted(intensity, unit(n)?.dot(wi), distance)
}

/// ∫ f(θ) cosθ dθ over the half circle.
pub(super) fn over_half_circle(f: impl Fn(f64) -> f64, quadrature: &Quadrature) -> Option<Integral<f64>> {
    quadrature.interval((-FRAC_PI_2, FRAC_PI_2), |theta| f(theta) * above_horizon(theta.cos()))
}

/// Unit direction from `p` to `e` and the distance; `None` when they coincide or something is not finite.
pub(super) fn towards(p: DVec2, e: DVec2) -> Option<(DVec2, Length)> {
    let d = e - p;
    let scale = positive(d.abs().max_element()).filter(|_| d.is_finite())?;
    let scaled = d / scale;
    let length = scaled.length();
    Some((scaled / length, Length::new(scale * length).finite()?))
}

/// `v` at unit length; `None` when it is 0 or not finite.
pub(super) fn unit(v: DVec2) -> Option<DVec2> {
    towards(DVec2::ZERO, v).map(|(direction, _)| direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_is_the_integral_over_its_angles_at_every_size_and_tilt() {
        let rule = Quadrature { relative: 1e-11, ..Quadrature::default() };
        for size in [1e3, 3.0, 0.5, 1e-3, 1e-9] {
            for tilt in [-1.6, -1.0, 0.0, 0.5, 1.5, 1.7] {
                let n = DVec2::new(f64::sin(tilt), f64::cos(tilt));
                let (a, b) = (DVec2::new(0.5 * size, 1.0), DVec2::new(-0.5 * size, 1.0));
                let got = irradiance_from_segment(a, b, Radiance::new(1.0), DVec2::ZERO, n).expect("off the segment");
                // Seen angles −θm … θm from +y; the normal stands at `tilt`. Cut the horizon by hand.
                let edge = f64::atan(0.5 * size);
                let (from, to) = ((-edge).max(tilt - FRAC_PI_2), edge.min(tilt + FRAC_PI_2));
                let want = rule.interval((from, to.max(from)), |theta| (theta - tilt).cos()).expect("finite");
                let bound = want.error + 4e-16 * want.value.abs().max(0.1 * edge);
                assert!((got.value() - want.value).abs() <= bound, "size {size:e} tilt {tilt}: {got} {want:?}");
            }
        }
    }

    #[test]
    fn degenerate_and_infinite_input_gives_none() {
        let lamp = [PointSource { position: DVec2::X, intensity: |_: DVec2| Intensity::new(1.0) }];
        assert_eq!(irradiance_at(DVec2::X, DVec2::Y, &lamp), None);
        assert_eq!(irradiance_at(DVec2::ZERO, DVec2::ZERO, &lamp), None);
        assert_eq!(irradiance_at(DVec2::NAN, DVec2::Y, &lamp), None);
        let segment = |p| irradiance_from_segment(DVec2::X, -DVec2::X, Radiance::new(1.0), p, DVec2::Y);
        assert_eq!(segment(DVec2::ZERO), None, "inside");
        assert_eq!(segment(DVec2::X), None, "at an end");
        assert_eq!(segment(2.0 * DVec2::X), Some(Irradiance::new(0.0)), "end-on");
        assert_eq!(segment(DVec2::new(f64::NAN, 0.0)), None);
        assert_eq!(segment(DVec2::new(0.0, -1.0)).map(|h| (h.value() - 2f64.sqrt()).abs() < 1e-15), Some(true));
    }
}
