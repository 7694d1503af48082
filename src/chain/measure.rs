//! Anything that reflects, on the simulated instrument's sample holder.

use super::error::ChainError;
use super::source::Source;
use crate::brdf::{Brdf, Material};
use crate::control::Control;
use crate::gonio::{Instrument, Scan, simulate};
use crate::measurement::interpolate::TableBrdf;
use crate::measurement::{Dimension, Measurement};

/// Measures a material or table along a scan.
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
    let too_large = || ChainError::ScanTooLarge { scan: scan.to_string() };
    match source {
        Source::Fitted(material) => {
            same_world(name, material.is_flat(), scan.dimension())?;
            let truth = |wi, wo, out: &mut [f64]| {
                material.write_value(wi, wo, out);
                true
            };
            simulate(name, &truth, &material.channels, instrument, scan, seed, control).ok_or_else(too_large)
        }
        Source::Measured(table) => {
            same_world(name, table.dimension == Dimension::Flat, scan.dimension())?;
            let all: Vec<usize> = (0..table.channels.len()).collect();
            let brdf = TableBrdf::new(table, &all)?;
            let truth = |wi, wo, out: &mut [f64]| brdf.eval(wi, wo, out);
            simulate(name, &truth, &table.channels, instrument, scan, seed, control).ok_or_else(too_large)
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
