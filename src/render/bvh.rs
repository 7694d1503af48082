//! A bounding volume hierarchy (crate `obvhs`, f32) that never loses an f64 intersection.
//!
//! The boxes live in coordinates scaled by a power of two so that all of them fit in [−1, 1]; rays are cut to start at that cube.
//! The f32 traversal is then wrong by less than 32·2⁻²⁴ in space: ½ ulp for each end of a box and for the ray's start; ½ ulp a
//! component of its direction and 2·2⁻²³ where `obvhs` replaces a tiny one, times a length of at most 2√3; 3 rounded operations of
//! the slab test. So every box grows by 2⁻¹⁹ and every distance too, and the primitives are intersected in f64.

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::{Ray as Ray32, RayHit};

use super::ray::Ray;

const MARGIN: f64 = 1.0 / 524_288.0;

/// The hierarchy over a list of boxes.
pub struct Bvh {
    tree: Bvh2,
    center: DVec3,
    scale: f64,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh").field("nodes", &self.tree.nodes.len()).finish_non_exhaustive()
    }
}

impl Bvh {
    /// The hierarchy over boxes (low, high), at least one, and the order in which it wants their contents to be stored: the
    /// indices that [`Bvh::traverse`] hands out are positions in that order.
    pub fn new(boxes: &[(DVec3, DVec3)]) -> (Self, Vec<u32>) {
        let low = boxes.iter().fold(DVec3::INFINITY, |m, b| m.min(b.0));
        let high = boxes.iter().fold(DVec3::NEG_INFINITY, |m, b| m.max(b.1));
        let center = 0.5 * (low + high);
        let half = (0.5 * (high - low)).max_element();
        // A power of two, so scaling rounds nothing.
        let scale = if half > 0.0 { (-half.log2().ceil()).clamp(-1000.0, 1000.0).exp2() } else { 1.0 };
        let to_f32 = |p: DVec3| ((p - center) * scale).as_vec3a();
        let grow = Vec3A::splat(MARGIN as f32);
        let small: Vec<Aabb> = boxes.iter().map(|b| Aabb::new(to_f32(b.0) - grow, to_f32(b.1) + grow)).collect();
        let mut spent = std::time::Duration::ZERO;
        let tree = build_bvh2(&small, BvhBuildParams::medium_build(), &mut spent);
        let order = tree.primitive_indices.clone();
        (Self { tree, center, scale }, order)
    }

    /// Calls `hit(index, t_max)` for every primitive whose box the ray meets before `t_max`, near boxes first; `hit` answers the
    /// distance at which it met the primitive. Returns the nearest, or with `any` the first found.
    pub fn traverse(&self, ray: &Ray, any: bool, mut hit: impl FnMut(usize, f64) -> Option<f64>) -> Option<usize> {
        let skip = self.distance_to_cube(ray)?;
        let start = (ray.at(skip) - self.center) * self.scale;
        // Distances in the tree's coordinates, rounded up by more than f32 loses.
        let outward = |t: f64| ((t - skip) * self.scale * (1.0 + MARGIN) + MARGIN) as f32;
        let (mut best, mut t_max) = (None, ray.t_max);
        let mut meet = |index: usize| -> f32 {
            if (any && best.is_some()) || index >= self.tree.primitive_indices.len() {
                return f32::INFINITY;
            }
            match hit(index, t_max) {
                None => f32::INFINITY,
                Some(t) => {
                    (best, t_max) = (Some(index), t);
                    if any { f32::NEG_INFINITY } else { outward(t) }
                }
            }
        };
        let ray32 = Ray32::new(start.as_vec3a(), ray.direction.as_vec3a(), 0.0, outward(ray.t_max));
        if any {
            self.tree.ray_traverse_miss(ray32, |_, i| meet(i));
        } else {
            self.tree.ray_traverse(ray32, &mut RayHit::none(), |_, i| meet(i));
        }
        best
    }

    /// Distance along the ray to the cube of half-side 2 (in the tree's coordinates) round all boxes, 0 inside; `None` if missed.
    fn distance_to_cube(&self, ray: &Ray) -> Option<f64> {
        let half = 2.0 / self.scale;
        let (mut near, mut far) = (0.0f64, ray.t_max);
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis] - self.center[axis], ray.direction[axis]);
            if d == 0.0 {
                if o.abs() > half {
                    return None;
                }
                continue;
            }
            let (a, b) = ((-half - o) / d, (half - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some(near)
    }
}
