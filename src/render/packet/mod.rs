//! Eight paths of a pixel at a time, on the vector units.
//!
//! What [`super::integrator`] does one path at a time, for scenes of spheres, planes and quads whose materials are sums of lobes; both are the same
//! estimator (lights aimed at and met, power heuristic, roulette), so pictures agree within their noise. A path that ends waits for its fellows.
//! Points are Owen-scrambled Sobol' points ([`points`]).

mod flat;
mod lights;
mod lobes;
mod path;
mod points;
mod shapes;

pub(super) use flat::FlatScene;
pub(super) use path::{Found, Packets, Plan};
