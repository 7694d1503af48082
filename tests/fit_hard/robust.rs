//! Robust fits: the scale s that they settle at, and what they say where it does not settle.

use goniofit::brdf::{LobeKind, Material};
use goniofit::fit::{Bootstrap, Datum, FitOptions, Limit, Loss, Robust, RobustKind, fit_best_model};
use goniofit::geometry::theta_of;
use goniofit::gonio::{Instrument, Scan};
use goniofit::measurement::{Dimension, Directions, Measurement, Weights};
use goniofit::numeric::random::RngExt;
use rayon::prelude::*;

use crate::experiment::{Outliers, add_outliers};
use crate::support::*;

/// A small random table of one glossy lobe with 5 to 15 % of gross outliers.
fn spoilt(seed: u64) -> Measurement {
    let rng = &mut draws(seed);
    let truth = material(&[0.4 * rng.random::<f64>()], &[0.05 + 0.5 * rng.random::<f64>()], 200f64.powf(rng.random()));
    let scan = if rng.random() { Scan::InPlane { step_deg: 10.0 } } else { HEMISPHERE(20.0) };
    let share = 0.05 + 0.1 * rng.random::<f64>();
    let outliers = if rng.random() { Outliers::OneSided(share) } else { Outliers::Symmetric(share) };
    let electrons = 10f64.powf(3.0 + 3.0 * rng.random::<f64>());
    let mut m = measure(&truth, &Instrument { electrons, ..Instrument::default() }, &scan, seed);
    add_outliers(&mut m, outliers, rng);
    m
}

/// Residuals of the one channel and their weights, which average 1.
fn residuals(m: &Measurement, of: &Material, o: &FitOptions) -> Vec<(f64, f64)> {
    let within = |w| theta_of(w).to_degrees() <= o.max_angle_deg + 1e-9;
    let one = |i: usize| {
        let (wi, wo) = m.directions.pair(i);
        let datum = Datum { value: m.values[i], cos_i: wi.z, epsilon: 0.0 };
        let counts = within(wi) && within(wo) && o.loss.accepts(datum);
        counts.then(|| (o.loss.residual(of.value(wi, wo)[0], datum), m.weights.get(i)))
    };
    let mut list: Vec<(f64, f64)> = (0..m.len()).step_by(o.stride).filter_map(one).collect();
    let mean = list.iter().map(|(_, w)| w).sum::<f64>() / list.len() as f64;
    list.iter_mut().for_each(|(_, w)| *w /= mean);
    list
}

/// Σ w s² ρ(r²/s²).
fn cost(list: &[(f64, f64)], kind: RobustKind, s: f64) -> f64 {
    list.iter().map(|(r, w)| w * s * s * kind.rho((r / s).powi(2)).0).sum()
}

/// 1.4826 × the median absolute deviation from the median.
fn spread(list: &[(f64, f64)]) -> f64 {
    let median = |mut v: Vec<f64>| {
        v.sort_by(f64::total_cmp);
        0.5 * (v[v.len() / 2] + v[(v.len() - 1) / 2])
    };
    let centre = median(list.iter().map(|(r, _)| *r).collect());
    1.482_602_218_505_602 * median(list.iter().map(|(r, _)| (r - centre).abs()).collect())
}

/// By how much a robust fit with a lobe more is worse than the one that it contains, at the s of the latter; as a share of the cost.
/// Of its own s alone nothing follows: a lobe more may move the median residual either way.
fn excess(m: &Measurement, o: &FitOptions, smaller: &str, larger: &str) -> f64 {
    let at = |model: &str| solved(m, &FitOptions { model: options(model).model, ..o.clone() });
    let (smaller, larger) = (at(smaller), at(larger));
    let kind = o.robust.expect("robust").kind;
    let s = record(&smaller).robust_scale[0];
    let least = cost(&residuals(m, &smaller, o), kind, s);
    assert!(rel(least, record(&smaller).cost) < 1e-6, "{least:e} {:e}", record(&smaller).cost);
    cost(&residuals(m, &larger, o), kind, s) / least - 1.0
}

#[test]
fn a_lobe_more_is_never_worse_than_the_robust_fit_that_it_contains() {
    let chains = [("lambert", "lambert+phong"), ("phong", "phong+phong"), ("lambert+phong", "lambert+phong+phong")];
    let one = |seed: u64| {
        let m = spoilt(seed);
        let mut said = Vec::new();
        for (kind, loss) in RobustKind::ALL.into_iter().flat_map(|k| [Loss::CosineL2, Loss::Log].map(|l| (k, l))) {
            let o = FitOptions { loss, robust: robust(kind), ..options("lambert") };
            let excesses = chains.map(|(smaller, larger)| excess(&m, &o, smaller, larger));
            said.extend(
                excesses.iter().zip(chains).map(|(e, (_, l))| (*e, format!("seed {seed} {kind:?} {loss:?} {l}"))),
            );
        }
        said
    };
    let mut all: Vec<(f64, String)> = (0..60).into_par_iter().flat_map_iter(one).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (excess, case) in &all[..10] {
        println!("{case}: cost higher by {:.3} %", 100.0 * excess);
    }
    assert!(all[0].0 < WORSE, "{all:?}");
}

/// What a descent leaves undone, as a share of the cost.
const WORSE: f64 = 1e-6;

/// Fifteen values drawn as squares of random numbers, a scale far below the noise: no s is the one that its own fit's residuals ask for.
#[test]
fn a_scale_that_can_not_settle_is_said_to_be_so_with_what_the_residuals_ask_for() {
    let rng = &mut draws(939);
    let mut m = measure(&material(&[0.3], &[0.3], 20.0), &Instrument::noiseless(), &HEMISPHERE(30.0), 939);
    m.values.iter_mut().for_each(|v| *v *= rng.random::<f64>().powi(2));
    let asked = Robust { kind: RobustKind::Cauchy, scale: 0.3 };
    let o = FitOptions { robust: Some(asked), stride: 5, ..options("lambert") };
    let got = solved(&m, &o);
    let used = record(&got).robust_scale[0];
    let left = (0.3 * spread(&residuals(&m, &got, &o)) / used - 1.0).abs();
    let said = record(&got).warnings.iter().find(|w| w.starts_with("the robust scale has not settled"));
    let said = said.unwrap_or_else(|| panic!("{:?}", record(&got).warnings));
    println!("{said}");
    // Far from settled is another matter than not settled: 1e-6 is what counts as settled.
    assert!(left > 1e-6 && said.contains(&format!("differs by {:.1e} %", 100.0 * left)), "{left:e}: {said}");
    // At the usual scale it settles, and nothing is said.
    let usual = solved(&m, &FitOptions { robust: robust(RobustKind::Cauchy), ..o });
    assert!(!record(&usual).warnings.iter().any(|w| w.contains("settled")), "{:?}", record(&usual).warnings);
}

const NOISE: f64 = 0.01;

/// A direction in the plane of incidence, degrees from the normal.
fn towards(theta: f64) -> glam::DVec3 {
    glam::DVec3::new(theta.to_radians().sin(), 0.0, theta.to_radians().cos())
}

/// Exact in-plane values every 5° up to `most` to both sides, for light from the other side at each incidence.
fn in_plane(truth: &Material, incidences: &[f64], most: i32) -> Measurement {
    let pairs = incidences.iter().flat_map(|i| (-most..=most).step_by(5).map(move |o| (-*i, f64::from(o))));
    let (wi, wo) = pairs.map(|(i, o)| (towards(i), towards(o))).unzip();
    let directions = Directions::List { wi, wo };
    let weights = Weights::Uniform;
    exact(
        truth,
        &Scan::List { name: "in plane".into(), directions, weights, dimension: Dimension::Space, rows: vec![] },
    )
}

/// In-plane scans at three incidences, 93 readings of a glossy lobe of exponent 30 with noise; a share of them too high by about 100 σ,
/// by 300 σ where the seed is odd.
fn leaning(seed: u64, share: f64) -> Measurement {
    let rng = &mut draws(seed);
    let mut m = in_plane(&material(&[0.2], &[0.1], 30.0), &[10.0, 40.0, 60.0], 75);
    let size = if seed % 2 == 1 { 3.0 } else { 1.0 };
    for value in &mut m.values {
        *value += NOISE * normal(rng);
        if rng.random::<f64>() < share {
            *value += size * (1.0 + 0.3 * normal(rng)).abs();
        }
    }
    m
}

/// Σ 1 − (1 − r²/s²)³ of two fits at one s, 4.685 times the smaller median deviation: by how many samples the first is the worse one.
fn worse_by(m: &Measurement, one: &Material, other: &Material, o: &FitOptions) -> f64 {
    let lists = [one, other].map(|of| residuals(m, of, o));
    let least = lists.iter().map(|list| spread(list)).fold(f64::INFINITY, f64::min);
    let s = 4.685 * least * (1.0 + 3.5 / (lists[0].len() as f64).sqrt());
    let bisquare = |(r, w): &(f64, f64)| w * (1.0 - (1.0 - (r / s).powi(2)).max(0.0).powi(3));
    let [one, other] = lists.map(|list| list.iter().map(bisquare).sum::<f64>());
    one - other
}

/// A minimum inside a range is one of the whole range too: the search over more may not end in a worse one.
#[test]
fn a_free_robust_fit_is_never_worse_than_one_bounded_around_the_truth() {
    let (low, high) = (5.0, 100.0);
    let one = |(kind, share, seed): (RobustKind, f64, u64)| {
        let m = leaning(seed, share);
        let free = FitOptions { robust: robust(kind), ..options("lambert+phong") };
        let limit = Limit::range(&format!("phong.exponent={low}..{high}")).expect("a limit");
        let bounded = FitOptions { limits: vec![limit], ..free.clone() };
        let [free, bounded] = [free, bounded].map(|o| solved(&m, &o));
        // At an end of the range it is no minimum of the free fit's.
        let inside = (1.01 * low..0.99 * high).contains(&exponent(&bounded, 1));
        let worse = worse_by(&m, &free, &bounded, &options("lambert+phong"));
        let [f, b] = [&free, &bounded].map(|m| (exponent(m, 1), record(m).robust_scale[0]));
        (inside && worse > 0.1).then(|| format!("{kind:?} {share} seed {seed}: {f:?}, {b:?}, worse by {worse:.3}"))
    };
    let shares = [0.1, 0.2, 0.3];
    let kinds = RobustKind::ALL.into_iter().flat_map(|k| shares.map(|share| (k, share)));
    let cases: Vec<_> = kinds.flat_map(|(k, share)| (0..100).map(move |seed| (k, share, seed))).collect();
    let worse: Vec<String> = cases.into_par_iter().filter_map(one).collect();
    assert!(worse.is_empty(), "{} of 600: {worse:#?}", worse.len());
}

/// In-plane readings every 5° of a lobe that few of them see, with normal noise and whatever `spoil` does to a reading.
fn few_see_it(seed: u64, incidences: &[f64], truth: &Material, noise: f64, spoil: fn(f64) -> f64) -> Measurement {
    let rng = &mut draws(seed);
    let mut m = in_plane(truth, incidences, 80);
    m.values.iter_mut().for_each(|v| *v = spoil(*v + noise * normal(rng)));
    m
}

/// What happens to a reading.
type Spoil = fn(f64) -> f64;
/// Name and kind of what happens to readings, incidences, exponent, weight, loss, seed.
type Case<'a> = (&'a str, Spoil, &'a [f64], f64, f64, RobustKind, u64);

/// Data without outliers are not a lobe's worth of outliers: where the plain fit knows the lobe, the robust one finds it.
#[test]
fn a_robust_fit_of_clean_data_finds_the_lobe_that_the_plain_fit_finds() {
    let kept = |v: f64| v;
    let clipped = |v: f64| v.max(0.0);
    let rounded = |v: f64| (v / 0.01).round() * 0.01;
    let spoils: [(&str, Spoil); 3] = [("clean", kept), ("clipped", clipped), ("rounded", rounded)];
    let scans: [&[f64]; 3] = [&[30.0], &[10.0, 30.0, 50.0], &[0.0, 15.0, 30.0, 45.0, 60.0]];
    let lobes = [(20.0, 0.2), (137.0, 0.1), (500.0, 0.3), (2000.0, 0.3)];
    let mut cases = Vec::new();
    for (name, spoil) in spoils {
        for scan in scans {
            // A lobe that a single reading sees can't be told from an outlier.
            for (n, ks) in lobes.into_iter().filter(|(n, _)| scan.len() > 1 || *n < 1000.0) {
                for kind in RobustKind::ALL {
                    cases.extend((0..20).map(|seed| (name, spoil, scan, n, ks, kind, seed)));
                }
            }
        }
    }
    let one = |(name, spoil, scan, n, ks, kind, seed): Case<'_>| {
        let m = few_see_it(seed, scan, &material(&[0.1], &[ks], n), 0.02, spoil);
        let o = options("lambert+phong");
        let plain = solved(&m, &o);
        if rel(exponent(&plain, 1), n) > 0.2 {
            return None;
        }
        let got = solved(&m, &FitOptions { robust: robust(kind), ..o });
        let found = rel(exponent(&got, 1), n) < 0.5 && rel(got.lobes[1].weight[0], ks) < 0.5;
        let said = format!("{name} {} incidences, n {n}, {kind:?}, seed {seed}: {:?}", scan.len(), parameters(&got));
        Some(if found { Ok(()) } else { Err(said) })
    };
    let all: Vec<Result<(), String>> = cases.into_par_iter().filter_map(one).collect();
    let lost: Vec<&String> = all.iter().filter_map(|r| r.as_ref().err()).collect();
    println!("{} of {} lost", lost.len(), all.len());
    assert!(all.len() > 1000 && lost.is_empty(), "{} of {}: {lost:#?}", lost.len(), all.len());
}

/// The pull of one value, however large, ends at s, and so must what it does to the fit.
#[test]
fn one_value_however_large_moves_a_robust_fit_no_further_than_a_large_one() {
    for kind in RobustKind::ALL {
        let o = FitOptions { robust: robust(kind), ..options("lambert+phong") };
        let with = |value: f64| {
            let mut m = leaning(5, 0.0);
            m.values[39] = value;
            solved(&m, &o)
        };
        let large = with(1e6);
        assert!(rel(exponent(&large, 1), 30.0) < 0.2, "{kind:?}: {:?}", parameters(&large));
        for value in [1e8, 1e12, 1e14, 1e16, 1e20, 1e100] {
            let got = with(value);
            let pairs = parameters(&got).into_iter().zip(parameters(&large)).zip(errors(&large));
            let off = pairs.map(|((a, b), e)| (a - b).abs() / e.expect("an error")).fold(0.0, f64::max);
            println!("{kind:?} {value:e}: {off:.1e} standard errors off");
            assert!(off < 0.1, "{kind:?} {value:e}: {:?}, not {:?}", parameters(&got), parameters(&large));
        }
    }
}

/// Channels fitted apart find their lobes each in its own order; the file has one.
#[test]
fn lobes_of_channels_fitted_apart_are_in_the_same_order() {
    let lobes = |w: f64, n: f64| (LobeKind::Phong, vec![w, 0.8 * w, 0.6 * w], vec![n]);
    let base = (LobeKind::Lambert, vec![0.2, 0.15, 0.1], vec![]);
    let names = ["r", "g", "b"].map(str::to_owned).to_vec();
    let truth = Material::new(names, vec![base, lobes(0.2, 20.0), lobes(0.1, 300.0)]);
    for (kind, seed) in RobustKind::ALL.into_iter().flat_map(|k| (0..6).map(move |seed| (k, seed))) {
        let mut m = measure(&truth, &Instrument::default(), &Scan::InPlane { step_deg: 4.0 }, seed);
        add_outliers(&mut m, Outliers::OneSided(0.05), &mut draws(seed));
        let model = options("lambert+phong+phong");
        let got = solved(&m, &FitOptions { robust: robust(kind), per_channel: true, loss: Loss::L2, ..model });
        let of = |lobe: usize, c: usize| got.lobes[lobe].shape_of(c).expect("a shape")[0];
        assert!((0..3).all(|c| of(1, c) < of(2, c)), "{kind:?} {seed}: {:?}", got.lobes);
    }
}

/// An outlier's own cost is no model's fault.
#[test]
fn one_huge_value_does_not_choose_the_model() {
    for kind in RobustKind::ALL {
        for value in [None, Some(1e3), Some(1e16), Some(9.9e37)] {
            let mut m = leaning(11, 0.0);
            m.values[30] = value.unwrap_or(m.values[30]);
            let got = fit_best_model(&m, &FitOptions { robust: robust(kind), ..options("lambert") }).expect("a fit");
            let choice = record(&got.material).choice.as_ref().expect("a choice");
            assert_eq!(choice.chosen, "lambert+phong", "{kind:?} {value:?}: {choice:?}");
        }
    }
}

/// One incidence, whose mirror direction a single reading looks into: a spike there fits it exactly.
#[test]
fn one_huge_value_in_a_lone_mirror_direction_is_no_lobe() {
    let rng = &mut draws(7);
    let mut m = in_plane(&material(&[0.2], &[0.1], 30.0), &[40.0], 75);
    m.values.iter_mut().for_each(|v| *v += NOISE * normal(rng));
    let peak = (0..m.len()).find(|&i| (m.directions.pair(i).1 - towards(40.0)).length() < 1e-12).expect("a peak");
    for kind in RobustKind::ALL {
        let o = FitOptions { robust: robust(kind), ..options("lambert+phong") };
        for value in [1e6, 1e12, 1e16, 1e30, 1e100] {
            m.values[peak] = value;
            let got = solved(&m, &o);
            println!("{kind:?} {value:e}: n {}", exponent(&got, 1));
            assert!(rel(exponent(&got, 1), 30.0) < 0.3, "{kind:?} {value:e}: {:?}", parameters(&got));
        }
    }
}

/// A detector that shows no negative readings: of a lobe before a black ground most are 0.
#[test]
fn a_lobe_before_a_ground_that_is_clipped_to_0_is_found() {
    for (seed, n) in (0..20).flat_map(|seed| [30.0, 200.0].map(|n| (seed, n))) {
        let rng = &mut draws(seed);
        let mut m = exact(&material(&[0.0], &[0.3], n), &HEMISPHERE(10.0));
        m.values.iter_mut().for_each(|v| *v = (*v + NOISE * normal(rng)).max(0.0));
        let zeros = m.values.iter().filter(|v| **v == 0.0).count();
        for kind in RobustKind::ALL {
            let got = solved(&m, &FitOptions { robust: robust(kind), ..options("lambert+phong") });
            let weight = got.lobes[1].weight[0];
            assert!(
                rel(weight, 0.3) < 0.1 && rel(exponent(&got, 1), n) < 0.1,
                "{kind:?} seed {seed}, {zeros} of {} zero: {:?}",
                m.len(),
                parameters(&got)
            );
        }
    }
}

/// Of forty readings twenty-eight are exactly 0: a diffuse fit's residuals ask for no scale at all.
#[test]
fn a_scale_of_nothing_settles_at_rounding() {
    let mut m = exact(&material(&[0.3], &[0.0], 1.0), &Scan::InPlane { step_deg: 20.0 });
    for (i, v) in m.values.iter_mut().enumerate() {
        *v = if i % 10 < 7 { 0.0 } else { 0.1 + 0.05 * (i as f64).sqrt() };
    }
    for kind in RobustKind::ALL {
        let got = solved(&m, &FitOptions { robust: robust(kind), loss: Loss::L2, ..options("lambert") });
        let r = record(&got);
        println!("{kind:?}: {:?} at {:?}", parameters(&got), r.robust_scale);
        assert!(!r.warnings.iter().any(|w| w.contains("settled")), "{:?}", r.warnings);
        assert!((1e-15..1e-11).contains(&r.robust_scale[0]) && got.lobes[0].weight[0].abs() < 1e-10, "{r:?}");
    }
}

/// More parameters than are descended in together.
#[test]
fn many_channels_of_a_diffuse_surface_keep_their_values() {
    let rng = &mut draws(3);
    let directions = Scan::InPlane { step_deg: 30.0 }.directions().expect("small").0;
    let n = directions.len();
    let names: Vec<String> = (0..61).map(|c| format!("{}nm", 400 + 5 * c)).collect();
    let level = |c: usize| (0.9 + 0.001 * c as f64) / std::f64::consts::PI;
    let values = (0..61 * n).map(|i| level(i / n) * (1.0 + 0.01 * normal(rng))).collect();
    let m = Measurement::new("white", directions, names, values);
    for kind in RobustKind::ALL {
        let got = solved(&m, &FitOptions { robust: robust(kind), loss: Loss::L2, ..options("lambert") });
        for (c, w) in got.lobes[0].weight.iter().enumerate() {
            assert!(rel(*w, level(c) * std::f64::consts::PI) < 0.02, "{kind:?} channel {c}: {w}");
        }
    }
}

/// Without a shape to search for, too, what is redrawn is fitted anew.
#[test]
fn a_diffuse_fit_s_bootstrap_scatters_by_its_standard_error() {
    let m = measure(&material(&[0.3], &[0.0], 1.0), &Instrument::default(), &HEMISPHERE(15.0), 4);
    for (loss, robust) in [(Loss::Log, None), (Loss::CubeRoot, None), (Loss::CosineL2, robust(RobustKind::Huber))] {
        let bootstrap = Some(Bootstrap { replicates: 200, seed: 5 });
        let got = solved(&m, &FitOptions { loss, robust, bootstrap, ..options("lambert") });
        let redrawn = record(&got).bootstrap.as_ref().expect("a bootstrap").standard_error[0].weight[0];
        let (redrawn, stated) = (redrawn.expect("an error"), errors(&got)[0].expect("an error"));
        println!("{loss:?} {robust:?}: {redrawn:e}, {stated:e}");
        assert!(rel(redrawn, stated) < 0.3, "{loss:?} {robust:?}: {redrawn:e}, {stated:e}");
    }
}

#[test]
fn a_robust_search_says_how_many_starts_ended_where() {
    for kind in RobustKind::ALL {
        let o = FitOptions { robust: robust(kind), ..options("lambert+phong") };
        let got = solved(&leaning(8, 0.2), &o);
        let search = record(&got).search.as_ref().expect("a search");
        println!("{kind:?}: {search:?}");
        assert!(search.starts > 1 && (1..=search.starts).contains(&search.reached), "{search:?}");
        assert!(search.minima >= 1 && search.reached + search.minima <= search.starts + 1, "{search:?}");
    }
}

/// Values that the model can't follow are outliers of a robust fit, and told from stray readings by standing side by side.
#[test]
fn outliers_that_stand_side_by_side_are_told_from_stray_ones() {
    let said = |m: &Measurement, kind: RobustKind, model: &str| {
        let o = FitOptions { robust: Some(Robust { kind, scale: kind.default_scale() }), ..options(model) };
        record(&solved(m, &o)).warnings.iter().any(|w| w.contains("side by side"))
    };
    let instrument = Instrument { electrons: 1e6, ..Instrument::default() };
    let lobe = measure(&material(&[0.2], &[0.1], 30.0), &instrument, &HEMISPHERE(10.0), 1);
    for kind in RobustKind::ALL {
        assert!(said(&lobe, kind, "lambert"), "{kind:?}");
        assert!(!said(&lobe, kind, "lambert+phong"), "{kind:?}");
        for seed in 0..30 {
            assert!(!said(&leaning(seed, 0.05 + 0.01 * (seed % 20) as f64), kind, "lambert+phong"), "{kind:?} {seed}");
            assert!(!said(&spoilt(seed), kind, "lambert+phong"), "{kind:?} {seed}");
        }
    }
}
