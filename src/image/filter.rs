//! Separable filters over pictures of one number a pixel.

use rayon::prelude::*;

/// A picture of one number a pixel. Pixels run along rows, row 0 on top.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f64>,
}

impl Plane {
    /// The plane whose pixel `i` is `value(i)`.
    pub fn new(width: usize, height: usize, value: impl Fn(usize) -> f64 + Sync + Send) -> Self {
        Self { width, height, values: (0..width * height).into_par_iter().map(value).collect() }
    }

    /// Weighed by `across` along rows, then by `down` along columns; both have an odd length. Beyond the edges, edge pixels
    /// repeat. Sums run in one order, whatever the number of threads.
    pub fn filtered(&self, across: &[f64], down: &[f64]) -> Self {
        self.along_rows(across).along_columns(down)
    }

    fn along_rows(&self, kernel: &[f64]) -> Self {
        let radius = kernel.len() / 2;
        let mut values = vec![0.0; self.values.len()];
        let rows = values.par_chunks_mut(self.width.max(1)).zip(self.values.par_chunks(self.width.max(1)));
        rows.for_each(|(out, row)| {
            let (first, last) = (row[0], row[row.len() - 1]);
            let padded: Vec<f64> = std::iter::repeat_n(first, radius)
                .chain(row.iter().copied())
                .chain(std::iter::repeat_n(last, radius))
                .collect();
            for (k, weight) in kernel.iter().enumerate() {
                out.iter_mut().zip(&padded[k..]).for_each(|(o, x)| *o += weight * x);
            }
        });
        Self { values, ..*self }
    }

    fn along_columns(&self, kernel: &[f64]) -> Self {
        let (radius, width) = (kernel.len() / 2, self.width.max(1));
        let mut values = vec![0.0; self.values.len()];
        values.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            for (k, weight) in kernel.iter().enumerate() {
                let from = (y + k).saturating_sub(radius).min(self.height - 1);
                let row = &self.values[from * width..][..width];
                out.iter_mut().zip(row).for_each(|(o, x)| *o += weight * x);
            }
        });
        Self { values, ..*self }
    }
}

/// The values of `f` at −`radius`, …, `radius`.
pub(super) fn kernel(radius: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * radius).map(|i| f(i as f64 - radius as f64)).collect()
}

/// A kernel whose positive weights sum to 1, and whose negative ones, where there are any, to −1.
pub(super) fn balanced(weights: &[f64]) -> Vec<f64> {
    let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = -weights.iter().filter(|w| **w < 0.0).sum::<f64>();
    weights.iter().map(|w| if *w < 0.0 { w / negative } else { w / positive }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edge_pixels_repeat_and_a_spike_shows_the_kernel() {
        let plane = Plane::new(5, 3, |i| if i == 7 { 1.0 } else { 0.0 });
        let out = plane.filtered(&[0.25, 0.5, 0.25], &[0.0, 1.0, 0.0]);
        assert_eq!(out.values[5..10], [0.0, 0.25, 0.5, 0.25, 0.0]);
        let edge = Plane::new(3, 1, |i| if i == 0 { 1.0 } else { 0.0 }).filtered(&[0.25, 0.5, 0.25], &[1.0]);
        assert_eq!(edge.values, [0.75, 0.25, 0.0]);
        let constant = Plane::new(2, 2, |_| 3.0).filtered(&[0.2; 5], &[0.2; 5]);
        assert!(constant.values.iter().all(|v| (v - 3.0).abs() < 1e-14));
    }
}
