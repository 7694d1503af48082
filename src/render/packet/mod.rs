//! Eight paths of a pixel at a time, on the vector units.
//!
//! What [`super::integrator`] does one path at a time, for scenes of spheres, planes and quads whose materials are sums of lobes; both are the same
//! estimator (lights aimed at and met, power heuristic, roulette), so pictures agree within their noise; where light has a closed form, it takes no samples ([`closed`]). A path that ends waits for its fellows.

mod closed;
mod flat;
mod lights;
mod lobes;
mod occluders;
mod path;
mod shapes;

pub(super) use flat::FlatScene;
pub(super) use path::{Found, Packets};
