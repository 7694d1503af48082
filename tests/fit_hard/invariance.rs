//! What must not change a fit: the unit of the data, the order of the samples, the number of threads.

use goniofit::brdf::{LobeKind, Material};
use goniofit::fit::{FitOptions, Loss, fit};
use goniofit::gonio::Instrument;
use goniofit::measurement::{Directions, Measurement, Weights};
use goniofit::numeric::random::RngExt;

use crate::support::*;

/// A noisy table of a material with as many glossy lobes as the model.
fn noisy(model: &str) -> Measurement {
    let three = |v: f64| vec![v, 0.7 * v, 0.4 * v];
    let glossy = [(three(0.2), 12.0), (three(0.3), 300.0)];
    let lobes = glossy.into_iter().take(model.matches("phong").count()).map(|(w, n)| (LobeKind::Phong, w, vec![n]));
    let all = std::iter::once((LobeKind::Lambert, three(0.3), vec![])).chain(lobes).collect();
    let scan = part_of(&HEMISPHERE(15.0), |_, wo| wo.y >= 0.0);
    measure(&Material::new(channels(3), all), &Instrument { electrons: 1e5, ..Instrument::default() }, &scan, 3)
}

const MODELS: [&str; 2] = ["lambert+phong", "lambert+phong+phong"];

fn copy(m: &Measurement) -> Measurement {
    Measurement {
        sigma: m.sigma.clone(),
        weights: m.weights.clone(),
        ..Measurement::new("m", m.directions.clone(), m.channels.clone(), m.values.clone())
    }
}

#[test]
fn the_unit_of_the_data_does_not_change_the_shape() {
    let mut failures = Vec::new();
    for model in MODELS {
        let m = noisy(model);
        for (loss, robust) in combinations(model, &HOMOGENEOUS) {
            let o = FitOptions { loss, robust, ..options(model) };
            let plain = solved(&m, &o);
            for scale in [1e-12, 1e12] {
                let mut scaled = copy(&m);
                scaled.values.iter_mut().for_each(|v| *v *= scale);
                scaled.sigma.iter_mut().flatten().for_each(|v| *v *= scale);
                let got = solved(&scaled, &o);
                let lobes = 1..got.lobes.len();
                let shape = lobes.clone().map(|l| rel(exponent(&got, l), exponent(&plain, l))).fold(0.0, f64::max);
                let pairs = parameters(&got).into_iter().zip(parameters(&plain)).take(3 * got.lobes.len());
                let weight = pairs.map(|(a, b)| if b == 0.0 { a } else { rel(a / scale, b) }).fold(0.0, f64::max);
                let case = format!(
                    "{model} {} {:?} × {scale:e}: shape {shape:.1e}, weights {weight:.1e}",
                    loss.name(),
                    robust.map(|r| r.kind)
                );
                println!("{case}");
                if !(shape <= 1e-12 && weight <= 1e-11) {
                    failures.push(case);
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn the_order_of_the_samples_does_not_change_the_shape() {
    let m = noisy(MODELS[1]);
    let mut order: Vec<usize> = (0..m.len()).collect();
    let mut rng = draws(5);
    for i in (1..order.len()).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    let Directions::List { wi, wo } = &m.directions else { panic!("a list") };
    let n = m.len();
    let pick = |list: &[f64]| -> Vec<f64> { (0..3).flat_map(|c| order.iter().map(move |i| list[c * n + i])).collect() };
    let mut shuffled = copy(&m);
    shuffled.directions =
        Directions::List { wi: order.iter().map(|i| wi[*i]).collect(), wo: order.iter().map(|i| wo[*i]).collect() };
    shuffled.values = pick(&m.values);
    shuffled.sigma = m.sigma.as_deref().map(pick);
    shuffled.weights = Weights::SolidAngle(order.iter().map(|i| m.weights.get(*i)).collect());
    let mut failures = Vec::new();
    for model in MODELS {
        for (loss, robust) in combinations(model, &Loss::ALL) {
            let o = FitOptions { loss, robust, ..options(model) };
            let (a, b) = (solved(&m, &o), solved(&shuffled, &o));
            let off = (1..a.lobes.len()).map(|l| rel(exponent(&a, l), exponent(&b, l))).fold(0.0, f64::max);
            let case = format!("{model} {} {:?}: {off:.1e}", loss.name(), robust.map(|r| r.kind));
            println!("{case}");
            if !(off <= 1e-12) {
                failures.push(case);
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn any_number_of_threads_gives_the_same_bits_for_every_loss() {
    let m = noisy(MODELS[1]);
    for model in MODELS {
        for (loss, robust) in combinations(model, &Loss::ALL) {
            let o = FitOptions { loss, robust, ..options(model) };
            let run = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
                let mut got = pool.install(|| fit(&m, &o)).unwrap_or_else(|e| panic!("{e}")).material;
                got.fit.as_mut().expect("a record").seconds = 0.0;
                got.to_json().expect("json")
            };
            let one = run(1);
            for threads in [2, 8] {
                assert_eq!(one, run(threads), "{model} {loss:?} {robust:?} {threads} threads");
            }
        }
    }
}
