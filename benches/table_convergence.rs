//! How fast pictures of measured tables converge beside pictures of their fits, by samples and in time: `cargo bench --bench table_convergence` prints Markdown
//! tables; `-- --quick` takes 32² pixels of 256 samples. Needs the encoded tables, and says so where they are not there.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

#[path = "../tests/convergence_support/mod.rs"]
mod convergence_support;
#[path = "../tests/encoded_tables/mod.rs"]
mod encoded_tables;

use convergence_support::{Noise, noise, noise_by, pair};
use encoded_tables::encoded;

const SCENES: [&str; 4] = ["sphere-on-plane", "cornell", "mesh-env", "preview"];
const TABLES: [&str; 8] =
    ["chrome", "steel", "black-obsidian", "gold-paint", "red-plastic", "blue-rubber", "alumina-oxide", "white-fabric"];

/// A scene with a table, with its fit as scenes with fits are rendered, and with the fit followed one path at a time as the table is.
struct Row {
    name: &'static str,
    exponent: f64,
    scene: &'static str,
    table: Noise,
    fit: Noise,
    alone: Noise,
}

fn rows(size: u32, samples: u32) -> Vec<Row> {
    let mut rows = Vec::new();
    for name in TABLES {
        let Some(table) = encoded(name) else { break };
        let both = pair(&table);
        for scene in SCENES {
            let [table, fit] = [&both.table, &both.fit].map(|material| noise(scene, material, size, samples));
            let alone = noise_by(scene, &both.fit, size, samples, false);
            rows.push(Row { name, exponent: both.exponent, scene, table, fit, alone });
        }
    }
    rows
}

fn by_samples(rows: &[Row]) {
    println!(
        "By samples: relMSE × samples of the table over that of its `lambert+phong`, as if samples were independent; by pictures: between two \
         seeds, which sees that some samplers are more even than that.\n"
    );
    println!("| table | n of the fit | scene | table, by samples | fit | ratio | table, by pictures | fit | ratio |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for Row { name, exponent, scene, table: t, fit: f, .. } in rows {
        println!(
            "| {name} | {exponent:.1} | {scene} | {:.4} | {:.4} | {:.2} | {:.4} | {:.4} | {:.2} |",
            t.of_samples,
            f.of_samples,
            t.of_samples / f.of_samples,
            t.of_pictures,
            f.of_pictures,
            t.of_pictures / f.of_pictures
        );
    }
}

fn in_time(rows: &[Row]) {
    println!(
        "\nIn time: what a picture takes, and the table's time to a relMSE, by pictures, over its fit's; the fit as its scene is rendered, in packets where \
         the scene allows them, and one path at a time, as tables are.\n"
    );
    println!(
        "| table | scene | table, s | fit, s | ratio of times to a relMSE | fit one path at a time, s | ratio of times to a relMSE |"
    );
    println!("|---|---|---|---|---|---|---|");
    for Row { name, scene, table, fit, alone, .. } in rows {
        println!(
            "| {name} | {scene} | {:.3} | {:.3} | {:.2} | {:.3} | {:.2} |",
            table.seconds,
            fit.seconds,
            table.in_time() / fit.in_time(),
            alone.seconds,
            table.in_time() / alone.in_time()
        );
    }
}

fn main() {
    let quick = std::env::args().any(|a| a == "--quick");
    let (size, samples) = if quick { (32, 256) } else { (64, 1024) };
    let rows = rows(size, samples);
    if rows.is_empty() {
        return;
    }
    println!("{size}² pixels, {samples} samples each, {} threads.\n", rayon::current_num_threads());
    by_samples(&rows);
    in_time(&rows);
}
