//! Passes over the samples: each returns a few dozen sums, however many samples there are. Sums run in blocks of fixed size,
//! in a fixed order, so they do not depend on the number of threads.
//!
//! Sums come in two kinds, each in two ways:
//! - *Transforms* ([`transform`]), of a linear loss's weights and weighted data, from which every cost follows without another pass: sorted
//!   into bins of the coordinate ([`Bins`]); or, where the samples are listed in one block and so few that adding them up takes no longer than
//!   the bins would, kept one by one. A MERL table whose one or three channels share a mask has its bins filled from folded lines as its
//!   samples are gathered.
//! - *True residuals* ([`sums`]), at given shapes and weights, for last digits, other losses and robust ones: block by block; or, for a
//!   linear loss on a MERL table that is not listed, line by line, folded about φd = 90°.

use nalgebra::{DMatrix, DVector};

use super::bins::Bins;
use super::folded::{OnLines, Products, Residuals};
use super::loss::{Loss, RobustKind};
use super::merl_lines::{Line, MerlLines};
use super::residuals::{Bend, Data, Evaluate, Linear, Out};
use super::samples::{Block, Samples, Transforms};
use super::tally::Tallied;
use super::transform::Transform;
use crate::brdf::LobeKind;
use crate::numeric::simd::{Kernel, Simd, dot_vectorised, vectorised};

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
}

impl Scratch {
    /// Fills the columns with the lobes as they are at these coordinates.
    pub fn bare_basis(&mut self, coordinates: &[f64], lobes: &[ShapedLobe]) {
        self.fill(coordinates.len(), lobes, |lobe, phi, own| {
            if own.is_empty() {
                // A lobe without a shape is the same wherever both directions are above the horizon, as all samples' are.
                phi.fill(lobe.kind.lobe().value(&[], 0.0, &mut []));
            } else {
                lobe.kind.lobe().fill(&lobe.shape, coordinates, phi, own);
            }
        });
    }

    /// Fills the columns with the lobes as the samples of a block see them.
    pub fn basis(&mut self, samples: &Samples<'_>, block: &Block, lobes: &[ShapedLobe]) {
        let Some(sight) = &samples.sight else { return self.bare_basis(&block.x, lobes) };
        self.fill(block.len(), lobes, |lobe, phi, own| {
            samples.shown.fill(&**sight, (lobe.kind, &lobe.shape), block, phi, own);
        });
    }

    /// Fills the columns, lists of this length: values of each lobe and their derivatives by `of`.
    fn fill(&mut self, length: usize, lobes: &[ShapedLobe], of: impl Fn(&ShapedLobe, &mut [f64], &mut [Vec<f64>])) {
        let slopes: usize = lobes.iter().map(|l| l.shape.len()).sum();
        self.columns.resize_with(lobes.len() + slopes, Vec::new);
        self.columns.iter_mut().for_each(|c| c.resize(length, 0.0));
        let (values, derivatives) = self.columns.split_at_mut(lobes.len());
        let mut next = 0;
        for (lobe, phi) in lobes.iter().zip(values) {
            let own = &mut derivatives[next..next + lobe.shape.len()];
            next += lobe.shape.len();
            of(lobe, phi, own);
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
        [&mut self.r, &mut self.slope, &mut self.pull].into_iter().for_each(|l| l.resize(n, 0.0));
        self.model(x);
        let (w, y) = (block.weight(channel), &block.y[channel]);
        samples.gain(&block.cos_i, y, channel, &mut self.slope);
        if samples.loss.is_linear() && saturation.is_none() {
            self.trust.clear();
            let (r, pull) = (&mut self.r, &mut self.pull);
            return vectorised(Linear { f: &self.f, y, w, gain: &self.slope, r, pull });
        }
        self.trust.resize(n, 0.0);
        let data = Data { f: &self.f, cos_i: &block.cos_i, y, w };
        let out = Out { r: &mut self.r, slope: &mut self.slope, trust: &mut self.trust, pull: &mut self.pull };
        vectorised(Evaluate { loss: samples.loss, saturation, data, out })
    }

    /// Fills the model values of one channel with weights `x`.
    pub fn model(&mut self, x: &DVector<f64>) {
        self.f.resize(self.columns.first().map_or(0, Vec::len), 0.0);
        vectorised(Model { phi: &self.columns[..x.len()], x: x.as_slice(), f: &mut self.f });
    }

    /// Fills the weight with w ρ′ (∂r/∂f)², the Gauss–Newton weight.
    pub fn curvature(&mut self, block: &Block, channel: usize) {
        self.weight.resize(block.len(), 0.0);
        let plain = block.weight(channel).iter().zip(&self.slope).map(|(w, s)| w * s * s);
        if self.trust.is_empty() {
            self.weight.iter_mut().zip(plain).for_each(|(to, v)| *to = v);
        } else {
            self.weight.iter_mut().zip(plain.zip(&self.trust)).for_each(|(to, (v, t))| *to = v * t);
        }
    }

    /// Fills the weight with the slope of the pull by f: what Newton's method weighs products by. Negative where the loss bends down.
    pub fn bend(&mut self, block: &Block, channel: usize, loss: Loss, saturation: Saturation) {
        self.weight.resize(block.len(), 0.0);
        let Self { r, slope, trust, weight, .. } = self;
        vectorised(Bend {
            loss,
            saturation,
            w: block.weight(channel),
            cos_i: &block.cos_i,
            r,
            slope,
            trust,
            to: weight,
        });
    }

    /// Fills the weight with the squared pull.
    pub fn squared_pull(&mut self) {
        self.weight.clear();
        self.weight.extend(self.pull.iter().map(|p| p * p));
    }
}

struct Scale<'a>(&'a mut [f64], f64);

impl Kernel for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) {
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
    fn run<S: Simd>(self, _simd: S) {
        self.f.fill(0.0);
        for (phi, x) in self.phi.iter().zip(self.x) {
            self.f.iter_mut().zip(phi).for_each(|(f, p)| *f = x.mul_add(*p, *f));
        }
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
        let mut g = vec![0.0; block.len()];
        samples.gain(&block.cos_i, &block.y[c], c, &mut g);
        block.weight(c).iter().zip(&g).map(|(w, g)| w * g * g).collect()
    };
    (0..samples.lists()).map(of).collect()
}

/// What the transforms are of, over a block: the weights w g² of a linear loss, list by list, then the weighted data w g² y, channel by
/// channel. Adds each channel's Σ w g² y² to `energy`.
fn measures(samples: &Samples<'_>, block: &Block, energy: &mut [f64]) -> Vec<Vec<f64>> {
    let mut values = omega(samples, block);
    let lists = values.len();
    for (c, energy) in energy.iter_mut().enumerate() {
        let weight = &values[if lists == 1 { 0 } else { c }];
        let wy: Vec<f64> = weight.iter().zip(&block.y[c]).map(|(w, y)| w * y).collect();
        *energy += dot_vectorised(&wy, &block.y[c]);
        values.push(wy);
    }
    values
}

/// The transforms of a linear loss's weights and weighted data (measures: lists, then channels), and each channel's energy
/// Σ w g² y².
pub(super) fn transform(samples: &Samples<'_>) -> Transforms {
    let (lists, channels) = (samples.lists(), samples.channels.len());
    if let Some(all) = samples.single_block().filter(|all| Transform::are_few(&all.x)) {
        let mut energy = vec![0.0; channels];
        let values = measures(samples, all, &mut energy);
        return (Transform::of_samples(&all.x, &values), energy);
    }
    // Each piece has its own sums: few enough that adding them costs nothing, and as many whatever the number of threads.
    let parts = samples.map_pieces(
        || (Bins::new(lists + channels), vec![0.0; channels]),
        |(bins, energy), block| bins.absorb(&block.x, &measures(samples, block, energy)),
    );
    let (mut bins, mut total) = (Bins::new(lists + channels), vec![0.0; channels]);
    for (part, energy) in &parts {
        bins.merge(part);
        total.iter_mut().zip(energy).for_each(|(t, e)| *t += e);
    }
    (Transform::of_bins(&bins), total)
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

/// The sums of a linear loss, as `zero` has them, over the folded lines of a table; `None` where the samples are no such.
fn line_sums(
    samples: &Samples<'_>,
    lobes: &[ShapedLobe],
    weights: &[DVector<f64>],
    zero: &Sums,
) -> Option<Vec<Vec<Sums>>> {
    let columns = zero.gradient.len();
    let tallied = || if zero.normal.is_empty() { Tallied::gradient(columns) } else { Tallied::new(columns) };
    let start = || (Residuals::default(), vec![(OnLines::default(), tallied()); weights.len()]);
    let on_lines = |(residuals, sums): &mut (Residuals, Vec<_>), lines: &MerlLines, block: &[Line]| {
        for line in block {
            residuals.set(lines, line, samples, lobes);
            for ((found, tallied), (c, x)) in sums.iter_mut().zip(weights.iter().enumerate()) {
                residuals.fill(samples, c, x, Products::Curvature, found);
                Tallied::add(tallied, &residuals.scratch);
            }
        }
    };
    let total = |(found, tallied): &(OnLines, Tallied)| {
        let mut sums = Sums { cost: found.cost(), ..zero.clone() };
        tallied.add_to(&mut sums.gradient, &mut sums.normal);
        sums
    };
    let parts = samples.map_lines(start, on_lines)?;
    Some(parts.iter().map(|(_, channels)| channels.iter().map(total).collect()).collect())
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
    /// As All, with the true slope of the pull by f in place of its Gauss–Newton part.
    Newton,
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
    let start = || vec![zero.clone(); weights.len()];
    let folds = samples.loss.is_linear() && saturation.is_none();
    let lines = folds.then(|| line_sums(samples, lobes, weights, &zero)).flatten();
    let parts: Vec<Vec<Sums>> = lines.unwrap_or_else(|| {
        let on_block = |(sums, scratch): &mut (Vec<Sums>, Scratch), block: &Block| {
            scratch.basis(samples, block, lobes);
            for (sums, (c, x)) in sums.iter_mut().zip(weights.iter().enumerate()) {
                sums.cost += scratch.residuals(samples, block, c, x, saturation);
                if matrix > 0 {
                    match want {
                        Want::Newton => scratch.bend(block, c, samples.loss, saturation),
                        _ => scratch.curvature(block, c),
                    }
                    scratch.tally(columns, &mut sums.gradient, &mut sums.normal);
                } else {
                    project(&scratch.columns[..columns], &scratch.pull, &mut sums.gradient);
                }
            }
        };
        samples.map_pieces(|| (start(), Scratch::default()), on_block).into_iter().map(|(sums, _)| sums).collect()
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

/// Adds Σ list·col of every column.
pub(super) fn project(columns: &[Vec<f64>], list: &[f64], into: &mut DVector<f64>) {
    into.iter_mut().zip(columns).for_each(|(to, column)| *to += dot_vectorised(list, column));
}
