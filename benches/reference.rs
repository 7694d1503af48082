//! Whole pictures against those of another renderer (Mitsuba 3.9.1), at 1 % over each picture (Šidák): `cargo bench --bench reference` prints two Markdown tables;
//! `-- --samples N` (512 if not said).
//!
//! First with the noise that each pixel's own samples show: every pixel and channel, and means over 32 × 32 pixels. Then as `compare` does it, with noise that
//! own samples may have missed, over blocks of all sizes. The means over 32 × 32 pixels of pictures without a mesh judge: it exits with 1 where they
//! differ. Why others differ stands in docs/render.md.
#![allow(clippy::expect_used)] // a bench may fail loudly

#[path = "../tests/reference_support/mod.rs"]
mod reference_support;

use goniofit::render::SceneSpec;
use reference_support::{Noise, Pair, references};

/// Whether means over 32 × 32 pixels agree.
fn plain_row(of: &(&str, SceneSpec, f64), samples: u32) -> bool {
    let Some(pair) = Pair::of(of, samples, 1, Noise::Own) else { return true };
    let cells = [1, 32].map(|blocks| {
        let (max, mean, p) = pair.plain(blocks);
        format!("{max:.2} | {mean:.3} | {p:.2e}")
    });
    println!("| {} | {} |", of.0, cells.join(" | "));
    pair.plain(32).2 >= 0.01
}

fn careful_row(of: &(&str, SceneSpec, f64), samples: u32) {
    let Some(pair) = Pair::of(of, samples, 1, Noise::Careful) else { return };
    let all = pair.tested(1);
    let blocks = &all.blocks;
    println!(
        "| {} | {} of {} | {:.3} | {:.2e} | {:.2} | {:.2e} |",
        of.0, all.pixels_differing, all.pixels, all.mean_z2, all.p, blocks.max_z, blocks.p
    );
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let samples = args.iter().position(|a| a == "--samples").and_then(|i| args.get(i + 1)?.parse().ok()).unwrap_or(512);
    println!("{samples} samples a pixel. With the noise of own samples:\n");
    println!("| picture | pixels: largest z | mean z² | p | blocks of 32²: largest z | mean z² | p |");
    println!("|---|---|---|---|---|---|---|");
    let agree: Vec<bool> = references().iter().map(|of| plain_row(of, samples) || !of.1.meshes.is_empty()).collect();
    println!("\nWith what own samples may have missed:\n");
    println!("| picture | pixels that differ | mean z² | p, blocks of all sizes | blocks of 32²: largest z | p |");
    println!("|---|---|---|---|---|---|");
    references().iter().for_each(|of| careful_row(of, samples));
    if agree.contains(&false) {
        eprintln!("a picture differs by more than its noise");
        std::process::exit(1);
    }
}
