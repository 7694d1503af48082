//! What leaves a surface: radiance and exitance, through a BRDF, under point and extended sources, from patch to patch.
//!
//! A BRDF is a closure of unit directions (wi, wo) in the local frame of the surface (normal +z), both away from it.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, TAU};

use glam::DVec3;

use super::adaptive::{Integral, Quadrature};
use super::flux::positive;
use super::irradiance::{Patch, above_horizon, irradiance_from_patch, irradiance_tilted, towards, unit};
use super::quantity::{
    Area, BrdfValue, Exitance, Intensity, Irradiance, Length, ProjectedSolidAngle, Quantity, Radiance, SolidAngle,
};
use crate::geometry::{Frame, direction};

/// Radiance I/(A cosθ₀) of a small patch of area A that sends the intensity I at the angle θ₀ from its normal: per area as
/// seen, hence the 1/cosθ₀. `None` when it is seen edge-on or from behind, A ≤ 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // The intensity of an even patch falls with the cosine: its radiance does not change.
/// let (l, a) = (Radiance::new(3.0), Area::new(1e-4));
/// for cos_o in [1.0, 0.5, 1e-3] {
///     let seen = radiance_of_patch(intensity_of_patch(l, a, cos_o), a, cos_o).unwrap();
///     assert!((seen / l - 1.0).abs() < 1e-15);
/// }
/// assert_eq!(radiance_of_patch(Intensity::new(1.0), a, 0.0), None);
/// ```
#[must_use]
pub fn radiance_of_patch(intensity: Intensity, area: Area, cos_o: f64) -> Option<Radiance> {
    let seen = area * positive(cos_o)?;
    positive(seen.value()).and_then(|_| (intensity / seen).finite())
}

/// Intensity L A cosθ₀ of a small patch of area A and radiance L at the angle θ₀ from its normal; 0 below its horizon.
/// ```
/// # use goniofit::radiometry::*;
/// // Over all directions it sends exitance × area.
/// let (l, a) = (Radiance::new(3.0), Area::new(1e-4));
/// let flux = total_flux(|w| intensity_of_patch(l, a, w.z), &Quadrature::default()).unwrap();
/// assert!((flux.value / (lambertian_exitance(l) * a) - 1.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn intensity_of_patch(radiance: Radiance, area: Area, cos_o: f64) -> Intensity {
    radiance * area * above_horizon(cos_o)
}

/// Radiant exitance ∫ L(wo) cosθo dωo of a surface that sends the radiance L along wo (local frame). `None` when a value of
/// L is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // L = cos²θ: 2π ∫ cos³θ sinθ dθ = π/2.
/// let e = exitance(|wo| Radiance::new(wo.z * wo.z), &Quadrature::default()).unwrap();
/// assert!((e.value.value() - std::f64::consts::FRAC_PI_2).abs() <= e.error.value() && e.converged);
/// ```
#[must_use]
pub fn exitance(radiance: impl Fn(DVec3) -> Radiance, quadrature: &Quadrature) -> Option<Integral<Exitance>> {
    over_hemisphere(|w| radiance(w).value(), quadrature).map(Integral::as_quantity)
}

/// Radiant exitance πL of a Lambertian surface, whose radiance L is the same in all directions.
/// ```
/// # use goniofit::radiometry::*;
/// let l = Radiance::new(2.0);
/// let by_integral = exitance(|_| l, &Quadrature::default()).unwrap();
/// assert!((lambertian_exitance(l) - by_integral.value).value().abs() <= by_integral.error.value());
/// ```
#[must_use]
pub fn lambertian_exitance(radiance: Radiance) -> Exitance {
    Exitance::new((radiance * ProjectedSolidAngle::HEMISPHERE).value())
}

/// Example 1: radiance ρ I cosθi/r² under one point source at distance r and angle θi. `None` for r ≤ 0 or what is not
/// finite.
/// ```
/// # use goniofit::radiometry::*;
/// // The limit of example 2 for an ever smaller bright disc of sky: L ω = I/r².
/// let (rho, i, r) = (BrdfValue::new(0.7), Intensity::new(4.0), Length::new(2.0));
/// let point = radiance_from_point(rho, i, 0.6, r).unwrap();
/// for sigma in [1e-2, 1e-3, 1e-4] {
///     let sky = irradiance_facing(i, r).unwrap() / SolidAngle::new(goniofit::geometry::cap_solid_angle(sigma)).projected(1.0);
///     let disc = rho * irradiance_from_cone(sky, sigma, 0.6).unwrap();
///     assert!((disc / point - 1.0).abs() < sigma * sigma);
/// }
/// assert_eq!(radiance_from_point(rho, i, 0.6, Length::new(0.0)), None);
/// ```
#[must_use]
pub fn radiance_from_point(rho: BrdfValue, intensity: Intensity, cos_i: f64, distance: Length) -> Option<Radiance> {
    (rho * irradiance_tilted(intensity, cos_i, distance)?).finite()
}

/// Example 2: radiance `∫ ρ(wi, wo) L_in(wi) cosθi dωi` along wo under an extended source, in the local frame. `None` when a
/// value is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec3;
/// // ρ = (wi·wo)² under an even sky: π/4 (1 + cos²θo), by the second moment of the cosine-weighted hemisphere.
/// let rho = |wi: DVec3, wo: DVec3| BrdfValue::new(wi.dot(wo).powi(2));
/// let wo = goniofit::geometry::direction(0.9, 2.0);
/// let l = radiance_from_extended(rho, wo, |_| Radiance::new(1.0), &Quadrature::default()).unwrap();
/// let exact = 0.25 * std::f64::consts::PI * (1.0 + wo.z * wo.z);
/// assert!((l.value.value() - exact).abs() <= l.error.value() && l.converged);
/// ```
#[must_use]
pub fn radiance_from_extended(
    rho: impl Fn(DVec3, DVec3) -> BrdfValue,
    wo: DVec3,
    incoming: impl Fn(DVec3) -> Radiance,
    quadrature: &Quadrature,
) -> Option<Integral<Radiance>> {
    let integrand = |wi: DVec3| rho(wi, wo).value() * incoming(wi).value();
    over_hemisphere(integrand, quadrature).map(Integral::as_quantity)
}

/// Example 3: the diffuse BRDF, albedo/π. It is the constant that makes the flux that leaves `albedo` times the flux that
/// arrives: energy is conserved up to albedo 1.
/// ```
/// # use goniofit::radiometry::*;
/// let arriving = Irradiance::new(8.0);
/// for albedo in [0.0, 0.3, 1.0] {
///     let leaving = exitance(|_| diffuse_brdf(albedo) * arriving, &Quadrature::default()).unwrap();
///     assert!((leaving.value / arriving - albedo).abs() <= leaving.error.value() / 8.0);
/// }
/// ```
#[must_use]
pub fn diffuse_brdf(albedo: f64) -> BrdfValue {
    BrdfValue::new(albedo * FRAC_1_PI)
}

/// Example 4: radiance `(albedo/π) ∫ L_in cosθi dωi` of a diffuse surface under an extended source (local frame), the same in
/// all directions. `None` when a value is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // A white surface under an even sky is as bright as the sky.
/// let l = diffuse_radiance_extended(1.0, |_| Radiance::new(5.0), &Quadrature::default()).unwrap();
/// assert!((l.value.value() - 5.0).abs() <= l.error.value());
/// ```
#[must_use]
pub fn diffuse_radiance_extended(
    albedo: f64,
    incoming: impl Fn(DVec3) -> Radiance,
    quadrature: &Quadrature,
) -> Option<Integral<Radiance>> {
    if !albedo.is_finite() {
        return None;
    }
    let arriving = over_hemisphere(|wi| incoming(wi).value(), quadrature)?;
    Some(arriving.as_quantity::<Radiance>().scaled(diffuse_brdf(albedo).value()))
}

/// Example 5: radiance (albedo/π) I cosθi/r² of a diffuse surface under a point source. `None` for r ≤ 0 or what is not
/// finite.
/// ```
/// # use goniofit::radiometry::*;
/// let (i, r) = (Intensity::new(4.0), Length::new(2.0));
/// let l = diffuse_radiance_point(0.5, i, 0.6, r).unwrap();
/// // What leaves is half of what arrives.
/// assert!((lambertian_exitance(l) / irradiance_tilted(i, 0.6, r).unwrap() - 0.5).abs() < 1e-15);
/// ```
#[must_use]
pub fn diffuse_radiance_point(albedo: f64, intensity: Intensity, cos_i: f64, distance: Length) -> Option<Radiance> {
    radiance_from_point(diffuse_brdf(albedo), intensity, cos_i, distance)
}

/// Example 5 for a source so far away that r is the same everywhere: the 1/r² goes into the strength, which is then the
/// irradiance `facing` of a patch that faces the source. `None` for what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// let (i, r) = (Intensity::new(1e25), Length::new(1.5e11));
/// let far = diffuse_radiance_distant(0.5, irradiance_facing(i, r).unwrap(), 0.6).unwrap();
/// assert!((far / diffuse_radiance_point(0.5, i, 0.6, r).unwrap() - 1.0).abs() < 1e-15);
/// ```
#[must_use]
pub fn diffuse_radiance_distant(albedo: f64, facing: Irradiance, cos_i: f64) -> Option<Radiance> {
    (diffuse_brdf(albedo) * (facing * above_horizon(cos_i))).finite()
}

/// One step of the light-transport cycle: radiance that leaves `q` → irradiance at `p` → radiance that leaves `p` along `wo`.
///
/// `leaving_q` is the radiance of `q` along a unit world direction away from it; `rho` the BRDF of `p` in the frame
/// [`Frame::from_normal`] of its normal; `wo` a world direction away from `p`. 0 where `wo` is below the horizon of `p`, or
/// the patches turn away. `None` when they coincide, a normal or `wo` is 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec3;
/// // Inside a white sphere of even radiance L every patch gets πL from all the others, and so sends L back: (A cosθ cosθ')/r²
/// // is A/4R² for any two points of a sphere.
/// let (l, n) = (Radiance::new(2.0), 40_000);
/// let area = Area::new(4.0 * std::f64::consts::PI / f64::from(n));
/// let p = Patch { position: -DVec3::Z, normal: DVec3::Z, area };
/// let sum: Radiance = (0..n).map(|k| {
///     let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(n);
///     let at = goniofit::geometry::direction(z.acos(), 2.399_963 * f64::from(k));
///     let q = Patch { position: at, normal: -at, area };
///     transport_step(&q, |_| l, &p, |_, _| diffuse_brdf(1.0), DVec3::new(0.6, 0.0, 0.8)).unwrap()
/// }).sum();
/// assert!((sum / l - 1.0).abs() < 1e-11);
/// ```
#[must_use]
pub fn transport_step(
    q: &Patch,
    leaving_q: impl Fn(DVec3) -> Radiance,
    p: &Patch,
    rho: impl Fn(DVec3, DVec3) -> BrdfValue,
    wo: DVec3,
) -> Option<Radiance> {
    let frame = Frame::from_normal(unit(p.normal)?);
    let (wi, _) = towards(p.position, q.position)?;
    let arriving = irradiance_from_patch(q, leaving_q(-wi), p.position, p.normal)?;
    let (local_wi, local_wo) = (frame.to_local(wi), frame.to_local(unit(wo)?));
    if local_wi.z <= 0.0 || local_wo.z <= 0.0 {
        return Some(Radiance::default());
    }
    (rho(local_wi, local_wo) * arriving).finite()
}

/// ∫ f(w) cosθ dω over the upper hemisphere of the local frame.
fn over_hemisphere(f: impl Fn(DVec3) -> f64, quadrature: &Quadrature) -> Option<Integral<f64>> {
    let integrand = |t: f64, p: f64| {
        let w = direction(t, p);
        f(w) * SolidAngle::new(t.sin()).projected(w.z).value()
    };
    quadrature.rectangle((0.0, FRAC_PI_2), (0.0, TAU), integrand)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reciprocal_brdf_carries_light_the_same_both_ways() {
        // From q over p towards a receiver: exchanging source and receiver leaves radiance × geometry as it was.
        let rho = |wi: DVec3, wo: DVec3| BrdfValue::new(0.2 + (wi - wo).length_squared().exp() * (wi.z + wo.z));
        let p = Patch { position: DVec3::ZERO, normal: DVec3::new(0.2, -0.4, 2.0), area: Area::new(1e-3) };
        let (a, b) = (DVec3::new(1.0, 0.5, 1.0), DVec3::new(-0.7, 1.1, 2.0));
        let at = |position: DVec3| Patch { position, normal: -position, area: Area::new(1e-3) };
        let over = |from: DVec3, to: DVec3| {
            let radiance = transport_step(&at(from), |_| Radiance::new(1.0), &p, rho, to).expect("lit");
            irradiance_from_patch(&p, radiance, to, -to).expect("lit").value()
        };
        assert!(over(a, b) > 0.0 && (over(a, b) / over(b, a) - 1.0).abs() < 1e-14, "{} {}", over(a, b), over(b, a));
    }

    #[test]
    fn light_does_not_pass_below_the_horizon_and_nan_does_not_pass_at_all() {
        let p = Patch { position: DVec3::ZERO, normal: DVec3::Z, area: Area::new(1.0) };
        let q = Patch { position: DVec3::new(0.0, 1.0, 1.0), normal: -DVec3::Z, area: Area::new(1.0) };
        let step =
            |q: &Patch, p: &Patch, wo| transport_step(q, |_| Radiance::new(1.0), p, |_, _| diffuse_brdf(1.0), wo);
        assert!(step(&q, &p, DVec3::Z).is_some_and(|l| l.value() > 0.0));
        assert_eq!(step(&q, &p, -DVec3::Z), Some(Radiance::new(0.0)));
        assert_eq!(step(&q, &Patch { normal: -DVec3::Z, ..p }, -DVec3::Z), Some(Radiance::new(0.0)));
        assert_eq!(step(&p, &p, DVec3::Z), None);
        assert_eq!(step(&q, &Patch { normal: DVec3::ZERO, ..p }, DVec3::Z), None);
        assert_eq!(transport_step(&q, |_| Radiance::new(f64::NAN), &p, |_, _| diffuse_brdf(1.0), DVec3::Z), None);
        assert_eq!(diffuse_radiance_distant(0.5, Irradiance::new(f64::NAN), 1.0), None);
        assert_eq!(diffuse_radiance_extended(f64::NAN, |_| Radiance::new(1.0), &Quadrature::default()), None);
        assert_eq!(radiance_of_patch(Intensity::new(1.0), Area::new(0.0), 1.0), None);
    }
}
