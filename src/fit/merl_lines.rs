//! The samples of a MERL table, line by line, without lists of directions: on a line of constant θh and θd the samples within the
//! angular limit are one run of φd, and everything else comes from a few sines.

use std::ops::Range;

use super::folded::ROOM;
use super::samples::Block;
use crate::geometry::HalfDiff;
use crate::measurement::{MerlAngles, MerlGrid};
use crate::numeric::simd::{Kernel, Simd, ln_1p, map, vectorised};

/// Lines of a block: it fixes how sums are bracketed, so it must not depend on the number of threads.
const LINES: usize = 5;

/// The geometry of the grid.
#[derive(Debug)]
pub(super) struct MerlLines {
    /// (sin, cos) of θh and θd at every bin.
    theta_h: Vec<(f64, f64)>,
    theta_d: Vec<(f64, f64)>,
    /// cosφd and sin²φd at every bin, and a row of zeros.
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

    /// a and b of cosθi = a − b cosφd and cosθo = a + b cosφd.
    #[inline(always)]
    pub fn cosines(&self) -> (f64, f64) {
        (self.theta_h.1 * self.theta_d.1, self.theta_h.0 * self.theta_d.0)
    }

    /// 1 − cosα = 2 sin²θh (1 − sin²θd sin²φd): small differences keep their digits.
    #[inline(always)]
    pub fn versines(&self, sin_phi_squared: &[f64], out: &mut [f64]) {
        let (twice_h, d) = (2.0 * self.theta_h.0 * self.theta_h.0, self.theta_d.0 * self.theta_d.0);
        map(sin_phi_squared, sin_phi_squared, out, |s, _| twice_h * d.mul_add(-s, 1.0));
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
            cos_phi: phi.iter().map(|p| p.1).chain([0.0; ROOM]).collect(),
            sin_phi_squared: phi.iter().map(|p| p.0 * p.0).chain([0.0; ROOM]).collect(),
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
        let (before, after) = self.cos_phi[..MerlGrid::PHI_D].split_at(MerlGrid::PHI_D / 2);
        let start = before.partition_point(|cos| !inside(cos));
        let end = before.len() + after.partition_point(inside);
        if start == end {
            return None;
        }
        let first = line * MerlGrid::PHI_D + start;
        let weight = if self.solid_angle { MerlGrid::solid_angle(first) } else { 1.0 };
        Some(Line { first, bins: start..end, weight, theta_h, theta_d })
    }

    /// Appends cosθi and 1 − cosα of a line to a block ([`finish`] makes it ln cosα).
    pub fn append(&self, line: &Line, block: &mut Block) {
        let (a, b) = line.cosines();
        block.cos_i.extend(self.cos_phi[line.bins.clone()].iter().map(|cos| a - b * cos));
        let start = block.x.len();
        block.x.resize(start + line.bins.len(), 0.0);
        line.versines(&self.sin_phi_squared[line.bins.clone()], &mut block.x[start..]);
    }

    /// Whether a line's first sample has no partner at 180° − φd: the lower edge of the first bin.
    pub fn starts_alone(&self, line: &Line) -> bool {
        self.edge && line.bins.start == 0
    }

    /// cosφd from a line's first sample on: a row at least.
    pub fn cos_phi(&self, line: &Line) -> &[f64] {
        &self.cos_phi[line.bins.start..]
    }

    /// sin²φd from a line's first sample on: a row at least.
    pub fn sin_phi_squared(&self, line: &Line) -> &[f64] {
        &self.sin_phi_squared[line.bins.start..]
    }
}

/// ln cosα from 1 − cosα.
#[inline(always)]
pub(super) fn ln_cosines(versines: &mut [f64]) {
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
    fn run<S: Simd>(self, _simd: S) {
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
}
