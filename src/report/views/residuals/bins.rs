//! Cells of a grid over two angles, and what they show.

use glam::DVec3;

use crate::geometry::theta_of;
use crate::measurement::{Directions, Measurement};

/// Sums over the residuals of each cell of a grid over two angles.
#[derive(Debug, Clone, PartialEq)]
pub struct Binned {
    /// Borders of the columns, degrees.
    pub x_deg: Vec<f64>,
    /// Borders of the rows, degrees.
    pub y_deg: Vec<f64>,
    /// Values in each cell, row by row.
    pub count: Vec<u64>,
    /// Σ w.
    pub weight: Vec<f64>,
    /// Σ w r.
    pub sum: Vec<f64>,
    /// Σ w r².
    pub squares: Vec<f64>,
    /// Σ w² r²: the variance of Σ w r, were r nothing but independent noise.
    pub variance: Vec<f64>,
}

/// What a cell shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// Σ w r / Σ w: which way the fit is off.
    Mean,
    /// √(Σ w r² / Σ w): how far.
    Rms,
    /// Σ w r / √(Σ w² r²): the mean over its own error. Noise alone gives numbers like those of a normal distribution, about 1.
    OverNoise,
}

impl Statistic {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Mean, Self::Rms, Self::OverNoise];

    /// Its name in options and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Rms => "rms",
            Self::OverNoise => "over-noise",
        }
    }
}

impl Binned {
    pub(super) fn new(x_deg: Vec<f64>, y_deg: Vec<f64>) -> Self {
        let cells = (x_deg.len() - 1) * (y_deg.len() - 1);
        let zero = vec![0.0; cells];
        Self {
            x_deg,
            y_deg,
            count: vec![0; cells],
            weight: zero.clone(),
            sum: zero.clone(),
            squares: zero.clone(),
            variance: zero,
        }
    }

    pub(super) fn cell(&self, x: f64, y: f64) -> Option<usize> {
        let find = |borders: &[f64], v: f64| {
            let k = borders.partition_point(|b| *b <= v);
            // The last border belongs to the last cell.
            let k = if k == borders.len() && v <= borders[k - 1] + 1e-9 { k - 1 } else { k };
            (k > 0 && k < borders.len()).then(|| k - 1)
        };
        Some(find(&self.y_deg, y)? * (self.x_deg.len() - 1) + find(&self.x_deg, x)?)
    }

    pub(super) fn add(&mut self, cell: usize, weight: f64, r: f64) {
        self.count[cell] += 1;
        self.weight[cell] += weight;
        self.sum[cell] += weight * r;
        self.squares[cell] += weight * r * r;
        self.variance[cell] += (weight * r).powi(2);
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.count.iter_mut().zip(&other.count).for_each(|(a, b)| *a += b);
        for (a, b) in [
            (&mut self.weight, &other.weight),
            (&mut self.sum, &other.sum),
            (&mut self.squares, &other.squares),
            (&mut self.variance, &other.variance),
        ] {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        }
    }

    /// What each cell shows; `None` where it is empty.
    #[must_use]
    pub fn values(&self, statistic: Statistic) -> Vec<Option<f64>> {
        let of = |i: usize| match statistic {
            Statistic::Mean => self.sum[i] / self.weight[i],
            Statistic::Rms => (self.squares[i] / self.weight[i]).sqrt(),
            Statistic::OverNoise if self.variance[i] > 0.0 => self.sum[i] / self.variance[i].sqrt(),
            Statistic::OverNoise => 0.0,
        };
        (0..self.count.len()).map(|i| (self.weight[i] > 0.0).then(|| of(i))).collect()
    }
}

/// Borders of the cells.
pub(super) struct Bins {
    half: Vec<f64>,
    difference: Vec<f64>,
    theta_i: Vec<f64>,
    theta_o: Vec<f64>,
}

impl Bins {
    /// As many as the readings fill. Where polar angles repeat they stand in the middle of cells, so that rounding does not
    /// split them; θh is finer towards 0, where lobes are.
    pub(super) fn of(table: &Measurement) -> Self {
        let count = ((table.len() as f64).sqrt() / 6.0).clamp(10.0, 45.0) as usize;
        let even = |n: usize| (0..=n).map(|k| 90.0 * k as f64 / n as f64).collect::<Vec<f64>>();
        let half = even(count).iter().map(|x| x * x / 90.0).collect();
        let step = |pick: fn(&(DVec3, DVec3)) -> DVec3| repeated_step(table, pick);
        let polar = |step: Option<f64>| step.map_or_else(|| even(count), centred);
        let theta_o = polar(step(|p| p.1));
        let mut signed: Vec<f64> = theta_o.iter().skip(1).rev().map(|t| -t).collect();
        // A cell about 0 is one, not two.
        signed.extend(if theta_o[1] < theta_o[2] - theta_o[1] - 1e-9 { &theta_o[1..] } else { &theta_o[..] });
        Self { half, difference: even(count), theta_i: polar(step(|p| p.0)), theta_o: signed }
    }

    /// Two maps a channel.
    pub(super) fn empty(&self, channels: usize) -> Vec<Binned> {
        let pair = [
            Binned::new(self.half.clone(), self.difference.clone()),
            Binned::new(self.theta_i.clone(), self.theta_o.clone()),
        ];
        (0..channels).flat_map(|_| pair.clone()).collect()
    }
}

/// The step between the polar angles of a list, where there are at most 60 of them; degrees, at least 2°.
fn repeated_step(table: &Measurement, pick: fn(&(DVec3, DVec3)) -> DVec3) -> Option<f64> {
    let Directions::List { .. } = &table.directions else { return None };
    let angle = |i: usize| (theta_of(pick(&table.directions.pair(i))).to_degrees() * 1e4).round() as i64;
    let mut angles: Vec<i64> = (0..table.len()).map(angle).collect();
    angles.sort_unstable();
    angles.dedup();
    let mut steps: Vec<i64> = angles.windows(2).map(|p| p[1] - p[0]).collect();
    steps.sort_unstable();
    let middle = *steps.get(steps.len() / 2)? as f64 * 1e-4;
    (angles.len() <= 60).then_some(middle.clamp(2.0, 30.0))
}

/// Cells about the multiples of a step, over 0° to 90°.
fn centred(step: f64) -> Vec<f64> {
    let inner = (0..).map(|k| (f64::from(k) + 0.5) * step).take_while(|t| *t < 90.0 - 1e-9);
    std::iter::once(0.0).chain(inner).chain(std::iter::once(90.0)).collect()
}
