#![allow(warnings)]
#[path = "../tests/instrument/experiment.rs"]
mod experiment;
use experiment::*;
use goniofit::brdf::*;
use goniofit::fit::{FitOptions, fit};
use goniofit::gonio::sight::Cones;
use std::sync::Arc;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let class = CLASSES.iter().find(|c| c.0 == a[2]).unwrap().1;
    let of = Experiment::new(&a[1], class);
    let n: u64 = a[3].parse().unwrap();
    let cones = Cones::of(&of.described).map(Arc::new);
    for s in 0..n {
        let m = of.reduced(s).measurement;
        let options = FitOptions {
            use_sigma: true,
            through: cones.clone().map(|c| c as Arc<dyn Sight>),
            ..FitOptions::new("lambert+phong".parse().unwrap())
        };
        let r = fit(&m, &options).unwrap().material;
        let rec = r.fit.as_ref().unwrap();
        println!(
            "kd {:.5} ks {:.5} {:?} n {:?} {:?} | {:?} common {}",
            r.lobes[0].weight[0],
            r.lobes[1].weight[0],
            rec.interval_95[1].weight[0],
            r.lobes[1].shape_of(0).unwrap(),
            rec.interval_95[1].shape[0].1,
            rec.warnings,
            m.common.len()
        );
    }
}
