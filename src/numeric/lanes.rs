//! Numbers side by side for long chains of steps: comparisons and choices, roots, vectors of three, and the elementary functions that light transport
//! takes. All give the same bits on every machine.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use glam::DVec3;

use super::simd::{self, Simd};

/// Registers that stand for one number: while one waits for a result, the other works.
const REGISTERS: usize = 2;
/// Numbers side by side.
pub const LANES: usize = REGISTERS * simd::LANES;
/// A number for each lane.
pub type Row = [f64; LANES];

/// [`LANES`] numbers in registers.
#[must_use]
#[derive(Debug, Clone, Copy)]
pub struct Lanes<S: Simd> {
    simd: S,
    v: [S::f64s; REGISTERS],
}

/// A yes or no for each lane.
#[must_use]
#[derive(Debug, Clone, Copy)]
pub struct Mask<S: Simd> {
    simd: S,
    m: [S::m64s; REGISTERS],
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
        let any = self.m[1..].iter().fold(self.m[0], |any, m| self.simd.or_m64s(any, *m));
        self.simd.first_true_m64s(any) < simd::LANES
    }

    /// `yes` where this says so, `no` elsewhere.
    #[inline(always)]
    pub fn select(self, yes: Lanes<S>, no: Lanes<S>) -> Lanes<S> {
        Lanes { v: std::array::from_fn(|k| self.simd.select_f64s(self.m[k], yes.v[k], no.v[k])), ..yes }
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
        Self { m: std::array::from_fn(|k| self.simd.and_m64s(self.m[k], other.m[k])), ..self }
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self { m: std::array::from_fn(|k| self.simd.or_m64s(self.m[k], other.m[k])), ..self }
    }
}

impl<S: Simd> Not for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self { m: self.m.map(|m| self.simd.not_m64s(m)), ..self }
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| self.simd.add_f64s(a, b))
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| self.simd.sub_f64s(a, b))
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| self.simd.mul_f64s(a, b))
    }
}

impl<S: Simd> Div for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(other, |a, b| self.simd.div_f64s(a, b))
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|v| self.simd.neg_f64s(v))
    }
}

impl<S: Simd> Lanes<S> {
    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, x: f64) -> Self {
        Self { simd, v: [simd.splat_f64s(x); REGISTERS] }
    }

    /// From memory.
    #[inline(always)]
    pub fn load(simd: S, from: &Row) -> Self {
        let v = S::as_simd_f64s(from).0;
        Self { simd, v: std::array::from_fn(|k| v[k]) }
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self, to: &mut Row) {
        S::as_mut_simd_f64s(to).0.copy_from_slice(&self.v);
    }

    #[inline(always)]
    fn each(self, f: impl Fn(S::f64s) -> S::f64s) -> Self {
        Self { v: self.v.map(f), ..self }
    }

    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(S::f64s, S::f64s) -> S::f64s) -> Self {
        Self { v: std::array::from_fn(|k| f(self.v[k], other.v[k])), ..self }
    }

    #[inline(always)]
    fn compared(self, other: Self, f: impl Fn(S::f64s, S::f64s) -> S::m64s) -> Mask<S> {
        Mask { simd: self.simd, m: std::array::from_fn(|k| f(self.v[k], other.v[k])) }
    }

    /// self·b + c, rounded once.
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        Self { v: std::array::from_fn(|k| self.simd.mul_add_f64s(self.v[k], b.v[k], c.v[k])), ..self }
    }

    /// |self|.
    #[inline(always)]
    pub fn abs(self) -> Self {
        self.each(|v| self.simd.abs_f64s(v))
    }

    /// The larger one; neither may be NaN.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        self.with(other, |a, b| self.simd.max_f64s(a, b))
    }

    /// The smaller one; neither may be NaN.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        self.with(other, |a, b| self.simd.min_f64s(a, b))
    }

    /// The root; NaN below 0.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.each(|v| self.simd.sqrt_f64s(v))
    }

    /// The root of what is above 0, else 0.
    #[inline(always)]
    pub fn sqrt_nonneg(self) -> Self {
        self.max(self.number(0.0)).sqrt()
    }

    /// self > other; no where one is NaN.
    #[inline(always)]
    pub fn above(self, other: Self) -> Mask<S> {
        self.compared(other, |a, b| self.simd.greater_than_f64s(a, b))
    }

    /// self ≥ other; no where one is NaN.
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Mask<S> {
        self.compared(other, |a, b| self.simd.greater_than_or_equal_f64s(a, b))
    }

    /// self = other.
    #[inline(always)]
    pub fn is(self, other: Self) -> Mask<S> {
        self.compared(other, |a, b| self.simd.equal_f64s(a, b))
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
        let mut lanes = [0.0; LANES];
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
        let mut lanes = [0.0; LANES];
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

    /// The angle of (x, y) = (`x`, self) in [0, 2π], radians, to 1e-15.
    #[inline(always)]
    pub fn angle_of(self, x: Self) -> Self {
        let y = self;
        let (ax, ay) = (x.abs(), y.abs());
        let steep = ay.above(ax);
        let (low, high) = (steep.select(ax, ay), steep.select(ay, ax));
        // Above an eighth of a right angle, about the diagonal: |ratio| ≤ tan(π/8).
        let diagonal = low.above(high * self.number(std::f64::consts::SQRT_2 - 1.0));
        let (over, under) = (diagonal.select(low - high, low), diagonal.select(low + high, high));
        let zero = self.number(0.0);
        let ratio = under.above(zero).select(over / under, zero);
        let pi = std::f64::consts::PI;
        let angle = ratio.arc_tangent() + diagonal.keep(self.number(0.25 * pi));
        let angle = steep.select(self.number(0.5 * pi) - angle, angle);
        let angle = x.at_least(zero).select(angle, self.number(pi) - angle);
        y.at_least(zero).select(angle, self.number(2.0 * pi) - angle)
    }

    /// The arc tangent of what is at most tan(π/8).
    #[inline(always)]
    fn arc_tangent(self) -> Self {
        let x2 = self * self;
        (self * x2).mul_add(x2.horner(&ARC), self)
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
/// (atan(x)/x − 1)/x² to 5e-17, so the arc to 3e-18, up to x = tan(π/8), in powers of x² from the tenth down: its interpolation at Chebyshev's points.
const ARC: [f64; 11] = [
    -0.019_175_404_711_104_935,
    0.039_230_447_784_793_09,
    -0.050_854_078_345_894_844,
    0.058_581_409_048_663_28,
    -0.066_645_105_255_089_36,
    0.076_921_831_253_768_92,
    -0.090_909_045_753_064_9,
    0.111_111_110_151_870_18,
    -0.142_857_142_846_656_82,
    0.199_999_999_999_955_16,
    -1.0 / 3.0,
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
            // The last register has them the other way round.
            let mut row = [5.0; LANES];
            row[..8].copy_from_slice(&[-3.0, -0.0, 0.0, 1.0, 2.0, f64::NAN, f64::INFINITY, 5.0]);
            row.copy_within(..8, LANES - 8);
            row[LANES - 8..].reverse();
            let lone = Lanes::load(simd, &std::array::from_fn(|lane| f64::from(u8::from(lane == LANES - 3))));
            assert!(lone.above(lone.number(0.5)).any() && !lone.above(lone.number(1.5)).any());
            let x = Lanes::load(simd, &row);
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
        assert_eq!(out.map(f64::abs)[..8], want);
        let mut last: Vec<f64> = out[LANES - 8..].iter().map(|x| x.abs()).collect();
        last.reverse();
        assert_eq!(last, want);
    }
}
