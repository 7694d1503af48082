//! Data at the edge of what is data: nothing there, nothing but noise, cut off, wrong in places, twice, over many decades.

use std::path::Path;

use goniofit::fit::{FitError, FitOptions, Limit, Loss, RobustKind, fit};
use goniofit::gonio::{Instrument, Scan};
use goniofit::measurement::formats::{self, ReadOptions};
use goniofit::measurement::{Directions, Measurement, Weights};
use goniofit::numeric::random::RngExt;

use crate::experiment::{Outliers, add_outliers};
use crate::support::*;

/// Every loss, plain and robust.
fn all_options(model: &str) -> Vec<FitOptions> {
    Loss::ALL
        .into_iter()
        .flat_map(|loss| robusts().map(|robust| FitOptions { loss, robust, ..options(model) }))
        .collect()
}

fn named(o: &FitOptions) -> String {
    format!("{} {:?}", o.loss.name(), o.robust.map(|r| r.kind))
}

#[test]
fn all_zero_is_a_black_material_by_every_loss() {
    let m = exact(&material(&[0.0, 0.0], &[0.0, 0.0], 10.0), &HEMISPHERE(20.0));
    let mut failures = Vec::new();
    for o in all_options("lambert+phong") {
        let got = match fit(&m, &o) {
            Ok(fitted) => fitted.material,
            Err(e) => {
                failures.push(format!("{}: {e}", named(&o)));
                continue;
            }
        };
        let black = got.lobes.iter().flat_map(|l| &l.weight).all(|w| *w == 0.0) && got.lobes[1].shape.is_none();
        let r = record(&got);
        let open = undetermined(&got).contains(&"phong.exponent".to_owned());
        if !(black && open && r.cost == 0.0 && r.rmse == 0.0 && r.status == "converged") {
            failures.push(format!("{}: {got:?}", named(&o)));
        }
    }
    assert!(failures.is_empty(), "{} cases:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn all_masked_is_refused_with_the_counts() {
    let mut m = exact(&material(&[0.3, 0.2], &[0.1, 0.1], 10.0), &HEMISPHERE(10.0));
    m.values.fill(f64::NAN);
    for o in all_options("lambert+phong") {
        let error = fit(&m, &o).expect_err("nothing to fit");
        // θi and θo of 0, 10 … 80 degrees, 36 azimuths but for the pole: all lie within 80°.
        let counts = matches!(
            error,
            FitError::NothingToFit { entries: 2601, below: 0, beyond: 0, masked: 2601, weightless: 0, .. }
        );
        assert!(counts, "{}: {error:?}", named(&o));
        assert!(error.to_string().contains("2601 are masked"), "{error}");
    }
}

/// Values that are noise about 0, half of them negative: data, not masked, and no light is made of them.
#[test]
fn noise_about_0_is_data_and_no_reflectance_is_made_of_it() {
    for (seed, kd) in [(1, 0.0), (2, 1e-3)] {
        let mut m = exact(&material(&[kd], &[0.0], 10.0), &HEMISPHERE(20.0));
        let mut rng = draws(seed);
        m.values.iter_mut().for_each(|v| *v += 0.02 * normal(&mut rng));
        let negative = m.values.iter().filter(|v| **v < 0.0).count();
        assert!(negative > m.len() / 3);
        for o in all_options("lambert+phong") {
            let got = solved(&m, &o);
            // θi and θo of 0, 20 … 80 degrees, 18 azimuths but for the pole: 5·(1 + 4·18).
            assert_eq!(record(&got).samples, 365, "{}", named(&o));
            if !matches!(o.loss, Loss::L2 | Loss::CosineL2 | Loss::Log) {
                continue; // the cube root and the relative loss are not centred where values are about 0
            }
            let total: f64 = got.lobes.iter().map(|l| l.weight[0]).sum();
            assert!(total < 0.1, "{}: {:?}", named(&o), parameters(&got));
            assert_nothing_made_up(&got, &[kd, 0.0], 1e-12, &named(&o));
            let alone = solved(&m, &FitOptions { model: "lambert".parse().expect("a model"), ..o.clone() });
            let (value, e) = (alone.lobes[0].weight[0], errors(&alone)[0].expect("determined"));
            println!("{} kd {kd:e}: {value:e} ± {e:e}", named(&o));
            // Within five standard errors; the logarithm bends by less than 0.02².
            assert!((value - kd).abs() < 5.0 * e + 0.02f64.powi(2), "{}: {value:e} ± {e:e}", named(&o));
            assert!(e < 4.0 * 0.02 * std::f64::consts::PI / 365f64.sqrt(), "{}: {e:e}", named(&o));
        }
    }
}

/// By stated σ, too, negative values are data: leaving them out would raise what is left.
#[test]
fn by_stated_sigma_negative_values_count_for_every_loss() {
    let instrument = Instrument { electrons: 1e3, ..Instrument::default() };
    let m = measure(&material(&[0.02], &[0.2], 20.0), &instrument, &HEMISPHERE(15.0), 3);
    let negative = m.values.iter().filter(|v| **v < 0.0).count();
    assert!(negative > 100, "{negative}");
    let mut failures = Vec::new();
    for loss in Loss::ALL {
        let plain = solved(&m, &FitOptions { loss, ..options("lambert+phong") });
        let got = solved(&m, &FitOptions { loss, use_sigma: true, ..options("lambert+phong") });
        let case = format!("{}: {} of {} samples", loss.name(), record(&got).samples, record(&plain).samples);
        println!("{case}, {negative} of {} negative, {:?}", m.len(), parameters(&got));
        if record(&got).samples != record(&plain).samples {
            failures.push(case);
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn values_too_negative_for_the_logarithm_are_left_out_and_said_so() {
    let mut m = exact(&material(&[0.3], &[0.2], 10.0), &HEMISPHERE(15.0));
    // θi = 0 comes first: cosθi·f is the value itself.
    m.values[3] = -1.0;
    m.values[5] = -7.0;
    m.values[7] = -0.5;
    let got = solved(&m, &FitOptions { loss: Loss::Log, ..options("lambert+phong") });
    let plain = record(&solved(&m, &options("lambert+phong"))).samples;
    assert_eq!(record(&got).samples, plain - 2);
    assert!(
        record(&got).warnings.iter().any(|w| w.starts_with("2 values are too negative")),
        "{:?}",
        record(&got).warnings
    );
}

/// A detector that saturates at a third of the peak: the plain fit says that the model does not describe the data, the peak masked gives the
/// truth, and Cauchy takes it for outliers.
#[test]
fn a_saturated_peak_is_warned_of_masked_or_seen_through() {
    let truth = material(&[0.3], &[0.2], 40.0);
    let ceiling = 0.3 / std::f64::consts::PI + 0.2 * 42.0 / std::f64::consts::TAU / 3.0;
    let instrument = Instrument { electrons: 1e6, ..Instrument::default() };
    let mut m = measure(&truth, &instrument, &HEMISPHERE(6.0), 3);
    let clipped = m.values.iter().filter(|v| **v > ceiling).count();
    m.values.iter_mut().for_each(|v| *v = v.min(ceiling));
    println!("{clipped} of {} values clipped", m.len());
    let plain = solved(&m, &options("lambert+phong"));
    let warnings = &record(&plain).warnings;
    println!("plain {:?} {warnings:?}", parameters(&plain));
    assert!(warnings.iter().any(|w| w.contains("does not describe these data")), "{warnings:?}");
    let cauchy = solved(&m, &FitOptions { robust: robust(RobustKind::Cauchy), ..options("lambert+phong") });
    let known = FitOptions {
        limits: vec![Limit::fixed("phong.exponent=40").expect("a limit")],
        robust: robust(RobustKind::Cauchy),
        ..options("lambert+phong")
    };
    let known = solved(&m, &known);
    println!("cauchy {:?}, off by {:.1e}", parameters(&cauchy), worst(&cauchy, &truth));
    println!(
        "scale {:?}, cost {:e}; n known: {:?}, scale {:?}, cost {:e}",
        record(&cauchy).robust_scale,
        record(&cauchy).cost,
        parameters(&known),
        record(&known).robust_scale,
        record(&known).cost
    );
    assert!(worst(&cauchy, &truth) < 0.01, "{:?}", parameters(&cauchy));
    m.values.iter_mut().filter(|v| **v >= ceiling).for_each(|v| *v = f64::NAN);
    let masked = solved(&m, &options("lambert+phong"));
    println!("masked {:?}, off by {:.1e}", parameters(&masked), worst(&masked, &truth));
    assert!(worst(&masked, &truth) < 0.01, "{:?}", parameters(&masked));
}

fn with_outliers(outliers: Outliers, seed: u64) -> Measurement {
    let instrument = Instrument { electrons: 3e5, ..Instrument::default() };
    let mut m = measure(&material(&[0.3], &[0.2], 40.0), &instrument, &HEMISPHERE(10.0), seed);
    add_outliers(&mut m, outliers, &mut draws(seed));
    m
}

#[test]
fn cauchy_sees_through_5_percent_of_gross_outliers_on_one_side_or_both() {
    let truth = material(&[0.3], &[0.2], 40.0);
    let mut failures = Vec::new();
    let losses = Loss::ALL.map(|loss| (loss, 1)).into_iter().chain((2..5).map(|seed| (Loss::CosineL2, seed)));
    for (loss, seed) in losses {
        for outliers in [Outliers::OneSided(0.05), Outliers::Symmetric(0.05)] {
            let m = with_outliers(outliers, seed);
            let off = |robust| worst(&solved(&m, &FitOptions { loss, robust, ..options("lambert+phong") }), &truth);
            let (plain, cauchy) = (off(None), off(robust(RobustKind::Cauchy)));
            let case =
                format!("{} seed {seed} {outliers:?}: plain off by {plain:.1e}, cauchy by {cauchy:.1e}", loss.name());
            println!("{case}");
            if !(cauchy < 0.01) {
                failures.push(case);
            }
            // The test bites: the plain fit does not stand it.
            assert!(plain > 0.01 || outliers != Outliers::OneSided(0.05) || loss != Loss::CosineL2, "{plain:e}");
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn huber_sees_through_5_percent_of_gross_outliers_on_both_sides() {
    let truth = material(&[0.3], &[0.2], 40.0);
    let mut failures = Vec::new();
    for seed in 1..5 {
        let m = with_outliers(Outliers::Symmetric(0.05), seed);
        let got = solved(&m, &FitOptions { robust: robust(RobustKind::Huber), ..options("lambert+phong") });
        let case = format!("seed {seed}: off by {:.1e}", worst(&got, &truth));
        println!("{case}");
        if !(worst(&got, &truth) < 0.01) {
            failures.push(case);
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// From 800/sr at the peak to 8·10⁻⁶/sr off it.
fn eight_decades() -> goniofit::brdf::Material {
    material(&[2.5e-5], &[0.5], 1e4)
}

#[test]
fn eight_decades_without_noise_come_back_by_every_loss() {
    let truth = eight_decades();
    // In the plane of incidence, where a step of half a degree resolves the lobe.
    let m = exact(&truth, &Scan::InPlane { step_deg: 0.5 });
    let (low, high) = m.values.iter().fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(*v), b.max(*v)));
    assert!(high / low > 0.99e8, "{low:e} {high:e}");
    let mut failures = Vec::new();
    for loss in Loss::ALL {
        let o = FitOptions { loss, ..options("lambert+phong") };
        let got = solved(&m, &o);
        let bound = f64::max(1e-9, 20.0 * crate::recovery::data_rounding(&m, &o, &parameters(&truth)));
        let case =
            format!("{}: off by {:.1e} of {bound:.1e}, {}", loss.name(), worst(&got, &truth), record(&got).status);
        println!("{case}");
        if !(worst(&got, &truth) <= bound) {
            failures.push(case);
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Each value off by 1 %, whatever its size: the relative loss is made for that and gives all parameters to a per cent; the logarithm of
/// 1 + f is linear for small f, so the peak's noise swamps the diffuse weight, which its interval says.
#[test]
fn eight_decades_with_noise_in_proportion_leave_the_small_part_known_to_the_relative_loss() {
    let truth = eight_decades();
    let mut m = exact(&truth, &Scan::InPlane { step_deg: 0.5 });
    let mut rng = draws(8);
    m.values.iter_mut().for_each(|v| *v *= 1.0 + 0.01 * normal(&mut rng));
    let relative = solved(&m, &FitOptions { loss: Loss::Relative, ..options("lambert+phong") });
    println!("relative {:?}", parameters(&relative));
    let log = solved(&m, &FitOptions { loss: Loss::Log, ..options("lambert+phong") });
    println!("log {:?} ± {:?}", parameters(&log), errors(&log));
    let plain = solved(&m, &FitOptions { loss: Loss::L2, ..options("lambert+phong") });
    println!("l2 {:?} ± {:?}", parameters(&plain), errors(&plain));
    assert_nothing_made_up(&relative, &[2.5e-5, 0.5, 1e4], 0.0, "relative");
    assert_nothing_made_up(&log, &[2.5e-5, 0.5, 1e4], 0.0, "log");
    assert_nothing_made_up(&plain, &[2.5e-5, 0.5, 1e4], 0.0, "l2");
    assert!(worst(&relative, &truth) < 0.01, "{:?}", parameters(&relative));
    let error = |m: &goniofit::brdf::Material| errors(m)[0].unwrap_or(f64::INFINITY);
    assert!(error(&log) < error(&plain), "log {:e}, l2 {:e}", error(&log), error(&plain));
}

/// Entries `chosen` of a table, in this order.
fn entries(m: &Measurement, chosen: &[usize]) -> Measurement {
    let (wi, wo) = chosen.iter().map(|&i| m.directions.pair(i)).unzip();
    let n = m.len();
    let pick = |v: &Vec<f64>| v.chunks(n).flat_map(|plane| chosen.iter().map(|&i| plane[i])).collect::<Vec<f64>>();
    Measurement {
        sigma: m.sigma.as_ref().map(pick),
        weights: Weights::SolidAngle(chosen.iter().map(|&i| m.weights.get(i)).collect()),
        ..Measurement::new("m", Directions::List { wi, wo }, m.channels.clone(), pick(&m.values))
    }
}

#[test]
fn every_sample_twice_is_the_same_fit_with_errors_smaller_by_the_root_of_2() {
    let m = measure(&material(&[0.3, 0.1], &[0.2, 0.3], 40.0), &Instrument::default(), &HEMISPHERE(15.0), 3);
    let once = entries(&m, &(0..m.len()).collect::<Vec<_>>());
    let twice = entries(&m, &(0..m.len()).chain(0..m.len()).collect::<Vec<_>>());
    for o in [
        options("lambert+phong"),
        FitOptions { loss: Loss::Log, ..options("lambert+phong") },
        FitOptions { robust: robust(RobustKind::Huber), ..options("lambert+phong") },
        FitOptions { robust: robust(RobustKind::Cauchy), loss: Loss::CubeRoot, ..options("lambert+phong") },
    ] {
        let (a, b) = (solved(&once, &o), solved(&twice, &o));
        let (r, s) = (record(&a), record(&b));
        println!("{}: off by {:.1e}, cost {:e} {:e}", named(&o), worst(&b, &a), r.cost, s.cost);
        assert!(worst(&b, &a) < 1e-9, "{}: {:e}", named(&o), worst(&b, &a));
        assert_eq!(s.samples, 2 * r.samples);
        let off = f64::max(rel(s.cost, 2.0 * r.cost), rel(s.rmse, r.rmse));
        assert!(off < 1e-8, "{}: {off:e}", named(&o));
        for (e, f) in errors(&a).into_iter().zip(errors(&b)) {
            // Where σ comes from the residuals, N/(N − p) of the small table is a little larger.
            let slack = if o.robust.is_some() { 5.0 / r.samples as f64 } else { 1e-6 };
            let ratio = e.expect("determined") / f.expect("determined");
            assert!((ratio / 2f64.sqrt() - 1.0).abs() < slack, "{}: {ratio}", named(&o));
        }
    }
}

#[test]
fn some_samples_twice_count_as_twice_their_weight() {
    let m = measure(&material(&[0.3], &[0.2], 40.0), &Instrument::default(), &HEMISPHERE(15.0), 3);
    let repeated = entries(&m, &(0..m.len()).chain((0..m.len()).step_by(3)).collect::<Vec<_>>());
    let mut heavier = entries(&m, &(0..m.len()).collect::<Vec<_>>());
    heavier.weights =
        Weights::SolidAngle((0..m.len()).map(|i| m.weights.get(i) * if i % 3 == 0 { 2.0 } else { 1.0 }).collect());
    for loss in Loss::ALL {
        let o = FitOptions { loss, ..options("lambert+phong") };
        let (a, b) = (solved(&repeated, &o), solved(&heavier, &o));
        println!("{}: off by {:.1e}", loss.name(), worst(&a, &b));
        assert!(worst(&a, &b) < 1e-9, "{}: {:e}", loss.name(), worst(&a, &b));
    }
}

#[test]
fn one_direction_a_hundred_times_gives_its_value_and_leaves_the_rest_open() {
    let m = measure(&material(&[0.3], &[0.2], 40.0), &Instrument::default(), &HEMISPHERE(15.0), 3);
    let m = entries(&m, &[700; 100]);
    let got = solved(&m, &options("lambert+phong"));
    let (wi, wo) = m.directions.pair(0);
    println!("{:?} {:?}", parameters(&got), undetermined(&got));
    assert!(rel(got.value(wi, wo)[0], m.values[0]) < 1e-9, "{got:?}");
    assert!(undetermined(&got).contains(&"phong.exponent".to_owned()), "{:?}", undetermined(&got));
    assert!(undetermined(&got).len() >= 2, "{:?}", undetermined(&got));
}

fn csv(m: &Measurement, cell: impl Fn(usize) -> String) -> Vec<u8> {
    let mut text = String::from("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r\n");
    for i in 0..m.len() {
        let (wi, wo) = m.directions.pair(i);
        let angles = |w: glam::DVec3| (w.truncate().length().atan2(w.z).to_degrees(), w.y.atan2(w.x).to_degrees());
        let ((ti, pi), (to, po)) = (angles(wi), angles(wo));
        text.push_str(&[ti, pi, to, po].map(|a| a.to_string()).join(","));
        text.push(',');
        text.push_str(&cell(i));
        text.push('\n');
    }
    text.into_bytes()
}

#[test]
fn one_nan_and_one_infinity_in_a_csv_file_are_masked_counted_and_do_no_harm() {
    let m = measure(&material(&[0.3], &[0.2], 20.0), &Instrument::default(), &HEMISPHERE(20.0), 3);
    for (nan, infinity) in [("nan", "inf"), ("NaN", "-inf"), ("NAN", "Infinity")] {
        let bytes = csv(&m, |i| match i {
            11 => nan.to_owned(),
            100 => infinity.to_owned(),
            _ => m.values[i].to_string(),
        });
        let table = formats::read_bytes(Path::new("hurt.csv"), bytes, &ReadOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((table.masked.not_finite, table.masked.marked), (2, 0), "{:?}", table.masked);
        let place = table.masked.first_not_finite.as_deref().unwrap_or_default();
        // The header is line 1, entry 11 line 13.
        assert!(place.contains("13"), "{place}");
        let whole = entries(&m, &(0..m.len()).filter(|i| *i != 11 && *i != 100).collect::<Vec<_>>());
        let uniform = Measurement { weights: Weights::Uniform, sigma: None, ..whole };
        let (a, b) = (solved(&table, &options("lambert+phong")), solved(&uniform, &options("lambert+phong")));
        assert_eq!(record(&a).samples, record(&b).samples);
        assert!(worst(&a, &b) < 1e-9, "{:e}", worst(&a, &b));
    }
}

fn copy(m: &Measurement) -> Measurement {
    entries(m, &(0..m.len()).collect::<Vec<_>>())
}

/// All entries but one.
fn without(m: &Measurement, place: usize) -> Measurement {
    entries(m, &(0..m.len()).filter(|i| *i != place).collect::<Vec<_>>())
}

/// NaN is how a table says masked. An infinity is no value, and files mask it: in code it is refused by its size, but for −∞ under the
/// logarithm, which is left out like any value too negative for it.
#[test]
fn one_nan_in_a_table_made_in_code_is_masked_and_one_infinity_refused() {
    let whole = measure(&material(&[0.3], &[0.2], 20.0), &Instrument::default(), &HEMISPHERE(20.0), 3);
    let others = without(&whole, 17);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for o in all_options("lambert+phong") {
            let mut m = copy(&whole);
            m.values[17] = bad;
            let case = format!("{bad} {}", named(&o));
            let too_negative = bad == f64::NEG_INFINITY && o.loss == Loss::Log;
            if !bad.is_nan() && !too_negative {
                let error = fit(&m, &o).expect_err(&case);
                let refused = matches!(error, FitError::Overflow { largest, .. } if largest == f64::INFINITY);
                assert!(refused, "{case}: {error}");
                continue;
            }
            let (got, want) = (solved(&m, &o), solved(&others, &o));
            assert_eq!(record(&got).samples, record(&want).samples, "{case}");
            assert!(worst(&got, &want) < 1e-8, "{case}: {:e}", worst(&got, &want));
            let said = record(&got).warnings.iter().any(|w| w.starts_with("1 values are too negative"));
            assert_eq!(said, too_negative, "{case}: {:?}", record(&got).warnings);
        }
    }
}

/// Where σ weighs the samples, one without a usable σ has no weight; where it does not, the value counts as ever, and its residual tells its
/// error.
#[test]
fn one_sigma_that_is_not_finite_or_not_positive_leaves_the_rest_as_it_is() {
    let mut rng = draws(4);
    let whole = measure(&material(&[0.3], &[0.2], 20.0), &Instrument::default(), &HEMISPHERE(20.0), 3);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0] {
        let mut m = copy(&whole);
        let place = rng.random_range(0..m.len());
        m.sigma.as_mut().expect("sigma")[place] = bad;
        let plain = options("lambert+phong");
        let weighted = FitOptions { use_sigma: true, ..plain.clone() };
        for (o, like) in [(plain, copy(&whole)), (weighted, without(&whole, place))] {
            let (got, want) = (solved(&m, &o), solved(&like, &o));
            let case = format!("{bad} at {place}, use_sigma {}", o.use_sigma);
            assert_eq!(record(&got).samples, record(&want).samples, "{case}");
            assert!(worst(&got, &want) < 1e-9, "{case}: {:?}, not {:?}", parameters(&got), parameters(&want));
            for (a, b) in errors(&got).into_iter().zip(errors(&want)) {
                let (a, b) = (a.expect("determined"), b.expect("determined"));
                assert!(rel(a, b) < 0.2, "{case}: {a:e}, not {b:e}");
            }
        }
    }
}
