//! Built-in instruments, printed as files to start from, and named wherever an instrument is.

use crate::bench::{Bench, number};

const NAMES: [&str; 5] = ["ideal", "standards-lab", "commercial", "robot", "classroom"];

/// An instrument by name and by its printed file give the same bits, and so does the reduction of its raw readings.
#[test]
fn an_instrument_printed_to_a_file_measures_as_the_built_in_one() {
    let b = Bench::new();
    let list = b.json(&["instruments"]);
    let names: Vec<&str> =
        list["instruments"].as_array().expect("a list").iter().map(|s| s["name"].as_str().expect("a name")).collect();
    assert_eq!(names, NAMES);
    for name in names {
        let file = format!("{name}.toml");
        b.write(&file, b.ok(&["instruments", name, "--toml"]).out);
        let measured = |instrument: &str, raw: &str| {
            let scan = ["simulate", "--material", "matte-white", "--scan", "in-plane:20", "--seed", "3"];
            b.ok(&[&scan[..], &["--instrument", instrument, "--raw", raw, "--out", "m.csv"]].concat());
            b.text("m.csv")
        };
        let by_name = measured(name, "a.csv");
        assert_eq!(by_name, measured(&file, "b.csv"), "{name}");
        assert_eq!(b.text("a.csv"), b.text("b.csv"), "{name}");
        b.ok(&["reduce", "a.csv", "--instrument", name, "--out", "r1.csv"]);
        b.ok(&["reduce", "a.csv", "--out", "r2.csv"]);
        assert_eq!(b.text("r1.csv"), b.text("r2.csv"), "{name}");
        assert_eq!(b.json(&["instruments", name])["name"], name);
    }
}

/// The whole chain by every one: raw readings, reduced, fitted at face value and through the instrument, and both fits beside the table in pictures.
/// Masked is what was not measured: the rim beyond 75°, the shadow, what saturates.
#[test]
fn every_instrument_goes_from_readings_to_pictures() {
    let b = Bench::new();
    for name in NAMES {
        let scan = ["--material", "satin", "--scan", "hemisphere:15", "--raw", "raw.csv"];
        b.ok(&[&["simulate", "--instrument", name][..], &scan, &["--out", "m.csv"]].concat());
        b.ok(&["reduce", "raw.csv", "--out", "reduced.csv"]);
        let sigma: &[&str] = if name == "ideal" { &[] } else { &["--use-sigma"] };
        b.ok(&[&["fit", "reduced.csv", "--out", "plain.json"][..], sigma].concat());
        // Points see the material as it is: a fit through them is the plain one, and that is said.
        let through: &[&str] = if name == "ideal" { &[] } else { &["--through", name] };
        b.ok(&[&["fit", "reduced.csv", "--out", "through.json"][..], through, sigma].concat());
        let validate = ["validate", "reduced.csv", "plain.json", "through.json", "--scene", "sphere", "--out", "v"];
        let said = b.json(&[&validate[..], &["--size", "32", "--samples", "16"]].concat());
        assert_eq!(said["fits"].as_array().expect("a list").len(), 2, "{name}");
        for fit in said["fits"].as_array().expect("a list") {
            let image = &fit["image"];
            let (pixels, masked) = (number(&image["pixels"]), number(&image["masked"]));
            let off = number(&image["rmse"]);
            println!("{name}: {pixels} pixels, {masked} masked, rmse {off}");
            assert!(pixels + masked == 1024.0 && masked < 0.25 * pixels && off.is_finite(), "{name}: {image}");
        }
        assert!(b.path("v/sheet.png").exists() && b.path("v/fit-2.exr").exists(), "{name}");
    }
}

/// The ideal one reads the truth and states no σ; the others state one.
#[test]
fn only_the_ideal_instrument_is_without_sigma() {
    let b = Bench::new();
    for name in NAMES {
        b.ok(&[
            "simulate",
            "--material",
            "matte-white",
            "--scan",
            "in-plane:20",
            "--instrument",
            name,
            "--out",
            "m.csv",
        ]);
        assert_eq!(b.text("m.csv").contains("sigma_"), name != "ideal", "{name}");
    }
}

#[test]
fn an_unknown_instrument_says_which_there_are_and_that_a_file_does_too() {
    let b = Bench::new();
    for args in
        [&["instruments", "lab"][..], &["simulate", "--material", "satin", "--instrument", "lab", "--out", "x.csv"]]
    {
        let ran = b.run(args);
        assert_eq!(ran.code, Some(2), "{args:?}");
        for said in NAMES.iter().chain(&["\"lab\"", "file"]) {
            assert!(ran.err.contains(said), "{args:?}: {}", ran.err);
        }
        assert!(!b.path("x.csv").exists());
    }
}
