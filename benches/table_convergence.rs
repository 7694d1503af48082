//! How fast pictures of measured tables converge beside pictures of their fits: `cargo bench --bench table_convergence` prints a Markdown
//! table; `-- --quick` takes 32² pixels of 256 samples. Needs the encoded tables, and says so where they are not there.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

#[path = "../tests/convergence_support/mod.rs"]
mod convergence_support;
#[path = "../tests/encoded_tables/mod.rs"]
mod encoded_tables;

use convergence_support::{encoded, noise, pair};

const SCENES: [&str; 4] = ["sphere-on-plane", "cornell", "mesh-env", "preview"];
const TABLES: [&str; 8] =
    ["chrome", "steel", "black-obsidian", "gold-paint", "red-plastic", "blue-rubber", "alumina-oxide", "white-fabric"];

fn main() {
    let quick = std::env::args().any(|a| a == "--quick");
    let (size, samples) = if quick { (32, 256) } else { (64, 1024) };
    println!(
        "{size}² pixels, {samples} samples each: relMSE × samples of the table over that of its `lambert+phong`. By samples: as if they were \
         independent; by pictures: between two seeds, which sees that some samplers are more even than that.\n"
    );
    println!("| table | n of the fit | scene | table, by samples | fit | ratio | table, by pictures | fit | ratio |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in TABLES {
        let Some(table) = encoded(name) else { return };
        let both = pair(&table);
        for scene in SCENES {
            let [t, f] = [&both.table, &both.fit].map(|material| noise(scene, material, size, samples));
            println!(
                "| {name} | {:.1} | {scene} | {:.4} | {:.4} | {:.2} | {:.4} | {:.4} | {:.2} |",
                both.exponent,
                t.of_samples,
                f.of_samples,
                t.of_samples / f.of_samples,
                t.of_pictures,
                f.of_pictures,
                t.of_pictures / f.of_pictures
            );
        }
    }
}
