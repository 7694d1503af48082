//! RGL tensor files against closed forms, Mitsuba's evaluations, and what an independent script counts.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::{Path, PathBuf};

use glam::DVec3;
use goniofit::brdf::Brdf;
use goniofit::geometry::angles::direction_deg;
use goniofit::geometry::direction;
use goniofit::measurement::formats::rgl::{self, RglBrdf};
use goniofit::measurement::{Measurement, MeasurementError, Quantity, ReadOptions};
use goniofit::numeric::quadrature::integrate_directions;
use goniofit::numeric::random::{Purpose, RngExt, stream};
use goniofit::numeric::stats::{chi_square_test, sidak};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn fixture(name: &str) -> PathBuf {
    root().join("data-fixtures/measurements").join(name)
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn read(path: &Path) -> Measurement {
    rgl::read(path, &bytes(path), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn brdf(path: &Path) -> RglBrdf {
    rgl::read_brdf(path, &bytes(path)).unwrap_or_else(|e| panic!("{e}"))
}

/// The five real files with their reference evaluations; `None`, with a line, where they are absent.
fn real(test: &str) -> Option<Vec<(PathBuf, PathBuf)>> {
    let shared = root().join("../shared");
    let pairs: Vec<_> = ["aurora_white", "cc_ibiza_sunset", "chm_mint", "irid_flake_paint1", "vch_silk_blue"]
        .iter()
        .map(|n| (shared.join(format!("data/rgl/{n}_rgb.bsdf")), shared.join(format!("reference/rgl/{n}_rgb.csv"))))
        .collect();
    let present = pairs.iter().all(|(data, reference)| data.exists() && reference.exists());
    if !present {
        println!("skipped {test}: ../shared/data/rgl or ../shared/reference/rgl is absent");
    }
    present.then_some(pairs)
}

/// Rows of numbers after the comment and header lines.
fn rows(path: &Path) -> Vec<Vec<f64>> {
    let text = String::from_utf8(bytes(path)).expect("text");
    let lines = text.lines().filter(|l| !l.starts_with('#')).skip(1);
    lines.map(|l| l.split(',').map(|v| v.parse().expect("number")).collect()).collect()
}

/// Largest deviation from a reference table relative to the row's largest value, over θ ≤ 85° and θi > 0, and the rows compared.
fn deviation(file: &Path, reference: &Path) -> (f64, usize) {
    let (brdf, mut out) = (brdf(file), [0.0; 3]);
    let (mut worst, mut compared) = (0.0f64, 0);
    for row in rows(reference) {
        if row[0] == 0.0 || row[0] > 85.0 || row[2] > 85.0 {
            continue;
        }
        assert!(brdf.eval(direction_deg(row[0], row[1]), direction_deg(row[2], row[3]), &mut out));
        let scale = row[4..7].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let off = out.iter().zip(&row[4..7]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        worst = worst.max(if scale > 0.0 { off / scale } else { off });
        compared += 1;
    }
    (worst, compared)
}

#[test]
fn real_files_evaluate_as_mitsuba_does() {
    let Some(files) = real("real_files_evaluate_as_mitsuba_does") else { return };
    for (file, reference) in files {
        let (worst, compared) = deviation(&file, &reference);
        println!("{}: {compared} pairs, largest deviation {worst:.1e}", file.display());
        assert!(compared > 300 && worst < 1e-4, "{}: {worst:e} over {compared}", file.display());
    }
}

#[test]
fn anisotropic_files_evaluate_as_mitsuba_does() {
    for name in ["rgl-half-turn", "rgl-two-planes", "rgl-full-turn"] {
        let reference = root().join(format!("data-fixtures/reference/{name}.csv"));
        let (worst, compared) = deviation(&fixture(&format!("{name}.bsdf")), &reference);
        println!("{name}: {compared} pairs, largest deviation {worst:.1e}");
        assert!(compared == 120 && worst < 1e-4, "{name}: {worst:e}");
    }
}
