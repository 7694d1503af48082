#![allow(warnings)]
#[path = "../tests/instrument/experiment.rs"]
mod experiment;
use experiment::*;
use goniofit::geometry::angles::theta_of;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let class = CLASSES.iter().find(|c| c.0 == a[2]).unwrap().1;
    let of = Experiment::new(&a[1], class);
    let n: u64 = a[3].parse().unwrap();
    let runs: Vec<_> = (0..n).map(|s| of.outcome(s, false)).collect();
    for i in 0..of.directions.len() {
        let (wi, wo) = of.directions.pair(i);
        let v: Vec<(f64, f64)> = runs.iter().filter_map(|r| r.readings[i]).collect();
        let m = v.len() as f64;
        let mean = v.iter().map(|v| v.0).sum::<f64>() / m;
        let sd = (v.iter().map(|v| v.0 * v.0).sum::<f64>() / m).sqrt();
        let sig = v.iter().map(|v| v.1).sum::<f64>() / m;
        let smin = v.iter().map(|v| v.1).fold(1e99, f64::min);
        let smax = v.iter().map(|v| v.1).fold(0., f64::max);
        let held = v.iter().filter(|v| v.0.abs() <= 1.96 * v.1).count() as f64 / m;
        println!(
            "{:5.1} {:6.2} exp {:10.4e} n {} mean {:+.2e} rms {:.2e} sigma {:.2e} [{:.1e} {:.1e}] held {:.3}",
            theta_of(wi).to_degrees(),
            theta_of(wo).to_degrees() * (-wo.x).signum(),
            of.expected(i),
            m,
            mean,
            sd,
            sig,
            smin,
            smax,
            held
        );
    }
}
