//! The camera: a pinhole or a thin lens, and the filter by which points of the picture count for pixels.

use glam::{DVec2, DVec3};

use super::points::{Decision, Draws};
use super::ray::Ray;
use super::scene::{CameraSpec, Filter};
use crate::geometry::sampling::square_to_disc;
use crate::numeric::stats::normal_quantile;

/// A camera for one picture size.
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    pub position: DVec3,
    pub forward: DVec3,
    pub across: DVec3,
    pub down: DVec3,
    pub pixel: DVec2,
    pub filter: Filter,
    pub lens: Option<Lens>,
}

/// A thin lens: what lies in the plane at its distance of focus is sharp.
#[derive(Debug, Clone, Copy)]
pub struct Lens {
    /// Its radius towards the right and up, m.
    pub right: DVec3,
    pub up: DVec3,
    /// Distance of the plane in focus, m.
    pub focus: f64,
}

impl Camera {
    /// The camera of a validated description, its position moved by −`origin`, for a picture of `width` × `height` square pixels.
    pub fn new(spec: &CameraSpec, origin: DVec3, filter: Filter, width: u32, height: u32) -> Self {
        let way = DVec3::from(spec.target) - DVec3::from(spec.position);
        let forward = way.normalize();
        let right = forward.cross(DVec3::from(spec.up)).normalize();
        let half = (0.5 * spec.fov_deg).to_radians().tan();
        let (w, h) = (f64::from(width), f64::from(height));
        let radius = spec.lens_radius;
        let lens = Lens {
            right: radius * right,
            up: radius * right.cross(forward),
            focus: spec.focus_distance.unwrap_or_else(|| way.length()),
        };
        Self {
            position: DVec3::from(spec.position) - origin,
            forward,
            across: half * right,
            down: half * h / w * forward.cross(right),
            pixel: DVec2::new(2.0 / w, 2.0 / h),
            filter,
            lens: (radius > 0.0).then_some(lens),
        }
    }

    /// A ray of the pixel in column x and row y.
    pub fn ray(&self, x: usize, y: usize, draws: Draws) -> Ray {
        let u = draws.at(Decision::Pixel.number(0, 0)).pair();
        let at = DVec2::new(x as f64 + self.filter.place(u.x), y as f64 + self.filter.place(u.y));
        let p = at * self.pixel - DVec2::ONE;
        let direction = self.forward + p.x * self.across + p.y * self.down;
        let Some(lens) = &self.lens else { return Ray::new(self.position, direction.normalize()) };
        let disc = square_to_disc(draws.at(Decision::Lens.number(0, 0)).pair());
        let shift = disc.x * lens.right + disc.y * lens.up;
        Ray::new(self.position + shift, (lens.focus * direction - shift).normalize())
    }
}

impl Filter {
    /// Where a point of the unit interval falls, pixels from the pixel's edge: distributed like the filter's weights, so that all points
    /// count alike (Ernst, Stamminger, Greiner 2006).
    pub(super) fn place(self, u: f64) -> f64 {
        match self {
            Self::Box => u,
            Self::Tent if u < 0.5 => (2.0 * u).sqrt() - 0.5,
            Self::Tent => 1.5 - (2.0 - 2.0 * u).sqrt(),
            Self::Gaussian => 0.5 + Self::SIGMA * normal_quantile(Self::TAIL + (1.0 - 2.0 * Self::TAIL) * u),
        }
    }

    /// The same for several.
    #[inline(always)]
    pub(super) fn spread<const N: usize>(self, u: &mut [f64; N]) {
        if self != Self::Box {
            u.iter_mut().for_each(|u| *u = self.place(*u));
        }
    }

    /// Standard deviation of the Gaussian, pixels.
    const SIGMA: f64 = 0.5;
    /// Its share beyond 1.5 pixels on one side, which is cut off.
    const TAIL: f64 = 0.001_349_898_031_630_094_5;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean 1/2 and the variances 1/12, 1/6 and 0.25·(1 − what the cut tails hold).
    #[test]
    fn places_are_distributed_like_the_filter() {
        let n = 100_000;
        for (filter, variance) in [(Filter::Box, 1.0 / 12.0), (Filter::Tent, 1.0 / 6.0), (Filter::Gaussian, 0.243_4)] {
            let list: Vec<f64> = (0..n).map(|k| filter.place((f64::from(k) + 0.5) / f64::from(n))).collect();
            let mean = list.iter().sum::<f64>() / f64::from(n);
            let found = list.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n);
            assert!((mean - 0.5).abs() < 1e-9 && (found / variance - 1.0).abs() < 1e-3, "{filter:?}: {mean}, {found}");
            let reach = list.iter().fold(0.0f64, |m, x| m.max((x - 0.5).abs()));
            assert!(reach <= 1.5, "{filter:?}: {reach}");
        }
    }
}
