//! Radiometry: quantities with units, sources, irradiance, radiance, exitance, and what a BRDF makes of them.
//!
//! In: positions and distances in metres, unit directions away from the surface, source strengths as typed quantities,
//! closures for what varies with direction. Out: typed quantities, and [`Integral`]s that state their error. The flat
//! world of plane diagrams, where a solid angle is an angle and an area a length, has types and functions of its own in
//! [`flat`]; mixing the two does not compile.
//!
//! The one decision to know: whatever divides, takes an integral or reads geometry returns an [`Option`], and `None` means
//! that the input was not finite or that the quantity does not exist there (distance 0, a surface seen edge-on, a normal of
//! length 0). No NaN comes out of them. Plain scaling and the operators of the quantities are ordinary arithmetic.

pub mod adaptive;
pub mod flat;
pub mod flux;
pub mod irradiance;
pub mod polygon;
pub mod quantity;
pub mod reflection;
pub mod shading;

pub use adaptive::{Integral, Quadrature};
pub use flux::{
    flux_through, flux_uniform, photon_energy, solid_angle_element, solid_angle_facing, solid_angle_of_rectangle,
    total_flux, uniform_intensity,
};
pub use irradiance::{
    Patch, PointSource, irradiance_at, irradiance_facing, irradiance_from_cone, irradiance_from_extended,
    irradiance_from_patch, irradiance_spherical, irradiance_tilted,
};
pub use polygon::irradiance_from_polygon;
pub use quantity::{
    Area, BrdfValue, Energy, Exitance, Flux, Intensity, Irradiance, Length, ProjectedSolidAngle, Quantity, Radiance,
    SolidAngle, Time,
};
pub use reflection::{
    diffuse_brdf, diffuse_radiance_distant, diffuse_radiance_extended, diffuse_radiance_point, exitance,
    intensity_of_patch, lambertian_exitance, radiance_from_extended, radiance_from_point, radiance_of_patch,
    transport_step,
};
pub use shading::PhongShading;

/// Runs the example of the users' chapter.
#[cfg(doctest)]
#[doc = include_str!("../../docs/radiometry.md")]
struct Chapter;
