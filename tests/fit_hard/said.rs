//! What a fit must say of itself: numbers that can't be trusted are named, and no number is made up.

use goniofit::fit::{FitOptions, Limit, Loss, Robust, RobustKind, fit};
use goniofit::gonio::{Instrument, Scan};
use goniofit::measurement::{Directions, Measurement};

use crate::experiment::{Outliers, add_outliers};
use crate::support::*;

fn says(m: &goniofit::brdf::Material, words: &str) -> bool {
    record(m).warnings.iter().any(|w| w.contains(words))
}

fn noisy(electrons: f64, scan: &Scan, seed: u64) -> Measurement {
    measure(
        &material(&[0.2, 0.1, 0.05], &[0.08; 3], 40.0),
        &Instrument { electrons, ..Instrument::default() },
        scan,
        seed,
    )
}

/// A loss that bends pulls a fit off the mean: its intervals don't hold, and it says so.
#[test]
fn a_fit_that_noise_pulls_off_the_mean_says_so() {
    let scan = HEMISPHERE(10.0);
    for seed in 0..6 {
        let m = noisy(300.0, &scan, seed);
        for loss in [Loss::Relative, Loss::CubeRoot] {
            assert!(
                says(&solved(&m, &FitOptions { loss, ..options("lambert+phong") }), "off the mean"),
                "{loss:?} {seed}"
            );
        }
        for kind in RobustKind::ALL.into_iter().filter(|_| seed < 1) {
            let robust = Some(Robust { kind, scale: kind.default_scale() });
            let relative =
                |m: &Measurement| solved(m, &FitOptions { loss: Loss::Relative, robust, ..options("lambert+phong") });
            let small = noisy(1e4, &scan, seed);
            let got = relative(&small);
            // Pulled far enough residuals are alike, which says it otherwise.
            let is_said = says(&got, "off the mean") || says(&got, "does not describe");
            assert!(is_said, "relative {kind:?} {seed}: {:?}", record(&got).warnings);
            // Where noise exceeds the values a model of 0 is off each by the factor 1: no scale tells anything then.
            let got = relative(&m);
            assert!(says(&got, "gross outliers") || says(&got, "does not describe"), "relative {kind:?} {seed}");
            let (clean, mut spoilt) = (noisy(1e8, &scan, seed), noisy(1e8, &scan, seed));
            add_outliers(&mut spoilt, Outliers::OneSided(0.05), &mut draws(seed));
            for (m, loss) in [&clean, &spoilt].into_iter().flat_map(|m| [Loss::Relative, Loss::Log].map(|l| (m, l))) {
                let got = solved(m, &FitOptions { loss, robust, ..options("lambert+phong") });
                assert!(!says(&got, "off the mean"), "{loss:?} {kind:?} {seed}: {:?}", record(&got).warnings);
            }
        }
        // Fits that follow the mean, and those whose noise is too small to matter, have nothing to say.
        for (m, loss) in [(&m, Loss::L2), (&m, Loss::CosineL2), (&noisy(1e9, &scan, seed), Loss::CubeRoot)] {
            assert!(
                !says(&solved(m, &FitOptions { loss, ..options("lambert+phong") }), "off the mean"),
                "{loss:?} {seed}"
            );
        }
    }
}

/// σ estimated from noisy photon counts: low readings weigh more. In a large scan that outgrows the standard errors.
#[test]
fn weights_by_a_sigma_that_follows_the_noise_are_said_to_pull_the_fit() {
    let truth = material(&[0.2, 0.1, 0.05], &[0.08; 3], 40.0);
    let o = FitOptions { use_sigma: true, ..options("lambert+phong") };
    let said =
        |seed| says(&solved(&measure(&truth, &Instrument::default(), &HEMISPHERE(5.0), seed), &o), "off the mean");
    assert!((0..6).filter(|seed| said(*seed)).count() >= 4);
}

/// With the sum of two weights at the limit one can only grow as the other shrinks.
#[test]
fn weights_that_the_energy_limit_ties_have_equal_errors() {
    let truth = material(&[0.8], &[0.5], 40.0);
    let m = measure(&truth, &Instrument { electrons: 1e5, ..Instrument::default() }, &HEMISPHERE(15.0), 4);
    let got = solved(&m, &FitOptions { conserve_energy: true, ..options("lambert+phong") });
    assert!((got.lobes[0].weight[0] + got.lobes[1].weight[0] - 1.0).abs() < 1e-9, "{got:?}");
    assert!(says(&got, "the energy limit decides"), "{got:?}");
    let record = record(&got);
    let error = |l: usize| record.standard_error[l].weight[0].expect("determined");
    assert!(error(0) > 0.0 && rel(error(0), error(1)) < 1e-9, "{} {}", error(0), error(1));
    let matrix = &record.correlation.as_ref().expect("few parameters").matrix;
    assert!((matrix[0][1].expect("known") + 1.0).abs() < 1e-9, "{matrix:?}");
    let interval = |l: usize| record.interval_95[l].weight[0].expect("determined");
    let ((a, b), (c, d)) = (interval(0), interval(1));
    // What one loses the other may gain at most; neither reaches beyond the limit.
    assert!(b <= 1.0 && d <= 1.0 && c <= 1.0 - b + 1e-6 && d <= 1.0 - a + 1e-6, "{a} {b} {c} {d}");
    assert!(a < got.lobes[0].weight[0] && got.lobes[0].weight[0] <= b, "{a} {b}");
    // A weight alone at the limit has room below only.
    let one = solved(&m, &FitOptions { conserve_energy: true, ..options("lambert") });
    let fit = crate::support::record(&one);
    let (low, high) = fit.interval_95[0].weight[0].expect("determined");
    assert!(one.lobes[0].weight[0] == 1.0 && high == 1.0 && low < 1.0, "{one:?}");
    assert!(!says(&solved(&m, &options("lambert+phong")), "the energy limit decides"));
}

/// σ = 0 is no statement, and σ far above the residuals is worth a word.
#[test]
fn stated_errors_that_can_not_be_right_are_not_taken_for_granted() {
    let with = |factor: f64| {
        let m = noisy(1e4, &HEMISPHERE(15.0), 2);
        let sigma = m.sigma.as_ref().map(|s| s.iter().map(|s| factor * s).collect());
        Measurement { sigma, ..m }
    };
    let without = Measurement { sigma: None, ..with(1.0) };
    let [plain, zero, far, none] =
        [with(1.0), with(0.0), with(10.0), without].map(|m| solved(&m, &options("lambert+phong")));
    assert_eq!(record(&zero).standard_error, record(&none).standard_error);
    assert!(says(&far, "smaller than the stated σ") && !says(&plain, "smaller than the stated σ"));
}

/// A sharp lobe whose tail is 10⁻¹⁵⁰ on every sample fits rounding with a weight of 10¹⁴³, unless it counts as absent. A model must never end
/// above a smaller one.
#[test]
fn a_lobe_that_no_sample_sees_is_absent_and_more_lobes_never_fit_worse() {
    let away = part_of(&Scan::InPlane { step_deg: 5.0 }, |wi, wo| cos_alpha(wi, wo) < 0.97);
    let m = measure(
        &lobes(0.2, &[(0.1, 3.0), (0.05, 20.0)]),
        &Instrument { electrons: 1e4, ..Instrument::default() },
        &away,
        3,
    );
    for loss in [Loss::CosineL2, Loss::L2, Loss::Relative] {
        let mut last = f64::INFINITY;
        for model in ["lambert+phong", "lambert+phong+phong", "lambert+phong+phong+phong"] {
            let got = solved(&m, &FitOptions { loss, ..options(model) });
            let largest = got.lobes.iter().flat_map(|l| &l.weight).copied().fold(0.0, f64::max);
            assert!(largest < 1e12, "{loss:?} {model}: {got:?}");
            let cost = record(&got).cost;
            assert!(cost <= last * (1.0 + 1e-9), "{loss:?} {model}: {cost} above {last}");
            last = cost;
        }
    }
}

/// Where neighbours are missing and no σ is stated nothing is made of the residuals, and that is said.
#[test]
fn residuals_that_can_not_be_judged_are_said_to_be_so() {
    let mut m = noisy(1e4, &HEMISPHERE(10.0), 2);
    m.sigma = None;
    let got = solved(&m, &FitOptions { stride: 50, ..options("lambert+phong") });
    assert!(record(&got).residual.is_none() && says(&got, "can't be told"), "{got:?}");
}

/// A table pasted twice knows no more than once, whatever its standard errors say.
#[test]
fn copied_readings_are_told_from_honest_repeats() {
    let scan = HEMISPHERE(15.0);
    let (once, again) = (noisy(1e4, &scan, 2), noisy(1e4, &scan, 3));
    let beside = |other: &Measurement| {
        let list = |m: &Measurement| (0..m.len()).map(|i| m.directions.pair(i)).collect::<Vec<_>>();
        let (wi, wo) = [list(&once), list(other)].concat().into_iter().unzip();
        let values = (0..3).flat_map(|c| [once.plane(c), other.plane(c)].concat()).collect();
        Measurement::new("both", Directions::List { wi, wo }, once.channels.clone(), values)
    };
    let words = "directions occur again with identical values";
    for (m, want) in [(&once, false), (&beside(&once), true), (&beside(&again), false)] {
        for o in [options("lambert+phong"), FitOptions { loss: Loss::Log, ..options("lambert") }] {
            assert_eq!(says(&solved(m, &o), words), want, "{:?}", record(&solved(m, &o)).warnings);
        }
    }
}

/// Weights by σ leave out what has none, and say how much that is.
#[test]
fn values_without_a_sigma_are_counted_where_sigma_weighs() {
    let mut m = noisy(1e4, &HEMISPHERE(15.0), 2);
    let sigma = m.sigma.as_mut().expect("stated");
    sigma.iter_mut().step_by(5).for_each(|s| *s = 0.0);
    let weighed = FitOptions { use_sigma: true, ..options("lambert+phong") };
    let got = solved(&m, &weighed);
    assert!(says(&got, "values were left out, for their stated sigma is 0"), "{:?}", record(&got).warnings);
    assert!(!says(&solved(&m, &options("lambert+phong")), "stated sigma is 0"));
    m.sigma.as_mut().expect("stated").fill(0.0);
    let error = fit(&m, &weighed).expect_err("no weight").to_string();
    assert!(error.contains("use-sigma") && error.contains("positive sigma"), "{error}");
}

/// Where nothing is free there are no standard errors to speak of.
#[test]
fn a_fit_of_held_parameters_does_not_speak_of_standard_errors() {
    let m = noisy(1e4, &HEMISPHERE(15.0), 2);
    let held =
        ["lambert.weight=0.1", "phong.weight=0.1", "phong.exponent=20"].map(|t| Limit::fixed(t).expect("a limit"));
    let got = solved(&m, &FitOptions { limits: held.to_vec(), ..options("lambert+phong") });
    assert!(says(&got, "does not describe these data") && !says(&got, "standard error"), "{:?}", record(&got).warnings);
    let free = FitOptions { limits: held[..2].to_vec(), ..options("lambert+phong") };
    assert!(says(&solved(&m, &free), "standard error"));
}

/// Values whose squares are no numbers any more are refused by name, small or large.
#[test]
fn values_too_small_to_have_all_digits_or_too_large_to_square_are_named() {
    let m = noisy(1e4, &HEMISPHERE(15.0), 2);
    let scaled = |factor: f64| {
        let values = m.values.iter().map(|v| factor * v).collect();
        Measurement::new("m", m.directions.clone(), m.channels.clone(), values)
    };
    for o in [options("lambert+phong"), FitOptions { loss: Loss::Relative, ..options("lambert") }] {
        for (factor, word) in [(1e-320, "too small"), (1e-302, "too small"), (1e200, "overflows")] {
            let error = fit(&scaled(factor), &o).expect_err("no square").to_string();
            assert!(error.contains(word), "{factor:e}: {error}");
        }
        assert!(fit(&scaled(1e-280), &o).is_ok());
    }
}
