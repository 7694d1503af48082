//! A measured table as a BRDF: exact where it was measured, symmetric, honest about what was not measured.
#![allow(clippy::float_cmp)] // exact zeros and copies are meant

mod table_support;

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use goniofit::brdf::check::reciprocity_error;
use goniofit::brdf::{Brdf, Sample};
use goniofit::geometry::angles::direction_deg;
use goniofit::geometry::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};
use goniofit::geometry::{HalfDiff, direction, mirror};
use goniofit::measurement::{Dimension, Directions, MerlAngles, MerlGrid, TableBrdf};
use goniofit::numeric::random::{Purpose, RngExt, stream};
use table_support::{TENS, grey, half_diff, list, lobe, merl_of, merl_of_bins, pairs, scan, table};

// ---- the MERL grid ------------------------------------------------------------------------------------------------------

/// Multilinear in the bins, with φd's dependence continuous across its wrap.
fn multilinear(i: f64, j: f64, k: f64) -> f64 {
    2.0 + i / 30.0 + j / 90.0 + i * j / 8100.0 + 0.5 * (k - 90.0).abs() / 90.0
}

#[test]
fn a_function_linear_in_the_bins_comes_back_everywhere_between_their_centres_or_edges() {
    for (angles, shift) in [(MerlAngles::Center, 0.5), (MerlAngles::Edge, 0.0)] {
        let brdf = table(&merl_of_bins(angles, &[&multilinear]));
        for (wi, wo) in pairs(20_000) {
            let a = HalfDiff::from_pair(wi, wo).expect("half");
            let hold = |x: f64| (x - shift).clamp(0.0, 89.0);
            let (i, j) = (hold((a.theta_h / FRAC_PI_2).sqrt() * 90.0), hold(a.theta_d.to_degrees()));
            let want = multilinear(i, j, (a.phi_d.to_degrees() - shift).rem_euclid(180.0));
            let got = grey(&brdf, wi, wo).expect("measured");
            // The values are rounded to f32: 2⁻²⁴.
            assert!((got / want - 1.0).abs() < 1.01 * 2f64.powi(-24), "{angles:?} {a:?}: {got} vs {want}");
        }
    }
}

#[test]
fn entries_come_back_at_their_own_places() {
    let f = lobe(0.05, 2.0);
    let brdf = table(&merl_of(&f));
    let grid = MerlGrid::default();
    let mut checked = 0;
    for index in (0..MerlGrid::LEN).step_by(1013) {
        let (wi, wo) = grid.pair(index);
        let Some(got) = grey(&brdf, wi, wo) else { continue };
        let want = f(grid.half_diff(index));
        assert!((got / want - 1.0).abs() < 1e-7, "entry {index}: {got} vs {want}");
        checked += 1;
    }
    assert!(checked > 500, "{checked}");
}

#[test]
fn between_entries_the_error_is_that_of_linear_interpolation() {
    let f = lobe(0.05, 2.0);
    let brdf = table(&merl_of(&f));
    let at = |p: [f64; 3]| f(half_diff(p[0], p[1], p[2]));
    let mut worst = 0.0f64;
    for (wi, wo) in pairs(20_000) {
        let a = HalfDiff::from_pair(wi, wo).expect("half");
        let p = [(a.theta_h / FRAC_PI_2).sqrt() * 90.0, a.theta_d.to_degrees(), a.phi_d.to_degrees()];
        if p[0] < 2.0 || p[0] > 87.0 || p[1] < 2.0 || p[1] > 87.0 {
            continue;
        }
        // |error| ≤ ⅛ Σ max |f''| over the cell, in bins; the maximum over ±1 bin, with half as much again for f''''.
        let bound: f64 = (0..2)
            .map(|axis| {
                let second = |shift: f64| {
                    let step = |s: f64| std::array::from_fn(|k| if k == axis { p[k] + s } else { p[k] });
                    (at(step(shift + 1.0)) - 2.0 * at(step(shift)) + at(step(shift - 1.0))).abs()
                };
                [-1.0, -0.5, 0.0, 0.5, 1.0].map(second).into_iter().fold(0.0, f64::max) * 1.5 / 8.0
            })
            .sum();
        let (got, want) = (grey(&brdf, wi, wo).expect("measured"), at(p));
        assert!((got - want).abs() <= bound + 1e-7 * want, "{p:?}: {got} vs {want}, bound {bound:e}");
        worst = worst.max((got / want - 1.0).abs());
    }
    println!("largest relative error between entries: {worst:.4}");
}

#[test]
fn a_merl_table_is_reciprocal_and_does_not_depend_on_a_common_rotation() {
    let f = |a: HalfDiff| lobe(0.05, 2.0)(a) * (1.5 + (2.0 * a.phi_d).cos());
    let brdf = table(&merl_of(f));
    for (wi, wo) in pairs(5000) {
        assert!(reciprocity_error(&brdf, wi, wo) < 1e-9, "{wi} {wo}");
        let turn = glam::DMat3::from_rotation_z(1.234);
        let (a, b) = (grey(&brdf, wi, wo).expect("known"), grey(&brdf, turn * wi, turn * wo).expect("known"));
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn masked_entries_are_left_out_and_what_only_they_reach_is_unmeasured() {
    let mut rng = stream(8, Purpose::Study, 0);
    let mut m = merl_of_bins(MerlAngles::Center, &[&|_, _, _| 0.25, &|_, _, _| 0.5]);
    for index in 0..MerlGrid::LEN {
        let hole = MerlGrid::bins(index).0 >= 60;
        if hole || rng.random::<f64>() < 0.3 {
            m.values[MerlGrid::LEN + index] = f64::NAN; // the second channel alone
        }
    }
    let first = TableBrdf::new(&m, &[0]).expect("table");
    let both = table(&m);
    let (mut known, mut hole) = (0, 0);
    for (wi, wo) in pairs(20_000) {
        let alone = grey(&first, wi, wo).expect("a mask in one channel leaves the other alone");
        assert!((alone - 0.25).abs() < 1e-15, "{alone}");
        let mut out = [f64::NAN; 2];
        let h = (HalfDiff::from_pair(wi, wo).expect("half").theta_h / FRAC_PI_2).sqrt() * 90.0 - 0.5;
        if both.eval(wi, wo, &mut out) {
            assert!(h < 60.0 && (out[0] - 0.25).abs() < 1e-15 && (out[1] - 0.5).abs() < 1e-15, "{out:?} at {h}");
            known += 1;
        } else {
            assert_eq!(out, [0.0; 2]);
            hole += usize::from(h >= 60.0);
        }
    }
    assert!(known > 5000 && hole > 1000, "{known} {hole}");
    for below in [DVec3::new(0.6, 0.0, -0.8), DVec3::X] {
        assert_eq!(grey(&first, below, DVec3::Z), None);
        assert_eq!(grey(&first, DVec3::Z, below), None);
    }
}

// ---- lists --------------------------------------------------------------------------------------------------------------

#[test]
fn a_scan_gives_its_samples_back() {
    let f = |i: DVec3, o: DVec3| 0.1 + (-(o - mirror(i)).length_squared() / 0.02).exp();
    let m = scan(&TENS, f);
    let brdf = table(&m);
    for i in 0..m.len() {
        let (wi, wo) = m.directions.pair(i);
        let (got, want) = (grey(&brdf, wi, wo).expect("measured"), f(wi, wo));
        // Triangle membership is decided to 1e-9 of a barycentric coordinate.
        assert!((got - want).abs() < 1e-8, "{wi} {wo}: {got} vs {want}");
    }
}

#[test]
fn a_function_linear_in_the_offset_comes_back_at_every_incidence() {
    let linear = |along: f64, across: f64| {
        move |i: DVec3, o: DVec3| {
            let azimuth = i.truncate().normalize_or(DVec2::X);
            let x = o.truncate().dot(azimuth) + i.truncate().length();
            2.0 + along * x + across * o.truncate().perp_dot(azimuth).abs()
        }
    };
    // From 12° on, the gap across the normal is bridged by isotropy; there the function must not lean to one side.
    let cases = [(&TENS[..], linear(0.7, 0.4), 10.0), (&[12.0, 24.0, 50.0, 76.0], linear(0.0, 0.4), 24.0)];
    for (incidences, f, widest_deg) in cases {
        // The hull of the 85° ring, measured every 10°, reaches to r = sin 85° cos 5°. Midway between two incidences each of
        // the two is shifted by half the difference of their sines: to the sides, r² − shift² is left.
        let (r, shift) =
            (85f64.to_radians().sin() * 5f64.to_radians().cos(), (0.5 * f64::to_radians(widest_deg)).sin());
        let covered = (r * r - shift * shift).sqrt();
        let brdf = table(&scan(incidences, f));
        let mut known = 0;
        for (wi, wo) in pairs(20_000) {
            let (theta_i, theta_o) = (wi.z.acos().to_degrees(), wo.z.acos().to_degrees());
            let got = grey(&brdf, wi, wo);
            if theta_i < 76.0 && theta_o.to_radians().sin() < covered {
                let (got, want) = (got.expect("covered"), f(wi, wo));
                assert!((got - want).abs() < 1e-8, "θi {theta_i} θo {theta_o}: {got} vs {want}");
                known += 1;
            } else if theta_i > 85.1 && theta_o > 80.1 {
                assert_eq!(got, None, "θi {theta_i} θo {theta_o}");
            }
        }
        assert!(known > 15_000, "{known}");
    }
}

#[test]
fn lists_are_read_as_isotropic_symmetric_and_where_they_end_reciprocal() {
    let f = |i: DVec3, o: DVec3| 0.1 + (-(o - mirror(i)).length_squared() / 0.1).exp();
    let brdf = table(&scan(&TENS[..6], f)); // 0 to 50°
    let mut exchanged = 0;
    for (wi, wo) in pairs(5000) {
        let value = grey(&brdf, wi, wo);
        let turn = |w: DVec3| glam::DMat3::from_rotation_z(-2.1) * w;
        let flip = |w: DVec3| DVec3::new(w.x, -w.y, w.z);
        for other in [grey(&brdf, turn(wi), turn(wo)), grey(&brdf, flip(wi), flip(wo))] {
            match (value, other) {
                (Some(a), Some(b)) => assert!((a - b).abs() < 1e-9, "{a} {b}"),
                (a, b) => assert_eq!(a, b),
            }
        }
        let (theta_i, theta_o) = (wi.z.acos().to_degrees(), wo.z.acos().to_degrees());
        if theta_i > 50.1 && theta_o < 50.0 {
            assert_eq!(value, grey(&brdf, wo, wi));
            exchanged += usize::from(value.is_some());
        }
        if theta_i > 50.1 && theta_o > 50.1 {
            assert_eq!(value, None);
        }
    }
    assert!(exchanged > 500, "{exchanged}");
}

#[test]
fn a_retro_reflector_keeps_its_peak_between_incidences() {
    let f = |i: DVec3, o: DVec3| 0.05 + (-(o - i).truncate().length_squared() / 0.03).exp();
    let brdf = table(&scan(&[15.0, 30.0, 45.0, 60.0], f));
    assert!(brdf.notes().iter().any(|n| n.contains("retro")), "{:?}", brdf.notes());
    for theta in [15.0, 22.5, 30.0, 37.5, 52.0, 60.0] {
        let w = direction_deg(theta, 40.0);
        let got = grey(&brdf, w, w).expect("covered");
        // Half a grid step (2.5°) off the peak the lobe has fallen by at most 1 − exp(−0.0436²/0.03) = 0.0615.
        assert!((got - 1.05).abs() < 0.0615, "θ {theta}: {got}");
    }
    let gloss = table(&scan(&TENS, |i, o| 0.05 + (-(o - mirror(i)).truncate().length_squared() / 0.03).exp()));
    assert!(gloss.notes().iter().all(|n| !n.contains("retro")), "{:?}", gloss.notes());
    assert!(grey(&gloss, direction_deg(35.0, 0.0), direction_deg(35.0, 180.0)).expect("covered") > 1.05 - 0.0615);
}

#[test]
fn a_scan_over_the_light_is_read_with_the_directions_exchanged() {
    let f = |i: DVec3, o: DVec3| 0.1 + (-(o - mirror(i)).length_squared() / 0.1).exp();
    let Directions::List { wi, wo } = scan(&TENS, f).directions else { panic!("a list") };
    let wi_jittered: Vec<DVec3> =
        wo.iter().enumerate().map(|(k, w)| direction(w.z.acos() + 2e-5 * k as f64, w.y.atan2(w.x))).collect();
    let m = list(wi_jittered, wi, f);
    let brdf = table(&m);
    assert!(brdf.notes().iter().any(|n| n.contains("exchanged")), "{:?}", brdf.notes());
    let (i, o) = m.directions.pair(100);
    assert!((grey(&brdf, i, o).expect("measured") - f(i, o)).abs() < 1e-8);
}

#[test]
fn tables_that_say_too_little_are_refused_with_the_reason() {
    let one = |_: DVec3, _: DVec3| 1.0;
    let in_plane = |phi: f64| {
        let thetas = || (0..18).map(|k| 5.0 * f64::from(k) - 42.0);
        let wi = TENS.iter().flat_map(|&t| thetas().map(move |_| direction_deg(t, 0.0))).collect();
        let wo = TENS.iter().flat_map(|_| thetas().map(move |t| direction_deg(t, phi))).collect();
        list(wi, wo, one)
    };
    let line: Vec<DVec3> = (0..90).map(|t| direction_deg(f64::from(t), 0.0)).collect();
    let (wi, wo): (Vec<_>, Vec<_>) = pairs(3000).unzip();
    let turned = |i: DVec3| glam::DMat3::from_rotation_z(FRAC_PI_2) * i;
    let Directions::List { wi: li, wo: lo } = scan(&TENS[1..], one).directions else { panic!("a list") };
    let both_azimuths: Vec<DVec3> = li.iter().copied().chain(li.iter().map(|&w| turned(w))).collect();
    let twice: Vec<DVec3> = lo.iter().copied().chain(lo.iter().map(|&w| turned(w))).collect();
    let brushed = list(both_azimuths, twice, |i, _| if i.y.abs() > i.x.abs() { 1.0 } else { 5.0 });
    let mut flat = scan(&TENS, one);
    flat.dimension = Dimension::Flat;
    let cases = [
        ("in-plane scan", in_plane(0.0), "in-plane"),
        ("line of wi = wo", list(line.clone(), line, one), "wi = wo"),
        ("flat world", flat, "flat-world"),
        ("one incidence", scan(&[30.0], one), "at least 2"),
        ("nothing repeats", list(wi, wo, one), "no incidence repeats"),
        ("all masked", scan(&TENS, |_, _| f64::NAN), "no sample is valid"),
        ("no sample", list(vec![], vec![], one), "no sample is valid"),
        ("brushed metal", brushed, "not isotropic"),
    ];
    for (name, m, reason) in cases {
        let error = TableBrdf::new(&m, &[0]).expect_err(name).to_string();
        assert!(error.contains(reason) && error.starts_with(&m.name), "{name}: {error}");
    }
    let m = scan(&TENS, one);
    assert!(TableBrdf::new(&m, &[]).expect_err("none").to_string().contains("no channel"));
    assert!(TableBrdf::new(&m, &[1]).expect_err("one").to_string().contains("channel 1"));
}

// ---- a format's own evaluation ------------------------------------------------------------------------------------------

/// Five channels: channel c is c + wi.z.
struct Own;

impl Brdf for Own {
    fn channels(&self) -> usize {
        5
    }
    fn eval(&self, wi: DVec3, _: DVec3, out: &mut [f64]) -> bool {
        out.iter_mut().enumerate().for_each(|(c, v)| *v = c as f64 + wi.z);
        wi.x < 0.9
    }
    fn sample(&self, _: DVec3, u: [f64; 3]) -> Option<Sample> {
        let wi = cosine_hemisphere(DVec2::new(u[0], u[1]));
        Some(Sample { wi, pdf: cosine_hemisphere_pdf(wi) })
    }
    fn pdf(&self, wi: DVec3, _: DVec3) -> f64 {
        cosine_hemisphere_pdf(wi)
    }
}

#[test]
fn a_format_s_own_evaluation_is_used_channel_by_channel() {
    let mut m = scan(&TENS, |_, _| 0.0);
    m.channels = (0..5).map(|c| format!("{c}")).collect();
    m.values = vec![0.0; 5 * m.len()];
    m.evaluator = Some(Arc::new(Own));
    let brdf = TableBrdf::new(&m, &[4, 0, 2]).expect("table");
    let (wi, mut out) = (DVec3::new(0.6, 0.0, 0.8), [0.0; 3]);
    assert!(brdf.eval(wi, DVec3::Z, &mut out));
    assert_eq!(out, [4.8, 0.8, 2.8]);
    assert!(!brdf.eval(DVec3::new(0.96, 0.0, 0.28), DVec3::Z, &mut out) && out == [0.0; 3]);
    assert_eq!(brdf.pdf(wi, DVec3::Z), cosine_hemisphere_pdf(wi));
    assert_eq!(brdf.sample(DVec3::Z, [0.1, 0.2, 0.3]), Own.sample(DVec3::Z, [0.1, 0.2, 0.3]));
    assert!(TableBrdf::new(&m, &[5]).is_err());
}
