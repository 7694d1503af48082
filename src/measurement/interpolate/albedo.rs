//! Directional albedo by a quadrature that is fine where tables are sharp.

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::DVec3;

use super::chart::{Chart, Plane, Polar};
use crate::brdf::Brdf;
use crate::numeric::quadrature::gauss_legendre;

/// Rows of a chart: two to a bin of a MERL table's θh.
const ROWS: usize = 180;
/// Gauss–Legendre points of a row.
const ORDER: usize = 3;
/// Azimuths over the whole turn, evenly spaced, which for periodic functions is the best rule; nothing need be symmetric.
const AZIMUTHS: usize = 256;

/// What a surface reflects of the light it gets, as far as it was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Albedo {
    /// ∫ f(wi, wo) cosθi dωi over the measured directions, channel by channel.
    pub per_channel: Vec<f64>,
    /// The measured share of the hemisphere, ∫ cosθi dωi / π over the measured directions: 1 when all is known.
    pub covered: f64,
}

/// Directional albedo ∫ f(wi, wo) cosθi dωi for lobes of any width that a table can hold.
///
/// The integral is split smoothly between two polar charts, one about the mirror direction (over the half vector, its angle
/// spaced by squares as MERL's is) and one about `wo`; each takes 3 Gauss–Legendre points in each of 180 rows, at 256 azimuths.
#[must_use]
pub fn directional_albedo(brdf: &dyn Brdf, wo: DVec3) -> Albedo {
    let mut albedo = Albedo { per_channel: vec![0.0; brdf.channels()], covered: 0.0 };
    let mut value = vec![0.0; brdf.channels()];
    let plane = Plane::new(wo);
    for chart in Chart::BOTH {
        for_each_point(chart, |at, solid_angle| {
            let Some((wi, stretch)) = chart.light(&plane, at) else { return };
            let weight = solid_angle * stretch * wi.z * chart.share(&plane, wi);
            if brdf.eval(plane.leave(wi), wo, &mut value) {
                albedo.covered += weight * FRAC_1_PI;
                albedo.per_channel.iter_mut().zip(&value).for_each(|(sum, f)| *sum += weight * f);
            }
        });
    }
    albedo
}

/// Visits the quadrature's points with the solid angle (in the chart) that each stands for.
fn for_each_point(chart: Chart, mut visit: impl FnMut(Polar, f64)) {
    let azimuth = |j: usize| (TAU * (j as f64 + 0.5) / AZIMUTHS as f64).sin_cos();
    let azimuths: Vec<(f64, f64)> = (0..AZIMUTHS).map(azimuth).collect();
    let rule = gauss_legendre(ORDER);
    for row in 0..ROWS {
        for &(x, w) in rule.iter() {
            // θ = θmax s², dω = sinθ dθ dφ with dθ = 2 θmax s ds
            let s = (row as f64 + 0.5 + 0.5 * x) / ROWS as f64;
            let theta = chart.theta_max() * s * s;
            let ring = theta.sin() * 2.0 * chart.theta_max() * s * 0.5 * w / ROWS as f64;
            let v = (0.5 * theta).sin().powi(2);
            for &(sin_phi, cos_phi) in &azimuths {
                visit(Polar { v, cos_phi, sin_phi }, ring * TAU / AZIMUTHS as f64);
            }
        }
    }
}
