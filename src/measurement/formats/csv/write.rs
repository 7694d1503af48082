//! A table to rows. Numbers are written with the fewest digits that read back as the same number.

use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::{ANGLES, FLAT_ANGLES, GRIDS, MASK_REASON, SOLID_ANGLE, is_reserved};
use crate::geometry::angles::{direction_deg, phi_of, sin_cos_deg, theta_of};
use crate::measurement::{Dimension, Directions, MaskReason, Measurement, MeasurementError, STOPPED, Weights};
use crate::numeric::sum::map_blocks;

/// Rows formatted at once, in parallel blocks, before they are written.
const ROWS_AT_ONCE: usize = 1 << 16;

/// Writes `measurement`: everything but its name, origin and notes comes back on reading; of notes the one that it was stopped does.
pub(in crate::measurement::formats) fn write(
    measurement: &Measurement,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), MeasurementError> {
    check_channels(&measurement.channels, path)?;
    write_all(measurement, out).map_err(|e| MeasurementError::io(path, e))
}

/// Refuses channels that are called like other columns.
pub(in crate::measurement::formats) fn check_channels(
    channels: &[String],
    path: &Path,
) -> Result<(), MeasurementError> {
    let Some(name) = channels.iter().find(|name| is_reserved(name)) else { return Ok(()) };
    let reason = format!("a channel of a CSV file can't be called {name:?}: that is the name of another column");
    Err(MeasurementError::unsupported(path, reason))
}

fn write_all(measurement: &Measurement, out: &mut dyn Write) -> std::io::Result<()> {
    write_comments(measurement, out)?;
    let mut header = ::csv::WriterBuilder::new().from_writer(&mut *out);
    header.write_record(column_names(measurement))?;
    header.flush()?;
    drop(header);
    let n = measurement.len();
    for start in (0..n).step_by(ROWS_AT_ONCE) {
        let rows = (n - start).min(ROWS_AT_ONCE);
        let format = |block: std::ops::Range<usize>| {
            let mut text = String::new();
            for i in block {
                write_row(measurement, start + i, &mut text);
            }
            text
        };
        for text in map_blocks(rows, format) {
            out.write_all(text.as_bytes())?;
        }
    }
    Ok(())
}

fn write_comments(measurement: &Measurement, out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(out, "# quantity: brdf")?;
    if measurement.dimension == Dimension::Flat {
        writeln!(out, "# dimension: 2")?;
    }
    if let Directions::Merl(grid) = &measurement.directions {
        let name = GRIDS.iter().find(|(_, angles)| *angles == grid.angles).map_or("", |(name, _)| name);
        writeln!(out, "# grid: {name}")?;
    }
    if matches!(measurement.weights, Weights::SolidAngle(_)) {
        writeln!(out, "# weights: {SOLID_ANGLE}")?;
    }
    for note in measurement.notes.iter().filter(|note| note.starts_with(STOPPED)) {
        writeln!(out, "# note: {note}")?;
    }
    Ok(())
}

fn column_names(measurement: &Measurement) -> Vec<String> {
    let angles: &[&str] = if measurement.dimension == Dimension::Flat { &FLAT_ANGLES } else { &ANGLES };
    let mut names: Vec<String> = angles.iter().map(ToString::to_string).collect();
    names.extend(measurement.channels.iter().cloned());
    if measurement.sigma.is_some() {
        names.extend(measurement.channels.iter().map(|channel| format!("sigma_{channel}")));
    }
    for k in 1..=measurement.common.len() {
        names.extend(measurement.channels.iter().map(|channel| format!("common_{k}_{channel}")));
    }
    if measurement.row.is_some() {
        names.extend(measurement.channels.iter().map(|channel| format!("row_{channel}")));
    }
    if has_weight_column(measurement) {
        names.push("weight".into());
    }
    if !measurement.reasons.is_empty() {
        names.push(MASK_REASON.into());
    }
    names
}

/// Whether the weights need a column: those of the MERL grid come with the grid.
fn has_weight_column(measurement: &Measurement) -> bool {
    matches!(measurement.weights, Weights::SolidAngle(_) | Weights::Column(_))
}

/// Appends row `i`.
fn write_row(measurement: &Measurement, i: usize, text: &mut String) {
    let (wi, wo) = measurement.directions.pair(i);
    if measurement.dimension == Dimension::Flat {
        push_number(text, flat_deg(wi));
        push_number(text, flat_deg(wo));
    } else {
        for angle in [spherical_deg(wi), spherical_deg(wo)].into_iter().flatten() {
            push_number(text, angle);
        }
    }
    let n = measurement.len();
    let errors = measurement.sigma.iter().chain(&measurement.common).chain(&measurement.row);
    let layers = std::iter::once(&measurement.values).chain(errors);
    for layer in layers {
        for k in (i..layer.len()).step_by(n.max(1)) {
            // Errors of what is masked are not read.
            push_number(text, if measurement.values[k].is_nan() { f64::NAN } else { layer[k] });
        }
    }
    if has_weight_column(measurement) {
        push_number(text, measurement.weights.get(i));
    }
    if !measurement.reasons.is_empty() {
        text.push_str(measurement.reasons.get(i).copied().flatten().map_or("", MaskReason::name));
        text.push(',');
    }
    text.pop();
    text.push('\n');
}

/// Appends `value` and a comma; an empty cell for NaN. The fewest digits that give `value` back, with an exponent where the
/// plain form is long.
pub(crate) fn push_number(text: &mut String, value: f64) {
    let plain = value == 0.0 || (1e-5..1e15).contains(&value.abs());
    // Writing to a String can't fail.
    let _ = match value {
        v if v.is_nan() => Ok(()),
        v if plain => write!(text, "{v}"),
        v => write!(text, "{v:e}"),
    };
    text.push(',');
}

/// θ and φ (deg) that [`direction_deg`] turns into `w` again, to within 10⁻¹⁵; round numbers where they do.
pub(crate) fn spherical_deg(w: DVec3) -> [f64; 2] {
    let theta = refine(theta_of(w).to_degrees(), w.truncate().length(), w.z);
    let radius = w.x.hypot(w.y);
    // Adding 0 turns −0 into 0, so that 180° is not written as −180°.
    let phi = if radius > 0.0 { refine(phi_of(w + DVec3::ZERO).to_degrees(), w.y / radius, w.x / radius) } else { 0.0 };
    let off = |&[theta, phi]: &[f64; 2]| (direction_deg(theta, phi) - w).abs().max_element();
    let (round_theta, round_phi) = (round(theta), round(phi));
    let exact = [[round_theta, round_phi], [round_theta, phi], [theta, round_phi]];
    exact.into_iter().find(|angles| off(angles) <= f64::EPSILON).unwrap_or([theta, phi])
}

/// The signed θ (deg) of a direction of the flat world.
pub(crate) fn flat_deg(w: DVec3) -> f64 {
    let theta = refine(w.x.atan2(w.z).to_degrees(), w.x, w.z);
    let rounded = round(theta);
    let exact = if (direction_deg(rounded, 0.0) - w).abs().max_element() <= f64::EPSILON { rounded } else { theta };
    exact + 0.0 // −0 is 0
}

/// `degrees` corrected by one Newton step towards the angle with this sine and cosine: what conversion and atan2 rounded.
fn refine(degrees: f64, sin: f64, cos: f64) -> f64 {
    let (s, c) = sin_cos_deg(degrees);
    degrees + (sin * c - cos * s).to_degrees()
}

/// `degrees` to 10⁻¹²: the angle that a file or a scan was most likely given.
fn round(degrees: f64) -> f64 {
    (degrees * 1e12).round() / 1e12
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::uniform_sphere;
    use crate::numeric::random::{Purpose, RngExt, stream};

    #[test]
    fn angles_give_the_same_directions_back() {
        let mut rng = stream(3, Purpose::Study, 0);
        let mut worst = 0.0f64;
        for _ in 0..200_000 {
            let w = uniform_sphere(glam::DVec2::new(rng.random(), rng.random())).normalize();
            let [theta, phi] = spherical_deg(w);
            worst = worst.max((direction_deg(theta, phi) - w).length());
        }
        assert!(worst < 1e-15, "{worst:e}");
    }

    #[test]
    fn round_angles_stay_round() {
        for theta in 0..=18 {
            for phi in -17..=18 {
                let (theta, phi) = (f64::from(theta) * 5.0, f64::from(phi) * 10.0);
                let want = if theta == 0.0 { [0.0, 0.0] } else { [theta, phi] };
                let bits = |angles: [f64; 2]| angles.map(f64::to_bits);
                assert_eq!(bits(spherical_deg(direction_deg(theta, phi))), bits(want), "{theta} {phi}");
                let flat = flat_deg(direction_deg(phi / 2.0, 0.0));
                assert_eq!(flat.to_bits(), (phi / 2.0 + 0.0).to_bits(), "{phi}");
            }
        }
        let tiny = spherical_deg(direction_deg(1e-9, 30.0));
        assert!((tiny[0] / 1e-9 - 1.0).abs() < 1e-3, "{tiny:?}");
    }

    #[test]
    fn numbers_read_back_to_the_bit() {
        let mut rng = stream(4, Purpose::Study, 0);
        for _ in 0..100_000 {
            let value = f64::from_bits(rng.random());
            if value.is_finite() {
                let mut text = String::new();
                push_number(&mut text, value);
                let back: f64 = text.trim_end_matches(',').parse().expect("number");
                assert_eq!(back.to_bits(), value.to_bits());
                assert!(text.len() <= 26, "{text}");
            }
        }
    }
}
