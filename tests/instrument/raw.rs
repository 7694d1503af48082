//! Raw readings as files: they come back as they were, and what is wrong with one is named.

use std::path::Path;

use crate::support::*;
use goniofit::gonio::{Instrument, Raw};
use goniofit::measurement::Directions;

#[test]
fn readings_come_back_from_their_file() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(15.0));
    let instrument = crooked();
    let raw = read(&material, &instrument, &scan, 3);
    let (back, told) = Raw::from_csv(Path::new("raw.csv"), &raw.to_csv(&instrument)).expect("reads back");
    assert_eq!(told.as_ref(), Some(&instrument));
    let bits = |r: &Raw| r.signal.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&back), bits(&raw));
    assert_eq!(back.channels, raw.channels);
    let (a, b) = (reduced(&raw, &instrument, &material), reduced(&back, &instrument, &material));
    assert_eq!(a.measurement.values.len(), b.measurement.values.len());
    for (x, y) in a.measurement.values.iter().zip(&b.measurement.values) {
        assert!(x.is_nan() && y.is_nan() || (x / y - 1.0).abs() < 1e-12, "{x} {y}");
    }
}

const HEADER: &str = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,kind,time_s,exposure_s,repeat,signal_y\n";

#[test]
fn what_is_wrong_with_a_file_is_named() {
    let read = |rows: &str| Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}{rows}"));
    assert!(read("0,0,45,0,sample,0,1,0,100\n,,,,dark,1,1,0,3\n").is_ok());
    for (rows, says) in [
        ("", "row of data"),
        ("0,0,45,0,smaple,0,1,0,100\n", "line 2, column `kind`: expected sample, blank, reference or dark"),
        (
            "0,0,45,0,sample,5,1,0,100\n0,0,50,0,sample,4,1,0,100\n",
            "line 3, column `time_s`: expected rows in order of time",
        ),
        ("0,0,45,0,sample,0,0,0,100\n", "column `exposure_s`"),
        ("0,0,45,0,sample,0,1,0,x\n", "column `signal_y`"),
        ("0,0,,0,sample,0,1,0,1\n", "column `theta_o_deg`"),
        ("0,0,245,0,sample,0,1,0,1\n", "column `theta_o_deg`"),
        ("0,0,45,0,sample,0,1,0\n", "line 2: expected 9 cells"),
        ("0,0,45,0,sample,0,1,-1,2\n", "column `repeat`"),
    ] {
        let error = read(rows).expect_err(rows).to_string();
        assert!(error.contains(says) && error.contains("r.csv"), "{rows}: {error}");
    }
    for (text, says) in [
        ("kind,time_s\nsample,0\n", "theta_i_deg"),
        (&HEADER.replace("signal_y", "signal_y,signal_y")[..], "twice"),
        (&HEADER.replace(",signal_y", "")[..], "signal_"),
        (&HEADER.replace("signal_y", "signal_y,colour")[..], "`colour`"),
        (&format!("# instrument: {{\"electrons\": -1}}\n{HEADER}")[..], "electrons"),
        (&format!("# instrument: {{\"colour\": 1}}\n{HEADER}")[..], "line 1"),
    ] {
        let error = Raw::from_csv(Path::new("r.csv"), text).expect_err(text).to_string();
        assert!(error.contains(says), "{text}: {error}");
    }
}

/// A real log without a description: repeats are averaged, blanks subtracted, a pair that was read twice counts once with both readings.
#[test]
fn a_real_log_is_reduced_by_its_own_blanks() {
    let rows = ",,,,blank,0,1,0,10\n,,,,blank,1,1,1,12\n0,0,30,0,sample,2,1,0,111\n0,0,30,0,sample,3,1,1,113\n0,0,60,0,sample,4,1,0,61\n\
                0,0,30,0,sample,5,1,0,115\n,,,,blank,6,1,0,11\n";
    let (raw, told) = Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}{rows}")).expect("valid");
    assert!(told.is_none() && matches!(&raw.directions, Directions::List { wi, .. } if wi.len() == 2));
    let m = goniofit::gonio::reduce("m", &raw, &Instrument::noiseless(), None).expect("reduced").measurement;
    let cos = |deg: f64| deg.to_radians().cos();
    let (a, b) = (m.value(0, 0).expect("valid") * cos(30.0), m.value(0, 1).expect("valid") * cos(60.0));
    // The stops at 30° read 112 and 115 over a blank of 11.
    assert!((a - (0.5 * (112.0 + 115.0) - 11.0)).abs() < 1e-12 && (b - 50.0).abs() < 1e-12, "{a} {b}");
}
