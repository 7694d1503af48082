//! Radiant energy, flux and intensity, and the solid angles they are spread over.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::adaptive::{Integral, Quadrature};
use super::quantity::{Area, Energy, Flux, Intensity, Length, Quantity, SolidAngle};
use crate::geometry::direction;
use crate::geometry::grid::cos_difference;

/// Energy of one photon of wavelength λ, hc/λ with the exact constants of the SI (2019). `None` unless λ > 0 and finite.
/// ```
/// # use goniofit::radiometry::*;
/// let green = photon_energy(Length::new(500e-9)).unwrap();
/// assert!((green / Energy::new(4e-19) - 1.0).abs() < 0.01);
/// // 1 eV is the photon of 1239.841 984 nm.
/// let volt = photon_energy(Length::new(1.239_841_984_332_e-6)).unwrap();
/// assert!((volt / Energy::new(1.602_176_634e-19) - 1.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn photon_energy(wavelength: Length) -> Option<Energy> {
    const PLANCK_TIMES_LIGHT: f64 = 6.626_070_15e-34 * 299_792_458.0; // J·m
    positive(wavelength.value()).and_then(|lambda| Energy::new(PLANCK_TIMES_LIGHT / lambda).finite())
}

/// Intensity Φ/4π of a point source that sends the flux Φ evenly into all directions.
/// ```
/// # use goniofit::radiometry::*;
/// let total = uniform_intensity(Flux::new(5.0)) * SolidAngle::SPHERE;
/// assert!((total.value() - 5.0).abs() < 1e-14);
/// ```
#[must_use]
pub fn uniform_intensity(total: Flux) -> Intensity {
    total / SolidAngle::SPHERE
}

/// Flux ωΦ/4π of a uniform source through a set of directions of solid angle ω.
/// ```
/// # use goniofit::radiometry::*;
/// let (bulb, cap) = (Flux::new(60.0), (0.3, 0.8));
/// // Against the integral of the intensity over the ring between two polar angles.
/// let ring = flux_through(cap, |_| (0.0, std::f64::consts::TAU), |_, _| uniform_intensity(bulb), &Quadrature::default());
/// let omega = solid_angle_of_rectangle(cap, (0.0, std::f64::consts::TAU));
/// assert!((flux_uniform(bulb, omega) / ring.unwrap().value - 1.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn flux_uniform(total: Flux, omega: SolidAngle) -> Flux {
    total * (omega / SolidAngle::SPHERE)
}

/// Solid angle area/r² of a patch on the sphere of radius r, or of any patch that faces the eye and is small against r.
/// `None` for r = 0 or input that is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// let r = Length::new(3.0);
/// let sphere = r * r * (4.0 * std::f64::consts::PI);
/// assert!((solid_angle_facing(sphere, r).unwrap() / SolidAngle::SPHERE - 1.0).abs() < 1e-15);
/// // A flat disc of radius a at distance r ≫ a: the exact cap 4π sin²(θ/2), tanθ = a/r, differs by ¾ (a/r)².
/// let a = 1e-3;
/// let disc = solid_angle_facing(Area::new(std::f64::consts::PI * a * a), Length::new(1.0)).unwrap();
/// let exact = goniofit::geometry::cap_solid_angle(f64::atan(a));
/// assert!((disc.value() / exact - 1.0 - 0.75 * a * a).abs() < 1e-11);
/// assert_eq!(solid_angle_facing(sphere, Length::new(0.0)), None);
/// ```
#[must_use]
pub fn solid_angle_facing(area: Area, distance: Length) -> Option<SolidAngle> {
    let r = positive(distance.value())?;
    SolidAngle::new(area.value() / r / r).finite()
}

/// The element of solid angle dω = sinθ dθ dφ (all in rad) at polar angle θ.
/// ```
/// # use goniofit::radiometry::*;
/// use std::f64::consts::{PI, TAU};
/// let ring = |i: f64| solid_angle_element(PI * (i + 0.5) / 1000.0, PI / 1000.0, TAU);
/// let sphere: SolidAngle = (0..1000).map(|i| ring(f64::from(i))).sum();
/// // The midpoint rule of 1000 steps is off by (π/1000)²/24.
/// assert!((sphere / SolidAngle::SPHERE - 1.0).abs() < 4.2e-7);
/// ```
#[must_use]
pub fn solid_angle_element(theta: f64, d_theta: f64, d_phi: f64) -> SolidAngle {
    SolidAngle::new(theta.sin() * d_theta * d_phi)
}

/// Solid angle of θ ∈ [theta.0, theta.1], φ ∈ [phi.0, phi.1] (rad): (cosθ₀ − cosθ₁)·Δφ, without cancellation.
/// ```
/// # use goniofit::radiometry::*;
/// use std::f64::consts::{PI, TAU};
/// assert_eq!(solid_angle_of_rectangle((0.0, PI), (0.0, TAU)), SolidAngle::SPHERE);
/// let (theta, d) = (0.7, 1e-9);
/// let patch = solid_angle_of_rectangle((theta, theta + d), (0.0, d));
/// assert!((patch / solid_angle_element(theta + 0.5 * d, d, d) - 1.0).abs() < 1e-6); // (θ + d) − θ has 7 digits of d
/// ```
#[must_use]
pub fn solid_angle_of_rectangle(theta: (f64, f64), phi: (f64, f64)) -> SolidAngle {
    SolidAngle::new(cos_difference(theta.0, theta.1) * (phi.1 - phi.0))
}

/// Flux ∬ I(θ, φ) sinθ dθ dφ through the patch of directions θ ∈ [theta.0, theta.1], φ between the two bounds that `phi`
/// gives for θ (rad). Bounds that are smooth in θ keep the quadrature fast. `None` when something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use std::f64::consts::{FRAC_PI_2, PI};
/// // The octant triangle x, y, z > 0 of a source I = I₀ (w·x̂)²: a third of an eighth of 4π.
/// let octant = flux_through(
///     (0.0, FRAC_PI_2),
///     |_| (0.0, FRAC_PI_2),
///     |theta, phi| Intensity::new((theta.sin() * phi.cos()).powi(2)),
///     &Quadrature::default(),
/// ).unwrap();
/// assert!((octant.value.value() - PI / 6.0).abs() <= octant.error.value() && octant.converged);
/// // A patch cut off by the great circle tanθ cosφ = 1, a lune of 45° cut at the equator: 2·(45° in rad).
/// let lune = flux_through(
///     (0.25 * PI, FRAC_PI_2),
///     |theta| (-(1.0 / theta.tan()).acos(), (1.0 / theta.tan()).acos()),
///     |_, _| Intensity::new(1.0),
///     &Quadrature::default(),
/// ).unwrap();
/// assert!((lune.value.value() - 0.5 * PI).abs() <= lune.error.value() && lune.converged);
/// ```
#[must_use]
pub fn flux_through(
    theta: (f64, f64),
    phi: impl Fn(f64) -> (f64, f64),
    intensity: impl Fn(f64, f64) -> Intensity,
    quadrature: &Quadrature,
) -> Option<Integral<Flux>> {
    let integrand = |t: f64, u: f64| {
        let (from, to) = phi(t);
        (to - from) * t.sin() * intensity(t, from + (to - from) * u).value()
    };
    quadrature.rectangle(theta, (0.0, 1.0), integrand).map(Integral::as_quantity)
}

/// Flux ∫ I(w) dω that a source sends into all directions.
/// ```
/// # use goniofit::radiometry::*;
/// let spot = |w: glam::DVec3| Intensity::new(w.z.max(0.0).powi(3));
/// let flux = total_flux(spot, &Quadrature::default()).unwrap();
/// assert!((flux.value.value() - 2.0 * std::f64::consts::PI / 4.0).abs() <= flux.error.value());
/// ```
#[must_use]
pub fn total_flux(intensity: impl Fn(DVec3) -> Intensity, quadrature: &Quadrature) -> Option<Integral<Flux>> {
    flux_through((0.0, PI), |_| (0.0, TAU), |t, p| intensity(direction(t, p)), quadrature)
}

/// `x` if it is positive and finite.
pub(super) fn positive(x: f64) -> Option<f64> {
    (x > 0.0 && x.is_finite()).then_some(x)
}
