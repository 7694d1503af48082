//! Sixteen paths side by side, on the vector units.
//!
//! What [`super::integrator`] does one path at a time, for scenes of spheres, planes and quads whose materials are sums of lobes; both are the same
//! estimator (lights aimed at and met, power heuristic but for small lights on diffuse surfaces, which points of the light alone show more evenly; roulette), so pictures agree within their noise; where light has a closed form, it takes no samples ([`outline`], [`surround`]). Paths are
//! followed by waves, event by event; those that have ended make room for the others ([`wave`]).

mod flat;
mod lights;
mod lobes;
mod outline;
mod path;
mod shapes;
mod steps;
mod surround;
mod wave;

pub(super) use flat::{FlatScene, MOST_CLOSED};
pub(super) use path::Packets;
