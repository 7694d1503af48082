//! More of what numbers side by side can do: comparisons and choices, roots, vectors of three, and the elementary functions that light transport
//! takes. All give the same bits on every machine.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use glam::DVec3;

use super::simd::{self, Eight, LANES, Lanes, Simd};

/// A yes or no for each lane.
#[must_use]
#[derive(Debug, Clone, Copy)]
pub struct Mask<S: Simd> {
    simd: S,
    m: S::m64s,
}

impl<S: Simd> Mask<S> {
    /// The same in every lane.
    #[inline(always)]
    pub fn splat(simd: S, yes: bool) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        if yes { zero.at_least(zero) } else { zero.above(zero) }
    }

    /// Whether any lane says yes.
    #[inline(always)]
    #[must_use]
    pub fn any(self) -> bool {
        self.simd.first_true_m64s(self.m) < LANES
    }

    /// `yes` where this says so, `no` elsewhere.
    #[inline(always)]
    pub fn select(self, yes: Lanes<S>, no: Lanes<S>) -> Lanes<S> {
        Lanes { v: self.simd.select_f64s(self.m, yes.v, no.v), ..yes }
    }

    /// The same for vectors.
    #[inline(always)]
    pub fn select3(self, yes: Vec3<S>, no: Vec3<S>) -> Vec3<S> {
        Vec3 { x: self.select(yes.x, no.x), y: self.select(yes.y, no.y), z: self.select(yes.z, no.z) }
    }

    /// `of` where this says yes, 0 elsewhere.
    #[inline(always)]
    pub fn keep(self, of: Lanes<S>) -> Lanes<S> {
        self.select(of, Lanes::splat(self.simd, 0.0))
    }

    /// The same for a vector.
    #[inline(always)]
    pub fn keep3(self, of: Vec3<S>) -> Vec3<S> {
        self.select3(of, Vec3::splat(self.simd, DVec3::ZERO))
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self { m: self.simd.and_m64s(self.m, other.m), ..self }
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self { m: self.simd.or_m64s(self.m, other.m), ..self }
    }
}

impl<S: Simd> Not for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self { m: self.simd.not_m64s(self.m), ..self }
    }
}

impl<S: Simd> Div for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self { v: self.simd.div_f64s(self.v, other.v), ..self }
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { v: self.simd.neg_f64s(self.v), ..self }
    }
}

impl<S: Simd> Lanes<S> {
    /// The root; NaN below 0.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self { v: self.simd.sqrt_f64s(self.v), ..self }
    }

    /// The root of what is above 0, else 0.
    #[inline(always)]
    pub fn sqrt_nonneg(self) -> Self {
        self.max(self.number(0.0)).sqrt()
    }

    /// self > other; no where one is NaN.
    #[inline(always)]
    pub fn above(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, m: self.simd.greater_than_f64s(self.v, other.v) }
    }

    /// self ≥ other; no where one is NaN.
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, m: self.simd.greater_than_or_equal_f64s(self.v, other.v) }
    }

    /// self = other.
    #[inline(always)]
    pub fn is(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, m: self.simd.equal_f64s(self.v, other.v) }
    }

    /// What vectors are made with.
    #[inline(always)]
    pub fn simd(self) -> S {
        self.simd
    }

    /// `x` in every lane.
    #[inline(always)]
    pub fn number(self, x: f64) -> Self {
        Self::splat(self.simd, x)
    }

    /// ln(1 + x) for x > −1 ([`simd::ln_1p`]).
    #[inline(always)]
    pub fn ln_1p(self) -> Self {
        let mut lanes: Eight = [0.0; LANES];
        self.store(&mut lanes);
        for x in &mut lanes {
            *x = simd::ln_1p(*x);
        }
        Self::load(self.simd, &lanes)
    }

    /// |self| with the sign of `of`, 0 counting as positive.
    #[inline(always)]
    pub fn with_sign(self, of: Self) -> Self {
        let size = self.abs();
        of.at_least(self.number(0.0)).select(size, -size)
    }

    /// A polynomial, its coefficients from the highest power down.
    #[inline(always)]
    fn horner(self, coefficients: &[f64]) -> Self {
        let mut sum = self.number(0.0);
        for c in coefficients {
            sum = sum.mul_add(self, self.number(*c));
        }
        sum
    }

    /// eˣ ([`simd::exp`]).
    #[inline(always)]
    pub fn exp(self) -> Self {
        let mut lanes: Eight = [0.0; LANES];
        self.store(&mut lanes);
        for x in &mut lanes {
            *x = simd::exp(*x);
        }
        Self::load(self.simd, &lanes)
    }

    /// Sine and cosine of `turns` full circles, 0 to 1, to 4e-16.
    #[inline(always)]
    pub fn sin_cos_turns(self) -> (Self, Self) {
        // To the nearest quarter: f quarters more, |f| ≤ ½.
        let quarters = self * self.number(4.0);
        let rounded = quarters + self.number(ROUND) - self.number(ROUND);
        let x = (quarters - rounded) * self.number(std::f64::consts::FRAC_PI_2);
        let x2 = x * x;
        let sin = x * x2.horner(&SIN);
        let cos = x2.horner(&COS);
        let one = rounded.is(self.number(1.0));
        let two = rounded.is(self.number(2.0));
        let three = rounded.is(self.number(3.0));
        let odd = one | three;
        let (s, c) = (odd.select(cos, sin), odd.select(sin, cos));
        ((two | three).select(-s, s), (one | two).select(-c, c))
    }

    /// The angle of (x, y) = (`x`, self) in [0, 2π), radians, to 1e-15.
    #[inline(always)]
    pub fn angle_of(self, x: Self) -> Self {
        let y = self;
        let (ax, ay) = (x.abs(), y.abs());
        let steep = ay.above(ax);
        let (low, high) = (steep.select(ax, ay), steep.select(ay, ax));
        let ratio = high.above(self.number(0.0)).select(low / high, self.number(0.0));
        let angle = ratio.arc_tangent();
        let pi = std::f64::consts::PI;
        let angle = steep.select(self.number(0.5 * pi) - angle, angle);
        let angle = x.at_least(self.number(0.0)).select(angle, self.number(pi) - angle);
        y.at_least(self.number(0.0)).select(angle, self.number(2.0 * pi) - angle)
    }

    /// The arc tangent of 0 to 1: about the nearest eighth, where that of the difference is a short series.
    #[inline(always)]
    fn arc_tangent(self) -> Self {
        let eighths = self * self.number(8.0);
        let near = (eighths + self.number(ROUND) - self.number(ROUND)) * self.number(0.125);
        let d = (self - near) / (self.number(1.0) + self * near);
        let d2 = d * d;
        let mut at: Eight = [0.0; LANES];
        (near * self.number(8.0)).store(&mut at);
        for x in &mut at {
            *x = ARC_TANGENTS[*x as usize & 15];
        }
        d.mul_add(d2.horner(&ARC), Self::load(self.simd, &at))
    }
}

/// 1.5·2⁵²: adding it rounds to an integer.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// (−1)ᵏ/(2k + 1)! from k = 8 down.
const SIN: [f64; 9] = [
    1.0 / 355_687_428_096_000.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];
/// (−1)ᵏ/(2k)! from k = 9 down.
const COS: [f64; 10] = [
    -1.0 / 6_402_373_705_728_000.0,
    1.0 / 20_922_789_888_000.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 479_001_600.0,
    -1.0 / 3_628_800.0,
    1.0 / 40_320.0,
    -1.0 / 720.0,
    1.0 / 24.0,
    -0.5,
    1.0,
];
/// (−1)ᵏ/(2k + 1) from k = 6 down.
const ARC: [f64; 7] = [1.0 / 13.0, -1.0 / 11.0, 1.0 / 9.0, -1.0 / 7.0, 1.0 / 5.0, -1.0 / 3.0, 1.0];
/// Arc tangents of 0, ⅛ … 1, then nothing.
const ARC_TANGENTS: [f64; 16] = [
    0.0,
    0.124_354_994_546_761_44,
    0.244_978_663_126_864_15,
    0.358_770_670_270_572_25,
    0.463_647_609_000_806_1,
    0.558_599_315_343_562_4,
    0.643_501_108_793_284_4,
    0.718_829_999_621_624_5,
    std::f64::consts::FRAC_PI_4,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
];

/// Vectors side by side.
#[must_use]
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)] // x, y, z
pub struct Vec3<S: Simd> {
    pub x: Lanes<S>,
    pub y: Lanes<S>,
    pub z: Lanes<S>,
}

impl<S: Simd> Vec3<S> {
    /// The same vector in every lane.
    #[inline(always)]
    pub fn splat(simd: S, v: DVec3) -> Self {
        Self { x: Lanes::splat(simd, v.x), y: Lanes::splat(simd, v.y), z: Lanes::splat(simd, v.z) }
    }

    /// From its components.
    #[inline(always)]
    pub fn new(x: Lanes<S>, y: Lanes<S>, z: Lanes<S>) -> Self {
        Self { x, y, z }
    }

    /// `v` in every lane.
    #[inline(always)]
    pub fn vector(self, v: DVec3) -> Self {
        Self::splat(self.x.simd, v)
    }

    /// The dot product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes<S> {
        self.x.mul_add(other.x, self.y.mul_add(other.y, self.z * other.z))
    }

    /// |self|².
    #[inline(always)]
    pub fn length_squared(self) -> Lanes<S> {
        self.dot(self)
    }

    /// Of length 1.
    #[inline(always)]
    pub fn normalize(self) -> Self {
        self * (self.x.number(1.0) / self.length_squared().sqrt())
    }

    /// self·s + b.
    #[inline(always)]
    pub fn scaled_plus(self, s: Lanes<S>, b: Self) -> Self {
        Self { x: self.x.mul_add(s, b.x), y: self.y.mul_add(s, b.y), z: self.z.mul_add(s, b.z) }
    }

    /// Absolute values.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    /// The largest component.
    #[inline(always)]
    pub fn largest(self) -> Lanes<S> {
        self.x.max(self.y).max(self.z)
    }

    /// Component by component.
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }
}

impl<S: Simd> Add for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<S: Simd> Sub for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<S: Simd> Neg for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl<S: Simd> Mul<Lanes<S>> for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, s: Lanes<S>) -> Self {
        Self { x: self.x * s, y: self.y * s, z: self.z * s }
    }
}

#[cfg(test)]
mod tests {
    use super::super::simd::{Kernel, vectorised};
    use super::*;

    struct Trig<'a>(&'a [f64], &'a mut Vec<[f64; 3]>);

    impl Kernel for Trig<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) {
            for eight in self.0.as_chunks::<LANES>().0 {
                let turns = Lanes::load(simd, eight);
                let (sin, cos) = turns.sin_cos_turns();
                let angle = sin.angle_of(cos);
                let mut out = [[0.0; LANES]; 3];
                sin.store(&mut out[0]);
                cos.store(&mut out[1]);
                angle.store(&mut out[2]);
                self.1.extend((0..LANES).map(|k| [out[0][k], out[1][k], out[2][k]]));
            }
        }
    }

    #[test]
    fn sines_cosines_and_angles_are_right() {
        let turns: Vec<f64> = (0..80_000).map(|k| f64::from(k) / 80_000.0).collect();
        let mut out = Vec::new();
        vectorised(Trig(&turns, &mut out));
        for (t, [sin, cos, angle]) in turns.iter().zip(out) {
            let x = t * std::f64::consts::TAU;
            assert!((sin - x.sin()).abs() < 1e-15 && (cos - x.cos()).abs() < 1e-15, "{t}: {sin} {cos}");
            assert!((angle - x).abs() < 2e-15, "{t}: {angle} {x}");
        }
    }

    struct Choices;

    impl Kernel for Choices {
        type Output = [f64; LANES];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [f64; LANES] {
            let x = Lanes::load(simd, &[-3.0, -0.0, 0.0, 1.0, 2.0, f64::NAN, f64::INFINITY, 5.0]);
            let zero = x.number(0.0);
            let positive = x.above(zero);
            assert!(positive.any() && !Mask::splat(simd, false).any() && Mask::splat(simd, true).any());
            let known = x.is(x);
            let y = (positive & known).select(x.sqrt(), -x.with_sign(x));
            let mut out = [0.0; LANES];
            (!known).select(x.number(7.0), y).store(&mut out);
            out
        }
    }

    #[test]
    fn choices_are_made_lane_by_lane() {
        let out = vectorised(Choices);
        let want = [3.0, 0.0, 0.0, 1.0, f64::sqrt(2.0), 7.0, f64::INFINITY, f64::sqrt(5.0)];
        assert_eq!(out.map(f64::abs), want);
    }
}
