//! What leaves a surface of the flat world. A BRDF is a closure of the angles (θi, θo) from the normal, rad.

use glam::DVec2;

use super::quantity::{BrdfValue, Exitance, Intensity, Irradiance, ProjectedAngle, Radiance};
use super::sources::{Patch, irradiance_from_patch, irradiance_tilted, over_half_circle, towards, unit};
use crate::radiometry::adaptive::{Integral, Quadrature};
use crate::radiometry::flux::positive;
use crate::radiometry::irradiance::above_horizon;
use crate::radiometry::quantity::{Length, Quantity};

/// Radiance I/(s cosθ₀) of a small patch of length s that sends the intensity I at the angle θ₀ from its normal. `None` when
/// it is seen edge-on or from behind, s ≤ 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// let (l, s) = (flat::Radiance::new(3.0), Length::new(1e-4));
/// for cos_o in [1.0, 0.5, 1e-3] {
///     let seen = flat::radiance_of_patch(flat::intensity_of_patch(l, s, cos_o), s, cos_o).unwrap();
///     assert!((seen / l - 1.0).abs() < 1e-15);
/// }
/// assert_eq!(flat::radiance_of_patch(flat::Intensity::new(1.0), s, 0.0), None);
/// ```
#[must_use]
pub fn radiance_of_patch(intensity: Intensity, length: Length, cos_o: f64) -> Option<Radiance> {
    let seen = length * positive(cos_o)?;
    positive(seen.value()).and_then(|_| (intensity / seen).finite())
}

/// Intensity L s cosθ₀ of a small patch of length s and radiance L; 0 below its horizon.
/// ```
/// # use goniofit::radiometry::*;
/// // Over all directions it sends exitance × length.
/// let (l, s) = (flat::Radiance::new(3.0), Length::new(1e-4));
/// let half = std::f64::consts::FRAC_PI_2;
/// let intensity = |theta: f64| flat::intensity_of_patch(l, s, theta.cos());
/// let flux = flat::flux_through_arc((-half, half), intensity, &Quadrature::default()).unwrap();
/// assert!((flux.value / (flat::lambertian_exitance(l) * s) - 1.0).abs() < 1e-14);
/// ```
#[must_use]
pub fn intensity_of_patch(radiance: Radiance, length: Length, cos_o: f64) -> Intensity {
    radiance * length * above_horizon(cos_o)
}

/// Radiant exitance ∫ L(θo) cosθo dθo. `None` when a value of L is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // L = cos²θ: ∫ cos³θ dθ = 4/3.
/// let e = flat::exitance(|theta| flat::Radiance::new(theta.cos().powi(2)), &Quadrature::default()).unwrap();
/// assert!((e.value.value() - 4.0 / 3.0).abs() <= e.error.value() && e.converged);
/// ```
#[must_use]
pub fn exitance(radiance: impl Fn(f64) -> Radiance, quadrature: &Quadrature) -> Option<Integral<Exitance>> {
    over_half_circle(|theta| radiance(theta).value(), quadrature).map(Integral::as_quantity)
}

/// Radiant exitance 2L of a Lambertian surface.
/// ```
/// # use goniofit::radiometry::*;
/// let l = flat::Radiance::new(2.0);
/// let by_integral = flat::exitance(|_| l, &Quadrature::default()).unwrap();
/// assert!((flat::lambertian_exitance(l) - by_integral.value).value().abs() <= by_integral.error.value());
/// ```
#[must_use]
pub fn lambertian_exitance(radiance: Radiance) -> Exitance {
    Exitance::new((radiance * ProjectedAngle::HALF_CIRCLE).value())
}

/// Example 1: radiance ρ I cosθi/r under one point source. `None` for r ≤ 0 or what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // The limit of example 2 for an ever narrower bright arc of sky: L·2σ = I/r.
/// let (rho, i, r, theta) = (flat::BrdfValue::new(0.7), flat::Intensity::new(4.0), Length::new(2.0), 0.9f64);
/// let point = flat::radiance_from_point(rho, i, theta.cos(), r).unwrap();
/// for sigma in [1e-2, 1e-3] {
///     let arc = Quadrature::default().interval((theta - sigma, theta + sigma), |t| 0.7 * 2.0 / (2.0 * sigma) * t.cos());
///     assert!((arc.unwrap().value / point.value() - 1.0).abs() < sigma * sigma);
/// }
/// ```
#[must_use]
pub fn radiance_from_point(rho: BrdfValue, intensity: Intensity, cos_i: f64, distance: Length) -> Option<Radiance> {
    (rho * irradiance_tilted(intensity, cos_i, distance)?).finite()
}

/// Example 2: radiance `∫ ρ(θi, θo) L_in(θi) cosθi dθi` along θo under an extended source. `None` when a value is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// // ρ = cos²(θi − θo) under an even sky: 1 + cos(2θo)/3.
/// let rho = |theta_i: f64, theta_o: f64| flat::BrdfValue::new((theta_i - theta_o).cos().powi(2));
/// let l = flat::radiance_from_extended(rho, 0.9, |_| flat::Radiance::new(1.0), &Quadrature::default()).unwrap();
/// assert!((l.value.value() - (1.0 + 1.8f64.cos() / 3.0)).abs() <= l.error.value() && l.converged);
/// ```
#[must_use]
pub fn radiance_from_extended(
    rho: impl Fn(f64, f64) -> BrdfValue,
    theta_o: f64,
    incoming: impl Fn(f64) -> Radiance,
    quadrature: &Quadrature,
) -> Option<Integral<Radiance>> {
    let integrand = |theta_i: f64| rho(theta_i, theta_o).value() * incoming(theta_i).value();
    over_half_circle(integrand, quadrature).map(Integral::as_quantity)
}

/// Example 3: the diffuse BRDF of the flat world, albedo/2; energy is conserved up to albedo 1.
/// ```
/// # use goniofit::radiometry::*;
/// let arriving = flat::Irradiance::new(8.0);
/// for albedo in [0.0, 0.3, 1.0] {
///     let leaving = flat::exitance(|_| flat::diffuse_brdf(albedo) * arriving, &Quadrature::default()).unwrap();
///     assert!((leaving.value / arriving - albedo).abs() <= leaving.error.value() / 8.0);
/// }
/// ```
#[must_use]
pub fn diffuse_brdf(albedo: f64) -> BrdfValue {
    BrdfValue::new(0.5 * albedo)
}

/// Example 4: radiance `(albedo/2) ∫ L_in cosθi dθi` of a diffuse surface under an extended source. `None` when a value is not
/// finite.
/// ```
/// # use goniofit::radiometry::*;
/// // A white surface under an even sky is as bright as the sky.
/// let l = flat::diffuse_radiance_extended(1.0, |_| flat::Radiance::new(5.0), &Quadrature::default()).unwrap();
/// assert!((l.value.value() - 5.0).abs() <= l.error.value());
/// ```
#[must_use]
pub fn diffuse_radiance_extended(
    albedo: f64,
    incoming: impl Fn(f64) -> Radiance,
    quadrature: &Quadrature,
) -> Option<Integral<Radiance>> {
    if !albedo.is_finite() {
        return None;
    }
    let arriving = over_half_circle(|theta| incoming(theta).value(), quadrature)?;
    Some(arriving.as_quantity::<Radiance>().scaled(diffuse_brdf(albedo).value()))
}

/// Example 5: radiance (albedo/2) I cosθi/r of a diffuse surface under a point source. `None` for r ≤ 0 or what is not
/// finite.
/// ```
/// # use goniofit::radiometry::*;
/// let (i, r) = (flat::Intensity::new(4.0), Length::new(2.0));
/// let l = flat::diffuse_radiance_point(0.5, i, 0.6, r).unwrap();
/// assert!((flat::lambertian_exitance(l) / flat::irradiance_tilted(i, 0.6, r).unwrap() - 0.5).abs() < 1e-15);
/// ```
#[must_use]
pub fn diffuse_radiance_point(albedo: f64, intensity: Intensity, cos_i: f64, distance: Length) -> Option<Radiance> {
    radiance_from_point(diffuse_brdf(albedo), intensity, cos_i, distance)
}

/// Example 5 for a source so far away that r is the same everywhere: `facing` is the irradiance of a patch that faces it.
/// `None` for what is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// let (i, r) = (flat::Intensity::new(1e15), Length::new(1.5e11));
/// let far = flat::diffuse_radiance_distant(0.5, flat::irradiance_facing(i, r).unwrap(), 0.6).unwrap();
/// assert!((far / flat::diffuse_radiance_point(0.5, i, 0.6, r).unwrap() - 1.0).abs() < 1e-15);
/// ```
#[must_use]
pub fn diffuse_radiance_distant(albedo: f64, facing: Irradiance, cos_i: f64) -> Option<Radiance> {
    (diffuse_brdf(albedo) * (facing * above_horizon(cos_i))).finite()
}

/// One step of the light-transport cycle: radiance that leaves `q` → irradiance at `p` → radiance that leaves `p` along `wo`.
///
/// `leaving_q` is the radiance of `q` along a unit world direction away from it; `rho` the BRDF of `p` in angles from its normal;
/// `wo` a world direction away from `p`. 0 below the horizon of either. `None` when the patches coincide, a normal or `wo`
/// is 0, or something is not finite.
/// ```
/// # use goniofit::radiometry::*;
/// use glam::DVec2;
/// // Inside a white circle of even radiance L every patch gets 2L from all the others, and so sends L back.
/// let (l, n) = (flat::Radiance::new(2.0), 2000);
/// let length = Length::new(std::f64::consts::TAU / f64::from(n));
/// let at = |k: f64| DVec2::from_angle(std::f64::consts::TAU * k / f64::from(n));
/// let p = flat::Patch { position: at(0.0), normal: -at(0.0), length };
/// let sum: flat::Radiance = (0..n).map(|k| {
///     let position = at(f64::from(k) + 0.5);
///     let q = flat::Patch { position, normal: -position, length };
///     flat::transport_step(&q, |_| l, &p, |_, _| flat::diffuse_brdf(1.0), DVec2::new(-0.6, 0.8)).unwrap()
/// }).sum();
/// assert!((sum / l - 1.0).abs() < 1e-6); // midpoint rule: π²/(6 n²)
/// ```
#[must_use]
pub fn transport_step(
    q: &Patch,
    leaving_q: impl Fn(DVec2) -> Radiance,
    p: &Patch,
    rho: impl Fn(f64, f64) -> BrdfValue,
    wo: DVec2,
) -> Option<Radiance> {
    let normal = unit(p.normal)?;
    let (wi, _) = towards(p.position, q.position)?;
    let arriving = irradiance_from_patch(q, leaving_q(-wi), p.position, p.normal)?;
    let out = unit(wo)?;
    if normal.dot(wi) <= 0.0 || normal.dot(out) <= 0.0 {
        return Some(Radiance::default());
    }
    (rho(angle_from(normal, wi), angle_from(normal, out)) * arriving).finite()
}

/// Angle of `w` from the normal, positive towards (n.y, −n.x).
fn angle_from(normal: DVec2, w: DVec2) -> f64 {
    w.perp_dot(normal).atan2(w.dot(normal))
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // exact results are compared exactly
mod tests {
    use super::*;
    use crate::radiometry::flat::phong2d;

    #[test]
    fn angles_count_from_the_normal_towards_plus_x() {
        assert!((angle_from(DVec2::Y, DVec2::new(1.0, 1.0)) - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        assert!((angle_from(DVec2::X, DVec2::new(1.0, -1.0)) - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
    }

    #[test]
    fn a_lobe_sends_light_on_to_the_mirror_side() {
        let p = Patch { position: DVec2::ZERO, normal: DVec2::Y, length: Length::new(1.0) };
        let q = Patch { position: DVec2::new(3.0, 4.0), normal: DVec2::new(-3.0, -4.0), length: Length::new(1e-3) };
        let rho = |ti, to| BrdfValue::new(phong2d(100.0, ti, to).unwrap_or(0.0));
        let step = |wo| transport_step(&q, |_| Radiance::new(1.0), &p, rho, wo).expect("lit").value();
        let mirrored = step(DVec2::new(-3.0, 4.0));
        // ρ·H with H = L s cosθp/r = 10⁻³·0.8/5.
        let want = crate::radiometry::flat::phong2d_normalisation(100.0).expect("n ≥ 0") * 1e-3 * 0.8 / 5.0;
        assert!((mirrored / want - 1.0).abs() < 1e-13, "{mirrored} {want}");
        assert!(step(DVec2::new(3.0, 4.0)) < 1e-9 * mirrored);
        assert_eq!(step(DVec2::new(3.0, -4.0)), 0.0);
        assert_eq!(transport_step(&p, |_| Radiance::new(1.0), &p, rho, DVec2::Y), None);
        assert_eq!(transport_step(&q, |_| Radiance::new(f64::NAN), &p, rho, DVec2::Y), None);
    }
}
