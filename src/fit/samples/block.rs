//! Samples as lists, structure of arrays.

use glam::DVec3;
use rayon::prelude::*;

use crate::brdf::Place;
use crate::measurement::MerlGrid;
use crate::numeric::simd::{Kernel, Simd};

/// Samples in a row, structure of arrays. Lists by channel hold the channels of the fit, in its order.
#[derive(Debug, Default, Clone)]
pub(in crate::fit) struct Block {
    /// Index of each sample in the measurement; left out for a table without σ.
    pub index: Vec<u32>,
    /// cosθi.
    pub cos_i: Vec<f64>,
    /// Coordinate of the lobes that have a shape.
    pub x: Vec<f64>,
    /// Where each sample stands for an instrument that lobes are seen through; left out without one.
    pub places: Vec<Place>,
    /// 1 where a sample is a neighbour of the one before, else 0.
    pub pairs: Vec<f64>,
    /// Normalised weight w, one list for all channels or one a channel; 0 where masked.
    pub w: Vec<Vec<f64>>,
    /// Measured value over [`Samples::scale`], one list a channel; 0 where masked.
    pub y: Vec<Vec<f64>>,
}

impl Block {
    pub fn reset(&mut self, lists: usize, channels: usize) {
        self.index.clear();
        self.cos_i.clear();
        self.x.clear();
        self.places.clear();
        self.pairs.clear();
        self.w.resize_with(lists, Vec::new);
        self.y.resize_with(channels, Vec::new);
        self.w.iter_mut().chain(&mut self.y).for_each(Vec::clear);
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Weights of one channel.
    pub fn weight(&self, channel: usize) -> &[f64] {
        if self.w.len() == 1 { &self.w[0] } else { &self.w[channel] }
    }

    /// The samples ordered by direction, so that neighbours stand together and the order of the file does not matter: along rings about the
    /// normal, or in planes through it where that makes more neighbours.
    pub fn neighbours_together(&self, wi: &[DVec3], wo: &[DVec3]) -> Self {
        let by = |of: fn(DVec3) -> [i32; 2]| {
            let key = |k: u32| {
                let entry = self.index[k as usize] as usize;
                let ([a, b], [c, d]) = (on_ring(wi[entry]), of(wo[entry]));
                ([a, b, c, d], k)
            };
            let mut order: Vec<([i32; 4], u32)> = (0..self.len() as u32).into_par_iter().map(key).collect();
            order.par_sort_unstable();
            order
        };
        let near = |a: usize, b: usize| {
            wi[a].distance_squared(wi[b]) < SAME_INCIDENCE && wo[a].distance_squared(wo[b]) < FARTHEST
        };
        let sorted = |of| {
            let order = by(of);
            let index: Vec<u32> = order.iter().map(|(_, k)| self.index[*k as usize]).collect();
            let pairs = neighbours(&index, near);
            let count = pairs.iter().filter(|p| **p > 0.0).count();
            (order, index, pairs, count)
        };
        let rings = sorted(on_ring);
        // Where most have a neighbour there are not more to be had.
        let is_good = rings.3 * 10 >= self.len() * 9;
        let meridians = if is_good { None } else { Some(sorted(on_meridian)) };
        let (order, index, pairs, _) = meridians.filter(|m| m.3 > rings.3).unwrap_or(rings);
        let places = order.iter().filter_map(|(_, k)| self.places.get(*k as usize).copied()).collect();
        let pick = |list: &Vec<f64>| order.iter().map(|(_, k)| list[*k as usize]).collect();
        Self {
            pairs,
            index,
            cos_i: pick(&self.cos_i),
            x: pick(&self.x),
            places,
            w: self.w.iter().map(pick).collect(),
            y: self.y.iter().map(pick).collect(),
        }
    }

    pub fn reserve(&mut self, samples: usize) {
        self.index.reserve_exact(samples);
        [&mut self.cos_i, &mut self.x, &mut self.pairs].into_iter().for_each(|l| l.reserve_exact(samples));
        self.w.iter_mut().chain(&mut self.y).for_each(|l| l.reserve_exact(samples));
    }

    pub fn append(&mut self, other: &Self) {
        self.index.extend_from_slice(&other.index);
        self.cos_i.extend_from_slice(&other.cos_i);
        self.x.extend_from_slice(&other.x);
        self.places.extend_from_slice(&other.places);
        self.pairs.extend_from_slice(&other.pairs);
        let pairs = self.w.iter_mut().chain(&mut self.y).zip(other.w.iter().chain(&other.y));
        pairs.for_each(|(list, more)| list.extend_from_slice(more));
    }
}

/// Incidences closer than this (squared chord of the unit sphere) are the same.
const SAME_INCIDENCE: f64 = 1e-8;
/// Directions farther apart than this (squared chord, about 14°) are no neighbours.
const FARTHEST: f64 = 0.0625;

/// 1 for every entry that is `near` the one before.
pub(super) fn neighbours(index: &[u32], near: impl Fn(usize, usize) -> bool) -> Vec<f64> {
    let pair = |p: &[u32]| if near(p[0] as usize, p[1] as usize) { 1.0 } else { 0.0 };
    std::iter::once(0.0).take(index.len()).chain(index.windows(2).map(pair)).collect()
}

/// Whether entry `b` of a MERL table is the next after `a` on the same line of φd.
pub(super) fn next_on_line(a: usize, b: usize) -> bool {
    b == a + 1 && !b.is_multiple_of(MerlGrid::PHI_D)
}

/// Places on a line of unit length that are told apart: coarse enough to overlook rounding.
const STEPS: f64 = 1e5;

/// A direction's polar ring and its place on it.
fn on_ring(w: DVec3) -> [i32; 2] {
    [(w.z * STEPS).round() as i32, (azimuth(w) * STEPS).round() as i32]
}

/// A direction's plane through the normal and its place along it.
fn on_meridian(w: DVec3) -> [i32; 2] {
    let half_turn = 2 * STEPS as i32;
    let azimuth = (azimuth(w) * STEPS).round() as i32;
    let from_pole = ((1.0 - w.z) * STEPS).round() as i32;
    let is_behind = azimuth.div_euclid(half_turn) % 2 != 0;
    [azimuth.rem_euclid(half_turn), if is_behind { -from_pole } else { from_pole }]
}

/// The azimuth by the way round a square, −1 to 3: monotone, 2 for half a turn, and cheaper than an arctangent.
fn azimuth(w: DVec3) -> f64 {
    let size = w.x.abs() + w.y.abs();
    let round = if size > 1e-9 { w.y / size } else { 0.0 };
    if w.x < 0.0 { 2.0 - round } else { round }
}

/// Values over their unit and their weights, both 0 where the value is masked.
pub(super) struct Values<'a> {
    pub unit: f64,
    pub y: &'a mut [f64],
    pub w: &'a mut [f64],
}

impl Kernel for Values<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) {
        for (w, y) in self.w.iter_mut().zip(&*self.y) {
            *w = if y.is_nan() { 0.0 } else { *w };
        }
        for y in self.y {
            *y = if y.is_nan() { 0.0 } else { *y * self.unit };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_a_line_is_no_neighbour_of_the_last_of_the_one_before() {
        let last = MerlGrid::PHI_D as u32 - 1;
        assert_eq!(
            neighbours(&[0, 1, 3, last - 1, last, last + 1, last + 2], next_on_line),
            [0., 1., 0., 0., 1., 0., 1.]
        );
        assert!(neighbours(&[], next_on_line).is_empty());
    }

    /// An in-plane scan runs through the pole from one azimuth to the other, whichever plane it lies in; a grid runs round the rings.
    #[test]
    fn a_plane_s_directions_are_neighbours_through_the_pole() {
        let towards = |theta: f64, phi: f64| {
            let ((s, c), (sin, cos)) = (theta.to_radians().sin_cos(), phi.to_radians().sin_cos());
            DVec3::new(s * cos, s * sin, c)
        };
        let pairs = |wo: &[DVec3]| {
            let n = wo.len();
            let block = Block { index: (0..n as u32).collect(), pairs: vec![0.0; n], ..Block::default() };
            let block = Block { cos_i: vec![1.0; n], x: vec![0.0; n], ..block };
            block.neighbours_together(&vec![towards(30.0, 0.0); n], wo).pairs.iter().sum::<f64>()
        };
        let ring = |theta: f64, azimuths: &[f64]| azimuths.iter().map(|p| towards(theta, *p)).collect::<Vec<_>>();
        for plane in [0.0, 30.0, 90.0, 117.0, 180.0, 300.0] {
            let wo: Vec<_> = (1..18).flat_map(|k| ring(5.0 * f64::from(k), &[plane, plane + 180.0])).collect();
            assert_eq!(pairs(&wo), 33.0, "azimuth {plane}");
        }
        // Encoders' azimuths of one half plane; four half planes.
        let one_sided: Vec<_> = (1..43).flat_map(|k| ring(2.0 * f64::from(k), &[0.01 * f64::from(k % 5)])).collect();
        assert_eq!(pairs(&one_sided), 41.0);
        let crossed: Vec<_> = (1..18).flat_map(|k| ring(5.0 * f64::from(k), &[0.0, 90.0, 180.0, 270.0])).collect();
        assert!(pairs(&crossed) >= 66.0);
        let azimuths: Vec<f64> = (0..36).map(|k| 10.0 * f64::from(k)).collect();
        let grid: Vec<_> = (1..9).flat_map(|k| ring(10.0 * f64::from(k), &azimuths)).collect();
        assert!(pairs(&grid) >= 8.0 * 35.0);
    }
}
