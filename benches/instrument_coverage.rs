//! How often the 95 % intervals of reduced readings, and of parameters fitted to them, hold the truth over redrawn instruments, their own errors
//! drawn too: `cargo bench --bench instrument_coverage` prints a Markdown table, then a line for each figure that leaves 93 to 97 %, and exits with 1
//! where there is one. Judged are the mean over a row's readings and the parameters fitted through the instrument, these within what so many redraws
//! allow. Of a parameter, instruments of which no interval is stated don't miss it, so more than 97 % may hold where there are such.
//!
//! `-- --quick` redraws a tenth, `-- NAME…` takes only built-in instruments and rows of these names: the classes of materials and, only if they are
//! named, `out-of-plane` (a scan all round the sample), `misfit` (a material that is none of the fitted model: its readings have to hold, a parameter
//! can't) and `visits` (repeats, pairs approached twice, and so many visits to the reference that several share a component).
//!
//! `--journal=FILE` notes each instrument as it ends, and does not redraw those that FILE has: a run of hours may be stopped and go on.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

use std::time::Instant;

#[allow(dead_code)] // tests use the rest
#[path = "../tests/instrument/experiment.rs"]
mod experiment;
mod journal;

use experiment::{CLASSES, Coverage, Experiment, Held, STUDIES, coverage_by};
use goniofit::geometry::angles::theta_of;
use goniofit::gonio::PRESETS;
use goniofit::numeric::stats::sidak;
use journal::Journal;
use rayon::prelude::*;
use statrs::distribution::{Binomial, DiscreteCDF};

const INSTRUMENTS: u64 = 2000;
/// What shares have to lie between.
const HELD: (f64, f64) = (0.93, 0.97);
/// Chance that one of a run's parameters is said to miss though all hold in so many.
const LEVEL: f64 = 0.01;
const PARAMETERS: [&str; 3] = ["kd", "ks", "n"];

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let count = if args.iter().any(|a| a == "--quick") { INSTRUMENTS / 10 } else { INSTRUMENTS };
    let journal = Journal::open(args.iter().find_map(|a| a.strip_prefix("--journal=")));
    let cells = cells(&args);
    let window = window(count, sidak(LEVEL, cells.len() * PARAMETERS.len()));
    let clock = Instant::now();
    println!("Intervals that hold the truth, {count} redrawn instruments a row:\n");
    println!(
        "| instrument | material | readings | held, mean | least | most | quantiles of errors over intervals | kd, ks, n at face value | kd, ks, n through |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut wrong = Vec::new();
    for (preset, row) in cells {
        let of = experiment(preset, row);
        let cell = journal.cell(preset, row, &of);
        let runs: Vec<_> = (0..count).into_par_iter().map(|seed| cell.outcome(seed)).collect();
        let all = coverage_by(&of, &runs);
        print_row(preset, row, &of, &all);
        wrong.extend(misses(&all, count, window).into_iter().map(|said| format!("{preset}, {row}: {said}")));
    }
    println!("\n{:.0} s on {} threads.", clock.elapsed().as_secs_f64(), rayon::current_num_threads());
    println!(
        "93 to 97 % of a parameter's intervals may be {:.1} to {:.1} % of {count} redraws.",
        100.0 * window.0,
        100.0 * window.1
    );
    if !wrong.is_empty() {
        wrong.iter().for_each(|said| eprintln!("{said}"));
        std::process::exit(1);
    }
}

/// The instruments and rows that were asked for.
fn cells(args: &[String]) -> Vec<(&'static str, &'static str)> {
    let instruments: Vec<&str> = PRESETS.iter().map(|p| p.name).filter(|name| *name != "ideal").collect();
    let (classes, studies) = (CLASSES.map(|(name, _)| name), STUDIES.map(|(name, _)| name));
    let rows = [classes, studies].concat();
    let names: Vec<&str> = args.iter().map(String::as_str).filter(|a| !a.starts_with("--")).collect();
    let strange = names.iter().find(|name| !instruments.contains(name) && !rows.contains(name));
    assert!(strange.is_none(), "expected names among {instruments:?} and {rows:?}, found {strange:?}");
    // A name of the one kind says nothing of the other.
    let asked = |all: &[&'static str], usual: &[&'static str]| -> Vec<&'static str> {
        let named: Vec<&'static str> = all.iter().copied().filter(|name| names.contains(name)).collect();
        if named.is_empty() { usual.to_vec() } else { named }
    };
    let (instruments, rows) = (asked(&instruments, &instruments), asked(&rows, &classes));
    instruments.into_iter().flat_map(|preset| rows.iter().map(move |row| (preset, *row)).collect::<Vec<_>>()).collect()
}

/// What a row redraws.
fn experiment(preset: &str, row: &str) -> Experiment {
    let class = CLASSES.into_iter().find(|(name, _)| *name == row);
    let study = || STUDIES.into_iter().find(|(name, _)| *name == row).expect("a row");
    class.map_or_else(|| study().1(preset), |(_, truth)| Experiment::new(preset, truth))
}

/// Between which shares of so many redraws 93 to 97 % lie but for a chance of `level`, half of it at each end, by the binomial distribution.
fn window(count: u64, level: f64) -> (f64, f64) {
    let least = |share: f64| {
        let redraws = Binomial::new(share, count).expect("a share");
        // Fewer come by less than that chance.
        let found = (0..=count).find(|k| redraws.cdf(*k) >= 0.5 * level).expect("all have chance 1");
        found as f64 / count as f64
    };
    (least(HELD.0), 1.0 - least(1.0 - HELD.1))
}

/// What of a row of so many redraws is not as it has to be.
fn misses(all: &Coverage, count: u64, (least, most): (f64, f64)) -> Vec<String> {
    let said = |what: &str, share: f64, least: f64, most: f64| {
        let [share, least, most] = [share, least, most].map(|s| 100.0 * s);
        format!("{what} hold in {share:.2} %, expected {least:.1} to {most:.1} %")
    };
    let mean =
        (!(HELD.0..=HELD.1).contains(&all.mean)).then(|| said("intervals of readings", all.mean, HELD.0, HELD.1));
    // Shares are whole counts over so many.
    let rounding = 0.5 / count as f64;
    let parameter = |(name, held): (&str, Option<Held>)| {
        let Held { stated, held } = held?;
        let most = if stated < 1.0 { 1.0 } else { most };
        let fine = (least - rounding..=most + rounding).contains(&held);
        (!fine).then(|| said(&format!("intervals of {name}"), held, least, most))
    };
    mean.into_iter().chain(PARAMETERS.into_iter().zip(all.parameters[1]).filter_map(parameter)).collect()
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
