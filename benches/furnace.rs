//! The white furnace with as many samples as 0.1 % takes: `cargo bench --bench furnace` renders every model and some tables until the error is
//! known to 0.02 % and prints a Markdown table; it fails where a picture is off by more than 0.1 %. `-- --quick` stops at 2²² samples.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

#[path = "../tests/furnace_support/mod.rs"]
mod furnace_support;
#[path = "../tests/table_support/mod.rs"]
mod table_support;

use std::sync::Arc;

use furnace_support::{Case, THETAS_DEG, models, rendered};
use glam::DVec3;
use goniofit::geometry::mirror;
use goniofit::render::Material;
use table_support::{TENS, lobe, merl_of, scan, table};

/// Samples of one picture; pictures of other seeds are added until the error is small.
const BATCH: u32 = 1 << 20;

/// Relative error of the first channel and its standard error.
fn off(material: &Material, want: f64, theta: f64, most: u32) -> (f64, f64, u32) {
    let (mut sum, mut variance, mut batches) = (0.0, 0.0, 0);
    loop {
        let (got, noise) = rendered(material, theta, BATCH, u64::from(batches), false);
        sum += got.x;
        variance += noise.x * noise.x;
        batches += 1;
        let n = f64::from(batches);
        let error = variance.sqrt() / n / want;
        if error < 2e-4 || batches >= most {
            return (sum / n / want - 1.0, error, batches * BATCH);
        }
    }
}

fn tables() -> Vec<Case> {
    let gloss = |i: DVec3, o: DVec3| 0.1 + 3.0 * (-(o - mirror(i)).length_squared() / 0.02).exp();
    let tables = [
        ("matte MERL", table(&merl_of(|_| 0.25))),
        ("near-mirror MERL", table(&merl_of(lobe(0.02, 0.0)))),
        ("retro MERL", table(&merl_of(lobe(0.3, 20.0)))),
        ("glossy scan", table(&scan(&TENS, gloss))),
    ];
    tables.map(|(name, brdf)| Case::brdf(name, Arc::new(brdf))).into()
}

fn main() {
    let most = if std::env::args().any(|a| a == "--quick") { 4 } else { 64 };
    println!("| material | θ, ° | albedo, by quadrature | picture less albedo, % | its standard error, % | samples |");
    println!("|---|---|---|---|---|---|");
    let mut worst = (0.0f64, String::new());
    for case in models().into_iter().chain(tables()) {
        for theta in THETAS_DEG {
            let (want, _) = case.albedo(theta);
            let (error, noise, samples) = off(&case.material, want.x, theta, most);
            let (name, percent) = (&case.name, 100.0);
            println!(
                "| {name} | {theta} | {:.6} | {:+.4} | {:.4} | {samples} |",
                want.x,
                percent * error,
                percent * noise
            );
            if error.abs() > worst.0 {
                worst = (error.abs(), format!("{name} at {theta}°"));
            }
        }
    }
    println!("\nLargest difference: {:.4} %, {}.", 100.0 * worst.0, worst.1);
    assert!(worst.0 < 1e-3, "more than 0.1 %: {worst:?}");
}
