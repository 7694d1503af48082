//! Sums of lobes, each lane its own.

use std::f64::consts::{FRAC_1_PI, TAU};

use super::flat::{FlatScene, MOST_LOBES};
use crate::brdf::phong;
use crate::numeric::lanes::{Lanes, Mask, Vec3};
use crate::numeric::simd::Simd;

/// A Phong lobe of each lane's material.
#[derive(Debug, Clone, Copy)]
struct Phong<S: Simd> {
    weight: Vec3<S>,
    exponent: Lanes<S>,
    share: Lanes<S>,
}

/// The materials that the lanes are at.
#[derive(Debug, Clone, Copy)]
pub(super) struct LobesAt<S: Simd> {
    diffuse: Vec3<S>,
    diffuse_share: Lanes<S>,
    phong: [Phong<S>; MOST_LOBES],
    count: usize,
    pub black: Mask<S>,
    /// Where there are no Phong lobes.
    pub plain: Mask<S>,
    /// Where light of quads that nothing can hide has a closed form.
    pub closed: Mask<S>,
}

/// Axes of the local frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frames<S: Simd> {
    tangent: Vec3<S>,
    bitangent: Vec3<S>,
    normal: Vec3<S>,
}

impl<S: Simd> Frames<S> {
    /// About unit normals (Duff et al. 2017).
    #[inline(always)]
    pub fn new(normal: Vec3<S>) -> Self {
        let one = normal.z.number(1.0);
        let sign = one.with_sign(normal.z);
        let a = -(one / (sign + normal.z));
        let b = normal.x * normal.y * a;
        let tangent = Vec3::new((sign * normal.x * normal.x).mul_add(a, one), sign * b, -(sign * normal.x));
        Self { tangent, bitangent: Vec3::new(b, (normal.y * normal.y).mul_add(a, sign), -normal.y), normal }
    }

    /// Coordinates in the frame.
    #[inline(always)]
    pub fn to_local(self, v: Vec3<S>) -> Vec3<S> {
        Vec3::new(self.tangent.dot(v), self.bitangent.dot(v), self.normal.dot(v))
    }

    /// The vector with these coordinates.
    #[inline(always)]
    pub fn to_world(self, v: Vec3<S>) -> Vec3<S> {
        self.tangent.scaled_plus(v.x, self.bitangent.scaled_plus(v.y, self.normal * v.z))
    }
}

impl FlatScene<'_> {
    /// The materials with these numbers.
    #[inline(always)]
    pub(super) fn lobes_at<S: Simd, const CLOSED: bool>(&self, owner: Lanes<S>) -> LobesAt<S> {
        let (zero, one) = (owner.number(0.0), owner.number(1.0));
        let none = Vec3::new(zero, zero, zero);
        let nothing = Phong { weight: none, exponent: one, share: zero };
        let mut found = LobesAt {
            diffuse: none,
            diffuse_share: one,
            phong: [nothing; MOST_LOBES],
            count: self.lobes,
            black: zero.above(zero),
            plain: one.above(zero),
            closed: one.above(zero),
        };
        for (m, material) in self.materials.iter().enumerate() {
            let here = owner.is(zero.number(m as f64));
            found.diffuse = here.select3(none.vector(material.diffuse), found.diffuse);
            found.diffuse_share = here.select(zero.number(material.diffuse_share), found.diffuse_share);
            if !material.phong.is_empty() {
                found.plain = found.plain & !here;
            }
            if CLOSED && !material.is_closed() {
                found.closed = found.closed & !here;
            }
            if material.black {
                found.black = found.black | here;
            }
            for (to, (weight, exponent, share)) in found.phong.iter_mut().zip(&material.phong) {
                to.weight = here.select3(none.vector(*weight), to.weight);
                to.exponent = here.select(zero.number(*exponent), to.exponent);
                to.share = here.select(zero.number(*share), to.share);
            }
        }
        found
    }
}

/// cosⁿ of the angles between the mirror images of `wi` and `wo`, both above the horizon.
#[inline(always)]
fn power<S: Simd>(ln_cos: Lanes<S>, exponent: Lanes<S>) -> Lanes<S> {
    let lit = ln_cos.above(ln_cos.number(-700.0));
    lit.keep((ln_cos * exponent).exp())
}

/// ln cosα; −1000 from a right angle on.
#[inline(always)]
fn ln_cos_alpha<S: Simd>(wi: Vec3<S>, wo: Vec3<S>) -> Lanes<S> {
    let off = Vec3::new(wi.x + wo.x, wi.y + wo.y, wi.z - wo.z);
    let fall = off.length_squared() * wi.x.number(0.5);
    let one = fall.number(1.0);
    let inside = one.above(fall);
    inside.select((-inside.keep(fall)).ln_1p(), one.number(-1000.0))
}

impl<S: Simd> LobesAt<S> {
    /// With the probabilities of drawing from each lobe for an eye at cosθo = `cos` ([`phong::seen`]).
    #[inline(always)]
    pub fn seen_at(mut self, cos: Lanes<S>) -> Self {
        let number = |x: f64| cos.number(x);
        let one = number(1.0);
        let square = cos * cos;
        let mut sum = self.diffuse_share;
        for lobe in &mut self.phong[..self.count] {
            let least = number(phong::SEEN_GRAZING) / (lobe.exponent + number(phong::SEEN_OFFSET));
            lobe.share = lobe.share * (one - least).mul_add(square, least).sqrt();
            sum = sum + lobe.share;
        }
        let scale = one / sum;
        self.diffuse_share = self.diffuse_share * scale;
        self.phong[..self.count].iter_mut().for_each(|lobe| lobe.share = lobe.share * scale);
        self
    }

    /// Weight of the Lambert lobe.
    #[inline(always)]
    pub fn diffuse(&self) -> Vec3<S> {
        self.diffuse
    }

    /// Weight and exponent of each Phong lobe.
    #[inline(always)]
    pub fn phong(&self) -> impl Iterator<Item = (Vec3<S>, Lanes<S>)> {
        self.phong[..self.count].iter().map(|lobe| (lobe.weight, lobe.exponent))
    }

    /// Values (1/sr) and densities of drawing `wi` (1/sr), for local directions above the horizon.
    #[inline(always)]
    pub fn evaluate<const GLOSSY: bool>(&self, wi: Vec3<S>, wo: Vec3<S>) -> (Vec3<S>, Lanes<S>) {
        let mut value = self.diffuse * wi.z.number(FRAC_1_PI);
        let mut pdf = self.diffuse_share * wi.z * wi.z.number(FRAC_1_PI);
        if GLOSSY {
            let ln_cos = ln_cos_alpha(wi, wo);
            for lobe in &self.phong[..self.count] {
                let p = power(ln_cos, lobe.exponent) * wi.z.number(1.0 / TAU);
                value = lobe.weight.scaled_plus(p * (lobe.exponent + p.number(2.0)), value);
                pdf = (lobe.share * p).mul_add(lobe.exponent + p.number(1.0), pdf);
            }
        }
        (value, pdf)
    }

    /// Draws `wi`, which may lie below the horizon: the lobe by `choice`, the direction by the point (x, y).
    #[inline(always)]
    pub fn sample<const GLOSSY: bool>(&self, wo: Vec3<S>, choice: Lanes<S>, (x, y): (Lanes<S>, Lanes<S>)) -> Vec3<S> {
        let diffuse = cosine_hemisphere(x, y);
        if !GLOSSY {
            return diffuse;
        }
        let mut rest = choice - self.diffuse_share;
        let is_glossy = rest.at_least(rest.number(0.0));
        let mut exponent = self.phong[0].exponent;
        for k in 1..self.count {
            rest = rest - self.phong[k - 1].share;
            exponent = rest.at_least(rest.number(0.0)).select(self.phong[k].exponent, exponent);
        }
        let ln_cos = (-x).ln_1p() / (exponent + exponent.number(1.0));
        let one = x.number(1.0);
        let cos = ln_cos.exp();
        let sin = (one - (ln_cos + ln_cos).exp()).sqrt_nonneg();
        let (s, c) = y.sin_cos_turns();
        let frame = Frames::new(Vec3::new(-wo.x, -wo.y, wo.z));
        is_glossy.select3(frame.to_world(Vec3::new(sin * c, sin * s, cos)), diffuse)
    }
}

/// Directions with density cosθ/π: Malley's method on the disc of Shirley and Chiu (1997).
#[inline(always)]
pub(super) fn cosine_hemisphere<S: Simd>(x: Lanes<S>, y: Lanes<S>) -> Vec3<S> {
    let one = x.number(1.0);
    let (px, py) = (x + x - one, y + y - one);
    let wide = px.abs().above(py.abs());
    let (r, other) = (wide.select(px, py), wide.select(py, px));
    let nothing = r.is(r.number(0.0));
    let slope = other / nothing.select(one, r) * r.number(0.125);
    let turns = wide.select(slope, r.number(0.25) - slope);
    // Onto [0, 1): the argument may be −⅛.
    let turns = turns.at_least(r.number(0.0)).select(turns, turns + one);
    let (sin, cos) = turns.sin_cos_turns();
    let (dx, dy) = (r * cos, r * sin);
    Vec3::new(dx, dy, (one - r * r).sqrt_nonneg())
}
