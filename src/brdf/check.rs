//! Checks that any BRDF can be put to: reciprocity and energy, by quadrature.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::Brdf;
use crate::numeric::float::larger;
use crate::numeric::quadrature::integrate_directions;

/// Directional albedo ∫ f(wi, wo) cosθi dωi of one channel by `order`² Gauss–Legendre points in (θ, φ): right for lobes wider
/// than π/`order`. Sharper ones have closed forms with their models.
pub fn directional_albedo(brdf: &dyn Brdf, wo: DVec3, channel: usize, order: usize) -> f64 {
    let mut out = vec![0.0; brdf.channels()];
    integrate_directions((0.0, FRAC_PI_2), (0.0, TAU), order, |wi| {
        brdf.eval(wi, wo, &mut out);
        out[channel] * wi.z
    })
}

/// Largest |f(a, b) − f(b, a)| over the channels, relative to the larger value; 0 where both are 0.
pub fn reciprocity_error(brdf: &dyn Brdf, a: DVec3, b: DVec3) -> f64 {
    let (mut ab, mut ba) = (vec![0.0; brdf.channels()], vec![0.0; brdf.channels()]);
    brdf.eval(a, b, &mut ab);
    brdf.eval(b, a, &mut ba);
    ab.iter().zip(&ba).map(|(x, y)| if x == y { 0.0 } else { (x - y).abs() / x.abs().max(y.abs()) }).fold(0.0, larger)
}
