//! Draws directions to the light in proportion to what a table reflects.
//!
//! For each of a few polar angles of `wo` (nodes) the product f·cosθi is tabulated over the cells of both charts
//! ([`super::chart`]), piecewise constant per solid angle of the chart. A draw takes one of the two nodes that enclose θo, by
//! linear weights, then a chart, a row and a column; a small share is drawn by the cosine instead, so that nothing that
//! reflects has a density of 0. The density is the sum over all the ways in which a direction can be drawn.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::chart::{Chart, Plane, Polar};
use crate::brdf::Sample;
use crate::geometry::grid::cos_difference;
use crate::geometry::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::geometry::{direction, theta_of};

/// Nodes in θo, evenly spaced from 0 to [`LAST_NODE`].
const NODES: usize = 46;
/// θo of the last node (rad): at 90° itself nothing is above the horizon.
const LAST_NODE: f64 = 89.7 / 90.0 * FRAC_PI_2;
/// Rows of a chart in polar angle, spaced by squares: one to a bin of a MERL table's θh.
const ROWS: usize = 90;
/// Columns over half a turn of azimuth; the density is the same on both sides of the plane of incidence.
const COLUMNS: usize = 32;
/// Share of the draws that follow the cosine.
const COSINE_SHARE: f64 = 0.05;

/// The tabulated densities.
pub(super) struct Sampler {
    nodes: Vec<Node>,
    /// θo of each node (rad), ascending.
    angles: Vec<f64>,
    /// sin²(θ/2) at the borders of each chart's rows.
    borders: [Vec<f64>; 2],
}

/// The density at one θo.
struct Node {
    /// Probability of each chart; all 0 when nothing is reflected.
    mass: [f64; 2],
    charts: [Distribution; 2],
}

/// A piecewise-constant distribution over the cells of a chart, as cumulative sums that end with 1.
struct Distribution {
    rows: Vec<f64>,
    columns: Vec<f64>,
}

/// Evaluates a table: the values, and whether they are known.
pub(super) trait Evaluate: Fn(DVec3, DVec3, &mut [f64]) -> bool + Sync {}
impl<F: Fn(DVec3, DVec3, &mut [f64]) -> bool + Sync> Evaluate for F {}

impl Sampler {
    /// Tabulates the mean of `channels` channels of `eval`. The result does not depend on the number of threads.
    /// `breaks` are angles θo (rad) at which the table changes abruptly: nodes of their own.
    pub(super) fn new(channels: usize, breaks: &[f64], eval: impl Evaluate) -> Self {
        let angles = node_angles(breaks);
        let borders = Chart::BOTH.map(row_borders);
        let nodes = angles
            .par_iter()
            .map(|&theta_o| {
                let plane = Plane::new(direction(theta_o, 0.0));
                Node::new(&plane, &borders, &mut vec![0.0; channels], &eval)
            })
            .collect();
        Self { nodes, angles, borders }
    }

    /// The nodes that enclose θo, with their weights.
    fn enclosing(&self, wo: DVec3) -> [(&Node, f64); 2] {
        let theta_o = theta_of(wo).min(LAST_NODE);
        let low = self.angles.partition_point(|&angle| angle <= theta_o).clamp(1, self.angles.len() - 1) - 1;
        let t = (theta_o - self.angles[low]) / (self.angles[low + 1] - self.angles[low]);
        [(&self.nodes[low], 1.0 - t), (&self.nodes[low + 1], t)]
    }

    /// Draws a direction to the light; see [`crate::brdf::Brdf::sample`].
    pub(super) fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        if wo.z.is_nan() || wo.z <= 0.0 {
            return None;
        }
        let plane = Plane::new(wo);
        let wi = match self.choose(wo, u[0]) {
            None => cosine_hemisphere(DVec2::new(u[1], u[2])),
            Some((c, distribution)) => {
                let at = distribution.draw(&self.borders[c], u[1], u[2]);
                plane.leave(Chart::BOTH[c].light(&plane, at)?.0)
            }
        };
        let pdf = self.pdf(wi, wo);
        (wi.z > 0.0 && pdf > 0.0).then_some(Sample { wi, pdf })
    }

    /// The chart and distribution that `u` in [0, 1) chooses; `None` for the cosine.
    fn choose(&self, wo: DVec3, u: f64) -> Option<(usize, &Distribution)> {
        let mut rest = (u - COSINE_SHARE) / (1.0 - COSINE_SHARE);
        if rest < 0.0 {
            return None;
        }
        for (node, weight) in self.enclosing(wo) {
            for (c, distribution) in node.charts.iter().enumerate() {
                let probability = weight * node.mass[c];
                if rest < probability {
                    return Some((c, distribution));
                }
                rest -= probability;
            }
        }
        None // a node that reflects nothing leaves its share to the cosine
    }

    /// Density of [`Self::sample`], per sr.
    pub(super) fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        if wi.z.is_nan() || wo.z.is_nan() || wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        let plane = Plane::new(wo);
        let light = plane.enter(wi);
        let cells =
            Chart::BOTH.map(|chart| chart.place(&plane, light).map(|(at, stretch)| (cell_of(chart, at), stretch)));
        let (mut tabulated, mut total_mass) = (0.0, 0.0);
        for (node, weight) in self.enclosing(wo) {
            total_mass += weight * (node.mass[0] + node.mass[1]);
            for (c, cell) in cells.iter().enumerate() {
                if let Some(((row, column), stretch)) = cell {
                    let density = node.charts[c].density(&self.borders[c], *row, *column);
                    tabulated += weight * node.mass[c] * density / stretch;
                }
            }
        }
        let cosine = COSINE_SHARE + (1.0 - COSINE_SHARE) * (1.0 - total_mass).max(0.0);
        cosine * cosine_hemisphere_pdf(wi) + (1.0 - COSINE_SHARE) * tabulated
    }
}

/// θo of the nodes, ascending: the even ones and `extra`.
fn node_angles(extra: &[f64]) -> Vec<f64> {
    let even = (0..NODES).map(|k| LAST_NODE * k as f64 / (NODES - 1) as f64);
    let mut angles: Vec<f64> = even.chain(extra.iter().copied().filter(|t| (0.0..LAST_NODE).contains(t))).collect();
    angles.sort_by(f64::total_cmp);
    angles.dedup();
    angles
}

/// sin²(θ/2) at the borders of the rows, θ = (k/ROWS)²·θmax.
fn row_borders(chart: Chart) -> Vec<f64> {
    (0..=ROWS).map(|k| (0.5 * row_theta(chart, k as f64)).sin().powi(2)).collect()
}

fn row_theta(chart: Chart, row: f64) -> f64 {
    (row / ROWS as f64).powi(2) * chart.theta_max()
}

/// Row and column of a place, the azimuth folded into half a turn.
fn cell_of(chart: Chart, at: Polar) -> (usize, usize) {
    let theta = 2.0 * at.v.sqrt().asin();
    let row = ROWS as f64 * (theta / chart.theta_max()).sqrt();
    let column = COLUMNS as f64 * at.sin_phi.abs().atan2(at.cos_phi) / PI;
    ((row as usize).min(ROWS - 1), (column as usize).min(COLUMNS - 1))
}

impl Node {
    fn new(plane: &Plane, borders: &[Vec<f64>; 2], scratch: &mut [f64], eval: &impl Evaluate) -> Self {
        let tables = [0, 1].map(|c| {
            let mut reflected = |at: Polar| reflected(Chart::BOTH[c], plane, at, scratch, eval);
            tabulate(Chart::BOTH[c], plane, &borders[c], &mut reflected)
        });
        let sums = [0, 1].map(|c| tables[c].iter().sum::<f64>());
        let total = sums[0] + sums[1];
        let mass = sums.map(|sum| if total > 0.0 { sum / total } else { 0.0 });
        Self { mass, charts: tables.map(|table| Distribution::new(&table)) }
    }
}

/// What the chart answers for of f·cosθi per solid angle of the chart; 0 where the table is negative or unknown.
fn reflected(chart: Chart, plane: &Plane, at: Polar, scratch: &mut [f64], eval: &impl Evaluate) -> f64 {
    let Some((wi, stretch)) = chart.light(plane, at) else { return 0.0 };
    if !eval(wi, plane.wo, scratch) {
        return 0.0;
    }
    let mean = scratch.iter().sum::<f64>() / scratch.len() as f64;
    let value = mean * wi.z * stretch * chart.share(plane, wi);
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

/// Each cell's solid angle times the root mean square of what it reflects: of all piecewise-constant densities, the one in
/// proportion to the root mean square gives the estimate of the integral the least variance.
fn tabulate(chart: Chart, plane: &Plane, borders: &[f64], reflected: &mut impl FnMut(Polar) -> f64) -> Vec<f64> {
    let mut cells = Vec::with_capacity(ROWS * COLUMNS);
    for row in 0..ROWS {
        let (low, high) = (row_theta(chart, row as f64), row_theta(chart, row as f64 + 1.0));
        let solid_angle = cos_difference(low, high) * PI / COLUMNS as f64;
        for column in 0..COLUMNS {
            let at = |s: f64, t: f64| place(borders, (row, s), (column, t));
            let above = |s: f64, t: f64| chart.light(plane, at(s, t)).is_some();
            let corners = [above(0.0, 0.0), above(0.0, 1.0), above(1.0, 0.0), above(1.0, 1.0)];
            let points: &[f64] = match corners.iter().filter(|&&above| above).count() {
                0 => &[],
                4 => &GAUSS,
                _ => &FINE,
            };
            let mut squares = 0.0;
            for (m, &s) in points.iter().enumerate() {
                for (n, &t) in points.iter().enumerate() {
                    // Every other point on the far side of the plane of incidence: a table need not be symmetric.
                    let side = if (m + n) % 2 == 0 { 1.0 } else { -1.0 };
                    squares += reflected(at(s, t).on_side(side)).powi(2);
                }
            }
            cells.push(solid_angle * (squares / (points.len() * points.len()).max(1) as f64).sqrt());
        }
    }
    cells
}

/// Where a cell is looked at, each way: the two Gauss points.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
/// Where a cell is looked at that the horizon cuts.
const FINE: [f64; 4] = [0.125, 0.375, 0.625, 0.875];

/// The place at these fractions of a row (by solid angle) and of a column.
fn place(borders: &[f64], (row, s): (usize, f64), (column, t): (usize, f64)) -> Polar {
    let v = borders[row] + s * (borders[row + 1] - borders[row]);
    let (sin_phi, cos_phi) = (PI * (column as f64 + t) / COLUMNS as f64).sin_cos();
    Polar { v, cos_phi, sin_phi }
}

impl Distribution {
    fn new(cells: &[f64]) -> Self {
        let sums: Vec<f64> = cells.chunks(COLUMNS).map(|row| row.iter().sum()).collect();
        Self { rows: cumulative(&sums), columns: cells.chunks(COLUMNS).flat_map(cumulative).collect() }
    }

    /// The cumulative sums of a row's columns.
    fn row(&self, row: usize) -> &[f64] {
        &self.columns[row * (COLUMNS + 1)..(row + 1) * (COLUMNS + 1)]
    }

    /// A place drawn by two numbers in [0, 1). The second is stretched over both sides of the plane of incidence.
    fn draw(&self, borders: &[f64], u0: f64, u1: f64) -> Polar {
        let (row, s) = invert(&self.rows, u0);
        let (side, u1) = if u1 < 0.5 { (1.0, 2.0 * u1) } else { (-1.0, 2.0 - 2.0 * u1) };
        let (column, t) = invert(self.row(row), u1);
        place(borders, (row, s), (column, t)).on_side(side)
    }

    /// Density of [`Self::draw`] in a cell, per sr of the chart.
    fn density(&self, borders: &[f64], row: usize, column: usize) -> f64 {
        let columns = self.row(row);
        let probability = (self.rows[row + 1] - self.rows[row]) * (columns[column + 1] - columns[column]);
        // Both sides of the plane: 2 Ω, with Ω = (cosθa − cosθb)·Δφ = 2 (v_b − v_a)·π/COLUMNS.
        probability * COLUMNS as f64 / (4.0 * PI * (borders[row + 1] - borders[row]))
    }
}

/// Cumulative sums scaled to end with exactly 1, starting with 0; uniform when all is 0.
fn cumulative(cells: &[f64]) -> Vec<f64> {
    let total: f64 = cells.iter().sum();
    let mut sum = 0.0;
    let mut sums: Vec<f64> = std::iter::once(0.0)
        .chain(cells.iter().map(|&cell| {
            sum += if total > 0.0 { cell / total } else { 1.0 / cells.len() as f64 };
            sum.min(1.0)
        }))
        .collect();
    if let Some(last) = sums.iter_mut().rev().take(1).next() {
        *last = 1.0;
    }
    sums
}

/// The interval of `sums` that holds `u` in [0, 1), and the place in it.
fn invert(sums: &[f64], u: f64) -> (usize, f64) {
    let index = sums.partition_point(|&sum| sum <= u).clamp(1, sums.len() - 1) - 1;
    let width = sums[index + 1] - sums[index];
    (index, if width > 0.0 { ((u - sums[index]) / width).clamp(0.0, 1.0) } else { 0.5 })
}
