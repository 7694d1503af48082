//! Anything that reflects, on the simulated instrument's sample holder.

use std::borrow::Cow;

use super::error::ChainError;
use super::source::Source;
use super::surrogate::Surrogate;
use crate::brdf::{Brdf, Material};
use crate::control::{Control, Stop};
use crate::gonio::{
    Adaptive, Instrument, Job, Look, Raw, Reduction, Scan, Truth, adapt, lit_rows, reduce, simulate, too_many,
};
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
        let raw = measure_raw(name, source, instrument, scan, seed, control)?.as_written();
        let mut measurement = reduced_until(name, &raw, instrument, control.stop)?.measurement;
        measurement.origin = format!("simulated, scan {scan}, seed {seed}");
        return Ok(measurement);
    }
    let mut measurement = with_truth(name, source, scan, |truth, channels| {
        let read = |scan: &Scan, control: Control<'_>| simulate(name, truth, channels, instrument, scan, seed, control);
        let look = |scan: &Scan, control: Control<'_>| {
            let table = read(scan, control)?;
            Some(Look { table, time_s: Vec::new() })
        };
        read(&chosen(scan, source, instrument, control, look), control)
    })?;
    measurement.origin = format!("simulated, scan {scan}, seed {seed}");
    Ok(measurement)
}

/// The scan itself; an adaptive one as the list that what `look` reads makes of it.
fn chosen<'s>(
    scan: &'s Scan,
    source: &Source,
    instrument: &Instrument,
    control: Control<'_>,
    look: impl Fn(&Scan, Control<'_>) -> Option<Look>,
) -> Cow<'s, Scan> {
    match *scan {
        Scan::Adaptive { pairs } => {
            Cow::Owned(adapt(&Adaptive { pairs, dimension: source.dimension(), instrument }, control, look))
        }
        _ => Cow::Borrowed(scan),
    }
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
    with_job(name, source, instrument, scan, seed, control, |job| job.run(control))
}

/// What `work` makes of the simulation of a material or table along a scan. The directions of an adaptive one are chosen before, by readings with all
/// effects.
///
/// # Errors
/// As [`measure`].
pub fn with_job<T>(
    name: &str,
    source: &Source,
    instrument: &Instrument,
    scan: &Scan,
    seed: u64,
    control: Control<'_>,
    work: impl FnOnce(&Job<'_>) -> T,
) -> Result<T, ChainError> {
    if let Scan::Adaptive { pairs } = scan {
        within(instrument, *pairs as usize)?;
    }
    let lobes = match source {
        Source::Fitted(material) => Some(&**material),
        Source::Measured(_) => None,
    };
    with_truth(name, source, scan, |truth, channels| {
        let kinked = lobes.is_none();
        let look = |scan: &Scan, control: Control<'_>| {
            let (directions, weights) = &scan.directions()?;
            let (dimension, rows) = (scan.dimension(), scan.rows());
            let along = Job::new(truth, channels, instrument, (directions, weights));
            Job { lobes, kinked, dimension, rows, seed, ..along }.look(control)
        };
        let scan = chosen(scan, source, instrument, control, look);
        let (directions, weights) = &scan.directions()?;
        let (dimension, rows) = (scan.dimension(), scan.rows());
        if let Err(error) = within(instrument, lit_rows(directions, rows).len()) {
            return Some(Err(error));
        }
        let along = Job::new(truth, channels, instrument, (directions, weights));
        Some(Ok(work(&Job { lobes, kinked, dimension, rows, seed, ..along })))
    })?
}

/// Refuses an instrument that makes too many raw readings of so many pairs of directions.
fn within(instrument: &Instrument, pairs: usize) -> Result<(), ChainError> {
    too_many(instrument, pairs).map_or(Ok(()), |said| Err(ChainError::TooManyReadings(said)))
}

/// Reduces raw readings. Where errors of positions matter, a fit of `lambert+phong+phong` to a first reduction, through the
/// instrument where that matters, tells what they do.
///
/// # Errors
/// [`ChainError::Reduce`].
pub fn reduced(name: &str, raw: &Raw, instrument: &Instrument) -> Result<Reduction, ChainError> {
    reduced_until(name, raw, instrument, Control::silent().stop)
}

/// As [`reduced`]; once the work is stopped errors of positions are left out, as a note of the measurement says.
///
/// # Errors
/// As [`reduced`].
pub fn reduced_until(name: &str, raw: &Raw, instrument: &Instrument, stop: &Stop) -> Result<Reduction, ChainError> {
    let wrong = |source| ChainError::Reduce { name: name.to_owned(), source };
    let told = |mut reduction: Reduction| {
        reduction.measurement.notes.splice(0..0, raw.notes.iter().cloned());
        reduction
    };
    let first = reduce(name, raw, instrument, None).map_err(wrong)?;
    if !instrument.has_positions() || stop.requested() {
        return Ok(told(first));
    }
    let Some(surrogate) = Surrogate::of(&first.measurement, instrument) else {
        return Ok(told(first)); // which says that there was no model
    };
    let model = |wi, wo, out: &mut [f64]| {
        if stop.requested() {
            return false; // what comes of it is thrown away
        }
        surrogate.write_value(wi, wo, out);
        true
    };
    let second = reduce(name, raw, instrument, Some(&model)).map_err(wrong)?;
    Ok(told(if stop.requested() { first } else { second }))
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
            same_world(name, source, scan)?;
            let truth = |wi, wo, out: &mut [f64]| {
                material.write_value(wi, wo, out);
                true
            };
            work(&truth, &material.channels).ok_or_else(too_large)
        }
        Source::Measured(table) => {
            same_world(name, source, scan)?;
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

fn same_world(name: &str, source: &Source, scan: &Scan) -> Result<(), ChainError> {
    match (source.dimension(), scan.dimension()) {
        _ if matches!(scan, Scan::Adaptive { .. }) => Ok(()),
        (Dimension::Flat, Dimension::Space) => Err(ChainError::Mismatch(format!(
            "{name} belongs to the flat world: measure it with --scan flat or adaptive"
        ))),
        (Dimension::Space, Dimension::Flat) => Err(ChainError::Mismatch(format!(
            "{name} belongs to space, the flat scan does not: choose in-plane, adaptive, hemisphere or merl"
        ))),
        _ => Ok(()),
    }
}
