//! `plot`: figures whose numbers are those of the files.

use crate::bench::{Bench, fixture, number};

#[test]
fn every_kind_writes_svg_and_png() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    for (kind, files) in [
        ("polar", &["p.csv", "p.json", "satin"][..]),
        ("slice", &["p.csv", "p.json"]),
        ("residuals", &["p.csv", "p.json"]),
        ("coverage", &["p.csv"]),
    ] {
        let plot = |out: &str, more: &[&str]| b.json(&[&["plot", kind][..], files, &["--out", out], more].concat());
        plot("f.svg", &[]);
        let svg = b.text("f.svg");
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && !svg.contains("var("), "{kind}");
        plot("f.png", &["--width", "300"]);
        let png = b.bytes("f.png");
        assert!(png.starts_with(b"\x89PNG\r\n"), "{kind}");
        assert_eq!(u32::from_be_bytes(png[16..20].try_into().unwrap()), 300, "{kind}");
        b.ok(&[&["plot", kind][..], files, &["--out", "g.svg", "--threads", "1"]].concat());
        assert!(b.text("g.svg") == svg, "{kind}: whatever the number of threads");
    }
}

#[test]
fn a_slice_holds_the_readings_and_the_fit() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let found = b.json(&["plot", "slice", "p.csv", "p.json", "--incidence", "30", "--channel", "r", "--out", "f.svg"]);
    assert_eq!((&found["channel"], &found["unit"]), (&"r".into(), &"1/sr".into()));
    let [readings, fit] = [0, 1].map(|k| &found["slices"][0]["curves"][k]);
    assert_eq!(readings["name"], "readings");
    // The mirror direction's reading, straight from the file: θi 30°, θo 30°, opposite azimuths.
    let text = b.text("p.csv");
    let header: Vec<&str> = text.lines().find(|l| !l.starts_with('#')).unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).expect("a column");
    let rows = text.lines().filter(|l| !l.starts_with('#')).skip(1).map(|l| l.split(',').collect::<Vec<_>>());
    let angle = |row: &[&str], name: &str| row[column(name)].parse::<f64>().unwrap();
    let mirror = rows.into_iter().find(|row| {
        let turned = (angle(row, "phi_o_deg") - angle(row, "phi_i_deg")).rem_euclid(360.0);
        angle(row, "theta_i_deg") == 30.0 && angle(row, "theta_o_deg") == 30.0 && (turned - 180.0).abs() < 1e-6
    });
    let mirror: f64 = mirror.expect("a reading")[column("r")].parse().unwrap();
    let angles = |curve: &serde_json::Value| -> Vec<f64> {
        curve["theta_o_deg"].as_array().unwrap().iter().map(number).collect()
    };
    let at =
        |curve: &serde_json::Value, theta: f64| angles(curve).iter().position(|t| (t - theta).abs() < 1e-6).unwrap();
    assert_eq!(number(&readings["value"][at(readings, 30.0)]), mirror);
    // The fit's own value there: kd/π + ks (n + 2)/2π.
    let lobes = &b.json_file("p.json")["lobes"];
    let (kd, ks) = (number(&lobes[0]["weight"][0]), number(&lobes[1]["weight"][0]));
    let n = number(&lobes[1]["shape"]["exponent"]);
    let want = kd / std::f64::consts::PI + ks * (n + 2.0) / std::f64::consts::TAU;
    let value = number(&fit["value"][at(fit, 30.0)]);
    assert!((value - want).abs() < 1e-9, "{value} vs {want}");
}

#[test]
fn residuals_add_up_to_the_fits_own_and_coverage_is_the_scans() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    let found = b.json(&["plot", "residuals", "p.csv", "p.json", "--out", "f.svg"]);
    let rmse = number(&b.json_file("p.json")["fit"]["rmse"]);
    assert!((number(&found["rmse"]) / rmse - 1.0).abs() < 1e-6, "{found}");
    for map in found["maps"].as_array().unwrap() {
        let count: u64 = map["count"].as_array().unwrap().iter().map(|c| c.as_u64().unwrap()).sum();
        assert_eq!(count, found["values"].as_u64().unwrap());
    }
    // Polar angles 0°, 10° … 80°, cells of ±5°: all but what lies beyond 85°.
    let covered = number(&b.json(&["plot", "coverage", "p.csv", "--out", "c.svg"])["covered"]);
    let want = 1.0 - 85f64.to_radians().cos();
    assert!((covered - want).abs() < 1e-9, "{covered} vs {want}");
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    b.write("flat.csv", std::fs::read(fixture("measurements/in-plane-flat-world.csv")).expect("reads"));
    let setting = |s: f64| format!(r#"{{"seconds": {{"value": {s}}}, "errors": [{{"value": {s}, "low": {s}}}]}}"#);
    let sweep = |settings: &str| {
        let curve = format!(r#"{{"name": "c", "main": "error", "knob": "stride", "points": [{settings}]}}"#);
        format!(r#"{{"stage": "fit", "subject": "s", "measures": [{{"name": "error"}}], "curves": [{curve}]}}"#)
    };
    b.write("sweep.json", sweep(&setting(1.0)));
    b.write("pair.json", sweep(&[setting(1.0), setting(2.0)].join(", ")));
    for (args, expected) in [
        (&["slice", "p.csv", "--out", "f.pdf"][..], "--out: expected a name that ends in .svg or .png"),
        (&["slice", "p.csv", "--channel", "x", "--out", "f.svg"], "--channel: expected one of r, g, b, found x"),
        (&["slice", "p.csv", "p.csv", "--out", "f.svg"], "expected one measurement"),
        (&["slice", "p.csv", "--incidence", "91", "--out", "f.svg"], "expected degrees from 0 to 90"),
        (&["residuals", "p.csv", "p.csv", "--out", "f.svg"], "expected a fitted material"),
        (&["coverage", "flat.csv", "--out", "f.svg"], "expected a measurement of space"),
        (&["coverage", "p.csv", "--out", "no/f.svg"], "there is no such folder"),
        (&["coverage", "none.csv", "--out", "f.svg"], "none.csv"),
        (&["tradeoff", "none.json", "--out", "f.svg"], "none.json"),
        (&["tradeoff", "p.json", "--out", "f.svg"], "expected the tradeoff.json"),
        (&["tradeoff", "p.csv", "--out", "f.svg"], "expected the tradeoff.json"),
        (&["tradeoff", "sweep.json", "--out", "f.svg"], "expected a curve of two settings or more"),
        (&["tradeoff", "pair.json", "--only", "x", "--out", "f.svg"], "--only: expected any of error-time, found x"),
    ] {
        let ran = b.run(&[&["plot"][..], args].concat());
        assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
        assert!(ran.err.contains(expected), "{args:?}: {}", ran.err);
        assert!(!b.path("f.svg").exists());
    }
}

#[test]
fn every_format_and_the_flat_world_can_be_drawn_and_reported() {
    let b = Bench::new();
    for entry in std::fs::read_dir(fixture("measurements")).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|e| e == "py") {
            continue;
        }
        let file = path.to_string_lossy();
        let mut drawn = 0;
        for args in [
            &["plot", "coverage", &file, "--out", "f.svg"][..],
            &["plot", "slice", &file, "--out", "f.svg"],
            &["fit", &file, "--model", "lambert", "--max-angle", "90", "--out", "f.json", "--report"],
        ] {
            let ran = b.run(args);
            assert!(matches!(ran.code, Some(0..=2)), "{args:?}: {:?} {}", ran.code, ran.err);
            drawn += usize::from(ran.code == Some(0));
        }
        assert!(drawn > 0, "nothing of {file}");
    }
    b.write("flat.csv", std::fs::read(fixture("measurements/in-plane-flat-world.csv")).expect("reads"));
    b.ok(&["fit", "flat.csv", "--model", "lambert2d+phong2d", "--out", "flat.json", "--report"]);
    let found = b.json(&["plot", "slice", "flat.csv", "flat.json", "--out", "f.svg"]);
    assert_eq!(found["unit"], "1/rad");
    assert_eq!(found["slices"][0]["curves"].as_array().unwrap().len(), 2, "readings and fit");
    b.ok(&["plot", "residuals", "flat.csv", "flat.json", "--out", "r.svg"]);
}
