//! What a packet of rays meets.

use glam::DVec3;

use super::super::ray::gamma;
use super::super::shapes::{Piece, Sphere};
use super::super::surroundings::Occluders;
use super::flat::FlatScene;
use crate::numeric::lanes::{Lanes, Mask, Vec3};
use crate::numeric::simd::Simd;

/// Rays: origin + t·direction for t in (0, `t_max`).
#[derive(Debug, Clone, Copy)]
pub(super) struct Rays<S: Simd> {
    pub origin: Vec3<S>,
    pub direction: Vec3<S>,
    pub t_max: Lanes<S>,
}

/// Computed points of surfaces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Points3<S: Simd> {
    pub position: Vec3<S>,
    pub error: Vec3<S>,
    pub normal: Vec3<S>,
}

/// Where rays met a surface first, and whose it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Met<S: Simd> {
    pub hit: Mask<S>,
    pub at: Points3<S>,
    pub owner: Lanes<S>,
}

impl<S: Simd> Points3<S> {
    /// The nearest start on the normal's side that is certainly off the surface ([`super::super::ray::SurfacePoint::above`]).
    #[inline(always)]
    pub fn above(&self) -> Vec3<S> {
        let shift = self.normal * self.normal.abs().dot(self.error);
        Vec3::new(
            outward(self.position.x, shift.x),
            outward(self.position.y, shift.y),
            outward(self.position.z, shift.z),
        )
    }
}

/// p + shift, and one more step of the last place that way.
#[inline(always)]
fn outward<S: Simd>(p: Lanes<S>, shift: Lanes<S>) -> Lanes<S> {
    let moved = p + shift;
    let step = moved.abs().mul_add(p.number(f64::EPSILON), p.number(f64::MIN_POSITIVE));
    let none = shift.is(p.number(0.0));
    moved + none.select(p.number(0.0), step.with_sign(shift))
}

/// t of a sphere; NaN where it is not met.
#[inline(always)]
fn sphere_t<S: Simd>(sphere: &Sphere, rays: &Rays<S>) -> Lanes<S> {
    let f = rays.origin - rays.origin.vector(sphere.center);
    let b = -f.dot(rays.direction);
    let zero = b.number(0.0);
    let r2 = b.number(sphere.radius * sphere.radius);
    let c = f.length_squared() - r2;
    let discriminant = r2 - rays.direction.scaled_plus(b, f).length_squared();
    let leaves = c.at_least(zero) & zero.at_least(b);
    // The root of what is below 0 is NaN, and so is what follows.
    let q = b + discriminant.sqrt().with_sign(b);
    let other = c / q;
    let forward = q.at_least(zero);
    let (near, far) = (forward.select(other, q), forward.select(q, other));
    let t = near.above(zero).select(near, far);
    leaves.select(b.number(f64::NAN), t)
}

/// t of a flat piece; NaN where it is not met.
#[inline(always)]
fn piece_t<S: Simd>(piece: &Piece, rays: &Rays<S>) -> Lanes<S> {
    let f = rays.origin.vector(piece.point) - rays.origin;
    let normal = f.vector(piece.normal);
    let t = f.dot(normal) / rays.direction.dot(normal);
    if piece.to_a == DVec3::ZERO {
        return t;
    }
    let p = rays.direction.scaled_plus(t, -f);
    let one = t.number(1.0);
    let (a, b) = (p.dot(f.vector(piece.to_a)).abs(), p.dot(f.vector(piece.to_b)).abs());
    (one.at_least(a) & one.at_least(b)).select(t, t.number(f64::NAN))
}

impl FlatScene<'_> {
    /// The surfaces that the rays meet first.
    #[inline(always)]
    pub(super) fn closest<S: Simd>(&self, rays: &Rays<S>) -> Met<S> {
        let zero = rays.t_max.number(0.0);
        let mut t_best = rays.t_max;
        let (mut owner, mut hit) = (zero, zero.above(zero));
        let mut normal = rays.origin.vector(DVec3::ZERO);
        let (mut center, mut radius) = (normal, zero);
        for (sphere, number) in &self.spheres {
            let t = sphere_t(sphere, rays);
            let nearer = t.above(zero) & t_best.above(t);
            t_best = nearer.select(t, t_best);
            owner = nearer.select(zero.number(*number), owner);
            center = nearer.select3(center.vector(sphere.center), center);
            radius = nearer.select(zero.number(sphere.radius), radius);
            hit = hit | nearer;
        }
        let (mut point, mut reach) = (center, zero);
        for (piece, number) in &self.pieces {
            let t = piece_t(piece, rays);
            let nearer = t.above(zero) & t_best.above(t);
            t_best = nearer.select(t, t_best);
            owner = nearer.select(zero.number(*number), owner);
            normal = nearer.select3(normal.vector(piece.normal), normal);
            point = nearer.select3(point.vector(piece.point), point);
            reach = nearer.select(zero.number(piece.reach), reach);
            radius = nearer.select(zero, radius);
            hit = hit | nearer;
        }
        let p = rays.direction.scaled_plus(t_best, rays.origin);
        let round = radius.above(zero);
        let at = round_or_flat(round, (center, radius), (point, normal, reach), p);
        Met { hit, at, owner }
    }
}

impl Occluders {
    /// Whether any of them, seen from either side, lies on the rays.
    #[inline(always)]
    pub(super) fn hide<S: Simd>(&self, rays: &Rays<S>) -> Mask<S> {
        let zero = rays.t_max.number(0.0);
        let mut hidden = zero.above(zero);
        for sphere in &self.spheres {
            let t = sphere_t(sphere, rays);
            hidden = hidden | (t.above(zero) & rays.t_max.above(t));
        }
        for piece in &self.pieces {
            let t = piece_t(piece, rays);
            hidden = hidden | (t.above(zero) & rays.t_max.above(t));
        }
        hidden
    }
}

/// The points of spheres, or of flat pieces, nearest to `p`, which lie close to them.
#[inline(always)]
fn round_or_flat<S: Simd>(
    round: Mask<S>,
    (center, radius): (Vec3<S>, Lanes<S>),
    (point, normal, reach): (Vec3<S>, Vec3<S>, Lanes<S>),
    p: Vec3<S>,
) -> Points3<S> {
    let out = (p - center).normalize();
    let relative = out * radius;
    let on_sphere = center + relative;
    let (twelve, two) = (radius.number(gamma(12)), radius.number(gamma(2)));
    let of_sphere = relative.abs().scaled_plus(twelve, on_sphere.abs() * two);
    let on_piece = normal.scaled_plus(-(p - point).dot(normal), p);
    let flat = (on_piece.abs().largest() + reach) * radius.number(gamma(32));
    Points3 {
        position: round.select3(on_sphere, on_piece),
        error: round.select3(of_sphere, Vec3::new(flat, flat, flat)),
        normal: round.select3(out, normal),
    }
}
