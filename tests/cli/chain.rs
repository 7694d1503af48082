//! The whole chain, from the simulated instrument to the picture.

use serde_json::Value;

use crate::bench::{Bench, number};

/// No number is lost on its way into JSON: what is not finite becomes `null`.
fn assert_no_null(value: &Value, path: &str) {
    match value {
        Value::Null => panic!("{path} is null"),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| assert_no_null(v, &format!("{path}[{i}]"))),
        // A note is there only where there is something to note; a search of one shape finds no chance, and may see no second minimum.
        Value::Object(map) => {
            let said = map.iter().filter(|(k, _)| !["note", "runner_up_excess", "unseen_chance"].contains(&k.as_str()));
            said.for_each(|(k, v)| assert_no_null(v, &format!("{path}.{k}")));
        }
        _ => {}
    }
}

#[test]
fn the_demo_writes_every_file_and_its_numbers_can_be_read() {
    let b = Bench::new();
    let said = b.json(&["demo", "--size", "24", "--samples", "16", "--out", "d"]);
    let mut expected = vec!["measurement.csv", "numbers.json", "sheet.png", "lambert.json", "lambert+phong.json"];
    expected.extend(["maps-lambert.png", "maps-lambert+phong.png"]);
    let pictures = ["truth", "lambert", "lambert+phong", "difference-lambert", "difference-lambert+phong"];
    let files: Vec<String> = pictures.iter().flat_map(|p| [format!("{p}.exr"), format!("{p}.png")]).collect();
    expected.extend(files.iter().map(String::as_str));
    expected.sort_unstable();
    assert_eq!(b.list("d"), expected);

    for picture in pictures {
        let image = b.exr(&format!("d/{picture}.exr"));
        assert_eq!((image.width, image.height), (24, 24), "{picture}");
        assert!(image.radiance.iter().flatten().all(|v| v.is_finite()), "{picture}");
        assert!(b.bytes(&format!("d/{picture}.png")).starts_with(b"\x89PNG\r\n"), "{picture}");
    }
    let numbers = b.json_file("d/numbers.json");
    assert_no_null(&numbers, "numbers");
    for key in ["material", "pairs", "truth", "fits", "seconds"] {
        assert_eq!(numbers[key], said[key], "{key}: the file and stdout say the same");
    }
    for (k, model) in ["lambert", "lambert+phong"].iter().enumerate() {
        assert_eq!(numbers["fits"][k]["material"], b.json_file(&format!("d/{model}.json")), "{model}");
    }
    let rows = b.text("d/measurement.csv").lines().filter(|l| !l.starts_with('#')).count() - 1;
    assert_eq!(numbers["pairs"], rows);
}

#[test]
fn the_demo_finds_the_truth_within_five_standard_errors() {
    let b = Bench::new();
    let numbers = b.json(&["demo", "--size", "16", "--samples", "2", "--out", "d"]);
    let (truth, fit) = (&numbers["truth"]["lobes"], &numbers["fits"][1]["material"]);
    let error = &fit["fit"]["standard_error"];
    let within = |what: &str, got: &Value, want: &Value, sigma: &Value| {
        let z = (number(got) - number(want)) / number(sigma);
        assert!(z.abs() < 5.0, "{what}: {got} vs {want}, {z} standard errors");
    };
    for l in 0..2 {
        for c in 0..3 {
            let of = |v: &Value| v[l]["weight"][c].clone();
            within(&format!("weight {l} {c}"), &of(&fit["lobes"]), &of(truth), &of(error));
        }
    }
    let of = |v: &Value| v[1]["shape"]["exponent"].clone();
    within("exponent", &of(&fit["lobes"]), &of(truth), &of(error));
}

#[test]
fn every_command_takes_what_the_one_before_it_wrote() {
    let b = Bench::new();
    b.paint("paint.csv");
    assert_eq!(b.json(&["info", "paint.csv"])["entries"], 2601);

    b.ok(&["fit", "paint.csv", "--out", "paint.json"]);
    let small = ["--size", "24", "--samples", "4"];
    let validated = b.json(&[&["validate", "paint.csv", "paint.json", "--out", "v"], &small[..]].concat());
    let expected = [
        "difference-1.exr",
        "difference-1.png",
        "fit-1.exr",
        "fit-1.png",
        "maps-1.png",
        "numbers.json",
        "sheet.png",
        "table.exr",
        "table.png",
    ];
    assert_eq!(b.list("v"), expected);
    assert_eq!(b.json_file("v/numbers.json"), validated);

    let compared = b.json(&["compare", "v/fit-1.exr", "v/table.exr"]);
    let image = &validated["fits"][0]["image"];
    let looks = &image["appearance"];
    assert!(number(&looks["flip"]["mean"]) > 0.0 && number(&looks["delta_e_2000"]["max"]) > 0.0, "{looks}");
    let statement = validated["fits"][0]["statement"].as_str().expect("a sentence");
    assert!(statement.contains("too few samples") && statement.contains("largest difference"), "{statement}");
    assert_eq!(compared["pixels"], image["pixels"]);
    for key in ["rmse", "rel_mse", "max_abs"] {
        // Files hold 32-bit floats.
        let (file, memory) = (number(&compared[key]), number(&image[key]));
        assert!((file / memory - 1.0).abs() < 1e-5, "{key}: {file} from the files, {memory} from memory");
    }

    let rendered = b.picture("r.exr", &["--material", "paint.json", "--png", "r.png", "--json"]).json();
    let radiance = b.exr("r.exr").radiance;
    for c in 0..3 {
        let mean = radiance.iter().map(|p| p[c]).sum::<f64>() / radiance.len() as f64;
        assert!((mean / number(&rendered["mean"][c]) - 1.0).abs() < 1e-6, "channel {c}");
    }

    let converted = b.json(&["convert", "paint.json", "grid.csv", "--scan", "hemisphere:10"]);
    let summary = b.json(&["info", "grid.csv"]);
    assert_eq!((&converted["entries"], &summary["entries"]), (&Value::from(2601), &Value::from(2601)));
}

#[test]
fn validate_takes_several_fits_and_numbers_them_in_order() {
    let b = Bench::new();
    b.paint("p.csv");
    for model in ["lambert", "lambert+phong"] {
        b.ok(&["fit", "p.csv", "--model", model, "--out", &format!("{model}.json")]);
    }
    let args = ["validate", "p.csv", "lambert.json", "lambert+phong.json", "--scene", "sphere", "--out", "v"];
    let said = b.json(&[&args[..], &["--size", "24", "--samples", "8"]].concat());
    assert_eq!(said["scene"], "sphere");
    for (k, model) in ["lambert", "lambert+phong"].iter().enumerate() {
        assert_eq!(said["fits"][k]["model"], *model);
        assert_eq!(said["fits"][k]["fit"], format!("{model}.json"));
        assert_eq!(said["fits"][k]["picture"], format!("fit-{}.exr", k + 1));
        assert!(b.path(&format!("v/difference-{}.exr", k + 1)).is_file());
    }
    let rmse = |k: usize| number(&said["fits"][k]["image"]["rmse"]);
    assert!(rmse(1) < rmse(0), "the richer model looks more like the table: {} vs {}", rmse(1), rmse(0));
}

#[test]
fn a_difference_picture_is_the_fit_less_the_table() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    b.ok(&["validate", "p.csv", "p.json", "--size", "24", "--samples", "4", "--out", "v"]);
    let [fit, table, difference] = ["fit-1", "table", "difference-1"].map(|n| b.exr(&format!("v/{n}.exr")).radiance);
    for (i, d) in difference.iter().enumerate() {
        for c in 0..3 {
            let want = fit[i][c] - table[i][c];
            let rounding = f64::from(f32::EPSILON) * (fit[i][c].abs() + table[i][c].abs());
            assert!((d[c] - want).abs() <= rounding, "pixel {i} channel {c}: {} vs {want}", d[c]);
        }
    }
}

#[test]
fn a_fit_that_is_sampled_and_fitted_again_comes_back() {
    let b = Bench::new();
    b.fitted("p.csv", "p.json");
    b.ok(&["convert", "p.json", "grid.csv"]);
    b.ok(&["fit", "grid.csv", "--out", "again.json"]);
    let (first, again) = (b.json_file("p.json"), b.json_file("again.json"));
    let same = |a: &Value, b: &Value| {
        let (a, b) = (number(a), number(b));
        assert!((a / b - 1.0).abs() < 1e-9, "{a} vs {b}");
    };
    for l in 0..2 {
        for c in 0..3 {
            same(&first["lobes"][l]["weight"][c], &again["lobes"][l]["weight"][c]);
        }
    }
    same(&first["lobes"][1]["shape"]["exponent"], &again["lobes"][1]["shape"]["exponent"]);
}

#[test]
fn a_simulation_file_says_the_same_as_options_and_options_win() {
    let b = Bench::new();
    b.write("s.toml", "version = 1\nmaterial = \"satin\"\nscan = \"hemisphere:30\"\nseed = 4\n");
    b.ok(&["simulate", "s.toml", "--out", "file.csv"]);
    let typed = ["simulate", "--material", "satin", "--scan", "hemisphere:30", "--seed", "4", "--out", "typed.csv"];
    b.ok(&typed);
    assert_eq!(b.text("file.csv"), b.text("typed.csv"));
    b.ok(&["simulate", "s.toml", "--seed", "5", "--out", "other.csv"]);
    assert_ne!(b.text("file.csv"), b.text("other.csv"));
}

#[test]
fn a_scan_from_a_list_measures_the_directions_of_that_file() {
    let b = Bench::new();
    b.paint("p.csv");
    b.ok(&["simulate", "--material", "satin", "--scan", "list:p.csv", "--out", "s.csv"]);
    let angles = |name: &str| -> Vec<String> {
        let text = b.text(name);
        let rows = text.lines().filter(|l| !l.starts_with('#'));
        rows.map(|l| l.split(',').take(4).collect::<Vec<_>>().join(",")).collect()
    };
    assert_eq!(angles("s.csv"), angles("p.csv"));
}

const LAB: &str = "version = 1
[instrument]
electrons = 1e6
[instrument.detector]
aperture_deg = 1.0
dark_per_s = 200
full_well = 4e5
bits = 16
exposures_s = [0.02, 0.5]
[instrument.reference]
reflectance = 0.985
reflectance_u = 0.003
[instrument.axes]
zero_u_deg = 0.02
[instrument.surroundings]
stray_per_sr = 2e-3
shadow_deg = 3
";

/// An instrument with faults: its raw readings, written and reduced again, give the measurement that came with them, and a fit of it finds the
/// material within the errors that it states, the certificate's among them.
#[test]
fn raw_readings_reduce_to_the_measurement_and_fit_within_its_errors() {
    let b = Bench::new();
    b.write("lab.toml", LAB);
    let simulate =
        ["simulate", "--material", "satin", "--instrument", "lab.toml", "--scan", "in-plane:5", "--seed", "2"];
    b.ok(&[&simulate[..], &["--raw", "raw.csv", "--out", "first.csv"]].concat());
    let told = b.json(&["reduce", "raw.csv", "--out", "again.csv", "--budget", "budget.csv"]);
    let (first, again) = (b.text("first.csv"), b.text("again.csv"));
    let rows = |text: &str| text.lines().filter(|l| !l.starts_with('#')).count();
    assert_eq!(rows(&first), rows(&again));
    assert!(first.contains("common_1_r") && again.contains("common_1_r"));
    let lines = told["budget"].as_array().expect("a budget");
    let of = |name: &str| lines.iter().find(|l| l["name"] == name).unwrap_or_else(|| panic!("{name} in {lines:?}"));
    let certificate = of("certificate of the reference");
    assert!((number(&certificate["relative"]) - 0.003).abs() < 1e-12 && number(&certificate["u"]) == 0.003);
    let (rms, u, sensitivity) = (&certificate["rms"], &certificate["u"], &certificate["sensitivity"]);
    assert!((number(rms) / number(u) / number(sensitivity) - 1.0).abs() < 1e-12);
    assert!(of("all together")["u"].is_null());
    assert!(number(&of("all together")["relative"]) > 0.003);
    assert!(b.text("budget.csv").lines().count() > 500);
    b.ok(&["fit", "again.csv", "--out", "fit.json"]);
    let file = b.json_file("fit.json");
    let warnings = file["fit"]["warnings"].to_string();
    assert!(!warnings.contains("does not describe") && !warnings.contains("overstated"), "{warnings}");
    let range = &file["fit"]["interval_95"][0]["weight"][2];
    assert!(number(&range[0]) < 0.30 && number(&range[1]) > 0.30, "{range}");
    // The certificate's 0.3 % is in the error of a weight of 0.3.
    assert!(number(&file["fit"]["standard_error"][0]["weight"][2]) > 0.8e-3, "{}", file["fit"]["standard_error"]);
}

/// A laboratory that knows its certificate but not its detector: σ comes from the repeats, and what is missing where there are none is said.
#[test]
fn repeats_tell_the_noise_of_a_detector_that_nobody_described() {
    let b = Bench::new();
    let known = "[instrument.reference]\nreflectance = 0.985\nreflectance_u = 0.003\n";
    b.write("known.toml", format!("version = 1\n[instrument]\nelectrons = 0\n{known}"));
    for (readings, stated) in [("5", true), ("1", false)] {
        let all = format!("version = 1\n[instrument]\nelectrons = 1e5\nreadings = {readings}\n{known}");
        b.write("lab.toml", format!("{all}[instrument.protocol]\nrepeats = 1\n"));
        let simulate = ["simulate", "--material", "satin", "--instrument", "lab.toml", "--scan", "in-plane:5"];
        b.ok(&[&simulate[..], &["--raw", "raw.csv", "--out", "first.csv"]].concat());
        let ran = b.run(&["reduce", "raw.csv", "--instrument", "known.toml", "--out", "m.csv"]);
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        assert_eq!(b.text("m.csv").contains("sigma_r"), stated);
        let said = "σ is not stated, in any channel: the detector's noise is not described";
        assert_eq!(ran.err.contains(said), !stated, "{}", ran.err);
        assert_eq!(ran.text().contains("noise of the reading"), stated, "{}", ran.text());
    }
}

#[test]
fn what_is_wrong_with_an_instrument_or_its_readings_is_named() {
    let b = Bench::new();
    b.write("bad.toml", "version = 1\n[instrument.detector]\nbits = 12\n");
    b.write("key.toml", "version = 1\n[instrument.detector]\nbit = 12\n");
    b.write("cut.csv", "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,kind,time_s,exposure_s,repeat,signal_y\n");
    let simulate = |file: &'static str| ["simulate", "--material", "satin", "--instrument", file, "--out", "x.csv"];
    for (args, says) in [
        (&simulate("bad.toml")[..], "full_well"),
        (&simulate("key.toml")[..], "bit"),
        (&simulate("none.toml")[..], "none.toml"),
        (&["reduce", "cut.csv", "--out", "x.csv"][..], "row of data"),
        (&["reduce", "cut.csv", "--out", "cut.csv"][..], "cut.csv"),
    ] {
        let ran = b.run(args);
        assert!(ran.code == Some(2) && ran.err.contains(says), "{args:?}: {ran:?}");
        assert!(!b.path("x.csv").exists());
    }
}
