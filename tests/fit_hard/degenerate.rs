//! Data that do not determine everything: what they do determine is right, the rest is said to be open, and nothing is made up.

use goniofit::fit::{FitOptions, Limit};
use goniofit::gonio::{Instrument, Scan};

use crate::support::*;

#[test]
fn without_a_glossy_lobe_its_exponent_is_open_and_the_diffuse_weight_right() {
    for scan in [HEMISPHERE(10.0), Scan::InPlane { step_deg: 5.0 }] {
        for electrons in [0.0, 1e5] {
            let truth = material(&[0.3], &[0.0], 10.0);
            let m = measure(&truth, &Instrument { electrons, ..Instrument::default() }, &scan, 3);
            let got = solved(&m, &options("lambert+phong"));
            let open = undetermined(&got);
            println!("{scan}, {electrons:e}: {:?} {:?} {open:?}", parameters(&got), errors(&got));
            if electrons == 0.0 {
                assert!(rel(got.lobes[0].weight[0], 0.3) < 1e-12 && got.lobes[1].weight[0] < 1e-12, "{got:?}");
                assert!(open.contains(&"phong.exponent".to_owned()), "{open:?}");
            }
            assert_nothing_made_up(&got, &[0.3, 0.0], 1e-12, &format!("{scan}"));
            let says = record(&got).warnings.iter().any(|w| w.contains("do not determine"));
            assert_eq!(says, !open.is_empty(), "{:?}", record(&got).warnings);
        }
    }
}

/// At n → 0 the lobe is the diffuse one on the bright side of r·wo = 0: only the sum is known there.
#[test]
fn a_lobe_of_exponent_0_seen_from_its_bright_side_alone_is_told_from_the_diffuse_one_by_nobody() {
    for n in [0.0, 1e-6] {
        for scan in [HEMISPHERE(10.0), Scan::InPlane { step_deg: 5.0 }] {
            for electrons in [0.0, 1e6] {
                let bright = part_of(&scan, |wi, wo| cos_alpha(wi, wo) > 1e-6);
                let m = measure(
                    &material(&[0.3], &[0.2], n),
                    &Instrument { electrons, ..Instrument::default() },
                    &bright,
                    3,
                );
                let got = solved(&m, &options("lambert+phong"));
                // Seen as the value of the BRDF: kd/π + ks·2/(2π) = (kd + ks)/π.
                let (wi, wo) = (glam::DVec3::Z, glam::dvec3(0.6, 0.0, 0.8));
                let f = got.value(wi, wo)[0];
                let (open, e) = (undetermined(&got), errors(&got));
                println!("n {n:e} {scan} {electrons:e}: sum {f:e} {:?} {e:?} {open:?}", parameters(&got));
                // The search ends at n = 0.01, which bends a truth of 1e-6 by that much.
                let slack = if electrons == 0.0 { 1e-6 } else { 0.01 };
                assert!((f * std::f64::consts::PI / 0.5 - 1.0).abs() < slack, "{f} {got:?}");
                for name in ["lambert.weight[r]", "phong.weight[r]"] {
                    assert!(
                        open.contains(&name.to_owned()),
                        "n {n:e} {scan} {electrons:e}: {name} is not among {open:?}: {got:?}"
                    );
                }
                assert_nothing_made_up(&got, &[0.3, 0.2, n], 1e-9, "bright side");
            }
        }
    }
}

#[test]
fn with_both_sides_of_the_terminator_the_weights_at_exponent_0_are_known() {
    for n in [0.0, 1e-6, 1e-3] {
        let m = exact(&material(&[0.3], &[0.2], n), &HEMISPHERE(10.0));
        let got = solved(&m, &options("lambert+phong"));
        println!("n {n:e}: {:?} {:?} {}", parameters(&got), errors(&got), record(&got).status);
        assert_eq!(record(&got).status, "at-bound");
        assert!(rel(got.lobes[0].weight[0], 0.3) < 0.02 && rel(got.lobes[1].weight[0], 0.2) < 0.02, "{got:?}");
    }
}

#[test]
fn one_incidence_alone_gives_what_it_can() {
    for (theta, n) in [(0.0, 20.0), (45.0, 20.0), (45.0, 2000.0), (60.0, 1.0)] {
        for electrons in [0.0, 1e5] {
            let c = f64::to_radians(theta).cos();
            let scan = part_of(&HEMISPHERE(5.0), |wi, _| (wi.z - c).abs() < 1e-9);
            let m = measure(&material(&[0.3], &[0.2], n), &Instrument { electrons, ..Instrument::default() }, &scan, 2);
            let got = solved(&m, &options("lambert+phong"));
            println!(
                "θi {theta} n {n} {electrons:e}: {:?} {:?} {:?}",
                parameters(&got),
                errors(&got),
                undetermined(&got)
            );
            assert_nothing_made_up(&got, &[0.3, 0.2, n], 1e-9, &format!("θi {theta}, n {n}"));
            if electrons == 0.0 && n < 100.0 {
                assert!(worst(&got, &material(&[0.3], &[0.2], n)) < 1e-9, "{got:?}");
                assert!(undetermined(&got).is_empty(), "{got:?}");
            }
        }
    }
}

#[test]
fn samples_far_from_the_peak_alone_give_the_diffuse_weight_and_no_lobe() {
    for n in [1e3, 1e5] {
        for electrons in [0.0, 1e5] {
            let scan = part_of(&HEMISPHERE(7.5), |wi, wo| cos_alpha(wi, wo) < 0.3);
            let m = measure(&material(&[0.3], &[0.2], n), &Instrument { electrons, ..Instrument::default() }, &scan, 2);
            let got = solved(&m, &options("lambert+phong"));
            println!("n {n:e} {electrons:e}: {:?} {:?} {:?}", parameters(&got), errors(&got), undetermined(&got));
            if electrons == 0.0 {
                assert!(rel(got.lobes[0].weight[0], 0.3) < 1e-9, "{got:?}");
                assert!(undetermined(&got).contains(&"phong.exponent".to_owned()), "{got:?}");
            }
            assert_nothing_made_up(&got, &[0.3, 0.2, n], 1e-9, &format!("n {n:e}, {electrons:e} electrons"));
        }
    }
}

#[test]
fn fewer_samples_than_parameters_are_answered_without_a_made_up_number() {
    let truth = material(&[0.3], &[0.2], 20.0);
    let mut failures = Vec::new();
    for count in 1..=4 {
        for first in [0usize, 40, 170, 333] {
            for electrons in [0.0, 1e5] {
                for model in ["lambert", "phong", "lambert+phong", "lambert+phong+phong"] {
                    for robust in robusts() {
                        let (directions, weights) = HEMISPHERE(15.0).directions().expect("small");
                        let chosen: Vec<usize> = (0..count).map(|k| (first + 7 * k) % directions.len()).collect();
                        let scan = picked(&directions, &weights, &chosen);
                        let m = measure(&truth, &Instrument { electrons, ..Instrument::default() }, &scan, 2);
                        let o = goniofit::fit::FitOptions { robust, max_angle_deg: 90.0, ..options(model) };
                        let case = format!("{count} samples from {first}, {model}, {electrons:e}, {robust:?}");
                        let got = match goniofit::fit::fit(&m, &o) {
                            Ok(_) => solved(&m, &o),
                            Err(e) => {
                                failures.push(format!("{case}: {e}"));
                                continue;
                            }
                        };
                        let k = parameters(&got).len();
                        let open = errors(&got).iter().filter(|e| e.is_none()).count();
                        if count < k && open == 0 {
                            failures.push(format!(
                                "{case}: {k} parameters, all stated: {:?} {:?}",
                                parameters(&got),
                                errors(&got)
                            ));
                        }
                        if model == "lambert+phong" {
                            failures
                                .extend(made_up(&got, &[0.3, 0.2, 20.0], 1e-6).map(|wrong| format!("{case}: {wrong}")));
                        }
                    }
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} cases:\n{}", failures.len(), failures.join("\n"));
}

/// Two places, one of them the peak, fix two weights whatever the exponent: all is open but what is held.
#[test]
fn a_held_weight_stays_known_where_the_samples_stand_at_too_few_places() {
    let two = part_of(&HEMISPHERE(20.0), |wi, wo| {
        [1.0, 20f64.to_radians().cos()].iter().any(|c| (cos_alpha(wi, wo) - c).abs() < 1e-9)
    });
    let m = measure(&material(&[0.3], &[0.2], 20.0), &Instrument::default(), &two, 3);
    let limits = vec![Limit::fixed("phong.weight=0.2").expect("a limit")];
    let got = solved(&m, &FitOptions { limits, ..options("lambert+phong") });
    let open = undetermined(&got);
    println!("{} samples, {:?} {:?} {open:?}", m.len(), parameters(&got), errors(&got));
    assert!(!open.contains(&"phong.weight[r]".to_owned()), "{open:?}");
    assert_eq!(errors(&got)[1], Some(0.0));
    assert!(open.contains(&"phong.exponent".to_owned()), "{open:?}");
}

/// A lobe so narrow that no sample beside the mirror direction sees it: noise there may ask for one exponent or another, but the data
/// know weight × exponent alone.
#[test]
fn a_lobe_seen_in_the_mirror_direction_alone_has_no_exponent() {
    let truth = material(&[0.01, 0.01, 0.01], &[0.75, 0.7, 0.6], 2e4);
    for use_sigma in [false, true] {
        for seed in 0..20 {
            let instrument = Instrument { electrons: 3e3, ..Instrument::default() };
            let m = measure(&truth, &instrument, &Scan::InPlane { step_deg: 5.0 }, seed);
            let got = solved(&m, &FitOptions { use_sigma, ..options("lambert+phong") });
            let held = |i: Option<(f64, f64)>, truth: f64| i.is_none_or(|(low, high)| (low..=high).contains(&truth));
            let weights = &record(&got).interval_95[1].weight;
            let sure = weights.iter().zip([0.75, 0.7, 0.6]).filter(|(i, truth)| !held(**i, *truth)).count();
            assert!(sure <= 1, "seed {seed} {use_sigma}: {weights:?}");
            assert!(
                undetermined(&got).iter().any(|name| name == "phong.exponent"),
                "seed {seed}: {:?}",
                undetermined(&got)
            );
        }
    }
}
