//! Numbers side by side for long chains of steps: comparisons and choices, roots, vectors of three ([`Vec3`]), and the elementary functions that light
//! transport takes (`elementary`). All give the same bits on every machine.

mod elementary;
mod vec3;

pub use vec3::Vec3;

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

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

    /// `of` where this says yes, 0 elsewhere.
    #[inline(always)]
    pub fn keep(self, of: Lanes<S>) -> Lanes<S> {
        self.select(of, Lanes::splat(self.simd, 0.0))
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

    /// |self| with the sign of `of`, 0 counting as positive.
    #[inline(always)]
    pub fn with_sign(self, of: Self) -> Self {
        let size = self.abs();
        of.at_least(self.number(0.0)).select(size, -size)
    }
}

#[cfg(test)]
mod tests {
    use super::super::simd::{Kernel, vectorised};
    use super::*;

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
