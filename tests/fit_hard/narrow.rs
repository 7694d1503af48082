//! Lobes of one kind whose exponents have little room, or none.

use goniofit::fit::{FitOptions, Limit, Loss, Robust, RobustKind};
use goniofit::gonio::Instrument;
use goniofit::measurement::Measurement;

use crate::support::*;

const LOSSES: [(Loss, Option<RobustKind>); 3] =
    [(Loss::CosineL2, None), (Loss::Log, None), (Loss::CosineL2, Some(RobustKind::Huber))];

/// Models of one to four Phong lobes, with their number; the first of each row is the one that the others are held against.
const MODELS: [&[(&str, usize)]; 2] = [
    &[("lambert+phong", 1), ("lambert+phong+phong", 2), ("lambert+phong+phong+phong", 3)],
    &[("phong", 1), ("phong+phong+phong+phong", 4)],
];

/// Cost of a fit with this limit, and the exponents of those of its `count` lobes that are not absent.
fn narrow(
    m: &Measurement,
    (model, count): (&str, usize),
    limit: &str,
    (loss, kind): (Loss, Option<RobustKind>),
) -> (f64, Vec<f64>) {
    let robust = kind.map(|kind| Robust { kind, scale: kind.default_scale() });
    let read = if limit.contains("..") { Limit::range } else { Limit::fixed };
    let limit = |l: usize| read(&format!("phong[{l}].exponent={limit}")).expect("a limit");
    let got = solved(m, &FitOptions { loss, robust, limits: (0..count).map(limit).collect(), ..options(model) });
    let first = got.lobes.len() - count;
    (record(&got).cost, got.lobes[first..].iter().filter_map(|l| Some(l.shape_of(0)?[0])).collect())
}

fn noisy() -> Measurement {
    let instrument = Instrument { electrons: 1e4, ..Instrument::default() };
    measure(&material(&[0.2], &[0.1], 40.0), &instrument, &HEMISPHERE(18.0), 3)
}

/// Equal lobes are worth no more than one of them.
#[test]
fn lobes_whose_exponents_are_all_fixed_at_one_value_fit_as_one_lobe_does() {
    let (m, fixed) = (noisy(), "50");
    for (how, models) in LOSSES.iter().flat_map(|how| MODELS.map(|models| (*how, models))) {
        let (one, _) = narrow(&m, models[0], fixed, how);
        for model in &models[1..] {
            let (cost, exponents) = narrow(&m, *model, fixed, how);
            assert!(rel(cost, one) < 1e-7, "{how:?}, {model:?}: {cost} against {one}");
            assert!(exponents.iter().all(|n| rel(*n, 50.0) < 1e-12), "{exponents:?}");
        }
    }
}

/// A range of less than an octave has room for several lobes, and more lobes never fit worse.
#[test]
fn lobes_that_share_less_than_an_octave_are_fitted() {
    let (m, range) = (noisy(), "30..50");
    for (how, models) in LOSSES.iter().flat_map(|how| MODELS.map(|models| (*how, models))) {
        let (mut last, _) = narrow(&m, models[0], range, how);
        for model in &models[1..] {
            let (cost, exponents) = narrow(&m, *model, range, how);
            // The robust scale, and so what a residual costs, follows the fit.
            let slack = if how.1.is_some() { 0.02 } else { 1e-7 };
            assert!(cost <= last * (1.0 + slack), "{how:?}, {model:?}: {cost} above {last}");
            assert!(exponents.iter().all(|n| (29.999..50.001).contains(n)), "{exponents:?}");
            last = cost;
        }
    }
}
