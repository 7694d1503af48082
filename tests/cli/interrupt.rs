//! Ctrl-C stops long work with the best so far written, and exits 130.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::bench::{Bench, number};

/// Waits until the process handles SIGINT itself; where the system does not tell, long enough.
fn wait_for_handler(child: &Child) {
    let status = format!("/proc/{}/status", child.id());
    let deadline = Instant::now() + Duration::from_secs(20);
    while Instant::now() < deadline {
        let Ok(text) = std::fs::read_to_string(&status) else {
            std::thread::sleep(Duration::from_secs(2));
            return;
        };
        let mask = text.lines().find_map(|l| l.strip_prefix("SigCgt:")).map(str::trim).unwrap_or_default();
        // Bit 1 stands for signal 2, SIGINT.
        if u64::from_str_radix(mask, 16).is_ok_and(|m| m & 2 != 0) {
            return;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("no handler for SIGINT was installed");
}

/// Runs a command, interrupts it `after` its handler stands, and returns exit code, stdout and stderr.
fn interrupted(b: &Bench, args: &[&str], after: Duration) -> (Option<i32>, Vec<u8>, String) {
    let mut child = b.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    wait_for_handler(&child);
    std::thread::sleep(after);
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs");
    assert!(sent.success());
    let asked = Instant::now();
    while child.try_wait().expect("waits").is_none() {
        if asked.elapsed() > Duration::from_secs(30) {
            child.kill().expect("ends");
            panic!("{args:?} did not stop");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().expect("ends");
    (output.status.code(), output.stdout, String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn an_interrupted_render_leaves_the_picture_so_far() {
    let b = Bench::new();
    let asked = 10_000_000;
    let samples = asked.to_string();
    for (k, delay) in [0, 1000].into_iter().enumerate() {
        let (exr, png) = (format!("{k}.exr"), format!("{k}.png"));
        let args = ["render", "--size", "32", "--samples", &samples, "--json", "--out", &exr, "--png", &png];
        let (code, out, err) = interrupted(&b, &args, Duration::from_millis(delay));
        assert_eq!(code, Some(130), "{err}");
        // Before the first ray there is nothing to keep: the command ends at once and writes nothing.
        if delay == 0 && out.is_empty() {
            assert!(!b.path(&exr).exists() && !b.path(&png).exists(), "{:?}", b.list("."));
            continue;
        }
        assert!(err.contains("stopped"), "{err}");
        let said: serde_json::Value = serde_json::from_slice(&out).expect("one object");
        let taken = number(&said["samples"]);
        assert!((0.0..f64::from(asked)).contains(&taken), "{taken} samples after {delay} ms");
        let image = b.exr(&exr);
        assert_eq!((image.width, image.height), (32, 32));
        assert!(image.radiance.iter().flatten().all(|v| v.is_finite()), "after {delay} ms");
        assert!(b.path(&png).is_file());
    }
    assert!(b.list(".").iter().all(|f| !f.starts_with('.')), "no temporary files stay: {:?}", b.list("."));
}

#[test]
fn an_interrupted_demo_writes_what_it_has_and_says_so() {
    let b = Bench::new();
    let args = ["demo", "--size", "64", "--samples", "1000000", "--out", "d"];
    let (code, _, err) = interrupted(&b, &args, Duration::from_secs(1));
    assert_eq!(code, Some(130), "{err}");
    assert!(err.contains("stopped"), "{err}");
    let files = b.list("d");
    for file in ["measurement.csv", "lambert.json", "lambert+phong.json", "truth.exr", "sheet.png", "numbers.json"] {
        assert!(files.iter().any(|f| f == file), "{file} is missing: {files:?}");
    }
    let numbers: serde_json::Value =
        serde_json::from_slice(&std::fs::read(b.path("d/numbers.json")).expect("reads")).expect("JSON");
    assert_eq!(numbers["stopped"], true);
    assert!(numbers["fits"][1]["image"].is_null(), "a picture that was not rendered has no numbers: {numbers}");
}

#[test]
fn an_interrupted_simulation_writes_what_it_read_and_says_so() {
    let b = Bench::new();
    for raw in [&[][..], &["--raw", "raw.csv"]] {
        let scan = ["--scan", "hemisphere:2", "--out", "x.csv"];
        let args = [&["simulate", "--instrument", "commercial", "--material", "satin"], &scan[..], raw].concat();
        let (code, _, err) = interrupted(&b, &args, Duration::from_secs(3));
        assert_eq!(code, Some(130), "{err}");
        assert!(err.contains("stopped after "), "{err}");
        if err.contains("nothing is written") {
            assert!(!b.path("x.csv").exists(), "{err}");
            continue; // a slow machine
        }
        let note =
            err.lines().find_map(|l| l.strip_prefix("warning: ").filter(|l| l.starts_with("stopped"))).expect("it");
        let text = b.text("x.csv");
        assert!(text.lines().any(|l| l == format!("# note: {note}")), "{note}");
        // Pairs that were not read are not there, and not said to have been saturated.
        assert!(!err.contains("nothing was read"), "{err}");
        let rows = text.lines().filter(|l| !l.starts_with(['#', 't'])).count();
        assert!(rows > 0 && rows < 46 * (1 + 44 * 180), "{rows}");
        let info = b.ok(&["info", "x.csv"]).text();
        let words: Vec<&str> = info.split_whitespace().collect();
        assert!(words.join(" ").contains(note), "{info}");
    }
    if b.path("raw.csv").exists() && b.path("x.csv").exists() {
        let again = b.ok(&["reduce", "raw.csv", "--out", "y.csv"]);
        assert!(
            again.err.contains("stopped after ") && b.text("y.csv").contains("# note: stopped after "),
            "{}",
            again.err
        );
    }
}

#[test]
fn an_interrupted_simulation_of_a_plain_detector_says_how_far_it_came() {
    let b = Bench::new();
    let args = ["simulate", "--material", "satin", "--scan", "hemisphere:1.5", "--out", "x.csv"];
    let (code, _, err) = interrupted(&b, &args, Duration::from_millis(60));
    // It may have been done, or not begun, in that time.
    assert_eq!(code, Some(130), "{err}");
    if b.path("x.csv").exists() && err.contains("stopped after ") {
        let head: String = b.text("x.csv").lines().take(4).collect();
        assert!(head.contains("# note: stopped after "), "{head}");
    }
}

#[test]
fn a_simulation_that_is_interrupted_before_its_first_reading_writes_nothing() {
    let b = Bench::new();
    let args = ["simulate", "--instrument", "commercial", "--material", "mirror-like", "--scan", "adaptive:1000"];
    let (code, out, err) = interrupted(&b, &[&args[..], &["--out", "x.csv"]].concat(), Duration::from_millis(500));
    assert_eq!(code, Some(130), "{err}");
    assert!(!err.contains("panicked"), "{err}");
    // While directions are chosen nothing counts yet; a fast machine may have been past that.
    if !b.path("x.csv").exists() && !err.is_empty() {
        assert!(out.is_empty() && err.contains("stopped"), "{err}");
    }
}

#[test]
fn an_interrupted_sweep_keeps_its_trials() {
    let b = Bench::new();
    let args = [
        "tradeoff",
        "render",
        "--size",
        "16",
        "--samples",
        "4,8",
        "--ways",
        "scene",
        "--trials",
        "10000",
        "--json",
        "--out",
        "t",
    ];
    let (code, out, err) = interrupted(&b, &args, Duration::from_secs(3));
    assert_eq!(code, Some(130), "{err}");
    let said: serde_json::Value = serde_json::from_slice(&out).expect("one object");
    let trials = said["curves"][0]["points"][0]["trials"].as_array().expect("trials").len();
    assert!((1..10_000).contains(&trials) && said["ended"] == "stopped", "{trials} trials");
    assert_eq!(b.json_file("t/tradeoff.json")["ended"], "stopped");
}
