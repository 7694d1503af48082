//! How often the 95 % intervals of reduced readings, and of parameters fitted to them, hold the truth over redrawn instruments, their own errors
//! drawn too: `cargo bench --bench instrument_coverage` prints a Markdown table and exits with 1 where a mean leaves 93 to 97 %;
//! `-- --quick` redraws a tenth, `-- NAME…` takes only built-in instruments and materials of these names. Of a parameter, instruments of which no interval is
//! stated don't miss it.
//!
//! `--journal=FILE` notes each instrument as it ends, and does not redraw those that FILE has: a run of hours may be stopped and go on.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

use std::time::Instant;

#[allow(dead_code)] // tests use the rest
#[path = "../tests/instrument/experiment.rs"]
mod experiment;
mod journal;

use experiment::{CLASSES, Coverage, Experiment, Held, coverage_by};
use goniofit::geometry::angles::theta_of;
use goniofit::gonio::PRESETS;
use journal::Journal;
use rayon::prelude::*;

const INSTRUMENTS: u64 = 2000;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let count = if args.iter().any(|a| a == "--quick") { INSTRUMENTS / 10 } else { INSTRUMENTS };
    let journal = Journal::open(args.iter().find_map(|a| a.strip_prefix("--journal=")));
    let classes = CLASSES.map(|(class, _)| class);
    // A name of the one kind says nothing of the other.
    let asked = |name: &str| {
        let mut same = args
            .iter()
            .filter(|a| !a.starts_with("--") && classes.contains(&&a[..]) == classes.contains(&name))
            .peekable();
        same.peek().is_none() || same.any(|a| a == name)
    };
    let clock = Instant::now();
    println!("Intervals that hold the truth, {count} redrawn instruments a row:\n");
    println!(
        "| instrument | material | readings | held, mean | least | most | quantiles of errors over intervals | kd, ks, n at face value | kd, ks, n through |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut fine = true;
    for preset in PRESETS.iter().filter(|p| p.name != "ideal" && asked(p.name)) {
        for (class, truth) in CLASSES.into_iter().filter(|(class, _)| asked(class)) {
            let of = Experiment::new(preset.name, truth);
            let cell = journal.cell(preset.name, class, &of);
            let runs: Vec<_> = (0..count).into_par_iter().map(|seed| cell.outcome(seed)).collect();
            let all = coverage_by(&of, &runs);
            fine &= (0.93..=0.97).contains(&all.mean);
            print_row(preset.name, class, &of, &all);
        }
    }
    println!("\n{:.0} s on {} threads.", clock.elapsed().as_secs_f64(), rayon::current_num_threads());
    if !fine {
        eprintln!("a mean leaves 93 to 97 %");
        std::process::exit(1);
    }
}

fn print_row(instrument: &str, class: &str, of: &Experiment, all: &Coverage) {
    let at = |(share, i): (f64, usize)| {
        let (wi, wo) = of.directions.pair(i);
        let sign = if wo.x <= 0.0 { 1.0 } else { -1.0 };
        let (theta_i, theta_o) = (theta_of(wi).to_degrees(), sign * theta_of(wo).to_degrees());
        format!("{:.1} % ({theta_i:.0}°, {theta_o:.1}°)", 100.0 * share)
    };
    let three = |p: [Option<Held>; 3]| p.map(|held| held.map_or("–".into(), |held| held.to_string())).join(", ");
    println!(
        "| {instrument} | {class} | {} | {:.1} % | {} | {} | {:.2} to {:.2} | {} | {} |",
        all.readings,
        100.0 * all.mean,
        at(all.least),
        at(all.most),
        all.quantiles.0,
        all.quantiles.1,
        three(all.parameters[0]),
        three(all.parameters[1])
    );
}
