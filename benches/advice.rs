//! What advice promises, in 100 trials each: `cargo bench --bench advice` prints a Markdown table, and exits with 1 where an error that was promised
//! at 95 % is met in fewer than 89 of 100. Times are printed and judge nothing: another program may have wanted the machine.
#![allow(clippy::expect_used)] // a bench may fail loudly

#[path = "../tests/promises/mod.rs"]
mod promises;

use goniofit::tradeoff::Wish;
use promises::{Kept, chain, fit, fit_with, render, render_with, simulate};

fn row(stage: &str, wish: &str, kept: Kept) -> bool {
    let share = 100.0 * kept.met as f64 / kept.trials as f64;
    println!("| {stage} | {wish} | {} | {share:.0} % | {:.1} | {:.0} s |", kept.trials, kept.size, kept.seconds);
    share >= 89.0
}

fn main() {
    println!("| stage | wished, with 95 % confidence | trials | met | advised, mean size | time of all |");
    println!("|---|---|---|---|---|---|");
    let mut fine = row("fit, 22050 directions", "parameters to 0.1 %", fit(20, 5, 5.0));
    for (scene, error) in [("sphere-on-plane", 0.03), ("cornell", 0.05), ("preview", 0.04)] {
        fine &= row(&format!("render {scene}, 64²"), &format!("error below {error}"), render(scene, 20, 5, 64, error));
    }
    fine &= row("simulate, 22050 directions", "parameters to 0.05 %", simulate(20, 5, 5.0));
    fine &= row("chain sphere, 24²", "error below 0.1", chain(20, 5, 0.1));
    row("fit, 22050 directions", "2.5 ms", fit_with(20, 5, 5.0, &Wish::Time(2.5e-3)));
    row("render cornell, 64²", "0.1 s", render_with("cornell", 20, 5, 64, &Wish::Time(0.1)));
    if !fine {
        eprintln!("a promise is kept too seldom");
        std::process::exit(1);
    }
}
