//! `-` is stdin or stdout; a closed pipe is no error.

use serde_json::Value;

use crate::bench::{Bench, broken};

fn timeless(bytes: &[u8]) -> Value {
    let mut fit: Value = serde_json::from_slice(bytes).expect("a fit");
    fit["fit"]["seconds"] = 0.into();
    fit
}

#[test]
fn simulate_to_stdout_gives_the_bytes_of_the_csv_file() {
    let b = Bench::new();
    b.paint("p.csv");
    let args = ["simulate", "--material", "glossy-paint", "--scan", "hemisphere:10", "--seed", "3", "--out", "-"];
    assert!(b.ok(&args).out == b.bytes("p.csv"));
}

#[test]
fn a_fit_reads_stdin_and_writes_stdout_as_it_does_files() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let ran = b.run_on(&["fit", "-", "--out", "-"], &b.bytes("p.csv"));
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    assert_eq!(timeless(&ran.out), timeless(&b.bytes("p.json")));
    assert!(!b.path("-").exists());
}

#[test]
fn convert_passes_a_csv_through_unchanged() {
    let b = Bench::new();
    b.paint("p.csv");
    let ran = b.run_on(&["convert", "-", "-"], &b.bytes("p.csv"));
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    assert!(ran.out == b.bytes("p.csv"));
}

#[test]
fn a_fit_from_stdin_is_sampled_to_stdout_in_the_format_asked_for() {
    let b = Bench::new();
    let satin = b.ok(&["models", "satin"]).out;
    b.write("satin.json", &satin);
    b.ok(&["convert", "satin.json", "satin.binary"]);
    let ran = b.run_on(&["convert", "-", "-", "--to", "merl"], &satin);
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    assert!(ran.out == b.bytes("satin.binary"), "{} bytes", ran.out.len());
}

#[test]
fn info_sniffs_what_comes_through_stdin() {
    let b = Bench::new();
    b.paint("p.csv");
    let mut piped = b.run_on(&["info", "-", "--json"], &b.bytes("p.csv")).json();
    let mut file = b.json(&["info", "p.csv"]);
    for summary in [&mut piped, &mut file] {
        summary["name"] = "".into();
    }
    assert_eq!(piped, file);
    let ran = b.run_on(&["info", "-"], b"");
    assert_eq!(ran.code, Some(2));
    assert!(ran.err.contains("stdin"), "{}", ran.err);
}

#[test]
fn materials_and_measurements_come_from_stdin() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let small = ["--size", "16", "--samples", "2", "--out"];
    let render = [&["render", "--material", "-"], &small[..], &["r.exr"]].concat();
    let ran = b.run_on(&render, &b.bytes("p.json"));
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    let validate = [&["validate", "-", "p.json"], &small[..], &["v"]].concat();
    let ran = b.run_on(&validate, &b.bytes("p.csv"));
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    let simulate = ["simulate", "--material", "-", "--scan", "hemisphere:30", "--out", "s.csv"];
    let ran = b.run_on(&simulate, &b.bytes("p.json"));
    assert_eq!(ran.code, Some(0), "{}", ran.err);
}

#[test]
fn a_closed_pipe_is_no_error() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    for args in [
        vec!["--help"],
        vec!["fit", "--help"],
        vec!["models"],
        vec!["scenes", "cornell", "--toml"],
        vec!["info", "p.csv"],
        vec!["info", "p.csv", "--json"],
        vec!["fit", "p.csv"],
        vec!["fit", "p.csv", "--out", "-"],
        vec!["convert", "p.csv", "-"],
        vec!["simulate", "--material", "satin", "--scan", "hemisphere:10", "--out", "-"],
        vec!["render", "--size", "16", "--samples", "2", "--out", "-"],
    ] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let output = b.command(&args).stdout(writer).stderr(std::process::Stdio::piped()).output().expect("runs");
        let err = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((output.status.code(), err.as_str()), (Some(0), ""), "{args:?}");
    }
}

#[test]
fn a_closed_pipe_does_not_hide_that_the_work_failed() {
    let b = Bench::new();
    b.write("broken.csv", broken());
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let status = b.command(&["fit", "broken.csv", "--json"]).stdout(writer).status().expect("runs");
    assert_eq!(status.code(), Some(2));
}

#[test]
fn a_picture_on_stdout_is_alone_there() {
    let b = Bench::new();
    let small = ["--size", "16", "--samples", "2"];
    let exr = b.ok(&[&["render", "--out", "-"], &small[..]].concat()).out;
    assert!(exr.starts_with(&[0x76, 0x2f, 0x31, 0x01]), "OpenEXR's mark");
    let png = b.ok(&[&["render", "--out", "x.exr", "--png", "-"], &small[..]].concat()).out;
    assert!(png.starts_with(b"\x89PNG") && png.ends_with(b"IEND\xae\x42\x60\x82"), "{} bytes", png.len());
    let told = b"samples a pixel";
    assert!(!exr.windows(told.len()).any(|w| w == told), "the result in words follows the picture");
}

#[test]
fn a_fit_from_stdin_is_named_stdin_in_a_folder() {
    let b = Bench::new();
    b.paint("p.csv");
    assert_eq!(b.run_on(&["fit", "-", "--out-dir", "f"], &b.bytes("p.csv")).code, Some(0));
    assert_eq!(b.list("f"), ["stdin.json"]);
}
