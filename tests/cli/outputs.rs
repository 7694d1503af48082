//! An output file appears whole or not at all.

use crate::bench::{Bench, broken, fixture, nothing_to_fit};

/// Commands that fail, and the output that they were asked for.
fn failing(flat: &str) -> Vec<(Vec<&str>, &'static str)> {
    vec![
        (vec!["fit", "broken.csv", "--out", "x.json"], "x.json"),
        (vec!["fit", "none.csv", "--out", "x.json"], "x.json"),
        (vec!["simulate", "--material", "satin", "--scan", "hemisphere:30", "--out", "x.binary"], "x.binary"),
        (vec!["simulate", "--material", "velvet", "--out", "x.csv"], "x.csv"),
        (vec!["convert", "p.csv", "x.binary"], "x.binary"),
        (vec!["convert", "broken.csv", "x.csv"], "x.csv"),
        (vec!["render", "--material", flat, "--size", "16", "--samples", "2", "--out", "x.exr"], "x.exr"),
        (vec!["render", "--material", "broken.csv", "--size", "16", "--samples", "2", "--out", "x.exr"], "x.exr"),
    ]
}

#[test]
fn a_failing_command_leaves_no_file_and_keeps_the_old_one() {
    let b = Bench::new();
    b.paint("p.csv");
    b.write("none.csv", nothing_to_fit());
    b.write("broken.csv", broken());
    let flat = fixture("measurements/in-plane-flat-world.csv");
    for (args, out) in failing(&flat) {
        let before = b.list(".");
        assert_ne!(b.run(&args).code, Some(0), "{args:?}");
        assert_eq!(b.list("."), before, "{args:?} leaves nothing behind");
        b.write(out, "old");
        assert_ne!(b.run(&args).code, Some(0), "{args:?}");
        assert_eq!(b.text(out), "old", "{args:?}");
        std::fs::remove_file(b.path(out)).expect("removes");
    }
}

#[test]
fn a_succeeding_command_replaces_the_old_file_and_leaves_nothing_else() {
    let b = Bench::new();
    b.paint("p.csv");
    for (args, out) in [
        (vec!["fit", "p.csv", "--out", "x.json"], "x.json"),
        (vec!["convert", "p.csv", "x.csv"], "x.csv"),
        (vec!["render", "--size", "16", "--samples", "2", "--out", "x.exr"], "x.exr"),
    ] {
        b.write(out, "old");
        let before = b.list(".");
        b.ok(&args);
        assert_ne!(b.bytes(out), b"old", "{args:?}");
        assert_eq!(b.list("."), before, "{args:?}");
    }
}

#[test]
fn an_output_never_replaces_an_input() {
    let b = Bench::new();
    b.paint("p.csv");
    b.ok(&["fit", "p.csv", "--out", "p.json"]);
    b.write("a.json", b.text("p.csv"));
    b.write("s.toml", "version = 1\nmaterial = \"p.json\"\n");
    std::fs::create_dir(b.path("v")).expect("a folder");
    b.write("v/numbers.json", b.text("p.json"));
    let mut refused = vec![
        vec!["fit", "p.csv", "--out", "p.csv"],
        vec!["fit", "p.csv", "--out", "./v/../p.csv"],
        vec!["fit", "a.json", "--out-dir", "."],
        vec!["fit", "p.csv", "a.json", "--out-dir", "."],
        vec!["convert", "p.csv", "p.csv"],
        vec!["convert", "p.json", "p.json", "--to", "csv"],
        vec!["simulate", "--material", "p.csv", "--out", "p.csv"],
        vec!["simulate", "--material", "satin", "--scan", "list:p.csv", "--out", "p.csv"],
        vec!["validate", "p.csv", "v/numbers.json", "--out", "v"],
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("p.csv", b.path("link.csv")).expect("a link");
        std::os::unix::fs::symlink("p.json", b.path("link.exr")).expect("a link");
        refused.push(vec!["fit", "link.csv", "--out", "p.csv"]);
        refused.push(vec!["fit", "p.csv", "--out", "link.csv"]);
        refused.push(vec!["render", "--material", "p.json", "--out", "link.exr"]);
        refused.push(vec!["simulate", "s.toml", "--scan", "list:p.csv", "--out", "link.csv"]);
    }
    let kept = ["p.csv", "p.json", "a.json", "v/numbers.json"].map(|name| (name, b.bytes(name)));
    let before = b.list(".");
    for args in refused {
        let ran = b.run(&args);
        assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
        assert!(ran.err.contains("would destroy the input"), "{args:?}: {}", ran.err);
        assert_eq!(b.list("."), before, "{args:?}");
        assert!(kept.iter().all(|(name, bytes)| b.bytes(name) == *bytes), "{args:?}");
    }
    // Another fit of that name may be replaced, and what is no file can be both.
    b.ok(&["fit", "p.csv", "--out-dir", "."]);
    #[cfg(unix)]
    assert!(!b.run(&["convert", "/dev/null", "/dev/null", "--to", "csv"]).err.contains("destroy"));
}

#[test]
fn an_output_of_the_wrong_kind_is_said_before_the_work() {
    let b = Bench::new();
    b.paint("p.csv");
    std::fs::create_dir(b.path("folder")).expect("a folder");
    for args in [
        vec!["fit", "p.csv", "--out-dir", "p.csv"],
        vec!["fit", "p.csv", "--out-dir", "p.csv/deeper"],
        vec!["fit", "missing.csv", "--out", "folder"],
        vec!["convert", "missing.csv", "folder", "--to", "csv"],
        vec!["demo", "--out", "p.csv"],
    ] {
        let ran = b.run(&args);
        assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
        assert!(ran.err.contains("expected") && ran.err.contains("folder"), "{args:?}: {}", ran.err);
    }
}

#[test]
fn a_folder_that_is_not_there_is_said_and_nothing_is_written() {
    let b = Bench::new();
    b.paint("p.csv");
    let before = b.list(".");
    for args in [
        vec!["fit", "p.csv", "--out", "nowhere/x.json"],
        vec!["simulate", "--material", "satin", "--scan", "hemisphere:30", "--out", "nowhere/x.csv"],
        vec!["convert", "p.csv", "nowhere/x.csv"],
        vec!["render", "--size", "16", "--samples", "2", "--out", "nowhere/x.exr"],
    ] {
        let ran = b.run(&args);
        assert!(matches!(ran.code, Some(1 | 2)), "{args:?}: {:?}", ran.code);
        assert!(ran.err.contains("nowhere"), "{args:?}: {}", ran.err);
        assert_eq!(b.list("."), before, "{args:?}");
    }
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_an_error() {
    if !std::path::Path::new("/dev/full").exists() {
        println!("SKIPPED: this system has no /dev/full");
        return;
    }
    let b = Bench::new();
    b.paint("p.csv");
    for args in [
        vec!["fit", "p.csv", "--out", "/dev/full"],
        vec!["convert", "p.csv", "/dev/full", "--to", "csv"],
        vec!["render", "--size", "16", "--samples", "2", "--out", "/dev/full"],
    ] {
        let ran = b.run(&args);
        assert_eq!(ran.code, Some(1), "{args:?}: {}", ran.err);
        assert!(ran.err.contains("/dev/full"), "{args:?}: {}", ran.err);
    }
}
