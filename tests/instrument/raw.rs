//! Raw readings as files: they come back as they were, and what is wrong with one is named.

use std::path::Path;

use crate::experiment::sigma;
use crate::support::*;
use goniofit::control::Control;
use goniofit::gonio::parts::{Detector, Reference, Surroundings};
use goniofit::gonio::{Instrument, Raw};
use goniofit::measurement::formats;
use goniofit::measurement::{Directions, Format, MaskReason, ReadOptions};

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

/// A log that goes through its exposures again and again: all repeats of the longest that does not saturate count, wherever they stand.
#[test]
fn repeats_count_whatever_the_order_of_exposures() {
    let rows = |order: &[(f64, f64)]| -> String {
        let row =
            |(i, (exposure, signal)): (usize, &(f64, f64))| format!("0,0,60,0,sample,{i},{exposure},0,{signal}\n");
        order.iter().enumerate().map(row).collect()
    };
    let detector = goniofit::gonio::parts::Detector { full_well: 500.0, ..Default::default() };
    let instrument = Instrument { electrons: 100.0, read_noise: 0.0, detector, ..Instrument::default() };
    let reduced = |order: &[(f64, f64)]| {
        let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}{}", rows(order))).expect("valid");
        let m = goniofit::gonio::reduce("m", &raw, &instrument, None).expect("reduced").measurement;
        (m.value(0, 0).expect("valid"), m.sigma.expect("noise")[0])
    };
    let blocks = reduced(&[(0.1, 9.0), (0.1, 11.0), (1.0, 90.0), (1.0, 110.0), (9.0, 500.0), (9.0, 500.0)]);
    let cycled = reduced(&[(0.1, 9.0), (1.0, 90.0), (9.0, 500.0), (0.1, 11.0), (1.0, 110.0), (9.0, 500.0)]);
    assert_eq!(blocks, cycled);
    // 100 a second of 50 at cosθo = ½, by two readings of shot noise 10.
    assert!((cycled.0 - 2.0).abs() < 1e-12 && (cycled.1 - 0.2 / f64::sqrt(2.0)).abs() < 1e-12, "{cycled:?}");
}

/// Why a pair has no value stands in its row of the file, and comes back: an empty cell alone would not tell a full well from a shadow.
#[test]
fn every_masked_pair_says_why() {
    let detector = Detector { full_well: 500.0, ..Default::default() };
    let surroundings = Surroundings { shadow_deg: 2.0, ..Default::default() };
    let instrument = Instrument { electrons: 100.0, read_noise: 0.0, detector, surroundings, ..Instrument::default() };
    let log = "0,0,60,0,sample,0,1,0,50\n30,0,30,180,sample,1,1,0,500\n30,0,30,180,sample,2,9,0,500\n\
        20,0,20,0,sample,3,1,0,50\n40,0,30,0,sample,4,1,0,\n40,0,95,0,sample,5,1,0,1\n";
    let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}{log}")).expect("valid");
    let m = goniofit::gonio::reduce("m", &raw, &instrument, None).expect("reduced").measurement;
    let want = [
        None,
        Some(MaskReason::Saturated),
        Some(MaskReason::Shadowed),
        Some(MaskReason::Unread),
        Some(MaskReason::Unlit),
    ];
    assert_eq!(m.reasons, want);
    assert!((0..5).all(|i| m.value(0, i).is_some() == m.reasons[i].is_none()));
    for reason in MaskReason::ALL {
        assert!(m.notes.contains(&format!("1 pair of directions is masked: {}", reason.said())), "{:?}", m.notes);
    }
    let mut file = Vec::new();
    formats::write(&m, Format::Csv, Path::new("m.csv"), &mut file).expect("written");
    let text = String::from_utf8(file.clone()).expect("text");
    let cells: Vec<&str> = text.lines().filter_map(|l| l.rsplit(',').next()).filter(|l| !l.starts_with('#')).collect();
    assert_eq!(cells, ["mask_reason", "", "saturated", "shadowed", "unread", "unlit"], "{text}");
    let back = formats::read_bytes(Path::new("m.csv"), file, &ReadOptions::default()).expect("read");
    assert_eq!(back.reasons, m.reasons);
    assert_eq!(back.summary().mask_reasons.values().sum::<usize>(), 4);
    // Where nothing is masked nobody is told why.
    let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}0,0,60,0,sample,0,1,0,50\n")).expect("valid");
    assert!(goniofit::gonio::reduce("m", &raw, &instrument, None).expect("reduced").measurement.reasons.is_empty());
}

/// What counts is the pair: a channel that saturates is enough, a later stop that does not mends it, an exposure that is missing tells nothing of a well, and of
/// several reasons the first is said. A pair that nobody stopped at has none.
#[test]
fn of_channels_and_stops_a_masked_pair_says_the_first_reason() {
    let detector = Detector { full_well: 500.0, ..Default::default() };
    let instrument = Instrument { electrons: 100.0, read_noise: 0.0, detector, ..Instrument::default() };
    let head = HEADER.trim_end().to_owned() + ",signal_z\n";
    let log = "0,0,10,0,sample,0,1,0,50,500\n0,0,20,0,sample,1,1,0,,500\n0,0,30,0,sample,2,1,0,500,500\n0,0,40,0,sample,3,1,0,,50\n\
        0,0,50,0,sample,4,1,0,,\n0,0,50,0,sample,5,9,0,500,500\n0,0,30,0,sample,16,1,0,50,50\n";
    let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{head}{log}")).expect("valid");
    let m = goniofit::gonio::reduce("m", &raw, &instrument, None).expect("reduced").measurement;
    let (saturated, unread) = (Some(MaskReason::Saturated), Some(MaskReason::Unread));
    assert_eq!(m.reasons, [saturated, saturated, None, unread, unread]);
    assert_eq!((m.value(0, 0).is_some(), m.value(1, 0)), (true, None));
    assert!(m.value(0, 2).is_some() && m.value(1, 3).is_some() && m.value(0, 3).is_none());
}

/// Without a reference nothing tells how far the source's power has walked. Two readings differ by what it walked between them, and not by less because
/// both are off by what it walked before: σ² of their ratio is that of the time between.
#[test]
fn a_walk_that_no_reference_tells_is_shared_as_far_as_it_is() {
    let base = Instrument { electrons: 1e15, read_noise: 0.0, ..Instrument::default() };
    let drifting = goniofit::gonio::parts::Source { drift_per_sqrt_hour: 0.01, ..base.source };
    let detector = goniofit::gonio::parts::Detector { exposures_s: vec![36.0], ..Default::default() };
    let instrument = Instrument { source: drifting, detector, ..base };
    let (of, scan) = (material(0.3, 0.0, 1.0), in_plane(10.0));
    let raw = read(&of, &instrument, &scan, 1);
    let m = reduced(&raw, &instrument, &of).measurement;
    let sigma = m.sigma.as_ref().expect("noise");
    // Readings of 36 s: place i is 0.01 (i + ½) hours from the start.
    let hours = |i: usize| 0.01 * (i as f64 + 0.5);
    let relative = |plane: &[f64], i: usize| plane[i] / m.value(0, i).expect("valid");
    let last = m.len() - 1;
    for (i, j) in [(0, last), (3, 60), (40, 80), (50, 60), (last - 9, last)] {
        let alone = m.common.iter().map(|plane| relative(plane, j).powi(2)).sum::<f64>() + relative(sigma, j).powi(2);
        assert!((alone / (1e-4 * hours(j)) - 1.0).abs() < 1e-9, "{j}: {alone}");
        let shared: f64 = m.common.iter().map(|p| (relative(p, j) - relative(p, i)).powi(2)).sum();
        let apart = shared + relative(sigma, i).powi(2) + relative(sigma, j).powi(2);
        let want = 1e-4 * (hours(j) - hours(i));
        println!("{i}, {j}: {apart:e}, {want:e}");
        // Within an eighth of the run the walk counts as each one's own: at most a quarter of an eighth's variance twice.
        let own = 1e-4 * 1.02 / 8.0 / 4.0;
        assert!(apart > want * (1.0 - 1e-9) && apart < want + 2.0 * own, "{i} {j}: {apart:e} {want:e}");
    }
}

/// Electronics that add 50 to every reading: dark and blank of the same exposure have them too, those of another do not tell.
#[test]
fn what_is_subtracted_is_of_the_same_exposure() {
    // Clocks differ in their last digits.
    let base = |kind: &str, time: u32| format!(",,,,{kind},{time},0.10000001,0,51\n,,,,{kind},{},1,0,60\n", time + 1);
    let sample = |angle: u32, time: u32, exposure: f64, rate: f64| {
        format!("0,0,{angle},0,sample,{time},{exposure},0,{}\n", 50.0 + exposure * (rate + 10.0))
    };
    let rows = [base("dark", 0), sample(30, 4, 0.1, 1000.0), sample(60, 5, 1.0, 30.0), base("dark", 8)].concat();
    let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}{rows}")).expect("valid");
    let m = goniofit::gonio::reduce("m", &raw, &Instrument::noiseless(), None).expect("reduced").measurement;
    let cos = |deg: f64| deg.to_radians().cos();
    let (a, b) = (m.value(0, 0).expect("valid") * cos(30.0), m.value(0, 1).expect("valid") * cos(60.0));
    assert!((a - 1000.0).abs() < 1e-4 && (b - 30.0).abs() < 1e-9 && m.notes.is_empty(), "{a} {b} {:?}", m.notes);
    // Of half a second there is no dark: said, and a described offset comes off all the same.
    let rows = [base("dark", 0), sample(30, 4, 0.5, 1000.0), base("dark", 8)].concat();
    let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}{rows}")).expect("valid");
    let of =
        |instrument: &Instrument| goniofit::gonio::reduce("m", &raw, instrument, None).expect("reduced").measurement;
    let blind = of(&Instrument::noiseless());
    assert!(
        blind.notes.iter().any(|n| n.starts_with("no blank or dark has the exposure of 0.5 s")),
        "{:?}",
        blind.notes
    );
    let detector = Detector { offset: 50.0, ..Detector::default() };
    let told = of(&Instrument { electrons: 1.0, read_noise: 0.0, detector, ..Instrument::default() });
    assert!((told.value(0, 0).expect("valid") * cos(30.0) - 1000.0).abs() < 1e-9);
}

/// The noise of the one visit to the white is in all readings, however often blanks were read.
#[test]
fn a_visit_s_noise_is_shared_however_often_others_are_read() {
    let of = |blanks: usize| {
        let mut rows = ",,,,reference,0,1,0,3000\n,,,,reference,1,1,1,3000\n,,,,blank,2,1,0,10\n".to_owned();
        let sample = |k: usize| format!("0,0,{k},0,sample,{},1,0,2000\n", 10 + 2 * k);
        let blank = |k: usize| format!(",,,,blank,{},1,0,10\n", 11 + 2 * k);
        let of = |k: usize| if k.is_multiple_of(60 / blanks) { sample(k) + &blank(k) } else { sample(k) };
        rows.extend((0..60).map(of));
        let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{HEADER}{rows}")).expect("valid");
        let reference = Reference { reflectance: 0.98, ..Reference::default() };
        let instrument = Instrument { electrons: 1e4, reference, ..Instrument::default() };
        let reduction = goniofit::gonio::reduce("m", &raw, &instrument, None).expect("reduced");
        let line = reduction.budget.lines.iter().position(|l| l.name == "noise of the reference").expect("there");
        let shared: f64 = reduction.measurement.common.iter().map(|k| k[30] * k[30]).sum();
        (reduction.budget.contribution(line, 30), shared.sqrt())
    };
    for blanks in [1, 12, 60] {
        let (reference, shared) = of(blanks);
        assert!(shared > 0.99 * reference, "{blanks}: {shared} of {reference}");
    }
}

/// An instrument whose electronics have an offset reads what one without it does, in every exposure, and is as sure.
#[test]
fn an_electronic_offset_comes_off() {
    let (satin, scan) = (material(0.2, 0.1, 200.0), in_plane(5.0));
    let exact = Instrument { electrons: 1e6, ..faultless() };
    let offset = |offset: f64| Instrument {
        detector: Detector { offset, full_well: 2e6, ..exact.detector.clone() },
        ..exact.clone()
    };
    let of = |instrument: &Instrument| {
        let raw = with_job(&satin, instrument, &scan, 1, &["shot noise"], |job| job.run(Control::silent()));
        reduced(&raw, instrument, &satin).measurement
    };
    let (without, with) = (of(&offset(0.0)), of(&offset(3e4)));
    let mut read = 0;
    for i in 0..with.len() {
        let (Some(a), Some(b)) = (without.value(0, i), with.value(0, i)) else { continue };
        assert!((a / b - 1.0).abs() < 1e-9, "{i}: {a} {b}");
        assert!(sigma(&with, i) < 1.2 * sigma(&without, i) + 1e-12, "{i}");
        read += 1;
    }
    assert!(read > 150, "{read}");
}

/// A pair that was read at several stops and in several channels is one pair, whichever of its channels is masked.
#[test]
fn a_masked_pair_counts_once() {
    let header = HEADER.replace("signal_y", "signal_a,signal_b");
    let rows = "0,0,30,0,sample,0,1,0,5,\n0,0,60,0,sample,1,1,0,,\n0,0,30,0,sample,2,1,0,6,\n10,0,60,0,sample,3,1,0,7,8\n0,0,100,0,sample,4,1,0,1,1\n\
                0,0,20,0,sample,5,1,0,1,\n0,0,20,0,sample,6,1,0,,1\n";
    let (raw, _) = Raw::from_csv(Path::new("r.csv"), &format!("{header}{rows}")).expect("valid");
    let m = goniofit::gonio::reduce("m", &raw, &Instrument::noiseless(), None).expect("reduced").measurement;
    // Of 20° each channel was read once.
    let counts: Vec<&str> =
        m.notes.iter().filter(|n| n.contains("masked")).map(|n| &n[..n.find(':').unwrap()]).collect();
    assert_eq!(counts, ["2 pairs of directions are masked", "1 pair of directions is masked"], "{:?}", m.notes);
}
