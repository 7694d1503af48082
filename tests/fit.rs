//! The fit against known truths.
#![allow(clippy::expect_used, clippy::panic)] // helpers of tests

use goniofit::brdf::{LobeKind, Material, PerChannel};
use goniofit::control::Control;
use goniofit::fit::{FitError, FitOptions, WeightMode, fit};
use goniofit::gonio::{Instrument, Scan, simulate};
use goniofit::measurement::{Measurement, Weights};

fn material(kd: &[f64], ks: &[f64], n: f64) -> Material {
    let channels = ["r", "g", "b"][..kd.len()].iter().map(|c| (*c).to_owned()).collect();
    Material::new(channels, vec![(LobeKind::Lambert, kd.to_vec(), vec![]), (LobeKind::Phong, ks.to_vec(), vec![n])])
}

fn measure(truth: &Material, instrument: &Instrument, scan: &Scan, seed: u64) -> Measurement {
    let value = |wi, wo, out: &mut [f64]| {
        out.copy_from_slice(&truth.value(wi, wo));
        true
    };
    simulate("truth", &value, &truth.channels, instrument, scan, seed, Control::silent()).expect("a scan of usual size")
}

fn options(model: &str) -> FitOptions {
    FitOptions::new(model.parse().expect("a model"))
}

fn exponent(m: &Material, lobe: usize) -> f64 {
    m.lobes[lobe].shape_of(0).expect("a shape")[0]
}

#[test]
fn noise_free_materials_come_back_to_1e_6() {
    for n in [1.0, 3.0, 10.0, 100.0, 1e3, 1e4, 1e5] {
        for scan in [Scan::Merl, Scan::Hemisphere { step_deg: 5.0 }] {
            let truth = material(&[0.3, 0.2, 0.1], &[0.05, 0.3, 0.6], n);
            let m = measure(&truth, &Instrument::noiseless(), &scan, 1);
            let fitted = fit(&m, &options("lambert+phong")).expect("a fit");
            let got = &fitted.material;
            let rel = |a: f64, b: f64| (a / b - 1.0).abs();
            let worst = (0..3)
                .flat_map(|c| (0..2).map(move |l| (c, l)))
                .map(|(c, l)| rel(got.lobes[l].weight[c], truth.lobes[l].weight[c]))
                .fold(rel(exponent(got, 1), n), f64::max);
            println!("n {n:e}, {scan}: worst relative error {worst:.1e}, {:?}", fitted.stop);
            assert!(worst < 1e-6, "n {n}, {scan}: {worst:e} {got:?}");
        }
    }
}

#[test]
fn two_glossy_lobes_come_back_sorted() {
    let truth = Material::new(
        vec!["r".into()],
        vec![
            (LobeKind::Lambert, vec![0.3], vec![]),
            (LobeKind::Phong, vec![0.2], vec![900.0]),
            (LobeKind::Phong, vec![0.25], vec![12.0]),
        ],
    );
    let m = measure(&truth, &Instrument::noiseless(), &Scan::Hemisphere { step_deg: 4.0 }, 1);
    let got = fit(&m, &options("lambert+phong+phong")).expect("a fit").material;
    assert!((exponent(&got, 1) / 12.0 - 1.0).abs() < 1e-5, "{got:?}");
    assert!((exponent(&got, 2) / 900.0 - 1.0).abs() < 1e-5, "{got:?}");
    assert!((got.lobes[1].weight[0] / 0.25 - 1.0).abs() < 1e-5);
}

#[test]
fn the_flat_world_has_its_own_lobes() {
    let truth = Material::new(
        vec!["i".into()],
        vec![(LobeKind::Lambert2d, vec![0.4], vec![]), (LobeKind::Phong2d, vec![0.3], vec![40.0])],
    );
    let m = measure(&truth, &Instrument::noiseless(), &Scan::Flat { step_deg: 2.0 }, 1);
    let got = fit(&m, &options("lambert+phong")).expect("a fit").material;
    assert_eq!(got.model(), "lambert2d+phong2d");
    assert!((exponent(&got, 1) / 40.0 - 1.0).abs() < 1e-9, "{got:?}");
    assert!((got.lobes[0].weight[0] / 0.4 - 1.0).abs() < 1e-9);
}

/// How often of 200 seeds the 95 % intervals of kd, ks and n hold the truth.
fn held_of_200(stated_sigma: bool) -> [i32; 3] {
    let truth = material(&[0.3], &[0.2], 40.0);
    let mut held = [0; 3];
    for seed in 0..200 {
        let instrument = Instrument { electrons: 1e4, ..Instrument::default() };
        let mut m = measure(&truth, &instrument, &Scan::Hemisphere { step_deg: 10.0 }, seed);
        m.sigma = m.sigma.filter(|_| stated_sigma);
        let record = fit(&m, &options("lambert+phong")).expect("a fit").material.fit.expect("a record");
        let inside = |i: Option<(f64, f64)>, truth: f64| i32::from(i.is_some_and(|(a, b)| a <= truth && truth <= b));
        held[0] += inside(record.interval_95[0].weight[0], 0.3);
        held[1] += inside(record.interval_95[1].weight[0], 0.2);
        let PerChannel::Shared(interval) = record.interval_95[1].shape[0].1 else { panic!("one exponent") };
        held[2] += inside(interval, 40.0);
    }
    println!("held {held:?} of 200");
    held
}

/// With 200 seeds a 95 % interval that is right holds the truth 177 to 199 times (probability 0.998 by the binomial).
#[test]
fn the_truth_lies_in_the_95_percent_interval_177_to_199_times_of_200() {
    let held = held_of_200(true);
    assert!(held.iter().all(|h| (177..=199).contains(h)), "{held:?}");
}

#[test]
fn without_stated_sigma_the_residuals_give_the_interval() {
    let held = held_of_200(false);
    assert!(held.iter().all(|h| (177..=199).contains(h)), "{held:?}");
}

#[test]
fn a_lobe_without_weight_has_no_shape_and_says_so() {
    let truth = material(&[0.3, 0.5], &[0.0, 0.0], 10.0);
    let m = measure(&truth, &Instrument::noiseless(), &Scan::Hemisphere { step_deg: 10.0 }, 1);
    let got = fit(&m, &options("lambert+phong")).expect("a fit").material;
    assert!((got.lobes[0].weight[1] / 0.5 - 1.0).abs() < 1e-12);
    assert_eq!((&got.lobes[1].weight, &got.lobes[1].shape), (&vec![0.0, 0.0], &None), "{got:?}");
    let record = got.fit.as_ref().expect("a record");
    assert!(record.undetermined.contains(&"phong.exponent".to_owned()), "{:?}", record.undetermined);
    assert_eq!(record.status, "converged");
}

/// Small tables of every kind: few samples, any weights, noise of any size.
fn small_tables() -> impl Iterator<Item = Measurement> {
    (0..40u64).map(|k| {
        let n = [0.5, 5.0, 50.0, 5000.0][k as usize % 4];
        let truth = material(&[0.3 * (k % 3) as f64], &[0.2 * (k % 5) as f64], n);
        let electrons = [0.0, 1e2, 1e4, 1e6][(k / 4) as usize % 4];
        let instrument = Instrument { electrons, ..Instrument::default() };
        let step = [9.0, 20.0, 45.0][k as usize % 3];
        let scan = if k % 2 == 0 { Scan::InPlane { step_deg: step } } else { Scan::Hemisphere { step_deg: step } };
        measure(&truth, &instrument, &scan, k)
    })
}

#[test]
fn a_model_with_more_lobes_never_fits_worse_and_every_result_reads_back() {
    let models = ["phong", "lambert+phong", "lambert+phong+phong", "lambert+phong+phong+phong"];
    for (k, m) in small_tables().enumerate() {
        let mut before = f64::INFINITY;
        for model in models {
            let got = fit(&m, &options(model)).expect("a fit").material;
            let rmse = got.fit.as_ref().expect("a record").rmse;
            // Where the smaller model is already exact, the larger one ends somewhere in a valley without noise.
            assert!(rmse <= before * (1.0 + 1e-6) + 1e-10, "table {k}, {model}: {rmse:e} after {before:e}");
            before = rmse;
            let text = got.to_json().expect("json");
            let back = Material::from_json(&text).unwrap_or_else(|e| panic!("table {k}, {model}: {e}\n{text}"));
            assert!(back.fit.is_some(), "table {k}, {model}: the record does not read back\n{text}");
        }
    }
}

#[test]
fn weights_and_values_of_any_size_give_the_same_fit() {
    let truth = material(&[0.3], &[0.2], 20.0);
    let plain = measure(&truth, &Instrument::noiseless(), &Scan::Hemisphere { step_deg: 15.0 }, 1);
    for (weight, scale) in [(1e308, 1.0), (1e-300, 1.0), (1.0, 1e-170), (1.0, 1e140), (5e-324, 1e-290)] {
        let mut m = measure(&truth, &Instrument::noiseless(), &Scan::Hemisphere { step_deg: 15.0 }, 1);
        m.weights = Weights::Column(vec![weight; m.len()]);
        m.values.iter_mut().for_each(|v| *v *= scale);
        let got = fit(&m, &options("lambert+phong")).expect("a fit").material;
        assert!((exponent(&got, 1) / 20.0 - 1.0).abs() < 1e-9, "weight {weight:e}, scale {scale:e}: {got:?}");
        assert!(
            (got.lobes[0].weight[0] / (0.3 * scale) - 1.0).abs() < 1e-9,
            "weight {weight:e}, scale {scale:e}: {got:?}"
        );
    }
    let mut huge = plain;
    huge.values.iter_mut().for_each(|v| *v *= 1e300);
    assert!(matches!(fit(&huge, &options("lambert")), Err(FitError::Overflow { .. })));
}

#[test]
fn all_zero_and_all_masked_are_answered() {
    let mut m =
        measure(&material(&[0.0], &[0.0], 10.0), &Instrument::noiseless(), &Scan::Hemisphere { step_deg: 15.0 }, 1);
    let got = fit(&m, &options("lambert+phong")).expect("a fit").material;
    assert_eq!(got.lobes[0].weight, [0.0]);
    assert_eq!(got.lobes[1].shape, None);
    let record = got.fit.expect("a record");
    assert_eq!(record.rmse, 0.0);
    assert!(record.undetermined.contains(&"phong.exponent".to_owned()), "{:?}", record.undetermined);
    m.values.iter_mut().for_each(|v| *v = f64::NAN);
    assert!(matches!(fit(&m, &options("lambert")), Err(FitError::NothingToFit { .. })));
}

fn fitted_by_threads(m: &Measurement, threads: usize) -> Material {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
    let mut got = pool.install(|| fit(m, &options("lambert+phong")).expect("a fit")).material;
    got.fit.as_mut().expect("a record").seconds = 0.0;
    got
}

/// A whole table of three channels without stated errors is folded line by line; where one channel has masks of its own the samples are
/// taken block by block.
#[test]
fn a_whole_merl_table_has_the_same_bits_from_any_number_of_threads() {
    let truth = material(&[0.3, 0.2, 0.1], &[0.05, 0.3, 0.6], 87.0);
    let mut m = measure(&truth, &Instrument::default(), &Scan::Merl, 3);
    m.sigma = None;
    let n = m.len();
    for masked in [false, true] {
        if masked {
            m.values[n..2 * n].iter_mut().step_by(1009).for_each(|v| *v = f64::NAN);
        }
        let json = |threads| fitted_by_threads(&m, threads).to_json().expect("json");
        let one = json(1);
        for threads in [2, 8] {
            assert_eq!(one, json(threads), "masked {masked}, {threads} threads");
        }
    }
}

#[test]
fn the_result_has_the_same_bits_from_any_number_of_threads_and_any_scale_of_the_data() {
    let truth = material(&[0.3, 0.2, 0.1], &[0.05, 0.3, 0.6], 87.0);
    let mut m = measure(&truth, &Instrument::default(), &Scan::Hemisphere { step_deg: 4.0 }, 3);
    let run = fitted_by_threads;
    let one = run(&m, 1);
    assert_eq!(one.to_json().expect("json"), run(&m, 2).to_json().expect("json"));
    assert_eq!(one.to_json().expect("json"), run(&m, 8).to_json().expect("json"));
    for scale in [1e-12, 1e12] {
        let kept = m.values.clone();
        m.values.iter_mut().for_each(|v| *v *= scale);
        let scaled = run(&m, 2);
        assert!((exponent(&scaled, 1) / exponent(&one, 1) - 1.0).abs() < 1e-11, "scale {scale:e}");
        m.values = kept;
    }
}

#[test]
fn the_angular_limit_is_inclusive_and_weights_may_be_uniform() {
    let m = measure(&material(&[0.3], &[0.1], 10.0), &Instrument::noiseless(), &Scan::Hemisphere { step_deg: 10.0 }, 1);
    let samples = |max: f64| {
        let o = FitOptions { max_angle_deg: max, ..options("lambert") };
        fit(&m, &o).expect("a fit").material.fit.expect("a record").samples
    };
    // Polar angles 0, 10 … max, 36 azimuths but for the pole.
    assert_eq!(samples(80.0), 9 * (1 + 8 * 36));
    assert_eq!(samples(79.9), 8 * (1 + 7 * 36));
    let uniform = FitOptions { weights: WeightMode::Uniform, ..options("lambert") };
    assert_eq!(fit(&m, &uniform).expect("a fit").material.fit.expect("a record").weights, "uniform");
    let wrong = FitOptions { max_angle_deg: 91.0, ..options("lambert") };
    assert!(fit(&m, &wrong).expect_err("out of range").to_string().contains("max-angle"));
}

#[test]
fn shared_error_components_widen_the_intervals() {
    let truth = material(&[0.3], &[0.2], 40.0);
    let mut m = measure(&truth, &Instrument::default(), &Scan::Hemisphere { step_deg: 10.0 }, 1);
    let error = |m: &Measurement| {
        let record = fit(m, &options("lambert+phong")).expect("a fit").material.fit.expect("a record");
        record.standard_error[0].weight[0].expect("determined")
    };
    let alone = error(&m);
    // A gain common to all readings, known to 2 %: the diffuse weight is uncertain by 2 % of itself on top.
    m.common = vec![m.values.iter().map(|v| 0.02 * v).collect()];
    let together = error(&m);
    assert!((together / alone.hypot(0.02 * 0.3) - 1.0).abs() < 0.02, "{alone} {together}");
}

#[test]
fn one_valid_channel_does_not_need_the_others() {
    let mut m = measure(
        &material(&[0.3, 0.2], &[0.1, 0.1], 20.0),
        &Instrument::noiseless(),
        &Scan::Hemisphere { step_deg: 10.0 },
        1,
    );
    let n = m.len();
    m.values[n..2 * n].iter_mut().for_each(|v| *v = f64::NAN);
    let got = fit(&m, &options("lambert+phong")).expect("a fit").material;
    assert!((got.lobes[0].weight[0] / 0.3 - 1.0).abs() < 1e-9);
    let record = got.fit.expect("a record");
    assert!(record.undetermined.contains(&"lambert.weight[g]".to_owned()), "{record:?}");
}

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config {
        cases: 64,
        rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        failure_persistence: None,
        ..Default::default()
    })]

    /// Whatever the weights and the exponent, data without noise give them back, from no start value.
    #[test]
    fn any_noise_free_material_comes_back(
        kd in 1e-3f64..1.0,
        ks in 1e-3f64..1.0,
        ln_n in 0.0f64..9.0,
        step in proptest::sample::select(vec![5.0, 7.5, 10.0]),
    ) {
        let truth = material(&[kd], &[ks], ln_n.exp());
        let m = measure(&truth, &Instrument::noiseless(), &Scan::Hemisphere { step_deg: step }, 1);
        let got = fit(&m, &options("lambert+phong")).expect("a fit").material;
        let worst = [
            got.lobes[0].weight[0] / kd,
            got.lobes[1].weight[0] / ks,
            exponent(&got, 1) / ln_n.exp(),
        ].into_iter().map(|r| (r - 1.0).abs()).fold(0.0, f64::max);
        proptest::prop_assert!(worst < 1e-9, "kd {kd}, ks {ks}, n {}: {worst:e}", ln_n.exp());
    }
}
