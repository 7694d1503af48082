//! Truths off the prior's middle, measured by a planned scan and by uniform grids, reduced and fitted: how far the parameters are off.
//! `benches/planner.rs` runs the same in numbers.

use goniofit::brdf::{LobeKind, Material};
use goniofit::chain::{Source, measure};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, fit};
use goniofit::gonio::design::{Plan, Prior, Wish, plan};
use goniofit::gonio::{Instrument, Scan, hours, lit_rows};
use goniofit::measurement::{Dimension, Weights};
use goniofit::numeric::random::{Purpose, RngExt, stream};
use rayon::prelude::*;

pub const MODEL: &str = "lambert+phong";

pub fn prior() -> Prior {
    Prior::usual(&MODEL.parse().expect("a model")).expect("space")
}

/// The hours that a scan takes.
pub fn hours_of(scan: &Scan, instrument: &Instrument) -> f64 {
    let (directions, _) = scan.directions().expect("small");
    hours(instrument, &directions, &lit_rows(&directions, scan.rows()))
}

/// The plan for so many hours.
pub fn planned(instrument: &Instrument, hours: f64) -> Plan {
    plan(&Wish { prior: &prior(), instrument, budget_s: 3600.0 * hours }).expect("enough")
}

/// The scan of a plan.
pub fn scan_of(plan: &Plan) -> Scan {
    Scan::List {
        name: "plan".into(),
        directions: plan.directions.clone(),
        weights: Weights::Uniform,
        dimension: Dimension::Space,
        rows: plan.rows.clone(),
    }
}

/// Parameters from the outer quarters of the prior's ranges, on the logarithmic scale, with equal chance of either.
pub fn truth(index: u64) -> [f64; 3] {
    let rng = &mut stream(11, Purpose::Study, index);
    let prior = prior();
    let mut draw = |k: usize| {
        let place = 0.25 * rng.random::<f64>();
        let place = if rng.random::<bool>() { place } else { 1.0 - place };
        let range = &prior.ranges()[k];
        range.low * (range.high / range.low).powf(place)
    };
    [draw(0), draw(1), draw(2)]
}

/// ln(found/true) of kd, ks, n, from one simulated measurement; `None` where the fit says that the data leave one open.
pub fn off(scan: &Scan, instrument: &Instrument, truth: [f64; 3], seed: u64) -> Option<[f64; 3]> {
    let [kd, ks, n] = truth;
    let lobes = vec![(LobeKind::Lambert, vec![kd], vec![]), (LobeKind::Phong, vec![ks], vec![n])];
    let material = Material::new(vec!["y".into()], lobes);
    let source = Source::Fitted(Box::new(material));
    let measured = measure("m", &source, instrument, scan, seed, Control::silent()).expect("measured");
    let options = FitOptions { use_sigma: true, ..FitOptions::new(MODEL.parse().expect("a model")) };
    let found = fit(&measured, &options).expect("fitted").material;
    let exponent = found.lobes[1].shape_of(0)?[0];
    let ratio = [found.lobes[0].weight[0] / kd, found.lobes[1].weight[0] / ks, exponent / n];
    ratio.iter().all(|r| *r > 0.0).then(|| ratio.map(f64::ln))
}

/// Root mean squares of what is off, over so many truths, and how many left something open.
pub fn rms(scan: &Scan, instrument: &Instrument, truths: u64) -> ([f64; 3], usize) {
    let all: Vec<Option<[f64; 3]>> =
        (0..truths).into_par_iter().map(|i| off(scan, instrument, truth(i), 1000 + i)).collect();
    let told: Vec<[f64; 3]> = all.iter().copied().flatten().collect();
    let of = |k: usize| (told.iter().map(|e| e[k] * e[k]).sum::<f64>() / told.len() as f64).sqrt();
    ([of(0), of(1), of(2)], all.len() - told.len())
}
