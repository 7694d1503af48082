//! The pinhole camera.

use glam::{DVec2, DVec3};

use super::ray::Ray;
use super::scene::CameraSpec;

/// A pinhole camera for one picture size.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    pub position: DVec3,
    pub forward: DVec3,
    pub across: DVec3,
    pub down: DVec3,
    pub pixel: DVec2,
}

impl Camera {
    /// The camera of a validated description, its position moved by −`origin`, for a picture of `width` × `height` square pixels.
    pub fn new(spec: &CameraSpec, origin: DVec3, width: u32, height: u32) -> Self {
        let forward = (DVec3::from(spec.target) - DVec3::from(spec.position)).normalize();
        let right = forward.cross(DVec3::from(spec.up)).normalize();
        let half = (0.5 * spec.fov_deg).to_radians().tan();
        let (w, h) = (f64::from(width), f64::from(height));
        Self {
            position: DVec3::from(spec.position) - origin,
            forward,
            across: half * right,
            down: half * h / w * forward.cross(right),
            pixel: DVec2::new(2.0 / w, 2.0 / h),
        }
    }

    /// The ray through the point (x, y) of the picture in pixels, from the upper left corner.
    pub fn ray(&self, at: DVec2) -> Ray {
        let p = at * self.pixel - DVec2::ONE;
        Ray::new(self.position, (self.forward + p.x * self.across + p.y * self.down).normalize())
    }
}
