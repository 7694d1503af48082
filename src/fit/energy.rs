//! How much of the light a fit reflects.

use rayon::prelude::*;

use crate::brdf::{EnergyRecord, Material};

/// Polar angles of incidence that are looked at, degrees.
const ANGLES_DEG: [f64; 10] = [0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 75.0, 80.0, 85.0, 89.0];
/// Slack of the weights' sum where the fit was held to 1.
const ROUNDING: f64 = 1e-12;

/// The directional albedo of a material over the angle of incidence; `None` in the flat world, or where nothing reflects.
///
/// Every lobe's is largest at normal incidence, where it is the lobe's weight, so that energy is conserved where the weights of each channel
/// add up to at most 1.
pub(super) fn energy(material: &Material, constrained: bool) -> Option<EnergyRecord> {
    let at = |deg: &f64| material.directional_albedo(deg.to_radians());
    let by_angle = ANGLES_DEG.par_iter().map(at).collect::<Option<Vec<Vec<f64>>>>()?;
    let channels = material.channels.len();
    let albedo: Vec<Vec<f64>> = (0..channels).map(|c| by_angle.iter().map(|a| a[c]).collect()).collect();
    let largest = albedo.iter().flatten().copied().fold(0.0, f64::max);
    let conserved = largest <= 1.0 + ROUNDING;
    Some(EnergyRecord { theta_deg: ANGLES_DEG.to_vec(), albedo, largest, conserved, constrained })
}

/// Says where the material reflects more than it receives.
pub(super) fn warning(material: &Material, energy: &EnergyRecord) -> Option<String> {
    if energy.conserved {
        return None;
    }
    let (channel, most) = energy.albedo.iter().map(|a| a[0]).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let name = &material.channels[channel];
    Some(format!(
        "the fit reflects {most:.3} of the light at normal incidence (channel {name}): more than it receives; --conserve-energy \
         forbids that"
    ))
}
