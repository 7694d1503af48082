//! Whole pictures against those of another renderer (Mitsuba 3.9.1), at 1 % over each picture (Šidák): `cargo bench --bench reference` prints two Markdown tables;
//! `-- --samples N` (512 if not said).
//!
//! First with the noise that each pixel's own samples show: every pixel and channel, and means over 32 × 32 pixels. Then as `compare` does it, with noise that
//! own samples may have missed, over blocks of all sizes. The means over 32 × 32 pixels of pictures without a mesh judge: it exits with 1 where they
//! differ. Why others differ stands in docs/render.md.
#![allow(clippy::expect_used)] // a bench may fail loudly

#[path = "../tests/reference_support/mod.rs"]
mod reference_support;

use reference_support::{Noise, Shot, references};

/// The row of one picture, and whether its means over 32 × 32 pixels agree.
fn plain_row(name: &str, shot: &Shot) -> (String, bool) {
    let pair = shot.with(Noise::Own);
    let found = [1, 32].map(|blocks| pair.plain(blocks));
    let cells = found.map(|(max, mean, p)| format!("{max:.2} | {mean:.3} | {p:.2e}"));
    (format!("| {name} | {} |", cells.join(" | ")), found[1].2 >= 0.01)
}

fn careful_row(name: &str, shot: &Shot) -> String {
    let all = shot.with(Noise::Careful).tested(1);
    let blocks = &all.blocks;
    format!(
        "| {name} | {} of {} | {:.3} | {:.2e} | {:.2} | {:.2e} |",
        all.pixels_differing, all.pixels, all.mean_z2, all.p, blocks.max_z, blocks.p
    )
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let samples = args.iter().position(|a| a == "--samples").and_then(|i| args.get(i + 1)?.parse().ok()).unwrap_or(512);
    println!("{samples} samples a pixel. With the noise of own samples:\n");
    println!("| picture | pixels: largest z | mean z² | p | blocks of 32²: largest z | mean z² | p |");
    println!("|---|---|---|---|---|---|---|");
    let (mut careful, mut fine) = (Vec::new(), true);
    for of in &references() {
        let Some(shot) = Shot::of(of, samples, 1) else { continue };
        let (row, agrees) = plain_row(of.0, &shot);
        println!("{row}");
        fine &= agrees || !of.1.meshes.is_empty();
        careful.push(careful_row(of.0, &shot));
    }
    println!("\nWith what own samples may have missed:\n");
    println!("| picture | pixels that differ | mean z² | p, blocks of all sizes | blocks of 32²: largest z | p |");
    println!("|---|---|---|---|---|---|");
    careful.iter().for_each(|row| println!("{row}"));
    if !fine {
        eprintln!("a picture differs by more than its noise");
        std::process::exit(1);
    }
}
