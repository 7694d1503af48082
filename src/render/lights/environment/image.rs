//! An environment from a picture in latitude and longitude, bilinear between its pixels, sampled in proportion to its light.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::above::{Above, Drawn};
use super::density::{Density, within};
use super::lat_long::{LatLong, Place};
use crate::image::{ColorGrid, read_exr_colors};
use crate::render::RenderError;

/// Pixels of an environment at most: 8192 × 4096, which take 0.7 GB.
pub const MAX_PIXELS: u64 = 1 << 25;

/// A picture of all directions (see [`LatLong`] for which pixel shows which).
#[derive(Debug)]
pub struct EnvironmentImage {
    grid: LatLong,
    pixels: Vec<[f32; 3]>,
    /// What a pixel's value is multiplied by, at least 0.
    scale: f64,
    density: Density,
    above: Above,
}

impl EnvironmentImage {
    /// Reads an OpenEXR file: its radiance (W/(sr·m²)) is multiplied by `scale` and turned by `turn` (rad) about +y. `None` where it
    /// gives no light at all.
    ///
    /// # Errors
    /// [`RenderError::Image`] where it can't be read, [`RenderError::Environment`] where it is no picture of light: fewer than 2
    /// rows, or a value that is negative or not finite.
    pub fn read(path: &Path, scale: f64, turn: f64) -> Result<Option<Self>, RenderError> {
        Self::new(path, read_exr_colors(path, MAX_PIXELS)?, scale, turn)
    }

    /// [`EnvironmentImage::read`] from pixels; errors call them `path`.
    pub fn new(path: &Path, picture: ColorGrid, scale: f64, turn: f64) -> Result<Option<Self>, RenderError> {
        check(path, &picture)?;
        let grid = LatLong::new(picture.width, picture.height, turn);
        let block = Above::block(&grid);
        let density =
            Density::new(&grid, block, |column, row| corners(&grid, &picture.pixels, column, row).map(brightness));
        if !(density.total() > 0.0 && scale > 0.0) {
            return Ok(None);
        }
        let above = Above::new(&grid, |columns, rows| density.light(&grid, columns, rows) / density.total());
        Ok(Some(Self { grid, pixels: picture.pixels, scale, density, above }))
    }

    /// Radiance from a unit direction, W/(sr·m²).
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let place = self.grid.place(direction);
        self.scale * bilinear(corners(&self.grid, &self.pixels, place.column, place.row), &place)
    }

    /// The same, and the density (1/sr) with which [`EnvironmentImage::sample`] draws it for a surface with a unit normal.
    pub fn find(&self, normal: DVec3, direction: DVec3) -> (DVec3, f64) {
        let place = self.grid.place(direction);
        let drawn = self.above.find(&self.grid, normal, place.column, place.row);
        self.found(corners(&self.grid, &self.pixels, place.column, place.row), &place, &drawn)
    }

    /// Radiance and density at a place of a cell with these corners.
    fn found(&self, at: [DVec3; 4], place: &Place, drawn: &Drawn) -> (DVec3, f64) {
        // In proportion to the radiance within the block.
        let by_radiance = self.density.pdf(&self.grid, place, at.map(brightness));
        let known = by_radiance > 0.0 && drawn.light > 0.0;
        let pdf = if known { by_radiance / drawn.light * drawn.probability } else { 0.0 };
        (self.scale * bilinear(at, place), pdf)
    }

    /// A unit direction drawn with two numbers in [0, 1), about in proportion to the radiance times the cosine at a surface with a
    /// unit normal; the radiance, and the density, 1/sr. `None` where no light reaches the surface.
    pub fn sample(&self, normal: DVec3, u: DVec2) -> Option<(DVec3, DVec3, f64)> {
        let drawn = self.above.draw(&self.grid, normal, u)?;
        let (column, row, x, s) = self.density.pick(&self.grid, (drawn.columns, drawn.rows), drawn.u);
        let at = corners(&self.grid, &self.pixels, column, row);
        let (x, s) = within(&self.grid, row, at.map(brightness), (x, s));
        let (place, direction) = self.grid.at(column, row, x, s);
        let (radiance, pdf) = self.found(at, &place, &drawn);
        (pdf > 0.0).then_some((direction, radiance, pdf))
    }
}

fn check(path: &Path, picture: &ColorGrid) -> Result<(), RenderError> {
    let wrong = |place: String, message: String| RenderError::Environment { path: path.into(), place, message };
    let (width, height) = (picture.width, picture.height);
    if width < 1 || height < 2 || picture.pixels.len() != width * height {
        let message = format!("expected a picture of at least 1 x 2 pixels, found {width} x {height}");
        return Err(wrong(String::new(), message));
    }
    for (i, pixel) in picture.pixels.iter().enumerate() {
        if let Some(c) = pixel.iter().position(|x| !(x.is_finite() && *x >= 0.0)) {
            let place = format!(", column {}, row {}, {}", i % width, i / width, ["red", "green", "blue"][c]);
            return Err(wrong(place, format!("radiance is {}, expected a finite number of at least 0", pixel[c])));
        }
    }
    Ok(())
}

/// The pixels at the corners of a cell: left and right above, left and right below.
fn corners(grid: &LatLong, pixels: &[[f32; 3]], column: usize, row: usize) -> [DVec3; 4] {
    let right = if column + 1 == grid.width { 0 } else { column + 1 };
    let at = |column: usize, row: usize| DVec3::from(pixels[row * grid.width + column].map(f64::from));
    [at(column, row), at(right, row), at(column, row + 1), at(right, row + 1)]
}

fn bilinear([a, b, c, d]: [DVec3; 4], place: &Place) -> DVec3 {
    (a.lerp(b, place.x)).lerp(c.lerp(d, place.x), place.y)
}

/// Mean of the channels: it is 0 only where all of them are.
fn brightness(radiance: DVec3) -> f64 {
    radiance.element_sum() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::quadrature::integrate_directions;
    use crate::numeric::random::{Purpose, RngExt, Stream, stream};
    use crate::numeric::stats::chi_square_test;
    use std::f64::consts::{PI, TAU};

    fn picture(width: usize, height: usize, mut value: impl FnMut(usize, usize) -> [f32; 3]) -> ColorGrid {
        let pixels = (0..width * height).map(|i| value(i % width, i / width)).collect();
        ColorGrid { width, height, pixels }
    }

    fn environment(picture: ColorGrid, turn: f64) -> EnvironmentImage {
        EnvironmentImage::new(Path::new("sky"), picture, 1.0, turn).unwrap().expect("shines")
    }

    /// Noise with black parts, a sun of a few pixels that is 10⁵ as bright, coloured channels.
    fn noise(width: usize, height: usize, rng: &mut Stream) -> ColorGrid {
        picture(width, height, |i, j| {
            let sun = i / 3 == 2 && j == height / 3;
            let dark = (i * height + j).is_multiple_of(3);
            let value = |rng: &mut Stream| if dark { 0.0 } else { rng.random::<f32>() + if sun { 1e5 } else { 0.0 } };
            [value(rng), if i % 2 == 0 { 0.0 } else { value(rng) }, value(rng)]
        })
    }

    fn any_direction(rng: &mut Stream) -> DVec3 {
        crate::geometry::sampling::uniform_sphere(DVec2::new(rng.random(), rng.random()))
    }

    /// Samples over their density are even where all light is from above: a sky of small patches, which the tree follows one by one.
    #[test]
    fn a_lit_surface_is_sampled_evenly() {
        let mut rng = stream(8, Purpose::Study, 0);
        // Light about the zenith alone, within 40°, some of it 10⁴ as bright.
        let sky = picture(64, 33, |i, j| {
            [if j > 7 {
                0.0
            } else if (i, j) == (9, 4) {
                1e4
            } else {
                1.0 + (i % 3) as f32
            }; 3]
        });
        let sky = environment(sky, 0.7);
        for tilt in [0.0, 0.3, 0.7] {
            let normal = DVec3::new(f64::sin(tilt), f64::cos(tilt), 0.0);
            let of = |_| {
                let (d, radiance, pdf) = sky.sample(normal, DVec2::new(rng.random(), rng.random())).expect("lit");
                radiance.x * d.dot(normal) / pdf
            };
            let list: Vec<f64> = (0..20_000).map(of).collect();
            let mean = list.iter().sum::<f64>() / list.len() as f64;
            let spread = (list.iter().map(|x| (x / mean - 1.0).powi(2)).sum::<f64>() / list.len() as f64).sqrt();
            let parts = by_cells(64, 33, 0.7, |d| sky.radiance(d).x * d.dot(normal).max(0.0));
            let want: f64 = parts.iter().sum();
            // Within a cell the density follows the solid angle, the radiance θ: that is what is left.
            assert!((mean / want - 1.0).abs() < 4.0 * spread / 141.0, "tilt {tilt}: {mean} vs {want}");
            assert!(spread < 0.15, "tilt {tilt}: {spread}");
        }
    }

    /// A surface that looks away from all light gets none.
    #[test]
    fn what_looks_away_gets_nothing() {
        let sky = environment(picture(32, 17, |_, j| [f32::from(u8::from(j < 4)); 3]), 0.0);
        for u in [0.01, 0.4, 0.9] {
            assert!(sky.sample(-DVec3::Y, DVec2::splat(u)).is_none_or(|(d, _, _)| d.y > 0.0));
            assert!(sky.sample(DVec3::Y, DVec2::splat(u)).is_some_and(|(d, _, pdf)| d.y > 0.0 && pdf > 0.0));
        }
    }

    /// ∫ f over every cell apart, as (column, row) → value; f is smooth within a cell.
    fn by_cells(width: usize, height: usize, turn: f64, f: impl Fn(DVec3) -> f64) -> Vec<f64> {
        let cell = |k: usize| {
            let (i, j) = ((k % width) as f64, (k / width) as f64);
            let theta = (PI * j / (height - 1) as f64, PI * (j + 1.0) / (height - 1) as f64);
            let phi = (TAU * (i + 0.5) / width as f64 - turn, TAU * (i + 1.5) / width as f64 - turn);
            // The quadrature's azimuth runs from +x to +y about +z.
            integrate_directions(theta, phi, 12, |d| f(DVec3::new(d.y, d.z, -d.x)))
        };
        (0..width * (height - 1)).map(cell).collect()
    }

    #[test]
    fn the_density_integrates_to_one_and_vanishes_only_with_the_light() {
        let mut rng = stream(5, Purpose::Study, 0);
        for (width, height, turn) in [(1, 2, 0.0), (5, 3, 1.0), (16, 9, 0.3), (40, 21, -4.0)] {
            let sky = environment(noise(width.max(2), height, &mut rng), turn);
            for _ in 0..4 {
                let normal = any_direction(&mut rng);
                let sum: f64 = by_cells(width.max(2), height, turn, |d| sky.find(normal, d).1).iter().sum();
                assert!((sum - 1.0).abs() < 1e-9, "{width} x {height}, {normal}: {sum}");
            }
            for _ in 0..4000 {
                let (normal, d) = (any_direction(&mut rng), any_direction(&mut rng));
                let (radiance, pdf) = sky.find(normal, d);
                assert_eq!(radiance, sky.radiance(d));
                let lit = normal.dot(d) > 0.0 && radiance != DVec3::ZERO;
                assert!(!lit || pdf > 0.0, "{d} above {normal}: {radiance} but density {pdf}");
            }
        }
    }

    /// A sky that falls by forty decades within a row: what is dark is dark, and no density is anything but a number. Blocks of several cells too.
    #[test]
    fn a_sky_of_forty_decades_has_finite_densities() {
        let mut rng = stream(7, Purpose::Study, 0);
        for (width, height) in [(64, 33), (700, 301)] {
            let of = |k: usize, all: usize| (k as f64 / all as f64 - 0.4).powi(2);
            let value = |i: usize, j: usize| (1e4 * (-250.0 * (of(i, width) + of(j, height))).exp()) as f32;
            let sky = environment(picture(width, height, |i, j| [value(i, j); 3]), 0.3);
            for _ in 0..4000 {
                let (normal, d) = (any_direction(&mut rng), any_direction(&mut rng));
                let (radiance, pdf) = sky.find(normal, d);
                assert!(pdf.is_finite() && pdf >= 0.0, "{d} above {normal}: {radiance}, {pdf}");
                let u = DVec2::new(rng.random(), rng.random());
                if let Some((d, radiance, pdf)) = sky.sample(normal, u) {
                    let ratio = radiance.x / pdf;
                    assert!(pdf > 0.0 && ratio.is_finite(), "{d} above {normal}: {radiance}, {pdf}");
                }
            }
            let normal = DVec3::Y;
            let sum: f64 =
                if width < 100 { by_cells(width, height, 0.3, |d| sky.find(normal, d).1).iter().sum() } else { 1.0 };
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        }
    }

    #[test]
    fn directions_follow_the_density() {
        let mut rng = stream(6, Purpose::Study, 0);
        for (width, height, turn) in [(2, 2, 0.0), (6, 3, 1.0), (16, 9, 0.3)] {
            let sky = environment(noise(width, height, &mut rng), turn);
            let draws = 100_000;
            let normal = any_direction(&mut rng);
            let mut counts = vec![0.0; width * (height - 1) * 4];
            // Each cell in four: halves of φ and of θ.
            for _ in 0..draws {
                let u = DVec2::new(rng.random(), rng.random());
                let (d, radiance, density) = sky.sample(normal, u).expect("lit");
                let p = sky.grid.place(d);
                let (again, at) = sky.find(normal, d);
                // Next to an edge rounding may lead into the neighbour, which is as bright there but drawn with a density of its own.
                let inside = [p.x, p.y].iter().all(|x| (1e-9..1.0 - 1e-9).contains(x));
                assert!((again - radiance).length() <= 1e-12 * 1e5, "{again} {radiance}");
                assert!(!inside || (at / density - 1.0).abs() < 1e-5, "{at} {density}");
                let quarter = 2 * usize::from(p.y > 0.5) + usize::from(p.x > 0.5);
                counts[4 * (p.row * width + p.column) + quarter] += 1.0;
            }
            let expected: Vec<f64> = {
                let pdf = |d| sky.find(normal, d).1;
                let fine = |k: usize| {
                    let (i, j, q) = ((k / 4 % width) as f64, (k / 4 / width) as f64, k % 4);
                    let (x, y) = (0.5 * (q % 2) as f64, 0.5 * (q / 2) as f64);
                    let theta = (PI * (j + y) / (height - 1) as f64, PI * (j + y + 0.5) / (height - 1) as f64);
                    let at = |x: f64| TAU * (i + 0.5 + x) / width as f64 - turn;
                    integrate_directions(theta, (at(x), at(x + 0.5)), 12, |d| pdf(DVec3::new(d.y, d.z, -d.x)))
                };
                (0..counts.len()).map(|k| f64::from(draws) * fine(k)).collect()
            };
            let (chi2, freedom, chance) = chi_square_test(&counts, &expected);
            assert!(chance > 1e-3, "{width} x {height}: chi2 {chi2} of {freedom}, p {chance}");
        }
    }

    #[test]
    fn what_is_no_picture_of_light_is_refused_with_its_place() {
        let of = |picture| EnvironmentImage::new(Path::new("sky.exr"), picture, 1.0, 0.0).map(|sky| sky.is_some());
        for (value, words) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (-1.0, "-1")] {
            let bad = picture(4, 3, |i, j| if (i, j) == (3, 1) { [1.0, value, 1.0] } else { [1.0; 3] });
            let message = of(bad).expect_err("refused").to_string();
            let expected = format!("sky.exr, column 3, row 1, green: radiance is {words}, expected");
            assert!(message.starts_with(&expected), "{message}");
        }
        for (width, height) in [(0, 0), (4, 1), (0, 4)] {
            let message = of(picture(width, height, |_, _| [1.0; 3])).expect_err("refused").to_string();
            assert!(message.contains(&format!("found {width} x {height}")), "{message}");
        }
        assert!(!of(picture(4, 3, |_, _| [0.0; 3])).unwrap(), "black is no light, and no error");
        assert!(of(picture(4, 3, |_, _| [1e-38; 3])).unwrap());
    }
}
