//! Residuals of a block and what follows from them, in vectorised loops: each loss with each robust loss has its own.

use super::loss::{Loss, RobustKind};
use super::passes::Saturation;
use crate::numeric::simd::{Kernel, Simd, dot};

/// A linear loss: r = g (f − y) and w g r; returns Σ w r².
pub(super) struct Linear<'a> {
    pub f: &'a [f64],
    pub y: &'a [f64],
    pub w: &'a [f64],
    pub gain: &'a [f64],
    pub r: &'a mut [f64],
    pub pull: &'a mut [f64],
}

impl Kernel for Linear<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> f64 {
        let n = self.r.len();
        let (f, y, w, gain) = (&self.f[..n], &self.y[..n], &self.w[..n], &self.gain[..n]);
        let (r, pull) = (&mut self.r[..n], &mut self.pull[..n]);
        for i in 0..n {
            r[i] = gain[i] * (f[i] - y[i]);
            pull[i] = w[i] * r[i];
        }
        let cost = dot(r, pull);
        for i in 0..n {
            pull[i] *= gain[i];
        }
        cost
    }
}

/// What the residuals of a block are made of.
pub(super) struct Data<'a> {
    pub f: &'a [f64],
    pub cos_i: &'a [f64],
    pub y: &'a [f64],
    pub w: &'a [f64],
}

/// Filled; `slope` holds the ∂r/∂f of a linear loss before.
pub(super) struct Out<'a> {
    pub r: &'a mut [f64],
    pub slope: &'a mut [f64],
    pub trust: &'a mut [f64],
    pub pull: &'a mut [f64],
}

pub(super) struct Evaluate<'a> {
    pub loss: Loss,
    pub saturation: Saturation,
    pub data: Data<'a>,
    pub out: Out<'a>,
}

/// A loss by its type, so that each has loops of its own, inlined into the kernel.
trait Residual {
    const LOSS: Loss;
}

/// s²ρ and ρ′ of a residual.
trait Trust: Copy {
    fn at(self, r: f64) -> (f64, f64);
}

struct Plain;
struct Log;
struct CubeRoot;

impl Residual for Plain {
    const LOSS: Loss = Loss::L2; // as any linear loss, by its gain
}

impl Residual for Log {
    const LOSS: Loss = Loss::Log;
}

impl Residual for CubeRoot {
    const LOSS: Loss = Loss::CubeRoot;
}

#[derive(Clone, Copy)]
struct Full;

/// Huber's or Cauchy's loss with s² and 1/s².
#[derive(Clone, Copy)]
struct Huber(f64, f64);
#[derive(Clone, Copy)]
struct Cauchy(f64, f64);

impl Trust for Full {
    #[inline(always)]
    fn at(self, r: f64) -> (f64, f64) {
        (r * r, 1.0)
    }
}

impl Trust for Huber {
    #[inline(always)]
    fn at(self, r: f64) -> (f64, f64) {
        let (rho, weight, _) = RobustKind::Huber.rho(r * r * self.1);
        (self.0 * rho, weight)
    }
}

impl Trust for Cauchy {
    #[inline(always)]
    fn at(self, r: f64) -> (f64, f64) {
        let (rho, weight, _) = RobustKind::Cauchy.rho(r * r * self.1);
        (self.0 * rho, weight)
    }
}

impl Kernel for Evaluate<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) -> f64 {
        match self.loss {
            Loss::Log => self.of_loss::<Log>(),
            Loss::CubeRoot => self.of_loss::<CubeRoot>(),
            Loss::L2 | Loss::CosineL2 | Loss::Relative => self.of_loss::<Plain>(),
        }
    }
}

impl Evaluate<'_> {
    #[inline(always)]
    fn of_loss<R: Residual>(self) -> f64 {
        match self.saturation {
            None => self.each::<R, Full>(Full),
            Some((RobustKind::Huber, s)) => self.each::<R, Huber>(Huber(s * s, 1.0 / (s * s))),
            Some((RobustKind::Cauchy, s)) => self.each::<R, Cauchy>(Cauchy(s * s, 1.0 / (s * s))),
        }
    }

    #[inline(always)]
    fn each<R: Residual, T: Trust>(self, rho: T) -> f64 {
        let n = self.data.f.len();
        let Data { f, cos_i, y, w } = self.data;
        let (f, cos_i, y, w) = (&f[..n], &cos_i[..n], &y[..n], &w[..n]);
        let (r, slope, trust, pull) =
            (&mut self.out.r[..n], &mut self.out.slope[..n], &mut self.out.trust[..n], &mut self.out.pull[..n]);
        for i in 0..n {
            (r[i], slope[i]) = R::LOSS.evaluate(f[i], cos_i[i], slope[i], y[i]);
        }
        for i in 0..n {
            // The cost waits where the pull will stand.
            (pull[i], trust[i]) = rho.at(r[i]);
        }
        let cost = dot(w, pull);
        for i in 0..n {
            pull[i] = w[i] * trust[i] * slope[i] * r[i];
        }
        cost
    }
}

/// w (ρ′ + 2uρ″) (∂r/∂f)² + w ρ′ r ∂²r/∂f².
pub(super) struct Bend<'a> {
    pub loss: Loss,
    pub saturation: Saturation,
    pub w: &'a [f64],
    pub cos_i: &'a [f64],
    pub r: &'a [f64],
    pub slope: &'a [f64],
    pub trust: &'a [f64],
    pub to: &'a mut [f64],
}

impl Kernel for Bend<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) {
        match self.saturation {
            None => self.each(|_| 1.0),
            Some((RobustKind::Huber, s)) => self.each(|r| RobustKind::Huber.rho(r * r / (s * s)).2),
            Some((RobustKind::Cauchy, s)) => self.each(|r| RobustKind::Cauchy.rho(r * r / (s * s)).2),
        }
    }
}

impl Bend<'_> {
    #[inline(always)]
    fn each(self, growth: impl Fn(f64) -> f64) {
        let n = self.to.len();
        let (w, cos_i, r) = (&self.w[..n], &self.cos_i[..n], &self.r[..n]);
        let (slope, trust, to) = (&self.slope[..n], &self.trust[..n], &mut self.to[..n]);
        for i in 0..n {
            let second = trust[i] * r[i] * self.loss.second_slope(slope[i], cos_i[i]);
            to[i] = w[i] * slope[i].mul_add(slope[i] * growth(r[i]), second);
        }
    }
}
