//! Every effect's limit: as its cause goes to 0 the reading goes to the ideal one, at the order that theory gives.

use crate::support::*;
use goniofit::gonio::Instrument;
use goniofit::gonio::parts::{Axes, Detector, Holder, Reference, Source, Surroundings};

/// An instrument without noise and without parts.
fn ideal() -> Instrument {
    Instrument::noiseless()
}

/// Largest |reading/ideal − 1| over a scan of a glossy material, for causes x, x/2, x/4, and the orders between them.
fn orders(name: &str, of: impl Fn(f64) -> Instrument, from: f64) -> [f64; 2] {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(20.0));
    let best = read_nominal(&material, &ideal(), &scan).signal;
    let off = |x: f64| {
        let raw = read_nominal(&material, &of(x), &scan);
        let sample = raw.readings.iter().zip(&raw.signal).filter(|(r, _)| r.entry.is_some()).map(|(_, s)| *s);
        sample.zip(&best).map(|(s, ideal)| (s / ideal - 1.0).abs()).fold(0.0, f64::max)
    };
    let offs = [from, from / 2.0, from / 4.0].map(off);
    let orders = [(offs[0] / offs[1]).log2(), (offs[1] / offs[2]).log2()];
    println!("{name}: off by {offs:?}, orders {orders:?}");
    orders
}

#[test]
fn apertures_and_divergences_fade_as_their_square() {
    let aperture = |x: f64| Instrument { detector: Detector { aperture_deg: x, ..Detector::default() }, ..ideal() };
    let divergence = |x: f64| Instrument { source: Source { divergence_deg: x, ..Source::default() }, ..ideal() };
    for order in [orders("aperture", aperture, 0.8), orders("divergence", divergence, 0.8)] {
        assert!(order.iter().all(|o| (o - 2.0).abs() < 0.05), "{order:?}");
    }
}

#[test]
fn stray_light_fades_in_proportion() {
    let stray =
        |x: f64| Instrument { surroundings: Surroundings { stray_per_sr: x, ..Surroundings::default() }, ..ideal() };
    assert!(orders("stray light", stray, 1e-3).iter().all(|o| (o - 1.0).abs() < 1e-9));
}

/// A mean over a cone of a lobe of any sharpness is what a fine sum over the same cone says.
#[test]
fn the_mean_over_a_wide_aperture_of_a_sharp_lobe_is_that_of_a_fine_sum() {
    let (material, scan) = (material(0.1, 0.2, 2e3), in_plane(15.0));
    let instrument = Instrument { detector: Detector { aperture_deg: 3.0, ..Detector::default() }, ..ideal() };
    let raw = read_nominal(&material, &instrument, &scan);
    assert!(raw.quadrature_error < 1e-7, "{}", raw.quadrature_error);
    let depth = 1.0 - 1.5f64.to_radians().cos();
    for (i, reading) in raw.readings.iter().enumerate() {
        let (wi, wo) = scan.0.pair(reading.entry.expect("sample") as usize);
        let frame = goniofit::geometry::frame::Frame::from_normal(wo);
        let (rings, around) = (400, 64);
        let mut sum = 0.0;
        for k in 0..rings {
            let z = 1.0 - depth * (f64::from(k) + 0.5) / f64::from(rings);
            let s = (1.0 - z * z).sqrt();
            for j in 0..around {
                let phi = std::f64::consts::TAU * f64::from(j) / f64::from(around);
                let w = frame.to_world(glam::DVec3::new(s * phi.cos(), s * phi.sin(), z));
                sum += if w.z > 0.0 { material.value(wi, w)[0] * w.z } else { 0.0 };
            }
        }
        let want = sum / f64::from(rings * around);
        assert!((raw.signal[i] / want - 1.0).abs() < 2e-4, "{i}: {} {want}", raw.signal[i]);
    }
}

/// What is off changes no bit: an instrument with every part at its ideal gives f cosθo, and leaving out by name is the same as not having.
#[test]
fn an_effect_that_is_off_changes_no_bit() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(10.0));
    let bits = |signal: &[f64]| signal.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
    let best = read_nominal(&material, &ideal(), &scan);
    let wanted: Vec<f64> = (0..scan.0.len())
        .map(|i| {
            let (wi, wo) = scan.0.pair(i);
            wo.z * material.value(wi, wo)[0]
        })
        .collect();
    assert_eq!(bits(&best.signal), bits(&wanted));
    let full = crooked();
    let without = Instrument { axes: Axes { jitter_deg: 0.0, ..full.axes }, ..full.clone() };
    let a = with_job(&material, &full, &scan, 7, &["axis jitter"], |job| job.run(goniofit::control::Control::silent()));
    let b = with_job(&material, &without, &scan, 7, &[], |job| job.run(goniofit::control::Control::silent()));
    assert_eq!(bits(&a.signal), bits(&b.signal));
    assert!(full != without);
}

/// The reduction of readings without noise, by an instrument without errors, is the truth: dark, stray light, drift, a small sample, a standard that
/// is no Lambertian and brackets all cancel.
#[test]
fn a_nominal_instrument_s_readings_reduce_to_the_truth() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(10.0));
    let instrument = Instrument {
        source: Source { beam_diameter_m: 0.02, ..Source::default() },
        sample: Holder { diameter_m: 0.03, ..Holder::default() },
        detector: Detector { field_diameter_m: 0.025, exposures_s: vec![0.1, 1.0], ..Detector::default() },
        reference: Reference { reflectance: 0.98, shape: 0.2, ..Reference::default() },
        surroundings: Surroundings { stray_per_sr: 0.01, shadow_deg: 4.0 },
        ..ideal()
    };
    let raw = read_nominal(&material, &instrument, &scan);
    let m = reduced(&raw, &instrument, &material).measurement;
    let mut shadowed = 0;
    for i in 0..m.len() {
        let (wi, wo) = m.directions.pair(i);
        match m.value(0, i) {
            Some(value) => assert!((value / material.value(wi, wo)[0] - 1.0).abs() < 1e-12, "{i}: {value}"),
            None => shadowed += 1,
        }
    }
    // The six incidences are multiples of 15°, the scan's steps of 10°: three of them meet.
    assert_eq!(shadowed, 3);
    assert!(m.notes.iter().any(|n| n.contains("shadow each other")), "{:?}", m.notes);
}
