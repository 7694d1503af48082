//! Exit codes: 0 done, 1 the work failed, 2 the command line or an input is wrong.

use crate::bench::{Bench, broken, csv, fixture, nothing_to_fit};

#[test]
fn exit_codes_tell_wrong_input_from_failed_work() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    b.picture("a.exr", &[]);
    b.picture("b.exr", &["--seed", "1"]);
    b.ok(&["render", "--size", "16", "--samples", "2", "--out", "c.exr"]);
    b.write("none.csv", nothing_to_fit());
    b.write("broken.csv", broken());
    b.write("masked.csv", csv(&[(30.0, 10.0, 0.0, f64::NAN)]));
    b.write("huge.csv", csv(&[(30.0, 10.0, 0.0, 1e300)]));
    b.write("cut.json", "{\"format\": \"goniofit-material\", ");
    b.write("odd.toml", "version = 1\nname = \"odd\"\ncolour = 3\n");
    let table: [(&[&str], i32, &str); 30] = [
        (&["--no-such-option"], 2, "--no-such-option"),
        (&["fit"], 2, "FILE"),
        (&["fit", "p.csv", "--no-such-option"], 2, "--no-such-option"),
        (&["fit", "missing.csv"], 2, "missing.csv"),
        (&["fit", "broken.csv"], 2, "broken.csv, after line 1"),
        (&["fit", "."], 2, "."),
        (&["fit", "none.csv"], 1, "nothing valid to fit"),
        (&["fit", "masked.csv"], 1, "1 are masked"),
        (&["fit", "huge.csv"], 2, "1e300"),
        (&["fit", "p.csv", "--fix", "lambert.weight=1e300"], 1, "p.csv: the solver failed"),
        (&["fit", "p.csv", "p.csv", "--out", "x.json"], 2, "--out-dir"),
        (&["fit", "p.csv", "--out", "x.json", "--out-dir", "d"], 2, "--out-dir"),
        (&["info", "a.exr"], 2, "a.exr"),
        (&["simulate", "--material", "satin", "--scan", "spiral", "--out", "x.csv"], 2, "spiral"),
        (&["simulate", "--material", "satin", "--scan", "hemisphere:0", "--out", "x.csv"], 2, "hemisphere"),
        (&["simulate", "--material", "satin", "--scan", "hemisphere:0.1", "--out", "x.csv"], 2, "million"),
        (&["simulate", "--material", "satin", "--scan", "flat", "--out", "x.csv"], 2, "flat"),
        (&["simulate", "--material", "satin", "--out", "x.exr"], 2, "x.exr"),
        (&["simulate", "odd.toml", "--out", "x.csv"], 2, "odd.toml"),
        (&["render", "odd.toml", "--out", "x.exr"], 2, "odd.toml"),
        (&["render", "--material", "cut.json", "--out", "x.exr"], 2, "cut.json"),
        (&["render", "--size", "0", "--out", "x.exr"], 2, "--size"),
        (&["validate", "p.csv", "p.csv", "--out", "v"], 2, "p.csv"),
        (&["compare", "a.exr", "p.csv"], 2, "p.csv"),
        (&["compare", "a.exr", "c.exr"], 2, "24x24"),
        (&["compare", "a.exr", "b.exr", "--fail-above", "beauty=1"], 2, "beauty"),
        (&["compare", "a.exr", "b.exr", "--fail-above", "rmse=1e-9"], 1, "rmse"),
        (&["compare", "a.exr", "b.exr", "--fail-above", "rmse=1e9"], 0, ""),
        (&["compare", "a.exr", "b.exr"], 0, ""),
        (&["convert", "p.csv", "x.xyz"], 2, "x.xyz"),
    ];
    for (args, code, says) in table {
        let ran = b.run(args);
        assert_eq!(ran.code, Some(code), "{args:?}: {}", ran.err);
        assert!(ran.err.contains(says), "{args:?}: {} lacks {says}", ran.err);
        // A comparison that misses its limit still shows its numbers.
        if code != 0 && !says.eq("rmse") {
            assert!(ran.out.is_empty(), "{args:?}: {}", ran.text());
        }
    }
}

#[test]
fn every_broken_fixture_exits_2_and_names_the_file() {
    let b = Bench::new();
    let folder = fixture("invalid");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("lists") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() || path.extension().is_some_and(|e| e == "py") {
            continue;
        }
        count += 1;
        let ran = b.run(&["info", &path.to_string_lossy()]);
        assert_eq!(ran.code, Some(2), "{name}: {} {}", ran.text(), ran.err);
        assert!(ran.err.contains(&name) && ran.out.is_empty(), "{name}: {}", ran.err);
    }
    assert!(count > 50, "{count} fixtures");
}

#[test]
fn a_batch_keeps_what_is_finished_and_fails_as_its_failures_do() {
    let b = Bench::new();
    b.paint("good.csv");
    b.paint("late.csv");
    b.write("none.csv", nothing_to_fit());
    b.write("broken.csv", broken());
    for (k, (bad, code)) in [("none.csv", 1), ("broken.csv", 2), ("missing.csv", 2)].iter().enumerate() {
        let folder = format!("out-{k}");
        let ran = b.run(&["fit", "good.csv", bad, "late.csv", "--out-dir", &folder]);
        assert_eq!(ran.code, Some(*code), "{bad}: {}", ran.err);
        assert_eq!(b.list(&folder), ["good.json", "late.json"], "{bad}");
        assert!(ran.err.contains("1 of 3") && ran.err.contains(bad.trim_end_matches(".csv")), "{}", ran.err);
        assert!(ran.text().contains("good.csv") && ran.text().contains("late.csv"), "{}", ran.text());
    }
    let ran = b.run(&["fit", "good.csv", "late.csv", "--out-dir", "all"]);
    assert_eq!(ran.code, Some(0));
}

#[test]
fn two_measurements_of_one_name_are_refused_before_anything_is_written() {
    let b = Bench::new();
    b.paint("p.csv");
    std::fs::create_dir(b.path("other")).expect("a folder");
    std::fs::copy(b.path("p.csv"), b.path("other/p.csv")).expect("copies");
    let ran = b.run(&["fit", "p.csv", "other/p.csv", "--out-dir", "f"]);
    assert_eq!(ran.code, Some(2));
    assert!(ran.err.contains("p.json"), "{}", ran.err);
    assert!(!b.path("f").exists() || b.list("f").is_empty());
}

#[test]
fn a_batch_that_fails_prints_one_json_object_with_the_reason() {
    let b = Bench::new();
    b.paint("good.csv");
    let ran = b.run(&["fit", "good.csv", "missing.csv", "--out-dir", "f", "--json"]);
    assert_eq!(ran.code, Some(2));
    assert!(ran.json()["error"].to_string().contains("missing.csv"), "{}", ran.text());
}
