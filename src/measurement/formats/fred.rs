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
//! A node that is listed several times (the pole once for every azimuth, say) shares its solid angle among its rows. Azimuths that
//! leave a gap of more than 90° (the two of a scan in the plane of incidence) are no grid over the hemisphere.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use super::limits::{AZIMUTH_DEG, POLAR_DEG};
use super::rows::{Divisor, Rows};
use super::source::Source;
use super::text::{Lines, quoted};
use super::{ReadOptions, cells};
use crate::geometry::angles::direction_deg;
use crate::measurement::{Measurement, MeasurementError, Weights};

/// Widest gap between azimuths of a grid over the hemisphere; 180° is that of a scan in the plane of incidence.
const LARGEST_GAP_DEG: f64 = 90.0;

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
        if let &[theta_deg, phi_deg, ..] = numbers.as_slice() {
            POLAR_DEG.check(line, || "column 1".into(), theta_deg)?;
            AZIMUTH_DEG.check(line, || "column 2".into(), phi_deg)?;
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
        self.scatter.push((theta + 0.0, phi + 0.0)); // −0 is 0
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

/// Solid angle of each row of a block that is a grid of at least two θ, and of three φ or more all round, at least three quarters of its nodes
/// listed.
fn block_cells(block: &Block) -> Option<Vec<f64>> {
    let thetas = unique(block.scatter.iter().map(|row| row.0));
    let phis = unique(block.scatter.iter().filter(|row| row.0 != 0.0).map(|row| row.1));
    let (first_theta, first_phi, last_phi) = (*thetas.first()?, *phis.first()?, *phis.last()?);
    let mirrored = first_phi >= 0.0 && last_phi <= 180.0;
    let regular = thetas.len() > 1 && phis.len() > 2 && first_theta >= 0.0 && last_phi - first_phi <= 360.0;
    if !regular || largest_gap(&phis, mirrored) > LARGEST_GAP_DEG {
        return None;
    }
    // The pole is one node, whatever azimuths it is listed at.
    let node = |&(theta, phi): &(f64, f64)| {
        let column = if theta == 0.0 { 0 } else { position(&phis, phi)? };
        Some((position(&thetas, theta)?, column))
    };
    let nodes: Vec<(usize, usize)> = block.scatter.iter().map(node).collect::<Option<_>>()?;
    let mut rows: BTreeMap<(usize, usize), u32> = BTreeMap::new();
    nodes.iter().for_each(|node| *rows.entry(*node).or_default() += 1);
    let pole = usize::from(first_theta == 0.0);
    if 4 * rows.len() < 3 * ((thetas.len() - pole) * phis.len() + pole) {
        return None;
    }
    let (polar, azimuth) = (cells::polar(&thetas), cells::azimuth(&phis, mirrored));
    let cell = |node: &(usize, usize)| {
        let width = if node.0 < pole { TAU } else { *azimuth.get(node.1)? };
        Some(polar.get(node.0)? * width / f64::from(*rows.get(node)?))
    };
    nodes.iter().map(cell).collect()
}

/// Widest gap (deg) between ascending azimuths round the circle; with `mirrored` each stands for its mirror image too.
fn largest_gap(phis: &[f64], mirrored: bool) -> f64 {
    let (Some(first), Some(last)) = (phis.first(), phis.last()) else { return 360.0 };
    let inner = phis.windows(2).map(|w| w[1] - w[0]);
    let ends = if mirrored { [2.0 * first, 2.0 * (180.0 - last)] } else { [first + 360.0 - last; 2] };
    inner.chain(ends).fold(0.0, f64::max)
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
