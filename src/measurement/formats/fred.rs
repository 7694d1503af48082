//! FRED text (Photon Engineering's "tabulated BSDF"): two header lines, then blocks.
//!
//! ```text
//! type bsdf_data
//! format angles=deg bsdf=value scale=1
//! θ φ          a block begins with the direction of specular reflection (two numbers)
//! θ φ BSDF     its rows: scatter direction and value (three numbers), angles from the normal and in the surface
//! ```
//!
//! So the light comes from wi = (θ, φ + 180°) of the block's first line, and scatter azimuth = the block's azimuth is the forward
//! side. The values are multiplied by `scale`. Measured on a file and its Zemax twin (the same sample, an anodised black, 4
//! incidences): with this reading the values at the mirror direction agree within 4 % (exactly at 10° and 30°), and the median
//! difference of 700 interpolated pairs is 6.5 %; with the azimuth reversed it is 43 %, and the rows that FRED leaves out (the
//! source is in the detector's way at the retro side) lie at φ = 180°.
//!
//! Rows that form a grid in (θ, φ), missing nodes allowed, get its solid angles; azimuths within [0°, 180°] stand for both halves.

use super::rows::{Divisor, Rows};
use super::source::Source;
use super::text::{Lines, quoted};
use super::{ReadOptions, cells};
use crate::geometry::angles::direction_deg;
use crate::measurement::{Measurement, MeasurementError, Weights};

/// A block of rows that share the light's direction.
struct Block {
    theta_deg: f64,
    phi_deg: f64,
    /// θ and φ (deg) of the rows.
    scatter: Vec<(f64, f64)>,
}

/// Reads a FRED file.
pub(super) fn read(source: &Source, options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    let mut lines = Lines::new(source)?;
    let scale = header(&mut lines)?;
    let mut rows = Rows::new(1, options.quantity.unwrap_or_default());
    let mut blocks: Vec<Block> = Vec::new();
    while let Some(line) = lines.next_content()? {
        let numbers = line.numbers()?;
        if numbers.iter().take(2).any(|angle| !angle.is_finite()) {
            return Err(line.invalid("", "finite angles", quoted(line.text)));
        }
        match (numbers.as_slice(), blocks.last_mut()) {
            (&[theta_deg, phi_deg], _) => blocks.push(Block { theta_deg, phi_deg, scatter: Vec::new() }),
            (&[theta, phi, value], Some(block)) => {
                let divisor = block.row(&mut rows, theta, phi);
                rows.value(0, divisor, Some(value * scale), || line.place("column 3"));
            }
            (_, None) => return Err(line.invalid("", "a block's two angles first", quoted(line.text))),
            (other, Some(_)) => {
                let expected = "2 numbers (a block's angles) or 3 (θ, φ, value)";
                return Err(line.invalid("", expected, other.len().to_string()));
            }
        }
    }
    if rows.len() == 0 {
        return Err(lines.ends_too_early("a row of data (θ, φ, value)"));
    }
    let mut measurement = rows.finish(source.name(), vec!["value".into()]);
    measurement.weights = weights(&blocks).map_or(Weights::Uniform, Weights::SolidAngle);
    measurement.notes.extend(lines.cut_note());
    Ok(measurement)
}

impl Block {
    /// Adds a row's directions.
    fn row(&mut self, rows: &mut Rows, theta: f64, phi: f64) -> Divisor {
        self.scatter.push((theta, phi));
        rows.directions(direction_deg(self.theta_deg, self.phi_deg + 180.0), direction_deg(theta, phi))
    }
}

/// Reads the two header lines and returns the scale.
fn header(lines: &mut Lines<'_>) -> Result<f64, MeasurementError> {
    let Some(line) = lines.next_content()? else { return Err(lines.ends_too_early("type bsdf_data")) };
    if line.text.split_whitespace().ne(["type", "bsdf_data"]) {
        return Err(line.invalid("", "type bsdf_data", quoted(line.text)));
    }
    let Some(line) = lines.next_content()? else {
        return Err(lines.ends_too_early("format angles=deg bsdf=value scale=1"));
    };
    let mut words = line.text.split_whitespace();
    if words.next() != Some("format") {
        return Err(line.invalid("", "format angles=deg bsdf=value scale=1", quoted(line.text)));
    }
    let mut scale = 1.0;
    for word in words {
        match word.split_once('=') {
            Some(("angles", "deg") | ("bsdf", "value")) => {}
            Some(("angles", "sin")) => {
                return Err(
                    line.unsupported("expected angles=deg, found angles=sin, direction cosines, which are not read")
                );
            }
            Some(("bsdf", "log")) => {
                return Err(line.unsupported("expected bsdf=value, found bsdf=log, logarithms, which are not read"));
            }
            Some(("scale", number)) => scale = line.finite("scale", number)?,
            _ => return Err(line.invalid("", "angles=deg, bsdf=value or scale=<number>", quoted(word))),
        }
    }
    Ok(scale)
}

/// Solid angles ∝ dωi dωo of all rows, where every block is a grid; `None` otherwise.
fn weights(blocks: &[Block]) -> Option<Vec<f64>> {
    let incidences = unique(blocks.iter().map(|block| block.theta_deg));
    if incidences.len() != blocks.len() {
        return None; // incidences repeated at other azimuths: not a grid in θi alone
    }
    let incidence_cells = cells::polar(&incidences);
    let mut all = Vec::new();
    for block in blocks {
        let incidence = incidence_cells.get(position(&incidences, block.theta_deg)?)?;
        all.extend(block_cells(block)?.into_iter().map(|cell| cell * incidence));
    }
    Some(all)
}

/// Solid angle of each row of a block that is a grid of at least two θ and two φ, at least three quarters of its nodes listed.
fn block_cells(block: &Block) -> Option<Vec<f64>> {
    let thetas = unique(block.scatter.iter().map(|row| row.0));
    let phis = unique(block.scatter.iter().filter(|row| row.0 != 0.0).map(|row| row.1));
    let (first_phi, last_phi) = (*phis.first()?, *phis.last()?);
    let has_pole = thetas.first() == Some(&0.0);
    let nodes = (thetas.len() - usize::from(has_pole)) * phis.len() + usize::from(has_pole);
    let regular = thetas.len() > 1 && phis.len() > 1 && thetas.first()? >= &0.0 && last_phi - first_phi <= 360.0;
    if !regular || 4 * block.scatter.len() < 3 * nodes || block.scatter.len() > nodes {
        return None;
    }
    let polar = cells::polar(&thetas);
    let azimuth = cells::azimuth(&phis, first_phi >= 0.0 && last_phi <= 180.0);
    let cell = |&(theta, phi): &(f64, f64)| {
        let ring = polar.get(position(&thetas, theta)?)?;
        // At the pole one row stands for the whole circle.
        let width = if theta == 0.0 { std::f64::consts::TAU } else { *azimuth.get(position(&phis, phi)?)? };
        Some(ring * width)
    };
    block.scatter.iter().map(cell).collect()
}

/// The values, sorted, each once.
fn unique(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted
}

fn position(sorted: &[f64], value: f64) -> Option<usize> {
    sorted.binary_search_by(|v| v.total_cmp(&value)).ok()
}
