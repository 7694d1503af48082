//! Triangles with their hierarchy.

use glam::DVec3;

use super::super::bvh::Bvh;
use super::super::ray::Ray;
use super::triangle::{self, ShearedRay};
use super::{Mesh, Owner, Surface};

/// The triangles of meshes, in the order of their hierarchy.
#[derive(Debug)]
pub struct Triangles {
    bvh: Bvh,
    corners: Vec<[DVec3; 3]>,
    /// Unit normals at the corners; empty where all faces are flat.
    normals: Vec<Option<[DVec3; 3]>>,
    owners: Vec<Owner>,
}

/// Where a ray met a triangle.
#[derive(Debug, Clone, Copy)]
pub struct TriangleHit {
    /// Distance, m.
    pub t: f64,
    index: usize,
    b1: f64,
    b2: f64,
}

impl Triangles {
    /// All triangles of some meshes; `None` where there are none. Triangles of a light are told apart by their place in its mesh.
    pub fn new(meshes: Vec<(Mesh, Owner)>) -> Option<Self> {
        let (mut corners, mut normals, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for (mesh, owner) in meshes {
            normals.extend((0..mesh.triangles.len()).map(|i| mesh.normals.get(i).copied()));
            owners.extend((0..mesh.triangles.len()).map(|i| match owner {
                Owner::Light { light, .. } => Owner::Light { light, part: i as u32 },
                material @ Owner::Material(_) => material,
            }));
            corners.extend(mesh.triangles);
        }
        if corners.is_empty() {
            return None;
        }
        let boxes: Vec<_> =
            corners.iter().map(|[a, b, c]: &[DVec3; 3]| (a.min(*b).min(*c), a.max(*b).max(*c))).collect();
        let (bvh, order) = Bvh::new(&boxes);
        if normals.iter().all(Option::is_none) {
            normals.clear();
        }
        let sorted = |i: &u32| *i as usize;
        Some(Self {
            bvh,
            corners: order.iter().map(|i| corners[sorted(i)]).collect(),
            normals: order.iter().filter_map(|i| normals.get(sorted(i)).copied()).collect(),
            owners: order.iter().map(|i| owners[sorted(i)]).collect(),
        })
    }

    /// The triangle that the ray meets first.
    pub fn closest(&self, ray: &Ray) -> Option<TriangleHit> {
        let sheared = ShearedRay::new(ray);
        let mut found = None;
        self.bvh.traverse(ray, false, |index, t_max| {
            let (t, b1, b2) = sheared.hit(&self.corners[index], t_max)?;
            found = Some(TriangleHit { t, index, b1, b2 });
            Some(t)
        });
        found
    }

    /// Whether a triangle, seen from either side, lies on the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let sheared = ShearedRay::new(ray);
        self.bvh.traverse(ray, true, |i, t_max| Some(sheared.hit(&self.corners[i], t_max)?.0)).is_some()
    }

    /// The surface where a ray met a triangle.
    pub fn surface(&self, hit: &TriangleHit) -> Surface {
        let (b1, b2) = (hit.b1, hit.b2);
        let point = triangle::surface(&self.corners[hit.index], b1, b2);
        let normals = self.normals.get(hit.index).copied().flatten();
        let smooth = normals.and_then(|[n0, n1, n2]| ((1.0 - b1 - b2) * n0 + b1 * n1 + b2 * n2).try_normalize());
        Surface { point, shading_normal: smooth.unwrap_or(point.normal), owner: self.owners[hit.index] }
    }

    /// The box of all triangles: its lowest and its highest corner.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let all = self.corners.iter().flatten();
        all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
    }
}
