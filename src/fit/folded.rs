//! A MERL table's lines folded about φd = 90°. Samples at φd and 180° − φd are each other with the directions swapped: they have the
//! same cosα, so every sum over lobes needs the two only together, and half the exponentials.
//!
//! A half's lists end at a whole number of vectors, beyond the last sample with weight 0, so that there are no remainders, and the
//! table's values are read where they lie. Running sums stay in lanes until the pass is over.

use nalgebra::DVector;

use super::bins::Bins;
use super::merl_lines::{Line, MerlLines, ln_cosines};
use super::passes::{Scratch, ShapedLobe};
use super::samples::Samples;
use super::structure::PairSums;
use crate::measurement::MerlGrid;
use crate::numeric::simd::{Eight, Kernel, LANES, Lanes, Simd, vectorised};

/// Room for half a line.
pub(super) const ROOM: usize = 96;
const _: () = assert!(ROOM > MerlGrid::PHI_D / 2 && ROOM.is_multiple_of(LANES));

/// A number for each sample of half a line.
pub(super) type Row = [f64; ROOM];

/// How a line folds.
#[derive(Debug, Clone, Copy, Default)]
struct Fold {
    /// Samples of the line.
    n: usize,
    /// Samples of the near half: the pairs, the one alone, and the middle where there is one.
    near: usize,
    /// Whether the first has no partner: the lower edge of the first bin, whose partner would lie at 180°.
    alone: usize,
}

impl Fold {
    fn of(n: usize, alone: bool) -> Self {
        let alone = usize::from(alone);
        Self { n, near: n - (n - alone) / 2, alone }
    }

    /// Samples of the near half that have a partner.
    fn partners(self) -> std::ops::Range<usize> {
        self.alone..self.alone + self.n - self.near
    }

    /// The near half's length in whole vectors.
    #[inline(always)]
    fn padded(self) -> usize {
        self.near.next_multiple_of(LANES).min(ROOM)
    }
}

/// One half of a line.
#[derive(Debug, Clone)]
struct Half {
    /// Weight before normalisation, 0 where there is no sample.
    weight: Row,
    /// ∂r/∂f of a linear loss: cosθi or 1.
    gain: Row,
}

/// A folded line: its near half, and the partners in the same order.
#[derive(Debug, Clone)]
pub(super) struct FoldedLine {
    fold: Fold,
    /// Entry of the first sample.
    first: usize,
    /// Coordinate of each sample and its partner, −∞ where the lobes are 0.
    x: Row,
    halves: [Half; 2],
}

impl Default for FoldedLine {
    fn default() -> Self {
        let half = Half { weight: [0.0; ROOM], gain: [0.0; ROOM] };
        Self { fold: Fold::default(), first: 0, x: [0.0; ROOM], halves: [half.clone(), half] }
    }
}

impl FoldedLine {
    /// Takes a line; `cosine` says whether residuals are times cosθi.
    pub fn set(&mut self, lines: &MerlLines, line: &Line, cosine: bool) {
        self.first = line.first;
        self.fold = Fold::of(line.entries().len(), lines.starts_alone(line));
        let (cos_phi, sin_phi_squared) = (lines.cos_phi(line), lines.sin_phi_squared(line));
        vectorised(Set { line, cos_phi, sin_phi_squared, cosine, to: self });
    }

    /// A channel's values on the near half; beyond its end whatever stands there, NaN where nothing does.
    #[inline(always)]
    fn near<'a>(&self, plane: &'a [f64], spare: &'a mut Row) -> &'a [Eight] {
        let rest = &plane[self.first..];
        let row = rest.first_chunk::<ROOM>().unwrap_or_else(|| {
            *spare = [f64::NAN; ROOM];
            spare.iter_mut().zip(rest).for_each(|(to, v)| *to = *v);
            spare
        });
        row[..self.fold.padded()].as_chunks().0
    }

    /// A channel's values on the far half, in the order of their partners.
    #[inline(always)]
    fn far<'a>(&self, plane: &[f64], into: &'a mut Row) -> &'a [Eight] {
        let (end, m) = (self.first + self.fold.n + self.fold.alone, self.fold.padded());
        let into = &mut into[..m];
        if let Some(row) = plane.get(..end).and_then(|before| before.last_chunk::<ROOM>()) {
            let row = &row[ROOM - m..];
            // In the order of the table, which the memory is quickest in.
            for (to, from) in into.as_chunks_mut::<LANES>().0.iter_mut().rev().zip(row.as_chunks::<LANES>().0) {
                *to = std::array::from_fn(|k| from[LANES - 1 - k]);
            }
        } else {
            let value = |i: usize| end.checked_sub(1 + i).and_then(|e| plane.get(e)).copied().unwrap_or(f64::NAN);
            into.iter_mut().enumerate().for_each(|(i, to)| *to = value(i));
        }
        into.as_chunks().0
    }
}

/// Reads a number of every cache line of these entries, so that memory delivers them all at once instead of one after the other.
pub(super) fn touch(plane: &[f64], entries: std::ops::Range<usize>) {
    let mut all = 0;
    for v in plane[entries].iter().step_by(8) {
        all |= v.to_bits();
    }
    std::hint::black_box(all);
}

struct Set<'a> {
    line: &'a Line,
    cos_phi: &'a [f64],
    sin_phi_squared: &'a [f64],
    cosine: bool,
    to: &'a mut FoldedLine,
}

impl Kernel for Set<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) {
        let (near, partners, m) = (self.to.fold.near, self.to.fold.partners(), self.to.fold.padded());
        let (a, b) = if self.cosine { self.line.cosines() } else { (1.0, 0.0) };
        let w = self.line.weight;
        let (cos_phi, [first, second]) = (&self.cos_phi[..m], &mut self.to.halves);
        for i in 0..m {
            first.gain[i] = a - b * cos_phi[i];
            second.gain[i] = a + b * cos_phi[i];
        }
        for i in 0..m {
            first.weight[i] = if i < near { w } else { 0.0 };
            second.weight[i] = if i >= partners.start && i < partners.end { w } else { 0.0 };
        }
        self.line.versines(&self.sin_phi_squared[..m], &mut self.to.x[..m]);
        ln_cosines(&mut self.to.x[..m]);
    }
}

/// Room for a channel's values where they can't be read in place.
type Spare = [Row; 2];

/// Sums over a run of lines for the transforms of a linear loss; `M` channels that share one mask.
pub(super) struct Gathered<const M: usize> {
    /// Measures: w g², then w g² y of every channel.
    pub bins: Bins,
    seen: SeenLanes<M>,
    line: FoldedLine,
    spare: [Spare; M],
    measures: Vec<Row>,
}

/// What is found of the samples on the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<const M: usize> {
    /// Samples that count.
    pub count: f64,
    /// Σ w over them, before normalisation.
    pub weight: f64,
    /// Σ w g² y² of each channel.
    pub energy: [f64; M],
    /// Largest |y|.
    pub largest: f64,
    /// Values that are masked where another channel's are not.
    pub unlike: f64,
}

impl<const M: usize> Default for Seen<M> {
    fn default() -> Self {
        Self { count: 0.0, weight: 0.0, energy: [0.0; M], largest: 0.0, unlike: 0.0 }
    }
}

impl<const M: usize> Seen<M> {
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.weight += other.weight;
        self.energy.iter_mut().zip(&other.energy).for_each(|(a, b)| *a += b);
        self.largest = self.largest.max(other.largest);
        self.unlike += other.unlike;
    }
}

/// [`Seen`] in lanes.
struct SeenLanes<const M: usize> {
    count: Eight,
    weight: Eight,
    energy: [Eight; M],
    largest: Eight,
    unlike: Eight,
}

impl<const M: usize> Gathered<M> {
    pub fn new() -> Self {
        let zero = [0.0; LANES];
        Self {
            bins: Bins::new(1 + M),
            seen: SeenLanes { count: zero, weight: zero, energy: [zero; M], largest: zero, unlike: zero },
            line: FoldedLine::default(),
            spare: [[[0.0; ROOM]; 2]; M],
            measures: vec![[0.0; ROOM]; 1 + M],
        }
    }

    /// Adds a line of the channels' planes.
    pub fn add(&mut self, lines: &MerlLines, line: &Line, planes: [&[f64]; M], cosine: bool) {
        let Self { bins, seen, line: folded, spare, measures } = self;
        planes.iter().for_each(|plane| touch(plane, line.entries()));
        folded.set(lines, line, cosine);
        vectorised(Measure { line: folded, planes, spare, sums: measures, seen });
        bins.absorb(&folded.x[..folded.fold.near], measures);
    }

    pub fn seen(&self) -> Seen<M> {
        let total = |lanes: &Eight| lanes.iter().sum::<f64>();
        Seen {
            count: total(&self.seen.count),
            weight: total(&self.seen.weight),
            energy: self.seen.energy.each_ref().map(total),
            largest: self.seen.largest.into_iter().fold(0.0, f64::max),
            unlike: total(&self.seen.unlike),
        }
    }
}

/// w g² and w g² y on a line, partners added.
struct Measure<'a, const M: usize> {
    line: &'a FoldedLine,
    planes: [&'a [f64]; M],
    spare: &'a mut [Spare; M],
    sums: &'a mut [Row],
    seen: &'a mut SeenLanes<M>,
}

impl<const M: usize> Kernel for Measure<'_, M> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { line, planes, spare, sums, seen } = self;
        let mut values: [[&[Eight]; 2]; M] = [[&[]; 2]; M];
        for (c, [near, far]) in spare.iter_mut().enumerate() {
            values[c] = [line.near(planes[c], near), line.far(planes[c], far)];
        }
        let load = |from: &Eight| Lanes::load(simd, from);
        let one = Lanes::splat(simd, 1.0);
        let (mut count, mut weight, mut unlike) = (load(&seen.count), load(&seen.weight), load(&seen.unlike));
        let (mut energy, mut largest) = (seen.energy.each_ref().map(load), load(&seen.largest));
        let halves = line.halves.each_ref().map(|h| (h.weight.as_chunks().0, h.gain.as_chunks().0));
        for i in 0..line.fold.padded() / LANES {
            let (mut omega, mut valid, mut known) = ([one; 2], [one; 2], [one; 2]);
            for side in 0..2 {
                let (w, g) = (load(&halves[side].0[i]), load(&halves[side].1[i]));
                let first = load(&values[0][side][i]);
                known[side] = one.where_positive(w);
                valid[side] = known[side].where_known(first);
                omega[side] = (w * g * g).where_known(first);
                count = count + valid[side];
                weight = w.mul_add(valid[side], weight);
            }
            (omega[0] + omega[1]).store(&mut sums[0].as_chunks_mut().0[i]);
            for c in 0..M {
                let mut sum = Lanes::splat(simd, 0.0);
                for side in 0..2 {
                    let value = load(&values[c][side][i]);
                    let y = value.where_known(value).where_positive(known[side]);
                    let unmatched = known[side].where_known(value) - valid[side];
                    unlike = unmatched.mul_add(unmatched, unlike);
                    let product = omega[side] * y;
                    energy[c] = product.mul_add(y, energy[c]);
                    largest = largest.max(y.abs());
                    sum = sum + product;
                }
                sum.store(&mut sums[1 + c].as_chunks_mut().0[i]);
            }
        }
        count.store(&mut seen.count);
        weight.store(&mut seen.weight);
        unlike.store(&mut seen.unlike);
        largest.store(&mut seen.largest);
        energy.iter().zip(&mut seen.energy).for_each(|(from, to)| from.store(to));
    }
}

/// What products of columns are weighted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Products {
    /// w (∂r/∂f)²: the cost's curvature.
    Curvature,
    /// (w r ∂r/∂f)²: the scatter of the cost's gradient.
    Scatter,
}

/// A pass over true residuals of a linear loss, line by line.
#[derive(Debug, Default)]
pub(super) struct Residuals {
    line: FoldedLine,
    work: Work,
    /// Columns at the line's coordinates, and pull and weight of the channel last filled, partners added.
    pub scratch: Scratch,
}

/// What is worked out of one channel on a line.
#[derive(Debug)]
struct Work {
    spare: Spare,
    /// Residuals and weights of both halves; there is one more than a half has, so that each has a next.
    r: [[f64; ROOM + LANES]; 2],
    w: [[f64; ROOM + LANES]; 2],
}

impl Default for Work {
    fn default() -> Self {
        let zero = [[0.0; ROOM + LANES]; 2];
        Self { spare: [[0.0; ROOM]; 2], r: zero, w: zero }
    }
}

/// What residuals of one channel say beside their sums with columns.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct OnLines {
    /// Σ w r².
    cost: Eight,
    /// Σ w where the lobes with a shape are 0.
    dark: Eight,
    pub neighbours: PairSums,
}

impl OnLines {
    pub fn cost(&self) -> f64 {
        self.cost.iter().sum()
    }

    pub fn is_dark(&self) -> bool {
        self.dark.iter().any(|w| *w > 0.0)
    }
}

impl Residuals {
    /// Goes to a line: its columns.
    pub fn set(&mut self, lines: &MerlLines, line: &Line, samples: &Samples<'_>, lobes: &[ShapedLobe]) {
        let cosine = samples.is_cosine();
        for c in &samples.channels {
            touch(samples.measurement.plane(*c), line.entries());
        }
        self.line.set(lines, line, cosine);
        self.scratch.bare_basis(&self.line.x[..self.line.fold.padded()], lobes);
    }

    /// Residuals of a channel with weights `x`.
    pub fn fill(
        &mut self,
        samples: &Samples<'_>,
        channel: usize,
        x: &DVector<f64>,
        products: Products,
        sums: &mut OnLines,
    ) {
        self.scratch.model(x);
        let (factor, unit) = (samples.factor(channel), 1.0 / samples.scale);
        let plane = samples.measurement.plane(samples.channels[channel]);
        let (line, work) = (&self.line, &mut self.work);
        let Scratch { f, pull, weight, .. } = &mut self.scratch;
        pull.resize(f.len(), 0.0);
        weight.resize(f.len(), 0.0);
        vectorised(Fill { line, work, plane, factor, unit, products, f, pull, weight, sums });
    }
}

struct Fill<'a> {
    line: &'a FoldedLine,
    work: &'a mut Work,
    plane: &'a [f64],
    factor: f64,
    unit: f64,
    products: Products,
    f: &'a [f64],
    pull: &'a mut [f64],
    weight: &'a mut [f64],
    sums: &'a mut OnLines,
}

impl Kernel for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { line, sums, work: Work { spare: [near, far], r, w }, .. } = self;
        let load = |from: &Eight| Lanes::load(simd, from);
        let (factor, unit) = (Lanes::splat(simd, self.factor), Lanes::splat(simd, -self.unit));
        let values = [line.near(self.plane, near), line.far(self.plane, far)];
        let (f, x) = (self.f.as_chunks().0, line.x.as_chunks().0);
        let (pull, weight) = (self.pull.as_chunks_mut().0, self.weight.as_chunks_mut().0);
        let (mut cost, mut dark) = (load(&sums.cost), load(&sums.dark));
        let vectors = line.fold.padded() / LANES;
        for i in 0..vectors {
            let (mut joint, mut joint_weight) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 0.0));
            for side in 0..2 {
                let y = load(&values[side][i]);
                let g = load(&line.halves[side].gain.as_chunks().0[i]);
                let own = (factor * load(&line.halves[side].weight.as_chunks().0[i])).where_known(y);
                let residual = (g * y.mul_add(unit, load(&f[i]))).where_positive(own);
                let (weighted, curvature) = (own * residual, own * g * g);
                cost = weighted.mul_add(residual, cost);
                dark = dark + own.where_dark(load(&x[i]));
                residual.store(&mut r[side].as_chunks_mut().0[i]);
                own.store(&mut w[side].as_chunks_mut().0[i]);
                let score = weighted * g;
                joint = joint + score;
                joint_weight = match self.products {
                    Products::Scatter => score.mul_add(score, joint_weight),
                    Products::Curvature => joint_weight + curvature,
                };
            }
            joint.store(&mut pull[i]);
            joint_weight.store(&mut weight[i]);
        }
        cost.store(&mut sums.cost);
        dark.store(&mut sums.dark);
        for (r, w) in r.iter_mut().zip(w) {
            (r[vectors * LANES], w[vectors * LANES]) = (0.0, 0.0);
            sums.neighbours.add_row(simd, r, w, vectors);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::samples::Block;
    use crate::measurement::MerlAngles;

    /// The fold keeps Σ ω e^{sx} and Σ ω y e^{sx} of every line, masked values left out.
    #[test]
    fn folded_sums_are_those_over_all_samples() {
        let value = |k: usize| if k % 7 == 3 { f64::NAN } else { 0.3 + (k as f64 * 0.7).sin() };
        let plane: Vec<f64> = (0..MerlGrid::LEN).map(value).collect();
        for (angles, limit) in [(MerlAngles::Center, 80.0f64), (MerlAngles::Edge, 90.0), (MerlAngles::Edge, 35.5)] {
            let lines = MerlLines::new(MerlGrid { angles }, limit.to_radians().cos() - 1e-12, true);
            for b in 0..MerlLines::blocks() {
                for line in lines.lines(b) {
                    let mut folded = Gathered::<2>::new();
                    folded.add(&lines, &line, [&plane, &plane], true);
                    let mut block = Block::default();
                    lines.append(&line, &mut block);
                    super::super::merl_lines::finish(&mut block);
                    compare(&folded, &line, &block, &plane[line.entries()]);
                }
            }
        }
    }

    fn compare(folded: &Gathered<2>, line: &Line, block: &Block, y: &[f64]) {
        for s in [0.0, 1.0, 20.0] {
            let lobe = |x: &f64| if x.is_finite() { (s * x).exp() } else { 0.5 };
            let mut want = [0.0; 2];
            for ((y, g), x) in y.iter().zip(&block.cos_i).zip(&block.x).filter(|((y, _), _)| !y.is_nan()) {
                let omega = line.weight * g * g * lobe(x);
                want = [want[0] + omega, want[1] + omega * y];
            }
            for (m, want) in [(0, want[0]), (1, want[1]), (2, want[1])] {
                let x = &folded.line.x[..folded.line.fold.near];
                let got: f64 = folded.measures[m].iter().zip(x).map(|(v, x)| v * lobe(x)).sum();
                assert!((got - want).abs() <= 1e-13 * line.weight * 180.0, "{got} {want}");
            }
        }
        let seen = folded.seen();
        assert_eq!(seen.count as usize, y.iter().filter(|y| !y.is_nan()).count());
        assert_eq!(seen.unlike, 0.0);
    }
}
