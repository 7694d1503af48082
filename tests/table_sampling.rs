//! Drawing directions from a measured table: samples follow their density, weights have little variance, and their mean is
//! the directional albedo.
#![allow(clippy::float_cmp)] // the density of a draw and that of its direction are the same number

mod table_support;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;
use std::sync::OnceLock;

use glam::DVec3;
use goniofit::brdf::Brdf;
use goniofit::geometry::angles::direction_deg;
use goniofit::geometry::grid::cos_difference;
use goniofit::geometry::{Frame, HalfDiff, direction, mirror};
use goniofit::measurement::{Directions, Measurement, MerlGrid, TableBrdf};
use goniofit::numeric::quadrature::integrate;
use goniofit::numeric::random::{Purpose, RngExt, stream};
use goniofit::numeric::stats::{chi_square_test, sidak};
use table_support::{TENS, grey, lobe, merl_of, pairs, scan, table};

/// The tables, built once for all tests.
fn tables_to_draw_from() -> &'static [(&'static str, TableBrdf)] {
    static TABLES: OnceLock<Vec<(&str, TableBrdf)>> = OnceLock::new();
    TABLES.get_or_init(build_tables)
}

fn build_tables() -> Vec<(&'static str, TableBrdf)> {
    let gloss = |i: DVec3, o: DVec3| 0.1 + 3.0 * (-(o - mirror(i)).length_squared() / 0.02).exp();
    let retro = |i: DVec3, o: DVec3| 0.05 + 9.0 * (-(o - i).truncate().length_squared() / 0.03).exp();
    vec![
        ("matte MERL", table(&merl_of(|_| 0.25))),
        ("glossy MERL", table(&merl_of(lobe(0.1, 0.0)))),
        ("near-mirror MERL", table(&merl_of(lobe(0.008, 0.0)))),
        ("retro MERL", table(&merl_of(lobe(0.3, 20.0)))),
        ("lopsided MERL", table(&merl_of(|a| lobe(0.3, 0.0)(a) * (1.0 + 0.6 * (2.0 * a.phi_d).sin())))),
        ("glossy scan", table(&scan(&TENS, gloss))),
        ("retro scan", table(&scan(&[15.0, 30.0, 60.0], retro))),
        ("black scan", table(&scan(&TENS, |_, _| 0.0))),
    ]
}

/// The bin of `wi` about an axis: 24 polar rows spaced by squares over [0, π], 8 azimuths.
fn bin(frame: &Frame, wi: DVec3) -> usize {
    let w = frame.to_local(wi);
    let row = 24.0 * (w.z.clamp(-1.0, 1.0).acos() / PI).sqrt();
    let column = 8.0 * (w.y.atan2(w.x) / TAU).rem_euclid(1.0);
    (row as usize).min(23) * 8 + (column as usize).min(7)
}

/// ∫ pdf dω over every bin, by 40 × 40 points each.
fn probabilities(brdf: &TableBrdf, frame: &Frame, wo: DVec3) -> Vec<f64> {
    const FINE: usize = 40;
    let mut bins = vec![0.0; 192];
    for row in 0..24 * FINE {
        let border = |k: usize| (k as f64 / (24 * FINE) as f64).powi(2) * PI;
        let theta = 0.5 * (border(row) + border(row + 1));
        let ring = cos_difference(border(row), border(row + 1)) * TAU / (8 * FINE) as f64;
        for column in 0..8 * FINE {
            let w = frame.to_world(direction(theta, TAU * (column as f64 + 0.5) / (8 * FINE) as f64));
            bins[row / FINE * 8 + column / FINE] += ring * brdf.pdf(w, wo);
        }
    }
    bins
}

#[test]
fn draws_follow_their_density_and_the_density_integrates_to_at_most_one() {
    const N: usize = 60_000;
    let tables = tables_to_draw_from();
    let angles = [0.0, 7.3, 31.0, 62.0, 86.0];
    let level = sidak(0.01, tables.len() * angles.len());
    for (name, brdf) in tables {
        for theta in angles {
            let wo = direction_deg(theta, 200.0);
            // About the sharper of the two directions.
            let frame = Frame::from_normal(if name.contains("retro") { wo } else { mirror(wo) });
            let mut rng = stream(21, Purpose::Study, theta.to_bits());
            let (mut counts, mut none) = (vec![0.0; 193], 0.0);
            for _ in 0..N {
                match brdf.sample(wo, rng.random()) {
                    Some(s) => {
                        assert!(s.wi.z > 0.0 && s.pdf > 0.0 && (s.wi.length() - 1.0).abs() < 1e-12);
                        assert_eq!(s.pdf, brdf.pdf(s.wi, wo));
                        counts[bin(&frame, s.wi)] += 1.0;
                    }
                    None => none += 1.0,
                }
            }
            let mut expected: Vec<f64> = probabilities(brdf, &frame, wo).iter().map(|p| p * N as f64).collect();
            let total: f64 = expected.iter().sum::<f64>() / N as f64;
            assert!(total < 1.001, "{name} θo {theta}: the density integrates to {total}");
            counts[192] = none;
            expected.push((1.0 - total).max(0.0) * N as f64);
            let (chi2, freedom, p) = chi_square_test(&counts, &expected);
            assert!(p > level, "{name} θo {theta}: χ² {chi2:.1} of {freedom}, p {p:e}, ∫pdf {total}");
        }
    }
}

/// Mean and relative variance of f·cosθi/pdf over `n` draws.
fn estimate(brdf: &TableBrdf, wo: DVec3, n: u32) -> (f64, f64) {
    let mut rng = stream(4, Purpose::Study, u64::from(n));
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..n {
        let weight =
            brdf.sample(wo, rng.random()).map_or(0.0, |s| grey(brdf, s.wi, wo).unwrap_or(0.0) * s.wi.z / s.pdf);
        sum += weight;
        squares += weight * weight;
    }
    let mean = sum / f64::from(n);
    (mean, squares / f64::from(n) / (mean * mean) - 1.0)
}

#[test]
fn the_weights_of_draws_average_to_the_directional_albedo_with_little_variance() {
    const N: u32 = 100_000;
    for (name, brdf) in tables_to_draw_from() {
        for theta in [0.0, 7.3, 31.0, 62.0, 80.0] {
            let wo = direction_deg(theta, 100.0);
            let albedo = brdf.directional_albedo(wo);
            if *name == "black scan" {
                assert_eq!(albedo.per_channel, [0.0]);
                continue;
            }
            let (mean, variance) = estimate(brdf, wo, N);
            println!(
                "{name:17} θo {theta:4}: albedo {:.5} vs {mean:.5}, relative variance {variance:.4}",
                albedo.per_channel[0]
            );
            // 5σ of the mean, and 3 parts in 1000 for the quadrature over the edges of the triangles.
            let bound = mean * (5.0 * (variance / f64::from(N)).sqrt() + 3e-3);
            assert!((albedo.per_channel[0] - mean).abs() < bound, "{name} θo {theta}: {albedo:?} vs {mean}");
            // A cosine draw of the near-mirror has a relative variance above 10³.
            assert!(variance < 0.25, "{name} θo {theta}: {variance}");
        }
    }
}

#[test]
fn the_albedo_matches_closed_forms() {
    let matte = table(&merl_of(|_| 0.25));
    for theta in [0.0, 20.0, 45.0, 70.0, 85.0] {
        let albedo = matte.directional_albedo(direction_deg(theta, 10.0));
        assert!(
            (albedo.per_channel[0] / (0.25 * PI) - 1.0).abs() < 1e-4 && (albedo.covered - 1.0).abs() < 1e-4,
            "{albedo:?}"
        );
    }
    // At normal incidence θd = θh = θi/2, and the integral is one-dimensional: once of the closed form, once of the table itself,
    // in pieces that end where the table's linear pieces do. The first differ by the table's interpolation error, which is
    // largest for the narrowest lobe (4 bins wide); the second by the quadrature alone.
    for m in [0.02, 0.1, 0.4] {
        let f = lobe(m, 0.0);
        let brdf = table(&merl_of(&f));
        let ring = |value: f64, theta: f64| value * theta.cos() * TAU * theta.sin();
        let over_pieces = |integrand: &dyn Fn(f64) -> f64| -> f64 {
            let border = |k: i32| 2.0 * MerlGrid::theta_h(0.5 * f64::from(k));
            (0..180)
                .map(|k| (border(k), border(k + 1).min(FRAC_PI_2)))
                .filter(|(a, b)| a < b)
                .map(|(a, b)| integrate(a, b, 8, integrand))
                .sum()
        };
        let closed = over_pieces(&|t| {
            let at = HalfDiff { theta_h: 0.5 * t, theta_d: 0.5 * t, phi_d: 0.0 };
            ring(f(at), t)
        });
        let own = over_pieces(&|t| ring(grey(&brdf, direction(t, 0.3), DVec3::Z).unwrap_or(0.0), t));
        let got = brdf.directional_albedo(DVec3::Z).per_channel[0];
        println!("m {m}: albedo {got}, of the table {own}, closed form {closed}");
        assert!((got / closed - 1.0).abs() < 0.02, "m {m}: {got} vs {closed}");
        assert!((got / own - 1.0).abs() < 1e-5, "m {m}: {got} vs {own}");
    }
}

#[test]
fn the_same_density_comes_from_any_number_of_threads() {
    let m = merl_of(lobe(0.1, 1.0));
    let build =
        |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool").install(|| table(&m));
    let (one, three) = (build(1), build(3));
    for (wi, wo) in pairs(2000) {
        assert_eq!(one.pdf(wi, wo).to_bits(), three.pdf(wi, wo).to_bits());
    }
}

#[test]
fn a_measured_retro_reflective_tape_can_be_rendered() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/measured/retro-gray-tape.alta.dat");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: {} is not there", path.display());
        return;
    };
    let rows = text.lines().filter(|l| !l.starts_with('#')).map(|l| {
        let x: Vec<f64> = l.split_whitespace().map(|t| t.parse().expect("a number")).collect();
        (direction(x[0], 0.0), direction(x[1].hypot(x[2]), x[2].atan2(x[1])), x[3])
    });
    let (mut wi, mut wo, mut values) = (vec![], vec![], vec![]);
    rows.for_each(|(i, o, v)| (wi.push(i), wo.push(o), values.push(v)).2);
    let m = Measurement::new("tape", Directions::List { wi, wo }, vec!["y".into()], values);
    let brdf = table(&m);
    println!("{:?}", brdf.notes());
    for i in (0..m.len()).step_by(7) {
        let (wi, wo) = m.directions.pair(i);
        if wo.z > 0.0 {
            // The two sides of the plane of incidence are averaged: they differ by noise.
            let got = grey(&brdf, wi, wo).expect("measured");
            assert!((got - m.values[i]).abs() < 0.5 * m.values[i] + 0.01, "{wi} {wo}: {got} vs {}", m.values[i]);
        }
    }
    for theta in [0.0, 15.0, 22.0, 40.0, 58.0] {
        let (mean, variance) = estimate(&brdf, direction_deg(theta, 0.0), 50_000);
        println!("tape θo {theta}: albedo {mean:.4}, relative variance {variance:.4}");
        assert!(variance < 0.25 && mean < 1.0);
    }
}
