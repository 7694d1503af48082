//! The instrument of the flat world: the same chain with lengths for areas and angles for solid angles.

use crate::support::*;
use goniofit::brdf::{LobeKind, Material};
use goniofit::gonio::parts::Detector;
use goniofit::gonio::{Instrument, Raw, Scan};
use goniofit::measurement::{Dimension, Directions, Weights};

fn flat_material(kd: f64, ks: f64, n: f64) -> Material {
    let lobes = vec![(LobeKind::Lambert2d, vec![kd], vec![]), (LobeKind::Phong2d, vec![ks], vec![n])];
    Material::new(vec!["y".into()], lobes)
}

fn scan() -> (Directions, Weights) {
    Scan::Flat { step_deg: 10.0 }.directions().expect("small")
}

/// Everything that cancels in space cancels here.
#[test]
fn a_nominal_instrument_s_readings_reduce_to_the_truth() {
    let (truth, scan) = (flat_material(0.3, 0.2, 15.0), scan());
    let instrument = faultless();
    let m = reduced(&read_nominal(&truth, &instrument, &scan), &instrument, &truth).measurement;
    assert_eq!(m.dimension, Dimension::Flat);
    let mut valid = 0;
    for i in 0..m.len() {
        let (wi, wo) = m.directions.pair(i);
        if let Some(value) = m.value(0, i) {
            valid += 1;
            assert!((value / truth.value(wi, wo)[0] - 1.0).abs() < 1e-12, "{i}: {value}");
        }
    }
    // Source and detector meet once for each of seventeen incidences.
    assert_eq!(valid, 17 * 17 - 17);
}

/// The mean over an arc of an aperture is that of a fine sum over its angle, and errors of positions stay in the plane.
#[test]
fn an_aperture_of_the_flat_world_is_an_arc() {
    let (truth, scan) = (flat_material(0.1, 0.3, 400.0), scan());
    let instrument =
        Instrument { detector: Detector { aperture_deg: 6.0, ..Detector::default() }, ..Instrument::noiseless() };
    let raw = read_nominal(&truth, &instrument, &scan);
    for (i, reading) in raw.readings.iter().enumerate() {
        let (wi, wo) = scan.0.pair(reading.entry.expect("sample") as usize);
        let (middle, steps) = (wo.x.atan2(wo.z), 20_000);
        let at = |k: i32| {
            let theta = middle + 3f64.to_radians() * ((2.0 * f64::from(k) + 1.0) / f64::from(steps) - 1.0);
            let w = glam::DVec3::new(theta.sin(), 0.0, theta.cos());
            if w.z > 0.0 { truth.value(wi, w)[0] * w.z } else { 0.0 }
        };
        let want = (0..steps).map(at).sum::<f64>() / f64::from(steps);
        assert!((raw.signal[i] - want).abs() < 1e-6 * (1.0 + want), "{i}: {} {want}", raw.signal[i]);
    }
}

/// Readings of an instrument whose positions are off hold the truth as often as they should, and come back from their file.
#[test]
fn readings_hold_the_truth_and_come_back_from_their_file() {
    let (truth, instrument, scan) = (flat_material(0.3, 0.2, 15.0), crooked(), scan());
    let raw = read(&truth, &instrument, &scan, 3);
    let text = raw.to_csv(&instrument);
    assert!(text.contains("# dimension: 2\n") && !text.contains("phi"), "{}", &text[..400]);
    let (back, _) = Raw::from_csv(std::path::Path::new("r.csv"), &text).expect("reads back");
    assert_eq!((back.dimension, &back.signal), (Dimension::Flat, &raw.signal));
    let (mut held, mut all) = (0u32, 0u32);
    for seed in 0..100 {
        let m = reduced(&read(&truth, &instrument, &scan, seed), &instrument, &truth).measurement;
        for i in 0..m.len() {
            let (wi, wo) = m.directions.pair(i);
            let Some(value) = m.value(0, i) else { continue };
            let own = m.sigma.as_ref().expect("noise")[i];
            let variance = own * own + m.common.iter().map(|k| k[i] * k[i]).sum::<f64>();
            all += 1;
            held += u32::from((value - truth.value(wi, wo)[0]).abs() <= 1.96 * variance.sqrt());
        }
    }
    // Errors that an instrument keeps make its readings hold or miss together: the share scatters as over 100 draws, 2.2 %, at most.
    let share = f64::from(held) / f64::from(all);
    println!("{share}");
    assert!((share - 0.95).abs() < 0.05, "{share}");
    for other in ["3", "4"] {
        let wrong = text.replace("# dimension: 2", &format!("# dimension: {other}"));
        let said = Raw::from_csv(std::path::Path::new("r.csv"), &wrong).expect_err("no such line").to_string();
        assert!(said.contains("expected 2, the flat world") && said.contains(&format!("found \"{other}\"")), "{said}");
    }
}
