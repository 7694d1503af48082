//! Differences of two pictures in units of their noise, in pixels and in blocks of them.

use super::Image;

/// The picture in blocks of one size.
pub(super) struct Level {
    pub width: usize,
    pub height: usize,
    /// Edge of a block, pixels.
    pub block: usize,
    cells: Vec<[Cell; 3]>,
}

impl Level {
    pub fn pixels(image: &Image, reference: &Image, known: &[bool]) -> Self {
        let freedom = |p: &Image| p.metadata.samples.map_or(f64::INFINITY, |n| f64::from(n) - 1.0);
        let (freedom, reference_freedom) = (freedom(image), freedom(reference));
        let (noise, reference_noise) = (pooled_variance(image, known), pooled_variance(reference, known));
        let cell = |i: usize, c: usize| {
            let (x, r) = (image.radiance[i][c], reference.radiance[i][c]);
            let (v, w) = (noise[i][c], reference_noise[i][c]);
            let agree = (x - r).abs() == 0.0 && v + w == 0.0;
            if !known[i] || agree || v + w == f64::INFINITY {
                return Cell::default();
            }
            let rounding = 0.5 * f64::from(f32::EPSILON) * x.abs().max(r.abs());
            let spread = v * v / freedom + w * w / reference_freedom;
            Cell { tested: true, pixels: 1.0, difference: x - r, variance: v + w + rounding * rounding, spread }
        };
        let cells = (0..known.len()).map(|i| [cell(i, 0), cell(i, 1), cell(i, 2)]).collect();
        Self { width: image.width, height: image.height, block: 1, cells }
    }

    /// The picture in blocks of twice the edge.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut cells = vec![[Cell::default(); 3]; width * height];
        for (i, from) in self.cells.iter().enumerate() {
            let (x, y) = (i % self.width, i / self.width);
            let into = &mut cells[y / 2 * width + x / 2];
            (0..3).for_each(|c| into[c].add(&from[c]));
        }
        Self { width, height, block: 2 * self.block, cells }
    }

    pub fn outcome(&self) -> Outcome {
        let mut outcome = Outcome { block: self.block, ..Outcome::default() };
        for (i, cell) in self.cells.iter().enumerate() {
            for (c, cell) in cell.iter().enumerate().filter(|(_, cell)| cell.tested) {
                let z = cell.z();
                outcome.tests += 1;
                outcome.squares += z * z;
                if exceeds(z, outcome.max_z) {
                    let (column, row) = (i % self.width, i / self.width);
                    (outcome.max_z, outcome.at) = (z, (self.block * column, self.block * row, c));
                    let pixels = cell.pixels;
                    outcome.difference = (cell.difference / pixels, cell.variance.sqrt() / pixels);
                }
            }
        }
        outcome
    }
}

/// What the tests of one level, or of several, found.
#[derive(Debug, Clone, Default)]
pub(super) struct Outcome {
    pub tests: usize,
    pub max_z: f64,
    pub at: (usize, usize, usize),
    pub block: usize,
    /// Σ z².
    pub squares: f64,
    /// Mean of x − ref over the tested pixels of the block of `max_z`, and its standard error.
    pub difference: (f64, f64),
}

impl Level {
    /// Cells of which some channel is tested, and those of which some channel has a |z| beyond the `limit`, or one that is not a number.
    pub fn beyond(&self, limit: f64) -> (usize, usize) {
        let tested = |cell: &&[Cell; 3]| cell.iter().any(|c| c.tested);
        let far = |cell: &&[Cell; 3]| cell.iter().any(|c| c.tested && (c.z() > limit || c.z().is_nan()));
        (self.cells.iter().filter(tested).count(), self.cells.iter().filter(far).count())
    }
}

impl Level {
    /// The signed z of largest size in every cell; `None` where none is tested: unknown, or equal without noise.
    pub fn signed(&self) -> Vec<Option<f64>> {
        let z = |c: &Cell| c.tested.then(|| c.z().copysign(c.difference));
        let larger = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        self.cells.iter().map(|cell| cell.iter().filter_map(z).reduce(larger)).collect()
    }
}

impl Outcome {
    pub fn join(&mut self, other: &Self) {
        self.tests += other.tests;
        if exceeds(other.max_z, self.max_z) {
            (self.max_z, self.at, self.block) = (other.max_z, other.at, other.block);
            self.difference = other.difference;
        }
    }
}

/// Whether z is above the largest so far; the first NaN is above everything.
fn exceeds(z: f64, largest: f64) -> bool {
    z > largest || (z.is_nan() && !largest.is_nan())
}

/// Sums over a block.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    tested: bool,
    /// Pixels tested.
    pixels: f64,
    /// Σ (x − ref).
    difference: f64,
    /// Σ (σ² + σref²).
    variance: f64,
    /// Σ σ⁴/(samples − 1) of both pictures.
    spread: f64,
}

impl Cell {
    fn add(&mut self, other: &Self) {
        self.tested |= other.tested;
        self.pixels += other.pixels;
        self.difference += other.difference;
        self.variance += other.variance;
        self.spread += other.spread;
    }

    fn z(&self) -> f64 {
        if self.difference == 0.0 {
            return 0.0;
        }
        let t = self.difference.abs() / self.variance.sqrt();
        if self.spread > 0.0 { normal_of_student(t, self.variance * self.variance / self.spread) } else { t }
    }
}

/// The normal variate as improbable as Student's t ≥ 0 with `freedom` degrees of freedom, to 1 % from 15 degrees on up to z = 6
/// (Wallace 1959): z = (8ν + 1)/(8ν + 3)·√(ν ln(1 + t²/ν)).
pub(super) fn normal_of_student(t: f64, freedom: f64) -> f64 {
    (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * (freedom * (t * t / freedom).ln_1p()).sqrt()
}

/// Variance of every pixel: the larger of its own and the mean of the three largest among the 3 × 3 known pixels about it, those
/// that are not finite left out; 0 for an exact picture. NaN stays NaN.
fn pooled_variance(image: &Image, known: &[bool]) -> Vec<[f64; 3]> {
    let Some(errors) = &image.standard_error else { return vec![[0.0; 3]; known.len()] };
    let near = |i: usize, end: usize| i.saturating_sub(1)..(i + 2).min(end);
    let pooled = |i: usize| {
        let columns = near(i % image.width, image.width);
        let cells = near(i / image.width, image.height).flat_map(|y| columns.clone().map(move |x| y * image.width + x));
        // The three largest so far, channel by channel.
        let mut largest = [[0.0f64; 3]; 3];
        for k in cells.filter(|k| known[*k]) {
            for (c, top) in largest.iter_mut().enumerate() {
                let mut value = errors[k][c] * errors[k][c];
                if value.is_finite() {
                    for kept in top {
                        (*kept, value) = (kept.max(value), kept.min(value));
                    }
                }
            }
        }
        [0, 1, 2].map(|c| {
            let own = errors[i][c] * errors[i][c];
            if own.is_nan() { own } else { own.max(largest[c].iter().sum::<f64>() / 3.0) }
        })
    };
    (0..errors.len()).map(pooled).collect()
}
