//! What a planned scan is worth: truths off the prior's middle, simulated, reduced and fitted, by a plan of a third of the hours beside uniform grids.
//! `cargo bench --bench planner` prints a Markdown table, and exits with 1 where moves take time and a plan is surely worse; `-- --quick` does a fifth of the truths.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

use goniofit::gonio::parts::Axes;
use goniofit::gonio::{Instrument, Scan};

#[path = "../tests/instrument/planned.rs"]
mod planned;
#[allow(dead_code)] // the tests use more of it
#[path = "../tests/instrument/support.rs"]
mod support;

use planned::{hours_of, planned as plan_for, rms, scan_of};
use support::lab;

const TRUTHS: u64 = 400;

fn main() {
    let truths = if std::env::args().any(|a| a == "--quick") { TRUTHS / 5 } else { TRUTHS };
    println!(
        "Relative rms errors over {truths} truths from the outer quarters of the prior, one simulated instrument each:\n"
    );
    println!("| instrument | scan | hours | kd | ks | n | left open | grid/plan: kd | ks | n |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let mut fine = true;
    for (name, instrument) in [("plain", Instrument::default()), ("moves of 5 s", moving()), ("all parts", full())] {
        for scan in
            [Scan::InPlane { step_deg: 5.0 }, Scan::InPlane { step_deg: 1.0 }, Scan::Hemisphere { step_deg: 10.0 }]
        {
            let least = compare(name, &instrument, &scan, truths);
            // The ratio of two rms errors of so many truths scatters by 1/√truths.
            fine &= instrument.axes.move_s == 0.0 || least > 1.0 - 3.0 / (truths as f64).sqrt();
        }
    }
    if !fine {
        eprintln!("a plan of a third of the hours is worse than its grid");
        std::process::exit(1);
    }
}

/// Prints a grid and the plan of a third of its hours; the least of the grid's errors over the plan's.
fn compare(name: &str, instrument: &Instrument, grid: &Scan, truths: u64) -> f64 {
    let hours = hours_of(grid, instrument);
    let plan = plan_for(instrument, hours / 3.0);
    let (by_grid, grid_open) = rms(grid, instrument, truths);
    let (by_plan, plan_open) = rms(&scan_of(&plan), instrument, truths);
    let cells = |errors: [f64; 3]| errors.map(|e| format!("{:.3} %", 100.0 * e)).join(" | ");
    println!("| {name} | {grid} | {hours:.3} | {} | {grid_open} | | | |", cells(by_grid));
    let ratios: Vec<f64> = by_grid.iter().zip(&by_plan).map(|(g, p)| g / p).collect();
    let said: Vec<String> = ratios.iter().map(|r| format!("{r:.2}")).collect();
    println!(
        "| {name} | plan | {:.3} | {} | {plan_open} | {} |",
        plan.precision.hours,
        cells(by_plan),
        said.join(" | ")
    );
    ratios.into_iter().fold(f64::INFINITY, f64::min)
}

/// The plain instrument with axes that take their time.
fn moving() -> Instrument {
    Instrument { axes: Axes { move_s: 5.0, ..Axes::default() }, ..Instrument::default() }
}

/// Every part, as the laboratory of the tests has it, and axes that stop a little off.
fn full() -> Instrument {
    Instrument { axes: Axes { jitter_deg: 0.02, ..lab().axes }, ..lab() }
}
