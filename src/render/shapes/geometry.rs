//! All shapes of a scene, and the questions a path asks them: what is met first, and is anything in between.

use glam::DVec3;

use super::super::ray::{Ray, SurfacePoint};
use super::instances::{Instances, Placement};
use super::triangles::{TriangleHit, Triangles};
use super::{Mesh, Plane, Quad, Sphere};

/// To whom a piece of surface belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Owner {
    /// Index of a material.
    Material(usize),
    /// A light; its front shines, and it reflects nothing.
    Light {
        /// Index of the light.
        light: u32,
        /// Index of the triangle within a light that is a mesh, else 0.
        part: u32,
    },
}

/// Where a ray met a surface.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// The point and the geometric normal.
    pub point: SurfacePoint,
    /// Unit normal that shades: the geometric one, or interpolated over a mesh.
    pub shading_normal: DVec3,
    /// Whose surface it is.
    pub owner: Owner,
}

#[derive(Debug, Clone, Copy)]
enum Hit {
    Sphere(usize),
    Plane(usize),
    Quad(usize, f64, f64),
    Triangle(TriangleHit),
    Placed(usize, TriangleHit),
}

/// All shapes of a scene.
#[derive(Debug, Default)]
pub struct Geometry {
    spheres: Vec<(Sphere, Owner)>,
    planes: Vec<(Plane, Owner)>,
    quads: Vec<(Quad, Owner)>,
    triangles: Option<Triangles>,
    instances: Option<Instances>,
}

impl Geometry {
    /// The shapes of a scene.
    pub fn new(
        spheres: Vec<(Sphere, Owner)>,
        planes: Vec<(Plane, Owner)>,
        quads: Vec<(Quad, Owner)>,
        meshes: Vec<(Mesh, Owner)>,
        placed: Vec<(Mesh, Owner, Vec<Placement>)>,
    ) -> Self {
        Self { spheres, planes, quads, triangles: Triangles::new(meshes), instances: Instances::new(placed) }
    }

    /// Spheres, planes and quads, where there is nothing else.
    #[allow(clippy::type_complexity)] // three lists
    pub fn analytic(&self) -> Option<(&[(Sphere, Owner)], &[(Plane, Owner)], &[(Quad, Owner)])> {
        (self.triangles.is_none() && self.instances.is_none()).then_some((&self.spheres, &self.planes, &self.quads))
    }

    /// Number of shapes, all meshes that stand in one place together being one.
    pub fn shapes(&self) -> usize {
        let placed = self.instances.as_ref().map_or(0, Instances::len);
        self.spheres.len() + self.planes.len() + self.quads.len() + usize::from(self.triangles.is_some()) + placed
    }

    /// The surface that the ray meets first. Of surfaces at the same distance it is the first of the spheres, else of the quads, so
    /// that a square light in a floor is seen.
    pub fn closest(&self, ray: &Ray) -> Option<Surface> {
        let (mut t_max, mut best) = (ray.t_max, None);
        for (i, (sphere, _)) in self.spheres.iter().enumerate() {
            if let Some(t) = sphere.hit(ray, t_max) {
                (t_max, best) = (t, Some(Hit::Sphere(i)));
            }
        }
        for (i, (quad, _)) in self.quads.iter().enumerate() {
            if let Some((t, a, b)) = quad.hit(ray, t_max) {
                (t_max, best) = (t, Some(Hit::Quad(i, a, b)));
            }
        }
        for (i, (plane, _)) in self.planes.iter().enumerate() {
            if let Some(t) = plane.hit(ray, t_max) {
                (t_max, best) = (t, Some(Hit::Plane(i)));
            }
        }
        if let Some(hit) = self.triangles.as_ref().and_then(|mesh| mesh.closest(&Ray { t_max, ..*ray })) {
            (t_max, best) = (hit.t, Some(Hit::Triangle(hit)));
        }
        if let Some((t, i, hit)) = self.instances.as_ref().and_then(|all| all.closest(&Ray { t_max, ..*ray })) {
            (t_max, best) = (t, Some(Hit::Placed(i, hit)));
        }
        best.and_then(|hit| self.surface(hit, ray.at(t_max)))
    }

    /// Whether anything, seen from either side, lies on the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let t_max = ray.t_max;
        self.spheres.iter().any(|(sphere, _)| sphere.hit(ray, t_max).is_some())
            || self.quads.iter().any(|(quad, _)| quad.hit(ray, t_max).is_some())
            || self.planes.iter().any(|(plane, _)| plane.hit(ray, t_max).is_some())
            || self.triangles.as_ref().is_some_and(|mesh| mesh.occluded(ray))
            || self.instances.as_ref().is_some_and(|all| all.occluded(ray))
    }

    fn surface(&self, hit: Hit, p: DVec3) -> Option<Surface> {
        let (point, owner) = match hit {
            Hit::Sphere(i) => (self.spheres[i].0.surface(p), self.spheres[i].1),
            Hit::Plane(i) => (self.planes[i].0.surface(p), self.planes[i].1),
            Hit::Quad(i, a, b) => (self.quads[i].0.surface(a, b), self.quads[i].1),
            Hit::Triangle(hit) => return self.triangles.as_ref().map(|mesh| mesh.surface(&hit)),
            Hit::Placed(i, hit) => return self.instances.as_ref().map(|all| all.surface(i, &hit)),
        };
        Some(Surface { point, shading_normal: point.normal, owner })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::geometry::sampling::uniform_sphere;
    use crate::numeric::random::{Purpose, RngExt, Stream, stream};
    use crate::render::shapes::triangle::ShearedRay;

    fn point(rng: &mut Stream) -> DVec3 {
        DVec3::new(rng.random(), rng.random(), rng.random()) - 0.5
    }

    #[test]
    fn the_hierarchy_finds_what_a_search_of_all_triangles_finds() {
        let mut rng = stream(1, Purpose::Study, 0);
        for (scale, center) in [(1.0, DVec3::ZERO), (1e-4, DVec3::splat(0.3)), (1e6, DVec3::new(1e7, 0.0, 0.0))] {
            // Triangles, needles that run across the whole, and specks that are smaller than an ulp of f32.
            let triangles: Vec<[DVec3; 3]> = (0..600)
                .map(|i| {
                    let (a, b) = (point(&mut rng), point(&mut rng));
                    let c = a + if i % 10 == 0 { 1e-9 } else { 0.3 } * point(&mut rng);
                    let b = if i % 10 == 0 { b } else { a + 0.3 * b };
                    let (b, c) = if i % 10 == 1 { (a + 1e-8 * (b - a), a + 1e-8 * (c - a)) } else { (b, c) };
                    [a, b, c].map(|p| center + scale * p)
                })
                .collect();
            let mesh = Mesh { triangles: triangles.clone(), normals: Vec::new() };
            let geometry = Geometry::new(vec![], vec![], vec![], vec![(mesh, Owner::Material(0))], vec![]);
            let mut met = 0;
            for i in 0..4000 {
                let direction = uniform_sphere(DVec2::new(rng.random(), rng.random()));
                let origin = if i % 4 == 0 { -1e3 * direction + 0.3 * point(&mut rng) } else { 2.0 * point(&mut rng) };
                let t_max = if i % 3 == 0 { scale } else { f64::INFINITY };
                let origin = center + scale * origin;
                // Every second ray aims at a point of a triangle.
                let [a, b, c] = triangles[i % 600];
                let aimed = (a + 0.25 * (b - a) + 0.5 * (c - a) - origin).normalize();
                let ray = Ray { origin, direction: if i % 2 == 0 { direction } else { aimed }, t_max };
                let sheared = ShearedRay::new(&ray);
                let want = triangles.iter().filter_map(|c| sheared.hit(c, t_max)).map(|h| h.0).min_by(f64::total_cmp);
                let found = geometry.triangles.as_ref().and_then(|mesh| mesh.closest(&ray)).map(|h| h.t);
                assert!(found == want, "ray {i} at scale {scale:e}: {found:?} vs {want:?}");
                assert_eq!(geometry.occluded(&ray), want.is_some());
                met += usize::from(want.is_some());
            }
            assert!((1500..3900).contains(&met), "{met} rays met a triangle");
        }
    }

    #[test]
    fn a_small_distant_sphere_is_met_where_it_is() {
        for (radius, distance) in [(1.0, 4.0), (1e-6, 1e3), (1e3, 1e-6), (1e-4, 1e7)] {
            let sphere = Sphere { center: DVec3::new(0.0, 0.0, -distance - radius), radius };
            for (offset, met) in [(0.0, true), (0.999, true), (1.001, false)] {
                let ray = Ray::new(DVec3::new(offset * radius, 0.0, 0.0), -DVec3::Z);
                let hit = sphere.hit(&ray, f64::INFINITY);
                assert_eq!(hit.is_some(), met, "radius {radius:e}, distance {distance:e}, offset {offset}");
                let want = distance + radius * (1.0 - f64::sqrt(1.0 - offset * offset));
                // The coordinates themselves are rounded.
                let bound = 8.0 * f64::EPSILON * (distance + radius) / f64::sqrt(1.0 - offset * offset).max(0.04);
                assert!(hit.is_none_or(|t| (t - want).abs() <= bound), "{hit:?} vs {want} ± {bound:e}");
            }
        }
    }

    #[test]
    fn rays_that_leave_a_surface_do_not_find_it_again() {
        let mut rng = stream(2, Purpose::Study, 0);
        for scale in [1e-6, 1.0, 1e9] {
            for center in [DVec3::ZERO, DVec3::new(3.0, -2.0, 1e3)] {
                let sphere = Sphere { center: scale * center, radius: scale };
                let quad = Quad::new(scale * center, scale * point(&mut rng), scale * point(&mut rng));
                for _ in 0..2000 {
                    let normal = uniform_sphere(DVec2::new(rng.random(), rng.random()));
                    let on_sphere = sphere.surface(sphere.center + scale * normal);
                    let on_quad = quad.surface(rng.random(), rng.random());
                    for at in [on_sphere, on_quad] {
                        // Grazing directions too.
                        let w = uniform_sphere(DVec2::new(rng.random(), rng.random()));
                        let flat = w - (1.0 - 1e-9) * w.dot(at.normal) * at.normal;
                        for d in [w, flat.normalize()] {
                            let d = if d.dot(at.normal) < 0.0 { d - 2.0 * d.dot(at.normal) * at.normal } else { d };
                            let ray = Ray::new(at.above(), d.normalize());
                            let again = sphere.hit(&ray, f64::INFINITY).filter(|_| at.normal != quad.normal);
                            assert!(again.is_none(), "sphere at {center} x {scale:e}: {again:?}");
                            let again = quad.hit(&ray, f64::INFINITY).filter(|_| at.normal == quad.normal);
                            assert!(again.is_none(), "quad at {center} x {scale:e}: {again:?}");
                        }
                    }
                }
            }
        }
    }
}
