//! Meshes that stand in several places and share their triangles: a hierarchy of placed hierarchies.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::super::bvh::{Bvh, Contents};
use super::super::ray::{Ray, SurfacePoint, gamma};
use super::triangles::{TriangleHit, Triangles};
use super::{Mesh, Owner, Surface};

/// A similarity: p ↦ scale·R·p + shift, R a rotation.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    rotation: DMat3,
    scale: f64,
    shift: DVec3,
}

impl Placement {
    /// A rotation by `angle` (rad) about the unit vector `axis`, a scaling by `scale` > 0, and a shift (m) at last.
    pub fn new(axis: DVec3, angle: f64, scale: f64, shift: DVec3) -> Self {
        Self { rotation: DMat3::from_axis_angle(axis, angle), scale, shift }
    }

    /// The point's place in the scene.
    pub fn place(&self, p: DVec3) -> DVec3 {
        self.scale * (self.rotation * p) + self.shift
    }

    /// The direction in the scene.
    pub fn turn(&self, direction: DVec3) -> DVec3 {
        (self.rotation * direction).normalize()
    }

    /// The same placement moved by −`origin`.
    pub fn relative_to(self, origin: DVec3) -> Self {
        Self { shift: self.shift - origin, ..self }
    }

    /// The ray as the mesh sees it; distances are divided by the scale.
    fn ray_inside(&self, ray: &Ray) -> Ray {
        let back = self.rotation.transpose();
        Ray {
            origin: back * (ray.origin - self.shift) / self.scale,
            direction: (back * ray.direction).normalize(),
            t_max: ray.t_max / self.scale,
        }
    }

    /// The point of the mesh in the scene. The bound also covers what a later ray rounds off on its way into the mesh: about ten
    /// operations on its coordinates and the shift, through R and back (|R||Rᵀ| ≤ 3).
    fn surface_outside(&self, point: &SurfacePoint) -> SurfacePoint {
        let absolute =
            DMat3::from_cols(self.rotation.x_axis.abs(), self.rotation.y_axis.abs(), self.rotation.z_axis.abs());
        let position = self.place(point.position);
        let reach = position.abs().max_element() + self.shift.abs().max_element();
        let error = self.scale * (absolute * point.error) + DVec3::splat(gamma(48) * reach);
        SurfacePoint { position, error, normal: self.turn(point.normal) }
    }
}

/// Placed meshes.
#[derive(Debug)]
pub struct Instances {
    bvh: Bvh,
    /// In the hierarchy's order.
    items: Vec<(Placement, Arc<Triangles>)>,
}

impl Instances {
    /// Meshes in all their places; `None` where there are none.
    pub fn new(meshes: Vec<(Mesh, Owner, Vec<Placement>)>) -> Option<Self> {
        let (mut items, mut boxes) = (Vec::new(), Vec::new());
        for (mesh, owner, placements) in meshes {
            let Some(triangles) = Triangles::new(vec![(mesh, owner)]).map(Arc::new) else { continue };
            let bounds = triangles.bounds();
            boxes.extend(placements.iter().map(|placement| placed_box(placement, bounds)));
            items.extend(placements.into_iter().map(|placement| (placement, Arc::clone(&triangles))));
        }
        if items.is_empty() {
            return None;
        }
        let (bvh, order) = Bvh::new(&boxes, 1);
        Some(Self { bvh, items: order.iter().map(|i| items[*i as usize].clone()).collect() })
    }

    /// Number of placed meshes.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// The instance and its triangle that the ray meets first, with the distance in the scene.
    pub fn closest(&self, ray: &Ray) -> Option<(f64, usize, TriangleHit)> {
        let mut search = Search { of: self, ray, found: None };
        self.bvh.traverse::<false>(ray, &mut search);
        search.found
    }

    /// Whether a triangle, seen from either side, lies on the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.bvh.traverse::<true>(ray, &mut Hiding { of: self, ray })
    }

    /// The instance of a leaf, each of which has one, with its place.
    fn of_leaf(&self, leaf: usize) -> (usize, &(Placement, Arc<Triangles>)) {
        let index = self.bvh.leaves()[leaf].0 as usize;
        (index, &self.items[index])
    }

    /// The surface where a ray met a triangle of an instance.
    pub fn surface(&self, instance: usize, hit: &TriangleHit) -> Surface {
        let (placement, mesh) = &self.items[instance];
        let inside = mesh.surface(hit);
        Surface {
            point: placement.surface_outside(&inside.point),
            shading_normal: placement.turn(inside.shading_normal),
            owner: inside.owner,
        }
    }
}

/// The search for the triangle that a ray meets first.
struct Search<'a> {
    of: &'a Instances,
    ray: &'a Ray,
    found: Option<(f64, usize, TriangleHit)>,
}

impl Contents for Search<'_> {
    fn meet(&mut self, leaf: usize, t_max: f64) -> Option<f64> {
        let (index, (placement, mesh)) = self.of.of_leaf(leaf);
        let hit = mesh.closest(&placement.ray_inside(&Ray { t_max, ..*self.ray }))?;
        let t = (hit.t * placement.scale).min(t_max); // rounding must not carry it past what was found before
        self.found = Some((t, index, hit));
        Some(t)
    }
}

/// The search for anything on a ray.
struct Hiding<'a> {
    of: &'a Instances,
    ray: &'a Ray,
}

impl Contents for Hiding<'_> {
    fn meet(&mut self, leaf: usize, t_max: f64) -> Option<f64> {
        let (_, (placement, mesh)) = self.of.of_leaf(leaf);
        mesh.occluded(&placement.ray_inside(&Ray { t_max, ..*self.ray })).then_some(t_max)
    }
}

/// The box round a placed box. The hierarchy grows its boxes by far more than is rounded off here.
fn placed_box(placement: &Placement, (low, high): (DVec3, DVec3)) -> (DVec3, DVec3) {
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        placement.place(DVec3::new(pick(0), pick(1), pick(2)))
    };
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    (0..8).map(corner).fold(none, |(low, high), p| (low.min(p), high.max(p)))
}
