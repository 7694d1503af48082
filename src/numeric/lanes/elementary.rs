//! Elementary functions of numbers side by side.

use super::{LANES, Lanes};
use crate::numeric::simd::{self, Simd};

impl<S: Simd> Lanes<S> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::{Kernel, vectorised};

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
}
