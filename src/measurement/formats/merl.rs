//! MERL `.binary` (Matusik et al. 2003): three 32-bit integers, the bins in θh, θd, φd, always 90, 90, 180; then three planes of
//! 64-bit floats, red, green, blue, all little-endian, entry φd + 180·(θd + 90·θh). BRDF (1/sr) = stored · scale, the scales
//! being 1/1500, 1.15/1500, 1.66/1500. A stored negative value is invalid, in its own channel.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use rayon::prelude::*;

use super::source::Source;
use super::{Quantity, ReadOptions, WriteReport};
use crate::measurement::{Directions, Masked, Measurement, MeasurementError, MerlGrid, Weights};

/// Bins in θh, θd, φd.
const DIMS: [i32; 3] = [90, 90, 180];
/// Bytes before the first plane.
const HEADER: usize = 12;
/// Bytes of a value.
const WORD: usize = 8;
/// Bytes of the whole file.
const TOTAL: u64 = (HEADER + 3 * WORD * MerlGrid::LEN) as u64;
/// BRDF (1/sr) per stored unit: red, green, blue.
const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
/// Channels, in the order of the planes.
const CHANNELS: [&str; 3] = ["r", "g", "b"];
/// Values read at once: those of one θh. They divide a plane, so no piece spans two.
const PIECE: usize = MerlGrid::THETA_D * MerlGrid::PHI_D;

/// Reads a table; `options` says where in its bin an entry is read.
pub(super) fn read(source: &Source, options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    check_header(source)?;
    if options.quantity == Some(Quantity::BrdfCos) {
        let reason = "a MERL table holds the BRDF by definition; read it without --quantity brdf_cos";
        return Err(MeasurementError::unsupported(source.path(), reason));
    }
    // Nothing is allocated before the length is known to be right; the pieces go straight to their places.
    let mut values = vec![0.0; 3 * MerlGrid::LEN];
    let masks: Vec<Masked> = values
        .par_chunks_mut(PIECE)
        .enumerate()
        .map_init(|| (None, Vec::new()), |(file, bytes), (i, piece)| read_piece(source, file, bytes, i, piece))
        .collect::<Result<_, _>>()?;
    let grid = MerlGrid { angles: options.merl_angles.unwrap_or_default() };
    let channels = CHANNELS.map(String::from).to_vec();
    let mut measurement = Measurement::new(source.name(), Directions::Merl(grid), channels, values);
    measurement.weights = Weights::Merl;
    measurement.masked = total(masks);
    Ok(measurement)
}

/// Checks the dimensions and the file's length.
fn check_header(source: &Source) -> Result<(), MeasurementError> {
    let head = source.head(HEADER)?;
    let (words, _) = head.as_chunks::<4>();
    let [a, b, c] = words else {
        let header = "a MERL table begins with 12 bytes of dimensions".to_string();
        return Err(MeasurementError::Length {
            path: source.path().into(),
            header,
            expected: TOTAL,
            found: source.len(),
        });
    };
    let dims = [a, b, c].map(|word| i32::from_le_bytes(*word));
    if dims != DIMS {
        let [i, j, k] = dims;
        let found = if dims.map(i32::swap_bytes) == DIMS {
            "the same in big-endian order: the file comes from a machine of the other byte order".to_string()
        } else {
            format!("{i}, {j}, {k}")
        };
        let expected = "the dimensions 90, 90, 180 as little-endian integers";
        return Err(MeasurementError::invalid(source.path(), "bytes 0 to 11", expected, found));
    }
    if source.len() != TOTAL {
        return Err(MeasurementError::Length {
            path: source.path().into(),
            header: "3 planes of 90 × 90 × 180 values".into(),
            expected: TOTAL,
            found: source.len(),
        });
    }
    Ok(())
}

/// Reads piece `i` of the planes into `piece`, masks what is invalid, and counts it.
fn read_piece(
    source: &Source,
    file: &mut Option<File>,
    bytes: &mut Vec<u8>,
    i: usize,
    piece: &mut [f64],
) -> Result<Masked, MeasurementError> {
    let first = i * PIECE;
    let offset = |value: usize| (HEADER + WORD * value) as u64;
    bytes.resize(WORD * piece.len(), 0);
    source.read_exact_at(file, offset(first), bytes)?;
    let channel = first / MerlGrid::LEN;
    let (scale, name) = (SCALES.get(channel).unwrap_or(&f64::NAN), CHANNELS.get(channel).unwrap_or(&"?"));
    let mut masked = Masked::default();
    let (words, _) = bytes.as_chunks::<WORD>();
    for (k, (value, word)) in piece.iter_mut().zip(words).enumerate() {
        let stored = f64::from_le_bytes(*word);
        *value = if !stored.is_finite() {
            let entry = (first + k) % MerlGrid::LEN;
            masked.count_not_finite(|| format!("channel {name}, entry {entry} (byte {})", offset(first + k)));
            f64::NAN
        } else if stored < 0.0 {
            masked.marked += 1;
            f64::NAN
        } else {
            stored * scale
        };
    }
    Ok(masked)
}

/// The pieces' counts added up in order, so that the first place is the file's first.
fn total(pieces: Vec<Masked>) -> Masked {
    pieces.into_iter().fold(Masked::default(), |mut sum, piece| {
        sum.marked += piece.marked;
        sum.not_finite += piece.not_finite;
        sum.first_not_finite = sum.first_not_finite.or(piece.first_not_finite);
        sum
    })
}

/// Writes a table on the MERL grid with three channels; others are refused. Masked values become −1. What the format can't
/// hold is counted in the report: negative values, which become −1 too, and σ.
pub(super) fn write(
    measurement: &Measurement,
    path: &Path,
    out: &mut dyn Write,
) -> Result<WriteReport, MeasurementError> {
    let refuse = |reason: String| Err(MeasurementError::unsupported(path, reason));
    if !matches!(measurement.directions, Directions::Merl(_)) {
        let listed = measurement.len();
        return refuse(format!(
            "a MERL file holds the 90 × 90 × 180 grid of half and difference angles, not {listed} listed directions; \
             write CSV instead, or fit a model and sample that"
        ));
    }
    check_channels(&measurement.channels, path)?;
    let mut report = WriteReport {
        lost_sigma: measurement.sigma.as_ref().map_or(0, |s| s.len() as u64),
        lost_common: measurement.common.len() as u64,
        ..WriteReport::default()
    };
    write_planes(measurement, out, &mut report).map_err(|e| MeasurementError::io(path, e))?;
    Ok(report)
}

/// Refuses other than three channels.
pub(super) fn check_channels(channels: &[String], path: &Path) -> Result<(), MeasurementError> {
    if channels.len() == 3 {
        return Ok(());
    }
    let names = channels.join(", ");
    let reason = format!("a MERL file holds three channels, r, g, b; this table has {names}; write CSV instead");
    Err(MeasurementError::unsupported(path, reason))
}

fn write_planes(measurement: &Measurement, out: &mut dyn Write, report: &mut WriteReport) -> std::io::Result<()> {
    for dim in DIMS {
        out.write_all(&dim.to_le_bytes())?;
    }
    for (channel, scale) in SCALES.into_iter().enumerate() {
        for piece in measurement.plane(channel).chunks(PIECE) {
            let bytes: Vec<u8> = piece.iter().flat_map(|&value| stored(value, scale).to_le_bytes()).collect();
            report.lost_negative += piece.iter().filter(|value| **value < 0.0).count() as u64;
            out.write_all(&bytes)?;
        }
    }
    Ok(())
}

/// What to store for `value`: −1 for what the format can't hold, else the number that reads back as `value` to the last bit,
/// where there is one (for every value that came from a MERL file there is: it may be a neighbour of the quotient).
fn stored(value: f64, scale: f64) -> f64 {
    if value.is_nan() || value < 0.0 {
        return -1.0;
    }
    let quotient = value / scale;
    let exact = [quotient, quotient.next_up(), quotient.next_down()]
        .into_iter()
        .find(|x| (x * scale).to_bits() == value.to_bits());
    exact.unwrap_or(quotient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};

    #[test]
    fn what_was_read_is_written_so_that_it_reads_the_same() {
        let mut rng = stream(5, Purpose::Study, 1);
        for _ in 0..100_000 {
            let original = 10f64.powf(rng.random::<f64>() * 12.0 - 6.0);
            for scale in SCALES {
                let value = original * scale;
                assert_eq!((stored(value, scale) * scale).to_bits(), value.to_bits(), "{original:e}");
            }
        }
        for (value, want) in [(f64::NAN, -1.0f64), (-1e-9, -1.0), (0.0, 0.0)] {
            assert_eq!(stored(value, SCALES[0]).to_bits(), want.to_bits(), "{value}");
        }
    }

    #[test]
    fn pieces_divide_the_planes() {
        assert_eq!(MerlGrid::LEN % PIECE, 0);
        assert_eq!(
            DIMS.map(i64::from),
            [MerlGrid::THETA_H, MerlGrid::THETA_D, MerlGrid::PHI_D].map(|d| i64::try_from(d).expect("small"))
        );
        assert_eq!(TOTAL, 34_992_012);
    }
}
