//! Measurements by an instrument with an aperture, fitted through it; the instrument of the flat world; the demo by an instrument.

use crate::bench::{Bench, number};

const WIDE: &str = "version = 1
[instrument]
electrons = 1e6
[instrument.detector]
aperture_deg = 4.0
";

#[test]
fn a_fit_through_the_instrument_finds_the_exponent_that_a_plain_one_misses() {
    let b = Bench::new();
    b.write("wide.toml", WIDE);
    let simulate = ["simulate", "--material", "glossy-paint", "--instrument", "wide.toml", "--scan", "in-plane:2"];
    b.ok(&[&simulate[..], &["--seed", "3", "--out", "m.csv"]].concat());
    let off = |args: &[&str]| {
        let fit = b.json(&[&["fit", "m.csv"][..], args].concat());
        let error = number(&fit["fit"]["standard_error"][1]["shape"]["exponent"]);
        ((number(&fit["lobes"][1]["shape"]["exponent"]) - 90.0) / error, fit["fit"]["through"].clone())
    };
    let (plain, none) = off(&[]);
    let (through, said) = off(&["--through", "wide.toml"]);
    assert!(none.is_null() && said.as_str().is_some_and(|s| s.contains("4.000°")), "{said}");
    assert!(plain < -10.0 && through.abs() < 5.0, "off by {plain} and {through} standard errors");
}

#[test]
fn a_fit_through_points_or_of_the_flat_world_is_refused() {
    let b = Bench::new();
    b.paint("p.csv");
    b.write("flat.csv", "# dimension: 2\ntheta_i_deg,theta_o_deg,y\n0,0,0.5\n0,10,0.4\n10,20,0.3\n");
    for (args, says) in [
        (["fit", "p.csv", "--through", "ideal"], "aperture_deg"),
        (["fit", "p.csv", "--through", "nothing.toml"], "no built-in instrument"),
        (["fit", "flat.csv", "--through", "commercial"], "flat world"),
    ] {
        let ran = b.run(&args);
        assert!(ran.code == Some(2) && ran.err.contains(says), "{args:?}: {ran:?}");
    }
}

/// Lobes through cones take longer than all the rest of a fit: a time too short for them ends it, with an error that says what was done and what it takes.
#[test]
fn a_time_that_is_too_short_for_the_cones_ends_the_fit_and_says_so() {
    let b = Bench::new();
    let simulate = ["simulate", "--material", "glossy-paint", "--instrument", "classroom", "--scan", "in-plane:5"];
    b.ok(&[&simulate[..], &["--out", "m.csv"]].concat());
    let fit = ["fit", "m.csv", "--through", "classroom", "--out", "fit.json"];
    let timed = |args: &[&str]| {
        let clock = std::time::Instant::now();
        (b.run(&[&fit[..], args].concat()), clock.elapsed())
    };
    let (free, whole) = timed(&[]);
    let free = (free.code, b.json_file("fit.json")["lobes"].clone());
    std::fs::remove_file(b.path("fit.json")).expect("was written");
    for args in [&["--time-budget", "1ms"][..], &["--time-budget", "1ms", "--model", "auto"]] {
        let (ran, took) = timed(args);
        assert!(ran.code == Some(1) && !b.path("fit.json").exists(), "{ran:?}");
        for says in ["--time-budget: 1ms ended after lobes of", "cones of the instrument", "expected about"] {
            assert!(ran.err.contains(says), "{}", ran.err);
        }
        // One table is begun at most on each thread, of the hundred or so that a fit asks for.
        assert!(took < whole / 2, "{took:?} of {whole:?}");
    }
    // A time that is enough changes no bit.
    let (ran, _) = timed(&["--time-budget", "10min"]);
    assert_eq!((ran.code, b.json_file("fit.json")["lobes"].clone()), free);
}

/// The same files, options and commands in the flat world.
#[test]
fn an_instrument_measures_the_flat_world() {
    let b = Bench::new();
    let lobes = r#"[{"kind":"lambert2d","weight":[0.3]},{"kind":"phong2d","weight":[0.2],"shape":{"exponent":20}}]"#;
    let head = r#"{"format":"goniofit-material","version":1,"model":"lambert2d+phong2d","channels":["y"]"#;
    b.write("flat.json", format!("{head},\"lobes\":{lobes}}}"));
    let simulate = ["simulate", "--material", "flat.json", "--instrument", "commercial", "--scan", "flat:5"];
    b.ok(&[&simulate[..], &["--raw", "raw.csv", "--out", "m.csv"]].concat());
    assert!(b.text("raw.csv").contains("# dimension: 2"));
    b.ok(&["reduce", "raw.csv", "--out", "r.csv"]);
    let fit = b.json(&["fit", "r.csv"]);
    let exponent = number(&fit["lobes"][1]["shape"]["exponent"]);
    assert!((exponent / 20.0 - 1.0).abs() < 0.1, "{exponent}");
}

#[test]
fn the_demo_by_an_instrument_writes_its_readings_and_both_fits() {
    let b = Bench::new();
    b.write("wide.toml", WIDE);
    let args = ["demo", "--instrument", "wide.toml", "--size", "16", "--samples", "2", "--out", "d"];
    let said = b.json(&args);
    let labels: Vec<&str> = said["fits"].as_array().expect("fits").iter().filter_map(|f| f["label"].as_str()).collect();
    assert_eq!(labels, ["lambert", "lambert+phong", "lambert+phong-through"]);
    assert_eq!(said["instrument"], "wide.toml");
    for file in ["raw.csv", "measurement.csv", "lambert+phong-through.json", "difference-lambert+phong-through.png"] {
        assert!(b.path(&format!("d/{file}")).exists(), "{file}");
    }
}
