//! The map between directions and the pixels of a picture in latitude and longitude.
//!
//! The direction (sinφ sinθ, cosθ, −cosφ sinθ), up being +y, has the column φ/2π·W − ½, which wraps, and the row θ/π·(H − 1):
//! the first and the last row are the poles. Four neighbouring pixels are the corners of a cell; there are W·(H − 1).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

/// A grid of pixels over the sphere.
#[derive(Debug, Clone)]
pub struct LatLong {
    /// Columns, at least 1.
    pub width: usize,
    /// Rows, at least 2.
    pub height: usize,
    /// Added to φ before the column is looked up, rad: turns what is seen by this angle about +y.
    turn: f64,
    /// sin²(θ/2) of every row; the share of the sphere above it.
    cap: Vec<f64>,
    /// Solid angle of a cell in every row of them, sr.
    solid_angles: Vec<f64>,
}

/// A place in a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Column of the pixels on the left; the right ones are the next column, which after the last is the first.
    pub column: usize,
    /// Row of the upper pixels.
    pub row: usize,
    /// Distance from the left, 0 to 1, in φ.
    pub x: f64,
    /// Distance from above, 0 to 1, in θ.
    pub y: f64,
    /// Share of the cell's solid angle that lies above, 0 to 1.
    pub s: f64,
}

impl LatLong {
    /// The grid of a picture with `width` ≥ 1 columns and `height` ≥ 2 rows, turned by `turn` (rad) about +y: counter-clockwise
    /// seen from above.
    pub fn new(width: usize, height: usize, turn: f64) -> Self {
        let half = FRAC_PI_2 / (height - 1) as f64;
        let cap = |row: usize| (half * row as f64).sin().powi(2);
        // 2π/W·(cosθ_a − cosθ_b), as a product that does not cancel.
        let solid_angle = |row: usize| 2.0 * TAU / width as f64 * (half * (2 * row + 1) as f64).sin() * half.sin();
        let (cap, solid_angles) = ((0..height).map(cap).collect(), (0..height - 1).map(solid_angle).collect());
        Self { width, height, turn: turn % TAU, cap, solid_angles }
    }

    /// Solid angle of a cell in this row, sr.
    pub fn solid_angle(&self, row: usize) -> f64 {
        self.solid_angles[row]
    }

    /// Where a direction lies.
    pub fn place(&self, d: DVec3) -> Place {
        let (x, column) = self.across(d);
        let flat2 = d.x.mul_add(d.x, d.z * d.z);
        let down = self.down(flat2, d.y);
        let row = (down as usize).min(self.height - 2);
        // Measured from the nearer pole, where the share of the sphere keeps its digits.
        let (from, mirrored) = self.nearer_pole(row);
        let (low, high) = (self.cap[from], self.cap[from + 1]);
        let up = if mirrored { -d.y } else { d.y };
        // sin²(θ/2) by that of the two forms that doesn't cancel.
        let cap = if up >= 0.0 { flat2 / (2.0 + 2.0 * up) } else { 0.5 - 0.5 * up };
        let s = ((cap - low) / (high - low)).clamp(0.0, 1.0);
        Place { column, row, x, y: (down - row as f64).clamp(0.0, 1.0), s: if mirrored { 1.0 - s } else { s } }
    }

    /// Rows from above, of the direction with this sin²θ and cosθ.
    fn down(&self, flat2: f64, up: f64) -> f64 {
        flat2.sqrt().atan2(up) * ((self.height - 1) as f64 / PI)
    }

    /// The place with coordinates x and s in a cell, and its unit direction.
    pub fn at(&self, column: usize, row: usize, x: f64, s: f64) -> (Place, DVec3) {
        let d = self.direction(column, row, x, s);
        let y = (self.down(d.x.mul_add(d.x, d.z * d.z), d.y) - row as f64).clamp(0.0, 1.0);
        (Place { column, row, x, y, s }, d)
    }

    /// The unit direction of the point with coordinates x and s in a cell.
    pub fn direction(&self, column: usize, row: usize, x: f64, s: f64) -> DVec3 {
        let (from, mirrored) = self.nearer_pole(row);
        let s = if mirrored { 1.0 - s } else { s };
        let cap = self.cap[from] + s * (self.cap[from + 1] - self.cap[from]);
        let flat = 2.0 * (cap * (1.0 - cap)).sqrt();
        let up = if mirrored { 2.0 * cap - 1.0 } else { 1.0 - 2.0 * cap };
        let (sin, cos) = ((column as f64 + x + 0.5) / self.width as f64 * TAU - self.turn).sin_cos();
        DVec3::new(sin * flat, up, -cos * flat).normalize()
    }

    /// φ of the left edge of a column of cells, rad.
    fn azimuth(&self, column: f64) -> f64 {
        (column + 0.5) / self.width as f64 * TAU - self.turn
    }

    /// The direction in the middle of a block of cells: columns and rows, their ends not included.
    pub fn middle(&self, columns: (usize, usize), rows: (usize, usize)) -> DVec3 {
        let theta = 0.5 * PI * (rows.0 + rows.1) as f64 / (self.height - 1) as f64;
        let (sin, cos) = self.azimuth(0.5 * (columns.0 + columns.1) as f64).sin_cos();
        DVec3::new(sin * theta.sin(), theta.cos(), -cos * theta.sin())
    }

    /// The largest distance of a block's directions from a point: |ω − p|² = 1 + p² − 2 p·ω, and p·ω is least at an edge, at the azimuth
    /// away from p, or, along a meridian, away from p.
    pub fn farthest(&self, p: DVec3, columns: (usize, usize), rows: (usize, usize)) -> f64 {
        let theta = |row: usize| PI * row as f64 / (self.height - 1) as f64;
        let (from, to) = (self.azimuth(columns.0 as f64), self.azimuth(columns.1 as f64));
        let away = p.x.atan2(-p.z) + PI;
        let inside = (away - from).rem_euclid(TAU) <= to - from;
        let least = |phi: f64| {
            let across = p.x * phi.sin() - p.z * phi.cos();
            let along = |theta: f64| p.y * theta.cos() + across * theta.sin();
            let bottom = across.atan2(p.y) + PI; // where p·ω is least on the whole circle
            let at = bottom.rem_euclid(TAU).clamp(theta(rows.0), theta(rows.1));
            along(at).min(along(theta(rows.0))).min(along(theta(rows.1)))
        };
        let mut dot = least(from).min(least(to));
        if inside {
            dot = dot.min(least(away));
        }
        (1.0 + p.length_squared() - 2.0 * dot).clamp(0.0, 4.0).sqrt()
    }

    /// Row counted from the nearer pole, and whether that is the lower one.
    fn nearer_pole(&self, row: usize) -> (usize, bool) {
        if 2 * row + 1 < self.height { (row, false) } else { (self.height - 2 - row, true) }
    }

    fn across(&self, d: DVec3) -> (f64, usize) {
        let across = (d.x.atan2(-d.z) + self.turn) / TAU * self.width as f64 - 0.5;
        let column = across.floor();
        (across - column, (column as i64).rem_euclid(self.width as i64) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::uniform_sphere;
    use crate::numeric::random::{Purpose, RngExt, stream};
    use glam::DVec2;

    #[test]
    fn directions_and_places_invert() {
        let mut rng = stream(1, Purpose::Study, 0);
        for (width, height, turn) in [(1, 2, 0.0), (8, 3, 0.4), (512, 256, -2.0), (5000, 4001, 7.0)] {
            let grid = LatLong::new(width, height, turn);
            for _ in 0..2000 {
                let d = uniform_sphere(DVec2::new(rng.random(), rng.random()));
                let p = grid.place(d);
                let back = grid.direction(p.column, p.row, p.x, p.s);
                // The share of the sphere keeps its digits at either pole.
                assert!((back - d).length() < 1e-14, "{width} x {height}: {d} came back as {back}");
            }
        }
    }

    #[test]
    fn the_convention_is_as_stated() {
        let grid = LatLong::new(512, 256, 0.0);
        let (phi, theta) = (TAU * 100.5 / 512.0 + 1e-9, PI * 64.0 / 255.0 + 1e-9);
        let p = grid.place(DVec3::new(phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin()));
        assert!(p.column == 100 && p.row == 64 && p.x < 1e-6 && p.y < 1e-6, "{p:?}");
        // Left of the first column lies the last.
        let p = grid.place(DVec3::new(1e-9, 0.0, -1.0));
        assert!(p.column == 511 && (p.x - 0.5).abs() < 1e-6, "{p:?}");
        // What lies at −z, turned by 90° about +y, is seen at −x.
        let turned = LatLong::new(512, 256, FRAC_PI_2);
        let (a, b) = (grid.place(-DVec3::Z), turned.place(-DVec3::X));
        assert!(a.column == b.column && (a.x - b.x).abs() < 1e-9, "{a:?} {b:?}");
    }

    #[test]
    fn cells_fill_the_sphere() {
        for (width, height) in [(1, 2), (7, 3), (512, 256)] {
            let grid = LatLong::new(width, height, 0.0);
            let sum: f64 = (0..height - 1).map(|row| width as f64 * grid.solid_angle(row)).sum();
            assert!((sum / (2.0 * TAU) - 1.0).abs() < 1e-14, "{width} x {height}: {sum}");
        }
    }

    /// Among 41² directions of a block none is farther from a point than stated, and one nearly is.
    #[test]
    fn the_farthest_direction_of_a_block_is_found() {
        let mut rng = stream(2, Purpose::Study, 0);
        for case in 0..600 {
            let grid = LatLong::new(
                1 + rng.random_range(0..40usize),
                2 + rng.random_range(0..20usize),
                3.0 * rng.random::<f64>(),
            );
            let columns = (rng.random_range(0..grid.width), grid.width);
            let rows = (rng.random_range(0..grid.height - 1), grid.height - 1);
            let columns = (columns.0, rng.random_range(columns.0..columns.1) + 1);
            let rows = (rows.0, rng.random_range(rows.0..rows.1) + 1);
            let size = [0.0, 0.3, 0.9, 1.0][case % 4];
            let p = size * uniform_sphere(DVec2::new(rng.random(), rng.random()));
            let stated = grid.farthest(p, columns, rows);
            let at = |(from, to): (usize, usize), k: usize| {
                let x = from as f64 + (to - from) as f64 * k as f64 / 40.0;
                let cell = (x as usize).min(to - 1);
                (cell, x - cell as f64)
            };
            let mut found: f64 = 0.0;
            for k in 0..41 * 41 {
                let ((column, x), (row, y)) = (at(columns, k % 41), at(rows, k / 41));
                let (top, bottom) = (PI * row as f64 / (grid.height - 1) as f64, PI / (grid.height - 1) as f64);
                let theta = top + y * bottom;
                let (sin, cos) = grid.azimuth(column as f64 + x).sin_cos();
                found = found.max((DVec3::new(sin * theta.sin(), theta.cos(), -cos * theta.sin()) - p).length());
            }
            assert!(found <= stated + 1e-12, "case {case}: {found} beyond {stated}");
            // The grid of directions misses the farthest by half a step each way.
            assert!(stated - found < 0.03, "case {case}: {stated} where {found} is farthest");
        }
    }
}
