//! FIT.json: keys, shape, order.

use serde_json::{Value, json};

use crate::bench::{Bench, csv, keys, number};

/// The keys of every fit, in their order; `weights` says which of `--weights` was used, or `sigma`.
const RECORD: [&str; 12] = [
    "status",
    "loss",
    "weights",
    "samples",
    "cost",
    "rmse",
    "iterations",
    "seconds",
    "standard_error",
    "interval_95",
    "undetermined",
    "warnings",
];

/// Those that follow where they have something to say: of the plain fit of a measurement in space they have.
const EVIDENCE: [&str; 4] = ["correlation", "residual", "energy", "search"];

/// A lambertian with a dent where a mirror would send the light: no glossy lobe of positive weight helps.
fn dented() -> String {
    let mut rows = Vec::new();
    for theta_i in [0.0f64, 20.0, 40.0, 60.0] {
        for theta_o in 0..8 {
            for phi in 0..12 {
                let (theta_o, phi) = (f64::from(theta_o) * 10.0, f64::from(phi) * 30.0);
                let (i, o) = (theta_i.to_radians(), theta_o.to_radians());
                let cos = i.sin() * o.sin() * phi.to_radians().cos() + i.cos() * o.cos();
                rows.push((theta_i, theta_o, phi, 0.1 * (1.0 - 0.5 * cos.max(0.0).powi(20))));
            }
        }
    }
    csv(&rows)
}

#[test]
fn a_fit_has_exactly_the_keys_of_the_contract() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let fit = b.json_file("p.json");
    assert_eq!(keys(&fit), ["format", "version", "model", "channels", "lobes", "fit"]);
    assert_eq!(fit["format"], "goniofit-material");
    assert_eq!(fit["version"], 1);
    assert_eq!(fit["model"], "lambert+phong");
    assert_eq!(fit["channels"], json!(["r", "g", "b"]));
    assert_eq!(keys(&fit["fit"]), [&RECORD[..], &EVIDENCE[..]].concat());
    assert_eq!(fit["fit"]["status"], "converged");
    assert_eq!(fit["fit"]["loss"], "cosine-l2");
    assert_eq!(fit["fit"]["samples"], 2601);
    assert!(fit["fit"]["iterations"].is_u64() && number(&fit["fit"]["seconds"]) > 0.0);
    assert_eq!((&fit["fit"]["undetermined"], &fit["fit"]["warnings"]), (&json!([]), &json!([])));
}

#[test]
fn lobes_errors_and_intervals_have_the_same_shape() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let fit = b.json_file("p.json");
    assert_eq!(keys(&fit["lobes"][0]), ["kind", "weight"], "a lambert lobe has no shape");
    assert_eq!(keys(&fit["lobes"][1]), ["kind", "weight", "shape"]);
    for list in ["standard_error", "interval_95"] {
        let lobes = &fit["fit"][list];
        assert_eq!(lobes.as_array().map(Vec::len), Some(2), "{list}");
        assert_eq!(keys(&lobes[0]), ["weight"], "{list}");
        assert_eq!(keys(&lobes[1]), ["weight", "shape"], "{list}");
        assert_eq!(keys(&lobes[1]["shape"]), ["exponent"], "{list}");
    }
    let holds = |value: &Value, error: &Value, interval: &Value| {
        let (low, high) = (number(&interval[0]), number(&interval[1]));
        assert!(low < number(value) && number(value) < high, "{value} in {interval}");
        // Student's t of many samples is 1.96; an exponent's interval is symmetric in its logarithm.
        let half_width = (high - low) / 2.0 / number(error);
        assert!((half_width - 1.96).abs() < 0.01, "{interval} is {half_width} standard errors wide");
    };
    let (error, interval) = (&fit["fit"]["standard_error"], &fit["fit"]["interval_95"]);
    for l in 0..2 {
        for c in 0..3 {
            holds(&fit["lobes"][l]["weight"][c], &error[l]["weight"][c], &interval[l]["weight"][c]);
        }
    }
    let exponent = |v: &Value| v[1]["shape"]["exponent"].clone();
    holds(&exponent(&fit["lobes"]), &exponent(error), &exponent(interval));
}

#[test]
fn what_the_residuals_the_search_and_the_energy_say_has_its_shape() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let fit = b.json_file("p.json");
    let record = &fit["fit"];
    assert_eq!(
        keys(&record["residual"]),
        ["noise_rmse", "model_rmse", "structured_share", "noise_from", "effective_samples"]
    );
    assert_eq!(record["residual"]["noise_from"], "sigma", "the simulated file states it");
    assert_eq!(keys(&record["search"]), ["starts", "reached", "minima", "runner_up_excess", "unseen_chance"]);
    assert_eq!(record["search"]["unseen_chance"], Value::Null, "one shape is bracketed, not sampled");
    assert_eq!(keys(&record["energy"]), ["theta_deg", "albedo", "largest", "conserved", "constrained"]);
    let energy = &record["energy"];
    assert_eq!((&energy["conserved"], &energy["constrained"]), (&json!(true), &json!(false)));
    for c in 0..3 {
        // At normal incidence every lobe reflects its weight, and at no other angle more.
        let sum = number(&fit["lobes"][0]["weight"][c]) + number(&fit["lobes"][1]["weight"][c]);
        let albedo: Vec<f64> = energy["albedo"][c].as_array().expect("a list").iter().map(number).collect();
        assert_eq!(albedo.len(), energy["theta_deg"].as_array().map_or(0, Vec::len));
        assert!((albedo[0] / sum - 1.0).abs() < 1e-9, "{} vs {sum}", albedo[0]);
        assert!(
            albedo.iter().all(|a| *a <= albedo[0] * (1.0 + 1e-12) && *a <= number(&energy["largest"])),
            "{albedo:?}"
        );
    }
}

#[test]
fn correlations_are_symmetric_with_ones_and_name_every_parameter() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let correlation = &b.json_file("p.json")["fit"]["correlation"];
    let names = json!([
        "lambert.weight[r]",
        "lambert.weight[g]",
        "lambert.weight[b]",
        "phong.weight[r]",
        "phong.weight[g]",
        "phong.weight[b]",
        "phong.exponent"
    ]);
    assert_eq!(correlation["parameters"], names);
    for i in 0..7 {
        for j in 0..7 {
            let (a, b) = (number(&correlation["matrix"][i][j]), number(&correlation["matrix"][j][i]));
            assert!((a - b).abs() < 1e-9 && a.abs() <= 1.0 && (i != j || a == 1.0), "{i} {j}: {a} vs {b}");
        }
    }
    // A sharper lobe is higher and so needs less weight, or more where its flanks tell: never independent of it.
    assert!(number(&correlation["matrix"][3][6]).abs() > 0.1, "{correlation}");
}

#[test]
fn a_model_that_can_not_bend_enough_says_how_far_that_moves_its_parameters() {
    let b = Bench::new();
    b.paint("p.csv");
    let record = &b.json(&["fit", "p.csv", "--model", "phong"])["fit"];
    let share = number(&record["residual"]["structured_share"]);
    assert!(share > 0.99, "no lambert lobe, so nearly all is structure, not {share}");
    assert!(record["warnings"].to_string().contains("does not describe"), "{}", record["warnings"]);
    let (model, noise) = (&record["model_error"][0], &record["standard_error"][0]);
    let exponent = |r: &Value| number(&r["shape"]["exponent"]);
    assert!(exponent(model) > 3.0 * exponent(noise), "{model} vs {noise}");
}

#[test]
fn cost_is_the_sum_and_rmse_its_root_mean_over_samples_and_channels() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let record = &b.json_file("p.json")["fit"];
    let (cost, rmse) = (number(&record["cost"]), number(&record["rmse"]));
    let want = (cost / (3.0 * number(&record["samples"]))).sqrt();
    assert!((rmse / want - 1.0).abs() < 1e-12, "{rmse} vs {want}");
}

#[test]
fn lobes_keep_the_models_order_and_those_of_one_kind_ascend() {
    let b = Bench::new();
    b.paint("p.csv");
    let kinds = |fit: &Value| -> Vec<String> {
        fit["lobes"].as_array().expect("lobes").iter().map(|l| l["kind"].as_str().expect("kind").to_owned()).collect()
    };
    for model in ["lambert", "phong", "lambert+phong", "phong+lambert"] {
        let fit = b.json(&["fit", "p.csv", "--model", model]);
        assert_eq!(fit["model"], model);
        assert_eq!(kinds(&fit).join("+"), model);
    }
    let two = json!({ "format": "goniofit-material", "version": 1, "model": "lambert+phong+phong", "channels": ["x"],
        "lobes": [ { "kind": "lambert", "weight": [0.2] },
                   { "kind": "phong", "weight": [0.3], "shape": { "exponent": 400.0 } },
                   { "kind": "phong", "weight": [0.1], "shape": { "exponent": 6.0 } } ] });
    b.write("two.json", two.to_string());
    b.ok(&["convert", "two.json", "two.csv"]);
    let fit = b.json(&["fit", "two.csv", "--model", "lambert+phong+phong"]);
    let exponents = [1, 2].map(|l: usize| number(&fit["lobes"][l]["shape"]["exponent"]));
    assert!((exponents[0] - 6.0).abs() < 1e-4 && (exponents[1] - 400.0).abs() < 1e-2, "{exponents:?}");
}

#[test]
fn a_lobe_of_weight_zero_has_shape_null_and_readers_drop_it() {
    let b = Bench::new();
    b.write("dent.csv", dented());
    let ran = b.ok(&["fit", "dent.csv", "--out", "dent.json"]);
    assert!(ran.text().contains("undetermined"), "{}", ran.text());
    let fit = b.json_file("dent.json");
    assert_eq!(fit["lobes"][1]["weight"], json!([0.0]), "{fit}");
    assert_eq!(fit["lobes"][1].get("shape"), Some(&Value::Null), "{fit}");
    assert_eq!(fit["fit"]["undetermined"], json!(["phong.exponent"]));
    let warnings = fit["fit"]["warnings"].to_string();
    assert!(warnings.contains("phong.exponent"), "{warnings}");

    // What is left is the lambert lobe: the same picture and the same samples.
    let mut alone = fit.clone();
    alone["model"] = "lambert".into();
    alone["lobes"] = json!([fit["lobes"][0]]);
    alone.as_object_mut().expect("an object").remove("fit");
    b.write("alone.json", alone.to_string());
    for name in ["dent", "alone"] {
        b.ok(&["convert", &format!("{name}.json"), &format!("{name}-grid.csv"), "--scan", "hemisphere:30"]);
        let ran = b.picture(&format!("{name}.exr"), &["--material", &format!("{name}.json")]);
        assert_eq!(ran.code, Some(0), "{}", ran.err);
    }
    assert_eq!(b.text("dent-grid.csv"), b.text("alone-grid.csv"));
    assert!(b.exr("dent.exr").radiance == b.exr("alone.exr").radiance);
}

#[test]
fn what_the_data_do_not_determine_has_null_errors_and_is_named() {
    let b = Bench::new();
    // Black in every direction: no weight, so no exponent.
    b.write("black.csv", csv(&[(30.0, 10.0, 0.0, 0.0), (30.0, 20.0, 0.0, 0.0), (40.0, 20.0, 90.0, 0.0)]));
    let fit = b.json(&["fit", "black.csv"]);
    assert_eq!(fit["lobes"][1]["shape"], Value::Null);
    assert_eq!(fit["fit"]["standard_error"][1]["shape"]["exponent"], Value::Null);
    assert_eq!(fit["fit"]["interval_95"][1]["shape"]["exponent"], Value::Null);
    let named = fit["fit"]["undetermined"].to_string();
    assert!(named.contains("phong.exponent"), "{named}");
}

#[test]
fn a_reader_ignores_unknown_keys_and_refuses_other_formats_and_newer_versions() {
    let b = Bench::new();
    let mut material = b.ok(&["models", "satin"]).json();
    material["colour"] = "blue".into();
    material["lobes"][0]["note"] = "matte".into();
    b.write("m.json", material.to_string());
    assert_eq!(b.picture("m.exr", &["--material", "m.json"]).code, Some(0));
    for (key, value) in [("format", json!("other")), ("version", json!(2))] {
        let mut wrong = material.clone();
        wrong[key] = value;
        b.write("wrong.json", wrong.to_string());
        let ran = b.picture("wrong.exr", &["--material", "wrong.json"]);
        assert_eq!(ran.code, Some(2), "{key}");
        assert!(ran.err.contains("wrong.json") && ran.err.contains(key), "{}", ran.err);
    }
}
