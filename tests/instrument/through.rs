//! Fits through the instrument: lobes averaged as it averages them.

use std::sync::Arc;

use crate::support::*;
use glam::DVec3;
use goniofit::brdf::{LobeKind, Material, Place, Sight};
use goniofit::fit::{FitOptions, fit};
use goniofit::geometry::direction;
use goniofit::gonio::Instrument;
use goniofit::gonio::parts::{Detector, Source};
use goniofit::gonio::sight::Cones;
use goniofit::measurement::{Directions, Weights};

/// An instrument without noise and with cones of these full angles.
fn wide(divergence_deg: f64, aperture_deg: f64) -> Instrument {
    Instrument {
        source: Source { divergence_deg, ..Source::default() },
        detector: Detector { aperture_deg, ..Detector::default() },
        ..Instrument::noiseless()
    }
}

/// Pairs about the mirror direction, at steps of a share of what is the wider, lobe or cones, and some farther out.
fn about_the_mirror(width: f64) -> (Directions, Weights) {
    let (mut wi, mut wo) = (Vec::new(), Vec::new());
    for theta in [0.1f64, 0.6, 1.1] {
        for k in -12..=12 {
            for j in 0..4 {
                let (off, side) = (0.3 * width * f64::from(k), 0.5 * width * f64::from(j));
                let pair = (
                    direction(theta, 0.0),
                    direction((theta + off).abs(), if theta + off < 0.0 { 0.0 } else { std::f64::consts::PI } + side),
                );
                if pair.1.z > 0.35 {
                    wi.push(pair.0);
                    wo.push(pair.1);
                }
            }
        }
        for k in 0..10 {
            wi.push(direction(theta, 0.0));
            wo.push(direction(0.12 * f64::from(k), 2.0));
        }
    }
    (Directions::List { wi, wo }, Weights::Uniform)
}

/// Every how many-th pair of a scan.
fn thinned((directions, weights): (Directions, Weights), step: usize) -> (Directions, Weights) {
    let (wi, wo) = (0..directions.len()).step_by(step).map(|i| directions.pair(i)).unzip();
    (Directions::List { wi, wo }, weights)
}

/// What a lobe's kernel says is what the readings are: the same integral by another way.
#[test]
fn a_lobe_seen_through_the_instrument_is_what_it_reads() {
    for (source, detector, n) in [
        (0.0, 2.0, 30.0),
        (0.0, 3.0, 3e3),
        (1.0, 0.0, 500.0),
        (0.5, 2.0, 2e3),
        (2.0, 0.7, 2e3),
        (4.0, 4.0, 5.0),
        (0.3, 1.0, 2e4),
    ] {
        let instrument = wide(source, detector);
        let cones = Cones::of(&instrument).expect("cones");
        // Sums over two cones take long: fewer pairs then.
        let scan =
            thinned(about_the_mirror(f64::max(1.0 / f64::sqrt(n), 0.01)), if source * detector > 0.0 { 9 } else { 1 });
        let material = Material::new(vec!["y".into()], vec![(LobeKind::Phong, vec![1.0], vec![n])]);
        let raw = read_nominal(&material, &instrument, &scan);
        let read = reduced(&raw, &instrument, &material).measurement;
        let pairs: Vec<(DVec3, DVec3)> = (0..scan.0.len()).map(|i| scan.0.pair(i)).collect();
        let places: Vec<Place> = pairs.iter().map(|(wi, wo)| cones.place(*wi, *wo).expect("above")).collect();
        let (mut values, mut slopes) = (vec![0.0; places.len()], vec![vec![0.0; places.len()]]);
        cones.fill(LobeKind::Phong, &[n], &places, &mut values, &mut slopes);
        let largest = values.iter().copied().fold(0.0, f64::max);
        let worst = values.iter().zip(&read.values).map(|(a, b)| (a - b).abs() / largest).fold(0.0, f64::max);
        println!("source {source}°, aperture {detector}°, n {n}: off by {worst:.1e} of the peak");
        assert!(worst < 3e-6 + 3.0 * raw.quadrature_error, "{source} {detector} {n}: {worst:e}");
        // Derivatives are those of the values.
        let step = 1e-4 * n;
        let at = |n: f64| {
            let mut list = vec![0.0; places.len()];
            cones.fill(LobeKind::Phong, &[n], &places, &mut list, &mut [vec![0.0; places.len()]]);
            list
        };
        let (up, down) = (at(n + step), at(n - step));
        for i in 0..places.len() {
            let slope = (up[i] - down[i]) / (2.0 * step);
            assert!(
                (slope - slopes[0][i]).abs() < 1e-5 * largest / n,
                "{source} {detector} {n}: {slope} {}",
                slopes[0][i]
            );
        }
    }
}

/// Noise-free readings give the material back, whatever the cones make of them; taken at face value they don't.
#[test]
fn a_fit_through_the_instrument_finds_the_material() {
    for (source, detector, n) in
        [(0.0, 1.0, 100.0), (0.0, 3.0, 1e3), (0.2, 1.0, 1e3), (1.0, 0.0, 300.0), (0.0, 0.5, 1e5)]
    {
        let (truth, instrument) = (material(0.2, 0.1, n), wide(source, detector));
        let scan = about_the_mirror(f64::max(1.0 / f64::sqrt(n), 0.01));
        let readings = reduced(&read_nominal(&truth, &instrument, &scan), &instrument, &truth).measurement;
        let plain = FitOptions::new("lambert+phong".parse().expect("a model"));
        let through = FitOptions { through: Some(Arc::new(Cones::of(&instrument).expect("cones"))), ..plain.clone() };
        let exponent = |options: &FitOptions| {
            let found = fit(&readings, options).expect("fits").material;
            (found.lobes[1].shape_of(0).expect("a shape")[0], found.lobes[0].weight[0], found.lobes[1].weight[0])
        };
        let (face, seen) = (exponent(&plain), exponent(&through));
        println!("source {source}°, aperture {detector}°, n {n}: plain {:.4}, through {:.6}", face.0, seen.0);
        assert!(
            (seen.0 / n - 1.0).abs() < 1e-4 && (seen.1 / 0.2 - 1.0).abs() < 1e-4 && (seen.2 / 0.1 - 1.0).abs() < 1e-4,
            "{seen:?}"
        );
        assert!((face.0 / n - 1.0).abs() > 20.0 * (seen.0 / n - 1.0).abs(), "{face:?} {seen:?}");
    }
}
