//! What can be rendered, and what is refused with its reason.

use crate::bench::{Bench, assert_same_picture, fixture};

#[test]
fn a_built_in_material_printed_to_a_file_is_the_same_material() {
    let b = Bench::new();
    let list = b.json(&["models"]);
    let names = list["materials"].as_array().expect("a list");
    assert!(names.len() >= 2);
    for name in names.iter().map(|m| m["name"].as_str().expect("a name")) {
        let file = format!("{name}.json");
        b.write(&file, b.ok(&["models", name]).out);
        for (out, material) in [("file.exr", file.as_str()), ("name.exr", name)] {
            let ran = b.picture(out, &["--material", material]);
            assert_eq!(ran.code, Some(0), "{material}: {}", ran.err);
        }
        assert_same_picture(&b.exr("file.exr"), &b.exr("name.exr"), name);
        for (out, material) in [("file.csv", file.as_str()), ("name.csv", name)] {
            b.ok(&["simulate", "--material", material, "--scan", "hemisphere:30", "--out", out]);
        }
        assert_eq!(b.text("file.csv"), b.text("name.csv"), "{name}");
    }
}

#[test]
fn in_plane_one_dimensional_and_flat_measurements_are_refused_for_rendering_with_the_reason() {
    let b = Bench::new();
    b.ok(&["simulate", "--material", "satin", "--scan", "in-plane:5", "--out", "plane.csv"]);
    b.ok(&["fit", &fixture("measurements/in-plane-flat-world.csv"), "--out", "flat.json"]);
    b.ok(&["fit", "plane.csv", "--out", "plane.json"]);
    let slice = fixture("measurements/half-angle-cosine-rgb.alta");
    let flat = fixture("measurements/in-plane-flat-world.csv");
    for (material, says) in [
        ("plane.csv", "plane of incidence"),
        (&slice, "one-dimensional"),
        (&flat, "flat-world"),
        ("flat.json", "flat world"),
    ] {
        let ran = b.picture("x.exr", &["--material", material]);
        assert_eq!(ran.code, Some(2), "{material}");
        assert!(ran.err.contains(says), "{material}: {}", ran.err);
        assert!(!b.path("x.exr").exists(), "{material}");
    }
    let refused = b.run(&["validate", &flat, "flat.json", "--size", "16", "--samples", "2", "--out", "v"]);
    assert!(refused.code == Some(2) && refused.err.contains("flat-world"), "{}", refused.err);
    assert!(!b.path("v").exists());
    assert_eq!(b.picture("fit.exr", &["--material", "plane.json"]).code, Some(0), "its fit is of space");
}

/// A table that can't be rendered, in plane or planned, is no dead end: its fits are, and what is missing is said.
#[test]
fn validate_shows_the_fits_alone_where_the_table_does_not_cover_enough() {
    let b = Bench::new();
    b.ok(&["simulate", "--material", "satin", "--scan", "in-plane:5", "--out", "plane.csv"]);
    b.ok(&["plan", "--budget", "5min", "--out", "scan.csv"]);
    b.ok(&["simulate", "--material", "satin", "--scan", "list:scan.csv", "--out", "planned.csv"]);
    for (table, why) in [("plane.csv", "lie in the plane of incidence"), ("planned.csv", "hemisphere")] {
        for (model, out) in [("lambert", "a.json"), ("lambert+phong", "b.json")] {
            b.ok(&["fit", table, "--model", model, "--out", out]);
        }
        let out = format!("{table}.d");
        let both = ["validate", table, "a.json", "b.json", "--size", "16", "--samples", "16", "--out", &out];
        let ran = b.ok(&[&both[..], &["--json"]].concat());
        for says in ["can't be rendered", why, "each compared with the first", "measure the hemisphere"] {
            assert!(ran.err.contains(says), "{says}: {}", ran.err);
        }
        let said = ran.json();
        assert_eq!(said["reference"], "fit-1.exr");
        assert!(said["table_not_rendered"].as_str().is_some_and(|reason| reason.contains(why)), "{said}");
        assert!(said["fits"][0]["image"].is_null() && said["fits"][1]["image"]["rmse"].as_f64() > Some(0.0), "{said}");
        let names = ["difference-2.exr", "difference-2.png", "fit-1.exr", "fit-1.png", "fit-2.exr", "fit-2.png"];
        assert_eq!(b.list(&out), [&names[..], &["maps-2.png", "numbers.json", "sheet.png"]].concat());
        let one = ["validate", table, "b.json", "--size", "16", "--samples", "2", "--out", "one"];
        let ran = b.ok(&one);
        assert!(ran.err.contains("of the fit alone") && ran.text().contains("rendered alone"), "{ran:?}");
        assert!(b.path("one/fit-1.exr").is_file() && !b.path("one/table.exr").exists());
    }
}

#[test]
fn spectral_channels_are_rendered_only_where_three_are_named() {
    let b = Bench::new();
    b.fitted("rgb.csv", "rgb.json");
    let renamed = |text: String| {
        [("r", "450nm"), ("g", "550nm"), ("b", "650nm")].iter().fold(text, |t, (old, new)| {
            t.replace(&format!(",{old},"), &format!(",{new},"))
                .replace(&format!("sigma_{old},"), &format!("sigma_{new},"))
        })
    };
    b.write("spectral.csv", renamed(b.text("rgb.csv")));
    let fit = b.json(&["fit", "spectral.csv", "--out", "spectral.json"]);
    assert_eq!(fit["channels"], serde_json::json!(["450nm", "550nm", "650nm"]));
    for material in ["spectral.csv", "spectral.json"] {
        let ran = b.picture("x.exr", &["--material", material]);
        assert_eq!(ran.code, Some(2), "{material}");
        assert!(ran.err.contains("--rgb") && ran.err.contains("550nm"), "{}", ran.err);
        let unknown = b.picture("x.exr", &["--material", material, "--rgb", "450nm,550nm,700nm"]);
        assert_eq!(unknown.code, Some(2));
        assert!(unknown.err.contains("700nm"), "{}", unknown.err);
        assert_eq!(b.picture("x.exr", &["--material", material, "--rgb", "450nm,550nm"]).code, Some(2));
        assert!(!b.path("x.exr").exists());

        let named = b.picture("named.exr", &["--material", material, "--rgb", "450nm,550nm,650nm"]);
        assert_eq!(named.code, Some(0), "{}", named.err);
        b.picture("rgb.exr", &["--material", &material.replace("spectral", "rgb")]);
        assert_same_picture(&b.exr("named.exr"), &b.exr("rgb.exr"), material);
    }
}

#[test]
fn one_channel_renders_grey() {
    let b = Bench::new();
    let material = r#"{ "format": "goniofit-material", "version": 1, "model": "lambert", "channels": ["650nm"],
        "lobes": [ {"kind": "lambert", "weight": [0.5]} ] }"#;
    b.write("grey.json", material);
    let ran = b.picture("grey.exr", &["--scene", "sphere", "--material", "grey.json"]);
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    let radiance = b.exr("grey.exr").radiance;
    assert!(radiance.iter().all(|p| p[0] == p[1] && p[1] == p[2]) && radiance.iter().any(|p| p[0] > 0.0));
}

#[test]
fn what_was_not_measured_is_marked_in_the_mask_and_left_out_of_the_numbers() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json"); // up to 80°, so the sphere's rim was not measured
    let said = b.picture("table.exr", &["--material", "p.csv", "--json"]).json();
    b.picture("fit.exr", &["--material", "p.json"]);
    let mask = b.exr("table.exr").mask.expect("a mask");
    let marked = mask.iter().filter(|m| **m > goniofit::image::MASKED_SHARE).count();
    assert!(marked > 0);
    assert_eq!(said["unmeasured_share"], marked as f64 / 576.0);
    let compared = b.json(&["compare", "fit.exr", "table.exr"]);
    assert_eq!((&compared["masked"], &compared["pixels"]), (&marked.into(), &(576 - marked).into()));
}
