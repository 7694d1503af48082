//! The spot's extent: points of the spot see source and detector in directions of their own.

use std::sync::Arc;

use crate::support::*;
use glam::DVec3;
use goniofit::brdf::{LobeKind, Material, Sight};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, fit};
use goniofit::gonio::parts::{Detector, Holder, Source};
use goniofit::gonio::sight::Cones;
use goniofit::gonio::{Instrument, Job};
use goniofit::measurement::{Dimension, Directions, Weights};
use rand::{RngExt, SeedableRng};

/// An instrument without noise: a beam, how far source and detector are, the sample's diameter, and an aperture.
fn near(beam_diameter_m: f64, source: f64, detector: f64, sample: f64, aperture_deg: f64) -> Instrument {
    Instrument {
        source: Source { beam_diameter_m, distance_m: source, ..Source::default() },
        sample: Holder { diameter_m: sample, ..Holder::default() },
        detector: Detector { distance_m: detector, aperture_deg, ..Detector::default() },
        ..Instrument::noiseless()
    }
}

/// Signals of a scan of a material.
fn read(material: &Material, instrument: &Instrument, scan: &(Directions, Weights)) -> Vec<f64> {
    read_nominal(material, instrument, scan).signal
}

fn phong(n: f64) -> Material {
    Material::new(vec!["y".into()], vec![(LobeKind::Phong, vec![1.0], vec![n])])
}

/// Pairs in a list.
fn list(pairs: &[(DVec3, DVec3)]) -> (Directions, Weights) {
    let (wi, wo) = pairs.iter().copied().unzip();
    (Directions::List { wi, wo }, Weights::Uniform)
}

/// Seen along the normal a matte disc of radius b fills the detector at d as sin²: ⟨1/(1 + ρ²)²⟩ = 1/(1 + b²/d²).
#[test]
fn a_matte_spot_along_the_normal_has_the_form_factor_of_a_disc() {
    let matte = Material::new(vec!["y".into()], vec![(LobeKind::Lambert, vec![0.5], vec![])]);
    let scan = list(&[(DVec3::Z, DVec3::Z)]);
    for (b, d) in [(0.005, 0.5), (0.01, 0.1), (0.05, 0.1)] {
        let got = read(&matte, &near(2.0 * b, 0.0, d, 0.0, 0.0), &scan)[0];
        let want = 0.5 / std::f64::consts::PI / (1.0 + (b / d) * (b / d));
        assert!((got / want - 1.0).abs() < 1e-6, "{b} {d}: {got} {want}");
        // The reduction knows it: what comes back is the BRDF.
        let instrument = near(2.0 * b, 0.0, d, 0.0, 0.0);
        let raw = read_nominal(&matte, &instrument, &scan);
        let back = reduced(&raw, &instrument, &matte).measurement.values[0];
        assert!((back * std::f64::consts::PI / 0.5 - 1.0).abs() < 1e-6, "{b} {d}: {back}");
    }
}

/// In the flat world a length of half b: ⟨(1 + x²)^(−3/2)⟩ = 1/√(1 + b²/d²).
#[test]
fn a_matte_spot_of_the_flat_world_has_its_closed_form() {
    let matte = Material::new(vec!["y".into()], vec![(LobeKind::Lambert2d, vec![0.5], vec![])]);
    let scan = list(&[(DVec3::Z, DVec3::Z)]);
    for (b, d) in [(0.005, 0.5), (0.05, 0.1)] {
        let instrument = near(2.0 * b, 0.0, d, 0.0, 0.0);
        let got = with_job(&matte, &instrument, &scan, 1, &[], |job| {
            Job { dimension: Dimension::Flat, ..*job }.run(Control::silent()).signal[0]
        });
        let want = 0.25 / f64::hypot(1.0, b / d);
        assert!((got / want - 1.0).abs() < 1e-6, "{b} {d}: {got} {want}");
    }
}

/// As the beam closes a reading goes to that of its middle as the diameter's square.
#[test]
fn the_spot_fades_as_its_square() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(20.0));
    let best = read(&material, &Instrument::noiseless(), &scan);
    let off = |beam: f64| {
        let signal = read(&material, &near(beam, 0.7, 0.5, 0.0, 0.0), &scan);
        signal.iter().zip(&best).map(|(s, ideal)| (s / ideal - 1.0).abs()).fold(0.0, f64::max)
    };
    let offs = [4e-3, 2e-3, 1e-3].map(off);
    let orders = [(offs[0] / offs[1]).log2(), (offs[1] / offs[2]).log2()];
    println!("spot extent: off by {offs:?}, orders {orders:?}");
    assert!(orders.iter().all(|o| (o - 2.0).abs() < 0.02), "{orders:?}");
}

/// The mean over a spot by random points of its own, straight from the geometry: flux through the detector's disc over that of a small spot.
fn by_chance(material: &Material, instrument: &Instrument, (wi, wo): (DVec3, DVec3), count: usize) -> (f64, f64) {
    // Over all of the beam: what misses the sample is nothing.
    let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(7);
    let (beam, sample) = (0.5 * instrument.source.beam_diameter_m, 0.5 * instrument.sample.diameter_m);
    let (source, detector) = (wi * instrument.source.distance_m, wo * instrument.detector.distance_m);
    // A square about the beam's ellipse, whose longer half axis is beam/cosθi.
    let half = beam / wi.z;
    let (mut sum, mut squares, mut inside) = (0.0, 0.0, 0usize);
    while inside < count {
        let p = DVec3::new((2.0 * rng.random::<f64>() - 1.0) * half, (2.0 * rng.random::<f64>() - 1.0) * half, 0.0);
        let across = p - wi * p.dot(wi);
        if across.length() > beam {
            continue;
        }
        inside += 1;
        if sample > 0.0 && p.length() > sample {
            continue;
        }
        let (to_source, to_detector) = (source - p, detector - p);
        let (i, o) = (to_source.normalize(), to_detector.normalize());
        // Irradiance of a beam that is even across it; the detector's solid angle; both over those of the middle.
        let tube = (to_source.dot(wi) / source.length()).powi(2);
        let irradiance = i.z / i.dot(wi) / tube / wi.z;
        let solid = o.dot(wo) / to_detector.length_squared() * detector.length_squared();
        let value = material.value(i, o)[0] * o.z * irradiance * solid;
        sum += value;
        squares += value * value;
    }
    let n = count as f64;
    let mean = sum / n;
    (mean, ((squares / n - mean * mean) / n).sqrt())
}

/// Spots that are whole, and such as the sample's edge cuts, oblique, in and out of the plane.
#[test]
fn readings_are_what_random_points_say() {
    let direction = |theta: f64, phi: f64| goniofit::geometry::angles::direction_deg(theta, phi);
    for (k, (pair, sample, n)) in [
        ((direction(30.0, 180.0), direction(32.0, 0.0)), 0.0, 200.0),
        ((direction(60.0, 180.0), direction(55.0, 5.0)), 0.0, 60.0),
        ((direction(60.0, 180.0), direction(55.0, 5.0)), 0.03, 60.0),
        ((direction(75.0, 100.0), direction(40.0, 30.0)), 0.05, 3.0),
        ((direction(0.0, 0.0), direction(2.0, 50.0)), 0.015, 1000.0),
    ]
    .into_iter()
    .enumerate()
    {
        let instrument = near(0.02, 0.4, 0.3, sample, 0.0);
        let material = phong(n);
        let raw = with_job(&material, &instrument, &list(&[pair]), 1, &[], |job| job.run(Control::silent()));
        let (mean, sigma) = by_chance(&material, &instrument, pair, 400_000);
        let z = (raw.signal[0] - mean) / sigma;
        println!("spot {k}: {:.6e} against {mean:.6e}, {z:.2} sigma of {:.1e}", raw.signal[0], sigma / mean);
        assert!(z.abs() < 4.0, "{k}: {z}");
        assert!(raw.quadrature_error < 1e-6, "{k}: {}", raw.quadrature_error);
    }
}

/// What a lobe's kernel says is what the readings are, and its derivative that of its value.
#[test]
fn a_lobe_seen_through_the_spot_is_what_it_reads() {
    for (beam, source, detector, aperture, n) in [
        (0.017, 0.0, 0.6, 1.0, 3e3),
        (0.02, 0.0, 1.0, 0.3, 2e4),
        (0.015, 0.6, 0.115, 3.0, 3e3),
        (0.02, 0.5, 0.5, 0.0, 1e5),
        (0.01, 0.0, 0.25, 4.0, 60.0),
    ] {
        let instrument = near(beam, source, detector, 0.0, aperture);
        let cones = Cones::of(&instrument).expect("a spot");
        let pairs: Vec<(DVec3, DVec3)> = [0.1f64, 0.5, 1.0]
            .into_iter()
            .flat_map(|theta| {
                let about = move |k: i32| theta + 0.012 * f64::from(k);
                let to = move |k: i32| {
                    goniofit::geometry::direction(
                        about(k).abs(),
                        if about(k) < 0.0 { 3.2 } else { 0.02 * f64::from(k) },
                    )
                };
                (-4..=4).map(move |k| (goniofit::geometry::direction(theta, std::f64::consts::PI), to(k)))
            })
            .collect();
        let (material, scan) = (phong(n), list(&pairs));
        let raw = read_nominal(&material, &instrument, &scan);
        let read = reduced(&raw, &instrument, &material).measurement;
        let places: Vec<_> = pairs.iter().map(|(wi, wo)| cones.place(*wi, *wo).expect("above")).collect();
        let fill = |n: f64| {
            let (mut values, mut slopes) = (vec![0.0; places.len()], vec![vec![0.0; places.len()]]);
            cones.fill(LobeKind::Phong, &[n], &places, &mut values, &mut slopes);
            (values, slopes.remove(0))
        };
        let (values, slopes) = fill(n);
        let largest = values.iter().copied().fold(0.0, f64::max);
        let worst = values.iter().zip(&read.values).map(|(a, b)| (a - b).abs() / largest).fold(0.0, f64::max);
        println!(
            "beam {beam} m, {source} and {detector} m, aperture {aperture}°, n {n}: off by {worst:.1e} of the peak"
        );
        assert!(worst < 1e-6 + raw.quadrature_error, "{worst:e}, {:e}", raw.quadrature_error);
        let (up, down) = (fill(n * 1.0001).0, fill(n * 0.9999).0);
        for i in 0..places.len() {
            let slope = (up[i] - down[i]) / (2e-4 * n);
            assert!((slope - slopes[i]).abs() < 1e-5 * largest / n, "{i}: {slope} {}", slopes[i]);
        }
    }
}

/// A plain fit takes the smear for a broader lobe; one through the instrument finds what was there.
#[test]
fn a_fit_through_the_spot_finds_the_exponent_that_a_plain_one_misses() {
    let instrument = near(0.017, 0.0, 0.6, 0.0, 0.0);
    let (truth, scan) = (material(0.2, 0.1, 2000.0), in_plane(1.0));
    let raw = read_nominal(&truth, &instrument, &scan);
    let table = reduced(&raw, &instrument, &truth).measurement;
    let plain = FitOptions::new("lambert+phong".parse().expect("a model"));
    let through = FitOptions { through: Some(Arc::new(Cones::of(&instrument).expect("a spot"))), ..plain.clone() };
    let exponent = |options: &FitOptions| {
        let found = fit(&table, options).expect("an answer").material;
        found.lobes.iter().find_map(|l| l.shape_of(0).and_then(|s| s.first().copied())).expect("a lobe")
    };
    let (plain, through) = (exponent(&plain), exponent(&through));
    println!("n = 2000: {plain:.2} at face value, {through:.6} through the spot");
    assert!(plain < 1900.0 && (through / 2000.0 - 1.0).abs() < 1e-5, "{plain} {through}");
}

/// A spot that nothing cuts grows with grazing incidence until it reaches up to the detector: such readings are masked with the reason, and no instrument whose beam is
/// wider than that is taken.
#[test]
fn a_spot_that_reaches_up_to_the_detector_is_refused() {
    let matte = Material::new(vec!["y".into()], vec![(LobeKind::Lambert, vec![0.5], vec![])]);
    let at = |theta: f64| {
        let direction = goniofit::geometry::angles::direction_deg;
        (direction(theta, 180.0), direction(20.0, 0.0))
    };
    let (instrument, scan) = (near(0.02, 0.0, 0.1, 0.0, 0.0), list(&[at(60.0), at(83.0), at(85.0), at(89.0)]));
    let raw = read_nominal(&matte, &instrument, &scan);
    let m = reduced(&raw, &instrument, &matte).measurement;
    assert!((m.values[0] * std::f64::consts::PI / 0.5 - 1.0).abs() < 1e-6, "{:?}", m.values);
    assert!((m.values[1] * std::f64::consts::PI / 0.5 - 1.0).abs() < 1e-4, "{:?}", m.values);
    assert!(m.values[2..].iter().all(|v| v.is_nan()) && m.notes.iter().any(|n| n.contains("2 pairs")), "{:?}", m.notes);
    let wide = near(0.2, 0.0, 0.1, 0.0, 0.0).fault().expect("refused");
    assert!(
        wide.contains("instrument.source.beam_diameter_m: expected instrument.detector.distance_m = 0.1"),
        "{wide}"
    );
}
