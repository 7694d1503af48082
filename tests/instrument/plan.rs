//! A plan keeps what it promises: errors that simulated measurements have are those that it states, and a third of a uniform grid's hours is enough.

use crate::planned::{hours_of, planned, prior, rms, scan_of, truth};
use crate::support::lab;
use goniofit::gonio::design::{Prior, Range, precision};
use goniofit::gonio::parts::{Axes, Detector, Holder, Reference};
use goniofit::gonio::{Instrument, Scan};

/// Axes that take 5 s to move.
fn moving() -> Instrument {
    Instrument { axes: Axes { move_s: 5.0, ..Axes::default() }, ..Instrument::default() }
}

const TRUTHS: u64 = 120;
/// By how much a ratio of two rms over that many truths may be off by chance, 4 σ: an rms over N scatters by 1/√(2N) of itself, and by more where truths
/// differ in how well they are told, here up to twice.
fn chance() -> f64 {
    4.0 * 2.0 / (TRUTHS as f64).sqrt()
}

#[test]
fn a_plan_of_a_third_of_the_hours_of_a_grid_tells_every_parameter_as_well() {
    for grid in [Scan::Hemisphere { step_deg: 10.0 }, Scan::InPlane { step_deg: 5.0 }] {
        let instrument = moving();
        let hours = hours_of(&grid, &instrument);
        let plan = planned(&instrument, hours / 3.0);
        assert!(plan.precision.hours <= hours / 3.0);
        let ((by_grid, _), (by_plan, open)) =
            (rms(&grid, &instrument, TRUTHS), rms(&scan_of(&plan), &instrument, TRUTHS));
        println!("{grid}: {by_grid:?}, plan of a third: {by_plan:?}");
        assert_eq!(open, 0);
        for (k, (g, p)) in by_grid.iter().zip(by_plan).enumerate() {
            assert!(p <= g * (1.0 + chance()), "{grid}, {}: {p} {g}", prior().names()[k]);
        }
    }
}

/// What a plan states is what redrawn noise does to a fit: at one truth, errors over stated standard errors have a mean square of 1.
#[test]
fn stated_precision_is_met_by_simulated_measurements() {
    let [kd, ks, n] = truth(3);
    let mut at = prior();
    for (name, x) in [("lambert.weight", kd), ("phong.weight", ks), ("phong.exponent", n)] {
        at = Prior::with(at, Range { name: name.into(), low: x, high: x }).expect("a range");
    }
    let instrument = moving();
    let plan = planned(&instrument, 0.3);
    let stated = precision(&at, &instrument, &plan.directions, &plan.rows);
    let draws = 300u64;
    let errors: Vec<[f64; 3]> =
        (0..draws).filter_map(|seed| crate::planned::off(&scan_of(&plan), &instrument, [kd, ks, n], seed)).collect();
    assert_eq!(errors.len() as u64, draws);
    for k in 0..3 {
        let square = errors.iter().map(|e| (e[k] / stated.errors[k][1]).powi(2)).sum::<f64>() / draws as f64;
        println!("{}: mean square {square}", at.names()[k]);
        // χ² of 300 over 300: σ = √(2/300).
        assert!((square - 1.0).abs() < 5.0 * (2.0 / draws as f64).sqrt(), "{k}: {square}");
    }
}

/// Jitter shortens stops, so that each pair is approached anew; a full well keeps off the peak.
#[test]
fn a_plan_knows_jitter_and_saturation() {
    let base = lab();
    let jittery = Instrument { axes: Axes { jitter_deg: 0.1, ..base.axes }, ..base.clone() };
    let [still, shaken] = [&base, &jittery].map(|i| planned(i, 0.5));
    assert!(shaken.precision.stops > 2 * still.precision.stops, "{} {}", shaken.precision.stops, still.precision.stops);
    let all = [&base, &jittery].map(|i| planned(i, 0.5).precision.errors[2][1]);
    assert!(all[1] > all[0], "{all:?}");
    let detector = Detector { full_well: 2e4, ..base.detector.clone() };
    let small = Instrument { detector, ..base };
    let plan = planned(&small, 0.5);
    let (brightest, _) = rms(&scan_of(&plan), &small, 20);
    assert!(brightest.iter().all(|e| *e < 0.2), "{brightest:?}");
}

/// Zeros, tilt and a certificate that readings share: the plan's stated errors are those of redrawn instruments, and it is no worse than the usual scan
/// in the same hours by more than chance may make it (4 σ); ks and n, which such errors move, it tells better (0.76 and 0.60 of the errors, known to a tenth).
#[test]
fn a_plan_knows_what_readings_share() {
    let base = moving();
    let instrument = Instrument {
        axes: Axes { zero_u_deg: 0.05, ..base.axes },
        sample: Holder { tilt_u_deg: 0.05, ..base.sample },
        reference: Reference { reflectance: 0.99, reflectance_u: 0.002, ..base.reference },
        ..base
    };
    let grid = Scan::InPlane { step_deg: 5.0 };
    let hours = hours_of(&grid, &instrument);
    let plan = planned(&instrument, hours);
    let ((by_grid, _), (by_plan, open)) = (rms(&grid, &instrument, TRUTHS), rms(&scan_of(&plan), &instrument, TRUTHS));
    println!("{grid}: {by_grid:?}, plan: {by_plan:?}, stated {:?}", plan.precision.errors);
    assert_eq!(open, 0);
    for (k, (g, p)) in by_grid.iter().zip(by_plan).enumerate() {
        assert!(p <= g * if k == 0 { 1.0 + chance() } else { 0.95 }, "{}: {p} {g}", prior().names()[k]);
    }
    // At one truth, over redrawn instruments.
    let [kd, ks, n] = truth(3);
    let mut at = prior();
    for (name, x) in [("lambert.weight", kd), ("phong.weight", ks), ("phong.exponent", n)] {
        at = Prior::with(at, Range { name: name.into(), low: x, high: x }).expect("a range");
    }
    let stated = precision(&at, &instrument, &plan.directions, &plan.rows);
    let draws = 200u64;
    let errors: Vec<[f64; 3]> =
        (0..draws).filter_map(|seed| crate::planned::off(&scan_of(&plan), &instrument, [kd, ks, n], seed)).collect();
    for k in 0..3 {
        let square = errors.iter().map(|e| (e[k] / stated.errors[k][1]).powi(2)).sum::<f64>() / errors.len() as f64;
        println!("{}: mean square {square}", at.names()[k]);
        // The noise of the reference's visits is not counted; squares of few shared errors scatter by √(2/200), 5 σ of which and a quarter.
        assert!((0.4..1.75).contains(&square), "{k}: {square}");
    }
}
