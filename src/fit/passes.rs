//! Passes over the samples: each returns a few dozen sums, however many samples there are. Sums run in blocks of fixed size,
//! in a fixed order, so they do not depend on the number of threads.

use nalgebra::{DMatrix, DVector};

use super::loss::{Loss, Robust, RobustKind};
use super::samples::{Block, Samples};
use super::transform::Transform;
use crate::brdf::LobeKind;
use crate::numeric::simd::{Kernel, dot, dot3, vectorised};

/// A lobe of the model at given shapes (natural units).
#[derive(Debug, Clone)]
pub(super) struct ShapedLobe {
    pub kind: LobeKind,
    pub shape: Vec<f64>,
}

/// How residuals count: a robust loss with its s (in the residual's unit), if any.
pub(super) type Saturation = Option<(RobustKind, f64)>;

/// s of a robust loss for residuals of this σ.
pub(super) fn saturation(robust: Option<Robust>, sigma: f64) -> Saturation {
    robust.map(|r| (r.kind, r.scale * sigma))
}

/// Basis columns of one block: lobe values φ, then for each shape parameter dφ/dt with t = ln(shape).
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub all: Vec<Vec<f64>>,
    lobes: usize,
}

impl Columns {
    pub fn fill(block: &Block, lobes: &[ShapedLobe]) -> Self {
        let n = block.len();
        let mut all = Vec::new();
        let mut slopes = Vec::new();
        for lobe in lobes {
            let mut phi = vec![0.0; n];
            let mut own = vec![vec![0.0; n]; lobe.shape.len()];
            lobe.kind.lobe().fill(&lobe.shape, &block.x, &mut phi, &mut own);
            for (list, s) in own.iter_mut().zip(&lobe.shape) {
                list.iter_mut().for_each(|d| *d *= s);
            }
            all.push(phi);
            slopes.extend(own);
        }
        let count = all.len();
        all.extend(slopes);
        Self { all, lobes: count }
    }

    /// Σ x φ.
    pub fn model(&self, x: &DVector<f64>) -> Vec<f64> {
        let mut f = vec![0.0; self.all.first().map_or(0, Vec::len)];
        for (phi, x) in self.all[..self.lobes].iter().zip(x.iter()) {
            f.iter_mut().zip(phi).for_each(|(f, p)| *f = x.mul_add(*p, *f));
        }
        f
    }
}

/// Gram matrices and data vectors of a linear loss. `K` columns: the lobe values, then their slopes.
#[derive(Debug, Clone)]
pub(super) struct Moments {
    /// Σ w g² col·col, one matrix for each weight list.
    pub gram: Vec<DMatrix<f64>>,
    /// Σ w g² col·y, one vector for each channel.
    pub data: Vec<DVector<f64>>,
}

impl Moments {
    /// The sums of one channel.
    pub fn gram(&self, channel: usize) -> &DMatrix<f64> {
        if self.gram.len() == 1 { &self.gram[0] } else { &self.gram[channel] }
    }
}

/// w g² of a linear loss over a block, list by list.
fn omega(samples: &Samples<'_>, block: &Block) -> Vec<Vec<f64>> {
    let of = |c: usize| {
        let g = samples.gain(block, c);
        block.weight(c).iter().zip(&g).map(|(w, g)| w * g * g).collect()
    };
    (0..samples.lists()).map(of).collect()
}

/// The transforms of a linear loss's weights and weighted data (measures: lists, then channels), and each channel's energy
/// Σ w g² y².
pub(super) fn transform(samples: &Samples<'_>) -> (Transform, Vec<f64>) {
    // Each piece has its own sums: few enough that adding them costs nothing, and as many whatever the number of threads.
    let (lists, channels) = (samples.lists(), samples.channels.len());
    let parts = samples.map_pieces(PIECES, || (Transform::new(lists + channels), vec![0.0; channels]), |sums, block| {
        let mut values = omega(samples, block);
        for c in 0..channels {
            let weight = &values[if lists == 1 { 0 } else { c }];
            let wy: Vec<f64> = weight.iter().zip(&block.y[c]).map(|(w, y)| w * y).collect();
            sums.1[c] += vectorised(Dot(&wy, &block.y[c]));
            values.push(wy);
        }
        sums.0.absorb(&block.x, &values);
    });
    let mut total = (Transform::new(lists + channels), vec![0.0; channels]);
    for (part, energy) in &parts {
        total.0.merge(part);
        total.1.iter_mut().zip(energy).for_each(|(t, e)| *t += e);
    }
    total
}

/// Pieces that a pass with large sums is cut into; it fixes how they are bracketed.
const PIECES: usize = 16;

struct Dot<'a>(&'a [f64], &'a [f64]);

impl Kernel for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        dot(self.0, self.1)
    }
}

/// The quadratic model of one channel's cost about given weights and shapes, by [weights, t of every shape parameter]. The slopes are
/// of the bare lobes: a lobe's weight is not multiplied in.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    /// Σ w r² (robust: Σ w s² ρ).
    pub cost: f64,
    /// Half the cost's gradient.
    pub gradient: DVector<f64>,
    /// Gauss–Newton matrix Σ w ρ′ (∂r/∂f)² col·col; empty where it was not asked for.
    pub normal: DMatrix<f64>,
}

/// What a pass over residuals is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Want {
    /// Cost and gradient by weights and shapes.
    Gradient,
    /// The normal matrix by the weights too.
    Weights,
    /// The normal matrix by weights and shapes.
    All,
}

/// One pass over true residuals for given shapes and weights (`weights[channel][lobe]`).
pub(super) fn sums(
    samples: &Samples<'_>,
    lobes: &[ShapedLobe],
    weights: &[DVector<f64>],
    saturation: Saturation,
    want: Want,
) -> Vec<Sums> {
    let slopes: usize = lobes.iter().map(|l| l.shape.len()).sum();
    let columns = lobes.len() + if want == Want::Weights { 0 } else { slopes };
    let matrix = if want == Want::Gradient { 0 } else { columns };
    let zero = Sums { cost: 0.0, gradient: DVector::zeros(columns), normal: DMatrix::zeros(matrix, matrix) };
    let parts = samples.map_blocks(|block| {
        let basis = Columns::fill(block, lobes);
        let channel = |(c, x): (usize, &DVector<f64>)| {
            let residuals = Residuals::at(samples, block, c, &basis.model(x), saturation);
            let mut sums = zero.clone();
            sums.cost = residuals.cost;
            vectorised(Products { columns: &basis.all[..columns], of: &residuals, into: &mut sums });
            sums
        };
        weights.iter().enumerate().map(channel).collect::<Vec<Sums>>()
    });
    let mut total = vec![zero.clone(); weights.len()];
    for part in parts {
        for (total, part) in total.iter_mut().zip(part) {
            total.cost += part.cost;
            total.gradient += part.gradient;
            total.normal += part.normal;
        }
    }
    total.iter_mut().for_each(|s| s.normal.fill_upper_triangle_with_lower_triangle());
    total
}

/// Residuals of one channel over a block, and what follows from them.
pub(super) struct Residuals {
    /// r.
    pub r: Vec<f64>,
    /// ∂r/∂f.
    pub slope: Vec<f64>,
    /// ρ′, the robust weight; 1 without a robust loss.
    pub trust: Vec<f64>,
    /// w ρ′ r ∂r/∂f: half the cost's slope by f.
    pub pull: Vec<f64>,
    /// w ρ′ (∂r/∂f)².
    pub curvature: Vec<f64>,
    /// Σ w s² ρ.
    pub cost: f64,
}

impl Residuals {
    /// At the model values `f`.
    pub fn at(samples: &Samples<'_>, block: &Block, channel: usize, f: &[f64], saturation: Saturation) -> Self {
        let n = block.len();
        let gain = samples.gain(block, channel);
        let zero = || vec![0.0; n];
        let mut out = Self { r: zero(), slope: zero(), trust: zero(), pull: zero(), curvature: zero(), cost: 0.0 };
        let targets;
        let target = if samples.loss.is_linear() {
            &block.y[channel]
        } else {
            let datum = |(y, c): (&f64, &f64)| super::loss::Datum { value: *y, cos_i: *c, epsilon: 0.0 };
            targets = block.y[channel].iter().zip(&block.cos_i).map(|p| samples.loss.target(datum(p))).collect::<Vec<_>>();
            &targets
        };
        let w = block.weight(channel);
        let data = Data { f, cos_i: &block.cos_i, gain: &gain, target, w };
        vectorised(Evaluate { loss: samples.loss, saturation, data, out: &mut out });
        out
    }
}

/// What the residuals of a block are made of.
struct Data<'a> {
    f: &'a [f64],
    cos_i: &'a [f64],
    gain: &'a [f64],
    target: &'a [f64],
    w: &'a [f64],
}

struct Evaluate<'a> {
    loss: Loss,
    saturation: Saturation,
    data: Data<'a>,
    out: &'a mut Residuals,
}

impl Kernel for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        // One loop a loss, so that each is free of branches.
        match self.loss {
            Loss::Log => self.of_loss(|f, c, g, t| Loss::Log.prepared(f, c, g, t)),
            Loss::CubeRoot => self.of_loss(|f, c, g, t| Loss::CubeRoot.prepared(f, c, g, t)),
            _ => self.of_loss(|f, _, g, t| (g * (f - t), g)),
        }
    }
}

impl Evaluate<'_> {
    #[inline(always)]
    fn of_loss(self, residual: impl Fn(f64, f64, f64, f64) -> (f64, f64)) {
        match self.saturation {
            None => self.each(residual, |r| (r * r, 1.0)),
            Some((kind, s)) => {
                let (square, inverse) = (s * s, 1.0 / (s * s));
                let rho = |r: f64| {
                    let (rho, weight, _) = kind.rho(r * r * inverse);
                    (square * rho, weight)
                };
                self.each(residual, rho);
            }
        }
    }

    #[inline(always)]
    fn each(self, residual: impl Fn(f64, f64, f64, f64) -> (f64, f64), rho: impl Fn(f64) -> (f64, f64)) {
        let n = self.data.f.len();
        let Data { f, cos_i, gain, target, w } = self.data;
        let (f, cos_i, gain, target, w) = (&f[..n], &cos_i[..n], &gain[..n], &target[..n], &w[..n]);
        let out = self.out;
        let (r, slope, trust) = (&mut out.r[..n], &mut out.slope[..n], &mut out.trust[..n]);
        let (pull, curvature) = (&mut out.pull[..n], &mut out.curvature[..n]);
        for i in 0..n {
            let (ri, si) = residual(f[i], cos_i[i], gain[i], target[i]);
            let (cost, ti) = rho(ri);
            r[i] = ri;
            slope[i] = si;
            trust[i] = ti;
            let ws = w[i] * ti * si;
            curvature[i] = ws * si;
            // The cost waits where the pull will stand.
            pull[i] = cost;
        }
        out.cost = dot(w, pull);
        for i in 0..n {
            pull[i] = w[i] * trust[i] * slope[i] * r[i];
        }
    }
}

/// Products of the columns with each other and with the residuals.
struct Products<'a> {
    columns: &'a [Vec<f64>],
    of: &'a Residuals,
    into: &'a mut Sums,
}

impl Kernel for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (a, column) in self.columns.iter().enumerate() {
            self.into.gradient[a] = dot(&self.of.pull, column);
            if self.into.normal.nrows() > a {
                for (b, other) in self.columns[..=a].iter().enumerate() {
                    self.into.normal[(a, b)] = dot3(&self.of.curvature, column, other);
                }
            }
        }
    }
}

/// Σ weight·col·col for several weights at once, lower triangles.
pub(super) struct Weighted<'a> {
    pub columns: &'a [Vec<f64>],
    pub weight: &'a [f64],
    pub into: &'a mut DMatrix<f64>,
}

impl Kernel for Weighted<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (a, column) in self.columns.iter().enumerate() {
            for (b, other) in self.columns[..=a].iter().enumerate() {
                self.into[(a, b)] += dot3(self.weight, column, other);
            }
        }
    }
}
