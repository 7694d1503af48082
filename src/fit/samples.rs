//! What a fit sees of a measurement: the samples that count, with their weights, data and lobe coordinates.

use rayon::prelude::*;

use super::options::{FitError, FitOptions, WeightMode};
use crate::brdf::{LobeKind, ModelSpec};
use crate::measurement::Measurement;
use crate::numeric::sum;

/// Samples with a positive weight in at least one channel, in the measurement's order, structure of arrays.
#[derive(Debug)]
pub(super) struct Samples {
    /// Index of each sample in the measurement.
    pub index: Vec<u32>,
    /// ∂r/∂f of each sample.
    pub slope: Vec<f64>,
    /// Normalised weight w, one list for all channels or one a channel (0 where that channel is masked).
    weight: Vec<Vec<f64>>,
    /// Measured value of each channel over [`Samples::scale`], 0 where masked.
    pub data: Vec<Vec<f64>>,
    /// The power of two that the data were divided by, so that no unit of theirs over- or underflows when squared.
    pub scale: f64,
    /// Σ w g² y² of each channel's data.
    pub energy: Vec<f64>,
    /// Samples with a positive weight in each channel.
    pub counts: Vec<usize>,
    /// Coordinate of each distinct lobe kind of the model.
    coordinates: Vec<(LobeKind, Vec<f64>)>,
    /// Whether the solid angles asked for were there.
    pub solid_angle: bool,
}

/// Slack in the cosine that makes the angular limit inclusive whatever the rounding of the direction.
const INCLUSIVE: f64 = 1e-12;

enum Left {
    Below,
    Beyond,
    Masked,
    Weightless,
}

impl Samples {
    /// Selects and prepares the samples.
    pub fn gather(measurement: &Measurement, model: &ModelSpec, options: &FitOptions) -> Result<Self, FitError> {
        let solid_angle = options.weights == WeightMode::SolidAngle && measurement.weights.known();
        let picked = pick(measurement, options, solid_angle)?;
        let index: Vec<u32> = picked.iter().map(|p| p.0).collect();
        let raw: Vec<f64> = picked.iter().map(|p| p.1).collect();
        let slope: Vec<f64> = picked.iter().map(|p| p.2).collect();
        drop(picked);
        let (weight, counts) = channel_weights(measurement, &index, &raw);
        let scale = scale_of(measurement, &index)?;
        let data: Vec<Vec<f64>> = (0..measurement.channels.len())
            .map(|c| {
                let plane = measurement.plane(c);
                let value = |&i: &u32| if plane[i as usize].is_nan() { 0.0 } else { plane[i as usize] / scale };
                index.par_iter().map(value).collect()
            })
            .collect();
        let mut kinds: Vec<LobeKind> = model.lobes().to_vec();
        kinds.sort_unstable();
        kinds.dedup();
        let coordinates = coordinates(measurement, &index, &kinds);
        let mut samples =
            Self { index, slope, weight, data, scale, energy: Vec::new(), counts, coordinates, solid_angle };
        samples.energy = (0..samples.data.len()).map(|c| samples.channel_energy(c)).collect();
        Ok(samples)
    }

    fn channel_energy(&self, channel: usize) -> f64 {
        let (w, y) = (self.weight(channel), &self.data[channel]);
        sum::sum_blocks(self.len(), |i| w[i] * (self.slope[i] * y[i]).powi(2))
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// Weights of one channel.
    pub fn weight(&self, channel: usize) -> &[f64] {
        if self.weight.len() == 1 { &self.weight[0] } else { &self.weight[channel] }
    }

    /// Number of distinct weight lists: 1 where all channels share one.
    pub fn weight_lists(&self) -> usize {
        self.weight.len()
    }

    /// Coordinates of one lobe kind; empty for a kind that the model lacks.
    pub fn coordinate(&self, kind: LobeKind) -> &[f64] {
        self.coordinates.iter().find(|(k, _)| *k == kind).map_or(&[], |(_, list)| list)
    }

    /// Residuals in all: samples × channels, masked ones left out.
    pub fn residuals(&self) -> usize {
        self.counts.iter().sum()
    }
}

/// (index, raw weight, slope) of every sample that counts.
fn pick(measurement: &Measurement, options: &FitOptions, solid_angle: bool) -> Result<Vec<(u32, f64, f64)>, FitError> {
    let least = options.max_angle_deg.to_radians().cos() - INCLUSIVE;
    let judge = |i: usize| -> Result<(u32, f64, f64), Left> {
        let (wi, wo) = measurement.directions.pair(i);
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return Err(Left::Below);
        }
        if wi.z < least || wo.z < least {
            return Err(Left::Beyond);
        }
        if (0..measurement.channels.len()).all(|c| measurement.value(c, i).is_none()) {
            return Err(Left::Masked);
        }
        let weight = if solid_angle { measurement.weights.get(i) } else { 1.0 };
        if weight > 0.0 { Ok((i as u32, weight, options.loss.slope(wi.z))) } else { Err(Left::Weightless) }
    };
    let blocks = sum::map_blocks(measurement.len(), |block| {
        let (mut kept, mut left) = (Vec::with_capacity(block.len()), [0usize; 4]);
        for i in block {
            match judge(i) {
                Ok(sample) => kept.push(sample),
                Err(reason) => left[reason as usize] += 1,
            }
        }
        (kept, left)
    });
    let mut left = [0; 4];
    let mut picked = Vec::with_capacity(blocks.iter().map(|b| b.0.len()).sum());
    for (kept, reasons) in blocks {
        picked.extend(kept);
        left.iter_mut().zip(reasons).for_each(|(sum, n)| *sum += n);
    }
    if picked.is_empty() {
        return Err(FitError::NothingToFit {
            name: measurement.name.clone(),
            entries: measurement.len(),
            below: left[Left::Below as usize],
            beyond: left[Left::Beyond as usize],
            masked: left[Left::Masked as usize],
            weightless: left[Left::Weightless as usize],
            max_angle_deg: options.max_angle_deg,
        });
    }
    Ok(picked)
}

/// The power of two next to the largest value; 1 for data that are all 0.
fn scale_of(measurement: &Measurement, index: &[u32]) -> Result<f64, FitError> {
    let largest_in = |c: usize| {
        let plane = measurement.plane(c);
        index.par_iter().map(|&i| plane[i as usize].abs()).filter(|v| !v.is_nan()).reduce(|| 0.0, f64::max)
    };
    let largest = (0..measurement.channels.len()).map(largest_in).fold(0.0, f64::max);
    // The cost is reported in the data's unit squared.
    if !(largest * largest * index.len() as f64).is_finite() {
        return Err(FitError::Overflow { name: measurement.name.clone(), largest });
    }
    Ok(if largest > 0.0 { largest.log2().floor().exp2() } else { 1.0 })
}

/// Weights normalised to Σw = number of samples, channel by channel, as one list where all channels have the same mask.
fn channel_weights(measurement: &Measurement, index: &[u32], raw: &[f64]) -> (Vec<Vec<f64>>, Vec<usize>) {
    let channels = measurement.channels.len();
    let largest = raw.iter().copied().fold(0.0, f64::max); // of any size: sums must not overflow
    let masked = |c: usize, i: u32| measurement.plane(c)[i as usize].is_nan();
    let alike = index.par_iter().all(|&i| (1..channels).all(|c| masked(c, i) == masked(0, i)));
    let lists: Vec<(Vec<f64>, usize)> = (0..if alike { 1 } else { channels })
        .map(|c| {
            let mut w: Vec<f64> =
                index.par_iter().zip(raw).map(|(&i, &w)| if masked(c, i) { 0.0 } else { w / largest }).collect();
            let count = w.iter().filter(|w| **w > 0.0).count();
            let total = sum::sum_blocks(w.len(), |i| w[i]);
            if total > 0.0 {
                w.par_iter_mut().for_each(|w| *w *= count as f64 / total);
            }
            (w, count)
        })
        .collect();
    let counts = (0..channels).map(|c| lists[if alike { 0 } else { c }].1).collect();
    (lists.into_iter().map(|l| l.0).collect(), counts)
}

/// Coordinates of every lobe kind; each pair of directions is found once.
fn coordinates(measurement: &Measurement, index: &[u32], kinds: &[LobeKind]) -> Vec<(LobeKind, Vec<f64>)> {
    let blocks = sum::map_blocks(index.len(), |block| {
        let mut lists = vec![Vec::with_capacity(block.len()); kinds.len()];
        for &i in &index[block] {
            let (wi, wo) = measurement.directions.pair(i as usize);
            lists.iter_mut().zip(kinds).for_each(|(list, kind)| list.push(kind.lobe().coordinate(wi, wo)));
        }
        lists
    });
    let join = |k: usize| blocks.iter().flat_map(|lists| lists[k].iter().copied()).collect();
    kinds.iter().enumerate().map(|(k, kind)| (*kind, join(k))).collect()
}
