//! `report`, and `--report`: one page, whole, from whatever is there.

use crate::bench::{Bench, csv};

/// A page's visible data are where they belong: nothing from a file or name became markup.
fn assert_whole(page: &str) {
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    for part in ["http://", "https://", "src=\"/", "url("] {
        let found = page.match_indices(part).find(|(at, _)| !page[*at..].starts_with("http://www.w3.org/2000/svg"));
        assert!(found.is_none(), "{part}: {:?}", found.map(|(at, _)| &page[at..(at + 80).min(page.len())]));
    }
}

#[test]
fn the_demo_and_report_write_the_same_page() {
    let b = Bench::new();
    let said = b.json(&["demo", "--size", "24", "--samples", "4", "--out", "d", "--report"]);
    assert_eq!(said["report"], "d/report.html");
    let page = b.text("d/report.html");
    assert_whole(&page);
    for part in
        ["glossy-paint", "lambert+phong", "goniofit demo --size 24 --samples 4 --out d --report", "goniofit plot"]
    {
        assert!(page.contains(part), "{part}");
    }
    let told = b.json(&["report", "d", "--out", "again.html"]);
    assert_eq!(told["bytes"], page.len());
    assert_eq!((&told["pictures"], &told["fits"][1]), (&3.into(), &"lambert+phong".into()));
    assert!(b.text("again.html") == page, "the folder holds all that the page shows");
    b.ok(&["report", "d", "--out", "one.html", "--threads", "1"]);
    assert!(b.text("one.html") == page, "whatever the number of threads");
    assert!(b.ok(&["report", "d", "--out", "-"]).text() == page, "on stdout too");
    // From another place the run's own folder is remembered.
    let other = Bench::new();
    other.ok(&["report", &b.path("d").to_string_lossy(), "--out", "far.html"]);
    assert!(other.text("far.html").contains("glossy-paint"));
}

#[test]
fn validate_reports_on_a_table_and_its_fits() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    b.ok(&["fit", "p.csv", "--model", "lambert", "--out", "q.json"]);
    let args = ["validate", "p.csv", "p.json", "q.json", "--size", "24", "--samples", "4", "--out", "v", "--report"];
    b.ok(&args);
    let page = b.text("v/report.html");
    assert_whole(&page);
    for part in ["lambert+phong", "table.exr", "hemisphere", "fit-2.exr"] {
        assert!(page.contains(part), "{part}");
    }
    let numbers = b.json_file("v/numbers.json");
    assert_eq!(numbers["run"]["command"][1], "validate");
    // Without the measurement the rest is there, and what is missing is said.
    std::fs::remove_file(b.path("p.csv")).unwrap();
    let told = b.json(&["report", "v"]);
    let missing = told["missing"][0].as_str().unwrap();
    assert!(missing.contains("p.csv") && missing.contains("--measurement"), "{missing}");
    assert!(b.text("v/report.html").contains("fit-2.exr"));
}

#[test]
fn fit_writes_a_page_beside_each_fit() {
    let b = Bench::new();
    b.paint("p.csv");
    let said = b.json(&["fit", "p.csv", "--out", "p.json", "--report", "--model", "auto"]);
    assert_eq!(said["report"], "p.html");
    let page = b.text("p.html");
    assert_whole(&page);
    assert!(page.contains("held out") && page.contains("(chosen)"), "the models compared");
    assert!(page.contains("goniofit validate p.csv p.json --out DIR --report"), "how to get pictures");
    b.ok(&["fit", "p.csv", "--out-dir", "fits", "--report"]);
    assert_eq!(b.list("fits"), ["p.html", "p.json"]);
    // The folder can be reported on as well.
    std::fs::copy(b.path("p.csv"), b.path("fits/p.csv")).unwrap();
    assert_eq!(b.json(&["report", "fits"])["missing"].as_array().unwrap().len(), 2, "pictures and curves");
    for args in [&["fit", "p.csv", "--report"][..], &["fit", "p.csv", "--out", "-", "--report"]] {
        let ran = b.run(args);
        assert_eq!(ran.code, Some(2));
        assert!(ran.err.contains("--report: expected --out FIT.json or --out-dir D"), "{}", ran.err);
    }
}

#[test]
fn names_from_files_stay_text() {
    let b = Bench::new();
    let nasty = "</script><img src=x onerror=alert(1)>&\"'";
    let rows: Vec<(f64, f64, f64, f64)> =
        (0..9).flat_map(|i| (0..9).map(move |o| (f64::from(i) * 10.0, f64::from(o) * 10.0, 0.0, 0.3))).collect();
    let table = csv(&rows).replacen(",r\n", &format!(",\"{}\"\n", nasty.replace('"', "\"\"")), 1);
    b.write("n.csv", table);
    b.ok(&["fit", "n.csv", "--model", "lambert", "--out", "n.json", "--report"]);
    let page = b.text("n.html");
    assert!(!page.contains("<img src=x"), "a channel's name became markup");
    assert_eq!(page.matches("</script>").count(), 2, "the page's own two scripts end, and nothing else does");
    b.ok(&["plot", "slice", "n.csv", "n.json", "--out", "n.svg"]);
    assert!(!b.text("n.svg").contains("<img src=x"));
}

#[test]
fn what_is_no_run_is_refused_by_name() {
    let b = Bench::new();
    std::fs::create_dir(b.path("empty")).unwrap();
    std::fs::create_dir(b.path("odd")).unwrap();
    b.write("odd/numbers.json", "{\"a\": 1}");
    std::fs::create_dir(b.path("broken")).unwrap();
    b.write("broken/numbers.json", "{");
    for (folder, expected) in [
        ("none", "found no such folder"),
        ("empty", "expected numbers.json of demo or validate, or fits"),
        ("odd", "neither `truth` nor `reference`"),
        ("broken", "numbers.json"),
    ] {
        let ran = b.run(&["report", folder]);
        assert_eq!(ran.code, Some(2), "{folder}");
        assert!(ran.err.contains(expected) && ran.err.contains(folder), "{folder}: {}", ran.err);
        assert!(!b.path(&format!("{folder}/report.html")).exists());
    }
    let ran = b.run(&["report", "empty", "--out", "-", "--json"]);
    assert_eq!(ran.code, Some(2));
}

#[test]
fn sweeps_and_effects_in_the_folder_join_the_page() {
    let b = Bench::new();
    b.ok(&["demo", "--size", "24", "--samples", "4", "--out", "d"]);
    let effects = b.ok(&["effects", "--scene", "sphere-on-plane", "--size", "16", "--samples", "4", "--json"]);
    b.write("d/effects.json", &effects.out);
    std::fs::create_dir(b.path("d/sweep")).unwrap();
    b.write(
        "d/sweep/tradeoff.json",
        r#"{"stage": "render", "subject": "cornell", "measures": [{"name": "relmse"}], "curves": [{"name": "independent points", "main": "relmse",
            "points": [{"seconds": {"value": 0.1, "low": 0.09, "high": 0.11}, "errors": [{"value": 0.2, "low": 0.18, "high": 0.22}]},
                       {"seconds": {"value": 0.4, "low": 0.39, "high": 0.41}, "errors": [{"value": 0.1, "low": 0.09, "high": null}]}],
            "slopes": [{"measure": "relmse", "slope": {"value": -0.51, "low": -0.55, "high": -0.47},
                        "law": {"theory": {"kind": "exactly", "slope": -0.5}, "why": "independent samples"}}]}]}"#,
    );
    b.ok(&["report", "d"]);
    let page = b.text("d/report.html");
    for part in ["off without it", "render: cornell", "−0.510", "−0.500", "independent samples"] {
        assert!(page.contains(part), "{part}");
    }
}
