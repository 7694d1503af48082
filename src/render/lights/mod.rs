//! Lights: each is a file, the closed set is [`Light`]. A light answers which light arrives at a point, and from where.

mod environment;
mod mesh;
mod pick;
mod rectangle;
mod sphere;
mod spherical_triangle;
mod spot;

use glam::{DVec2, DVec3};

pub use environment::{Environment, EnvironmentImage};
pub use mesh::MeshLight;
pub use rectangle::{QuadLight, SMALL_SOLID_ANGLE};
pub use sphere::SphereLight;
pub use spot::SpotLight;

use super::ray::{Ray, SurfacePoint};

/// A light other than the environment.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // a scene has few lights, and the quad is the one that is asked most
pub enum Light {
    /// Radiant intensity (W/sr) from a point.
    Point {
        /// Where, m.
        position: DVec3,
        /// W/sr.
        intensity: DVec3,
    },
    /// Parallel light.
    Directional {
        /// Unit direction towards the light.
        toward: DVec3,
        /// On a surface that faces it, W/m².
        irradiance: DVec3,
    },
    /// A point that shines into a cone.
    Spot(SpotLight),
    /// A shining parallelogram.
    Quad(QuadLight),
    /// A shining sphere.
    Sphere(SphereLight),
    /// Shining triangles.
    Mesh(MeshLight),
}

/// Light that arrives at a point from one direction.
#[derive(Debug, Clone, Copy)]
pub struct Arrival {
    /// Unit direction to the light.
    pub wi: DVec3,
    /// Irradiance on a surface that faces the light, W/m²; for a light with a surface its estimate, radiance over `pdf`.
    pub irradiance: DVec3,
    /// Density of the direction, per sr; `None` where there is only one direction.
    pub pdf: Option<f64>,
    /// The segment that must be free.
    pub shadow: Ray,
}

impl Light {
    /// Light that arrives at a point, drawn with two numbers in [0, 1); `None` where none does.
    pub fn sample(&self, at: &SurfacePoint, u: DVec2) -> Option<Arrival> {
        match self {
            Self::Point { position, intensity } => {
                let shadow = Ray::between(at.above(), *position)?;
                let distance2 = (*position - at.position).length_squared();
                let wi = shadow.direction;
                Some(Arrival { wi, irradiance: *intensity / distance2, pdf: None, shadow })
            }
            Self::Directional { toward, irradiance } => {
                let shadow = Ray::new(at.above(), *toward);
                Some(Arrival { wi: *toward, irradiance: *irradiance, pdf: None, shadow })
            }
            Self::Spot(light) => light.sample(at, u),
            Self::Quad(light) => light.sample(at, u),
            Self::Sphere(light) => light.sample(at, u),
            Self::Mesh(light) => light.sample(at, u),
        }
    }

    /// The direction and the segment by which Phong's equation sees the light; a quad and a sphere stand at their centre, a mesh
    /// has no place that stands for it and is not seen.
    pub fn as_seen_by_equation(&self, at: &SurfacePoint) -> Option<Ray> {
        match self {
            Self::Point { position, .. } => Ray::between(at.above(), *position),
            Self::Directional { toward, .. } => Some(Ray::new(at.above(), *toward)),
            Self::Spot(light) => light.segment(at),
            Self::Quad(light) => light.segment_to_centre(at),
            Self::Sphere(light) => light.segment_to_centre(at),
            Self::Mesh(_) => None,
        }
    }

    /// Whether a ray can run into the light.
    pub fn has_surface(&self) -> bool {
        matches!(self, Self::Quad(_) | Self::Sphere(_) | Self::Mesh(_))
    }

    /// Radiance that leaves the light's surface along −`direction`, on the side of its normal.
    pub fn radiance(&self) -> DVec3 {
        match self {
            Self::Quad(light) => light.radiance,
            Self::Sphere(light) => light.radiance,
            Self::Mesh(light) => light.radiance,
            Self::Point { .. } | Self::Directional { .. } | Self::Spot(_) => DVec3::ZERO,
        }
    }

    /// Density (1/sr) with which [`Light::sample`] draws the direction from `from` to the point `to` of the light's surface, which
    /// belongs to its triangle `part` where it is a mesh.
    pub fn pdf(&self, part: usize, from: DVec3, to: DVec3) -> f64 {
        match self {
            Self::Quad(light) => light.pdf(from, to),
            Self::Sphere(light) => light.pdf(from),
            Self::Mesh(light) => light.pdf(part, from, to),
            Self::Point { .. } | Self::Directional { .. } | Self::Spot(_) => 0.0,
        }
    }
}
