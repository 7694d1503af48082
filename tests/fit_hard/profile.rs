//! Intervals by profile where the cost takes passes: losses that are not linear in the weights, and robust ones.

use goniofit::brdf::Material;
use goniofit::fit::{FitOptions, Limit, Loss, Robust, RobustKind};
use goniofit::gonio::Instrument;
use goniofit::measurement::Measurement;

use crate::reference::{Reference, at};
use crate::support::*;

const NAMES: [&str; 3] = ["lambert.weight", "phong.weight", "phong.exponent"];

/// The losses of which a parabola was all that could be had.
fn losses() -> [FitOptions; 5] {
    let with = |loss, kind: Option<RobustKind>| {
        let robust = kind.map(|kind| Robust { kind, scale: kind.default_scale() });
        FitOptions { loss, robust, ..options("lambert+phong") }
    };
    [
        with(Loss::Log, None),
        with(Loss::CubeRoot, None),
        with(Loss::CosineL2, Some(RobustKind::Cauchy)),
        with(Loss::CosineL2, Some(RobustKind::Huber)),
        with(Loss::Log, Some(RobustKind::Cauchy)),
    ]
}

fn named(o: &FitOptions) -> String {
    format!("{} {:?}", o.loss.name(), o.robust.map(|r| r.kind))
}

fn noisy(truth: &Material, electrons: f64, step_deg: f64, seed: u64) -> Measurement {
    let mut m = measure(truth, &Instrument { electrons, ..Instrument::default() }, &HEMISPHERE(step_deg), seed);
    m.sigma = None;
    m
}

/// The robust loss with the s that a fit settled at, where it has one.
fn settled(o: &FitOptions, got: &Material) -> Option<(RobustKind, f64)> {
    o.robust.map(|robust| (robust.kind, record(got).robust_scale[0]))
}

/// The cost of the fit with a parameter fixed, under the s of the free fit: the scale is turned until s is that again.
fn cost_at(m: &Measurement, o: &FitOptions, got: &Material, name: &str, value: f64) -> f64 {
    let limits = vec![Limit::fixed(&format!("{name}={value:e}")).expect("a limit")];
    let mut o = FitOptions { limits, ..o.clone() };
    let robust = settled(&o, got);
    for _ in 0..60 {
        let held = solved(m, &o);
        let (Some(own), Some((_, wanted))) = (o.robust.as_mut(), robust) else { return record(&held).cost };
        let off = wanted / record(&held).robust_scale[0];
        if (off - 1.0).abs() < 1e-9 {
            return record(&held).cost;
        }
        own.scale *= off;
    }
    panic!("{}: no scale has this s", named(&o));
}

/// The rise of the cost that an interval's end stands for: (t σ)²/(A⁻¹)ⱼⱼ.
fn wanted_rise(reference: &Reference, p: &[f64], robust: Option<(RobustKind, f64)>, j: usize) -> f64 {
    let inverse = reference.normal(p, robust).try_inverse().expect("determined");
    reference.half_widths(p, robust)[j].powi(2) / inverse[(j, j)]
}

/// Few noisy samples: the exponent's interval is lopsided in ln n, and at both its ends the cost has risen as wanted.
#[test]
fn a_poorly_determined_exponent_has_a_lopsided_interval_where_the_cost_has_risen() {
    for o in losses() {
        let m = noisy(&material(&[0.2], &[0.06], 12.0), 300.0, 22.5, 4);
        let got = solved(&m, &o);
        let (reference, p) = at(&m, &o, &got);
        let robust = settled(&o, &got);
        let (low, high) = intervals(&got)[2].expect("determined");
        let lopsided = (high / p[2]).ln() / (p[2] / low).ln();
        let wanted = wanted_rise(&reference, &p, robust, 2);
        let rises = [low, high].map(|n| (cost_at(&m, &o, &got, NAMES[2], n) - record(&got).cost) / wanted);
        println!("{}: {low:.3} {:.3} {high:.3}, above over below {lopsided:.3}, rises {rises:?}", named(&o), p[2]);
        assert!((lopsided - 1.0).abs() > 0.01, "{}: {lopsided}", named(&o));
        assert!(rises.iter().all(|rise| (rise - 1.0).abs() < 1e-3), "{}: {rises:?}", named(&o));
    }
}

/// A lobe that is not there: its weight's interval begins at 0, and ends where the cost has risen as wanted.
#[test]
fn a_weight_near_zero_has_an_interval_that_begins_there() {
    for o in losses() {
        let mut found = 0;
        for seed in 0..6 {
            let m = noisy(&material(&[1e-3], &[0.3], 3.0), 3e3, 18.0, seed);
            let got = solved(&m, &o);
            let Some((low, high)) = intervals(&got)[0].filter(|i| i.0 == 0.0) else { continue };
            found += 1;
            let (reference, p) = at(&m, &o, &got);
            if o.loss == Loss::CubeRoot && p[0] == 0.0 {
                // The slope is infinite there, so that the reference has no A; the interval is none of nothing.
                println!("{} seed {seed}: {low:e} {:e} {high:e}", named(&o), p[0]);
                assert!(high > 1e-6, "{} seed {seed}: {high:e}", named(&o));
                continue;
            }
            let wanted = wanted_rise(&reference, &p, settled(&o, &got), 0);
            let rise = (cost_at(&m, &o, &got, NAMES[0], high) - record(&got).cost) / wanted;
            println!("{} seed {seed}: {low:e} {:e} {high:e}, rise {rise}", named(&o), p[0]);
            assert!((rise - 1.0).abs() < 1e-3, "{} seed {seed}: {rise}", named(&o));
        }
        assert!(found > 1, "{}: {found}", named(&o));
    }
}

/// Where the cost is a parabola as far as the interval reaches its profile says what estimate ± t·σ says; a range that ends nearby has it
/// read off.
#[test]
fn on_a_precise_table_the_profile_is_the_parabola() {
    let m = noisy(&material(&[0.2], &[0.1], 20.0), 1e7, 10.0, 5);
    for o in losses() {
        let free = solved(&m, &o);
        let p = parameters(&free);
        for j in 0..3 {
            let (low, high) = intervals(&free)[j].expect("determined");
            let bound = p[j] - 1.2 * (p[j] - low);
            let limits = vec![Limit::range(&format!("{}={bound:e}..", NAMES[j])).expect("a limit")];
            let near = solved(&m, &FitOptions { limits, ..o.clone() });
            let (a, b) = intervals(&near)[j].expect("determined");
            let off = [(a - low) / (p[j] - low), (b - high) / (high - p[j])];
            println!("{} {}: {off:?}", named(&o), NAMES[j]);
            assert!(off.iter().all(|off| off.abs() < 0.02), "{} {}: {off:?}", named(&o), NAMES[j]);
        }
    }
}

/// Two lobes in few noisy samples have several valleys; where the profile of a parameter meets a lower one the fit moves on to it.
#[test]
fn a_lower_valley_that_a_profile_meets_is_the_fit() {
    let truth = lobes(0.1, &[(0.05, 5.0), (0.05, 60.0)]);
    // As low as from the profiles of 600 such fits, of which three met a lower valley.
    let cases =
        [(116, 300.0, Loss::Log, 2.3195), (138, 300.0, Loss::Log, 2.2438), (116, 900.0, Loss::CubeRoot, 17.841)];
    for (seed, electrons, loss, least) in cases {
        let m = noisy(&truth, electrons, 15.0, seed);
        let o = FitOptions { loss, ..options("lambert+phong+phong") };
        let got = solved(&m, &o);
        assert!(record(&got).cost < least, "seed {seed}: {}", record(&got).cost);
        let names = ["lambert.weight", "phong[0].weight", "phong[1].weight", "phong[0].exponent", "phong[1].exponent"];
        for (name, interval) in names.iter().zip(intervals(&got)) {
            let Some((low, high)) = interval else { continue };
            for value in [low, high] {
                let cost = cost_at(&m, &o, &got, name, value);
                println!("seed {seed} {name} = {value:e}: {cost} against {}", record(&got).cost);
                assert!(cost >= record(&got).cost * (1.0 - 1e-9), "seed {seed} {name} = {value:e}: {cost}");
            }
        }
    }
}
