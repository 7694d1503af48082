//! RGL tensor files (`.bsdf`) of the RGL material database (Dupuy & Jakob 2018): a BRDF in an adaptive parameterisation.
//!
//! In: a file's bytes. Out: a [`Measurement`] that lists the directions its grid stands for, with its evaluator
//! [`RglBrdf`]. The one decision to know: the file's number is BRDF·cosθo; both the list and the evaluator give the BRDF, in 1/sr.

mod brdf;
mod listing;
mod tensor;
#[cfg(test)]
mod tests;
mod warp;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;
use std::sync::Arc;

pub use brdf::RglBrdf;
use brdf::Symmetry;
use tensor::{TensorFile, entry, shape_text};
use warp::{Table, Warp, ZeroSlice};

use super::{Quantity, ReadOptions};
use crate::measurement::{Directions, Measurement, MeasurementError, Weights};

/// What an RGL file begins with.
pub const MAGIC: &[u8] = b"tensor_file\0";

/// Reads the RGL tensor file `bytes`; `path` serves for messages and for the measurement's name.
///
/// # Errors
/// [`MeasurementError::Length`] where a field lies outside the file; [`MeasurementError::Invalid`] where the header, a shape, a
/// type or a number contradicts the format; [`MeasurementError::Unsupported`] for azimuths of incidence that no known symmetry
/// explains, and for [`ReadOptions::quantity`] set to [`Quantity::Brdf`].
pub fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    let file = TensorFile::parse(path, bytes)?;
    if options.quantity == Some(Quantity::Brdf) {
        return Err(
            file.unsupported("an RGL tensor file holds BRDF·cosθo by definition; read it without --quantity brdf")
        );
    }
    let (values_field, channels) = channels(&file)?;
    let brdf = brdf_of(&file, values_field, channels)?;
    let listing = listing::list(&brdf, file.bytes("valid")?, values_field);
    let name = path.file_stem().map_or_else(|| "RGL".to_string(), |stem| stem.to_string_lossy().into_owned());
    let directions = Directions::List { wi: listing.wi, wo: listing.wo };
    let mut measurement = Measurement::new(name, directions, brdf.channel_names().to_vec(), listing.values);
    measurement.origin = "RGL tensor file".to_string();
    measurement.weights = Weights::SolidAngle(listing.weights);
    measurement.masked = listing.masked;
    measurement.notes = description(&file)?.into_iter().chain(listing.notes).collect();
    measurement.evaluator = Some(Arc::new(brdf));
    Ok(measurement)
}

/// The evaluator of the RGL tensor file `bytes`, without listing its directions.
///
/// # Errors
/// As [`read`].
pub fn read_brdf(path: &Path, bytes: &[u8]) -> Result<RglBrdf, MeasurementError> {
    let file = TensorFile::parse(path, bytes)?;
    let (values_field, channels) = channels(&file)?;
    brdf_of(&file, values_field, channels)
}

/// Name of the field of values, and of its channels: `rgb`, else `spectra` at `wavelengths` (nm).
fn channels(file: &TensorFile<'_>) -> Result<(&'static str, Vec<String>), MeasurementError> {
    if file.find("spectra").is_none() || file.find("rgb").is_some() {
        return Ok(("rgb", ["r", "g", "b"].map(String::from).to_vec()));
    }
    let wavelengths = file.bounded("wavelengths", 1, 0.0)?;
    Ok(("spectra", wavelengths.values.iter().map(|w| format!("{w}nm")).collect()))
}

fn brdf_of(file: &TensorFile<'_>, values_field: &str, channels: Vec<String>) -> Result<RglBrdf, MeasurementError> {
    let theta_i = ascending(file, "theta_i")?;
    let phi_i = ascending(file, "phi_i")?;
    if let Some(theta) = theta_i.iter().find(|t| !(-1e-6..=FRAC_PI_2 + 1e-6).contains(*t)) {
        return Err(file.invalid("field `theta_i`", "angles from 0 to π/2", theta.to_string()));
    }
    let incidences = [phi_i.len(), theta_i.len()];
    let ndf = plane(file, "ndf", 0.0)?;
    let sigma = plane(file, "sigma", f32::MIN_POSITIVE)?;
    let vndf = density(file, "vndf", incidences)?;
    let luminance = file.find("luminance").map(|_| density(file, "luminance", incidences)).transpose()?;
    let values = values(file, values_field, incidences, channels.len())?;
    let (symmetry, scaled) = (symmetry(file, &phi_i)?, scaled(file)?);
    Ok(RglBrdf { channels, theta_i, phi_i, symmetry, scaled, ndf, sigma, vndf, luminance, values })
}

/// Strictly ascending finite angles.
fn ascending(file: &TensorFile<'_>, name: &str) -> Result<Vec<f64>, MeasurementError> {
    let nodes: Vec<f64> = file.bounded(name, 1, f32::NEG_INFINITY)?.values.into_iter().map(f64::from).collect();
    match nodes.windows(2).position(|pair| pair[0] >= pair[1]) {
        None => Ok(nodes),
        Some(i) => Err(file.invalid(entry(name, i + 1), format!("more than {}", nodes[i]), nodes[i + 1].to_string())),
    }
}

/// A function of a direction.
fn plane(file: &TensorFile<'_>, name: &str, low: f32) -> Result<Table, MeasurementError> {
    let floats = file.bounded(name, 2, low)?;
    match floats.shape[..] {
        [ny, nx] if nx >= 2 && ny >= 2 => Ok(Table { nx, ny, channels: 1, values: floats.values }),
        _ => Err(file.wrong_shape(name, "at least 2 in both dimensions", &floats.shape)),
    }
}

/// A density per incidence, with its warp.
fn density(file: &TensorFile<'_>, name: &str, [n_phi, n_theta]: [usize; 2]) -> Result<Warp, MeasurementError> {
    let floats = file.bounded(name, 4, 0.0)?;
    match floats.shape[..] {
        [p, t, ny, nx] if p == n_phi && t == n_theta && nx >= 2 && ny >= 2 => Warp::new(nx, ny, &floats.values)
            .map_err(|ZeroSlice(k)| {
                let place = format!("field `{name}`, incidence {} of {}", k + 1, n_phi * n_theta);
                file.invalid(place, "a density that is positive somewhere", "zeros alone")
            }),
        _ => Err(file.wrong_shape(name, format!("{n_phi}×{n_theta}×(2 or more)×(2 or more)"), &floats.shape)),
    }
}

/// Values per incidence, node and channel; channels are planes in the file and stand side by side here.
fn values(
    file: &TensorFile<'_>,
    name: &str,
    [n_phi, n_theta]: [usize; 2],
    channels: usize,
) -> Result<Table, MeasurementError> {
    let floats = file.floats(name, 5)?;
    let [p, t, c, ny, nx] = floats.shape[..] else {
        return Err(file.wrong_shape(name, "5 dimensions", &floats.shape));
    };
    if (p, t, c) != (n_phi, n_theta, channels) || nx < 2 || ny < 2 {
        let expected = format!("{}×(2 or more)×(2 or more)", shape_text(&[n_phi, n_theta, channels]));
        return Err(file.wrong_shape(name, expected, &floats.shape));
    }
    let plane = nx * ny;
    let slices = floats.values.chunks_exact(plane * channels);
    let values = slices.flat_map(|s| (0..plane).flat_map(move |k| s.iter().skip(k).step_by(plane).copied())).collect();
    Ok(Table { nx, ny, channels, values })
}

/// A range of azimuths names the symmetry: up to two of them an isotropic material, else the whole, half or quarter turn from −π.
fn symmetry(file: &TensorFile<'_>, phi_i: &[f64]) -> Result<Symmetry, MeasurementError> {
    let [first, _, .., last] = phi_i else { return Ok(Symmetry::Isotropic) };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
    match TAU / (last - first) {
        turn if near(*first, -PI) && near(turn, 1.0) => Ok(Symmetry::None),
        turn if near(*first, -PI) && near(turn, 2.0) => Ok(Symmetry::HalfTurn),
        turn if near(*first, -PI) && near(turn, 4.0) => Ok(Symmetry::TwoPlanes),
        _ => Err(file.unsupported(format!(
            "azimuths of incidence from {:.1}° to {:.1}°; known are −180° to 180°, to 0° and to −90°",
            first.to_degrees(),
            last.to_degrees()
        ))),
    }
}

/// Field `jacobian`: whether values were divided by D/(4σ).
fn scaled(file: &TensorFile<'_>) -> Result<bool, MeasurementError> {
    match file.bytes("jacobian")? {
        Some([flag]) => Ok(*flag != 0),
        Some(more) => Err(file.wrong_shape("jacobian", "1", &[more.len()])),
        None => Err(file.invalid("header", "a field `jacobian`", "none")),
    }
}

fn description(file: &TensorFile<'_>) -> Result<Option<String>, MeasurementError> {
    let text = file.bytes("description")?.map(|b| String::from_utf8_lossy(b).trim_matches(['\0', ' ']).to_string());
    Ok(text.filter(|t| !t.is_empty()).map(|t| format!("description: {t}")))
}
