//! Shapes: where a ray meets them, and the normal there. Each is a file; all of a scene's are a [`Geometry`].

mod geometry;
mod instances;
mod mesh;
mod piece;
mod plane;
mod quad;
mod sphere;
pub mod triangle;
mod triangles;

pub use geometry::{Geometry, Owner, Surface};
pub use instances::Placement;
pub use mesh::{Mesh, read_mesh};
pub use piece::Piece;
pub use plane::Plane;
pub use quad::Quad;
pub use sphere::Sphere;
