//! The flat world of plane diagrams: the same radiometry in two dimensions.
//!
//! A set of directions is an arc and its size an angle (rad); a surface is a curve and the size of a patch a length (m);
//! light thins out with 1/r instead of 1/r². Positions are [`glam::DVec2`] in metres. At a surface with normal n a direction
//! is the angle θ ∈ [−π/2, π/2) from n, positive towards the tangent t = (n.y, −n.x): towards +x where the normal is +y.
//! Flux, energy, time and length are those of [`crate::radiometry`]; every other quantity is of another type than its
//! namesake there. This is the world of an in-plane scan, and it is where formulas are easiest to draw.

mod lobes;
mod quantity;
mod reflection;
mod sources;

pub use lobes::{lambert2d, phong2d, phong2d_normalisation};
pub use quantity::{Angle, BrdfValue, Exitance, Intensity, Irradiance, ProjectedAngle, Radiance};
pub use reflection::{
    diffuse_brdf, diffuse_radiance_distant, diffuse_radiance_extended, diffuse_radiance_point, exitance,
    intensity_of_patch, lambertian_exitance, radiance_from_extended, radiance_from_point, radiance_of_patch,
    transport_step,
};
pub use sources::{
    Patch, PointSource, angle_facing, flux_through_arc, flux_uniform, irradiance_at, irradiance_facing,
    irradiance_from_extended, irradiance_from_patch, irradiance_from_segment, irradiance_tilted, uniform_intensity,
};
