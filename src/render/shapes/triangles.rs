//! Triangles with their hierarchy.

use glam::DVec3;

use super::super::bvh::{Bvh, Contents};
use super::super::ray::Ray;
use super::triangle::{self, Four, ShearedRay};
use super::{Mesh, Owner, Surface};

/// The triangles of meshes, in the order of their hierarchy.
#[derive(Debug)]
pub struct Triangles {
    bvh: Bvh,
    /// Those of each leaf, and the place of the first.
    blocks: Vec<(Four, usize)>,
    /// Unit normals at the corners; empty where all faces are flat.
    normals: Vec<Option<[DVec3; 3]>>,
    owners: Vec<Owner>,
}

/// Where a ray met a triangle.
#[derive(Debug, Clone, Copy)]
pub struct TriangleHit {
    /// Distance, m.
    pub t: f64,
    leaf: usize,
    lane: usize,
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
        let (bvh, order) = Bvh::new(&boxes, triangle::SIDE_BY_SIDE as u32);
        if normals.iter().all(Option::is_none) {
            normals.clear();
        }
        let sorted = |i: &u32| *i as usize;
        let block = |(first, count): &(u32, u32)| {
            let (first, count) = (*first as usize, *count as usize);
            let corners: Vec<_> = order[first..first + count].iter().map(|i| corners[sorted(i)]).collect();
            (Four::new(&corners), first)
        };
        Some(Self {
            blocks: bvh.leaves().iter().map(block).collect(),
            bvh,
            normals: order.iter().filter_map(|i| normals.get(sorted(i)).copied()).collect(),
            owners: order.iter().map(|i| owners[sorted(i)]).collect(),
        })
    }

    /// The triangle that the ray meets first.
    pub fn closest(&self, ray: &Ray) -> Option<TriangleHit> {
        let mut search = Search { blocks: &self.blocks, ray: ShearedRay::new(ray), found: None };
        self.bvh.traverse::<false>(ray, &mut search);
        search.found
    }

    /// Whether a triangle, seen from either side, lies on the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut search = Search { blocks: &self.blocks, ray: ShearedRay::new(ray), found: None };
        self.bvh.traverse::<true>(ray, &mut search)
    }

    /// The surface where a ray met a triangle.
    pub fn surface(&self, hit: &TriangleHit) -> Surface {
        let (b1, b2) = (hit.b1, hit.b2);
        let (four, first) = &self.blocks[hit.leaf];
        let index = first + hit.lane;
        let point = triangle::surface(&four.corners(hit.lane), b1, b2);
        let normals = self.normals.get(index).copied().flatten();
        let smooth = normals.and_then(|[n0, n1, n2]| ((1.0 - b1 - b2) * n0 + b1 * n1 + b2 * n2).try_normalize());
        Surface { point, shading_normal: smooth.unwrap_or(point.normal), owner: self.owners[index] }
    }

    /// The box of all triangles: its lowest and its highest corner.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let all = self.blocks.iter().flat_map(|(four, _)| (0..four.count()).flat_map(|lane| four.corners(lane)));
        all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    }
}

/// The search for the triangle that a ray meets first.
struct Search<'a> {
    blocks: &'a [(Four, usize)],
    ray: ShearedRay,
    found: Option<TriangleHit>,
}

impl Contents for Search<'_> {
    #[inline(always)]
    fn meet(&mut self, leaf: usize, t_max: f64) -> Option<f64> {
        let four = &self.blocks[leaf].0;
        let (mut near, mut found) = (t_max, None);
        let mut maybe = self.ray.may_meet(four);
        while maybe != 0 {
            let lane = maybe.trailing_zeros() as usize;
            maybe &= maybe - 1;
            if let Some((t, b1, b2)) = self.ray.hit(&four.corners(lane), near) {
                (near, found) = (t, Some(TriangleHit { t, leaf, lane, b1, b2 }));
            }
        }
        self.found = found.or(self.found);
        found.map(|hit| hit.t)
    }
}
