//! Passes over the samples: each returns a few dozen sums, however many samples there are. Sums run in blocks of fixed size,
//! in a fixed order, so they do not depend on the number of threads.

use nalgebra::{DMatrix, DVector};

use super::loss::{Loss, RobustKind};
use super::samples::{Block, Samples, Transforms};
use super::transform::Transform;
use crate::brdf::LobeKind;
use crate::numeric::simd::{Kernel, dot, dot_vectorised, dot3, vectorised};

/// A lobe of the model at given shapes (natural units).
#[derive(Debug, Clone)]
pub(super) struct ShapedLobe {
    pub kind: LobeKind,
    pub shape: Vec<f64>,
}

/// How residuals count: a robust loss with its s (in the residual's unit), if any.
pub(super) type Saturation = Option<(RobustKind, f64)>;

/// What a pass works out of a block, in lists that are used again for the next one.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// Basis columns: lobe values φ, then for each shape parameter dφ/dt with t = ln(shape).
    pub columns: Vec<Vec<f64>>,
    /// Model values f of one channel.
    pub f: Vec<f64>,
    /// Residuals r.
    pub r: Vec<f64>,
    /// ∂r/∂f.
    pub slope: Vec<f64>,
    /// ρ′, the robust weight; empty without a robust loss, where it is 1.
    pub trust: Vec<f64>,
    /// w ρ′ r ∂r/∂f: half the cost's slope by f.
    pub pull: Vec<f64>,
    /// What products of columns are weighted by.
    pub weight: Vec<f64>,
    /// r, ∂r/∂f and pull of the partners, where the block is folded.
    pub swapped: [Vec<f64>; 3],
}

impl Scratch {
    /// Fills the columns.
    pub fn basis(&mut self, block: &Block, lobes: &[ShapedLobe]) {
        let slopes: usize = lobes.iter().map(|l| l.shape.len()).sum();
        self.columns.resize_with(lobes.len() + slopes, Vec::new);
        self.columns.iter_mut().for_each(|c| c.resize(block.len(), 0.0));
        let (values, derivatives) = self.columns.split_at_mut(lobes.len());
        let mut next = 0;
        for (lobe, phi) in lobes.iter().zip(values) {
            let own = &mut derivatives[next..next + lobe.shape.len()];
            next += lobe.shape.len();
            if own.is_empty() {
                // A lobe without a shape is the same wherever both directions are above the horizon, as all samples' are.
                phi.fill(lobe.kind.lobe().value(&[], 0.0, &mut []));
            } else {
                lobe.kind.lobe().fill(&lobe.shape, &block.x, phi, own);
            }
            for (list, s) in own.iter_mut().zip(&lobe.shape) {
                vectorised(Scale(list, *s));
            }
        }
    }

    /// Fills model values, residuals and what follows from them for one channel with weights `x`, and returns its Σ w s² ρ. The columns must
    /// be there.
    pub fn residuals(
        &mut self,
        samples: &Samples<'_>,
        block: &Block,
        channel: usize,
        x: &DVector<f64>,
        saturation: Saturation,
    ) -> f64 {
        let n = block.len();
        [&mut self.f, &mut self.r, &mut self.slope, &mut self.pull].into_iter().for_each(|l| l.resize(n, 0.0));
        vectorised(Model { phi: &self.columns[..x.len()], x: x.as_slice(), f: &mut self.f });
        let (w, y) = (block.weight(channel), &block.y[channel]);
        samples.gain(&block.cos_i, y, channel, &mut self.slope);
        if samples.loss.is_linear() && saturation.is_none() {
            self.trust.clear();
            let (r, pull) = (&mut self.r, &mut self.pull);
            let cost = vectorised(Linear { f: &self.f, y, w, gain: &self.slope, r, pull });
            let Some(other) = &block.swapped else { return cost };
            let [r, slope, pull] = &mut self.swapped;
            [&mut *r, slope, pull].into_iter().for_each(|l| l.resize(n, 0.0));
            let (w, y) = (other.weight(channel), &other.y[channel]);
            samples.gain(&other.cos_i, y, channel, slope);
            return cost + vectorised(Linear { f: &self.f, y, w, gain: slope, r, pull });
        }
        self.trust.resize(n, 0.0);
        let data = Data { f: &self.f, cos_i: &block.cos_i, y, w };
        let out = Out { r: &mut self.r, slope: &mut self.slope, trust: &mut self.trust, pull: &mut self.pull };
        vectorised(Evaluate { loss: samples.loss, saturation, data, out })
    }

    /// Fills the weight with w ρ′ (∂r/∂f)², the Gauss–Newton weight; partners of a folded block are added.
    pub fn curvature(&mut self, block: &Block, channel: usize) {
        let n = block.len();
        self.weight.resize(n, 0.0);
        let (slope, trust, w) = (&self.slope, &self.trust, block.weight(channel));
        let plain = w.iter().zip(slope).map(|(w, s)| w * s * s);
        if trust.is_empty() {
            self.weight.iter_mut().zip(plain).for_each(|(to, v)| *to = v);
        } else {
            self.weight.iter_mut().zip(plain.zip(trust)).for_each(|(to, (v, t))| *to = v * t);
        }
        if let Some(other) = &block.swapped {
            let also = other.weight(channel).iter().zip(&self.swapped[1]).map(|(w, s)| w * s * s);
            self.weight.iter_mut().zip(also).for_each(|(to, v)| *to += v);
        }
    }

    /// Fills the weight with the squared pull; partners of a folded block are added.
    pub fn squared_pull(&mut self, block: &Block) {
        self.weight.resize(block.len(), 0.0);
        vectorised(AddSquares { of: &self.pull, to: &mut self.weight, keep: 0.0 });
        if block.swapped.is_some() {
            vectorised(AddSquares { of: &self.swapped[2], to: &mut self.weight, keep: 1.0 });
        }
    }

    /// Adds the partners' pull, so that the sums over the near half are those over both.
    pub fn join_pull(&mut self, block: &Block) {
        if block.swapped.is_some() {
            self.pull.iter_mut().zip(&self.swapped[2]).for_each(|(a, b)| *a += b);
        }
    }

    /// Adds Σ pull·col and the lower triangle of Σ weight·col·col.
    pub fn tally(&self, columns: usize, gradient: &mut DVector<f64>, products: &mut DMatrix<f64>) {
        let into = Into { gradient: gradient.as_mut_slice(), products };
        let (list, pull, weight) = (&self.columns[..columns], &self.pull[..], &self.weight[..]);
        match columns {
            1 => vectorised(Tally::<1> { columns: list, pull, weight, into }),
            2 => vectorised(Tally::<2> { columns: list, pull, weight, into }),
            3 => vectorised(Tally::<3> { columns: list, pull, weight, into }),
            4 => vectorised(Tally::<4> { columns: list, pull, weight, into }),
            5 => vectorised(Tally::<5> { columns: list, pull, weight, into }),
            _ => {
                vectorised(Projected { columns: list, on: pull, into: into.gradient });
                vectorised(Weighted { columns: list, weight, into: into.products });
            }
        }
    }
}

/// keep · to + of².
struct AddSquares<'a> {
    of: &'a [f64],
    to: &'a mut [f64],
    keep: f64,
}

impl Kernel for AddSquares<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.to.iter_mut().zip(self.of).for_each(|(to, v)| *to = v.mul_add(*v, self.keep * *to));
    }
}

struct Scale<'a>(&'a mut [f64], f64);

impl Kernel for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.0.iter_mut().for_each(|v| *v *= self.1);
    }
}

/// f = Σ x φ.
struct Model<'a> {
    phi: &'a [Vec<f64>],
    x: &'a [f64],
    f: &'a mut [f64],
}

impl Kernel for Model<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.f.fill(0.0);
        for (phi, x) in self.phi.iter().zip(self.x) {
            self.f.iter_mut().zip(phi).for_each(|(f, p)| *f = x.mul_add(*p, *f));
        }
    }
}

struct Into<'a> {
    gradient: &'a mut [f64],
    products: &'a mut DMatrix<f64>,
}

/// All sums of K columns at once, in registers.
struct Tally<'a, const K: usize> {
    columns: &'a [Vec<f64>],
    pull: &'a [f64],
    weight: &'a [f64],
    into: Into<'a>,
}

/// Running sums side by side.
const LANES: usize = 8;

impl<'a, const K: usize> Kernel for Tally<'a, K> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let n = self.pull.len();
        let chunks = |list: &'a [f64]| list[..n].as_chunks::<LANES>();
        let (pull, pull_rest) = chunks(self.pull);
        let (weight, weight_rest) = chunks(self.weight);
        let mut columns = [(pull, pull_rest); K];
        for a in 0..K {
            columns[a] = chunks(&self.columns[a]);
            columns[a].0 = &columns[a].0[..pull.len()];
        }
        let weight = &weight[..pull.len()];
        let mut gradient = [[0.0f64; LANES]; K];
        let mut products = [[[0.0f64; LANES]; K]; K];
        for i in 0..pull.len() {
            for a in 0..K {
                let column = &columns[a].0[i];
                let mut weighted = [0.0; LANES];
                for k in 0..LANES {
                    gradient[a][k] = pull[i][k].mul_add(column[k], gradient[a][k]);
                    weighted[k] = weight[i][k] * column[k];
                }
                // A fixed range, so that the loops unroll and the sums stay in registers.
                for b in 0..K {
                    if b <= a {
                        let other = &columns[b].0[i];
                        for k in 0..LANES {
                            products[a][b][k] = weighted[k].mul_add(other[k], products[a][b][k]);
                        }
                    }
                }
            }
        }
        for a in 0..K {
            let rest = columns[a].1;
            self.into.gradient[a] += gradient[a].iter().sum::<f64>() + plain_dot(pull_rest, rest);
            for b in 0..=a {
                let last: f64 = weight_rest.iter().zip(rest).zip(columns[b].1).map(|((w, x), y)| w * x * y).sum();
                self.into.products[(a, b)] += products[a][b].iter().sum::<f64>() + last;
            }
        }
    }
}

#[inline(always)]
fn plain_dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
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
        let mut g = vec![0.0; block.len()];
        samples.gain(&block.cos_i, &block.y[c], c, &mut g);
        block.weight(c).iter().zip(&g).map(|(w, g)| w * g * g).collect()
    };
    (0..samples.lists()).map(of).collect()
}

/// The transforms of a linear loss's weights and weighted data (measures: lists, then channels), and each channel's energy
/// Σ w g² y².
pub(super) fn transform(samples: &Samples<'_>) -> Transforms {
    // Each piece has its own sums: few enough that adding them costs nothing, and as many whatever the number of threads.
    let (lists, channels) = (samples.lists(), samples.channels.len());
    let parts = samples.map_pieces(
        || (Transform::new(lists + channels), vec![0.0; channels]),
        |sums, block| {
            let mut values = omega(samples, block);
            for c in 0..channels {
                let weight = &values[if lists == 1 { 0 } else { c }];
                let wy: Vec<f64> = weight.iter().zip(&block.y[c]).map(|(w, y)| w * y).collect();
                sums.1[c] += dot_vectorised(&wy, &block.y[c]);
                values.push(wy);
            }
            sums.0.absorb(&block.x, &values);
        },
    );
    let mut total = (Transform::new(lists + channels), vec![0.0; channels]);
    for (part, energy) in &parts {
        total.0.merge(part);
        total.1.iter_mut().zip(energy).for_each(|(t, e)| *t += e);
    }
    total
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
    let start = || (vec![zero.clone(); weights.len()], Scratch::default());
    let parts = samples.map_folded(start, |(sums, scratch), block| {
        scratch.basis(block, lobes);
        for (c, x) in weights.iter().enumerate() {
            let sums = &mut sums[c];
            sums.cost += scratch.residuals(samples, block, c, x, saturation);
            if matrix > 0 {
                scratch.curvature(block, c);
            }
            scratch.join_pull(block);
            if matrix > 0 {
                scratch.tally(columns, &mut sums.gradient, &mut sums.normal);
            } else {
                let (columns, on) = (&scratch.columns[..columns], &scratch.pull[..]);
                vectorised(Projected { columns, on, into: sums.gradient.as_mut_slice() });
            }
        }
    });
    let mut total = vec![zero.clone(); weights.len()];
    for (part, _) in parts {
        for (total, part) in total.iter_mut().zip(part) {
            total.cost += part.cost;
            total.gradient += part.gradient;
            total.normal += part.normal;
        }
    }
    total.iter_mut().for_each(|s| s.normal.fill_upper_triangle_with_lower_triangle());
    total
}

/// A linear loss: r = g (f − y) and w g r; returns Σ w r².
struct Linear<'a> {
    f: &'a [f64],
    y: &'a [f64],
    w: &'a [f64],
    gain: &'a [f64],
    r: &'a mut [f64],
    pull: &'a mut [f64],
}

impl Kernel for Linear<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
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
struct Data<'a> {
    f: &'a [f64],
    cos_i: &'a [f64],
    y: &'a [f64],
    w: &'a [f64],
}

/// Filled; `slope` holds the ∂r/∂f of a linear loss before.
struct Out<'a> {
    r: &'a mut [f64],
    slope: &'a mut [f64],
    trust: &'a mut [f64],
    pull: &'a mut [f64],
}

struct Evaluate<'a> {
    loss: Loss,
    saturation: Saturation,
    data: Data<'a>,
    out: Out<'a>,
}

/// r and ∂r/∂f from f, cosθi, the gain of a linear loss and y. A trait, so that each loss has loops of its own, inlined into the kernel.
trait Residual {
    fn at(f: f64, cos_i: f64, gain: f64, y: f64) -> (f64, f64);
}

/// s²ρ and ρ′ of a residual.
trait Trust: Copy {
    fn at(self, r: f64) -> (f64, f64);
}

struct Plain;
struct Log;
struct CubeRoot;

impl Residual for Plain {
    #[inline(always)]
    fn at(f: f64, _cos_i: f64, gain: f64, y: f64) -> (f64, f64) {
        (gain * (f - y), gain)
    }
}

impl Residual for Log {
    #[inline(always)]
    fn at(f: f64, cos_i: f64, gain: f64, y: f64) -> (f64, f64) {
        Loss::Log.evaluate(f, cos_i, gain, y)
    }
}

impl Residual for CubeRoot {
    #[inline(always)]
    fn at(f: f64, cos_i: f64, gain: f64, y: f64) -> (f64, f64) {
        Loss::CubeRoot.evaluate(f, cos_i, gain, y)
    }
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
    fn run(self) -> f64 {
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
            (r[i], slope[i]) = R::at(f[i], cos_i[i], slope[i], y[i]);
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

/// Σ list·col of every column.
pub(super) struct Projected<'a> {
    pub columns: &'a [Vec<f64>],
    pub on: &'a [f64],
    pub into: &'a mut [f64],
}

impl Kernel for Projected<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.into.iter_mut().zip(self.columns).for_each(|(to, column)| *to += dot(self.on, column));
    }
}

/// Σ weight·col·col, the lower triangle.
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
