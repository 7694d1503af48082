//! Intervals hold the truth as often as they say, by small numbers of experiments; `benches/coverage.rs` does it by large ones. Where the model
//! can't be right, on real tapes that send light back to where it came from, the record says so.

use std::path::Path;

use goniofit::brdf::{Material, PerChannel};
use goniofit::fit::{FitOptions, Limit, Robust, RobustKind};
use goniofit::gonio::{Instrument, Scan};
use goniofit::measurement::Measurement;
use goniofit::measurement::formats::{self, ReadOptions};
use rayon::prelude::*;

use crate::experiment::{Cell, Outliers};
use crate::support::*;

const SEEDS: u64 = 200;
/// kd, ks, n of the plain cells and the robust ones.
const FIGURES: usize = 3 * 8;

fn small() -> Scan {
    Scan::InPlane { step_deg: 5.0 }
}

/// The counts between which a binomial of `SEEDS` trials of 95 % lies but for a chance of `tail` at each end: the least k with P(X ≤ k) > tail
/// and the largest with P(X ≥ k) > tail. Tests of right intervals over all `FIGURES` fail by chance with 10⁻³ in all when
/// tail = 10⁻³/(2·`FIGURES`), by the union bound.
fn bounds() -> (u64, u64) {
    let tail = 1e-3 / (2 * FIGURES) as f64;
    let (n, p) = (SEEDS as f64, 0.95f64);
    // P(X = 0), then each from the one before.
    let mut probability = vec![(1.0 - p).powf(n)];
    for k in 1..=SEEDS {
        let last = probability[k as usize - 1];
        probability.push(last * (n - k as f64 + 1.0) / k as f64 * p / (1.0 - p));
    }
    let least = (0..=SEEDS).find(|k| probability[..=*k as usize].iter().sum::<f64>() > tail).expect("they add up to 1");
    let most = (0..=SEEDS).rfind(|k| probability[*k as usize..].iter().sum::<f64>() > tail).expect("they add up to 1");
    (least, most)
}

/// The cells, each with seeds of its own.
fn hold(cells: &[Cell], first_seed: u64) {
    let (least, most) = bounds();
    let mut failures = Vec::new();
    for (i, cell) in cells.iter().enumerate() {
        let seeds = first_seed + 1000 * i as u64..first_seed + 1000 * i as u64 + SEEDS;
        let all: Vec<[bool; 3]> = seeds.into_par_iter().map(|seed| cell.held([0.3, 0.2, 40.0], seed)).collect();
        let held: [u64; 3] = std::array::from_fn(|p| all.iter().filter(|h| h[p]).count() as u64);
        println!("{cell:?}: {held:?} of {SEEDS}, expected {least} to {most}");
        if !held.iter().all(|h| (least..=most).contains(h)) {
            failures.push(format!("{cell:?}: {held:?} of {SEEDS}"));
        }
    }
    assert!(failures.is_empty(), "expected {least} to {most}:\n{}", failures.join("\n"));
}

#[test]
fn the_bounds_are_those_of_the_binomial() {
    let (least, most) = bounds();
    // Mean 190, standard deviation 3.08: about four of them on the long side, all of it on the other.
    assert!((175..=178).contains(&least) && most == 200, "{least} {most}");
}

#[test]
fn intervals_hold_the_truth_at_every_noise_with_and_without_stated_sigma() {
    let mut cells = Vec::new();
    for electrons in [1e4, 1e6] {
        for stated_sigma in [true, false] {
            cells.push(Cell { stated_sigma, ..Cell::plain(small(), electrons) });
        }
    }
    cells.push(Cell::plain(HEMISPHERE(15.0), 1e5));
    cells.push(Cell { stated_sigma: false, ..Cell::plain(HEMISPHERE(15.0), 1e5) });
    hold(&cells, 10_000);
}

/// One-sided outliers pull a Cauchy fit by a hundredth of a sample's noise, a tenth of the standard error with so small a scan.
#[test]
fn robust_intervals_hold_the_truth_under_5_percent_of_gross_outliers() {
    let cauchy =
        Cell { outliers: Outliers::OneSided(0.05), robust: Some(RobustKind::Cauchy), ..Cell::plain(small(), 1e5) };
    let huber =
        Cell { outliers: Outliers::Symmetric(0.05), robust: Some(RobustKind::Huber), ..Cell::plain(small(), 1e5) };
    hold(&[cauchy, huber], 50_000);
}

fn a_real_tape_is_no_phong_lobe(file: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/measured").join(file);
    if !path.exists() {
        println!("SKIPPED: {file} is not here");
        return;
    }
    let m = formats::read(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    for model in ["lambert+phong", "lambert+phong+phong"] {
        let got = solved(&m, &options(model));
        let r = record(&got);
        let residual = r.residual.as_ref().expect("neighbours to compare");
        println!("{file} {model}: {:?} {residual:?} {:?}", parameters(&got), r.warnings);
        assert_eq!(residual.noise_from, "neighbours");
        assert!(residual.structured_share > 0.5, "{residual:?}");
        assert!(residual.effective_samples < 0.5 * r.samples as f64, "{residual:?}");
        assert!(r.warnings.iter().any(|w| w.starts_with("the model does not describe these data")), "{:?}", r.warnings);
        assert_eq!(r.model_error.len(), got.lobes.len());
        for (own, (error, lobe)) in r.model_error.iter().zip(r.standard_error.iter().zip(&got.lobes)) {
            let pairs = own.weight.iter().zip(&error.weight).zip(&lobe.weight);
            for ((model, noise), weight) in pairs.filter(|((_, noise), w)| noise.is_some() && **w > 0.0) {
                // The model's own error moves a parameter further than noise does.
                assert!(model >= noise, "weight {weight}: {model:?} {noise:?}");
            }
        }
    }
}

#[test]
fn a_real_yellow_tape_is_said_not_to_be_a_phong_lobe() {
    a_real_tape_is_no_phong_lobe("retro-3M-yellow.alta.dat");
}

#[test]
fn a_real_grey_tape_is_said_not_to_be_a_phong_lobe() {
    a_real_tape_is_no_phong_lobe("retro-gray-tape.alta.dat");
}

/// One sample on a narrow peak of a known width: the fit passes through it, so that its residual says nothing of its noise, and the weight's
/// error, which is made of residuals, is next to nothing. The interval takes the noise of the others for it.
#[test]
fn the_interval_of_what_one_sample_decides_is_by_the_others_noise() {
    let truth = material(&[0.3], &[0.2], 1e5);
    let scan = part_of(&Scan::InPlane { step_deg: 2.5 }, |wi, wo| {
        let peak = cos_alpha(wi, wo);
        peak < 0.99 || peak > 1.0 - 1e-9 && wi.z > 0.99
    });
    let mut o = options("lambert+phong");
    o.limits.push(Limit::fixed("phong.exponent=1e5").expect("a limit"));
    let (mut held, seeds) = (0, 100);
    for seed in 0..seeds {
        let mut m = exact(&truth, &scan);
        let mut rng = draws(seed);
        m.values.iter_mut().for_each(|v| *v += 0.01 * normal(&mut rng));
        let got = solved(&m, &o);
        let (low, high) = intervals(&got)[1].expect("an interval");
        let noise = 0.01 * std::f64::consts::TAU / 100_002.0;
        assert!(high - low < 6.0 * noise, "seed {seed}: {low} to {high}");
        held += u64::from((low..=high).contains(&0.2));
        assert!(
            record(&got).warnings.iter().any(|w| w.contains("decide phong.weight[")),
            "{:?}",
            record(&got).warnings
        );
    }
    // 95 % of 100, four standard deviations below.
    assert!(held >= 86, "{held} of {seeds}");
}

/// Huber's pull does not fade: outliers to one side move its weights by several of the noise's standard errors. What they pull counts.
#[test]
fn a_huber_fit_pulled_to_one_side_says_how_far() {
    let cell = Cell {
        outliers: Outliers::OneSided(0.05),
        robust: Some(RobustKind::Huber),
        ..Cell::plain(HEMISPHERE(10.0), 1e5)
    };
    let held: Vec<[bool; 3]> = (0..40).map(|seed| cell.held([0.3, 0.2, 40.0], seed)).collect();
    assert!((0..3).all(|p| held.iter().filter(|h| h[p]).count() >= 35), "{held:?}");
    let got = solved(&cell.measure([0.3, 0.2, 40.0], 0), &cell.options());
    assert!(record(&got).warnings.iter().any(|w| w.contains("lean to one side")), "{:?}", record(&got).warnings);
}

/// Two channels share an exponent and one has few samples of its own, or no more than it has weights: its noise is then the other's.
#[test]
fn intervals_of_a_channel_of_few_samples_hold_the_truth() {
    let truth = material(&[0.3, 0.2], &[0.1, 0.1], 20.0);
    let scan = Scan::InPlane { step_deg: 5.0 };
    for few in [2, 3, 4, 6] {
        let seeds = 150;
        let mut held = [0; 2];
        for seed in 0..seeds {
            let mut m = exact(&truth, &scan);
            let mut rng = draws(1000 * few + seed);
            m.values.iter_mut().for_each(|v| *v += 3e-3 * normal(&mut rng));
            // Of the first channel the mirror direction of 15° and what stands apart from it.
            let kept: Vec<usize> = (0..few as usize).map(|k| 35 + 17 - 3 + 7 * k).collect();
            (0..m.len()).filter(|i| !kept.contains(i)).for_each(|i| m.values[i] = f64::NAN);
            let got = solved(&m, &options("lambert+phong"));
            for (l, truth) in [(0, 0.3), (1, 0.1)] {
                let interval = record(&got).interval_95[l].weight[0];
                held[l] += u64::from(interval.is_none_or(|(low, high)| (low..=high).contains(&truth)));
            }
        }
        println!("{few} samples: {held:?} of {seeds}");
        // 95 % of 150 is 142.5, four standard deviations below 131.
        assert!(held.iter().all(|h| *h >= 131), "{few} samples: {held:?} of {seeds}");
    }
}

/// The tails of skew noise are no gross outliers, however small the scale of the loss.
#[test]
fn clean_samples_are_no_gross_outliers_at_a_small_scale() {
    let truth = material(&[0.3], &[0.2], 20.0);
    let mut m = exact(&truth, &HEMISPHERE(10.0));
    let mut rng = draws(3);
    m.values.iter_mut().for_each(|v| *v += 1e-3 * -goniofit::numeric::random::RngExt::random::<f64>(&mut rng).ln());
    for scale in [0.1, 0.3, 1.345] {
        let o = FitOptions { robust: Some(Robust { kind: RobustKind::Huber, scale }), ..options("lambert+phong") };
        let warnings = &record(&solved(&m, &o)).warnings.clone();
        let many = warnings.iter().find(|w| w.contains("gross outliers"));
        // Of 2,600 exponential draws a few lie beyond 9.5 σ of the median absolute deviation.
        let count = many.map_or(0, |w| w.split(' ').next().and_then(|n| n.parse().ok()).unwrap_or(usize::MAX));
        assert!(count < 40, "{scale}: {warnings:?}");
    }
}

/// Weights by a σ that follows the noise pull the fit; the intervals know how far.
#[test]
fn intervals_allow_for_a_sigma_that_follows_the_noise() {
    let truth = material(&[0.32, 0.06, 0.035], &[0.12; 3], 90.0);
    let o = FitOptions { use_sigma: true, ..options("lambert+phong") };
    let in_plane = Scan::InPlane { step_deg: 5.0 };
    for (scan, electrons) in
        [HEMISPHERE(10.0), in_plane].into_iter().flat_map(|s| [3e2, 1e3, 1e4, 1e5].map(|e| (s.clone(), e)))
    {
        let seeds = 100;
        let mut held = [0; 3];
        for seed in 0..seeds {
            let instrument = Instrument { electrons, ..Instrument::default() };
            let got = solved(&measure(&truth, &instrument, &scan, seed), &o);
            for (c, kd) in [0.32, 0.06, 0.035].into_iter().enumerate() {
                let (low, high) = record(&got).interval_95[0].weight[c].expect("determined");
                held[c] += u64::from((low..=high).contains(&kd));
            }
        }
        println!("{scan:?}, {electrons:e} electrons: {held:?} of {seeds}");
        // 95 % of 100, four standard deviations below.
        assert!(held.iter().all(|h| *h >= 86), "{scan:?}, {electrons:e} electrons: {held:?} of {seeds}");
    }
}

/// A sample's weight is by all of its error. Those on the flanks of a lobe, good to 0.1 % but for half of their value that they share, as where a
/// lobe stands off, must not decide how sharp it is: by their own σ alone the exponent would be off by more than a twentieth.
#[test]
fn samples_weigh_by_the_errors_that_they_share_too() {
    let truth = material(&[0.05], &[0.5], 1000.0);
    let scan = Scan::InPlane { step_deg: 1.0 };
    let exact = || exact(&truth, &scan);
    let right = exact().values;
    let peak = right.iter().copied().fold(0.0, f64::max);
    let is_flank = |y: f64| y > 0.03 && y < 0.05 * peak;
    let shared: Vec<f64> = right.iter().map(|y| if is_flank(*y) { 0.5 * y } else { 0.0 }).collect();
    let sigma: Vec<f64> = right.iter().map(|y| 1e-3 * y).collect();
    assert!(shared.iter().filter(|u| **u > 0.0).count() > 20);
    let o = FitOptions { use_sigma: true, ..options("lambert+phong") };
    for sign in [1.0, -1.0] {
        let values: Vec<f64> = right.iter().zip(&shared).map(|(y, u)| y + sign * u).collect();
        let with = |common| Measurement { values: values.clone(), sigma: Some(sigma.clone()), common, ..exact() };
        let [told, untold] = [vec![shared.clone()], Vec::new()].map(|common| solved(&with(common), &o));
        let off = |of: &Material| (of.lobes[1].shape_of(0).expect("a shape")[0] / 1000.0).ln();
        println!("{sign}: off by {:.2e}, by their own σ {:.2e}", off(&told), off(&untold));
        assert!(off(&told).abs() < 1e-3 && off(&untold).abs() > 0.05);
        let PerChannel::Shared(Some((low, high))) = record(&told).interval_95[1].shape[0].1 else {
            panic!("determined")
        };
        assert!((low..=high).contains(&1000.0) && high < 1010.0, "{low} {high}");
    }
}
