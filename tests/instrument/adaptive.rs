//! Adaptive scans: readings where the signal bends, none drawn by noise, the clock of the whole run.

use glam::DVec3;
use goniofit::brdf::{LobeKind, Material};
use goniofit::chain::{Source, measure, measure_raw};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, WeightMode, fit};
use goniofit::gonio::parts::{Axes, Detector, Reference};
use goniofit::gonio::{Adaptive, Instrument, Kind, Look, Scan, adapt, hours, lit_rows, simulate};
use goniofit::measurement::{Dimension, Measurement};

use crate::bends::{Found, MATERIALS, again, curve, hours_of, material, measured, study, uniform_in};
use crate::support::lab;

const SCAN: Scan = Scan::Adaptive { pairs: 500 };

fn incidences() -> impl Iterator<Item = f64> {
    (0..6).map(|k| 15.0 * f64::from(k))
}

/// Widths of the gaps between readings, incidence by incidence, and whether both sides are valid.
fn gaps(table: &Measurement) -> Vec<(f64, bool)> {
    let of = |theta: f64| {
        let list = curve(table, theta);
        list.windows(2).map(|w| (w[1].0 - w[0].0, w[0].1.is_finite() && w[1].1.is_finite())).collect::<Vec<_>>()
    };
    incidences().flat_map(of).collect()
}

/// Readings and hours being equal, sharp lobes are told better and blunt ones as well.
#[test]
fn an_adaptive_scan_pays_where_the_signal_bends_and_costs_nothing_where_it_does_not() {
    let (instrument, seeds) = (Instrument::default(), 40);
    // An rms over 40 seeds is known to 11 %, a ratio of two to 16 %: twice that is chance.
    for ((name, n), [curve_most, exponent_most]) in
        MATERIALS.into_iter().zip([[1.1, 1.0], [1.1, 1.3], [0.1, 0.6], [0.05, 0.5]])
    {
        let by_bends = study(n, &instrument, &SCAN, seeds);
        let even = study(n, &instrument, &uniform_in(by_bends.hours, &instrument), seeds);
        let ratio = |of: fn(&Found) -> f64| of(&by_bends) / of(&even);
        let ratios = [ratio(|f| f.interpolation), ratio(|f| f.exponent), ratio(|f| f.unweighted)];
        println!(
            "{name}: {} pairs, {} of the uniform scan; curve, exponent by σ and exponent without are off by {ratios:?} of it",
            by_bends.pairs, even.pairs
        );
        assert!(by_bends.pairs == 500 && even.pairs > 480 && by_bends.open + even.open == 0);
        assert!(ratios[0] <= curve_most, "{name}: {}", ratios[0]);
        assert!(n == 0.0 || ratios[1..].iter().all(|r| *r <= exponent_most), "{name}: {ratios:?}");
    }
}

/// A matte curve stays as even as halved gaps can be: 5° twice halved at most, whatever noise, drift and jitter do.
#[test]
fn noise_alone_draws_no_readings_to_itself() {
    let unsteady = Instrument { axes: Axes { jitter_deg: 0.05, ..lab().axes }, ..lab() };
    let faint = Instrument { electrons: 1e3, ..Instrument::default() };
    for (name, instrument) in [("noisy detector", Instrument::default()), ("all parts", unsteady), ("faint", faint)] {
        let found: Vec<(f64, f64, usize)> = (0..12)
            .map(|seed| {
                let table = measured(&material(0.0), &instrument, &SCAN, seed);
                let widths: Vec<f64> = gaps(&table).iter().filter(|g| g.1).map(|g| g.0).collect();
                let most = widths.iter().copied().fold(0.0, f64::max);
                let fine = widths.iter().filter(|w| **w < 1.2).count();
                let counts: Vec<usize> = incidences().map(|theta| curve(&table, theta).len()).collect();
                let spread = counts.iter().max().expect("some") - counts.iter().min().expect("some");
                (most, fine as f64, spread)
            })
            .collect();
        println!("{name}: {found:?}");
        for (most, fine, spread) in &found {
            assert!(*most < 2.6 && *fine <= 2.0 && *spread < 15, "{name}: {most} {fine} {spread}");
        }
        let all: f64 = found.iter().map(|f| f.1).sum();
        assert!(all <= 4.0, "{name}: {all}");
    }
}

/// Lobes narrower than the first step, and narrower than the least: the mirror direction of every incidence is in the first look.
#[test]
fn a_lobe_narrower_than_the_first_step_is_found_at_every_incidence() {
    for n in [2e4, 1e6] {
        let table = measured(&material(n), &Instrument::default(), &SCAN, 1);
        for theta in incidences() {
            let near: Vec<f64> = curve(&table, theta).iter().map(|c| c.0 - theta).filter(|a| a.abs() < 0.4).collect();
            println!("n {n}, {theta}°: {near:.3?}");
            assert!(near.len() >= 5, "n {n}, {theta}°: {near:?}");
        }
    }
}

/// Where the detector saturates the border is found to the least step, and nothing is read between two saturated readings.
#[test]
fn saturated_readings_are_closed_in_on_and_not_read_between() {
    let detector = Detector { full_well: 5e4, exposures_s: vec![0.02, 0.5], ..Detector::default() };
    let instrument = Instrument { electrons: 1e6, detector, ..Instrument::default() };
    // The peak at the mirror direction is 16/sr: 3·10⁵ electrons in the shorter exposure at 0°, 8·10⁴ at 75°.
    let table = measured(&material(1e3), &instrument, &SCAN, 2);
    for theta in incidences() {
        let list = curve(&table, theta);
        let borders: Vec<f64> =
            list.windows(2).filter(|w| w[0].1.is_nan() != w[1].1.is_nan()).map(|w| w[1].0 - w[0].0).collect();
        let lost = list.iter().filter(|c| c.1.is_nan()).count();
        println!("{theta}°: {lost} saturated, borders {borders:?}");
        assert!(
            borders.len() == 2 && borders.iter().all(|b| *b < 0.2) && lost <= 1 + 2 * 5,
            "{theta}°: {borders:?} {lost}"
        );
    }
    assert!(table.weights.known() && table.notes.iter().any(|n| n.contains("saturated")));
}

/// A truth that is unknown in places, as a table's: what is masked is not read between.
#[test]
fn where_the_truth_is_not_known_nothing_is_refined() {
    let of = material(1e3);
    let truth = |wi: DVec3, wo: DVec3, out: &mut [f64]| {
        out.copy_from_slice(&of.value(wi, wo));
        // Up to 40° beyond the normal on the mirror direction's side.
        wo.x > -0.643
    };
    let (instrument, channels) = (Instrument::default(), vec!["y".to_owned()]);
    let look = |scan: &Scan, control: Control<'_>| {
        let table = simulate("m", &truth, &channels, &instrument, scan, 3, control)?;
        Some(Look { table, time_s: vec![] })
    };
    let wish = Adaptive { pairs: 500, dimension: Dimension::Space, instrument: &instrument };
    let scan = adapt(&wish, Control::silent(), look);
    let table = simulate("m", &truth, &channels, &instrument, &scan, 3, Control::silent()).expect("small");
    assert_eq!(table.len(), 500);
    // Of the first look 9 of each incidence lie there, and a border costs five at most.
    let lost = table.values.iter().filter(|v| v.is_nan()).count();
    assert!((54..=54 + 6 * 5).contains(&lost), "{lost}");
    assert!(gaps(&table).iter().any(|g| g.0 < 0.3 && g.1), "the lobes that are known are refined");
}

#[test]
fn without_noise_lobes_are_refined_and_matte_stays_even_and_no_value_is_lost_at_grazing() {
    for (n, is_refined) in [(0.0, false), (60.0, true), (2e4, true)] {
        let table = measured(&material(n), &Instrument::noiseless(), &SCAN, 0);
        assert_eq!(table.len(), 500);
        assert!(table.values.iter().all(|v| v.is_finite() && *v > 0.0), "n {n}");
        assert!((0..table.len()).all(|i| table.weights.get(i) > 0.0));
        assert_eq!(gaps(&table).iter().any(|g| g.0 < 1.2), is_refined, "n {n}");
        let grazing = curve(&table, 75.0);
        assert!((grazing[0].0 + 85.0).abs() < 1e-9 && (grazing[grazing.len() - 1].0 - 85.0).abs() < 1e-9);
    }
    // Too many pairs for the least step: 0.16° is the last half of 5°.
    let table = measured(&material(0.0), &Instrument::noiseless(), &Scan::Adaptive { pairs: 20_000 }, 0);
    assert_eq!(table.len(), 6 * (34 * 32 + 1));
}

/// The scan is one run: a list of the same directions in the same order is read to the same bits, at the same times, in the same hours.
#[test]
fn an_adaptive_scan_is_the_run_that_chose_it_from_any_number_of_threads() {
    let axes = Axes { degrees_per_s: 15.0, jitter_deg: 0.02, ..lab().axes };
    for instrument in [Instrument::default(), Instrument { axes, ..lab() }] {
        let of = material(200.0);
        let source = Source::Fitted(Box::new(of.clone()));
        let table = measured(&of, &instrument, &SCAN, 5);
        let bits = |m: &Measurement| m.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let listed = measured(&of, &instrument, &again(&table), 5);
        // What jitter does on average is taken off by a surrogate, whose fit weighs an adaptive scan's readings by their cells and a list's alike: there values agree
        // within a part of their noise, not to the bit.
        let sigma = table.sigma.as_ref().expect("noise");
        let off = |((a, b), sigma): ((&f64, &f64), &f64)| (a - b).abs() / sigma;
        let worst = table.values.iter().zip(&listed.values).zip(sigma).map(off).fold(0.0, f64::max);
        println!("read again as a list: off by {worst:.1e} of a reading's noise at most");
        let near = worst < 0.1;
        assert!(near && (instrument.axes.jitter_deg > 0.0 || bits(&table) == bits(&listed)), "{:?}", instrument.axes);
        for threads in [1, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            let other = pool.install(|| measured(&of, &instrument, &SCAN, 5));
            assert!(bits(&other) == bits(&table) && other.directions == table.directions, "{threads} threads");
        }
        let raw = measure_raw("m", &source, &instrument, &SCAN, 5, Control::silent()).expect("read");
        let end = raw.readings.last().map_or(0.0, |r| r.time_s + r.exposure_s);
        let said = hours(&instrument, &raw.directions, &lit_rows(&raw.directions, &[]));
        assert!((end / 3600.0 / said - 1.0).abs() < 1e-9, "{end} s, {said} h");
        assert!(instrument.has_reference() || (said - hours_of(&table, &instrument)).abs() < 1e-12);
        // The choices see what was read until then: a longer scan goes on as a shorter one began, the first look at least.
        let order: Vec<u32> = raw.readings.iter().filter(|r| r.kind == Kind::Sample).filter_map(|r| r.entry).collect();
        assert!(order.is_sorted());
        assert_ne!(bits(&table), bits(&measured(&of, &instrument, &SCAN, 6)));
    }
}

/// The source's drift between readings of different rounds is no bend.
#[test]
fn drift_is_no_bend() {
    let source = goniofit::gonio::parts::Source { drift_per_sqrt_hour: 0.05, ..Default::default() };
    let reference = Reference { reflectance: 0.99, ..Reference::default() };
    let axes = Axes { move_s: 10.0, ..Axes::default() };
    let instrument = Instrument { electrons: 1e9, read_noise: 0.0, source, reference, axes, ..Instrument::default() };
    for seed in 0..6 {
        let table = measured(&material(0.0), &instrument, &SCAN, seed);
        let fine = gaps(&table).iter().filter(|g| g.0 < 1.2).count();
        assert!(fine <= 2, "seed {seed}: {fine}");
    }
}

/// On the flank of a lobe readings scatter by where axes stopped: that is no bend either, and the flank is not read finer than it bends.
#[test]
fn jitter_on_a_flank_is_no_bend() {
    let axes = Axes { jitter_deg: 0.2, ..Axes::default() };
    let instrument = Instrument { electrons: 1e7, read_noise: 0.0, axes, ..Instrument::default() };
    let flank = |seed: u64| {
        let table = measured(&material(20.0), &instrument, &SCAN, seed);
        let fine = |theta: f64| {
            let list = curve(&table, theta);
            let on_flank = |w: &&[(f64, f64)]| (6.0..=20.0).contains(&(0.5 * (w[0].0 + w[1].0) - theta).abs());
            list.windows(2).filter(on_flank).filter(|w| w[1].0 - w[0].0 < 0.7).count()
        };
        incidences().map(fine).sum::<usize>()
    };
    let found: Vec<usize> = (0..6).map(flank).collect();
    println!("gaps below 0.7° on flanks: {found:?}");
    assert!(found.iter().all(|f| *f < 20), "{found:?}");
}

/// A model that is wrong comes out as a uniform scan's does: a reading stands for its cell of θo, however many others lie beside it.
#[test]
fn a_wrong_model_is_not_pulled_to_where_readings_are_dense() {
    let lobe = |weight: f64, n: f64| (LobeKind::Phong, vec![weight], vec![n]);
    let lobes = vec![(LobeKind::Lambert, vec![0.2], vec![]), lobe(0.1, 15.0), lobe(0.05, 400.0)];
    let of = Material::new(vec!["y".into()], lobes);
    let diffuse = |scan: &Scan, weights: WeightMode| {
        let table = measured(&of, &Instrument::default(), scan, 1);
        let options = FitOptions { weights, ..FitOptions::new("lambert+phong".parse().expect("a model")) };
        fit(&table, &options).expect("fitted").material.lobes[0].weight[0]
    };
    let even = diffuse(&Scan::InPlane { step_deg: 0.5 }, WeightMode::Uniform);
    let [by_cell, by_count] =
        [WeightMode::SolidAngle, WeightMode::Uniform].map(|weights| diffuse(&SCAN, weights) / even);
    println!("diffuse weight over that of a uniform scan: {by_cell} by cells, {by_count} by count");
    assert!((by_cell - 1.0).abs() < 0.03 && (by_count - 1.0).abs() > 0.1, "{by_cell} {by_count}");
}

#[test]
fn a_flat_material_is_measured_in_its_own_world() {
    let lobes = vec![(LobeKind::Lambert2d, vec![0.3], vec![]), (LobeKind::Phong2d, vec![0.2], vec![1e3])];
    let of = Material::new(vec!["y".into()], lobes);
    let source = Source::Fitted(Box::new(of));
    let table = measure("m", &source, &Instrument::default(), &SCAN, 1, Control::silent()).expect("measured");
    assert_eq!((table.dimension, table.len()), (Dimension::Flat, 500));
    assert!(gaps(&table).iter().any(|g| g.0 < 0.7));
}
