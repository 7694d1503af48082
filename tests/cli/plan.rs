//! Plans: a scan for a budget of instrument hours, and what is said where there can be none.

use crate::bench::{Bench, LAB, number};

#[test]
fn a_plan_is_a_scan_that_keeps_its_budget_and_is_measured_as_planned() {
    let b = Bench::new();
    b.write("lab.toml", LAB);
    let said = b.json(&["plan", "--budget", "6min", "--instrument", "lab.toml", "--out", "scan.csv"]);
    let plan = &said["scans"][0];
    let hours = number(&plan["hours"]);
    assert!(hours <= 0.1 && hours > 0.09, "{hours}");
    assert_eq!(said["scans"].as_array().expect("a list").len(), 5, "beside four usual scans");
    // Precision against hours: a scan that takes longer can't be read in them, and more hours are never worse.
    for (i, scan) in said["scans"].as_array().expect("a list").iter().enumerate() {
        let series = scan["against_hours"].as_array().expect("a list");
        assert_eq!(number(&series[2]["hours"]), 0.1);
        let is_read = |point: &serde_json::Value| number(&point["hours"]) >= number(&scan["hours"]);
        let shown = if i == 0 { &series[2..] } else { &series[..] };
        assert!(shown.iter().all(|point| point["median"].is_array() == is_read(point)), "{scan}");
        // Read for as long as it takes once it is as precise as it is.
        let once = series.iter().find(|point| number(&point["hours"]) == number(&scan["hours"]));
        let stated = scan["errors"].as_array().expect("a list").iter().map(|e| &e["relative"][1]);
        assert!(once.is_none_or(|point| stated.eq(point["median"].as_array().expect("a list"))), "{scan}");
        let errors: Vec<f64> = series.iter().filter_map(|p| p["median"][2].as_f64()).collect();
        // Plans of their own choose by all parameters together: a longer one may know one of them a little less. Of this instrument
        // scans lose nothing by more hours.
        let slack = if i == 0 { 1.1 } else { 1.0 + 1e-12 };
        assert!(errors.windows(2).all(|e| e[1] <= e[0] * slack), "{errors:?}");
    }
    let readings = b.text("scan.csv").lines().filter(|l| !l.starts_with(['#', 't'])).count();
    assert_eq!(number(&plan["readings"]), readings as f64);
    // What simulate makes of it: the plan's pairs, none lost to shadow or saturation, in the plan's hours.
    let args = ["--material", "satin", "--instrument", "lab.toml", "--scan", "list:scan.csv", "--out", "m.csv"];
    let measured = b.json(&[&["simulate"][..], &args].concat());
    assert_eq!(measured["entries"], said["pairs"]);
    assert_eq!(number(&measured["valid"]), 3.0 * number(&said["pairs"]));
    assert!((number(&measured["instrument_hours"]) - hours).abs() < 1e-9);
    // And reduced from the raw readings, the same.
    b.ok(&[&["simulate"][..], &args[..6], &["--raw", "raw.csv", "--out", "again.csv"]].concat());
    b.ok(&["reduce", "raw.csv", "--out", "reduced.csv"]);
    assert_eq!(b.text("again.csv"), b.text("reduced.csv"));
    let fit = b.json(&["fit", "m.csv", "--use-sigma", "--out", "fit.json"]);
    assert!(!fit.to_string().contains("undetermined\":[\""), "{fit}");
}

/// What axes take to turn is paid for, to the second: the plan keeps its budget and costs what its readings' clock says.
#[test]
fn axes_that_turn_slowly_cost_a_plan_what_they_cost_its_scan() {
    let b = Bench::new();
    b.write("slow.toml", LAB.replace("move_s = 2", "move_s = 2\ndegrees_per_s = 4"));
    b.write("lab.toml", LAB);
    let plan = |lab: &str| {
        let said = b.json(&["plan", "--budget", "30min", "--instrument", lab, "--out", "scan.csv"]);
        let args = ["--material", "satin", "--instrument", lab, "--scan", "list:scan.csv", "--raw", "raw.csv"];
        let measured = b.json(&[&["simulate"][..], &args, &["--out", "m.csv"]].concat());
        let hours = number(&said["scans"][0]["hours"]);
        assert!((number(&measured["instrument_hours"]) - hours).abs() < 1e-9, "{lab}: {hours}");
        assert!(hours <= 0.5 && hours > 0.48, "{lab}: {hours}");
        // The end of the last reading.
        let text = b.text("raw.csv");
        let heads: Vec<&str> = text.lines().find(|l| !l.starts_with('#')).expect("a header").split(',').collect();
        let last: Vec<&str> = text.lines().last().expect("rows").split(',').collect();
        let column = |name: &str| last[heads.iter().position(|h| *h == name).expect(name)].parse::<f64>().expect(name);
        let end = column("time_s") + column("exposure_s");
        assert!((end / 3600.0 - hours).abs() < 1e-6, "{lab}: {end} s, {hours} h");
        number(&said["scans"][0]["readings"])
    };
    let (fast, slow) = (plan("lab.toml"), plan("slow.toml"));
    assert!(slow < fast, "{slow} {fast}");
    b.write("wrong.toml", LAB.replace("move_s = 2", "degrees_per_s = -1"));
    let ran = b.run(&["plan", "--budget", "1h", "--instrument", "wrong.toml", "--out", "s.csv"]);
    assert!(ran.code == Some(2) && ran.err.contains("axes.degrees_per_s"), "{}", ran.err);
}

#[test]
fn the_same_plan_whatever_the_threads_and_a_table_for_people() {
    let b = Bench::new();
    // Errors that readings share, so that rows are exchanged.
    b.write("zeros.toml", "version = 1\n[instrument.axes]\nzero_u_deg = 0.05\n");
    for threads in ["1", "2"] {
        let out = format!("{threads}.csv");
        b.ok(&["plan", "--budget", "5min", "--instrument", "zeros.toml", "--threads", threads, "--out", &out]);
    }
    assert_eq!(b.bytes("1.csv"), b.bytes("2.csv"));
    let text = b.ok(&["plan", "--model", "lambert+phong+phong", "--budget", "1h", "--out", "s.csv"]).text();
    for says in ["phong[1]", "exponent", "hemisphere:10", "in-plane:5", "as many hours as the plan", "eff. %", "hours "]
    {
        assert!(text.contains(says), "{says}: {text}");
    }
    for model in ["lambert", "phong"] {
        b.ok(&["plan", "--model", model, "--budget", "1min", "--out", "-"]);
    }
}

/// Readings of a millisecond: two hours are more rows than a scan may have, so each row is several readings, and that is said.
#[test]
fn short_readings_are_joined_where_a_budget_pays_for_too_many_rows() {
    let b = Bench::new();
    let said = b.json(&["plan", "--budget", "2h", "--instrument", "robot", "--out", "scan.csv"]);
    let (plan, readings) = (&said["scans"][0], number(&said["readings_a_row"]));
    let hours = number(&plan["hours"]);
    assert!(hours <= 2.0 && hours > 1.95, "{hours}");
    let rows = number(&plan["readings"]);
    // Visits apart, 7.2 million milliseconds.
    assert!(rows <= 1e6 && (7e6..=7.2e6).contains(&(rows * readings)), "{rows} rows of {readings}");
    let says =
        format!("each row is {readings} readings, instrument.readings = {readings} (simulate --readings {readings})");
    assert!(b.text("scan.csv").contains(&says), "{says}");
}

/// A sharper prior asks for readings closer to the mirror direction.
#[test]
fn the_prior_decides_where_to_measure() {
    let b = Bench::new();
    let nearest = |range: &str| {
        b.ok(&["plan", "--budget", "10min", "--prior", &format!("phong.exponent={range}"), "--out", "s.csv"]);
        let text = b.text("s.csv");
        let off = |line: &str| {
            let cells: Vec<f64> = line.split(',').map(|c| c.parse().expect("a number")).collect();
            let signed = if cells[3] == 0.0 { cells[2] } else { -cells[2] };
            (signed - cells[0]).abs()
        };
        let rows = text.lines().filter(|l| !l.starts_with(['#', 't']));
        rows.map(off).filter(|a| *a > 0.01).fold(f64::INFINITY, f64::min)
    };
    let (blunt, sharp) = (nearest("10..20"), nearest("5000..10000"));
    assert!(sharp < 0.3 * blunt, "{sharp}° {blunt}°");
}

#[test]
fn what_can_t_be_planned_is_said() {
    let b = Bench::new();
    b.write("lab.toml", LAB);
    b.write("dark.toml", "version = 1\n[instrument]\nelectrons = 0\n");
    for (args, says) in [
        (&["--budget", "0"][..], "2h"),
        (&["--budget", "soon"], "2h or 30min"),
        (&["--budget", "20s", "--instrument", "lab.toml"], "the least that is needed"),
        (&["--budget", "2s"], "the least that is needed"),
        (&["--budget", "9999999999999h"], "rows of readings"),
        (&["--budget", "1h", "--instrument", "dark.toml"], "instrument.electrons"),
        (&["--budget", "1h", "--prior", "phong[1].exponent=1..2"], "phong[1].exponent"),
        (&["--budget", "1h", "--prior", "phong.exponent=0..2"], "0 < LOW"),
        (
            &["--budget", "1h", "--prior", "phong.exponent=1..2", "--prior", "phong.exponent=1..3"],
            "limit one parameter",
        ),
        (&["--budget", "1h", "--model", "lambert2d"], "flat world"),
        (&["--budget", "1h", "--model", "ward"], "ward"),
        (&["--budget", "1h", "--instrument", "none.toml"], "none.toml"),
    ] {
        let ran = b.run(&[&["plan"][..], args, &["--out", "s.csv"]].concat());
        assert_eq!(ran.code, Some(2), "{args:?}: {}", ran.err);
        assert!(ran.err.contains(says), "{args:?}: {}", ran.err);
    }
    assert!(!b.path("s.csv").exists());
}
