//! What a planned scan is worth: truths off the prior's middle, simulated, reduced and fitted, by a plan of a third of the hours beside uniform grids.
//! `cargo bench --bench planner` prints a Markdown table; `-- --quick` does a fifth of the truths.
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
    for (name, instrument) in [("plain", Instrument::default()), ("moves of 5 s", moving()), ("all parts", full())] {
        for scan in
            [Scan::InPlane { step_deg: 5.0 }, Scan::InPlane { step_deg: 1.0 }, Scan::Hemisphere { step_deg: 10.0 }]
        {
            compare(name, &instrument, &scan, truths);
        }
    }
}

fn compare(name: &str, instrument: &Instrument, grid: &Scan, truths: u64) {
    let hours = hours_of(grid, instrument);
    let plan = plan_for(instrument, hours / 3.0);
    let (by_grid, grid_open) = rms(grid, instrument, truths);
    let (by_plan, plan_open) = rms(&scan_of(&plan), instrument, truths);
    let cells = |errors: [f64; 3]| errors.map(|e| format!("{:.3} %", 100.0 * e)).join(" | ");
    println!("| {name} | {grid} | {hours:.3} | {} | {grid_open} | | | |", cells(by_grid));
    let ratio: Vec<String> = by_grid.iter().zip(&by_plan).map(|(g, p)| format!("{:.2}", g / p)).collect();
    println!(
        "| {name} | plan | {:.3} | {} | {plan_open} | {} |",
        plan.precision.hours,
        cells(by_plan),
        ratio.join(" | ")
    );
}

/// The plain instrument with axes that take their time.
fn moving() -> Instrument {
    Instrument { axes: Axes { move_s: 5.0, ..Axes::default() }, ..Instrument::default() }
}

/// Every part, as the laboratory of the tests has it, and axes that stop a little off.
fn full() -> Instrument {
    Instrument { axes: Axes { jitter_deg: 0.02, ..lab().axes }, ..lab() }
}
