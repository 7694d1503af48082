//! The listed directions, values and masks.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use goniofit::brdf::Brdf;
use goniofit::geometry::{half_vector, phi_of, theta_of};

use super::{CLOSED, brdf, fixture, read, real};

#[test]
fn listed_values_are_the_closed_form_at_the_listed_directions() {
    for closed in &CLOSED {
        let table = read(&fixture(closed.file));
        let (mut worst, mut compared) = (0.0f64, 0);
        for i in 0..table.len() {
            let (wi, wo) = table.directions.pair(i);
            assert!((wi.length() - 1.0).abs() < 1e-14 && (wo.length() - 1.0).abs() < 1e-14);
            for c in 0..table.channels.len() {
                assert_eq!(table.value(c, i).is_some(), wo.z > 0.0, "{}: entry {i}", closed.file);
                if let Some(value) = table.value(c, i) {
                    worst = worst.max((value / closed.eval(wi, wo, c) - 1.0).abs());
                    compared += 1;
                }
            }
        }
        println!("{}: {compared} values, largest relative deviation {worst:.1e}", closed.file);
        // The stored number was rounded to f32, 2⁻²⁴; what is read from the same f32 tables on both sides cancels.
        assert!(compared > 400 && worst < 1e-6, "{}: {worst:e}", closed.file);
    }
}

#[test]
fn the_evaluator_returns_the_listed_value_at_the_listed_directions() {
    let files = CLOSED.iter().map(|c| fixture(c.file)).chain(real("the_evaluator_returns").into_iter().map(|p| p.0));
    for file in files {
        let table = read(&file);
        let evaluator = table.evaluator.as_ref().expect("evaluator");
        let isotropic = brdf(&file).is_isotropic();
        let mut out = vec![0.0; table.channels.len()];
        let (mut worst, mut compared) = (0.0f64, 0);
        for i in (0..table.len()).filter(|&i| table.value(0, i).is_some()) {
            let (wi, wo) = table.directions.pair(i);
            // The half vector's angles lose their digits at the horizon, its azimuth at the mirror direction.
            let m = half_vector(wi, wo).map_or(0.0, theta_of);
            if wi.z < 1e-3 || wo.z < 1e-3 || m < 1e-8 {
                continue;
            }
            assert!(evaluator.eval(wi, wo, &mut out));
            let listed: Vec<f64> = (0..out.len()).filter_map(|c| table.value(c, i)).collect();
            let scale = listed.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let off = out.iter().zip(&listed).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // In an anisotropic file every azimuth has its slice for the one direction of incidence 0, and the ends of the range of
            // azimuths are the same incidence up to symmetry, tabulated twice.
            if isotropic || theta_of(wi) > 0.0 && wi.y.abs() > 1e-6 {
                worst = worst.max(off / scale);
                compared += 1;
            }
        }
        println!("{}: {compared} entries, largest relative deviation {worst:.1e}", file.display());
        assert!(compared > 50 && worst < 1e-6, "{}: {worst:e}", file.display());
    }
}

#[test]
fn at_normal_incidence_the_listed_directions_are_sane() {
    let files: Vec<_> =
        real("at_normal_incidence").into_iter().map(|p| p.0).chain([fixture("rgl-tiny.bsdf")]).collect();
    for file in files {
        let (table, brdf) = (read(&file), brdf(&file));
        let per_incidence = table.len() / brdf.incidences().len();
        let (mut azimuths, mut out) = (Vec::new(), [[0.0; 3]; 2]);
        for i in 0..per_incidence {
            let (wi, wo) = table.directions.pair(i);
            assert_eq!(wi, DVec3::Z);
            assert!(wo.is_finite());
            azimuths.push(phi_of(wo));
            // Turning an exactly normal incidence about itself changes nothing.
            brdf.eval(DVec3::new(0.0, 0.0, 1.0), wo, &mut out[0]);
            brdf.eval(DVec3::new(-0.0, -0.0, 1.0), wo, &mut out[1]);
            assert_eq!(out[0].map(f64::to_bits), out[1].map(f64::to_bits));
        }
        // All round, not one heap.
        let quadrant = |q: i32| azimuths.iter().filter(|&&a| ((a + PI) / FRAC_PI_2) as i32 == q).count();
        assert!((0..4).all(|q| quadrant(q) > per_incidence / 8), "{}", file.display());
    }
}

/// (file, masked entries by incidence, and over incidences below 90° per channel: smallest and largest BRDF, negative values),
/// counted by a script in numpy that shares no code with this one.
type Counted = (&'static str, [usize; 8], [(f64, f64, usize); 3]);

const COUNTED: [Counted; 5] = [
    (
        "aurora_white",
        [160, 154, 136, 114, 98, 80, 60, 94],
        [(0.05257, 333.85686, 0), (0.05299, 289.36348, 0), (0.05856, 253.27633, 0)],
    ),
    (
        "cc_ibiza_sunset",
        [64, 62, 60, 58, 56, 56, 60, 64],
        [(8e-6, 212.77537, 0), (1e-6, 204.08794, 0), (-0.002917, 196.35105, 502)],
    ),
    (
        "chm_mint",
        [32, 32, 32, 32, 32, 32, 32, 64],
        [(-143.458208, 3080.4905, 4992), (0.016212, 3951.77841, 0), (0.024102, 3844.88012, 0)],
    ),
    (
        "irid_flake_paint1",
        [64, 54, 66, 76, 70, 56, 48, 94],
        [(-0.002527, 3472.49385, 280), (-0.000393, 3340.17324, 58), (-0.000416, 3342.3847, 30)],
    ),
    (
        "vch_silk_blue",
        [32, 32, 32, 34, 40, 48, 62, 66],
        [(-0.686364, 112.70279, 1720), (1.6e-5, 105.72518, 0), (0.01354, 100.66905, 0)],
    ),
];

#[test]
fn real_files_hold_what_an_independent_script_counts() {
    for ((file, _), (name, masked, ranges)) in real("real_files_hold").iter().zip(COUNTED) {
        let table = read(file);
        assert_eq!(table.name, format!("{name}_rgb"));
        assert_eq!((table.len(), table.channels.as_slice()), (8192, ["r", "g", "b"].map(String::from).as_slice()));
        let counted = |k: usize| (k * 1024..(k + 1) * 1024).filter(|&i| table.value(0, i).is_none()).count();
        assert_eq!((0..8).map(counted).collect::<Vec<_>>(), masked, "{name}");
        assert_eq!((table.masked.marked, table.masked.not_finite), (3 * masked.iter().sum::<usize>() as u64, 0));
        for (c, (low, high, negative)) in ranges.into_iter().enumerate() {
            let values: Vec<f64> = (0..7 * 1024).filter_map(|i| table.value(c, i)).collect();
            let found = values.iter().fold((f64::MAX, f64::MIN), |(a, b), &v| (a.min(v), b.max(v)));
            // Half a unit of the last place that the script printed.
            assert!((found.0 - low).abs() < 5.1e-7 && (found.1 - high).abs() < 5.1e-6, "{name} {c}: {found:?}");
            assert_eq!(values.iter().filter(|v| **v < 0.0).count(), negative, "{name} {c}");
        }
        let swapped = table.notes.iter().any(|n| n.contains("marks with 1"));
        assert_eq!(swapped, name == "vch_silk_blue", "{:?}", table.notes);
    }
}
