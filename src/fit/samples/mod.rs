//! What a fit sees of a measurement: the samples that count, with their weights, data and lobe coordinates, block by block.
//!
//! A MERL table's samples are made block by block from the table itself; of any other measurement they are listed once.

mod block;
mod select;

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

pub(in crate::fit) use block::Block;
use block::{Values, neighbours, next_on_line};
use select::{Judge, Left, least_cos};
pub(in crate::fit) use select::{Thin, offset};

use super::bins::Bins;
use super::folded::{Gathered, Seen};
use super::loss::{Loss, RELATIVE_EPSILON};
use super::merl_lines::{self, Line, MerlLines};
use super::options::{FitError, FitOptions, WeightMode};
use super::transform::Transform;
use crate::brdf::{LobeKind, ModelSpec};
use crate::measurement::{Directions, Measurement};
use crate::numeric::simd::vectorised;
use crate::numeric::sum::{self, BLOCK};

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
}

/// What the first look at the data finds, channel by channel.
#[derive(Debug, Clone)]
struct Survey {
    directions: usize,
    counts: Vec<usize>,
    weights: Vec<f64>,
    absolute: Vec<f64>,
    largest: f64,
    alike: bool,
}

impl<'a> Samples<'a> {
    /// Selects and prepares the samples of the given channels; with them, where they come on the way, their transforms.
    pub fn gather(
        measurement: &'a Measurement,
        model: &ModelSpec,
        options: &FitOptions,
        channels: &[usize],
        thin: Thin,
    ) -> Result<(Self, Option<Transforms>), FitError> {
        let solid_angle = options.weights == WeightMode::SolidAngle && measurement.weights.known();
        let weighting = match (options.use_sigma, solid_angle) {
            (true, _) => "sigma",
            (false, true) => WeightMode::SolidAngle.name(),
            (false, false) => WeightMode::Uniform.name(),
        };
        let mut samples = Self {
            measurement,
            channels: channels.to_vec(),
            source: Source::Listed(Block::default()),
            loss: options.loss,
            count: 0,
            lists: channels.len(),
            factor: vec![1.0; channels.len()],
            scale: 1.0,
            counts: Vec::new(),
            epsilon: vec![0.0; channels.len()],
            refused: 0,
            weighting,
        };
        let mut transforms = None;
        if let Some(lines) = samples.lines(options, solid_angle).filter(|_| thin.step == 1) {
            transforms = samples.fold(&lines);
            samples.source = Source::Merl(lines);
        } else {
            let kind = model.lobes().iter().copied().find(|k| !k.lobe().parameters().is_empty());
            samples.list(kind, options, solid_angle, thin)?;
        }
        if transforms.is_none() {
            let survey = samples.survey();
            samples.settle(&survey, options)?;
        }
        Ok((samples, transforms))
    }

    /// The quick way through a table: samples are counted and the transforms summed in one pass over the values. `None` where the channels
    /// have different masks, or the values are of a size that needs scaling first.
    fn fold(&mut self, lines: &MerlLines) -> Option<Transforms> {
        match self.channels.len() {
            1 => self.fold_channels::<1>(lines),
            3 => self.fold_channels::<3>(lines),
            _ => None,
        }
    }

    fn fold_channels<const M: usize>(&mut self, lines: &MerlLines) -> Option<Transforms> {
        if self.loss == Loss::Relative {
            return None;
        }
        let planes: [&[f64]; M] = std::array::from_fn(|m| self.measurement.plane(self.channels[m]));
        let cosine = self.is_cosine();
        let piece = |p: usize| {
            let mut sums = Gathered::<M>::new();
            for b in piece(p, PIECES, MerlLines::blocks()) {
                lines.lines(b).for_each(|line| sums.add(lines, &line, planes, cosine));
            }
            sums
        };
        let parts: Vec<Gathered<M>> = (0..PIECES).into_par_iter().map(piece).collect();
        let (mut total, mut seen) = (Bins::new(1 + M), Seen::<M>::default());
        for part in &parts {
            total.merge(&part.bins);
            seen.add(&part.seen());
        }
        let plain = seen.unlike == 0.0 && seen.count > 0.0;
        if !plain || !(LEAST_UNSCALED..1.0 / LEAST_UNSCALED).contains(&seen.largest) {
            return None;
        }
        self.count = seen.count as usize;
        self.counts = vec![self.count; M];
        self.lists = 1;
        self.scale = power_of_two(seen.largest);
        let (factor, unit) = (seen.count / seen.weight, 1.0 / self.scale);
        self.factor = vec![factor; M];
        let mut factors = vec![factor * unit; 1 + M];
        factors[0] = factor;
        total.scale(&factors);
        Some((Transform::of_bins(&total), seen.energy.map(|e| e * factor * unit * unit).to_vec()))
    }

    /// A MERL table needs no lists where every sample counts and its weight is plain.
    fn lines(&self, options: &FitOptions, solid_angle: bool) -> Option<MerlLines> {
        let Directions::Merl(grid) = self.measurement.directions else { return None };
        let own = !solid_angle || matches!(self.measurement.weights, crate::measurement::Weights::Merl);
        let plain =
            options.loss.is_linear() && options.robust.is_none() && !options.use_sigma && options.stride == 1 && own;
        plain.then(|| MerlLines::new(grid, least_cos(options), solid_angle))
    }

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

    /// Lists every sample that counts, with raw weights.
    fn list(
        &mut self,
        kind: Option<LobeKind>,
        options: &FitOptions,
        solid_angle: bool,
        thin: Thin,
    ) -> Result<(), FitError> {
        let epsilon = self.plain_epsilon();
        let judge = Judge { samples: self, options, least_cos: least_cos(options), solid_angle, kind, thin, epsilon };
        let parts = sum::map_blocks(self.measurement.len(), |range| judge.list(range));
        let mut left = Left::default();
        let mut all = Block::default();
        all.reset(self.lists, self.channels.len());
        all.reserve(parts.iter().map(|(part, _)| part.len()).sum());
        for (part, reasons) in parts {
            all.append(&part);
            left.add(&reasons);
        }
        self.refused = left.refused;
        if all.len() == 0 {
            return Err(left.error(self.measurement, options.max_angle_deg));
        }
        // Weights may have any size: their sum must not overflow.
        let largest = all.w.iter().flatten().copied().fold(0.0, f64::max);
        all.w.iter_mut().flatten().for_each(|w| *w /= largest);
        match &self.measurement.directions {
            Directions::List { wi, wo } => all = all.neighbours_together(wi, wo),
            Directions::Merl(_) => all.pairs = neighbours(&all.index, next_on_line),
        }
        self.source = Source::Listed(all);
        Ok(())
    }

    /// ε of the relative loss if every valid value counted for one; 0 for other losses.
    fn plain_epsilon(&self) -> Vec<f64> {
        if self.loss != Loss::Relative {
            return vec![0.0; self.channels.len()];
        }
        let mean = |channel: &usize| {
            let known = self.measurement.plane(*channel).iter().filter(|v| !v.is_nan());
            let (sum, n) = known.fold((0.0, 0usize), |(sum, n), v| (sum + v.abs(), n + 1));
            RELATIVE_EPSILON * if sum > 0.0 { sum / n as f64 } else { 1.0 }
        };
        self.channels.iter().map(mean).collect()
    }

    /// Looks at all samples once.
    fn survey(&self) -> Survey {
        let channels = self.channels.len();
        let empty = Survey {
            directions: 0,
            counts: vec![0; channels],
            weights: vec![0.0; channels],
            absolute: vec![0.0; channels],
            largest: 0.0,
            alike: true,
        };
        let parts = self.map_blocks(|block| {
            let mut found = empty.clone();
            let masked = |c: usize, i: usize| block.w[c][i] == 0.0;
            for c in 0..channels {
                let (w, y) = (&block.w[c], &block.y[c]);
                found.counts[c] = w.iter().filter(|w| **w > 0.0).count();
                found.weights[c] = w.iter().sum();
                found.absolute[c] = w.iter().zip(y).map(|(w, y)| w * y.abs()).sum();
                found.largest = y.iter().fold(found.largest, |m, y| m.max(y.abs()));
                found.alike &= *w == block.w[0];
            }
            found.directions = (0..block.len()).filter(|&i| !(0..channels).all(|c| masked(c, i))).count();
            found
        });
        parts.into_iter().fold(empty, |mut sum, part| {
            sum.directions += part.directions;
            sum.largest = sum.largest.max(part.largest);
            sum.alike &= part.alike;
            for c in 0..channels {
                sum.counts[c] += part.counts[c];
                sum.weights[c] += part.weights[c];
                sum.absolute[c] += part.absolute[c];
            }
            sum
        })
    }

    /// Scale, normalisation and ε from the survey.
    fn settle(&mut self, survey: &Survey, options: &FitOptions) -> Result<(), FitError> {
        if survey.directions == 0 {
            // Only a table comes here: the lists say themselves what is missing.
            let (epsilon, thin) = (self.epsilon.clone(), Thin::NONE);
            let least_cos = least_cos(options);
            let judge = Judge { samples: self, options, least_cos, solid_angle: false, kind: None, thin, epsilon };
            let reasons = sum::map_blocks(self.measurement.len(), |range| judge.list(range).1);
            let mut left = Left::default();
            reasons.iter().for_each(|r| left.add(r));
            return Err(left.error(self.measurement, options.max_angle_deg));
        }
        let (largest, name) = (survey.largest, &self.measurement.name);
        // The cost is reported in the data's unit squared.
        if !(largest * largest * survey.directions as f64).is_finite() {
            return Err(FitError::Overflow { name: name.clone(), largest });
        }
        self.count = survey.directions;
        self.counts.clone_from(&survey.counts);
        if self.loss.is_homogeneous() && largest > 0.0 {
            self.scale = power_of_two(largest);
        }
        // A channel that is 0 throughout may have any ε.
        let mean = |c: usize| if survey.absolute[c] > 0.0 { survey.absolute[c] / survey.weights[c] } else { 1.0 };
        self.epsilon = (0..self.channels.len()).map(|c| RELATIVE_EPSILON * mean(c) / self.scale).collect();
        let factor = |c: usize| if survey.weights[c] > 0.0 { survey.counts[c] as f64 / survey.weights[c] } else { 0.0 };
        let factors: Vec<f64> = (0..self.channels.len()).map(factor).collect();
        self.lists = if survey.alike { 1 } else { self.channels.len() };
        let unit = 1.0 / self.scale;
        if let Source::Listed(all) = &mut self.source {
            all.w.truncate(self.lists);
            all.w.iter_mut().zip(&factors).for_each(|(w, f)| w.iter_mut().for_each(|w| *w *= f));
            all.y.iter_mut().for_each(|y| y.iter_mut().for_each(|y| *y *= unit));
        }
        self.factor = factors;
        Ok(())
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
    pub fn largest_coordinate(&self) -> f64 {
        match &self.source {
            Source::Listed(all) => all.x.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            Source::Merl(_) => 0.0,
        }
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
            loss: self.loss,
            count: all.len(),
            lists: self.lists,
            factor: self.factor.clone(),
            scale: self.scale,
            counts,
            epsilon: self.epsilon.clone(),
            refused: self.refused,
            weighting: self.weighting,
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

/// A power of two near `largest` > 0, with an exponent that is a multiple of three, so that its cube root is a power of two as well.
fn power_of_two(largest: f64) -> f64 {
    (3.0 * (largest.log2() / 3.0).floor()).exp2()
}

/// Values between this and its inverse can be squared and summed without scaling.
const LEAST_UNSCALED: f64 = 1e-100;

/// Pieces that a pass with large sums is cut into; it fixes how they are bracketed.
const PIECES: usize = 16;

/// The blocks of piece `p`.
fn piece(p: usize, pieces: usize, blocks: usize) -> Range<usize> {
    blocks * p / pieces..blocks * (p + 1) / pieces
}

/// The transforms of weights and weighted data (measures: lists, then channels), and each channel's energy Σ w g² y².
pub(in crate::fit) type Transforms = (Transform, Vec<f64>);
