//! `report`, and `--report`: one page, whole, from whatever is there.

use serde_json::json;

use crate::bench::{Bench, csv, number};

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
    // What accuracy costs was measured for it: both curves with their slopes, and the worth of each effect that is on.
    for (folder, settings) in [("accuracy-fit", 7), ("accuracy-render", 6)] {
        let curve = &b.json_file(&format!("d/{folder}/tradeoff.json"))["curves"][0];
        assert_eq!(curve["points"].as_array().expect("a list").len(), settings, "{folder}: {curve}");
        assert!(curve["slopes"].as_array().is_some_and(|s| !s.is_empty()), "{folder}: {curve}");
    }
    assert_eq!(b.json_file("d/effects.json")["scene"], "sphere-on-plane");
    assert!(!page.contains("another second buys is not measured here"), "it does not ask for what is there");
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
    let effects = "goniofit effects --scene sphere-on-plane --material q.json --json ";
    for part in ["lambert+phong", "table.exr", "hemisphere", "fit-2.exr", effects] {
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
    // The folder can be reported on as well; how to name the measurement is said once.
    let missing = b.json(&["report", "fits"])["missing"][0].as_str().unwrap().to_owned();
    assert!(missing.ends_with("Name it: goniofit report fits --measurement FILE"), "{missing}");
    assert_eq!(missing.matches("--measurement").count(), 1, "{missing}");
    std::fs::remove_file(b.path("fits/report.html")).unwrap();
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

/// A write that was cut short, or another file under a picture's name, costs that picture and no more.
#[test]
fn a_picture_that_can_t_be_read_is_left_out_and_the_rest_is_there() {
    let b = Bench::new();
    b.ok(&["demo", "--size", "24", "--samples", "4", "--out", "d"]);
    let whole = b.bytes("d/truth.exr");
    for (name, bytes) in [
        ("lambert", whole[..whole.len() / 2].to_vec()),
        ("lambert", Vec::new()),
        ("lambert", whole[..200].to_vec()),
        ("truth", b"not a picture".to_vec()),
    ] {
        let file = format!("d/{name}.exr");
        let kept = b.bytes(&file);
        b.write(&file, bytes);
        let ran = b.ok(&["report", "d", "--json"]);
        let (said, page) = (ran.json(), b.text("d/report.html"));
        assert_eq!(said["pictures"], 2, "{name}");
        let note = said["notes"][0].as_str().unwrap();
        assert!(note.contains(&format!("The picture of {name} is left out: {file}")), "{note}");
        assert!(ran.err.contains(&format!("warning: {note}")) && page.contains(&format!("{name} is left out")));
        // The numbers are those of the run, against what they were measured against.
        assert!(page.contains("picture against that of the truth") && page.contains("lambert+phong.exr"), "{name}");
        b.write(&file, kept);
    }
    assert_eq!(b.json(&["report", "d"])["notes"].as_array().unwrap().len(), 0);
}

/// The table is what the instrument saw, so a fit through it is compared as the instrument would see that, wherever both stand together.
#[test]
fn a_fit_through_an_instrument_is_compared_through_it_or_said_to_be_not() {
    let b = Bench::new();
    b.write("wide.toml", "version = 1\n[instrument]\nelectrons = 1e6\n[instrument.detector]\naperture_deg = 4.0\n");
    let simulate = ["simulate", "--material", "glossy-paint", "--instrument", "wide.toml", "--scan", "hemisphere:15"];
    b.ok(&[&simulate[..], &["--out", "m.csv"]].concat());
    std::fs::create_dir(b.path("fits")).unwrap();
    b.ok(&["fit", "m.csv", "--through", "wide.toml", "--out", "fits/m.json", "--report"]);
    let rmse = number(&b.json_file("fits/m.json")["fit"]["rmse"]);
    let drawn = || number(&b.json(&["plot", "residuals", "m.csv", "fits/m.json", "--out", "r.svg"])["rmse"]);
    let peak = || {
        let found = b.json(&["plot", "slice", "m.csv", "fits/m.json", "--incidence", "30", "--out", "s.svg"]);
        let fit = &found["slices"][0]["curves"][1];
        // Where the aperture reaches below the horizon a fit has no value.
        let values = fit["value"].as_array().unwrap().iter().filter_map(serde_json::Value::as_f64);
        values.fold(0.0, f64::max)
    };
    let through = (drawn(), peak());
    assert!((through.0 / rmse - 1.0).abs() < 1e-6, "{} vs {rmse}", through.0);
    b.ok(&["validate", "m.csv", "fits/m.json", "--size", "16", "--samples", "4", "--out", "v"]);
    let report = |folder: &str| {
        let said = b.json(&["report", folder, "--measurement", "m.csv"]);
        (said["notes"].as_array().unwrap().clone(), b.text(&format!("{folder}/report.html")))
    };
    let sees = "Like the readings, lambert+phong as wide.toml sees it.";
    for page in [b.text("fits/m.html"), report("v").1] {
        assert!(page.contains(sees) && !page.contains("own rmse is"), "the residuals are those of the fit");
    }
    let (notes, page) = report("v");
    assert!(notes.is_empty() && page.contains("its picture is of the surface"), "{notes:?}");
    assert!(page.contains("fits/m.json --through wide.toml --out residuals.svg"));
    assert!(report("fits").1.contains("Like the readings, m as wide.toml sees it."));
    // Without the instrument's file, or with another under its name, it is said.
    for (content, says) in [(None, "not at hand"), (Some("aperture_deg = 2.0"), "now it has an aperture of 2.000°")] {
        std::fs::remove_file(b.path("wide.toml")).ok();
        if let Some(aperture) = content {
            b.write(
                "wide.toml",
                format!("version = 1\n[instrument]\nelectrons = 1e6\n[instrument.detector]\n{aperture}\n"),
            );
        }
        for folder in ["v", "fits"] {
            let (notes, page) = report(folder);
            let note = notes[0].as_str().unwrap();
            assert!(note.contains(says) && note.contains("drawn as the surface"), "{note}");
            assert!(page.contains("drawn as the surface") && !page.contains("sees it."), "{folder}");
            assert!(page.contains("own rmse is"), "{folder}: residuals of another prediction than the fit's");
        }
        let ran = b.ok(&["plot", "residuals", "m.csv", "fits/m.json", "--out", "r.svg"]);
        assert!(ran.err.contains("warning: fits/m.json: fitted through") && ran.err.contains(says), "{}", ran.err);
        assert!(drawn() > 5.0 * through.0 && peak() > 1.01 * through.1, "{} {} vs {through:?}", drawn(), peak());
    }
}

/// What is left of `validate` where it was stopped while it rendered the table.
#[test]
fn fits_that_were_not_rendered_are_there_and_said_to_be_not_rendered() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    std::fs::create_dir(b.path("v")).unwrap();
    let mut numbers = json!({
        "measurement": "p.csv", "scene": "sphere-on-plane", "reference": "table.exr", "fits": [], "stopped": true,
        "not_rendered": [{"fit": "p.json", "model": "lambert+phong"}],
    });
    b.write("v/numbers.json", numbers.to_string());
    let said = b.json(&["report", "v"]);
    assert_eq!(said["fits"], json!(["lambert+phong"]));
    assert!(said["notes"].to_string().contains("lambert+phong was not rendered: the run was stopped"), "{said}");
    let page = b.text("v/report.html");
    assert!(page.contains("lambert+phong was not rendered") && !page.contains("Make one: goniofit fit"));
    // Earlier versions did not say which.
    numbers["not_rendered"] = json!(null);
    b.write("v/numbers.json", numbers.to_string());
    let missing = b.json(&["report", "v"])["missing"].to_string();
    assert!(missing.contains("The fits that were given are not here") && !missing.contains("Make one"), "{missing}");
}

/// A measurement that is named by mistake is told by what the fit's file says of its own, and not judged by that.
#[test]
fn a_fit_beside_another_measurement_is_said_to_be_of_another() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    b.ok(&["validate", "p.csv", "p.json", "--size", "16", "--samples", "4", "--out", "v"]);
    assert_eq!(b.json(&["report", "v"])["notes"], json!([]), "the fit is of its own measurement");
    let simulate = |material: &str, scan: &str, file: &str| {
        b.ok(&["simulate", "--material", material, "--scan", scan, "--seed", "5", "--out", file]);
    };
    simulate("satin", "hemisphere:10", "other.csv");
    simulate("glossy-paint", "in-plane:20", "few.csv");
    for (file, found) in [("other.csv", "expected its"), ("few.csv", "directions that it was made of")] {
        let ran = b.ok(&["report", "v", "--measurement", file, "--json"]);
        let (said, page) = (ran.json(), b.text("v/report.html"));
        let note = said["notes"][0].as_str().unwrap_or_default().to_owned();
        let start = format!("lambert+phong: the fit was not made of this measurement, {file}: ");
        assert!(note.starts_with(&start) && note.contains(found), "{said}");
        assert!(ran.err.contains(&format!("warning: {note}")), "{}", ran.err);
        assert!(page.contains(&start) && page.contains("is not of these readings"), "{file}");
        assert!(!page.contains("describes the readings") && !page.contains("comes closest"), "{file}");
    }
    // A fit of a part of the samples, or by another loss, is one of its measurement all the same.
    let ways: [&[&str]; 5] =
        [&["--stride", "3"], &["--max-angle", "60"], &["--loss", "log"], &["--robust", "cauchy"], &["--per-channel"]];
    for (k, way) in ways.into_iter().enumerate() {
        let folder = format!("f{k}");
        std::fs::create_dir(b.path(&folder)).unwrap();
        b.ok(&[&["fit", "p.csv", "--out", &format!("{folder}/p.json")], way].concat());
        assert_eq!(b.json(&["report", &folder, "--measurement", "p.csv"])["notes"], json!([]), "{way:?}");
    }
}

#[test]
fn fits_of_different_measurements_are_not_compared() {
    let b = Bench::new();
    std::fs::create_dir(b.path("fits")).unwrap();
    for (scan, name) in [("hemisphere:10", "a"), ("in-plane:10", "b")] {
        let file = format!("{name}.csv");
        b.ok(&["simulate", "--material", "glossy-paint", "--scan", scan, "--out", &file]);
        b.ok(&["fit", &file, "--out", &format!("fits/{name}.json")]);
    }
    let ran = b.ok(&["report", "fits", "--json"]);
    let (said, page) = (ran.json(), b.text("fits/report.html"));
    let note = said["notes"][0].as_str().unwrap_or_default();
    assert!(note.starts_with("The fits are of different measurements, or took different samples: a is of"), "{said}");
    assert!(ran.err.contains(&format!("warning: {note}")) && page.contains("which is the best can"), "{}", ran.err);
    assert!(!page.contains("rmse of the best fit") && !page.contains("Time and rmse of the fits"));
    let missing = said["missing"].to_string();
    assert!(missing.contains("Render each fit beside its own measurement: goniofit validate FILE FIT.json"), "{said}");
    // Beside the measurement of one of them the other is named.
    let said = b.json(&["report", "fits", "--measurement", "b.csv"]);
    assert!(said["notes"][1].as_str().is_some_and(|n| n.starts_with("a: the fit was not made of")), "{said}");
    assert_eq!(said["notes"].as_array().unwrap().len(), 2, "{said}");
}

#[test]
fn what_is_no_run_is_refused_by_name() {
    let b = Bench::new();
    std::fs::create_dir(b.path("empty")).unwrap();
    std::fs::create_dir(b.path("odd")).unwrap();
    b.write("odd/numbers.json", "{\"a\": 1}");
    std::fs::create_dir(b.path("broken")).unwrap();
    b.write("broken/numbers.json", "{");
    b.write("page.html", "<!doctype html>");
    for (folder, expected) in [
        ("none", "found no such folder"),
        ("page.html", "tradeoff wrote to, found a file"),
        ("empty", "expected numbers.json of demo or validate, fits (.json) or a sweep"),
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

/// What `tradeoff` writes of a curve of three settings.
const SWEEP: &str = r#"{"stage": "render", "subject": "cornell", "measures": [{"name": "relmse"}],
            "commands": [["goniofit", "render", "--scene", "cornell", "--out", "my OUT.exr"]],
            "run": {"program": "goniofit 9.9", "command": ["goniofit", "tradeoff", "render", "--scene", "cornell", "--out", "my sweep"]},
            "curves": [{"name": "independent points", "main": "relmse",
            "points": [{"seconds": {"value": 0.1, "low": 0.09, "high": 0.11}, "errors": [{"value": 0.2, "low": 0.18, "high": 0.22}],
                        "setting": "--samples 4", "standing": "front", "promise": 0.25, "kept": 7, "judged": 8},
                       {"seconds": {"value": 0.4, "low": 0.39, "high": 0.41}, "errors": [{"value": 0.1, "low": 0.09, "high": null}],
                        "setting": "--samples 16", "standing": "undecided"},
                       {"seconds": {"value": 0.5, "low": 0.49, "high": 0.51}, "errors": [{"value": 0.3, "low": 0.29, "high": 0.31}],
                        "setting": "--samples 17", "standing": "beaten"}],
            "slopes": [{"measure": "relmse", "slope": {"value": -0.51, "low": -0.55, "high": -0.47},
                        "law": {"theory": {"kind": "exactly", "slope": -0.5}, "why": "independent samples"}}]}]}"#;

#[test]
fn a_folder_of_sweeps_alone_has_a_page_of_its_own() {
    let b = Bench::new();
    std::fs::create_dir_all(b.path("s/deeper")).unwrap();
    b.write("s/tradeoff.json", SWEEP);
    let said = b.json(&["report", "s"]);
    assert_eq!((&said["missing"], &said["notes"], &said["warnings"]), (&json!([]), &json!([]), &json!(0)));
    let page = b.text("s/report.html");
    assert_whole(&page);
    // The only one says how all of it was made.
    let typed = "goniofit tradeoff render --scene cornell --out &#39;my sweep&#39;";
    let run = format!("<p>The run:</p><pre tabindex=\"0\"><code>{typed}</code></pre>");
    for part in ["<h1 id=\"title\">cornell: accuracy for time</h1>", "measured by tradeoff render", &run, "−0.510"] {
        assert!(page.contains(part), "{part}");
    }
    for part in ["id=\"measured\"", "#measured", "id=\"pictures\"", "There is no fit"] {
        assert!(!page.contains(part), "{part} has nothing to show");
    }
    // One that can't be read costs itself alone; where it is all that there is, it is the reason.
    b.write("s/deeper/tradeoff.json", "{\"stage\": 1}");
    let said = b.json(&["report", "s"]);
    assert!(said["notes"][0].as_str().is_some_and(|note| note.contains("s/deeper/tradeoff.json")), "{said}");
    let ran = b.run(&["report", "s/deeper"]);
    assert!(ran.code == Some(2) && ran.err.contains("expected what goniofit wrote there"), "{}", ran.err);
}

#[test]
fn a_sweep_that_ended_early_is_said_to_have() {
    let b = Bench::new();
    std::fs::create_dir(b.path("s")).unwrap();
    let trial = json!({"seconds": 0.1, "errors": [0.2]});
    let mut sweep: serde_json::Value = serde_json::from_str(SWEEP).unwrap();
    sweep["trials"] = json!(8);
    sweep["ended"] = json!("stopped");
    for (k, made) in [3, 2, 2].into_iter().enumerate() {
        sweep["curves"][0]["points"][k]["trials"] = json!(vec![trial.clone(); made]);
    }
    b.write("s/tradeoff.json", sweep.to_string());
    let ran = b.ok(&["report", "s", "--json"]);
    let (said, page) = (ran.json(), b.text("s/report.html"));
    let note = "The sweep render: cornell was stopped early: of 8 trials asked for, each setting shown has 2 to 3.";
    assert!(said["notes"][0].as_str().is_some_and(|n| n.starts_with(note)) && said["warnings"] == 1, "{said}");
    assert!(ran.err.contains(&format!("warning: {note}")) && page.contains(note), "{}", ran.err);
    assert!(!page.contains("8 trials of each setting"));
}

#[test]
fn sweeps_and_effects_in_the_folder_join_the_page() {
    let b = Bench::new();
    b.ok(&["demo", "--size", "24", "--samples", "4", "--out", "d"]);
    let effects = ["effects", "--scene", "sphere-on-plane", "--size", "16", "--samples", "4", "--json"];
    // Of the scene's own material they are not the demo's.
    b.write("d/effects.json", &b.ok(&effects).out);
    b.ok(&["report", "d"]);
    assert!(!b.text("d/report.html").contains("off without it"), "figures of another material");
    b.write("d/effects.json", &b.ok(&[&effects[..], &["--material", "glossy-paint"]].concat()).out);
    std::fs::create_dir(b.path("d/sweep")).unwrap();
    b.write("d/sweep/tradeoff.json", SWEEP);
    b.ok(&["report", "d"]);
    let page = b.text("d/report.html");
    for part in ["off without it", "render: cornell", "−0.510", "−0.500", "independent samples"] {
        assert!(page.contains(part), "{part}");
    }
    // The settings of the front with what they promise, each a row that its setting heads, and once more among all of them.
    let cell = |text: &str| format!("<td class=\"n\">{text}</td>");
    let first: String = ["100\u{a0}ms", "relmse 0.2", "0.18 to 0.22", "0.25 in 7 of 8"].map(cell).concat();
    let second: String = ["400\u{a0}ms", "relmse 0.1", "–", "–"].map(cell).concat();
    for (mark, samples, cells) in [('*', 4, first), ('~', 16, second)] {
        let head = format!("<td>{mark}</td><th scope=\"row\">--samples {samples}</th><td>independent points</td>");
        assert_eq!(page.matches(&(head.clone() + &cells)).count(), 2, "{head}{cells}");
    }
    assert_eq!(
        page.matches("<td> </td><th scope=\"row\">--samples 17</th>").count(),
        1,
        "it is beaten: among all alone"
    );
    // How it is measured again, as it is typed.
    let typed = "goniofit tradeoff render --scene cornell --out &#39;my sweep&#39;";
    assert!(page.contains(&format!("Measured by goniofit 9.9: <code>{typed}</code>")), "{typed}");
    assert!(page.contains(&format!("<td><code>{typed}</code></td>")), "among the commands");
    assert!(page.contains("options of: goniofit render --scene cornell --out &#39;my OUT.exr&#39;"));
}
