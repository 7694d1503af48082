//! Files that are cut, contradictory or odd.

use std::path::{Path, PathBuf};

use super::*;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-fixtures").join(name)
}

fn fixture(name: &str) -> (PathBuf, Vec<u8>) {
    let path = folder("measurements").join(name);
    let bytes = std::fs::read(&path).expect("fixture");
    (path, bytes)
}

fn read_default(path: &Path, bytes: &[u8]) -> Result<Measurement, MeasurementError> {
    read(path, bytes, &ReadOptions::default())
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for name in ["rgl-one-nan.bsdf", "rgl-spectral.bsdf"] {
        let (path, bytes) = fixture(name);
        assert!(read_default(&path, &bytes).is_ok());
        for length in 0..bytes.len() {
            let error = read_default(&path, &bytes[..length]).expect_err("cut");
            let message = error.to_string();
            assert!(message.contains(name), "{length}: {message}");
            match error {
                MeasurementError::Length { expected, found, .. } => {
                    assert!(found == length as u64 && expected > found && expected <= bytes.len() as u64, "{message}");
                }
                MeasurementError::Invalid { place, .. } => assert!(place.starts_with("byte "), "{message}"),
                _ => panic!("{length}: {message}"),
            }
        }
    }
}

#[test]
fn every_broken_file_is_refused_by_name_place_and_reason() {
    let cases: [(&str, &[&str]); 22] = [
        ("wrong-mark", &["byte 0", "tensor_file", "tensor-file"]),
        ("version-2", &["byte 12", "version 1.0", "version 2.0"]),
        ("empty", &["byte 0", "the end of the file, 0 bytes further on"]),
        ("header-cut", &["field `description`", "must hold 414 bytes", "holds 100"]),
        ("data-cut", &["field `rgb` has 1×3×3×4×4 × f32 at byte 1160", "hold 1736 bytes", "holds 1710"]),
        ("field-count-huge", &["byte 386", "a name of 31091 bytes", "1364 bytes further on"]),
        ("shape-huge", &["field `vndf`", "4611686018427387904×3×6×6 × f32", "holds 1750"]),
        ("shape-zero", &["positive extents of field `vndf`", "0×3×6×6"]),
        ("offset-huge", &["field `vndf`", "byte 18446744073709551608", "holds 1750"]),
        ("type-unknown", &["the type of field `vndf`, 1 to 11", "found 99"]),
        ("type-f64", &["field `vndf`", "type f32", "type f64"]),
        ("no-vndf", &["a field `vndf`", "only `description`, `phi_i`"]),
        ("no-rgb", &["a field `rgb`", "only `description`"]),
        ("no-jacobian", &["a field `jacobian`", "none"]),
        ("vndf-negative", &["field `vndf`, entry ", "at least 0", "found -"]),
        ("vndf-nan", &["field `vndf`, entry 0", "finite", "NaN"]),
        ("vndf-zero", &["field `vndf`, incidence 1 of 3", "zeros alone"]),
        ("sigma-zero", &["field `sigma`, entry 0", "found 0"]),
        ("rgb-four-channels", &["field `rgb`, shape", "1×3×3×", "found 1×3×4×4×4"]),
        ("theta-not-ascending", &["field `theta_i`, entry 1", "more than 1.57"]),
        ("theta-in-degrees", &["field `theta_i`", "0 to π/2", "found 40."]),
        ("field-twice", &["a field of a new name", "field `ndf` again"]),
    ];
    for (name, parts) in cases {
        let path = folder("invalid").join(format!("rgl-{name}.bsdf"));
        let bytes = std::fs::read(&path).expect("fixture");
        let message = read_default(&path, &bytes).expect_err(name).to_string();
        for part in parts.iter().chain(&[path.to_str().expect("text")]) {
            assert!(message.contains(part), "{name}: `{part}` is not in: {message}");
        }
    }
    let files = std::fs::read_dir(folder("invalid")).expect("folder").flatten();
    let listed = files.filter(|f| f.file_name().to_string_lossy().starts_with("rgl-")).count();
    assert_eq!(listed, cases.len(), "every broken file has its case");
}

#[test]
fn any_byte_of_the_header_may_be_wrong_without_harm() {
    // Whatever a header claims, reading ends in a measurement or an error, never in a panic or a huge allocation.
    let (path, bytes) = fixture("rgl-one-nan.bsdf");
    let (mut read_well, mut refused) = (0, 0);
    for at in 0..450 {
        for value in [0x00, 0x01, 0x7f, 0x80, 0xff] {
            let mut changed = bytes.clone();
            changed[at] = value;
            match read_default(&path, &changed) {
                Ok(measurement) => {
                    read_well += 1;
                    assert!(measurement.len() <= bytes.len(), "byte {at}: {} entries", measurement.len());
                }
                Err(error) => {
                    refused += 1;
                    assert!(error.to_string().contains("rgl-one-nan.bsdf"));
                }
            }
        }
    }
    assert!(read_well > 0 && refused > 1000, "{read_well} {refused}");
}

#[test]
fn a_value_that_is_not_finite_is_masked_counted_and_unknown_to_the_evaluator() {
    let (path, bytes) = fixture("rgl-one-nan.bsdf");
    let table = read_default(&path, &bytes).expect("valid");
    // Incidence 1, channel 1, row 2, column 1 of 1×3×3×4×4.
    let hole = 16 + 2 * 4 + 1;
    assert_eq!(table.masked.not_finite, 1);
    let place = format!("field `rgb`, entry {}", (3 + 1) * 16 + 2 * 4 + 1);
    assert_eq!(table.masked.first_not_finite.as_deref(), Some(place.as_str()));
    assert_eq!(table.value(1, hole), None);
    assert!(table.value(0, hole).is_some() && table.value(2, hole).is_some());

    let brdf = table.evaluator.as_ref().expect("evaluator");
    let (wi, wo) = table.directions.pair(hole);
    let mut out = [1.0; 3];
    assert!(!brdf.eval(wi, wo, &mut out) && out.iter().all(|v| v.abs() < f64::MIN_POSITIVE));
    let (wi, wo) = table.directions.pair(5);
    assert!(brdf.eval(wi, wo, &mut out) && out.iter().all(|v| *v > 0.0));
}

#[test]
fn beyond_the_last_stored_incidence_nothing_is_known() {
    let (path, mut bytes) = fixture("rgl-tiny.bsdf");
    let words: Vec<u8> = [1.3f32, 1.570_796_1].iter().flat_map(|theta| theta.to_le_bytes()).collect();
    let at = bytes.windows(8).position(|w| w == words).expect("the last two incidences");
    bytes[at + 4..at + 8].copy_from_slice(&1.4f32.to_le_bytes());
    let brdf = read_brdf(&path, &bytes).expect("valid");
    let wo = crate::geometry::direction(0.5, 2.0);
    for (theta_i, known) in [(0.0, true), (1.3, true), (1.4, true), (1.4 + 1e-5, false), (1.55, false)] {
        let mut out = [1.0; 3];
        let found = crate::brdf::Brdf::eval(&brdf, crate::geometry::direction(theta_i, 0.3), wo, &mut out);
        assert_eq!((found, out.iter().all(|v| *v > 0.0)), (known, known), "{theta_i}: {out:?}");
    }
}

#[test]
fn spectral_files_have_a_channel_per_wavelength_and_valid_bits_of_either_polarity() {
    let (path, bytes) = fixture("rgl-spectral.bsdf");
    let table = read_default(&path, &bytes).expect("valid");
    assert_eq!(table.channels, ["450nm", "532.5nm", "600nm", "700nm"]);
    assert_eq!(table.notes.len(), 2, "{:?}", table.notes);
    assert!(table.notes[0].contains("synthetic, four wavelengths") && table.notes[1].contains("marks with 1"));
    let below = (0..table.len()).filter(|&i| table.directions.pair(i).1.z <= 0.0).count() as u64;
    assert!(below > 0 && table.masked.marked == 4 * below, "{} {below}", table.masked.marked);
}

#[test]
fn the_quantity_can_t_be_overridden_and_odd_azimuths_are_unsupported() {
    let (path, bytes) = fixture("rgl-tiny.bsdf");
    let wrong = ReadOptions { quantity: Some(Quantity::Brdf), ..ReadOptions::default() };
    assert!(matches!(read(&path, &bytes, &wrong), Err(MeasurementError::Unsupported { .. })));
    let right = ReadOptions { quantity: Some(Quantity::BrdfCos), ..ReadOptions::default() };
    assert!(read(&path, &bytes, &right).is_ok());

    let (path, mut bytes) = fixture("rgl-half-turn.bsdf");
    let last = -1.0f32;
    let five: Vec<u8> = (0..5).flat_map(|k| (-std::f32::consts::PI * (1.0 - k as f32 / 4.0)).to_le_bytes()).collect();
    let at = bytes.windows(16).position(|w| w == &five[..16]).expect("azimuths") + 16;
    bytes[at..at + 4].copy_from_slice(&last.to_le_bytes());
    let error = read_default(&path, &bytes).expect_err("−180° … −57°").to_string();
    assert!(error.contains("phi_i") || error.contains("azimuths"), "{error}");
}
