//! The reported optimum is one, and what is reported of it is what the formulas of the documentation give.

use goniofit::fit::{FitOptions, Loss, RobustKind, WeightMode};
use goniofit::gonio::{Instrument, Scan};
use goniofit::measurement::Measurement;

use crate::reference::at;
use crate::support::*;

/// A noisy table that Lambert and one Phong lobe do not describe: its residuals are far from 0 and structured.
fn misfit(seed: u64) -> Measurement {
    let truth = lobes(0.25, &[(0.1, 9.0), (0.15, 120.0)]);
    let instrument = Instrument { electrons: 3e4, ..Instrument::default() };
    measure(&truth, &instrument, &HEMISPHERE(10.0), seed)
}

fn two_channels(scan: &Scan, electrons: f64) -> Measurement {
    let truth = material(&[0.3, 0.15], &[0.1, 0.25], 35.0);
    measure(&truth, &Instrument { electrons, ..Instrument::default() }, scan, 5)
}

/// All losses, weights and robust losses on a table.
fn cases(m: &Measurement) -> Vec<FitOptions> {
    let mut list = Vec::new();
    for loss in Loss::ALL {
        for robust in robusts() {
            for (weights, use_sigma) in
                [(WeightMode::SolidAngle, false), (WeightMode::Uniform, false), (WeightMode::Uniform, true)]
            {
                if !use_sigma || m.sigma.is_some() {
                    list.push(FitOptions { loss, robust, weights, use_sigma, ..options("lambert+phong") });
                }
            }
        }
    }
    list
}

#[test]
fn at_the_reported_optimum_of_every_loss_the_gradient_is_0_and_the_cost_is_that_of_the_formulas() {
    let mut failures = Vec::new();
    for (name, m) in [("misfit", misfit(3)), ("two channels", two_channels(&Scan::InPlane { step_deg: 2.0 }, 1e5))] {
        for o in cases(&m) {
            let got = solved(&m, &o);
            let (reference, p) = at(&m, &o, &got);
            let r = record(&got);
            let s = r.robust_scale.first().copied();
            let robust = o.robust.map(|robust| (robust.kind, s.expect("a scale")));
            let cost = reference.cost(&p, robust);
            let steepest = reference.gradient(&p, robust).into_iter().map(f64::abs).fold(0.0, f64::max);
            let spread = o.robust.map_or(0.0, |robust| rel(s.expect("a scale"), reference.robust_scale(&p, robust)));
            let (cost_off, rmse_off) = (rel(r.cost, cost), rel(r.rmse, reference.rmse(cost)));
            let epsilon_off =
                r.relative_epsilon.iter().zip(&reference.epsilon).map(|(a, b)| rel(*a, *b)).fold(0.0, f64::max);
            let case = format!(
                "{name} {} {} {:?}: gradient {steepest:.1e}, cost off by {cost_off:.1e}, rmse {rmse_off:.1e}, scale {spread:.1e}, \
                 epsilon {epsilon_off:.1e}, {}",
                o.loss.name(),
                r.weights,
                o.robust.map(|r| r.kind),
                r.status,
            );
            println!("{case}");
            let fine = steepest <= 1e-10 && cost_off < 1e-9 && rmse_off < 1e-9 && spread < 1e-6 && epsilon_off < 1e-12;
            if !fine || r.status != "converged" {
                failures.push(case);
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn standard_errors_are_those_of_the_sandwich_written_out() {
    let mut failures = Vec::new();
    let m = two_channels(&HEMISPHERE(15.0), 1e5);
    for loss in Loss::ALL {
        for use_sigma in [false, true] {
            for (stated, components) in [(true, 0), (false, 0), (true, 2), (false, 2)] {
                if use_sigma && !stated {
                    continue;
                }
                let mut m = Measurement {
                    sigma: m.sigma.clone(),
                    weights: m.weights.clone(),
                    ..Measurement::new("m", m.directions.clone(), m.channels.clone(), m.values.clone())
                };
                if !stated {
                    m.sigma = None;
                }
                if components == 2 {
                    let tilt = |i: usize| m.directions.pair(i % m.len()).1.x;
                    let gain = m.values.iter().map(|v| 0.02 * v).collect();
                    m.common = vec![gain, (0..m.values.len()).map(|i| 3e-3 * tilt(i)).collect()];
                }
                let o = FitOptions { loss, use_sigma, ..options("lambert+phong") };
                let got = solved(&m, &o);
                let (reference, p) = at(&m, &o, &got);
                let want = reference.errors(&m, &p);
                let off: Vec<f64> =
                    errors(&got).iter().zip(&want).map(|(a, b)| a.map_or(f64::NAN, |a| rel(a, *b))).collect();
                let worst = off.iter().copied().fold(0.0, f64::max);
                let case =
                    format!("{} use_sigma {use_sigma}, sigma {stated}, {components} common: {off:?}", loss.name());
                println!("{case}");
                if !(worst < 1e-6 && off.iter().all(|v| v.is_finite())) {
                    failures.push(case);
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Dim values with noise about them, so that a shared error moves the residuals of some up and of others down.
fn both_signs() -> Measurement {
    let truth = material(&[2e-3, 1e-3], &[0.1, 0.25], 35.0);
    let mut m = exact(&truth, &HEMISPHERE(15.0));
    let mut rng = draws(12);
    m.values.iter_mut().for_each(|v| *v += 2e-3 * normal(&mut rng));
    let negative = m.values.iter().filter(|v| **v < 0.0).count();
    assert!(negative > m.values.len() / 10, "{negative} of {}", m.values.len());
    m.common = vec![m.values.iter().map(|v| 1e-3 + 0.02 * v.abs()).collect()];
    m
}

fn assert_errors_are_those_written_out(m: &Measurement, loss: Loss) {
    let o = FitOptions { loss, ..options("lambert+phong") };
    let got = solved(m, &o);
    let (reference, p) = at(m, &o, &got);
    let (have, want) = (errors(&got), reference.errors(m, &p));
    // Noise as large as this can leave the exponent open.
    let near = have.iter().zip(&want).all(|(a, b)| a.is_none_or(|a| rel(a, *b) < 1e-6));
    let known = have.iter().flatten().count();
    assert!(near && known + 1 >= have.len(), "{}: {have:?}, written out {want:?}", loss.name());
}

#[test]
fn a_shared_error_keeps_its_sign_on_negative_values() {
    let m = both_signs();
    for loss in [Loss::L2, Loss::CosineL2, Loss::Relative] {
        assert_errors_are_those_written_out(&m, loss);
    }
}

/// The cube root's slope is infinite at a value of 0: a shared error can't be carried through it, and must not spoil the others.
#[test]
fn a_shared_error_passes_over_a_value_of_0_in_the_cube_root() {
    let mut m = two_channels(&HEMISPHERE(15.0), 1e5);
    m.sigma = None;
    m.values[40] = 0.0;
    m.common = vec![m.values.iter().map(|v| 1e-3 + 0.02 * v.abs()).collect()];
    assert_errors_are_those_written_out(&m, Loss::CubeRoot);
}

/// The written-out gradient used above is the slope of the written-out cost.
#[test]
fn the_written_out_gradient_is_the_slope_of_the_written_out_cost() {
    let m = misfit(4);
    for o in cases(&m) {
        let robust = o.robust.map(|r| (r.kind, 0.02));
        let reference = crate::reference::Reference::new(&m, &o);
        let p = [0.2, 0.2, 30.0];
        let cosines = reference.gradient(&p, robust);
        for i in 0..3 {
            let h = 1e-5 * p[i];
            let moved = |by: f64| {
                let mut q = p;
                q[i] += by;
                reference.cost(&q, robust)
            };
            let by_difference = (moved(h) - moved(-h)) / (2.0 * h) * if i == 2 { p[i] } else { 1.0 };
            // Undo the cosine's denominator.
            let mut energy = 0.0;
            let mut a = 0.0;
            for v in &reference.values {
                let (r, j) = (reference.residual(&p, v), reference.jacobian(&p, v)[i]);
                let u = robust.map_or(0.0, |(_, s)| r * r / (s * s));
                let trust = match robust.map(|r| r.0) {
                    None => 1.0,
                    Some(RobustKind::Huber) => {
                        if u <= 1.0 {
                            1.0
                        } else {
                            1.0 / u.sqrt()
                        }
                    }
                    Some(RobustKind::Cauchy) => 1.0 / (1.0 + u),
                };
                energy += v.w * trust * r * r;
                a += v.w * trust * j * j;
            }
            let written = 2.0 * cosines[i] * (energy * a).sqrt();
            let size = (energy * a).sqrt();
            assert!((written - by_difference).abs() < 1e-5 * size, "{o:?} {i}: {written:e} {by_difference:e}");
        }
    }
}
