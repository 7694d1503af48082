//! Which entries of a measurement count, one by one, and why the others don't.

use std::ops::Range;

use super::Samples;
use super::block::Block;
use crate::brdf::LobeKind;
use crate::fit::loss::Datum;
use crate::fit::options::{FitError, FitOptions};
use crate::measurement::Measurement;

/// Slack in the cosine that makes the angular limit inclusive whatever the rounding of the direction.
const INCLUSIVE: f64 = 1e-12;

/// Cosine of the angular limit, with that slack.
pub(in crate::fit) fn least_cos(options: &FitOptions) -> f64 {
    options.max_angle_deg.to_radians().cos() - INCLUSIVE
}

/// Decides entry by entry.
pub(super) struct Judge<'a> {
    pub samples: &'a Samples<'a>,
    pub options: &'a FitOptions,
    pub least_cos: f64,
    pub solid_angle: bool,
    pub kind: Option<LobeKind>,
    pub thin: Thin,
    /// The relative loss's ε for the weights by σ, channel by channel: of all values, each counting for one.
    pub epsilon: Vec<f64>,
}

/// Which entries of a measurement are looked at: of every `step` runs of `run` entries one, at a place that varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::fit) struct Thin {
    pub step: usize,
    pub run: usize,
}

impl Thin {
    /// All of them.
    pub const NONE: Self = Self { step: 1, run: 1 };

    /// Those of a range that are looked at, of parts alike number `draw`.
    fn entries(self, range: Range<usize>, draw: u64) -> impl Iterator<Item = usize> {
        let run = if self.step == 1 { range.end.max(1) } else { self.run };
        let group = self.step * run;
        let of_group = move |g: usize| {
            // Another draw is the same sequence of places, begun elsewhere.
            let first = g * group + offset(g.wrapping_add(draw as usize), self.step) * run;
            first.max(range.start)..(first + run).min(range.end)
        };
        (range.start / group..range.end.div_ceil(group)).flat_map(of_group)
    }
}

/// Which of the `step` entries of run `run` a thinned-out list keeps: spread evenly, without a beat with the grid's own period.
pub(in crate::fit) fn offset(run: usize, step: usize) -> usize {
    let golden = (run as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32;
    ((golden * step as u64) >> 32) as usize
}

/// Entries left out, by reason.
#[derive(Debug, Default)]
pub(super) struct Left {
    entries: usize,
    below: usize,
    beyond: usize,
    masked: usize,
    weightless: usize,
    /// Values, not entries, that the loss can't take.
    pub refused: usize,
}

impl Left {
    pub fn add(&mut self, other: &Self) {
        self.entries += other.entries;
        self.below += other.below;
        self.beyond += other.beyond;
        self.masked += other.masked;
        self.weightless += other.weightless;
        self.refused += other.refused;
    }

    pub fn error(&self, measurement: &Measurement, max_angle_deg: f64) -> FitError {
        FitError::NothingToFit {
            name: measurement.name.clone(),
            entries: self.entries,
            below: self.below,
            beyond: self.beyond,
            masked: self.masked,
            weightless: self.weightless,
            max_angle_deg,
        }
    }
}

impl Judge<'_> {
    /// The samples among these entries.
    pub fn list(&self, range: Range<usize>) -> (Block, Left) {
        let channels = self.samples.channels.len();
        let (mut block, mut left) = (Block::default(), Left::default());
        block.reset(channels, channels);
        let (mut w, mut y) = (vec![0.0; channels], vec![0.0; channels]);
        for entry in self.thin.entries(range, self.options.draw).filter(|e| self.options.takes(*e)) {
            left.entries += 1;
            let (wi, wo) = self.samples.measurement.directions.pair(entry);
            let place = self.samples.sight.as_ref().map(|sight| sight.place(wi, wo));
            if !(wi.z > 0.0 && wo.z > 0.0) {
                left.below += 1;
            } else if wi.z < self.least_cos || wo.z < self.least_cos || place == Some(None) {
                left.beyond += 1;
            } else if !self.values(entry, wi.z, &mut w, &mut y, &mut left) {
                left.masked += 1;
            } else if w.iter().all(|w| *w <= 0.0) {
                left.weightless += 1;
            } else {
                block.index.push(entry as u32);
                block.cos_i.push(wi.z);
                block.x.push(self.kind.map_or(0.0, |k| k.lobe().coordinate(wi, wo)));
                block.places.extend(place.flatten());
                block.pairs.push(0.0);
                block.w.iter_mut().zip(&w).for_each(|(list, w)| list.push(*w));
                block.y.iter_mut().zip(&y).for_each(|(list, y)| list.push(*y));
            }
        }
        (block, left)
    }

    /// Weights and values of an entry, channel by channel, 0 where masked; false where all are.
    fn values(&self, entry: usize, cos_i: f64, w: &mut [f64], y: &mut [f64], left: &mut Left) -> bool {
        let (samples, loss) = (self.samples, self.samples.loss);
        let weight =
            if self.solid_angle && !self.options.use_sigma { samples.measurement.weights.get(entry) } else { 1.0 };
        let mut any = false;
        for (c, &channel) in samples.channels.iter().enumerate() {
            (w[c], y[c]) = (0.0, 0.0);
            let Some(value) = samples.measurement.value(channel, entry) else { continue };
            let datum = Datum { value, cos_i, epsilon: self.epsilon[c] };
            if !loss.accepts(datum) {
                left.refused += 1;
                continue;
            }
            any = true;
            y[c] = value;
            w[c] = weight * if self.options.use_sigma { self.inverse_variance(entry, channel, datum) } else { 1.0 };
        }
        any
    }

    /// 1/((∂r/∂y)² (σ² + Σ u²)) at f = y, by all of the value's error, its own and what it shares with others; 0 where its own is no positive number.
    fn inverse_variance(&self, entry: usize, channel: usize, datum: Datum) -> f64 {
        let measurement = self.samples.measurement;
        let sigma = measurement.sigma_plane(channel).map_or(f64::NAN, |s| s[entry]);
        let shared = (0..measurement.common.len()).map(|k| measurement.common_plane(k, channel)[entry].powi(2));
        let variance = sigma * sigma + shared.sum::<f64>();
        let slope = self.samples.loss.data_slope(datum.value, datum);
        let weight = (variance * slope * slope).recip();
        if sigma > 0.0 && weight > 0.0 && weight.is_finite() { weight } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinned_entries_are_one_run_of_each_group_wherever_a_range_is_cut() {
        for thin in [Thin::NONE, Thin { step: 7, run: 1 }, Thin { step: 5, run: 12 }] {
            let all: Vec<usize> = thin.entries(0..1000, 3).collect();
            let cut: Vec<usize> = [0..333, 333..334, 334..1000].into_iter().flat_map(|r| thin.entries(r, 3)).collect();
            assert_eq!(all, cut);
            for group in all.chunk_by(|a, b| a / (thin.step * thin.run) == b / (thin.step * thin.run)) {
                assert!(group.len() <= thin.run && group.windows(2).all(|p| p[1] == p[0] + 1), "{group:?}");
            }
            assert!(all.len() >= 1000 / (thin.step * thin.run) * thin.run);
        }
    }
}
