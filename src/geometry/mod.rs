//! Directions: the local frame, spherical and half/difference angles, frames, sampling maps, solid-angle grids.
//!
//! In and out: unit vectors ([`glam::DVec3`]) and angles in radians. The one decision to know: in the local frame of a
//! surface point the normal is +z and azimuth counts from +x; `wi` points to the light, `wo` to the detector or eye, both
//! away from the surface.

pub mod angles;
pub mod frame;
pub mod grid;
pub mod half_diff;
pub mod sampling;

pub use angles::{cap_solid_angle, direction, mirror, phi_of, theta_of};
pub use frame::Frame;
pub use half_diff::{HalfDiff, half_vector};
