//! The plan of effects of a simulation, and simulations that are told how exact to be.

use serde_json::Value;

use crate::bench::{Bench, number};

/// Every kind of effect: of the geometry, of the flux, of the detector, of chance.
const LAB: &str = "version = 1
material = \"satin\"
scan = \"in-plane:10\"
seed = 3
[instrument]
electrons = 1e6
[instrument.source]
drift_per_sqrt_hour = 0.005
beam_diameter_m = 0.01
[instrument.sample]
diameter_m = 0.02
tilt_u_deg = 1e-7
[instrument.detector]
aperture_deg = 1
dark_per_s = 200
full_well = 4e5
bits = 16
nonlinearity_u = 0.003
exposures_s = [0.02, 0.5]
[instrument.reference]
reflectance = 0.985
[instrument.surroundings]
stray_per_sr = 1e-3
shadow_deg = 3
";

fn bench() -> Bench {
    let b = Bench::new();
    b.write("lab.toml", LAB);
    b
}

fn effect<'a>(said: &'a Value, name: &str) -> &'a Value {
    let list = said["effects"].as_array().expect("a list");
    list.iter().find(|e| e["effect"] == name).unwrap_or_else(|| panic!("{name}: {list:?}"))
}

#[test]
fn every_effect_is_listed_with_its_reason_and_what_it_changes() {
    let said = bench().json(&["effects", "lab.toml"]);
    assert_eq!(said["effects"].as_array().map(Vec::len), Some(20));
    for (name, on) in
        [("detector aperture", true), ("sample tilt", true), ("source divergence", false), ("read noise", true)]
    {
        assert_eq!(effect(&said, name)["on"], on, "{name}");
        assert_eq!(effect(&said, name)["reading"].is_object(), on, "{name}");
    }
    assert!(effect(&said, "detector aperture")["why"].as_str().expect("text").contains("aperture_deg = 1°"));
    let largest = |name: &str| number(&effect(&said, name)["reading"]["largest"]);
    // The well is deeper than any reading; in the shadow only dark and stray light are left.
    assert!(largest("saturation") == 0.0 && largest("shadow") > 0.9);
    // A tilt of 10⁻⁷ degrees moves readings of this material by some 10⁻⁸.
    assert!((1e-12..1e-6).contains(&largest("sample tilt")), "{}", largest("sample tilt"));
    // The reduction subtracts the dark and the stray light, and divides by the share of the beam; only the detector bends a little otherwise.
    for name in ["dark current", "stray light", "footprint"] {
        let reduced = number(&effect(&said, name)["reduced"]["largest"]);
        assert!(largest(name) > 0.1 && reduced < 1e-3 * largest(name), "{name}: {} {reduced}", largest(name));
    }
    assert!(number(&effect(&said, "detector aperture")["reduced"]["largest"]) > 1e-5);
    assert!(number(&effect(&said, "shadow")["masked"]) > 0.0);
    assert_eq!(effect(&said, "shot noise")["noise"], true);
    let shares: f64 = said["effects"].as_array().expect("a list").iter().map(|e| number(&e["share"])).sum();
    assert!(shares > 0.0 && shares <= 1.0 + 1e-9, "{shares}");
}

#[test]
fn the_table_fits_a_terminal_and_an_ideal_instrument_has_no_effect() {
    let b = bench();
    let text = b.ok(&["effects", "lab.toml"]).text();
    assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
    assert!(text.contains("detector aperture") && text.contains("off:"));
    let said = b.json(&["effects", "--material", "satin", "--noiseless", "--scan", "in-plane:15"]);
    assert!(said["effects"].as_array().expect("a list").iter().all(|e| e["on"] == false));
}

#[test]
fn what_is_no_simulation_is_said_to_be_none() {
    let b = bench();
    b.write("scene.toml", b.ok(&["scenes", "sphere", "--toml"]).out);
    b.write("colour.toml", format!("colour = 3\n{LAB}"));
    for (args, says) in [
        (&["simulate", "scene.toml", "--out", "x.csv"][..], "found a scene"),
        (&["effects", "colour.toml"], "colour"),
        (&["effects", "none.toml"], "none.toml"),
        (&["effects"], "--material"),
        (&["effects", "--material", "satin", "--instrument", "scene.toml"], "found a scene"),
    ] {
        let ran = b.run(args);
        assert!(ran.code == Some(2) && ran.err.contains(says), "{args:?}: {}", ran.err);
    }
}

#[test]
fn what_a_tolerance_leaves_out_is_named_and_below_it_nothing_changes() {
    let b = bench();
    b.ok(&["simulate", "lab.toml", "--out", "all.csv"]);
    let said = b.json(&["simulate", "lab.toml", "--auto", "1e-5", "--out", "few.csv"]);
    let left: Vec<&str> =
        said["left_out"].as_array().expect("a list").iter().filter_map(|e| e["effect"].as_str()).collect();
    assert_eq!(left, ["saturation", "sample tilt"]);
    let off = said["effects"].as_array().expect("a list").iter().find(|e| e["name"] == "sample tilt").expect("it");
    assert!(off["on"] == false && off["why"].as_str().expect("text").contains("at most"), "{off}");
    let none = b.json(&["simulate", "lab.toml", "--auto", "1e-12", "--out", "same.csv"]);
    // Where the means themselves are left out, that is the reason that nothing depends on a time for them.
    b.write("cone.toml", "version = 1\n[instrument.detector]\naperture_deg = 0.01\n");
    let loose = [
        "simulate",
        "cone.toml",
        "--material",
        "satin",
        "--scan",
        "in-plane:15",
        "--auto",
        "1e-2",
        "--time-budget",
        "1h",
        "--out",
        "loose.csv",
    ];
    let governs = b.json(&loose)["time_budget"]["governs"].as_array().map(Vec::len);
    assert_eq!(governs, Some(0));
    let text = b.ok(&loose).text();
    assert!(text.contains("--time-budget changed nothing") && text.contains("--auto left out the means"), "{text}");
    // A well that nothing fills changes no bit.
    assert_eq!(none["left_out"].as_array().map(Vec::len), Some(1));
    assert_eq!(b.bytes("same.csv"), b.bytes("all.csv"));
}

#[test]
fn targets_and_times_say_what_was_reached() {
    let b = bench();
    let reached = |extra: &[&str]| {
        let said = b.json(&[&["simulate", "lab.toml", "--out", "m.csv"], extra].concat());
        (number(&said["quadrature_error"]), said)
    };
    let (usual, _) = reached(&[]);
    let (coarse, _) = reached(&["--target-error", "1%"]);
    let (fine, _) = reached(&["--target-error", "1e-9"]);
    assert!(usual <= 1e-6 && coarse <= 1e-2 && fine <= 1e-9 && coarse > fine, "{usual} {coarse} {fine}");
    let (_, timed) = reached(&["--time-budget", "1h"]);
    assert_eq!(timed["time_budget"]["fits"], true);
    assert_eq!(timed["time_budget"]["governs"], serde_json::json!(["detector aperture"]));
    let short = b.ok(&["simulate", "lab.toml", "--out", "m.csv", "--time-budget", "1ns"]);
    assert!(short.err.contains("even the lowest orders"), "{}", short.err);
    for wrong in [&["--target-error", "0"][..], &["--time-budget", "0s"], &["--auto", "-1"]] {
        assert_eq!(b.run(&[&["simulate", "lab.toml", "--out", "m.csv"], wrong].concat()).code, Some(2), "{wrong:?}");
    }
    assert_eq!(
        b.run(&["simulate", "lab.toml", "--out", "m.csv", "--target-error", "1%", "--time-budget", "1s"]).code,
        Some(2)
    );
}

/// What a time budget is of, and what it is not: readings without means don't depend on it, reduction and files come after it.
#[test]
fn a_time_budget_says_what_it_covers_and_where_nothing_depends_on_it() {
    let b = bench();
    let text = b.ok(&["simulate", "lab.toml", "--out", "m.csv", "--time-budget", "1h"]).text();
    assert!(text.contains("of 3600 s, reducing and writing took") && text.contains("means over cones to"), "{text}");
    // Points, with and without raw readings.
    let points = ["simulate", "--material", "satin", "--scan", "in-plane:10", "--seed", "3"];
    for more in [&[][..], &["--raw", "raw.csv"]] {
        b.ok(&[&points[..], &["--out", "free.csv"], more].concat());
        let timed = [&points[..], &["--out", "m.csv", "--time-budget", "1h"], more].concat();
        let text = b.ok(&timed).text();
        for says in [
            "--time-budget changed nothing",
            "without means over cones or spot",
            "of 3600 s, reducing and writing took",
        ] {
            assert!(text.contains(says), "{says}: {text}");
        }
        assert_eq!(b.bytes("m.csv"), b.bytes("free.csv"), "{more:?}");
        let said = b.json(&timed);
        let (budget, reading) = (&said["time_budget"], number(&said["seconds_to_last_reading"]));
        assert_eq!((&budget["fits"], &budget["governs"]), (&Value::Bool(true), &Value::Array(vec![])), "{budget}");
        assert!(number(&said["seconds_to_last_file"]) >= reading && reading > 0.0, "{said}");
    }
    let text = b.ok(&[&points[..], &["--out", "m.csv", "--target-error", "1%"]].concat()).text();
    assert!(text.contains("--target-error changed nothing"), "{text}");
    let said = b.json(&[&points[..], &["--out", "m.csv"]].concat());
    assert!(said["time_budget"].is_null(), "{said}");
}
