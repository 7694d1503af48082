//! Options of `fit`: what they change, and that the file says so.

use crate::bench::{Bench, csv, fixture, number};

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
    assert_eq!(asked["fit"]["warnings"], serde_json::json!([]), "asked for, so nothing to say");
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
