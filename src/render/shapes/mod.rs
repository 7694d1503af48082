//! Shapes: where a ray meets them, and the normal there. Each is a file; all of a scene's are a [`Geometry`].

mod geometry;
mod mesh;
mod plane;
mod quad;
mod sphere;
mod triangle;

pub use geometry::{Geometry, Owner, Surface};
pub use mesh::{Mesh, read_obj};
pub use plane::Plane;
pub use quad::Quad;
pub use sphere::Sphere;
