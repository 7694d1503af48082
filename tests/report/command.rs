//! The command without a browser: what it refuses, and what it does with folders that are not whole.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::run::Run;

fn report(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_goniofit"));
    command.arg("report").args(args).current_dir(folder).output().expect("runs")
}

/// A folder with the demo's files in `d`, pages left out.
fn copy_of_the_demo() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let to = folder.path().join("d");
    std::fs::create_dir(&to).expect("makes");
    for entry in std::fs::read_dir(Run::shared().path("demo")).expect("lists") {
        let from = entry.expect("an entry").path();
        if from.is_file() && from.extension().is_none_or(|e| e != "html") {
            std::fs::copy(&from, to.join(from.file_name().expect("a name"))).expect("copies");
        }
    }
    folder
}

#[test]
fn no_file_of_the_run_becomes_a_page() {
    let folder = copy_of_the_demo();
    let text = |name: &str| std::fs::read(folder.path().join(name)).expect("reads");
    std::fs::copy(folder.path().join("d/measurement.csv"), folder.path().join("lab.html")).expect("copies");
    let of_run = ["d/numbers.json", "d/lambert.json", "d/measurement.csv", "d/truth.exr"];
    for (out, more) in of_run
        .map(|out| (out, vec![]))
        .into_iter()
        .chain([("lab.html", vec!["--measurement", "lab.html", "--format", "csv"]), ("d/../d/numbers.json", vec![])])
    {
        let before = text(out);
        let ran = report(folder.path(), &[&["d", "--out", out][..], &more].concat());
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert_eq!(ran.status.code(), Some(2), "{out}: {said}");
        assert!(said.contains("would destroy the input"), "{said}");
        assert!(text(out) == before, "{out} was written over");
    }
    for out in ["page.json", "page", "page.html.gz"] {
        let ran = report(folder.path(), &["d", "--out", out]);
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert_eq!(ran.status.code(), Some(2), "{said}");
        assert!(said.contains("expected a name that ends in .html or .htm") && said.contains(out), "{said}");
        assert!(!folder.path().join(out).exists());
    }
    for out in ["page.htm", "d/other.HTML", "d/other.HTML"] {
        assert!(report(folder.path(), &["d", "--out", out]).status.success(), "{out}, twice if need be");
    }
}

#[test]
fn broken_files_beside_a_run_are_noted_on_its_page() {
    let folder = copy_of_the_demo();
    let d = folder.path().join("d");
    std::fs::write(d.join("effects.json"), "{\"scene\": \"sphe").expect("writes");
    for (name, bytes) in [("a", &b"{\"curves\": [{"[..]), ("b", b"\xff\xfe{}"), ("c", b"[1, 2]")] {
        std::fs::create_dir(d.join(name)).expect("makes");
        std::fs::write(d.join(name).join("tradeoff.json"), bytes).expect("writes");
    }
    std::fs::create_dir(d.join("tradeoff.json")).expect("makes");
    let ran = report(folder.path(), &["d", "--json"]);
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let page = std::fs::read_to_string(d.join("report.html")).expect("a page");
    for name in ["d/effects.json", "d/a/tradeoff.json", "d/b/tradeoff.json", "d/c/tradeoff.json"] {
        assert!(page.contains(&format!("A file is left out: {name}")), "{name}");
    }
    assert_eq!(page.matches("A file is left out").count(), 4);
}

#[test]
fn broken_files_among_fits_leave_the_others() {
    let folder = copy_of_the_demo();
    let fits = folder.path().join("fits");
    std::fs::create_dir_all(fits.join("x.json")).expect("makes");
    std::fs::create_dir(fits.join("x.csv")).expect("makes");
    let fit = std::fs::read(folder.path().join("d/lambert.json")).expect("reads");
    std::fs::write(fits.join("half.json"), &fit[..fit.len() / 2]).expect("writes");
    std::fs::write(fits.join("latin.json"), b"\"caf\xe9\"").expect("writes");
    std::fs::write(fits.join("effects.json"), "{").expect("writes");
    std::fs::copy(folder.path().join("d/measurement.csv"), fits.join("m.csv")).expect("copies");
    // Of what is broken alone there is no report; the file is named.
    let ran = report(folder.path(), &["fits"]);
    assert_eq!(ran.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&ran.stderr).contains("half.json"));

    std::fs::write(fits.join("whole.json"), &fit).expect("writes");
    let ran = report(folder.path(), &["fits", "--json"]);
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let told: Value = serde_json::from_slice(&ran.stdout).expect("JSON");
    assert_eq!(told["fits"], serde_json::json!(["whole"]));
    let missing = told["missing"].to_string();
    assert!(!missing.contains("measurement is not at hand"), "m.csv is the only file that may be one: {missing}");
    let page = std::fs::read_to_string(fits.join("report.html")).expect("a page");
    for name in ["half.json", "latin.json", "effects.json"] {
        assert_eq!(page.matches(&format!("A file is left out: fits/{name}")).count(), 1, "{name}");
    }
    assert!(!page.contains("x.json"));
}

#[test]
fn a_demos_own_instrument_has_a_plan_and_one_that_is_gone_has_none() {
    let page = std::fs::read_to_string(Run::shared().page()).expect("reads");
    assert!(page.contains("The instrument, shot and read noise: what is simulated"));

    let folder = copy_of_the_demo();
    let path = folder.path().join("d/numbers.json");
    let text = std::fs::read_to_string(&path).expect("reads");
    let gone = text.replace("\"shot and read noise\"", "\"bench.toml\"");
    assert_ne!(gone, text, "the demo names its instrument");
    std::fs::write(&path, gone).expect("writes");
    let ran = report(folder.path(), &["d", "--json"]);
    let told: Value = serde_json::from_slice(&ran.stdout).expect("JSON");
    let said = told["missing"].as_array().expect("a list").last().and_then(Value::as_str).expect("text");
    assert!(said.contains("bench.toml") && said.contains("goniofit effects"), "{said}");
    let page = std::fs::read_to_string(folder.path().join("d/report.html")).expect("reads");
    assert!(!page.contains("The instrument, bench.toml: what is simulated"));
}
