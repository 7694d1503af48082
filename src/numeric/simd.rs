//! Elementary functions written so that the compiler can vectorise them, and the one way to run them on the vector units that
//! the machine turns out to have.
//!
//! An ordinary x86-64 build knows SSE2 alone; [`vectorised`] compiles a kernel for AVX2 and AVX-512 too and chooses when the
//! program runs. Kernels add in fixed lanes and multiply-add by [`f64::mul_add`], whose result does not depend on the machine,
//! so all of them give the same bits.

use std::ops::{Add, Mul, Sub};

pub use pulp::Simd;
use pulp::{Scalar512b, WithSimd};

/// Numbers side by side: as many as the widest register holds. On narrower machines several registers stand for it.
pub const LANES: usize = 8;

/// Work to be compiled for every vector unit. Mark `run` and whatever it calls `#[inline(always)]`, else it stays scalar.
pub trait Kernel {
    /// What it returns.
    type Output;

    /// The work; `simd` is for [`Lanes`].
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// A kernel with the vectors that it is to use.
struct Dispatched<K, S>(K, S);

impl<K: Kernel, S: Simd> WithSimd for Dispatched<K, S> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<Native: Simd>(self, _native: Native) -> K::Output {
        const { assert!(S::F64_LANES == LANES) };
        self.0.run(self.1)
    }
}

/// Runs a kernel on the widest vector unit there is.
pub fn vectorised<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        if let Some(v4) = pulp::x86::V4::try_new() {
            return Simd::vectorize(v4, Dispatched(kernel, v4));
        }
        if let Some(v3) = pulp::x86::V3::try_new() {
            return Simd::vectorize(v3, Dispatched(kernel, pulp::x86::V3_512b(v3)));
        }
    }
    kernel.run(Scalar512b)
}

/// [`LANES`] numbers in registers.
#[must_use]
#[derive(Debug, Clone, Copy)]
pub struct Lanes<S: Simd> {
    pub(super) simd: S,
    pub(super) v: S::f64s,
}

/// A number for each lane.
pub type Eight = [f64; LANES];

impl<S: Simd> Lanes<S> {
    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, x: f64) -> Self {
        Self { simd, v: simd.splat_f64s(x) }
    }

    /// From memory.
    #[inline(always)]
    pub fn load(simd: S, from: &Eight) -> Self {
        Self { simd, v: S::as_simd_f64s(from).0[0] }
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self, to: &mut Eight) {
        S::as_mut_simd_f64s(to).0[0] = self.v;
    }

    /// self·b + c, rounded once.
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        Self { v: self.simd.mul_add_f64s(self.v, b.v, c.v), ..self }
    }

    /// Every number `by` lanes on; those that fall off at the end come in at the beginning.
    #[inline(always)]
    pub fn shifted(self, by: usize) -> Self {
        Self { v: self.simd.rotate_right_f64s(self.v, by), ..self }
    }

    /// The lanes' sum, always in the same order.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let mut lanes = [0.0; LANES];
        self.store(&mut lanes);
        lanes.iter().sum()
    }

    /// |self|.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self { v: self.simd.abs_f64s(self.v), ..self }
    }

    /// The larger one; neither may be NaN.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self { v: self.simd.max_f64s(self.v, other.v), ..self }
    }

    /// The smaller one; neither may be NaN.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self { v: self.simd.min_f64s(self.v, other.v), ..self }
    }

    /// self where `test` is a number, 0 where it is NaN.
    #[inline(always)]
    pub fn where_known(self, test: Self) -> Self {
        let known = self.simd.equal_f64s(test.v, test.v);
        Self { v: self.simd.select_f64s(known, self.v, self.simd.splat_f64s(0.0)), ..self }
    }

    /// self where `test` > 0, 0 elsewhere.
    #[inline(always)]
    pub fn where_positive(self, test: Self) -> Self {
        let zero = self.simd.splat_f64s(0.0);
        let positive = self.simd.less_than_f64s(zero, test.v);
        Self { v: self.simd.select_f64s(positive, self.v, zero), ..self }
    }

    /// self where `test` is −∞, 0 elsewhere.
    #[inline(always)]
    pub fn where_dark(self, test: Self) -> Self {
        let dark = self.simd.equal_f64s(test.v, self.simd.splat_f64s(f64::NEG_INFINITY));
        Self { v: self.simd.select_f64s(dark, self.v, self.simd.splat_f64s(0.0)), ..self }
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { v: self.simd.add_f64s(self.v, other.v), ..self }
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { v: self.simd.sub_f64s(self.v, other.v), ..self }
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { v: self.simd.mul_f64s(self.v, other.v), ..self }
    }
}

/// ln 2 in two parts: the first has zeros at its end, so that small multiples of it are exact.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// 1.5·2⁵²: adding it rounds to an integer, which then stands in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// 1/k! from k = 12 down to 0.
const TAYLOR: [f64; 13] = [
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// eˣ for x ≤ 709 to one unit in the last place; below −708 (−∞ included) it stays at 3e-308, which is what a sum of lobes
/// can spare. NaN stays NaN.
#[inline(always)]
#[must_use]
pub fn exp(x: f64) -> f64 {
    let x = if x < -708.0 { -708.0 } else { x };
    let rounded = x.mul_add(std::f64::consts::LOG2_E, ROUND);
    let k = rounded - ROUND;
    let r = k.mul_add(-LN_2[1], k.mul_add(-LN_2[0], x));
    let mut p: f64 = 1.0 / 6_227_020_800.0;
    for c in TAYLOR {
        p = p.mul_add(r, c);
    }
    // 2ᵏ goes straight into the exponent's bits.
    f64::from_bits(p.to_bits().wrapping_add(rounded.to_bits() << 52))
}

/// ln x for normal x > 0 to one unit in the last place, by the series of fdlibm's `e_log.c` in s = f/(2 + f).
#[inline(always)]
#[must_use]
pub fn ln(x: f64) -> f64 {
    let bits = x.to_bits();
    // x = 2ᵏ m with m in [√½, √2).
    let above = bits.wrapping_sub(0x3fe6_a09e_667f_3bcd);
    let k = ((above as i64) >> 52) as f64;
    let f = f64::from_bits(bits.wrapping_sub(above & 0xfff0_0000_0000_0000)) - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let odd =
        w * w.mul_add(w.mul_add(1.531_383_769_920_937_3e-1, 2.222_219_843_214_978_4e-1), 3.999_999_999_940_942e-1);
    let even = z * w.mul_add(
        w.mul_add(w.mul_add(1.479_819_860_511_658_6e-1, 1.818_357_216_161_805e-1), 2.857_142_874_366_239e-1),
        6.666_666_666_666_735e-1,
    );
    let half_square = 0.5 * f * f;
    let small = s.mul_add(half_square + (odd + even), k * LN_2[1]);
    k.mul_add(LN_2[0], f - (half_square - small))
}

/// ln(1 + y) for y > −1 to a few units in the last place, however small y is (the correction is Kahan's).
#[inline(always)]
#[must_use]
pub fn ln_1p(y: f64) -> f64 {
    let u = 1.0 + y;
    let rounded = u - 1.0;
    if rounded == 0.0 { y } else { ln(u) * (y / rounded) }
}

/// out = f(a, b), element by element. Lists whose length is a multiple of 32 leave nothing to the slow remainder of the compiler's
/// unrolled loop.
#[inline(always)]
pub fn map(a: &[f64], b: &[f64], out: &mut [f64], f: impl Fn(f64, f64) -> f64) {
    let n = out.len();
    let (a, b) = (&a[..n], &b[..n]);
    for i in 0..n {
        out[i] = f(a[i], b[i]);
    }
}

/// Running sums of a dot product: two registers full, so that one product need not wait for the one before.
const SUMS: usize = 2 * LANES;

/// Σ a·b in fixed lanes.
#[inline(always)]
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a16, rest_a), (b16, rest_b)) = (a.as_chunks::<SUMS>(), b.as_chunks::<SUMS>());
    let mut lanes = [0.0f64; SUMS];
    for (a, b) in a16.iter().zip(b16) {
        for k in 0..SUMS {
            lanes[k] = a[k].mul_add(b[k], lanes[k]);
        }
    }
    lanes.iter().sum::<f64>() + rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum::<f64>()
}

/// [`dot`] on the widest vector unit there is.
#[must_use]
pub fn dot_vectorised(a: &[f64], b: &[f64]) -> f64 {
    vectorised(Dot(a, b))
}

struct Dot<'a>(&'a [f64], &'a [f64]);

impl Kernel for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> f64 {
        dot(self.0, self.1)
    }
}

/// Σ a·b·c in fixed lanes.
#[inline(always)]
#[must_use]
pub fn dot3(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    let (a16, rest_a) = a.as_chunks::<SUMS>();
    let (b16, rest_b) = b.as_chunks::<SUMS>();
    let (c16, rest_c) = c.as_chunks::<SUMS>();
    let mut lanes = [0.0f64; SUMS];
    for ((a, b), c) in a16.iter().zip(b16).zip(c16) {
        for k in 0..SUMS {
            lanes[k] = (a[k] * b[k]).mul_add(c[k], lanes[k]);
        }
    }
    let rest = rest_a.iter().zip(rest_b).zip(rest_c).map(|((a, b), c)| a * b * c).sum::<f64>();
    lanes.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Each<'a>(fn(f64) -> f64, &'a [f64], &'a mut [f64]);

    impl Kernel for Each<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd>(self, _simd: S) {
            self.2.iter_mut().zip(self.1).for_each(|(o, x)| *o = (self.0)(*x));
        }
    }

    fn compare(ours: fn(f64) -> f64, theirs: fn(f64) -> f64, x: &[f64], bound: f64) {
        let mut out = vec![0.0; x.len()];
        vectorised(Each(ours, x, &mut out));
        for (x, got) in x.iter().zip(&out) {
            let want = theirs(*x);
            assert!((got - want).abs() <= bound * want.abs(), "{x:e}: {got:e} vs {want:e}");
            assert_eq!(got.to_bits(), ours(*x).to_bits(), "{x:e}: the vector unit gives other bits");
        }
    }

    #[test]
    fn elementary_functions_match_the_standard_library() {
        let x: Vec<f64> = (0..20_000).map(|i| -0.035 * f64::from(i) + 3.0).collect();
        compare(exp, f64::exp, &x[..20_000], 3e-16);
        let x: Vec<f64> =
            (-9000..9000).map(|i| (f64::from(i) * 0.0777).exp2() * 1.234).filter(|x| x.is_normal()).collect();
        compare(ln, f64::ln, &x, 3e-16);
        let x: Vec<f64> = (0..2000).map(|i| -(f64::from(-i) * 0.03).exp2() * 0.999).collect();
        compare(ln_1p, f64::ln_1p, &x, 6e-16);
        compare(ln_1p, f64::ln_1p, &x.iter().map(|x| -1e3 * x).collect::<Vec<_>>(), 6e-16);
        assert!(exp(f64::NEG_INFINITY) < 1e-300 && exp(f64::NAN).is_nan());
    }

    #[test]
    fn sums_of_products() {
        let a: Vec<f64> = (0..37).map(f64::from).collect();
        let b: Vec<f64> = a.iter().map(|x| x + 0.5).collect();
        assert_eq!(dot(&a, &b), a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>());
        assert_eq!(dot3(&a, &a, &b), a.iter().zip(&b).map(|(a, b)| a * a * b).sum::<f64>());
    }
}
