//! Irradiance from point sources, extended sources and patches.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::adaptive::{Integral, Quadrature};
use super::flux::positive;
use super::quantity::{Area, Intensity, Irradiance, Length, Quantity, Radiance};
use crate::geometry::{Frame, direction};

/// Irradiance I/r² of a patch that faces a point source at distance r. `None` for r ≤ 0 or what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // The flux of a uniform source over the area of a sphere round it.
/// let (bulb, r) = (Flux::new(60.0), Length::new(2.0));
/// let sphere = r * r * (4.0 * std::f64::consts::PI);
/// let irradiance = irradiance_facing(uniform_intensity(bulb), r).unwrap();
/// assert!((irradiance / (bulb / sphere) - 1.0).abs() < 1e-15);
/// assert_eq!(irradiance_facing(uniform_intensity(bulb), Length::new(0.0)), None);
/// ```
#[must_use]
pub fn irradiance_facing(intensity: Intensity, distance: Length) -> Option<Irradiance> {
    irradiance_tilted(intensity, 1.0, distance)
}

/// Irradiance I cosθ/r² of a patch whose normal makes the angle θ with the direction to a point source; 0 where the source
/// is below its horizon. `None` for r ≤ 0 or what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // A lamp at height h over a plane sends half of its flux into it: ∫ I cosθ/r² · 2πs ds, cosθ = h/r, r² = h² + s².
/// let (intensity, h) = (Intensity::new(1.0), 0.7);
/// let plane = Quadrature::default().interval((0.0, std::f64::consts::FRAC_PI_2), |theta| {
///     let (s, r) = (h * theta.tan(), h / theta.cos());
///     let ds = h / theta.cos().powi(2);
///     irradiance_tilted(intensity, theta.cos(), Length::new(r)).unwrap().value() * std::f64::consts::TAU * s * ds
/// }).unwrap();
/// assert!((plane.value - (intensity * SolidAngle::HEMISPHERE).value()).abs() < 1e-12);
/// ```
#[must_use]
pub fn irradiance_tilted(intensity: Intensity, cos_theta: f64, distance: Length) -> Option<Irradiance> {
    let r = positive(distance.value())?;
    Irradiance::new(above_horizon(cos_theta) * (intensity.value() / r / r)).finite()
}

/// A point source at `position` (m) with the intensity that it sends along a unit direction away from itself.
#[derive(Debug, Clone, Copy)]
pub struct PointSource<F> {
    /// Where it is, m.
    pub position: DVec3,
    /// Direction (unit, away from the source) → intensity.
    pub intensity: F,
}

/// Irradiance `H(p) = Σ I_k · max(0, n·(e_k − p))/|e_k − p|³` of the point `p` (m) with normal `n` from point sources at `e_k`,
/// each of the intensity that it has along `p − e_k`. `n` need not be of unit length.
///
/// `None` when `p` is on a source, `n` is 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec3;
/// // Far sources on a ring, each at 60° from the normal: K I cos 60°/r².
/// let ring: Vec<_> = (0..7).map(|k| {
///     let position = 1e4 * goniofit::geometry::direction(std::f64::consts::FRAC_PI_3, f64::from(k));
///     PointSource { position, intensity: |_: DVec3| Intensity::new(1e8) }
/// }).collect();
/// let got = irradiance_at(DVec3::ZERO, DVec3::Z, &ring).unwrap();
/// assert!((got.value() - 7.0 * 0.5).abs() < 1e-14);
/// // Sources of different kinds share one slice by reference; one behind the patch adds nothing.
/// let (up, behind) = (|w: DVec3| Intensity::new(2.0 * w.z.abs()), |_: DVec3| Intensity::new(9.0));
/// let kinds: [PointSource<&dyn Fn(DVec3) -> Intensity>; 2] = [
///     PointSource { position: 2.0 * DVec3::Z, intensity: &up },
///     PointSource { position: -DVec3::Z, intensity: &behind },
/// ];
/// assert_eq!(irradiance_at(DVec3::ZERO, DVec3::Z, &kinds).unwrap(), Irradiance::new(0.5));
/// assert_eq!(irradiance_at(2.0 * DVec3::Z, DVec3::Z, &kinds), None);
/// ```
#[must_use]
pub fn irradiance_at<F: Fn(DVec3) -> Intensity>(p: DVec3, n: DVec3, sources: &[PointSource<F>]) -> Option<Irradiance> {
    let mut total = Irradiance::default();
    for source in sources {
        let (wi, distance) = towards(p, source.position)?;
        let cos_i = cosine(n, wi)?;
        total += irradiance_tilted((source.intensity)(-wi), cos_i, distance)?;
    }
    total.finite()
}

/// Irradiance ∫ L(wi) cosθi dω from a surrounding that sends the radiance L from the direction wi (unit, away from the
/// surface, world coordinates) onto a surface with normal `n`; only directions above its horizon count.
///
/// `None` when `n` is 0 or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec3;
/// // A sky of L = (wi·a)² gives π/4 (1 + (n·a)²): the second moment of the cosine-weighted hemisphere.
/// let (a, n) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(1.0, 2.0, 2.0) / 3.0);
/// let sky = |wi: DVec3| Radiance::new(wi.dot(a).powi(2));
/// let got = irradiance_from_extended(n, sky, &Quadrature::default()).unwrap();
/// let exact = 0.25 * std::f64::consts::PI * (1.0 + n.dot(a).powi(2));
/// assert!((got.value.value() - exact).abs() <= got.error.value() && got.converged, "{got:?} {exact}");
/// ```
#[must_use]
pub fn irradiance_from_extended(
    n: DVec3,
    radiance: impl Fn(DVec3) -> Radiance,
    quadrature: &Quadrature,
) -> Option<Integral<Irradiance>> {
    let frame = Frame::from_normal(unit(n)?);
    irradiance_spherical(|theta, phi| radiance(frame.to_world(direction(theta, phi))), quadrature)
}

/// The same in spherical coordinates of the surface's own frame: ∬ L(θ, φ) cosθ sinθ dθ dφ, θ ∈ [0, π/2], φ ∈ [0, 2π] rad.
/// ```
/// # use goniofit::radiometry::*;
/// // An even sky gives πL; a sky that is seen only within θ₀ of the zenith gives πL sin²θ₀, here by a jump.
/// let even = irradiance_spherical(|_, _| Radiance::new(3.0), &Quadrature::default()).unwrap();
/// assert!((even.value / (Radiance::new(3.0) * ProjectedSolidAngle::HEMISPHERE) - 1.0).abs() < 1e-14);
/// let rough = Quadrature { relative: 1e-4, ..Quadrature::default() };
/// let hole = |theta: f64, _| Radiance::new(if theta < 0.5 { 3.0 } else { 0.0 });
/// let got = irradiance_spherical(hole, &rough).unwrap();
/// let exact = irradiance_from_cone(Radiance::new(3.0), 0.5, 1.0).unwrap();
/// assert!((got.value - exact).value().abs() <= got.error.value() && got.converged);
/// ```
#[must_use]
pub fn irradiance_spherical(
    radiance: impl Fn(f64, f64) -> Radiance,
    quadrature: &Quadrature,
) -> Option<Integral<Irradiance>> {
    let integrand = |t: f64, p: f64| {
        let (sin_t, cos_t) = t.sin_cos();
        radiance(t, p).value() * cos_t * sin_t
    };
    quadrature.rectangle((0.0, FRAC_PI_2), (0.0, TAU), integrand).map(Integral::as_quantity)
}

/// Irradiance π L sin²σ cosθ from an even disc of sky of half-angle σ = `half_angle` (rad) whose centre stands at the angle θ
/// from the normal: a sphere of radius R at distance d has sinσ = R/d. The disc must be whole above the horizon.
///
/// `None` where it is not (θ + σ > π/2), or what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // Small discs: the tilted point source I = L · area.
/// let (sun, cos_theta) = (Radiance::new(2e7), 0.4);
/// let disc = irradiance_from_cone(sun, 0.00465, cos_theta).unwrap();
/// let point = sun * goniofit::radiometry::SolidAngle::new(goniofit::geometry::cap_solid_angle(0.00465)).projected(cos_theta);
/// assert!((disc / point - 1.0).abs() < 0.00465f64.powi(2));
/// assert_eq!(irradiance_from_cone(sun, 0.5, 0.4), None);
/// ```
#[must_use]
pub fn irradiance_from_cone(radiance: Radiance, half_angle: f64, cos_theta: f64) -> Option<Irradiance> {
    // θ + σ ≤ π/2 is cosθ ≥ sinσ.
    let sin_s = half_angle.sin();
    let whole = (0.0..=FRAC_PI_2).contains(&half_angle) && cos_theta >= sin_s && cos_theta <= 1.0;
    whole.then(|| Irradiance::new(radiance.value() * PI * sin_s * sin_s * cos_theta)).and_then(Quantity::finite)
}

/// A piece of surface, small against its distance from what it lights or is lit by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// Its centre, m.
    pub position: DVec3,
    /// Its normal, of any length but 0, on the side that counts.
    pub normal: DVec3,
    /// Its area.
    pub area: Area,
}

/// Irradiance `L · A_q cosθq cosθp/r²` that the patch `q`, of radiance L towards `p`, causes at the point `p` (m) with normal
/// `n`; 0 when either turns its back on the other. `None` when they coincide or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec3;
/// // Two patches exchange the same flux both ways, A_p H_p = A_q H_q.
/// let p = Patch { position: DVec3::ZERO, normal: DVec3::Z, area: Area::new(2e-4) };
/// let q = Patch { position: DVec3::new(1.0, 2.0, 3.0), normal: DVec3::new(0.0, -1.0, -2.0), area: Area::new(7e-4) };
/// let l = Radiance::new(5.0);
/// let forth = irradiance_from_patch(&q, l, p.position, p.normal).unwrap() * p.area;
/// let back = irradiance_from_patch(&p, l, q.position, q.normal).unwrap() * q.area;
/// assert!(forth.value() > 0.0 && (forth / back - 1.0).abs() < 1e-14);
/// // Rings of patches make up a disc of radius a at height h: π L a²/(a² + h²).
/// let (a, h) = (2.0, 0.5);
/// let disc: Irradiance = (0..4000).map(|i| {
///     let (s, ds) = (a * (f64::from(i) + 0.5) / 4000.0, a / 4000.0);
///     let area = Area::new(std::f64::consts::TAU * s * ds);
///     irradiance_from_patch(&Patch { position: DVec3::new(s, 0.0, h), normal: -DVec3::Z, area }, l, p.position, p.normal)
/// }).sum::<Option<_>>().unwrap();
/// let exact = 5.0 * std::f64::consts::PI * a * a / (a * a + h * h);
/// assert!((disc.value() / exact - 1.0).abs() < 1e-6); // midpoint rule: O((ds/h)²) = 10⁻⁶
/// ```
#[must_use]
pub fn irradiance_from_patch(q: &Patch, leaving: Radiance, p: DVec3, n: DVec3) -> Option<Irradiance> {
    let (wi, distance) = towards(p, q.position)?;
    let intensity = leaving * q.area * above_horizon(cosine(q.normal, -wi)?);
    irradiance_tilted(intensity, cosine(n, wi)?, distance)
}

/// Unit direction from `p` to `e` and the distance; `None` when they coincide or something is not finite. Scaled by the
/// largest component, so that no square under- or overflows.
pub(super) fn towards(p: DVec3, e: DVec3) -> Option<(DVec3, Length)> {
    let d = e - p;
    let scale = positive(d.abs().max_element()).filter(|_| d.is_finite())?;
    let scaled = d / scale;
    let length = scaled.length();
    Some((scaled / length, Length::new(scale * length).finite()?))
}

/// `v` at unit length; `None` when it is 0 or not finite.
pub(super) fn unit(v: DVec3) -> Option<DVec3> {
    towards(DVec3::ZERO, v).map(|(direction, _)| direction)
}

/// Cosine of the angle between the normal `n`, of any length, and the unit vector `w`.
pub(super) fn cosine(n: DVec3, w: DVec3) -> Option<f64> {
    Some(unit(n)?.dot(w))
}

/// max(0, cosθ) that keeps a NaN.
pub(super) fn above_horizon(cos_theta: f64) -> f64 {
    cos_theta.clamp(0.0, f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn irradiance_scales_with_the_inverse_square_at_every_scale() {
        let source = |r: f64| {
            [PointSource { position: r * DVec3::new(0.6, 0.0, 0.8), intensity: |_: DVec3| Intensity::new(1.0) }]
        };
        for exponent in [-150, -100, -9, 0, 9, 100, 150] {
            let r = 10f64.powi(exponent);
            let got = irradiance_at(DVec3::ZERO, DVec3::Z * 3.0, &source(r)).expect("lit").value();
            assert!((got * r * r / 0.8 - 1.0).abs() < 1e-14, "r {r:e}: {got:e}");
        }
        assert_eq!(irradiance_at(DVec3::ZERO, DVec3::Z, &source(1e-200)), None, "overflows");
        assert_eq!(irradiance_at(DVec3::ZERO, DVec3::Z, &source(1e200)), Some(Irradiance::new(0.0)), "underflows");
    }

    #[test]
    fn degenerate_and_infinite_input_gives_none() {
        let lamp = |position| [PointSource { position, intensity: |_: DVec3| Intensity::new(1.0) }];
        assert_eq!(irradiance_at(DVec3::X, DVec3::Z, &lamp(DVec3::X)), None);
        assert_eq!(irradiance_at(DVec3::X, DVec3::ZERO, &lamp(DVec3::Z)), None);
        assert_eq!(irradiance_at(DVec3::NAN, DVec3::Z, &lamp(DVec3::Z)), None);
        assert_eq!(irradiance_at(DVec3::ZERO, DVec3::Z, &lamp(DVec3::INFINITY)), None);
        assert_eq!(irradiance_tilted(Intensity::new(1.0), f64::NAN, Length::new(1.0)), None);
        assert_eq!(irradiance_facing(Intensity::new(f64::INFINITY), Length::new(1.0)), None);
        let sky = |_: DVec3| Radiance::new(f64::NAN);
        assert_eq!(irradiance_from_extended(DVec3::Z, sky, &Quadrature::default()), None);
    }

    #[test]
    fn a_disc_of_sky_is_the_integral_over_it() {
        // In the disc's own frame, θ from its centre: n·w = cosθ₀ cosθ + sinθ₀ sinθ cosφ.
        for (sigma, theta0) in [(0.3, 0.0), (0.3, 1.2), (1e-3, 1.5), (0.7, 0.8)] {
            let closed = irradiance_from_cone(Radiance::new(2.0), sigma, f64::cos(theta0)).expect("above the horizon");
            let n = direction(theta0, 0.0);
            let by_parts = Quadrature::default()
                .rectangle((0.0, sigma), (0.0, TAU), |t, p| 2.0 * n.dot(direction(t, p)) * t.sin())
                .expect("finite");
            assert!(
                (closed.value() - by_parts.value).abs() <= by_parts.error,
                "{sigma} {theta0}: {closed} {by_parts:?}"
            );
        }
    }

    #[test]
    fn vector_and_spherical_forms_agree_in_every_frame() {
        let sky = |w: DVec3| Radiance::new((1.5 * w.x - 0.3 * w.y + 0.2 * w.z).exp());
        for n in [DVec3::Z, -DVec3::Z, DVec3::X, DVec3::new(-1.0, 4.0, 0.1)] {
            let vector = irradiance_from_extended(n, sky, &Quadrature::default()).expect("finite");
            // Another frame round the same normal: turned by 1 rad.
            let frame = Frame::from_normal(n.normalize());
            let turned = |t, p: f64| sky(frame.to_world(direction(t, p + 1.0)));
            let spherical = irradiance_spherical(turned, &Quadrature::default()).expect("finite");
            let difference = (vector.value - spherical.value).value().abs();
            assert!(difference <= (vector.error + spherical.error).value(), "n {n}: {vector:?} {spherical:?}");
        }
    }
}
