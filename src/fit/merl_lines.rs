//! The samples of a MERL table, line by line, without lists of directions: on a line of constant θh and θd the samples within the
//! angular limit are one run of φd, and everything else comes from a few sines.

use std::ops::Range;

use super::samples::Block;
use crate::geometry::HalfDiff;
use crate::measurement::{MerlAngles, MerlGrid};
use crate::numeric::simd::{Kernel, dot, ln_1p, map, vectorised};

/// Lines of a block: it fixes how sums are bracketed, so it must not depend on the number of threads.
const LINES: usize = 5;

/// The geometry of the grid.
#[derive(Debug)]
pub(super) struct MerlLines {
    /// (sin, cos) of θh and θd at every bin.
    theta_h: Vec<(f64, f64)>,
    theta_d: Vec<(f64, f64)>,
    cos_phi: Vec<f64>,
    sin_phi_squared: Vec<f64>,
    /// Least cosine of θi and θo, positive.
    least_cos: f64,
    solid_angle: bool,
    /// Whether entries are read at the lower edges of their bins.
    edge: bool,
}

/// A run of samples: entries `first` on, at φd bins `bins`.
#[derive(Debug, Clone)]
pub(super) struct Line {
    /// Entry of the first sample.
    pub first: usize,
    bins: Range<usize>,
    /// Weight of each sample, before normalisation.
    pub weight: f64,
    theta_h: (f64, f64),
    theta_d: (f64, f64),
}

impl Line {
    /// Entries of the line.
    pub fn entries(&self) -> Range<usize> {
        self.first..self.first + self.bins.len()
    }
}

impl MerlLines {
    /// The lines of a grid; samples whose directions have a cosine below `least_cos` are left out.
    pub fn new(grid: MerlGrid, least_cos: f64, solid_angle: bool) -> Self {
        let angles = |entry: usize| grid.half_diff(entry);
        let row = |of: fn(&HalfDiff) -> f64, step: usize, count: usize| -> Vec<(f64, f64)> {
            (0..count).map(|i| of(&angles(i * step)).sin_cos()).collect()
        };
        let phi = row(|a| a.phi_d, 1, MerlGrid::PHI_D);
        Self {
            theta_h: row(|a| a.theta_h, MerlGrid::THETA_D * MerlGrid::PHI_D, MerlGrid::THETA_H),
            theta_d: row(|a| a.theta_d, MerlGrid::PHI_D, MerlGrid::THETA_D),
            cos_phi: phi.iter().map(|p| p.1).collect(),
            sin_phi_squared: phi.iter().map(|p| p.0 * p.0).collect(),
            least_cos: least_cos.max(f64::MIN_POSITIVE),
            solid_angle,
            edge: grid.angles == MerlAngles::Edge,
        }
    }

    /// Number of blocks.
    pub fn blocks() -> usize {
        MerlGrid::THETA_H * MerlGrid::THETA_D / LINES
    }

    /// The lines of block `b` that have samples.
    pub fn lines(&self, b: usize) -> impl Iterator<Item = Line> {
        (b * LINES..(b + 1) * LINES).filter_map(|line| self.line(line))
    }

    fn line(&self, line: usize) -> Option<Line> {
        let (theta_h, theta_d) = (self.theta_h[line / MerlGrid::THETA_D], self.theta_d[line % MerlGrid::THETA_D]);
        // cosθi and cosθo are a ∓ b cosφd, so both reach `least_cos` where |cosφd| is at most a bound: a run about 90°.
        let (a, b) = (theta_h.1 * theta_d.1, theta_h.0 * theta_d.0);
        let inside = |cos: &f64| a - b * cos.abs() >= self.least_cos;
        let start = self.cos_phi.iter().position(inside)?;
        let end = self.cos_phi.iter().rposition(inside)? + 1;
        let first = line * MerlGrid::PHI_D + start;
        let weight = if self.solid_angle { MerlGrid::solid_angle(first) } else { 1.0 };
        Some(Line { first, bins: start..end, weight, theta_h, theta_d })
    }

    /// Appends cosθi and 1 − cosα of a line to a block ([`finish`] makes it ln cosα); to a folded one, of the near half and its
    /// partners.
    pub fn append(&self, line: &Line, block: &mut Block) -> Option<Fold> {
        let (a, b) = (line.theta_h.1 * line.theta_d.1, line.theta_h.0 * line.theta_d.0);
        let fold = block.swapped.is_some().then(|| self.fold(line));
        let cos_phi = &self.cos_phi[line.bins.clone()][..fold.map_or(line.bins.len(), Fold::len)];
        block.cos_i.extend(cos_phi.iter().map(|cos| a - b * cos));
        if let Some(swapped) = &mut block.swapped {
            swapped.cos_i.extend(cos_phi.iter().map(|cos| a + b * cos));
        }
        let start = block.x.len();
        block.x.resize(start + cos_phi.len(), 0.0);
        let end = line.bins.start + cos_phi.len();
        versines(line, &self.sin_phi_squared[line.bins.start..end], &mut block.x[start..]);
        fold
    }

    #[inline(always)]
    fn fold(&self, line: &Line) -> Fold {
        Fold::of(line.bins.len(), self.edge && line.bins.start == 0)
    }
}

/// What a line adds to the transforms of a linear loss: samples at φd and 180° − φd have the same cosα, for they are each other with
/// the directions swapped, so they are added first. `M` channels that share one mask.
pub(super) struct Folded<'a, const M: usize> {
    pub lines: &'a MerlLines,
    pub line: &'a Line,
    /// Each channel's values on the line; NaN where masked.
    pub values: [&'a [f64]; M],
    /// Whether the residual is times cosθi.
    pub cosine: bool,
    /// Filled: coordinates, then w g² and w g² y of every channel.
    pub x: &'a mut Vec<f64>,
    pub sums: &'a mut [Vec<f64>],
    pub seen: &'a mut Seen<M>,
}

/// What is found on the way.
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

/// Room for a line, with some to spare: lists of a multiple of 32 go through the vector units without a remainder.
const ROOM: usize = 192;
type Row = [f64; ROOM];

/// A line's values, padded by `filler`.
#[inline(always)]
fn padded(values: &[f64], filler: f64) -> Row {
    let mut row = [filler; ROOM];
    row[..values.len()].copy_from_slice(values);
    row
}

impl<const M: usize> Kernel for Folded<'_, M> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let line = self.line;
        let (n, w) = (line.bins.len(), line.weight);
        let (a, b) = (line.theta_h.1 * line.theta_d.1, line.theta_h.0 * line.theta_d.0);
        let fold = self.lines.fold(line);
        let m = n.next_multiple_of(32);
        let cos_phi = padded(&self.lines.cos_phi[line.bins.clone()], 0.0);
        let first = padded(self.values[0], f64::NAN);
        let (mut omega, mut valid, mut y, mut product) = ([0.0; ROOM], [0.0; ROOM], [0.0; ROOM], [0.0; ROOM]);
        map(&first[..m], &first[..m], &mut valid[..m], |v, _| if v.is_nan() { 0.0 } else { 1.0 });
        if self.cosine {
            let gain = |cos: f64| a - b * cos;
            map(&cos_phi[..m], &valid[..m], &mut omega[..m], |cos, valid| w * gain(cos) * gain(cos) * valid);
        } else {
            map(&valid[..m], &valid[..m], &mut omega[..m], |valid, _| w * valid);
        }
        let count = dot(&valid[..m], &valid[..m]);
        self.seen.count += count;
        self.seen.weight += w * count;
        fold.apply(&omega, &mut self.sums[0]);
        for c in 0..M {
            let values = padded(self.values[c], f64::NAN);
            map(&values[..m], &valid[..m], &mut product[..m], |v, valid| if v.is_nan() { valid } else { 1.0 - valid });
            self.seen.unlike += dot(&product[..m], &product[..m]);
            map(&values[..m], &values[..m], &mut y[..m], |v, _| if v.is_nan() { 0.0 } else { v });
            map(&omega[..m], &y[..m], &mut product[..m], |omega, y| omega * y);
            self.seen.energy[c] += dot(&product[..m], &y[..m]);
            self.seen.largest = largest(&y[..m], self.seen.largest);
            fold.apply(&product, &mut self.sums[1 + c]);
        }
        let half = fold.len().next_multiple_of(32);
        let squares = padded(&self.lines.sin_phi_squared[line.bins.start..line.bins.start + fold.len()], 0.0);
        versines(line, &squares[..half], &mut product[..half]);
        ln_cosines(&mut product[..half]);
        self.x.clear();
        self.x.extend_from_slice(&product[..fold.len()]);
    }
}

/// How a line folds about φd = 90°.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fold {
    /// Samples of the line.
    n: usize,
    /// Whether the first has no partner: the lower edge of the first bin, whose partner would lie at 180°.
    alone: usize,
    pairs: usize,
}

impl Fold {
    #[inline(always)]
    fn of(n: usize, alone: bool) -> Self {
        let alone = usize::from(alone);
        Self { n, alone, pairs: (n - alone) / 2 }
    }

    /// Samples left: the pairs, the one alone, and the middle where there is one.
    #[inline(always)]
    pub fn len(self) -> usize {
        self.n - self.pairs
    }

    /// Which of the samples left have a partner.
    pub fn partners(self) -> std::ops::Range<usize> {
        self.alone..self.alone + self.pairs
    }

    /// The partners on the line, in reverse order.
    pub fn far(self) -> std::ops::Range<usize> {
        self.n - self.pairs..self.n
    }

    #[inline(always)]
    fn apply(self, from: &Row, to: &mut Vec<f64>) {
        to.resize(self.len(), 0.0);
        to.copy_from_slice(&from[..self.len()]);
        let near = &mut to[self.alone..self.alone + self.pairs];
        let far = &from[self.n - self.pairs..self.n];
        for i in 0..self.pairs {
            near[i] += far[self.pairs - 1 - i];
        }
    }
}

/// The largest of `start` and all |y|.
#[inline(always)]
fn largest(y: &[f64], start: f64) -> f64 {
    let (chunks, rest) = y.as_chunks::<8>();
    let mut lanes = [start; 8];
    for chunk in chunks {
        for k in 0..8 {
            let size = chunk[k].abs();
            lanes[k] = if size > lanes[k] { size } else { lanes[k] };
        }
    }
    lanes.iter().copied().chain(rest.iter().map(|y| y.abs())).fold(start, f64::max)
}

/// 1 − cosα = 2 sin²θh (1 − sin²θd sin²φd) of a line: small differences keep their digits.
#[inline(always)]
fn versines(line: &Line, sin_phi_squared: &[f64], out: &mut [f64]) {
    let (twice_h, d) = (2.0 * line.theta_h.0 * line.theta_h.0, line.theta_d.0 * line.theta_d.0);
    map(sin_phi_squared, sin_phi_squared, out, |s, _| twice_h * d.mul_add(-s, 1.0));
}

/// ln cosα from 1 − cosα.
#[inline(always)]
fn ln_cosines(versines: &mut [f64]) {
    for x in versines {
        // Where cosα ≤ 0 the logarithm is of some positive number and not used.
        let inside = *x < 1.0;
        let ln = ln_1p(if inside { -*x } else { 0.0 });
        *x = if inside { ln } else { f64::NEG_INFINITY };
    }
}

struct LnCosines<'a>(&'a mut [f64]);

impl Kernel for LnCosines<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        ln_cosines(self.0);
    }
}

/// ln cosα of a block whose coordinates are 1 − cosα so far.
pub(super) fn finish(block: &mut Block) {
    vectorised(LnCosines(&mut block.x));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::lobe::ln_cos_alpha;

    #[test]
    fn lines_are_the_entries_that_pass_one_by_one() {
        for angles in [MerlAngles::Center, MerlAngles::Edge] {
            for limit in [80.0f64, 90.0, 35.5] {
                let grid = MerlGrid { angles };
                let least = limit.to_radians().cos() - 1e-12;
                let lines = MerlLines::new(grid, least, true);
                let mut found = Vec::new();
                for b in 0..MerlLines::blocks() {
                    for line in lines.lines(b) {
                        let mut block = Block::default();
                        lines.append(&line, &mut block);
                        finish(&mut block);
                        for (k, entry) in line.entries().enumerate() {
                            let (wi, wo) = grid.pair(entry);
                            assert!((block.cos_i[k] - wi.z).abs() < 1e-15);
                            let (got, want) = (block.x[k], ln_cos_alpha(wi, wo));
                            let cos = want.exp();
                            let near = (got - want).abs() <= 1e-15 * want.abs().sqrt() + 4e-16 / cos;
                            assert!(near || cos < 1e-15, "entry {entry}: {got:e} vs {want:e}");
                            assert_eq!(line.weight, MerlGrid::solid_angle(entry));
                        }
                        folded_sums_are_the_line_s(&lines, &line, &block);
                        found.extend(line.entries());
                    }
                }
                let passes = |entry: &usize| {
                    let (wi, wo) = grid.pair(*entry);
                    wi.z > 0.0 && wo.z > 0.0 && wi.z >= least && wo.z >= least
                };
                let want: Vec<usize> = (0..MerlGrid::LEN).filter(passes).collect();
                assert_eq!(found.len(), want.len(), "{angles:?} {limit}");
                assert_eq!(found, want, "{angles:?} {limit}");
            }
        }
    }

    /// The fold keeps Σ ω e^{sx} and Σ ω y e^{sx}, masked values left out.
    fn folded_sums_are_the_line_s(lines: &MerlLines, line: &Line, block: &Block) {
        let value = |k: usize| if k % 7 == 3 { f64::NAN } else { 0.3 + (k as f64 * 0.7).sin() };
        let y: Vec<f64> = (0..line.bins.len()).map(value).collect();
        let (mut x, mut sums, mut seen) = (Vec::new(), vec![Vec::new(); 3], Seen::<2>::default());
        let (x_out, values) = (&mut x, [&y[..], &y[..]]);
        vectorised(Folded { lines, line, values, cosine: true, x: x_out, sums: &mut sums, seen: &mut seen });
        for s in [0.0, 1.0, 20.0] {
            let lobe = |x: &f64| if x.is_finite() { (s * x).exp() } else { 0.5 };
            let mut want = [0.0; 2];
            for ((y, g), x) in y.iter().zip(&block.cos_i).zip(&block.x).filter(|((y, _), _)| !y.is_nan()) {
                let omega = line.weight * g * g * lobe(x);
                want = [want[0] + omega, want[1] + omega * y];
            }
            for (m, want) in [(0, want[0]), (1, want[1]), (2, want[1])] {
                let got: f64 = sums[m].iter().zip(&x).map(|(v, x)| v * lobe(x)).sum();
                assert!((got - want).abs() <= 1e-13 * line.weight * 180.0, "{got} {want}");
            }
        }
        assert_eq!(seen.count as usize, y.iter().filter(|y| !y.is_nan()).count());
        assert_eq!((seen.unlike, y.len() < 4), (0.0, y.len() < 4));
    }
}
