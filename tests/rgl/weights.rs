//! What the listed weights add up to.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};

use glam::DVec3;
use goniofit::brdf::Brdf;
use goniofit::geometry::direction;
use goniofit::geometry::grid::polar_cells;
use goniofit::measurement::Measurement;
use goniofit::measurement::formats::rgl;
use goniofit::numeric::quadrature::integrate_directions;

use super::{brdf, bytes, fixture, read, real};

fn files(test: &str) -> Vec<PathBuf> {
    real(test).into_iter().map(|p| p.0).chain([fixture("rgl-tiny.bsdf")]).collect()
}

/// For each incidence: θi, and (value of channel 1, cosθo, solid angle of wo in sr) of each entry, `None` where masked.
type Row = (f64, Vec<(Option<f64>, f64, f64)>);

fn by_incidence(table: &Measurement, theta_i: &[f64]) -> Vec<Row> {
    let n = table.len() / theta_i.len();
    let cells = polar_cells(theta_i);
    let entry =
        |i: usize, cell: f64| (table.value(1, i), table.directions.pair(i).1.z, table.weights.get(i) / (TAU * cell));
    let row = |t: usize| (t * n..(t + 1) * n).map(|i| entry(i, cells[t])).collect();
    theta_i.iter().enumerate().map(|(t, &theta)| (theta, row(t))).collect()
}

#[test]
fn solid_angles_add_up_to_the_hemisphere() {
    for file in files("solid_angles_add_up") {
        let (table, brdf) = (read(&file), brdf(&file));
        for (theta, row) in by_incidence(&table, brdf.incidences()) {
            let sum: f64 = row.iter().map(|e| e.2).sum::<f64>() / TAU;
            // At normal incidence the horizon is a circle u(m) = const: the rule is right to half of one of the 8 pieces of
            // a cell there, dω/du · du / 16 / 2π with dω/du = 4 cos 45° · 2π² √½ sin 45°. Elsewhere it crosses cells.
            let cells = if file.ends_with("rgl-tiny.bsdf") { 31.0 } else { 127.0 };
            let bound = 4.0 * PI * PI * 0.5f64.sqrt() / cells / 16.0 / TAU;
            assert!((sum - 1.0).abs() < bound, "{}, {:.1}°: {sum} of 2π sr", file.display(), theta.to_degrees());
        }
    }
}

/// The file with 1 for every value above the horizon, 0 for every masked one, and no factor: its evaluator times cosθo is the
/// share of a direction that belongs to measured entries.
fn mask_file(path: &Path, table: &Measurement) -> Vec<u8> {
    let mut data = bytes(path);
    let offset = |name: &[u8], data: &[u8]| {
        let at = data.windows(name.len()).position(|w| w == name).expect("field") + name.len() + 3;
        u64::from_le_bytes(data[at..at + 8].try_into().expect("8 bytes")) as usize
    };
    let (values, jacobian) = (offset(b"rgb", &data), offset(b"jacobian", &data));
    let plane = table.len() / brdf(path).incidences().len();
    for i in 0..table.len() {
        for c in 0..3 {
            let at = values + 4 * ((i / plane * 3 + c) * plane + i % plane);
            let measured = if table.value(c, i).is_some() { 1.0f32 } else { 0.0 };
            data[at..at + 4].copy_from_slice(&measured.to_le_bytes());
        }
    }
    data[jacobian] = 0;
    data
}

#[test]
fn measured_entries_stand_for_the_measured_part_of_the_hemisphere() {
    for file in files("measured_entries_stand_for") {
        let table = read(&file);
        let share = rgl::read_brdf(&file, &mask_file(&file, &table)).expect("valid");
        for (theta, row) in by_incidence(&table, share.incidences()) {
            if theta.to_degrees() > 85.0 {
                continue; // reflections at the horizon
            }
            let listed: f64 = row.iter().filter(|e| e.0.is_some()).map(|e| e.2).sum();
            let (wi, mut out) = (direction(theta, 0.0), [0.0; 3]);
            let mut measured = |wo: DVec3| {
                share.eval(wi, wo, &mut out);
                out[0] * wo.z
            };
            let integral = integrate_directions((0.0, FRAC_PI_2), (0.0, TAU), 160, &mut measured);
            println!(
                "{}, {:.1}°: {:.4} of the hemisphere, by quadrature {:.4}",
                table.name,
                theta.to_degrees(),
                listed / TAU,
                integral / TAU
            );
            assert!((listed - integral).abs() < 5e-3 * TAU, "{}: {listed} vs {integral}", table.name);
        }
    }
}

/// ∫ f cosθo dωo of channel 1 by midpoints over u(m), where a sharp lobe is as wide as a broad one.
fn albedo(brdf: &rgl::RglBrdf, wi: DVec3) -> f64 {
    let (fine, round, mut out) = (800u32, 240u32, [0.0; 3]);
    let mut sum = 0.0;
    for k in 0..fine * round {
        let u = (f64::from(k / round) + 0.5) / f64::from(fine);
        let theta = FRAC_PI_2 * u * u;
        let m = direction(theta, (f64::from(k % round) + 0.5) / f64::from(round) * TAU);
        let wo = 2.0 * wi.dot(m) * m - wi;
        if wo.z > 0.0 && wi.dot(m) > 0.0 {
            brdf.eval(wi, wo, &mut out);
            sum += out[1] * wo.z * 4.0 * wi.dot(m) * theta.sin() * PI * u;
        }
    }
    sum * TAU / f64::from(fine) / f64::from(round)
}

#[test]
fn weighted_values_add_up_to_the_directional_albedo() {
    for file in files("weighted_values_add_up") {
        let (table, brdf) = (read(&file), brdf(&file));
        for (theta, row) in by_incidence(&table, brdf.incidences()) {
            if theta.to_degrees() > 85.0 {
                continue;
            }
            let sum: f64 = row.iter().filter_map(|(value, cos, w)| Some((*value)? * cos * w)).sum();
            let integral = albedo(&brdf, direction(theta, 0.0));
            let off = sum / integral - 1.0;
            println!(
                "{}, {:.1}°: Σ {sum:.5}, albedo {integral:.5}, {:+.2} %",
                table.name,
                theta.to_degrees(),
                100.0 * off
            );
            // A rule of 32 × 32 points whose weight changes by decades from node to node. Measured up to 72°: within 1.0 % in three
            // real files, 4.0 % in irid_flake_paint1, 5.2 % in chm_mint, the sharpest; at 79° to 82° the sum is 2 to 33 % too large.
            let bound = match theta.to_degrees() {
                t if t < 65.0 => 0.04,
                t if t < 75.0 => 0.06,
                _ => 0.35,
            };
            assert!(off.abs() < bound, "{}, {:.1}°: {sum} vs {integral}", table.name, theta.to_degrees());
        }
    }
}
