//! Anything that reflects, on the simulated instrument's sample holder.

use super::error::ChainError;
use super::source::Source;
use super::surrogate::Surrogate;
use crate::brdf::{Brdf, Material};
use crate::control::Control;
use crate::gonio::{ACCURACY, Instrument, Job, Raw, Reduction, Scan, Truth, reduce, simulate};
use crate::measurement::interpolate::TableBrdf;
use crate::measurement::{Dimension, Measurement};

/// Measures a material or table along a scan: readings, reduced.
///
/// # Errors
/// [`ChainError`] where material and scan belong to different worlds, the table can't be interpolated, or the scan is too large.
pub fn measure(
    name: &str,
    source: &Source,
    instrument: &Instrument,
    scan: &Scan,
    seed: u64,
    control: Control<'_>,
) -> Result<Measurement, ChainError> {
    if !instrument.is_plain() {
        let raw = measure_raw(name, source, instrument, scan, seed, control)?;
        let mut measurement = reduced(name, &raw, instrument)?.measurement;
        measurement.origin = format!("simulated, scan {scan}, seed {seed}");
        return Ok(measurement);
    }
    with_truth(name, source, scan, |truth, channels| simulate(name, truth, channels, instrument, scan, seed, control))
}

/// Raw readings of a material or table along a scan.
///
/// # Errors
/// As [`measure`].
pub fn measure_raw(
    name: &str,
    source: &Source,
    instrument: &Instrument,
    scan: &Scan,
    seed: u64,
    control: Control<'_>,
) -> Result<Raw, ChainError> {
    with_job(name, source, instrument, scan, seed, |job| job.run(control))
}

/// What `work` makes of the simulation of a material or table along a scan.
///
/// # Errors
/// As [`measure`].
pub fn with_job<T>(
    name: &str,
    source: &Source,
    instrument: &Instrument,
    scan: &Scan,
    seed: u64,
    work: impl FnOnce(&Job<'_>) -> T,
) -> Result<T, ChainError> {
    with_truth(name, source, scan, |truth, channels| {
        let (directions, weights) = scan.directions()?;
        let (directions, weights) = (&directions, &weights);
        let (dimension, accuracy) = (scan.dimension(), ACCURACY);
        let (rows, left_out) = (scan.rows(), &[][..]);
        Some(work(&Job { truth, channels, instrument, dimension, directions, weights, rows, seed, accuracy, left_out }))
    })
}

/// Reduces raw readings. Where errors of positions matter, a fit of `lambert+phong+phong` to a first reduction, through the
/// instrument where that matters, tells what they do.
///
/// # Errors
/// [`ChainError::Reduce`].
pub fn reduced(name: &str, raw: &Raw, instrument: &Instrument) -> Result<Reduction, ChainError> {
    let wrong = |source| ChainError::Reduce { name: name.to_owned(), source };
    let first = reduce(name, raw, instrument, None).map_err(wrong)?;
    if !instrument.has_positions() {
        return Ok(first);
    }
    let Some(surrogate) = Surrogate::of(&first.measurement, instrument) else {
        return Ok(first); // which says that there was no model
    };
    let model = |wi, wo, out: &mut [f64]| {
        surrogate.write_value(wi, wo, out);
        true
    };
    reduce(name, raw, instrument, Some(&model)).map_err(wrong)
}

/// What `work` makes of the material's values and channels; `None` from it is a scan that is too large.
fn with_truth<T>(
    name: &str,
    source: &Source,
    scan: &Scan,
    work: impl FnOnce(&Truth<'_>, &[String]) -> Option<T>,
) -> Result<T, ChainError> {
    let too_large = || ChainError::ScanTooLarge { scan: scan.to_string() };
    match source {
        Source::Fitted(material) => {
            same_world(name, material.is_flat(), scan.dimension())?;
            let truth = |wi, wo, out: &mut [f64]| {
                material.write_value(wi, wo, out);
                true
            };
            work(&truth, &material.channels).ok_or_else(too_large)
        }
        Source::Measured(table) => {
            same_world(name, table.dimension == Dimension::Flat, scan.dimension())?;
            let all: Vec<usize> = (0..table.channels.len()).collect();
            let brdf = TableBrdf::new(table, &all)?;
            let truth = |wi, wo, out: &mut [f64]| brdf.eval(wi, wo, out);
            work(&truth, &table.channels).ok_or_else(too_large)
        }
    }
}

/// A material sampled without noise onto the directions of a grid.
///
/// # Errors
/// As [`measure`].
pub fn tabulate(name: &str, material: &Material, scan: &Scan, control: Control<'_>) -> Result<Measurement, ChainError> {
    let source = Source::Fitted(Box::new(material.clone()));
    let mut table = measure(name, &source, &Instrument::noiseless(), scan, 0, control)?;
    table.origin = format!("{} sampled on {scan}", material.model());
    Ok(table)
}

fn same_world(name: &str, flat: bool, scan: Dimension) -> Result<(), ChainError> {
    match (flat, scan) {
        (true, Dimension::Space) => {
            Err(ChainError::Mismatch(format!("{name} belongs to the flat world: measure it with --scan flat")))
        }
        (false, Dimension::Flat) => Err(ChainError::Mismatch(format!(
            "{name} belongs to space, the flat scan does not: choose in-plane, hemisphere or merl"
        ))),
        _ => Ok(()),
    }
}
