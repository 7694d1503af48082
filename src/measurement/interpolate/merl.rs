//! The MERL grid between its entries: linear in index space.
//!
//! The ends need no special case. At θh → 0 and at θd → 0 the grid meets a pole: going on to −θ is the same as turning φd by
//! 180°, and that is the reciprocal pair, whose value is the same. So what lies beyond the first entry is the first entry
//! itself, and linear interpolation across the pole is constant there. Beyond the last entries the value is held too: half a
//! bin, up to 90°. φd wraps at 180° for the same reason.
//!
//! Values are kept as `f32`, the channels of an entry side by side (17.5 MB for three channels instead of 35): each stands within a
//! relative 2⁻²⁴ = 6·10⁻⁸ of the measured value.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use rayon::prelude::*;

use crate::geometry::HalfDiff;
use crate::measurement::{Measurement, MerlAngles, MerlGrid};

/// Some channels of a MERL table, entry by entry, NaN where masked.
pub(super) struct MerlTable {
    channels: usize,
    /// Index of the place where entry 0 is read, in bins: ½ at centres, 0 at edges.
    shift: f64,
    values: Vec<f32>,
}

impl MerlTable {
    /// Copies the given channels, which must exist.
    pub(super) fn new(measurement: &Measurement, grid: MerlGrid, channels: &[usize]) -> Self {
        let planes: Vec<&[f64]> = channels.iter().map(|&c| measurement.plane(c)).collect();
        let count = channels.len();
        let mut values = vec![0.0f32; MerlGrid::LEN * count];
        values.par_chunks_mut(count).enumerate().for_each(|(i, entry)| {
            for (value, plane) in entry.iter_mut().zip(&planes) {
                let stored = plane[i] as f32;
                *value = if stored.is_finite() { stored } else { f32::NAN };
            }
        });
        let shift = match grid.angles {
            MerlAngles::Center => 0.5,
            MerlAngles::Edge => 0.0,
        };
        Self { channels: count, shift, values }
    }

    /// The interpolated value of every channel; `false`, with `out` undefined, when some channel has no valid neighbour.
    pub(super) fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let Some(angles) = HalfDiff::from_pair(wi, wo) else { return false };
        let cell = self.cell(angles);
        out.fill(0.0);
        for (index, weight) in cell.corners() {
            let entry = &self.values[index * self.channels..(index + 1) * self.channels];
            for (sum, &value) in out.iter_mut().zip(entry) {
                *sum += weight * f64::from(value);
            }
        }
        out.iter().all(|sum| !sum.is_nan()) || self.eval_masked(&cell, out)
    }

    /// As [`Self::eval`] where some neighbour is masked: the valid ones' weights are scaled to add up to 1.
    fn eval_masked(&self, cell: &Cell, out: &mut [f64]) -> bool {
        for (c, value) in out.iter_mut().enumerate() {
            let (mut sum, mut total) = (0.0, 0.0);
            for (index, weight) in cell.corners() {
                let neighbour = f64::from(self.values[index * self.channels + c]);
                if !neighbour.is_nan() {
                    sum += weight * neighbour;
                    total += weight;
                }
            }
            if total <= 0.0 {
                return false;
            }
            *value = sum / total;
        }
        true
    }

    fn cell(&self, angles: HalfDiff) -> Cell {
        let bins_h = MerlGrid::THETA_H as f64 * (angles.theta_h / FRAC_PI_2).sqrt() - self.shift;
        let bins_d = MerlGrid::THETA_D as f64 * angles.theta_d / FRAC_PI_2 - self.shift;
        let half_turns = angles.phi_d / PI;
        let bins_p = MerlGrid::PHI_D as f64 * (half_turns - half_turns.floor()) - self.shift;
        Cell {
            h: clamped(bins_h, MerlGrid::THETA_H),
            d: clamped(bins_d, MerlGrid::THETA_D),
            p: wrapped(bins_p, MerlGrid::PHI_D),
        }
    }
}

/// Two neighbouring indices along one axis and the share of the second.
type Pair = (usize, usize, f64);

fn clamped(position: f64, bins: usize) -> Pair {
    let position = position.clamp(0.0, (bins - 1) as f64);
    let low = (position as usize).min(bins - 2);
    (low, low + 1, position - low as f64)
}

fn wrapped(position: f64, bins: usize) -> Pair {
    let floor = position.floor();
    let low = (floor + bins as f64) as usize % bins;
    (low, (low + 1) % bins, position - floor)
}

/// The eight entries round a place in the grid.
struct Cell {
    h: Pair,
    d: Pair,
    p: Pair,
}

impl Cell {
    /// Entry index and weight of the corners that count; those of weight 0 are left out, so that a masked entry does not
    /// reach beyond its own cells.
    fn corners(&self) -> impl Iterator<Item = (usize, f64)> {
        let ends = |&(low, high, t): &Pair| [(low, 1.0 - t), (high, t)];
        let (h, d, p) = (ends(&self.h), ends(&self.d), ends(&self.p));
        (0..8usize).filter_map(move |corner| {
            let ((i, a), (j, b), (k, c)) = (h[corner >> 2], d[corner >> 1 & 1], p[corner & 1]);
            let weight = a * b * c;
            (weight > 0.0).then_some(((i * MerlGrid::THETA_D + j) * MerlGrid::PHI_D + k, weight))
        })
    }
}
