//! The diffuse lobe: the same radiance into every direction (Lambert 1760).

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::lobe::{Lobe, Parameter, above_horizon};

/// weight/π: reflects the share `weight` of the light from every direction.
#[derive(Debug, Clone, Copy)]
pub struct Lambert;

/// weight/2, its twin in the flat world.
#[derive(Debug, Clone, Copy)]
pub struct Lambert2d;

fn coordinate(wi: DVec3, wo: DVec3) -> f64 {
    if above_horizon(wi, wo) { 0.0 } else { f64::NEG_INFINITY }
}

impl Lobe for Lambert {
    fn name(&self) -> &'static str {
        "lambert"
    }

    fn parameters(&self) -> &'static [Parameter] {
        &[]
    }

    fn coordinate(&self, wi: DVec3, wo: DVec3) -> f64 {
        coordinate(wi, wo)
    }

    fn value(&self, _shape: &[f64], coordinate: f64, _gradient: &mut [f64]) -> f64 {
        if coordinate == f64::NEG_INFINITY { 0.0 } else { FRAC_1_PI }
    }
}

impl Lobe for Lambert2d {
    fn name(&self) -> &'static str {
        "lambert2d"
    }

    fn parameters(&self) -> &'static [Parameter] {
        &[]
    }

    fn coordinate(&self, wi: DVec3, wo: DVec3) -> f64 {
        coordinate(wi, wo)
    }

    fn value(&self, _shape: &[f64], coordinate: f64, _gradient: &mut [f64]) -> f64 {
        if coordinate == f64::NEG_INFINITY { 0.0 } else { 0.5 }
    }
}
