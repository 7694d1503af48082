//! What a fit sees of a measurement: the samples that count, with their weights, data and lobe coordinates, block by block.
//!
//! A MERL table's samples are made block by block from the table itself; of any other measurement they are listed once.

mod block;
mod gather;
mod select;
mod shown;

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

pub(in crate::fit) use block::Block;
use block::Values;
pub(in crate::fit) use select::{Thin, least_cos, offset};
use shown::Shown;

use super::loss::Loss;
use super::merl_lines::{self, Line, MerlLines};
use super::part::SMALL;
use super::transform::Transform;
use crate::brdf::{LobeKind, Sight};
use crate::measurement::{Directions, Measurement};
use crate::numeric::simd::vectorised;
use crate::numeric::sum::BLOCK;

/// Samples of a list that are taken as one when model error is judged.
const CLUSTER: usize = 64;

#[derive(Debug)]
enum Source {
    Listed(Block),
    Merl(MerlLines),
}

/// The samples with a positive weight in at least one channel, in the measurement's order.
#[derive(Debug)]
pub(in crate::fit) struct Samples<'a> {
    /// The table they come from.
    pub measurement: &'a Measurement,
    /// The measurement's channels that are fitted.
    pub channels: Vec<usize>,
    source: Source,
    /// What lobes are seen through, and what it showed.
    pub sight: Option<Arc<dyn Sight>>,
    pub shown: Shown,
    /// The loss they were prepared for.
    pub loss: Loss,
    /// Directions that count.
    count: usize,
    /// Distinct weight lists: 1 where all channels share one.
    lists: usize,
    /// What each raw weight of a table is multiplied by, list by list.
    factor: Vec<f64>,
    /// The power of two that the data were divided by, so that no unit of theirs over- or underflows when squared.
    pub scale: f64,
    /// Samples with a positive weight in each channel.
    pub counts: Vec<usize>,
    /// ε of the relative loss, channel by channel, in the fit's scale.
    pub epsilon: Vec<f64>,
    /// Values that the loss can't take.
    pub refused: usize,
    /// How the samples were weighted: `solid-angle`, `uniform` or `sigma`.
    pub weighting: &'static str,
    /// Whether they stand for more of their kind, so that the last digits of a fit to them are nobody's.
    pub are_drawn: bool,
}

impl Samples<'_> {
    /// Whether residuals are times cosθi.
    pub fn is_cosine(&self) -> bool {
        self.loss == Loss::CosineL2
    }

    /// What the raw weights of a channel of a table are multiplied by.
    pub fn factor(&self, channel: usize) -> f64 {
        self.factor[channel]
    }

    /// Number of directions that count.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether the last digits are worth many passes.
    pub fn want_last_digits(&self) -> bool {
        !self.are_drawn && self.residuals() <= SMALL
    }

    /// Residuals in all: samples × channels, masked ones left out.
    pub fn residuals(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Distinct weight lists of the linear problem: 1 where all channels share one.
    pub fn lists(&self) -> usize {
        if self.loss == Loss::Relative { self.channels.len() } else { self.lists }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        match &self.source {
            Source::Listed(all) => all.len().div_ceil(BLOCK),
            Source::Merl(_) => MerlLines::blocks(),
        }
    }

    /// All samples in one block, where they are listed and fit into one.
    pub fn single_block(&self) -> Option<&Block> {
        match &self.source {
            Source::Listed(all) if all.len() <= BLOCK => Some(all),
            _ => None,
        }
    }

    /// Maps every block in parallel and returns the results in order.
    pub fn map_blocks<T: Send>(&self, map: impl Fn(&Block) -> T + Sync + Send) -> Vec<T> {
        let step = |block: &mut Block, b: usize| {
            self.fill(b, block);
            map(block)
        };
        (0..self.blocks()).into_par_iter().map_init(Block::default, step).collect()
    }

    /// Cuts the samples into at most [`PIECES`] runs of blocks; each folds its blocks in order into sums of its own. Results in
    /// order.
    pub fn map_pieces<T: Send>(
        &self,
        start: impl Fn() -> T + Sync + Send,
        add: impl Fn(&mut T, &Block) + Sync + Send,
    ) -> Vec<T> {
        let blocks = self.blocks();
        let pieces = PIECES.min(blocks).max(1);
        let run = |p: usize| {
            let (mut sums, mut block) = (start(), Block::default());
            for b in piece(p, pieces, blocks) {
                self.fill(b, &mut block);
                add(&mut sums, &block);
            }
            sums
        };
        (0..pieces).into_par_iter().map(run).collect()
    }

    /// As [`Samples::map_pieces`], over blocks of a table's lines, where the samples are such and the loss is one that folds.
    pub fn map_lines<T: Send>(
        &self,
        start: impl Fn() -> T + Sync + Send,
        add: impl Fn(&mut T, &MerlLines, &[Line]) + Sync + Send,
    ) -> Option<Vec<T>> {
        let errors = self.measurement.sigma.is_some() || !self.measurement.common.is_empty();
        let Source::Merl(lines) = &self.source else { return None };
        let run = |p: usize| {
            let mut sums = start();
            for b in piece(p, PIECES, MerlLines::blocks()) {
                add(&mut sums, lines, &lines.lines(b).collect::<Vec<_>>());
            }
            sums
        };
        let folds = !errors && self.loss != Loss::Relative;
        folds.then(|| (0..PIECES).into_par_iter().map(run).collect())
    }

    /// Writes block `b` into `block`.
    fn fill(&self, b: usize, block: &mut Block) {
        block.reset(self.lists, self.channels.len());
        match &self.source {
            Source::Listed(all) => {
                let range = b * BLOCK..((b + 1) * BLOCK).min(all.len());
                block.index.extend_from_slice(&all.index[range.clone()]);
                block.cos_i.extend_from_slice(&all.cos_i[range.clone()]);
                block.x.extend_from_slice(&all.x[range.clone()]);
                block.places.extend_from_slice(all.places.get(range.clone()).unwrap_or_default());
                block.pairs.extend_from_slice(&all.pairs[range.clone()]);
                let pairs = block.w.iter_mut().chain(&mut block.y).zip(all.w.iter().chain(&all.y));
                pairs.for_each(|(to, from)| to.extend_from_slice(&from[range.clone()]));
            }
            Source::Merl(lines) => {
                for line in lines.lines(b) {
                    lines.append(&line, block);
                    self.append_values(line.entries(), line.weight, block);
                }
                merl_lines::finish(block);
                let unit = 1.0 / self.scale;
                for c in (0..block.y.len()).rev() {
                    let none = &mut Vec::new();
                    let w = block.w.get_mut(c).unwrap_or(none);
                    vectorised(Values { unit, y: &mut block.y[c], w });
                }
            }
        }
    }

    /// Appends weights and values of entries in a row of a table.
    fn append_values(&self, entries: Range<usize>, weight: f64, block: &mut Block) {
        let start = block.pairs.len();
        block.pairs.resize(start + entries.len(), 1.0);
        block.pairs[start] = 0.0;
        for c in 0..block.y.len() {
            block.y[c].extend_from_slice(&self.measurement.plane(self.channels[c])[entries.clone()]);
            if c < self.lists {
                block.w[c].resize(start + entries.len(), weight * self.factor[c]);
            }
        }
        if self.measurement.sigma.is_some() || !self.measurement.common.is_empty() {
            block.index.extend(entries.map(|e| e as u32));
        }
    }

    /// All samples in one list, or those for which `keep` holds (by position among the samples).
    pub fn listed(&self, keep: impl Fn(usize) -> bool) -> Self {
        let mut all = Block::default();
        all.reset(self.lists, self.channels.len());
        let (mut block, mut position) = (Block::default(), 0);
        for b in 0..self.blocks() {
            self.fill(b, &mut block);
            for i in 0..block.len() {
                if keep(position + i) {
                    all.index.extend(block.index.get(i));
                    all.cos_i.push(block.cos_i[i]);
                    all.x.push(block.x[i]);
                    all.places.extend(block.places.get(i));
                    all.pairs.push(block.pairs[i]);
                    let pairs = all.w.iter_mut().chain(&mut all.y).zip(block.w.iter().chain(&block.y));
                    pairs.for_each(|(to, from)| to.push(from[i]));
                }
            }
            position += block.len();
        }
        self.with(all)
    }

    /// Largest coordinate of all samples; 0, the peak, stands for a table's.
    fn largest_coordinate(&self) -> f64 {
        match &self.source {
            Source::Listed(all) => all.x.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            Source::Merl(_) => 0.0,
        }
    }

    /// Whether a lobe of one shape parameter is 0 on all samples.
    pub fn are_dark(&self, kind: LobeKind, shape: &[f64]) -> bool {
        let nearest = match (&self.source, &self.sight) {
            (Source::Listed(all), Some(_)) => all.places.iter().min_by(|a, b| a.alpha.total_cmp(&b.alpha)),
            _ => None,
        };
        let mut value = [0.0];
        match (nearest, &self.sight) {
            (Some(place), Some(sight)) => sight.fill(kind, shape, &[*place], &mut value, &mut [vec![0.0]]),
            _ => value[0] = kind.lobe().value(shape, self.largest_coordinate(), &mut [0.0]),
        }
        value[0] == 0.0
    }

    /// How many distinct coordinates the samples stand at, counted up to `most`.
    pub fn distinct_coordinates(&self, most: usize) -> usize {
        let Source::Listed(all) = &self.source else { return most };
        let mut seen: Vec<f64> = Vec::new();
        for x in &all.x {
            let same = |y: &f64| *y == *x || (y - x).abs() <= 1e-12 * x.abs();
            if !seen.iter().any(same) {
                seen.push(*x);
                if seen.len() >= most {
                    break;
                }
            }
        }
        seen.len()
    }

    /// Direction pair of every sample of a list.
    pub fn pairs_of(&self) -> Vec<(DVec3, DVec3)> {
        match &self.source {
            Source::Listed(all) => all.index.iter().map(|i| self.measurement.directions.pair(*i as usize)).collect(),
            Source::Merl(_) => Vec::new(),
        }
    }

    /// A list's samples with every weight multiplied by `factor` (one a sample); the weights are not normalised again.
    pub fn reweighted(&self, factor: &[f64]) -> Self {
        let mut other = self.listed(|_| true);
        if let Source::Listed(all) = &mut other.source {
            for w in &mut all.w {
                w.iter_mut().zip(factor).for_each(|(w, f)| *w *= f);
            }
        }
        other
    }

    fn with(&self, all: Block) -> Self {
        let weight = |c: usize| all.weight(c);
        let counts = (0..self.channels.len()).map(|c| weight(c).iter().filter(|w| **w > 0.0).count()).collect();
        Self {
            measurement: self.measurement,
            channels: self.channels.clone(),
            sight: self.sight.clone(),
            shown: Shown::default(),
            loss: self.loss,
            count: all.len(),
            lists: self.lists,
            factor: self.factor.clone(),
            scale: self.scale,
            counts,
            epsilon: self.epsilon.clone(),
            refused: self.refused,
            weighting: self.weighting,
            are_drawn: self.are_drawn,
            source: Source::Listed(all),
        }
    }

    /// Runs of neighbouring samples within a block.
    pub fn clusters(&self, block: &Block) -> Vec<Range<usize>> {
        let step = if matches!(self.measurement.directions, Directions::Merl(_)) { BLOCK } else { CLUSTER };
        (0..block.len()).step_by(step).map(|from| from..(from + step).min(block.len())).collect()
    }

    /// Fills `out` with the ∂r/∂f of a linear loss at samples with these cosθi and values, of one channel.
    pub fn gain(&self, cos_i: &[f64], y: &[f64], channel: usize, out: &mut [f64]) {
        match self.loss {
            Loss::L2 => out.fill(1.0),
            Loss::Relative => {
                let epsilon = self.epsilon[channel];
                out.iter_mut().zip(y).for_each(|(g, y)| *g = 1.0 / (y.abs() + epsilon));
            }
            Loss::CosineL2 | Loss::Log | Loss::CubeRoot => out.copy_from_slice(cos_i),
        }
    }
}

/// Pieces that a pass with large sums is cut into; it fixes how they are bracketed.
const PIECES: usize = 16;

/// The blocks of piece `p`.
fn piece(p: usize, pieces: usize, blocks: usize) -> Range<usize> {
    blocks * p / pieces..blocks * (p + 1) / pieces
}

/// The transforms of weights and weighted data (measures: lists, then channels), and each channel's energy Σ w g² y².
pub(in crate::fit) type Transforms = (Transform, Vec<f64>);
