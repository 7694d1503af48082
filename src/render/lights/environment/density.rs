//! The density with which directions are drawn from a picture of the sky.
//!
//! Within a cell the radiance is bilinear in φ and θ; the density is bilinear in φ and the solid angle, with the radiance's corners
//! (the mean of the three channels). So both vanish at the same corners and edges, and their ratio stays between ½ and 2 for
//! grey light. In the two rows at the poles, where θ and solid angle part, the density is the same all over a cell. A
//! cell's probability is its mean corner times its solid angle: nothing is integrated numerically.

use glam::DVec2;

use super::super::pick::pick;
use super::lat_long::{LatLong, Place};

/// Sums over the cells of a picture.
#[derive(Debug)]
pub struct Density {
    /// ∫ brightness dω, W/m².
    total: f64,
    /// Running sums of the mean corner along each row of a block's cells, W/(sr·m²), which begin anew with each block: what is dark keeps its digits beside
    /// what is bright.
    cells: Vec<f64>,
}

/// Brightness at the corners of a cell: left and right above, left and right below; W/(sr·m²).
pub type Corners = [f64; 4];

impl Density {
    /// The density of a grid whose cells have these corners, for blocks of so many columns.
    pub fn new(grid: &LatLong, block: usize, corners: impl Fn(usize, usize) -> Corners) -> Self {
        let mut total = 0.0;
        let mut cells = Vec::with_capacity(grid.width * (grid.height - 1));
        for row in 0..grid.height - 1 {
            let (mut sum, mut of_row) = (0.0, 0.0);
            for column in 0..grid.width {
                if column % block == 0 {
                    of_row += std::mem::take(&mut sum);
                }
                sum += mean(corners(column, row));
                cells.push(sum);
            }
            total += (of_row + sum) * grid.solid_angle(row);
        }
        Self { total, cells }
    }

    /// ∫ brightness dω, W/m²; 0 where the picture is black.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Density at a place, per sr.
    pub fn pdf(&self, grid: &LatLong, place: &Place, corners: Corners) -> f64 {
        if at_pole(grid, place.row) {
            return mean(corners) / self.total();
        }
        let [a, b, c, d] = corners;
        (lerp(lerp(a, b, place.x), lerp(c, d, place.x), place.s)) / self.total()
    }

    /// Light of cells of one block, columns and rows without their ends, W/m².
    pub fn light(&self, grid: &LatLong, columns: (usize, usize), rows: (usize, usize)) -> f64 {
        (rows.0..rows.1).map(|row| self.of_row(grid, columns, row)).sum()
    }

    /// Sums along a row of a block.
    fn sums(&self, grid: &LatLong, columns: (usize, usize), row: usize) -> &[f64] {
        self.cells.get(row * grid.width + columns.0..row * grid.width + columns.1).unwrap_or_default()
    }

    fn of_row(&self, grid: &LatLong, columns: (usize, usize), row: usize) -> f64 {
        self.sums(grid, columns, row).last().copied().unwrap_or(0.0) * grid.solid_angle(row)
    }

    /// The row of a block in which the share u of its light lies, and how far through it, 0 to 1.
    fn pick_row(&self, grid: &LatLong, columns: (usize, usize), rows: (usize, usize), u: f64) -> (usize, f64) {
        let target = u * self.light(grid, columns, rows);
        let (mut above, mut last) = (0.0, (rows.0, 0.0));
        for row in rows.0..rows.1 {
            let here = self.of_row(grid, columns, row);
            if here > 0.0 {
                last = (row, ((target - above) / here).clamp(0.0, 1.0));
                if target < above + here {
                    break;
                }
            }
            above += here;
        }
        last
    }

    /// The cell of a block in which two numbers in [0, 1) lie, as column and row, and how far through it, to the right and down.
    pub fn pick(
        &self,
        grid: &LatLong,
        (columns, rows): ((usize, usize), (usize, usize)),
        u: DVec2,
    ) -> (usize, usize, f64, f64) {
        let (row, s) = self.pick_row(grid, columns, rows, u.x);
        let (column, x) = pick(self.sums(grid, columns, row), u.y);
        (column + columns.0, row, x, s)
    }
}

/// The coordinates x and s in a cell of a row, with these corners, so far through it.
pub fn within(grid: &LatLong, row: usize, [a, b, c, d]: Corners, (x, s): (f64, f64)) -> (f64, f64) {
    if at_pole(grid, row) {
        return (x, s);
    }
    let s = linear(a + b, c + d, s);
    (linear(lerp(a, c, s), lerp(b, d, s), x), s)
}

fn at_pole(grid: &LatLong, row: usize) -> bool {
    row == 0 || row + 2 == grid.height
}

fn mean([a, b, c, d]: Corners) -> f64 {
    0.25 * ((a + b) + (c + d))
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    (1.0 - t) * a + t * b
}

/// t in [0, 1] with a density that runs linearly from a to b, both at least 0; the root's form that does not cancel.
fn linear(a: f64, b: f64, u: f64) -> f64 {
    let root = lerp(a * a, b * b, u).sqrt();
    if a + root > 0.0 { (u * (a + b) / (a + root)).clamp(0.0, 1.0) } else { u }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_linear_density_is_inverted() {
        for (a, b) in [(1.0, 1.0), (0.0, 2.0), (2.0, 0.0), (1e-9, 1.0), (3.0, 1e5)] {
            for i in 0..=16 {
                let u = f64::from(i) / 16.0;
                let t = linear(a, b, u);
                let back = t * (a + 0.5 * t * (b - a)) / (0.5 * (a + b));
                assert!((back - u).abs() < 1e-12, "{a} to {b}, {u}: {back}");
            }
        }
    }
}
