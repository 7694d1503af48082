//! What `simulate` and `reduce` refuse, warn of and say, where a user would otherwise be misled.

use crate::bench::{Bench, number};

/// A small scan.
const SCAN: [&str; 4] = ["--material", "satin", "--scan", "in-plane:15"];

/// `simulate` with that scan and more.
fn simulated<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["simulate"], &SCAN[..], more].concat()
}

/// A bench with a laboratory's raw readings and their reduction.
fn reduced() -> Bench {
    let b = Bench::new();
    b.ok(&simulated(&["--instrument", "commercial", "--raw", "raw.csv", "--out", "m.csv"]));
    b
}

#[test]
fn too_many_readings_are_refused_with_their_number_before_any_work() {
    let b = Bench::new();
    let one = "version = 1\n[instrument]\nreadings = 1000000000\n[instrument.reference]\nreflectance = 0.9\n";
    b.write("readings.toml", one);
    b.write(
        "visits.toml",
        "version = 1\n[instrument.reference]\nreflectance = 0.9\n[instrument.protocol]\nblock = 1\nrepeats = 1000000000\n",
    );
    let keys =
        ["instrument.readings = ", "instrument.protocol.block = ", "instrument.protocol.repeats = ", "at most 5e7"];
    let effects = [&["effects", "visits.toml"], &SCAN[..]].concat();
    for (args, number) in [
        (simulated(&["--readings", "1000000000", "--raw", "r.csv", "--out", "x.csv"]), "6.600e10"),
        (simulated(&["--instrument", "readings.toml", "--out", "x.csv"]), "6.600e10"),
        (simulated(&["--instrument", "visits.toml", "--out", "x.csv"]), "6.700e10"),
        (effects, "6.700e10"),
        (
            vec![
                "simulate",
                "--material",
                "satin",
                "--scan",
                "adaptive",
                "--instrument",
                "readings.toml",
                "--out",
                "x.csv",
            ],
            "5.000e11",
        ),
    ] {
        let ran = b.run(&args);
        assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
        for said in keys.iter().chain(&[number]) {
            assert!(ran.err.contains(said), "{args:?}: {} lacks {said}", ran.err);
        }
        assert!(!b.path("x.csv").exists() && !b.path("r.csv").exists());
    }
    // Without raw readings they are averaged at once.
    b.ok(&simulated(&["--readings", "1000000000", "--out", "x.csv"]));
}

/// A file that could not be written is refused, and nothing is left behind.
#[test]
fn channels_called_like_other_columns_are_refused() {
    let b = Bench::new();
    for name in ["mask_reason", "weight", "sigma_y", "time_s"] {
        b.write(
            "m.json",
            format!(
                r#"{{"format": "goniofit-material", "version": 1, "model": "lambert", "channels": ["{name}"],
                    "lobes": [{{"kind": "lambert", "weight": [0.5]}}]}}"#
            ),
        );
        let fine = ["simulate", "--material", "m.json", "--instrument", "classroom", "--scan", "in-plane:15"];
        for out in [&["--out", "x.csv"][..], &["--out", "x.csv", "--raw", "r.csv"], &["--out", "-"]] {
            let ran = b.run(&[&fine[..], out].concat());
            assert_eq!(ran.code, Some(2), "{name}: {}", ran.err);
            let said = format!("can't be called \"{name}\": that is the name of another column");
            assert!(ran.err.contains(&said) && ran.out.is_empty(), "{name}: {}", ran.err);
            assert_eq!(b.list("."), ["m.json"]);
        }
        let ran = b.run(&["convert", "m.json", "x.csv"]);
        assert!(ran.code == Some(2) && ran.err.contains(name), "{name}: {}", ran.err);
    }
}

#[test]
fn means_over_cones_that_are_worse_than_asked_for_are_always_warned_of() {
    let b = Bench::new();
    let paint = b.ok(&["models", "glossy-paint"]).text();
    let exponent = paint.lines().find(|l| l.contains("\"exponent\"")).expect("an exponent");
    b.write("cone.toml", "version = 1\n[instrument.detector]\naperture_deg = 4\n");
    // A narrower lobe than any sum over directions meets is known by its tables, to 3e-9.
    for (n, error, said) in [
        ("1e8", "1e-10", "means over cones are good to 3.0e-9 at worst, not to 1.0e-10"),
        ("1e8", "1e-6", ""),
        ("90", "1e-6", ""),
    ] {
        b.write("n.json", paint.replace(exponent, &format!("\"exponent\": {n}")));
        let args = ["simulate", "cone.toml", "--material", "n.json", "--scan", "in-plane:15", "--out", "x.csv"];
        let ran = b.ok(&[&args[..], &["--target-error", error]].concat());
        assert!(ran.err.contains(said) && ran.err.is_empty() == said.is_empty(), "{n}: {}", ran.err);
    }
    b.write("n.json", paint.replace(exponent, "\"exponent\": 1e9"));
    let ran = b.run(&["simulate", "--material", "n.json", "--scan", "in-plane:15", "--out", "y.csv"]);
    assert_eq!(ran.code, Some(2));
    assert!(ran.err.contains("shape.exponent: expected a number from 0 to 1e8"), "{}", ran.err);
}

#[test]
fn two_outputs_of_one_name_are_refused() {
    let b = reduced();
    let mut pairs = vec![("q.csv", "q.csv"), ("q.csv", "./q.csv"), ("-", "-")];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("q.csv", b.path("l.csv")).expect("a link");
        pairs.extend([("q.csv", "l.csv"), ("l.csv", "q.csv")]);
    }
    let before = b.list(".");
    for (first, second) in pairs {
        for (args, option) in [
            (simulated(&["--out", first, "--raw", second]), "--raw"),
            (vec!["reduce", "raw.csv", "--out", first, "--budget", second], "--budget"),
        ] {
            let ran = b.run(&args);
            assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
            assert!(ran.err.contains(option) && ran.err.contains("would write over"), "{args:?}: {}", ran.err);
            assert_eq!((b.list("."), ran.out.len()), (before.clone(), 0), "{args:?}");
        }
    }
    // A table on stdout is alone there.
    let lines = b.ok(&["reduce", "raw.csv", "--out", "o.csv", "--budget", "-"]).text();
    assert!(
        lines.lines().skip(1).all(|l| l.matches(',').count() == lines.lines().next().unwrap().matches(',').count())
    );
    #[cfg(unix)]
    b.ok(&["reduce", "raw.csv", "--out", "o.csv", "--budget", "/dev/null"]);
}

#[test]
fn a_budget_s_rows_are_those_of_the_measurement() {
    let b = reduced();
    b.ok(&["reduce", "raw.csv", "--out", "m.csv", "--budget", "b.csv"]);
    let rows = |name: &str| -> Vec<Vec<String>> {
        let text = b.text(name);
        let lines = text.lines().filter(|l| !l.starts_with('#')).skip(1);
        lines.map(|l| l.split(',').map(str::to_owned).collect()).collect()
    };
    let (table, budget) = (rows("m.csv"), rows("b.csv"));
    let mut valid = 0;
    for row in &table {
        let values = row[4..7].iter().zip(["r", "g", "b"]).filter(|(v, _)| !v.is_empty());
        for (value, channel) in values {
            valid += 1;
            let is = |of: &&Vec<String>| of[..4] == row[..4] && of[4] == channel && of[5] == *value;
            assert_eq!(budget.iter().filter(is).count(), 1, "{row:?}");
        }
    }
    assert_eq!((valid, budget.iter().flatten().any(|cell| cell.starts_with("-0"))), (budget.len(), false));
    let ran = b.run(&["reduce", "raw.csv", "--out", "o.csv", "--budget", "b.txt"]);
    assert!(ran.code == Some(2) && ran.err.contains("ends in .csv"), "{}", ran.err);
    // Without noise there is no component at all.
    b.ok(&simulated(&["--noiseless", "--raw", "quiet.csv", "--out", "o.csv"]));
    let said = b.ok(&["reduce", "quiet.csv", "--out", "o.csv", "--budget", "b.csv"]).text();
    assert!(!said.contains("-0.0") && !b.text("b.csv").contains(",-0"), "{said}");
}

#[test]
fn settings_that_do_nothing_are_named_with_what_they_need() {
    let b = Bench::new();
    b.write(
        "idle.toml",
        "version = 1\n[instrument.reference]\nreflectance_u = 0.01\n[instrument.source]\nbandwidth_nm = 5\n\
         [instrument.sample]\nheight_u_m = 1e-4\n",
    );
    let ran = b.ok(&simulated(&["--instrument", "idle.toml", "--out", "x.csv"]));
    for said in
        ["reference.reflectance_u does nothing", "source.bandwidth_nm does nothing", "sample.height_u_m does nothing"]
    {
        assert!(ran.err.contains(said), "{} lacks {said}", ran.err);
    }
    let ran = b.ok(&simulated(&["--instrument", "commercial", "--out", "x.csv"]));
    assert!(!ran.err.contains("does nothing"), "{}", ran.err);
}

#[test]
fn directions_below_the_horizon_are_counted() {
    let b = Bench::new();
    let head = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg\n";
    b.write("l.csv", format!("{head}0,0,10,0\n0,0,95,0\n0,0,90,0\n10,0,180,0\n"));
    for more in [&[][..], &["--instrument", "commercial"]] {
        let ran =
            b.ok(&[&["simulate", "--material", "satin", "--scan", "list:l.csv", "--out", "x.csv"], more].concat());
        assert!(ran.err.contains("3 pairs of directions are masked: at or below the horizon"), "{}", ran.err);
    }
    b.write("one.csv", format!("{head}0,0,10,0\n"));
    let ran =
        b.ok(&["simulate", "--material", "satin", "--scan", "list:one.csv", "--raw", "raw.csv", "--out", "x.csv"]);
    assert!(ran.err.is_empty() && ran.text().contains("1 direction pair, 3 valid"), "{} {}", ran.err, ran.text());
    assert!(
        b.ok(&["reduce", "raw.csv", "--out", "x.csv"]).text().contains("reduced from 1 reading; 1 pair of directions")
    );
}

#[test]
fn a_measurement_without_any_value_is_a_failure_that_says_why() {
    let b = Bench::new();
    b.write("well.toml", "version = 1\n[instrument.detector]\nfull_well = 60\nbits = 8\n");
    let by_well = simulated(&["--instrument", "well.toml", "--raw", "raw.csv", "--out", "x.csv"]);
    b.write("down.csv", "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg\n0,0,95,0\n");
    for (args, why) in [
        (by_well, "even the shortest exposure saturated"),
        (vec!["reduce", "raw.csv", "--out", "x.csv"], "even the shortest exposure saturated"),
        (vec!["simulate", "--material", "satin", "--scan", "list:down.csv", "--out", "x.csv"], "horizon"),
    ] {
        b.write("x.csv", "old");
        let ran = b.run(&args);
        assert_eq!(ran.code, Some(1), "{args:?}: {}", ran.err);
        assert!(ran.err.contains("is valid") && ran.err.contains(why), "{args:?}: {}", ran.err);
        assert_ne!(b.text("x.csv"), "old", "{args:?}: the file says where");
        let said = b.run(&[&args[..], &["--json"]].concat()).json();
        assert_eq!((number(&said["valid"]), said["error"].is_string()), (0.0, true));
    }
}

#[test]
fn wrong_inputs_are_named_as_they_were_typed_with_what_is_expected() {
    let b = reduced();
    let raw = b.text("raw.csv");
    let bare: String = raw.split_inclusive('\n').filter(|l| !l.starts_with('#')).collect();
    std::fs::create_dir(b.path("sub")).expect("a folder");
    b.write("sub/hand.csv", &bare);
    b.write("flat.csv", format!("# dimension: 3\n{bare}"));
    let utf16: Vec<u8> = [0xfeff].into_iter().chain(raw.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    b.write("utf16.csv", &utf16);
    b.write("bare16.csv", &utf16[2..]);
    b.write("latin.toml", b"version = 1\n# \xe9\n");
    b.write("empty.toml", "");
    b.write("exposures.toml", "version = 1\n[instrument.detector]\nexposures_s = []\n");
    let table = [
        (vec!["reduce", "sub/hand.csv", "--out", "x.csv"], "sub/hand.csv: the reference was read"),
        (vec!["reduce", "flat.csv", "--out", "x.csv"], "flat.csv, line 1, `# dimension:`: expected 2"),
        (
            vec!["reduce", "utf16.csv", "--out", "x.csv"],
            "utf16.csv, byte 0: expected text in UTF-8, found the mark of UTF-16",
        ),
        (vec!["reduce", "bare16.csv", "--out", "x.csv"], "UTF-16 without its mark"),
        (vec!["reduce", "sub", "--out", "x.csv"], "sub: expected a file, found a folder"),
        (vec!["simulate", "latin.toml", "--out", "x.csv"], "latin.toml, byte 14: expected text in UTF-8"),
        (vec!["simulate", "empty.toml", "--out", "x.csv"], "empty.toml: version: expected the line `version = 1`"),
        (
            simulated(&["--instrument", "exposures.toml", "--out", "x.csv"]),
            "one or more times from 1e-9 to 1e6 s, ascending, found []",
        ),
        (
            simulated(&["--instrument", "m.csv", "--out", "x.csv"]),
            "m.csv: expected a simulation file with an [instrument]",
        ),
        (vec!["simulate", "commercial", "--material", "satin", "--out", "x.csv"], "--instrument commercial"),
        (vec!["simulate", "--material", "satin", "--scan", "list:", "--out", "x.csv"], "expected list:FILE"),
        (simulated(&["--auto", "2", "--out", "x.csv"]), "above 0 and below 1"),
        (simulated(&["--target-error", "1", "--out", "x.csv"]), "above 0 and below 1"),
        (
            simulated(&["--electrons", "1e-300", "--out", "x.csv"]),
            "instrument.electrons: expected 0 (no noise) or a number from 1e-3",
        ),
    ];
    for (args, says) in table {
        let ran = b.run(&args);
        assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
        assert!(ran.err.contains(says), "{args:?}: {} lacks {says}", ran.err);
        assert!(!b.path("x.csv").exists(), "{args:?}");
    }
    let ran = b.run_on(&["reduce", "-", "--out", "x.csv"], bare.as_bytes());
    assert!(ran.code == Some(2) && ran.err.contains("stdin: the reference was read"), "{}", ran.err);
    // Raw readings say what made them.
    b.ok(&["reduce", "sub/hand.csv", "--instrument", "raw.csv", "--out", "x.csv"]);
    assert_eq!(b.text("x.csv").lines().last(), b.text("m.csv").lines().last());
}

/// A raw file's angles are text, 10⁻¹⁵ off the directions that were simulated: both ways to a measurement take those of the text.
#[test]
fn reducing_the_raw_file_gives_what_simulate_writes_to_the_byte() {
    let b = Bench::new();
    let flat = r#"{"format": "goniofit-material", "version": 1, "model": "lambert2d+phong2d", "channels": ["y"], "lobes":
        [{"kind": "lambert2d", "weight": [0.4]}, {"kind": "phong2d", "weight": [0.1], "shape": {"exponent": 40}}]}"#;
    b.write("flat.json", flat);
    b.write("repeated.csv", "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg\n".to_owned() + &"31,180,17,1.3\n".repeat(3));
    let points = "version = 1\n[instrument]\nread_noise = 3\n[instrument.axes]\njitter_deg = 0.1\n[instrument.protocol]\nblock = 2\n";
    b.write("points.toml", points);
    for (material, instrument, scan) in [
        ("glossy-paint", "commercial", "in-plane:7.3"),
        ("glossy-paint", "standards-lab", "hemisphere:26"),
        ("satin", "robot", "hemisphere:29"),
        ("satin", "commercial", "adaptive:230"),
        ("flat.json", "classroom", "flat:13"),
        // A block ends within a stop, and no visit stands between.
        ("satin", "points.toml", "list:repeated.csv"),
    ] {
        let args = ["simulate", "--material", material, "--instrument", instrument, "--scan", scan];
        b.ok(&[&args[..], &["--raw", "raw.csv", "--out", "m.csv"]].concat());
        b.ok(&["reduce", "raw.csv", "--out", "reduced.csv"]);
        assert!(b.bytes("m.csv") == b.bytes("reduced.csv"), "{instrument}, {scan}");
        // And without a raw file.
        b.ok(&[&args[..], &["--out", "plain.csv"]].concat());
        assert!(b.bytes("m.csv") == b.bytes("plain.csv"), "{instrument}, {scan}");
    }
}

#[test]
fn a_reference_that_is_described_but_was_not_read_is_said_to_be_missing() {
    let b = Bench::new();
    let rows = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,kind,time_s,exposure_s,repeat,signal_y\n0,0,45,0,sample,0,1,0,100\n";
    b.write("log.csv", rows);
    let ran = b.run(&["reduce", "log.csv", "--instrument", "commercial", "--out", "m.csv"]);
    for says in ["log.csv", "instrument.reference.reflectance = ", "no reading of it is there", "kind `reference`"] {
        assert!(ran.code == Some(2) && ran.err.contains(says), "{ran:?}");
    }
}
