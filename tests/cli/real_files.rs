//! `info` on files from elsewhere, against counts made here from the files' text and headers.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::bench::Bench;

fn shared(folder: &str) -> Option<Vec<PathBuf>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(folder);
    let Ok(entries) = std::fs::read_dir(&path) else {
        println!("SKIPPED: {} is not here", path.display());
        return None;
    };
    let mut files: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    files.sort();
    assert!(!files.is_empty());
    Some(files)
}

/// What `info` says of a file, after the checks that hold for every file.
fn info(path: &Path) -> Value {
    let summary = Bench::new().json(&["info", &path.to_string_lossy()]);
    let count = |v: &Value| v.as_u64().unwrap_or_else(|| panic!("no count: {v}"));
    let (masked, channels) = (&summary["masked"], summary["channels"].as_array().expect("channels"));
    let of_channels: u64 = channels.iter().map(|c| count(&c["valid"])).sum();
    assert_eq!(count(&summary["valid"]), of_channels);
    let all = count(&summary["entries"]) * channels.len() as u64;
    let told = count(&summary["valid"]) + count(&masked["marked"]) + count(&masked["not_finite"]);
    assert_eq!(told, all, "every value is valid or masked for a reason: {}", path.display());
    summary
}

fn rows(path: &Path) -> Vec<Vec<f64>> {
    let text = String::from_utf8_lossy(&std::fs::read(path).expect("reads")).into_owned();
    let data = text.lines().filter(|l| !l.starts_with('#'));
    let numbers = data.map(|l| l.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>());
    numbers.filter_map(Result::ok).filter(|row| !row.is_empty()).collect()
}

#[test]
fn alta_files_are_counted_as_their_rows() {
    for path in shared("measured").into_iter().flatten() {
        let (summary, rows) = (info(&path), rows(&path));
        assert_eq!(summary["entries"], rows.len(), "{}", path.display());
        let columns = rows[0].len();
        let least = rows.iter().map(|r| r[columns - 1]).fold(f64::INFINITY, f64::min);
        let text = String::from_utf8_lossy(&std::fs::read(&path).expect("reads")).into_owned();
        let with_cosine = text.contains("COSINE_FACTOR");
        // BRDF·cosθo says nothing of the BRDF at the horizon: the length of the second and third column is θo.
        let at_horizon = rows.iter().filter(|r| r[1].hypot(r[2]) > std::f64::consts::FRAC_PI_2 - 1e-9).count();
        let masked = if with_cosine { at_horizon } else { 0 };
        assert_eq!(summary["masked"]["marked"], masked, "{}", path.display());
        if !with_cosine {
            let channel = summary["channels"].as_array().and_then(|c| c.last()).expect("a channel");
            assert_eq!(channel["min"], least, "{}", path.display());
        }
        if columns == 4 && !text.contains("#PARAM_OUT") {
            assert!(summary["notes"].to_string().contains("#PARAM_OUT"), "{}", summary["notes"]);
        }
    }
}

#[test]
fn lab_files_are_counted_as_their_values() {
    for path in shared("lab").into_iter().flatten() {
        let (summary, rows) = (info(&path), rows(&path));
        if path.extension().is_some_and(|e| e == "txt") {
            // FRED: an angle pair opens a block, three numbers are a sample.
            let samples: Vec<&Vec<f64>> = rows.iter().filter(|r| r.len() == 3).collect();
            assert_eq!(summary["entries"], samples.len());
            assert_eq!(summary["masked"]["marked"], 0);
            let largest = samples.iter().map(|r| r[2]).fold(0.0, f64::max);
            assert_eq!(summary["channels"][0]["max"], largest);
        } else {
            // Zemax: 4 incidences × 19 azimuths rows of 12 values; 0 means not measured.
            let values: Vec<f64> = rows.into_iter().skip_while(|r| r.len() != 12).skip(1).flatten().collect();
            assert_eq!(values.len(), 4 * 19 * 12);
            assert_eq!(summary["entries"], values.len());
            assert_eq!(summary["masked"]["marked"], values.iter().filter(|v| **v == 0.0).count());
            assert_eq!(summary["incidences_deg"], serde_json::json!([10.0, 30.0, 50.0, 70.0]));
        }
    }
}

/// Shapes of a tensor file's fields.
fn shapes(bytes: &[u8]) -> Vec<(String, Vec<u64>)> {
    let number = |at: usize, len: usize| bytes[at..at + len].iter().rev().fold(0u64, |n, b| n << 8 | u64::from(*b));
    let mut at = 18;
    let mut fields = Vec::new();
    for _ in 0..number(14, 4) {
        let name = number(at, 2) as usize;
        let text = String::from_utf8_lossy(&bytes[at + 2..at + 2 + name]).into_owned();
        at += 2 + name;
        let dimensions = number(at, 2) as usize;
        at += 2 + 1 + 8;
        fields.push((text, (0..dimensions).map(|d| number(at + 8 * d, 8)).collect()));
        at += 8 * dimensions;
    }
    fields
}

#[test]
fn rgl_files_have_as_many_samples_as_their_grid() {
    for path in shared("rgl").into_iter().flatten() {
        let summary = info(&path);
        let fields = shapes(&std::fs::read(&path).expect("reads"));
        let shape = &fields.iter().find(|f| f.0 == "rgb").expect("rgb").1;
        let entries = shape.iter().product::<u64>() / shape[2];
        assert_eq!((shape[2], &summary["entries"]), (3, &entries.into()), "{}", path.display());
        let incidences = summary["incidences_deg"].as_array().expect("incidences").len();
        assert_eq!(incidences as u64, shape[1], "{}", path.display());
        let masked = summary["masked"]["marked"].as_u64().expect("a count");
        assert!(masked >= 3 * summary["below_horizon"].as_u64().expect("a count"), "{}", path.display());
    }
}
