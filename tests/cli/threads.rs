//! The same input gives the same bits from any number of threads; only times differ.

use serde_json::Value;

use crate::bench::{Bench, Ran, assert_same_picture};

const THREADS: [&str; 3] = ["1", "2", "8"];

/// Runs a command with each number of threads and hands what it wrote to `out` to `check`, pairwise with one thread's.
fn with_threads<T>(b: &Bench, args: &[&str], read: impl Fn(Ran) -> T, same: impl Fn(&T, &T, &str)) {
    let mut first = None;
    for threads in THREADS {
        let got = read(b.ok(&[args, &["--threads", threads]].concat()));
        match &first {
            None => first = Some(got),
            Some(first) => same(first, &got, threads),
        }
    }
}

#[test]
fn simulate_writes_the_same_bytes() {
    let b = Bench::new();
    for (scan, out) in [("hemisphere:10", "x.csv"), ("in-plane:1", "x.csv"), ("merl", "x.binary")] {
        let args = ["simulate", "--material", "glossy-paint", "--scan", scan, "--seed", "5", "--out", out, "--quiet"];
        with_threads(&b, &args, |_| b.bytes(out), |a, c, n| assert!(a == c, "{scan}, {n} threads"));
    }
}

#[test]
fn a_fit_writes_the_same_numbers() {
    let b = Bench::new();
    b.ok(&["simulate", "--material", "satin", "--scan", "hemisphere:6", "--out", "p.csv"]);
    let read = |_| {
        let mut fit: Value = b.json_file("p.json");
        fit["fit"]["seconds"] = 0.into();
        fit.to_string() // every digit counts
    };
    with_threads(&b, &["fit", "p.csv", "--out", "p.json"], read, |a, c, n| assert_eq!(a, c, "{n} threads"));
}

#[test]
fn a_picture_has_the_same_pixels() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    for (material, scene) in [("p.json", "cornell"), ("p.csv", "sphere-on-plane")] {
        let args = ["render", "--material", material, "--scene", scene, "--quiet", "--png", "r.png"];
        let args = [&args[..], &["--size", "32", "--samples", "8", "--out", "r.exr"]].concat();
        let read = |_| {
            b.write("kept.exr", b.bytes("r.exr"));
            (b.exr("r.exr"), b.bytes("r.png"))
        };
        with_threads(&b, &args, read, |a, c, n| {
            assert_same_picture(&a.0, &c.0, &format!("{material}, {n} threads"));
            assert!(a.1 == c.1, "{material}, {n} threads: previews differ");
        });
        b.ok(&[&args[..], &["--threads", "1"]].concat());
        let compared = b.json(&["compare", "r.exr", "kept.exr", "--fail-above", "max_abs=0"]);
        assert_eq!(compared["max_abs"], 0.0, "{material}");
    }
}

#[test]
fn validate_and_convert_give_the_same_numbers() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let validate = ["validate", "p.csv", "p.json", "--size", "24", "--samples", "4", "--out", "v"];
    with_threads(&b, &validate, |_| b.text("v/numbers.json"), |a, c, n| assert_eq!(a, c, "{n} threads"));
    let convert = ["convert", "p.json", "g.csv"];
    with_threads(&b, &convert, |_| b.text("g.csv"), |a, c, n| assert!(a == c, "{n} threads"));
    with_threads(&b, &["info", "p.csv"], |ran| ran.text(), |a, c, n| assert_eq!(a, c, "{n} threads"));
}
