//! The tracer: what a material looks like under known light.
//!
//! In: a scene (a [`SceneSpec`] read from TOML plus the materials that its names stand for), a resolution, a number of samples
//! and a seed. Out: a [`Film`] of radiance in W/(sr·m²) per linear RGB channel, with the standard error of every pixel and
//! the share of its light that nobody measured. Lengths are in scene units, called metres.
//!
//! The one decision to know: everything is one-sided. A surface reflects, and a light shines, on the side that its normal points
//! to; the other side is black and blocks light. A path is a chain of at most `max_bounces` scattering events; at each one
//! the lights are sampled directly and the two ways to find them are combined by multiple importance sampling (Veach 1997).
//! Every pixel has its own points, so the picture does not depend on the number of threads.

mod bvh;
mod camera;
mod error;
mod film;
mod integrator;
mod layers;
mod lights;
mod material;
mod noise;
mod packet;
mod pixel;
pub mod plan;
mod points;
mod ray;
pub mod scene;
mod schedule;
mod shapes;
mod surroundings;
mod tiles;

pub use error::RenderError;
pub use film::{Film, Options, render};
pub use integrator::Strategy;
pub use layers::LayerSet;
pub use material::{Material, Materials, PhongEquation};
pub use noise::{PictureError, relative_squares};
pub use plan::Plan;
pub use scene::{Scene, SceneSpec};
