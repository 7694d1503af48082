//! What advice promises, in 100 trials each: `cargo bench --bench advice` prints a Markdown table, and exits with 1 where an error that was promised
//! at 95 % is met in fewer than 89 of 100. Times are printed and judge nothing: another program may have wanted the machine. `-- NAME…` takes only
//! rows whose name begins so: `fit`, `render cornell`, `simulate`, `chain`, `time`.
#![allow(clippy::expect_used)] // a bench may fail loudly

#[path = "../tests/promises/mod.rs"]
mod promises;

use goniofit::tradeoff::Wish;
use promises::{Kept, chain, fit, fit_with, render, render_with, simulate};

/// A row: its stage, what is wished, and how often that is met; of a time nothing is asked.
type Row = (&'static str, &'static str, fn() -> Kept);

const ROWS: [Row; 6] = [
    ("fit, 22050 directions", "parameters to 0.1 %", || fit(20, 5, 5.0)),
    ("render sphere-on-plane, 64²", "error below 0.03", || render("sphere-on-plane", 20, 5, 64, 0.03)),
    ("render cornell, 64²", "error below 0.05", || render("cornell", 20, 5, 64, 0.05)),
    ("render preview, 64²", "error below 0.04", || render("preview", 20, 5, 64, 0.04)),
    ("simulate, 22050 directions", "parameters to 0.05 %", || simulate(20, 5, 5.0)),
    ("chain sphere, 24²", "error below 0.1", || chain(20, 5, 0.1)),
];
const TIMES: [Row; 2] = [
    ("time of fit, 22050 directions", "5 ms", || fit_with(20, 5, 5.0, &Wish::Time(5e-3))),
    ("time of render cornell, 64²", "0.1 s", || render_with("cornell", 20, 5, 64, &Wish::Time(0.1))),
];

/// Runs a row and prints it; whether it is kept often enough.
fn row((stage, wish, run): &Row) -> bool {
    let kept = run();
    let share = 100.0 * kept.met as f64 / kept.trials as f64;
    println!("| {stage} | {wish} | {} | {share:.0} % | {:.1} | {:.0} s |", kept.trials, kept.size, kept.seconds);
    share >= 89.0
}

fn main() {
    let names: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let is_asked = |row: &&Row| names.is_empty() || names.iter().any(|name| row.0.starts_with(name.as_str()));
    assert!(ROWS.iter().chain(&TIMES).any(|of| is_asked(&of)), "no row's name begins with one of {names:?}");
    println!("| stage | wished, with 95 % confidence | trials | met | advised, mean size | time of all |");
    println!("|---|---|---|---|---|---|");
    let missed = ROWS.iter().filter(is_asked).filter(|of| !row(of)).count();
    TIMES.iter().filter(is_asked).for_each(|of| _ = row(of));
    if missed > 0 {
        eprintln!("a promise is kept too seldom");
        std::process::exit(1);
    }
}
