//! From a measurement to its samples: which count, how they weigh, and in what unit.

use rayon::prelude::*;

use super::block::{Block, neighbours, next_on_line};
use super::select::{Judge, Left, Thin, least_cos};
use super::shown::Shown;
use super::{PIECES, Samples, Source, Transforms, piece};
use crate::brdf::{LobeKind, ModelSpec};
use crate::fit::bins::Bins;
use crate::fit::folded::{Gathered, Seen};
use crate::fit::loss::{Loss, RELATIVE_EPSILON};
use crate::fit::merl_lines::MerlLines;
use crate::fit::options::{FitError, FitOptions, WeightMode};
use crate::fit::transform::Transform;
use crate::measurement::{Directions, Measurement};
use crate::numeric::sum;

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
            sight: options.through.clone(),
            shown: Shown::default(),
            loss: options.loss,
            count: 0,
            lists: channels.len(),
            factor: vec![1.0; channels.len()],
            scale: 1.0,
            counts: Vec::new(),
            epsilon: vec![0.0; channels.len()],
            refused: 0,
            weighting,
            are_drawn: false,
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
        let plain = plain && options.through.is_none();
        plain.then(|| MerlLines::new(grid, least_cos(options), solid_angle))
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
        if largest > 0.0 && largest < SMALLEST {
            return Err(FitError::Underflow { name: name.clone(), largest });
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
}

/// A power of two near `largest` > 0, with an exponent that is a multiple of three, so that its cube root is a power of two as well.
fn power_of_two(largest: f64) -> f64 {
    (3.0 * (largest.log2() / 3.0).floor()).exp2()
}

/// Values below this stand where doubles lose digits.
const SMALLEST: f64 = 1e-300;
/// Values between this and its inverse can be squared and summed without scaling.
const LEAST_UNSCALED: f64 = 1e-100;
