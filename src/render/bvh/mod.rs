//! A bounding volume hierarchy (built by the crate `obvhs`, f32) that never loses an f64 intersection.
//!
//! The boxes live in coordinates scaled by a power of two so that all of them fit in [−1, 1]; rays are cut to start at a cube of twice
//! that side, whose start f64 knows well enough up to some 10⁹ sizes away. The f32 traversal is then wrong by less than 32·2⁻²⁴ in space:
//! ½ ulp for each end of a box and for the ray's start; ½ ulp a component of its direction and 2⁻²³ where a tiny one is replaced, times a
//! length of at most 3√3; 3 rounded operations of the slab test. So every box grows by 2⁻¹⁹ and every distance too, and the primitives are intersected in f64.

mod wide;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;

use self::wide::{Leaves, Wide, WideRay};
use super::ray::Ray;

const MARGIN: f64 = 1.0 / 524_288.0;

/// The hierarchy over a list of boxes.
#[derive(Debug)]
pub struct Bvh {
    tree: Wide,
    center: DVec3,
    scale: f64,
}

/// What the boxes of a hierarchy contain.
pub trait Contents {
    /// Where in (0, `t_max`) the ray first meets what lies in a leaf of the hierarchy, by the leaf's number in [`Bvh::leaves`].
    fn meet(&mut self, leaf: usize, t_max: f64) -> Option<f64>;
}

impl Bvh {
    /// The hierarchy over boxes (low, high), at least one, with at most `per_leaf` of them in a leaf, and the order in which it wants their contents to be
    /// stored.
    pub fn new(boxes: &[(DVec3, DVec3)], per_leaf: u32) -> (Self, Vec<u32>) {
        let low = boxes.iter().fold(DVec3::INFINITY, |m, b| m.min(b.0));
        let high = boxes.iter().fold(DVec3::NEG_INFINITY, |m, b| m.max(b.1));
        let center = 0.5 * (low + high);
        let half = (0.5 * (high - low)).max_element();
        // A power of two, so scaling rounds nothing.
        let scale = if half > 0.0 { (-half.log2().ceil()).clamp(-1000.0, 1000.0).exp2() } else { 1.0 };
        let to_f32 = |p: DVec3| ((p - center) * scale).as_vec3a();
        let grow = Vec3A::splat(MARGIN as f32);
        let small: Vec<Aabb> = boxes.iter().map(|b| Aabb::new(to_f32(b.0) - grow, to_f32(b.1) + grow)).collect();
        let parameters = BvhBuildParams {
            max_prims_per_leaf: per_leaf,
            // Leaves are asked as a whole: full ones cost hardly more.
            collapse_traversal_cost: 20.0,
            ..BvhBuildParams::medium_build()
        };
        let binary = build_bvh2(&small, parameters, &mut std::time::Duration::default());
        let order = binary.primitive_indices.clone();
        (Self { tree: Wide::new(&binary), center, scale }, order)
    }

    /// Of each leaf where its contents begin, in the order in which they are stored, and how many they are.
    pub fn leaves(&self) -> &[(u32, u32)] {
        self.tree.leaves()
    }

    /// Asks the leaves that the ray may meet before what was met so far, near ones first; with `ANY` until one answers. Whether any did.
    pub fn traverse<const ANY: bool>(&self, ray: &Ray, contents: &mut impl Contents) -> bool {
        let Some(skip) = self.distance_to_cube(ray) else { return false };
        let start = ((ray.at(skip) - self.center) * self.scale).as_vec3();
        let mut scaled = Scaled { contents, t_max: ray.t_max, skip, scale: self.scale, met: false };
        let inverse = ray.direction.as_vec3().to_array().map(inverse);
        let ray = WideRay { origin: start.to_array(), inverse, t_max: scaled.outward(ray.t_max) };
        self.tree.walk::<ANY>(ray, &mut scaled);
        scaled.met
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

/// 1/x, and that of a tiny one in place of those below it.
fn inverse(x: f32) -> f32 {
    if x.abs() <= f32::EPSILON { f32::EPSILON.recip().copysign(x) } else { x.recip() }
}

/// Contents, with distances in the tree's coordinates.
struct Scaled<'a, C> {
    contents: &'a mut C,
    t_max: f64,
    skip: f64,
    scale: f64,
    met: bool,
}

impl<C> Scaled<'_, C> {
    /// A distance in the tree's coordinates, rounded up by more than f32 loses.
    #[inline(always)]
    fn outward(&self, t: f64) -> f32 {
        ((t - self.skip) * self.scale * (1.0 + MARGIN) + MARGIN) as f32
    }
}

impl<C: Contents> Leaves for Scaled<'_, C> {
    #[inline(always)]
    fn meet(&mut self, leaf: usize) -> Option<f32> {
        self.t_max = self.contents.meet(leaf, self.t_max)?;
        self.met = true;
        Some(self.outward(self.t_max))
    }
}
