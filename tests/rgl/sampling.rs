//! Samples against their density.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use goniofit::brdf::Brdf;
use goniofit::geometry::angles::direction_deg;
use goniofit::geometry::{direction, half_vector, phi_of, theta_of};
use goniofit::measurement::formats::rgl::RglBrdf;
use goniofit::numeric::random::{Purpose, RngExt, stream};
use goniofit::numeric::stats::{chi_square_test, sidak};

use super::{CLOSED, brdf, fixture, real};

const BINS: (usize, usize) = (16, 24);
/// Midpoints each way in a bin.
const FINE: usize = 32;
const DRAWS: usize = 200_000;

/// Draws binned by their half vector in (√θm, φm) against ∫ pdf over the bins, with a bin of its own for draws below the horizon.
fn chi_square_of_samples(brdf: &RglBrdf, wo: DVec3) -> f64 {
    let (columns, rows) = BINS;
    let mut expected = vec![0.0; columns * rows + 1];
    let cell = 1.0 / (columns * rows * FINE * FINE) as f64;
    for k in 0..columns * rows * FINE * FINE {
        let (row, column) = (k / (columns * FINE), k % (columns * FINE));
        let u = (column as f64 + 0.5) / (columns * FINE) as f64;
        let (theta, phi) = (FRAC_PI_2 * u * u, (row as f64 + 0.5) / (rows * FINE) as f64 * TAU);
        let m = direction(theta, phi);
        let wi = 2.0 * wo.dot(m) * m - wo;
        // dωi = 4 (wo·m) dωm
        let solid_angle = 4.0 * wo.dot(m).max(0.0) * theta.sin() * PI * u * TAU * cell;
        expected[row / FINE * columns + column / FINE] += brdf.pdf(wi, wo) * solid_angle * DRAWS as f64;
    }
    let inside: f64 = expected.iter().sum();
    // At most 1, up to the midpoint rule: 1e-3 is 200 of 200 000 draws, half of their own noise.
    assert!(inside <= DRAWS as f64 * 1.001, "∫ pdf = {}", inside / DRAWS as f64);
    expected[columns * rows] = (DRAWS as f64 - inside).max(0.0);
    let mut observed = vec![0.0; columns * rows + 1];
    let mut rng = stream(5, Purpose::Study, 0);
    for _ in 0..DRAWS {
        let bin = brdf.sample(wo, rng.random()).map_or(columns * rows, |s| {
            assert!(s.pdf > 0.0 && (s.pdf / brdf.pdf(s.wi, wo) - 1.0).abs() < 1e-12);
            let m = half_vector(s.wi, wo).expect("above the horizon");
            let column = ((theta_of(m) / FRAC_PI_2).sqrt() * columns as f64) as usize;
            let row = (phi_of(m).rem_euclid(TAU) / TAU * rows as f64) as usize;
            row.min(rows - 1) * columns + column.min(columns - 1)
        });
        observed[bin] += 1.0;
    }
    chi_square_test(&observed, &expected).2
}

#[test]
fn samples_follow_the_density() {
    let mut files: Vec<_> = real("samples_follow_the_density").into_iter().map(|p| p.0).collect();
    files.extend(CLOSED.iter().map(|c| fixture(c.file)));
    let incidences = [(0.0, 0.0), (25.0, 40.0), (50.0, 200.0), (70.0, 310.0)];
    let level = sidak(1e-2, files.len() * incidences.len());
    for file in &files {
        let brdf = brdf(file);
        for (theta, phi) in incidences {
            let p = chi_square_of_samples(&brdf, direction_deg(theta, phi));
            assert!(p > level, "{}, wo at {theta}°, {phi}°: p = {p:e} below {level:e}", file.display());
        }
    }
}
