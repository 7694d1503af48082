//! `--json` prints one object on stdout and nothing else there; `--quiet` leaves stderr empty.

use crate::bench::{Bench, broken, keys, nothing_to_fit};

const SMALL: [&str; 4] = ["--size", "16", "--samples", "2"];

#[test]
fn every_command_prints_exactly_one_json_object() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    b.ok(&[&["render", "--out", "a.exr"], &SMALL[..]].concat());
    let with = |args: &[&'static str]| [args, &SMALL[..]].concat();
    let commands: Vec<Vec<&str>> = vec![
        with(&["demo", "--out", "d"]),
        vec!["simulate", "--material", "satin", "--scan", "hemisphere:30", "--out", "s.csv"],
        vec!["info", "p.csv"],
        vec!["fit", "p.csv"],
        vec!["fit", "p.csv", "--out", "f.json"],
        vec!["fit", "p.csv", "--log"],
        vec!["fit", "p.csv", "--model", "auto"],
        vec!["fit", "p.csv", "--robust", "huber"],
        vec!["fit", "p.csv", "--per-channel", "--bootstrap", "2"],
        with(&["render", "--material", "p.json", "--out", "r.exr"]),
        with(&["render", "--material", "p.csv", "--out", "r.exr", "--png", "r.png"]),
        with(&["validate", "p.csv", "p.json", "--out", "v"]),
        vec!["compare", "a.exr", "a.exr"],
        vec!["convert", "p.json", "c.csv"],
        vec!["models"],
        vec!["models", "satin"],
        vec!["scenes"],
        vec!["scenes", "sphere"],
        vec!["scenes", "sphere", "--toml"],
    ];
    for args in commands {
        let after = b.ok(&[&args[..], &["--json"]].concat()).json();
        let before = b.ok(&[&["--json"], &args[..]].concat()).json();
        assert_eq!(keys(&after), keys(&before), "{args:?}: the option may stand on either side");
        assert!(after.get("error").is_none(), "{args:?}: {after}");
    }
}

#[test]
fn several_fits_are_one_object_in_the_order_of_the_files() {
    let b = Bench::new();
    b.paint("b.csv");
    b.paint("a.csv");
    let all = b.json(&["fit", "b.csv", "a.csv", "--out-dir", "f"]);
    let files: Vec<&str> = all["fits"].as_array().expect("a list").iter().filter_map(|f| f["file"].as_str()).collect();
    assert_eq!(files, ["b.csv", "a.csv"]);
    assert_eq!(b.list("f"), ["a.json", "b.json"]);
}

#[test]
fn a_failure_is_one_object_with_the_reason_and_stderr_stays_empty() {
    let b = Bench::new();
    b.write("none.csv", nothing_to_fit());
    b.write("broken.csv", broken());
    for (args, code, says) in [
        (vec!["fit", "none.csv"], 1, "nothing valid to fit"),
        (vec!["fit", "broken.csv"], 2, "broken.csv"),
        (vec!["fit", "missing.csv"], 2, "missing.csv"),
        (vec!["fit", "--no-such-option"], 2, "--no-such-option"),
        (vec!["no-such-command"], 2, "no-such-command"),
        (vec![], 2, "subcommand"),
        (vec!["info", "missing.csv"], 2, "missing.csv"),
        (vec!["simulate", "--material", "velvet", "--out", "x.csv"], 2, "velvet"),
        (vec!["simulate", "--out", "x.csv"], 2, "--material"),
        (vec!["render", "--scene", "nowhere", "--out", "x.exr"], 2, "nowhere"),
        (vec!["validate", "missing.csv", "missing.json", "--out", "v"], 2, "missing"),
        (vec!["compare", "missing.exr", "missing.exr"], 2, "missing.exr"),
        (vec!["convert", "missing.csv", "x.csv"], 2, "missing.csv"),
        (vec!["models", "velvet"], 2, "velvet"),
        (vec!["scenes", "nowhere"], 2, "nowhere"),
    ] {
        let ran = b.run(&[&args[..], &["--json"]].concat());
        assert_eq!(ran.code, Some(code), "{args:?}: {}", ran.err);
        let object = ran.json();
        assert_eq!(keys(&object), ["error"], "{args:?}");
        assert!(object["error"].as_str().expect("a text").contains(says), "{args:?}: {object}");
        assert!(ran.err.is_empty(), "{args:?}: {}", ran.err);
    }
}

#[test]
fn quiet_silences_what_a_command_remarks_and_leaves_its_result() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let lines: [Vec<&str>; 2] = [
        vec!["fit", "p.csv", "--log"],
        vec!["render", "--material", "p.csv", "--size", "16", "--samples", "2", "--out", "r.exr"],
    ];
    for args in lines {
        let loud = b.ok(&args);
        assert!(!loud.err.is_empty(), "{args:?} has something to remark");
        let quiet = b.ok(&[&args[..], &["--quiet"]].concat());
        assert!(quiet.err.is_empty(), "{args:?}: {}", quiet.err);
        assert_eq!(quiet.text().lines().count(), loud.text().lines().count(), "{args:?}");
    }
}

#[test]
fn nothing_but_a_progress_bar_is_lost_where_stderr_is_no_terminal() {
    let b = Bench::new();
    let ran = b.picture("r.exr", &[]);
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
}
