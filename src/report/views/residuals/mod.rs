//! Residuals in bins of angles: where a fit is off, and which way.

mod bins;
mod figure;
#[cfg(test)]
mod tests;

use glam::DVec3;

pub use bins::{Binned, Statistic};
pub use figure::{residual_figure, residual_range};

use super::Predicted;
use crate::fit::{Datum, Loss};
use crate::geometry::{HalfDiff, theta_of};
use crate::measurement::{Dimension, Measurement};
use crate::numeric::sum::map_blocks;
use bins::Bins;

/// The residuals of a fit, over two pairs of angles.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualMaps {
    /// Over θh (columns) and θd; none in the flat world.
    pub half_diff: Option<Binned>,
    /// Over θi (columns) and θo, the latter positive on the mirror side.
    pub in_out: Binned,
    /// Values counted.
    pub count: u64,
    /// √(Σ w r² / Σ w) over all of them.
    pub rmse: f64,
    /// Unit of r, empty where it has none.
    pub unit: &'static str,
}

/// Bins the residuals of a fit over all valid readings with both angles up to `max_angle_deg`, weighted as the fit's `weights` say (`solid-angle`,
/// else alike), each channel counting alike. The loss is that of the fit's record; a robust fit's outliers count in full.
#[must_use]
pub fn residual_maps(table: &Measurement, fit: &Predicted, max_angle_deg: f64) -> ResidualMaps {
    let record = fit.material().fit.clone().unwrap_or_default();
    let loss = Loss::from_name(&record.loss).unwrap_or_default();
    let judge = Judge {
        table,
        fit,
        loss,
        epsilon: &record.relative_epsilon,
        max_angle_deg,
        by_area: record.weights != "uniform",
    };
    let bins = Bins::of(table);
    let parts = map_blocks(table.len(), |block| judge.bin(block, &bins));
    let (mut maps, mut totals) = (bins.empty(table.channels.len()), Totals::default());
    for (part, found) in parts {
        maps.iter_mut().zip(&part).for_each(|(all, part)| all.join(part));
        totals.join(found);
    }
    let [half_diff, in_out] = joined(maps, table.channels.len(), &totals);
    let squares: f64 = in_out.squares.iter().sum();
    let weight: f64 = in_out.weight.iter().sum();
    ResidualMaps {
        half_diff: (table.dimension == Dimension::Space).then_some(half_diff),
        count: in_out.count.iter().sum(),
        in_out,
        rmse: (squares / weight).sqrt(),
        unit: loss.unit(table.dimension),
    }
}

/// Σw and count, channel by channel.
#[derive(Default)]
struct Totals(Vec<(f64, u64)>);

impl Totals {
    fn join(&mut self, other: Self) {
        if self.0.is_empty() {
            self.0 = other.0;
            return;
        }
        self.0.iter_mut().zip(other.0).for_each(|(a, b)| *a = (a.0 + b.0, a.1 + b.1));
    }
}

/// The channels' maps as one, Σw of each being its number of values.
fn joined(maps: Vec<Binned>, channels: usize, totals: &Totals) -> [Binned; 2] {
    let mut all: Option<[Binned; 2]> = None;
    let mut maps = maps.into_iter();
    for c in 0..channels {
        let (weight, count) = totals.0.get(c).copied().unwrap_or_default();
        let factor = if weight > 0.0 { count as f64 / weight } else { 0.0 };
        let scaled = |mut map: Binned| {
            for list in [&mut map.weight, &mut map.sum, &mut map.squares] {
                list.iter_mut().for_each(|x| *x *= factor);
            }
            map.variance.iter_mut().for_each(|x| *x *= factor * factor);
            map
        };
        let (Some(first), Some(second)) = (maps.next(), maps.next()) else { break };
        let pair = [scaled(first), scaled(second)];
        match &mut all {
            None => all = Some(pair),
            Some(all) => all.iter_mut().zip(&pair).for_each(|(a, b)| a.join(b)),
        }
    }
    all.unwrap_or_else(|| {
        [Binned::new(vec![0.0, 90.0], vec![0.0, 90.0]), Binned::new(vec![0.0, 90.0], vec![-90.0, 90.0])]
    })
}

/// What decides which values count, and finds their residuals.
struct Judge<'a> {
    table: &'a Measurement,
    fit: &'a Predicted,
    loss: Loss,
    epsilon: &'a [f64],
    max_angle_deg: f64,
    by_area: bool,
}

impl Judge<'_> {
    fn bin(&self, block: std::ops::Range<usize>, bins: &Bins) -> (Vec<Binned>, Totals) {
        let channels = self.table.channels.len();
        // Inclusive whatever the rounding of a direction.
        let least = self.max_angle_deg.to_radians().cos() - 1e-12;
        let is_in = |(wi, wo): &(DVec3, DVec3)| wi.z > 0.0 && wo.z > 0.0 && wi.z >= least && wo.z >= least;
        let kept = block.map(|i| (i, self.table.directions.pair(i))).filter(|(_, pair)| is_in(pair));
        let (index, pairs): (Vec<usize>, Vec<_>) = kept.unzip();
        let values = self.fit.values(&pairs);
        let (mut maps, mut totals) = (bins.empty(channels), Totals(vec![(0.0, 0); channels]));
        for (k, (&i, (wi, wo))) in index.iter().zip(&pairs).enumerate() {
            let weight = if self.by_area { self.table.weights.get(i) } else { 1.0 };
            let cells = cells(&maps, *wi, *wo);
            for c in 0..channels {
                let (Some(value), f) = (self.table.value(c, i), values[c][k]) else { continue };
                let datum = Datum { value, cos_i: wi.z, epsilon: self.epsilon.get(c).copied().unwrap_or(1e-12) };
                if f.is_nan() || weight <= 0.0 || !self.loss.accepts(datum) {
                    continue;
                }
                let r = self.loss.residual(f, datum);
                totals.0[c] = (totals.0[c].0 + weight, totals.0[c].1 + 1);
                for (map, cell) in maps[2 * c..2 * c + 2].iter_mut().zip(cells) {
                    if let Some(cell) = cell {
                        map.add(cell, weight, r);
                    }
                }
            }
        }
        (maps, totals)
    }
}

/// Where a pair of directions stands in both maps.
fn cells(maps: &[Binned], wi: DVec3, wo: DVec3) -> [Option<usize>; 2] {
    let degrees = |w: DVec3| theta_of(w).to_degrees();
    let half = HalfDiff::from_pair(wi, wo);
    let half = half.and_then(|h| maps[0].cell(h.theta_h.to_degrees(), h.theta_d.to_degrees()));
    // The mirror side is where the horizontal parts oppose each other.
    let mirror_side = wi.x * wo.x + wi.y * wo.y <= 0.0;
    let theta_o = if mirror_side { degrees(wo) } else { -degrees(wo) };
    [half, maps[1].cell(degrees(wi), theta_o)]
}
