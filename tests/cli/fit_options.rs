//! Options of `fit`: what they change, and that the file says so.

use serde_json::{Value, json};

use std::fmt::Write as _;

use crate::bench::{Bench, csv, fixture, keys, number};

#[test]
fn the_angular_limit_is_inclusive_and_counts_as_by_hand() {
    let b = Bench::new();
    b.paint("p.csv");
    // Polar angles 0°, 10° … limit; 36 azimuths of wo but for the pole.
    for (limit, rings) in [("80", 9), ("60", 7), ("59.9", 6), ("10", 2)] {
        let fit = b.json(&["fit", "p.csv", "--model", "lambert", "--max-angle", limit]);
        assert_eq!(fit["fit"]["samples"], rings * (1 + (rings - 1) * 36), "limit {limit}");
    }
}

#[test]
fn loss_and_weights_are_recorded_and_change_the_answer() {
    let b = Bench::new();
    b.paint("p.csv");
    let mut seen = Vec::new();
    for loss in ["cosine-l2", "l2"] {
        for weights in ["solid-angle", "uniform"] {
            let fit = b.json(&["fit", "p.csv", "--model", "lambert", "--loss", loss, "--weights", weights]);
            assert_eq!(fit["fit"]["loss"], loss);
            assert_eq!(fit["fit"]["weights"], weights);
            seen.push(number(&fit["lobes"][0]["weight"][0]));
        }
    }
    for (i, a) in seen.iter().enumerate() {
        assert!(seen[..i].iter().all(|b| (a / b - 1.0).abs() > 1e-3), "{seen:?}");
    }
}

/// The weights of a fit, lobe by lobe, channel by channel.
fn weights(fit: &Value) -> Vec<f64> {
    let lobes = fit["lobes"].as_array().expect("lobes");
    lobes.iter().flat_map(|l| l["weight"].as_array().expect("weights")).map(number).collect()
}

fn exponent(fit: &Value, lobe: usize) -> f64 {
    number(&fit["lobes"][lobe]["shape"]["exponent"])
}

/// A lambertian of weight 0.3 with a phong lobe of weight 0.2 and exponent 40, on a hemisphere grid, without noise.
fn glossy(b: &Bench, name: &str) {
    let material = json!({ "format": "goniofit-material", "version": 1, "model": "lambert+phong", "channels": ["r"],
        "lobes": [ { "kind": "lambert", "weight": [0.3] },
                   { "kind": "phong", "weight": [0.2], "shape": { "exponent": 40.0 } } ] });
    b.write("glossy.json", material.to_string());
    b.ok(&["convert", "glossy.json", name, "--scan", "hemisphere:10"]);
}

#[test]
fn every_loss_recovers_what_was_put_in_and_is_recorded() {
    let b = Bench::new();
    glossy(&b, "g.csv");
    b.paint("p.csv");
    let mut seen: Vec<f64> = Vec::new();
    for loss in ["l2", "cosine-l2", "log", "cuberoot", "relative"] {
        let exact = b.json(&["fit", "g.csv", "--loss", loss]);
        assert_eq!(exact["fit"]["loss"], loss);
        for (got, want) in weights(&exact).iter().chain([&exponent(&exact, 1)]).zip([0.3, 0.2, 40.0]) {
            assert!((got / want - 1.0).abs() < 1e-6, "{loss}: {got} vs {want}");
        }
        // ε of the relative loss is told, and of no other.
        assert_eq!(exact["fit"]["relative_epsilon"].is_array(), loss == "relative", "{loss}");
        let lambert = b.json(&["fit", "p.csv", "--model", "lambert", "--loss", loss]);
        seen.push(weights(&lambert)[0]);
    }
    for (i, a) in seen.iter().enumerate() {
        assert!(seen[..i].iter().all(|b| (a / b - 1.0).abs() > 1e-4), "each loss has its own answer: {seen:?}");
    }
}

#[test]
fn a_robust_loss_lets_outliers_go_and_records_its_scale() {
    let b = Bench::new();
    let mut rows = Vec::new();
    for i in 0..200 {
        // A lambertian of weight 0.1 π with a little ripple, every twentieth reading ten times too high.
        let ripple = 1e-3 * f64::from(i).sin();
        let value = if i % 20 == 7 { 1.0 } else { 0.1 + ripple };
        rows.push((f64::from(i % 8) * 10.0, f64::from(i / 8 % 8) * 10.0, f64::from(i) * 1.7, value));
    }
    b.write("o.csv", csv(&rows));
    let truth = 0.1 * std::f64::consts::PI;
    let off = |extra: &[&str]| {
        let fit = b.json(&[&["fit", "o.csv", "--model", "lambert"], extra].concat());
        ((weights(&fit)[0] / truth - 1.0).abs(), fit["fit"].clone())
    };
    let (plain, record) = off(&[]);
    assert!(plain > 0.3 && record.get("robust").is_none(), "{plain}: {record}");
    for (robust, recorded, within) in
        [("huber", "huber:1.345", 3e-3), ("cauchy", "cauchy:2.385", 1e-3), ("cauchy:1", "cauchy:1", 1e-3)]
    {
        let (error, record) = off(&["--robust", robust]);
        assert!(error < within, "{robust}: off by {error}, the plain fit by {plain}");
        assert_eq!(record["robust"], recorded);
        let s = number(&record["robust_scale"][0]);
        assert!(s > 1e-4 && s < 1e-2, "{robust}: s = {s}, the ripple is 1e-3");
    }
}

#[test]
fn stated_sigmas_weigh_by_their_inverse_square() {
    let b = Bench::new();
    let mut text = String::from("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,sigma_r\n");
    let (mut above, mut below) = (0.0, 0.0);
    for (theta_o, value, sigma) in [(10.0, 0.10, 0.01), (20.0, 0.14, 0.02), (30.0, 0.20, 0.04)] {
        writeln!(text, "30,180,{theta_o},0,{value},{sigma}").expect("writes");
        above += value / (sigma * sigma);
        below += 1.0 / (sigma * sigma);
    }
    b.write("s.csv", text);
    let fit = b.json(&["fit", "s.csv", "--model", "lambert", "--use-sigma", "--loss", "l2"]);
    let want = std::f64::consts::PI * above / below;
    assert!((weights(&fit)[0] / want - 1.0).abs() < 1e-12, "{} vs {want}", weights(&fit)[0]);
    assert_eq!(fit["fit"]["weights"], "sigma");
    // σ of the mean: 1/√Σσ⁻², times π.
    let error = number(&fit["fit"]["standard_error"][0]["weight"][0]);
    assert!((error / (std::f64::consts::PI / f64::sqrt(below)) - 1.0).abs() < 1e-9, "{error}");
}

#[test]
fn a_stride_takes_every_nth_entry() {
    let b = Bench::new();
    b.write("five.csv", csv(&[1.0, 2.0, 3.0, 4.0, 5.0].map(|k| (30.0, 10.0 * k, 0.0, 0.1 * k))));
    for (stride, samples, mean) in [("1", 5, 0.3), ("2", 3, 0.3), ("3", 2, 0.25), ("9", 1, 0.1)] {
        let fit = b.json(&["fit", "five.csv", "--model", "lambert", "--stride", stride]);
        assert_eq!(fit["fit"]["samples"], samples, "stride {stride}");
        let want = std::f64::consts::PI * mean;
        assert!((weights(&fit)[0] / want - 1.0).abs() < 1e-12, "stride {stride}: {}", weights(&fit)[0]);
    }
}

#[test]
fn channels_apart_have_shapes_of_their_own_written_as_arrays() {
    let b = Bench::new();
    let material = json!({ "format": "goniofit-material", "version": 1, "model": "phong", "channels": ["r", "g"],
        "lobes": [ { "kind": "phong", "weight": [0.3, 0.2], "shape": { "exponent": [10.0, 200.0] } } ] });
    b.write("two.json", material.to_string());
    b.ok(&["convert", "two.json", "two.csv", "--scan", "hemisphere:10"]);
    let fit = b.json(&["fit", "two.csv", "--model", "phong", "--per-channel"]);
    for (c, want) in [10.0, 200.0].iter().enumerate() {
        let got = number(&fit["lobes"][0]["shape"]["exponent"][c]);
        assert!((got / want - 1.0).abs() < 1e-6, "{got} vs {want}");
    }
    for list in ["standard_error", "interval_95"] {
        let exponent = &fit["fit"][list][0]["shape"]["exponent"];
        assert_eq!(exponent.as_array().map(Vec::len), Some(2), "{list}: {exponent}");
    }
    assert!(number(&fit["fit"]["rmse"]) < 1e-6);
    let shared = b.json(&["fit", "two.csv", "--model", "phong"]);
    assert!(shared["lobes"][0]["shape"]["exponent"].is_number() && number(&shared["fit"]["rmse"]) > 1e-3);
}

#[test]
fn fixed_parameters_stay_and_bounds_hold() {
    let b = Bench::new();
    glossy(&b, "g.csv");
    let fixed = b.json(&["fit", "g.csv", "--fix", "phong.exponent=50", "--fix", "lambert.weight[r]=0.25"]);
    assert!((exponent(&fixed, 1) / 50.0 - 1.0).abs() < 1e-14, "{}", exponent(&fixed, 1));
    assert!((weights(&fixed)[0] / 0.25 - 1.0).abs() < 1e-15, "{}", weights(&fixed)[0]);
    assert_eq!(fixed["fit"]["standard_error"][1]["shape"]["exponent"], 0.0, "what is fixed has no error");
    assert_eq!(fixed["fit"]["limits"], json!(["phong.exponent=50", "lambert.weight[r]=0.25"]));
    assert!(number(&fixed["fit"]["rmse"]) > 1e-4);

    let bounded = b.json(&["fit", "g.csv", "--bound", "phong.exponent=60..1e3"]);
    assert_eq!(bounded["fit"]["status"], "at-bound");
    assert!((exponent(&bounded, 1) / 60.0 - 1.0).abs() < 1e-12, "{}", exponent(&bounded, 1));
    // At the end of a range: no standard error, yet not undetermined; the interval reaches inwards, and print and warning say so.
    let record = &bounded["fit"];
    assert!(record["standard_error"][1]["shape"]["exponent"].is_null(), "{}", record["standard_error"]);
    assert!(record["standard_error"][1]["weight"][0].is_number(), "{}", record["standard_error"]);
    assert_eq!(record["undetermined"], json!([]));
    let warned = record["warnings"].to_string();
    assert!(warned.contains("phong.exponent ended at 60, the low end of the range that was asked for"), "{warned}");
    assert!(warned.contains("a smaller one") && warned.contains("an interval reaches"), "{warned}");
    let ends = &record["interval_95"][1]["shape"]["exponent"];
    let (low, high) = (number(&ends[0]), number(&ends[1]));
    assert!((low / 60.0 - 1.0).abs() < 1e-12 && high > 60.0 && high < 70.0, "{low} to {high}");
    let text = b.ok(&["fit", "g.csv", "--bound", "phong.exponent=60..1e3"]).text();
    assert!(text.contains("(at the end of its range)") && !text.contains("undetermined"), "{text}");
    let bounded = b.json(&["fit", "g.csv", "--bound", "phong.weight=..0.1"]);
    assert!((weights(&bounded)[1] / 0.1 - 1.0).abs() < 1e-12, "{}", weights(&bounded)[1]);
    // Bounds that the optimum lies within change nothing.
    let free = b.json(&["fit", "g.csv"]);
    let wide = b.json(&["fit", "g.csv", "--bound", "phong.exponent=1..1e4", "--bound", "lambert.weight=0..1"]);
    for (a, b) in weights(&wide).iter().zip(weights(&free)) {
        assert!((a / b - 1.0).abs() < 1e-9, "{a} vs {b}");
    }
}

#[test]
fn limits_name_the_second_lobe_of_a_kind() {
    let b = Bench::new();
    b.paint("p.csv"); // noise, so that the second lobe has a weight
    let fit = b.json(&["fit", "p.csv", "--model", "lambert+phong+phong", "--fix", "phong[1].exponent=7"]);
    assert!((exponent(&fit, 2) / 7.0 - 1.0).abs() < 1e-14, "{fit}");
    assert_eq!(fit["fit"]["limits"], json!(["phong[1].exponent=7"]));
}

#[test]
fn energy_is_conserved_on_request_and_a_fit_that_does_not_is_warned_of() {
    let b = Bench::new();
    let bright: Vec<_> = (0..24).map(|i| (30.0, f64::from(i % 8) * 10.0, f64::from(i / 8) * 60.0, 0.4)).collect();
    b.write("bright.csv", csv(&bright)); // a lambertian of weight 0.4 π = 1.26
    let free = b.json(&["fit", "bright.csv", "--model", "lambert"]);
    assert_eq!(free["fit"]["energy"]["conserved"], false);
    assert!(free["fit"]["warnings"].to_string().contains("--conserve-energy"), "{}", free["fit"]["warnings"]);
    let held = b.json(&["fit", "bright.csv", "--model", "lambert", "--conserve-energy"]);
    let energy = &held["fit"]["energy"];
    assert_eq!((&energy["conserved"], &energy["constrained"]), (&json!(true), &json!(true)));
    assert!((weights(&held)[0] - 1.0).abs() < 1e-12, "{held}");
    assert!(!held["fit"]["warnings"].to_string().contains("--conserve-energy"));
}

/// A measurement that is large enough to be thinned out.
fn large(b: &Bench) {
    let scan = ["--scan", "hemisphere:5", "--seed", "3", "--out", "large.csv"];
    b.ok(&[&["simulate", "--material", "glossy-paint"], &scan[..]].concat());
}

#[test]
fn a_target_is_met_by_a_part_of_the_samples() {
    let b = Bench::new();
    large(&b);
    let all = b.json(&["fit", "large.csv"]);
    assert!(all["fit"].get("subset").is_none(), "all samples, nothing to say");
    let part = b.json(&["fit", "large.csv", "--target-rmse-excess", "2%"]);
    let subset = &part["fit"]["subset"];
    assert_eq!(keys(subset), ["samples", "of", "rmse_excess", "rmse_excess_95"]);
    assert_eq!(part["fit"]["status"], "converged");
    assert!(number(&subset["rmse_excess_95"]) <= 0.02, "{subset}");
    assert!(number(&part["fit"]["samples"]) < 0.5 * number(&all["fit"]["samples"]), "{subset}");
    let z = (exponent(&part, 1) - exponent(&all, 1)) / number(&part["fit"]["standard_error"][1]["shape"]["exponent"]);
    assert!(z.abs() < 4.0, "{z} standard errors apart");
    assert_eq!(part, {
        let mut again = b.json(&["fit", "large.csv", "--target-rmse-excess", "0.02"]);
        again["fit"]["seconds"] = part["fit"]["seconds"].clone();
        again
    });
}

#[test]
fn a_budget_ends_the_work_and_says_what_that_costs() {
    let b = Bench::new();
    large(&b);
    let fit = b.json(&["fit", "large.csv", "--time-budget", "1us"]);
    assert_eq!(fit["fit"]["status"], "budget");
    let subset = &fit["fit"]["subset"];
    assert!(number(&subset["samples"]) < number(&subset["of"]), "{subset}");
    assert!(fit["fit"]["warnings"].to_string().contains("the time ended"), "{}", fit["fit"]["warnings"]);
    let ample = b.json(&["fit", "large.csv", "--time-budget", "10min"]);
    assert_eq!(ample["fit"]["status"], "converged");
    assert!(ample["fit"].get("subset").is_none(), "all samples were used");
}

#[test]
fn a_bootstrap_is_drawn_from_the_samples_that_a_budget_or_target_ended_with() {
    let b = Bench::new();
    large(&b);
    for (option, value) in [("--target-rmse-excess", "2%"), ("--time-budget", "1us")] {
        let fit = b.json(&["fit", "large.csv", option, value, "--bootstrap", "30"]);
        assert!(fit["fit"]["subset"].is_object(), "{option}: a part of the samples");
        let error = |of: &Value, lobe: usize| {
            let record = &of["standard_error"][lobe];
            [number(&record["weight"][0]), record["shape"]["exponent"].as_f64().unwrap_or(f64::NAN)]
        };
        let (drawn, known) = (error(&fit["fit"]["bootstrap"], 1), error(&fit["fit"], 1));
        // A standard deviation of 30 drawings scatters by 1/√58 = 13 %.
        for (drawn, known) in drawn.iter().zip(known) {
            assert!((0.4..2.5).contains(&(drawn / known)), "{option}: {drawn} vs {known}");
        }
    }
}

#[test]
fn channels_apart_are_all_fitted_within_a_budget() {
    let b = Bench::new();
    large(&b);
    let fit = b.json(&["fit", "large.csv", "--per-channel", "--time-budget", "1us", "--bootstrap", "2"]);
    assert_eq!(fit["fit"]["status"], "budget");
    let exponents = fit["lobes"][1]["shape"]["exponent"].as_array().expect("one a channel");
    assert!(exponents.iter().all(|n| (number(n) / 90.0 - 1.0).abs() < 0.05), "{exponents:?}");
    let drawn = fit["fit"]["bootstrap"]["standard_error"][1]["shape"]["exponent"].as_array().expect("one a channel");
    assert!(drawn.len() == 3 && drawn.iter().all(Value::is_number), "{drawn:?}");
}

#[test]
fn a_bootstrap_agrees_with_the_analytic_errors_and_depends_on_its_seed_alone() {
    let b = Bench::new();
    b.paint("p.csv");
    let redrawn =
        |seed: &str| b.json(&["fit", "p.csv", "--bootstrap", "50", "--seed", seed])["fit"]["bootstrap"].clone();
    let first = redrawn("1");
    assert_eq!(first, redrawn("1"));
    assert_ne!(first, redrawn("2"));
    assert_eq!(first["replicates"], 50);
    let analytic = &b.json(&["fit", "p.csv"])["fit"];
    assert!(analytic.get("bootstrap").is_none());
    // A standard deviation of 50 drawings scatters by 1/√98 = 10 %; both σ are of the same noise, whose size varies over the table.
    let ratio = number(&first["standard_error"][1]["shape"]["exponent"])
        / number(&analytic["standard_error"][1]["shape"]["exponent"]);
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_model_is_chosen_on_request_and_the_comparison_shown() {
    let b = Bench::new();
    b.paint("p.csv");
    let ran = b.ok(&["fit", "p.csv", "--model", "auto", "--out", "a.json"]);
    let fit = b.json_file("a.json");
    assert_eq!(fit["model"], "lambert+phong", "what the paint was made of");
    let choice = &fit["fit"]["choice"];
    assert_eq!(keys(choice), ["chosen", "reason", "candidates"]);
    assert_eq!(choice["chosen"], "lambert+phong");
    let candidates = choice["candidates"].as_array().expect("a list");
    assert!(candidates.len() >= 4);
    for candidate in candidates {
        assert_eq!(keys(candidate), ["model", "parameters", "rmse", "held_out_rmse", "aicc", "bic"]);
        let model = candidate["model"].as_str().expect("a name");
        assert!(
            ran.text().lines().any(|l| l.trim_start_matches('*').trim_start().starts_with(&format!("{model} "))),
            "{model}"
        );
    }
    assert!(ran.text().lines().any(|l| l.starts_with("* lambert+phong ")), "{}", ran.text());
    // The fit is that of the model asked for by name.
    assert_eq!(fit["lobes"], b.json(&["fit", "p.csv"])["lobes"]);
}

#[test]
fn a_limit_concerns_the_candidates_that_have_its_lobe() {
    let b = Bench::new();
    b.paint("p.csv");
    let ran = b.ok(&["fit", "p.csv", "--model", "auto", "--fix", "phong[1].exponent=4", "--out", "a.json"]);
    let fit = b.json_file("a.json");
    assert_eq!(fit["model"], "lambert+phong");
    let warned = fit["fit"]["warnings"].to_string();
    assert!(warned.contains("phong[1].exponent=4 limits nothing: lambert+phong has no such parameter"), "{warned}");
    assert_eq!(fit["lobes"], b.json(&["fit", "p.csv"])["lobes"]);
    assert!(ran.text().contains("limits nothing"), "{}", ran.text());
    let held = b.json(&["fit", "p.csv", "--model", "auto", "--fix", "phong.exponent=90"]);
    assert_eq!(held["fit"]["limits"], json!(["phong.exponent=90"]));
    assert_eq!(exponent(&held, 1), 90.0);
}

#[test]
fn the_table_of_models_says_what_it_was_computed_on() {
    let b = Bench::new();
    b.paint("p.csv");
    let plain = b.ok(&["fit", "p.csv", "--model", "auto"]).text();
    assert!(plain.contains("rmse and held out are in 1/sr\n"), "{plain}");
    let robust = b.ok(&["fit", "p.csv", "--model", "auto", "--robust", "huber"]).text();
    assert!(robust.contains("with one robust scale for all"), "{robust}");
    b.ok(&["simulate", "--material", "satin", "--scan", "hemisphere:4", "--seed", "1", "--out", "big.csv"]);
    let big = b.ok(&["fit", "big.csv", "--model", "auto", "--out", "big.json"]).text();
    let samples = b.json_file("big.json")["fit"]["choice"]["samples"].as_u64().expect("a count");
    assert!(samples < 40_000 && big.contains(&format!("of {samples} samples spread over the file")), "{big}");
}

#[test]
fn in_the_flat_world_models_are_compared_by_the_names_that_are_fitted() {
    let b = Bench::new();
    let file = fixture("measurements/in-plane-flat-world.csv");
    let fit = b.json(&["fit", &file, "--model", "auto", "--bound", "phong2d.exponent=1..1e3"]);
    assert_eq!(fit["fit"]["choice"]["chosen"], fit["model"]);
    assert_eq!(fit["fit"]["choice"]["candidates"][2]["model"], "lambert2d+phong2d");
    assert_eq!(fit["fit"]["limits"], json!(["phong2d.exponent=1..1000"]));
    let text = b.ok(&["fit", &file, "--loss", "cuberoot"]).text();
    assert!(text.contains(" rad^(-1/3),"), "{text}");
}

#[test]
fn residuals_are_printed_with_their_unit() {
    let b = Bench::new();
    b.paint("p.csv");
    for (loss, unit) in
        [("l2", " 1/sr,"), ("cosine-l2", " 1/sr,"), ("cuberoot", " sr^(-1/3),"), ("log", ","), ("relative", ",")]
    {
        let text = b.ok(&["fit", "p.csv", "--loss", loss, "--robust", "huber"]).text();
        let behind = text.split("rmse ").nth(1).expect("an rmse").trim_start_matches(|c: char| !" ,".contains(c));
        assert!(behind.starts_with(unit), "{loss}: {text}");
        let beyond = text.lines().find(|l| l.contains("residuals beyond")).expect("a line");
        assert!(beyond.contains(&format!("{} count less", unit.trim_end_matches(','))), "{loss}: {beyond}");
    }
}

#[test]
fn values_that_are_missing_and_channels_without_light_are_told() {
    let b = Bench::new();
    let rows =
        ["30,180,10,0,0.1,0", "30,180,20,0,,-0.1", "30,180,40,0,nan,0", "30,180,85,0,nan,0", "10,180,30,0,0.2,0"];
    b.write("m.csv", format!("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g\n{}\n", rows.join("\n")));
    let fit = b.json(&["fit", "m.csv", "--model", "lambert"]);
    let warned = fit["fit"]["warnings"].to_string();
    assert!(warned.contains("2 of 8 values are missing (NaN or masked in the file)"), "{warned}");
    assert!(warned.contains("channel g has no positive value") && !warned.contains("channel r"), "{warned}");
}

#[test]
fn the_log_ends_with_words() {
    let b = Bench::new();
    b.paint("p.csv");
    let ran = b.ok(&["fit", "p.csv", "--log"]);
    let last = ran.err.lines().find(|l| l.contains("stopped: ")).expect("a line");
    assert!(!last.contains('{') && last.split_whitespace().count() > 4, "{last}");
}

#[test]
fn what_is_printed_fits_on_a_page() {
    let b = Bench::new();
    b.paint("p.csv");
    for model in ["phong", "lambert+phong+phong", "auto"] {
        let text = b.ok(&["fit", "p.csv", "--model", model]).text();
        for line in text.lines() {
            assert!(line.chars().count() <= 80, "{model}: {line}");
        }
    }
}

#[test]
fn limits_and_wishes_that_can_not_be_met_exit_2_and_say_what_is_expected() {
    let b = Bench::new();
    b.paint("p.csv");
    b.write("plain.csv", csv(&[(30.0, 10.0, 0.0, 0.1), (30.0, 20.0, 0.0, 0.1)]));
    let table: [(&[&str], &[&str]); 31] = [
        (&["p.csv", "--fix", "phong.exponent"], &["--fix", "NAME=VALUE"]),
        (&["p.csv", "--fix", "phong.sharpness=2"], &["--fix", "sharpness"]),
        (&["p.csv", "--bound", "phong.exponent=5..1"], &["--bound", "5..1 is empty"]),
        (&["p.csv", "--bound", "phong.exponent=5"], &["--bound", "LOW..HIGH"]),
        (&["p.csv", "--bound", "ward.exponent=1..2"], &["--bound", "known are lambert"]),
        (&["p.csv", "--robust", "tukey"], &["--robust", "huber or cauchy"]),
        (&["p.csv", "--robust", "huber:0"], &["--robust", "huber"]),
        (&["p.csv", "--robust", "huber:1e-300"], &["--robust", "1e-3 to 1e6", "1e-300"]),
        (&["p.csv", "--robust", "cauchy:1e300"], &["--robust", "1e-3 to 1e6", "1e300"]),
        (
            &["p.csv", "--fix", "phong.exponent=1e9"],
            &["--fix phong.exponent", "up to 1e8", "searched ends", "found 1e9"],
        ),
        (
            &["p.csv", "--fix", "phong.exponent=50", "--bound", "phong.exponent=1..100"],
            &["--fix phong.exponent=50 and --bound phong.exponent=1..100", "one limit a parameter"],
        ),
        (
            &["missing.csv", "--bound", "lambert.weight=..1", "--bound", "lambert.weight[g]=..2"],
            &["--bound lambert.weight=0..1 and --bound lambert.weight[g]=0..2"],
        ),
        (
            &["p.csv", "--model", "auto", "--fix", "phong[3].exponent=5"],
            &["--fix phong[3].exponent", "a lobe of the model lambert+phong+phong+phong"],
        ),
        (&["p.csv", "--use-sigma", "--weights", "uniform"], &["--use-sigma", "--weights", "cannot be used"]),
        (&["p.csv", "--merl-angles", "center"], &["p.csv", "CSV", "--merl-angles"]),
        (&["p.csv", "--time-budget", "soon"], &["--time-budget", "2s"]),
        (&["p.csv", "--time-budget", "0"], &["--time-budget", "more than 0"]),
        (&["p.csv", "--time-budget", "0ms"], &["--time-budget", "more than 0"]),
        (&["p.csv", "--target-rmse-excess", "-1%"], &["--target-rmse-excess", "positive share"]),
        (&["p.csv", "--target-rmse-excess", "little"], &["--target-rmse-excess", "1%"]),
        (&["p.csv", "--bootstrap", "1"], &["--bootstrap", "2..=100000"]),
        (&["p.csv", "--seed", "1"], &["--bootstrap"]),
        (&["p.csv", "--stride", "0"], &["--stride: ", "at least 1"]),
        (&["plain.csv", "--use-sigma"], &["--use-sigma: ", "states sigma"]),
        (&["p.csv", "--max-angle", "100"], &["--max-angle: ", "(0, 90]"]),
        (&["p.csv", "--model", "phong2d"], &["--model: ", "not flat"]),
        (
            &["p.csv", "--model", "lambert", "--fix", "phong.exponent=5"],
            &["--fix phong.exponent", "a lobe of the model lambert"],
        ),
        (&["p.csv", "--fix", "phong[1].exponent=5"], &["--fix phong[1].exponent", "lambert+phong", "found phong[1]"]),
        (&["p.csv", "--bound", "lambert.weight[x]=0.5.."], &["--bound lambert.weight[x]", "r, g, b"]),
        (
            &["p.csv", "--bound", "phong.exponent=1e9.."],
            &["--bound phong.exponent", "meets 0.01..1e8, which is what is searched", "found 1e9.."],
        ),
        (
            &["p.csv", "--conserve-energy", "--bound", "lambert.weight=0.9..", "--bound", "phong.weight=0.5.."],
            &["--conserve-energy: ", "channel r", "1.4", "energy conservation", "--bound"],
        ),
    ];
    for (args, says) in table {
        let ran = b.run(&[&["fit"], args].concat());
        assert_eq!(ran.code, Some(2), "{args:?}: {} {}", ran.text(), ran.err);
        assert!(ran.out.is_empty(), "{args:?}: {}", ran.text());
        for say in says {
            assert!(ran.err.contains(say), "{args:?}: {} lacks {say}", ran.err);
        }
    }
}

#[test]
fn the_loss_of_a_lambertian_has_the_closed_form() {
    // One weight w: Σ c² (w/π − f)² is least at w = π Σ c² f / Σ c², with c = cosθi for cosine-l2 and 1 for l2.
    let rows = [(0.0, 10.0, 0.0, 0.10), (60.0, 10.0, 40.0, 0.20), (75.0, 20.0, 80.0, 0.40)];
    let b = Bench::new();
    b.write("three.csv", csv(&rows));
    for (loss, power) in [("l2", 0), ("cosine-l2", 2)] {
        let weight = |theta: f64| theta.to_radians().cos().powi(power);
        let (above, below) = rows.iter().fold((0.0, 0.0), |(a, b), r| (a + weight(r.0) * r.3, b + weight(r.0)));
        let want = std::f64::consts::PI * above / below;
        let fit = b.json(&["fit", "three.csv", "--model", "lambert", "--loss", loss]);
        let got = number(&fit["lobes"][0]["weight"][0]);
        assert!((got / want - 1.0).abs() < 1e-12, "{loss}: {got} vs {want}");
    }
}

#[test]
fn a_file_without_a_grid_falls_back_to_uniform_weights_and_says_so() {
    let b = Bench::new();
    b.write("list.csv", csv(&[(30.0, 10.0, 0.0, 0.1), (30.0, 20.0, 0.0, 0.1), (40.0, 20.0, 90.0, 0.2)]));
    let fit = b.json(&["fit", "list.csv", "--model", "lambert"]);
    assert_eq!(fit["fit"]["weights"], "uniform");
    let warnings = fit["fit"]["warnings"].to_string();
    assert!(warnings.contains("grid") && warnings.contains("uniform"), "{warnings}");
    let asked = b.json(&["fit", "list.csv", "--model", "lambert", "--weights", "uniform"]);
    let warnings = asked["fit"]["warnings"].to_string();
    assert!(!warnings.contains("grid"), "asked for, so nothing to say: {warnings}");
    assert_eq!(asked["lobes"], fit["lobes"]);
}

#[test]
fn the_quantity_of_a_file_can_be_overridden() {
    let b = Bench::new();
    // BRDF·cosθo of a lambertian of weight π/4: read as such it fits without a residue.
    let row = |theta_o: f64| (30.0, theta_o, 90.0, 0.25 * theta_o.to_radians().cos());
    b.write("c.csv", csv(&[row(0.0), row(30.0), row(60.0), row(75.0)]));
    let fit = b.json(&["fit", "c.csv", "--model", "lambert", "--quantity", "brdf_cos"]);
    assert!((number(&fit["lobes"][0]["weight"][0]) / std::f64::consts::FRAC_PI_4 - 1.0).abs() < 1e-12);
    assert!(number(&fit["fit"]["rmse"]) < 1e-12);
    let as_brdf = b.json(&["fit", "c.csv", "--model", "lambert"]);
    assert!(number(&as_brdf["fit"]["rmse"]) > 1e-2);
}

#[test]
fn an_option_out_of_its_range_is_named_with_what_is_known() {
    let b = Bench::new();
    b.paint("p.csv");
    for (args, says) in [
        (["--model", "lambert+ward"], "ward"),
        (["--loss", "none"], "cosine-l2"),
        (["--weights", "none"], "solid-angle"),
        (["--max-angle", "91"], "max-angle"),
        (["--max-angle", "nan"], "max-angle"),
        (["--format", "merl"], "p.csv"),
        (["--merl-angles", "corner"], "center"),
        (["--threads", "0"], "--threads"),
    ] {
        let ran = b.run(&[&["fit", "p.csv"], &args[..]].concat());
        assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
        assert!(ran.err.contains(says), "{args:?}: {}", ran.err);
    }
}

#[test]
fn flat_one_dimensional_and_in_plane_measurements_are_fitted() {
    // Each fixture was made from these weights and this exponent.
    let b = Bench::new();
    for (file, model) in [
        ("in-plane.fred.txt", "lambert+phong"),
        ("in-plane-flat-world.csv", "lambert2d+phong2d"),
        ("half-angle-cosine-rgb.alta", "lambert+phong"),
    ] {
        let fit = b.json(&["fit", &fixture(&format!("measurements/{file}"))]);
        assert_eq!(fit["model"], model, "{file}");
        let got = [
            number(&fit["lobes"][0]["weight"][0]),
            number(&fit["lobes"][1]["weight"][0]),
            number(&fit["lobes"][1]["shape"]["exponent"]),
        ];
        for (got, want) in got.iter().zip([0.2, 0.3, 20.0]) {
            assert!((got / want - 1.0).abs() < 1e-6, "{file}: {got} vs {want}");
        }
    }
}

#[test]
fn a_quantity_that_overrides_the_files_own_is_noted() {
    let b = Bench::new();
    b.paint("p.csv");
    let stated = "# quantity: brdf\n".to_owned()
        + &b.text("p.csv").lines().filter(|l| !l.starts_with('#')).collect::<Vec<_>>().join("\n");
    b.write("s.csv", stated + "\n");
    let said = |quantity: &[&str]| b.run(&[&["fit", "s.csv", "--model", "lambert"], quantity].concat()).err;
    assert!(said(&["--quantity", "brdf_cos"]).contains("`# quantity: brdf`; its values are read as brdf_cos"));
    assert!(!said(&["--quantity", "brdf"]).contains("quantity") && !said(&[]).contains("quantity"));
}

#[test]
fn a_criterion_without_a_value_is_a_dash_and_the_file_reads_back() {
    let b = Bench::new();
    b.write("few.csv", csv(&[(30.0, 10.0, 0.0, 0.1), (30.0, 20.0, 0.0, 0.11), (40.0, 20.0, 90.0, 0.09)]));
    let text = b.ok(&["fit", "few.csv", "--model", "auto", "--out", "few.json"]).text();
    assert!(!text.contains("inf") && text.contains("AICc: — where"), "{text}");
    let back = goniofit::brdf::Material::from_json(&b.text("few.json")).expect("reads");
    let choice = back.fit.and_then(|fit| fit.choice).expect("the record is kept");
    assert!(choice.candidates.iter().any(|c| c.aicc == f64::INFINITY), "{choice:?}");
}
