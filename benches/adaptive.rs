//! What an adaptive scan is worth beside uniform scans of the plane of incidence that take as long: `cargo bench --bench adaptive` prints a Markdown table;
//! `-- --quick` does a fifth of the seeds.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

use goniofit::gonio::parts::Axes;
use goniofit::gonio::{Instrument, Scan};

#[allow(dead_code)] // the tests use more of it
#[path = "../tests/instrument/bends.rs"]
mod bends;
#[allow(dead_code)] // the tests use more of it
#[path = "../tests/instrument/support.rs"]
mod support;

use bends::{MATERIALS, study, uniform_in};

const SEEDS: u64 = 200;
const SCANS: [u32; 2] = [500, 1000];

fn main() {
    let seeds = if std::env::args().any(|a| a == "--quick") { SEEDS / 5 } else { SEEDS };
    println!(
        "Rms over {seeds} seeds. Interpolation: the readings' linear interpolation along θo less the truth, over the rms of the truth.\n"
    );
    println!("| instrument | material | scan | pairs | hours | interpolation | n, by σ | n, plain | n left open |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, instrument) in [("noisy detector", Instrument::default()), ("all parts", turning())] {
        for (material, n) in MATERIALS {
            for pairs in SCANS {
                let adaptive = study(n, &instrument, &Scan::Adaptive { pairs }, seeds);
                let scan = uniform_in(adaptive.hours, &instrument);
                let even = study(n, &instrument, &scan, seeds);
                for (scan, of) in [(Scan::Adaptive { pairs }.to_string(), adaptive), (scan_name(&scan), even)] {
                    let share = |x: f64| if n > 0.0 { format!("{:.3} %", 100.0 * x) } else { String::new() };
                    println!(
                        "| {name} | {material} | {scan} | {} | {:.3} | {:.3} % | {} | {} | {} |",
                        of.pairs,
                        of.hours,
                        100.0 * of.interpolation,
                        share(of.exponent),
                        share(of.unweighted),
                        of.open
                    );
                }
            }
        }
    }
}

/// With a step of three digits.
fn scan_name(scan: &Scan) -> String {
    match scan {
        Scan::InPlane { step_deg } => format!("in-plane:{step_deg:.3}"),
        other => other.to_string(),
    }
}

/// Every part, and axes that take their time.
fn turning() -> Instrument {
    let lab = support::lab();
    Instrument { axes: Axes { degrees_per_s: 20.0, jitter_deg: 0.02, ..lab.axes }, ..lab }
}
