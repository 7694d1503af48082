//! Adaptive scans on the command line: wherever a scan is taken, and what is refused.

use crate::bench::{Bench, LAB, number};

/// The laboratory with drift and jitter, and what it is to simulate.
fn lab() -> String {
    let what = "version = 1\nmaterial = \"satin\"\nscan = \"adaptive:260\"\nseed = 4\n";
    let drifting = "[instrument.source]\ndrift_per_sqrt_hour = 0.005\n";
    LAB.replace("version = 1\n", what).replace("move_s = 2\n", "move_s = 2\ndegrees_per_s = 20\njitter_deg = 0.02\n")
        + drifting
}

/// Rows of a CSV without its head.
fn rows(text: &str) -> usize {
    text.lines().filter(|l| !l.starts_with(['#', 't'])).count()
}

#[test]
fn an_adaptive_scan_is_measured_reduced_and_fitted_like_any_other() {
    let b = Bench::new();
    b.write("lab.toml", lab());
    let said = b.json(&["simulate", "lab.toml", "--raw", "raw.csv", "--out", "m.csv"]);
    assert_eq!((number(&said["entries"]), &said["scan"]), (260.0, &"adaptive:260".into()));
    b.ok(&["reduce", "raw.csv", "--out", "again.csv"]);
    assert_eq!(b.bytes("m.csv"), b.bytes("again.csv"));
    for threads in ["1", "2"] {
        b.ok(&["simulate", "lab.toml", "--threads", threads, "--out", &format!("{threads}.csv")]);
    }
    assert_eq!(b.bytes("1.csv"), b.bytes("2.csv"));
    // A list of its directions is the same run, in the same hours.
    let list = b.json(&["simulate", "lab.toml", "--scan", "list:m.csv", "--out", "list.csv"]);
    assert_eq!(list["instrument_hours"], said["instrument_hours"]);
    let fit = b.json(&["fit", "m.csv", "--use-sigma", "--out", "fit.json"]);
    assert!(!fit.to_string().contains("undetermined\":[\""), "{fit}");
    let effects = b.json(&["effects", "lab.toml"]);
    assert_eq!(effects["scan"], "adaptive:260");
    b.ok(&["simulate", "lab.toml", "--auto", "1e-3", "--out", "auto.csv"]);
    // A fit is sampled where it bends.
    b.ok(&["convert", "fit.json", "even.csv", "--scan", "adaptive:300"]);
    assert_eq!(rows(&b.text("even.csv")), 300);
}

#[test]
fn half_a_thousand_pairs_unless_said_and_no_more_than_the_instrument_resolves() {
    let b = Bench::new();
    let said = b.json(&["simulate", "--material", "satin", "--scan", "adaptive", "--out", "m.csv"]);
    assert_eq!((number(&said["entries"]), &said["scan"]), (500.0, &"adaptive:500".into()));
    let args = ["simulate", "--material", "satin", "--instrument", "commercial", "--out", "m.csv", "--scan"];
    let ran = b.ok(&[&args[..], &["adaptive:1500"]].concat());
    // An aperture of 4° resolves 1°: gaps of 5° are halved twice, to 1.25°.
    assert!(ran.err.contains("ended with") && ran.err.contains("two steps of 1.00°"), "{}", ran.err);
    assert!(rows(&b.text("m.csv")) <= 6 * (34 * 4 + 1));
}

#[test]
fn too_few_pairs_are_refused_with_the_least() {
    let b = Bench::new();
    for text in ["adaptive:209", "adaptive:100001", "adaptive:x"] {
        let ran = b.run(&["simulate", "--material", "satin", "--scan", text, "--out", "m.csv"]);
        assert_eq!(ran.code, Some(2), "{}", ran.err);
        assert!(
            ran.err.contains(text) && ran.err.contains("from 210, which the first look alone takes"),
            "{}",
            ran.err
        );
    }
    b.write("few.toml", lab().replace("260", "60"));
    let ran = b.run(&["effects", "few.toml"]);
    assert!(ran.code == Some(2) && ran.err.contains("adaptive:60"), "{}", ran.err);
    assert!(!b.path("m.csv").exists());
}
