//! Light from all directions: constant, or from a picture of the whole sphere.

mod above;
mod density;
mod image;
mod lat_long;

use std::f64::consts::FRAC_1_PI;

use glam::{DVec2, DVec3};

pub use image::EnvironmentImage;

use crate::geometry::{Frame, sampling};

/// What lies behind everything: light that depends on the direction alone.
#[derive(Debug)]
pub enum Environment {
    /// One radiance from everywhere, W/(sr·m²).
    Constant(DVec3),
    /// A picture in latitude and longitude.
    Image(EnvironmentImage),
}

/// A direction in which the environment is looked for.
#[derive(Debug, Clone, Copy)]
pub struct SkySample {
    /// Unit direction.
    pub wi: DVec3,
    /// Radiance from there, W/(sr·m²).
    pub radiance: DVec3,
    /// Density of the direction, per sr.
    pub pdf: f64,
}

impl Environment {
    /// Radiance from the unit direction `wi`, and the density (1/sr) with which [`Environment::sample`] draws it at a surface
    /// with the unit normal `normal`.
    pub fn find(&self, normal: DVec3, wi: DVec3) -> (DVec3, f64) {
        match self {
            Self::Constant(radiance) => (*radiance, FRAC_1_PI * normal.dot(wi).clamp(0.0, f64::INFINITY)),
            Self::Image(image) => image.find(normal, wi),
        }
    }

    /// Radiance from the unit direction `wi`.
    pub fn radiance(&self, wi: DVec3) -> DVec3 {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::Image(image) => image.radiance(wi),
        }
    }

    /// A direction drawn with two numbers in [0, 1): in proportion to the cosine where the radiance is the same everywhere, else
    /// about in proportion to the radiance times the cosine. `None` where no light comes from above.
    pub fn sample(&self, frame: &Frame, u: DVec2) -> Option<SkySample> {
        match self {
            Self::Constant(radiance) => {
                let local = sampling::cosine_hemisphere(u);
                let pdf = sampling::cosine_hemisphere_pdf(local);
                Some(SkySample { wi: frame.to_world(local).normalize(), radiance: *radiance, pdf })
            }
            Self::Image(image) => {
                let (wi, radiance, pdf) = image.sample(frame.normal, u)?;
                Some(SkySample { wi, radiance, pdf })
            }
        }
    }
}
