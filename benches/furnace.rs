//! The white furnace with as many samples as 0.1 % takes: `cargo bench --bench furnace` renders every model, some made tables, one with a part missing among
//! them, and the measured tables beside the project until the error is known to 0.02 %, and prints a Markdown table; it fails where a picture is off by more
//! than 0.1 %. `-- --quick` stops at 2²² samples; `-- FILE…` takes these measurements alone, of any format that can be rendered.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

#[path = "../tests/encoded_tables/mod.rs"]
mod encoded_tables;
#[path = "../tests/furnace_support/mod.rs"]
mod furnace_support;
#[path = "../tests/table_support/mod.rs"]
mod table_support;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use encoded_tables::{expanded, shared};
use furnace_support::{Case, THETAS_DEG, models, rendered};
use glam::DVec3;
use goniofit::geometry::mirror;
use goniofit::measurement::{Measurement, ReadOptions, TableBrdf, formats};
use goniofit::render::Material;
use table_support::{TENS, lobe, merl_of, scan, scan_without_retro, table};

/// Samples of one picture; pictures of other seeds are added until the error is small.
const BATCH: u32 = 1 << 20;

/// Measured tables beside the project: sharp and glossy copies of MERL's, and RGL's own.
const BESIDE: [&str; 4] = [
    "data/merl-encoded/chrome.npz",
    "data/merl-encoded/gold-paint.npz",
    "data/rgl/aurora_white_rgb.bsdf",
    "data/rgl/vch_silk_blue_rgb.bsdf",
];

/// `part` as a share of `whole`: nothing of nothing is none.
fn share(part: f64, whole: f64) -> f64 {
    if part == 0.0 { 0.0 } else { part / whole }
}

/// What a picture shows less what it should, as a share of that, with its standard error: in the channel that is off most.
struct Off {
    channel: usize,
    error: f64,
    noise: f64,
    samples: u32,
}

fn off(material: &Material, want: DVec3, theta: f64, most: u32) -> Off {
    let (mut sum, mut variance, mut batches) = (DVec3::ZERO, DVec3::ZERO, 0);
    loop {
        let (got, noise) = rendered(material, theta, BATCH, u64::from(batches), false);
        sum += got;
        variance += noise * noise;
        batches += 1;
        let n = f64::from(batches);
        let noise = [0, 1, 2].map(|c| share(variance[c].sqrt() / n, want[c]));
        if batches >= most || noise.iter().all(|e| *e < 2e-4) {
            let error = [0, 1, 2].map(|c| share(sum[c] / n - want[c], want[c]));
            let channel = (0..3).fold(0, |worst, c| if error[c].abs() > error[worst].abs() { c } else { worst });
            return Off { channel, error: error[channel], noise: noise[channel], samples: batches * BATCH };
        }
    }
}

fn made_tables() -> Vec<Case> {
    let gloss = |i: DVec3, o: DVec3| 0.1 + 3.0 * (-(o - mirror(i)).length_squared() / 0.02).exp();
    let tables = [
        ("matte MERL", table(&merl_of(|_| 0.25))),
        ("near-mirror MERL", table(&merl_of(lobe(0.02, 0.0)))),
        ("retro MERL", table(&merl_of(lobe(0.3, 20.0)))),
        ("glossy scan", table(&scan(&TENS, gloss))),
        ("scan, no retro", table(&scan_without_retro(17.0, gloss))),
    ];
    tables.map(|(name, brdf)| Case::brdf(name, Arc::new(brdf))).into()
}

/// A measurement, the first three channels in colour.
fn measured(file: &Path) -> Case {
    let encoded = file.extension().is_some_and(|e| e == "npz");
    let read = || formats::read(file, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let measurement: Measurement = if encoded { expanded(file) } else { read() };
    let channels: &[usize] = if measurement.channels.len() < 3 { &[0] } else { &[0, 1, 2] };
    let brdf = TableBrdf::new(&measurement, channels).unwrap_or_else(|e| panic!("{e}"));
    Case::measured(&measurement.name, Arc::new(brdf))
}

/// The measurements that were typed, alone, else everything.
fn cases() -> Vec<Case> {
    let typed: Vec<PathBuf> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).map(PathBuf::from).collect();
    if !typed.is_empty() {
        return typed.iter().map(|file| measured(file)).collect();
    }
    let beside = BESIDE.iter().filter_map(|file| shared(file)).map(|file| measured(&file));
    models().into_iter().chain(made_tables()).chain(beside).collect()
}

fn main() {
    let most = if std::env::args().any(|a| a == "--quick") { 4 } else { 64 };
    let cases = cases();
    println!(
        "\n| material | θ, ° | albedo, by quadrature | its error, % | picture less albedo, % | its standard error, % | samples |"
    );
    println!("|---|---|---|---|---|---|---|");
    let (mut worst, mut count) = ((0.0f64, String::new()), 0);
    for case in &cases {
        for theta in THETAS_DEG {
            let (want, bound) = case.albedo(theta);
            let Off { channel, error, noise, samples } = off(&case.material, want, theta, most);
            let (name, percent) = (&case.name, 100.0);
            println!(
                "| {name} | {theta} | {:.6} | {:.4} | {:+.4} | {:.4} | {samples} |",
                want[channel],
                percent * share(bound[channel], want[channel]),
                percent * error,
                percent * noise
            );
            count += 1;
            if error.abs() > worst.0 {
                worst = (error.abs(), format!("{name} at {theta}°"));
            }
        }
    }
    println!("\nLargest of {count} differences: {:.4} %, {}.", 100.0 * worst.0, worst.1);
    assert!(worst.0 < 1e-3, "more than 0.1 %: {worst:?}");
}
