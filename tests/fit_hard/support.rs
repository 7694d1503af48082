//! What the tests of the fit share: truths, scans, the record's fields by short names.

use goniofit::brdf::{FitRecord, LobeKind, Material, PerChannel};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, Fitted, Loss, Robust, RobustKind, fit};
use goniofit::gonio::{Instrument, Scan, simulate};
use goniofit::measurement::{Dimension, Directions, Measurement, Weights};
use goniofit::numeric::random::{Purpose, Stream, stream};
use rand_distr::{Distribution, StandardNormal};

pub fn channels(count: usize) -> Vec<String> {
    ["r", "g", "b"][..count].iter().map(|c| (*c).to_owned()).collect()
}

/// Lambert and one Phong lobe.
pub fn material(kd: &[f64], ks: &[f64], n: f64) -> Material {
    let lobes = vec![(LobeKind::Lambert, kd.to_vec(), vec![]), (LobeKind::Phong, ks.to_vec(), vec![n])];
    Material::new(channels(kd.len()), lobes)
}

/// Lambert and several Phong lobes (weight, exponent), one channel.
pub fn lobes(kd: f64, phong: &[(f64, f64)]) -> Material {
    let glossy = phong.iter().map(|(w, n)| (LobeKind::Phong, vec![*w], vec![*n]));
    Material::new(channels(1), std::iter::once((LobeKind::Lambert, vec![kd], vec![])).chain(glossy).collect())
}

pub fn measure(truth: &Material, instrument: &Instrument, scan: &Scan, seed: u64) -> Measurement {
    let value = |wi, wo, out: &mut [f64]| {
        out.copy_from_slice(&truth.value(wi, wo));
        true
    };
    simulate("truth", &value, &truth.channels, instrument, scan, seed, Control::silent()).expect("a scan of usual size")
}

pub fn exact(truth: &Material, scan: &Scan) -> Measurement {
    measure(truth, &Instrument::noiseless(), scan, 1)
}

/// The pairs of a scan for which `keep` holds, as a scan of its own.
pub fn part_of(scan: &Scan, keep: impl Fn(glam::DVec3, glam::DVec3) -> bool) -> Scan {
    let (directions, weights) = scan.directions().expect("a scan of usual size");
    let chosen: Vec<usize> = (0..directions.len())
        .filter(|&i| {
            let (wi, wo) = directions.pair(i);
            keep(wi, wo)
        })
        .collect();
    picked(&directions, &weights, &chosen)
}

/// These entries of a list of directions, in this order, as a scan.
pub fn picked(directions: &Directions, weights: &Weights, chosen: &[usize]) -> Scan {
    let (wi, wo) = chosen.iter().map(|&i| directions.pair(i)).unzip();
    let weights = if weights.known() {
        Weights::SolidAngle(chosen.iter().map(|&i| weights.get(i)).collect())
    } else {
        Weights::Uniform
    };
    Scan::List {
        name: "part".into(),
        directions: Directions::List { wi, wo },
        weights,
        dimension: Dimension::Space,
        rows: vec![],
    }
}

/// r·wo, with r the mirror image of wi about the normal.
pub fn cos_alpha(wi: glam::DVec3, wo: glam::DVec3) -> f64 {
    glam::DVec3::new(-wi.x, -wi.y, wi.z).dot(wo)
}

pub const HEMISPHERE: fn(f64) -> Scan = |step_deg| Scan::Hemisphere { step_deg };

pub fn options(model: &str) -> FitOptions {
    FitOptions::new(model.parse().expect("a model"))
}

#[allow(clippy::unnecessary_wraps)] // as the option wants it
pub fn robust(kind: RobustKind) -> Option<Robust> {
    Some(Robust { kind, scale: kind.default_scale() })
}

/// No robust loss, and each of them.
pub fn robusts() -> [Option<Robust>; 3] {
    [None, robust(RobustKind::Huber), robust(RobustKind::Cauchy)]
}

/// Losses with robust losses that meet each loss and each robust loss: all pairs for one glossy lobe, fewer for more, which take long.
pub fn combinations(model: &str, losses: &[Loss]) -> Vec<(Loss, Option<Robust>)> {
    let few = [
        (Loss::L2, robust(RobustKind::Cauchy)),
        (Loss::CosineL2, None),
        (Loss::CosineL2, robust(RobustKind::Huber)),
        (Loss::Log, None),
        (Loss::CubeRoot, robust(RobustKind::Huber)),
        (Loss::Relative, None),
        (Loss::Relative, robust(RobustKind::Cauchy)),
    ];
    let all = losses.iter().flat_map(|loss| robusts().map(|robust| (*loss, robust)));
    all.filter(|pair| model.matches("phong").count() < 2 || few.contains(pair)).collect()
}

pub const HOMOGENEOUS: [Loss; 4] = [Loss::L2, Loss::CosineL2, Loss::CubeRoot, Loss::Relative];

pub fn fitted(m: &Measurement, o: &FitOptions) -> Fitted {
    fit(m, o).unwrap_or_else(|e| panic!("{e}"))
}

/// A fit, written and read back: no number in it may be one that a file has no form for.
pub fn solved(m: &Measurement, o: &FitOptions) -> Material {
    let got = fitted(m, o).material;
    let text = got.to_json().expect("json");
    let back = Material::from_json(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert!(back.fit.is_some(), "the record does not read back\n{text}");
    assert_finite(&got);
    got
}

pub fn record(m: &Material) -> &FitRecord {
    m.fit.as_ref().expect("a record")
}

pub fn exponent(m: &Material, lobe: usize) -> f64 {
    m.lobes[lobe].shape_of(0).expect("a shape")[0]
}

pub fn rel(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}

/// Largest relative error of all weights and exponents.
pub fn worst(got: &Material, truth: &Material) -> f64 {
    let mut worst = 0.0f64;
    for (g, t) in got.lobes.iter().zip(&truth.lobes) {
        worst = g.weight.iter().zip(&t.weight).map(|(a, b)| rel(*a, *b)).fold(worst, f64::max);
        for c in 0..t.weight.len() {
            let pairs = t.shape_of(c).expect("a shape");
            match g.shape_of(c) {
                Some(own) => worst = own.iter().zip(&pairs).map(|(a, b)| rel(*a, *b)).fold(worst, f64::max),
                None => return f64::INFINITY,
            }
        }
    }
    worst
}

/// Weights channel by channel, lobe by lobe, then every shape.
pub fn parameters(m: &Material) -> Vec<f64> {
    let weights = (0..m.channels.len()).flat_map(|c| m.lobes.iter().map(move |l| l.weight[c]));
    let shapes = m.lobes.iter().flat_map(|l| l.shape_of(0).unwrap_or_default());
    weights.chain(shapes).collect()
}

/// Standard errors in the order of [`parameters`].
pub fn errors(m: &Material) -> Vec<Option<f64>> {
    flat(m, &record(m).standard_error)
}

/// 95 % intervals in the order of [`parameters`].
pub fn intervals(m: &Material) -> Vec<Option<(f64, f64)>> {
    flat(m, &record(m).interval_95)
}

fn flat<T: Copy>(m: &Material, list: &[goniofit::brdf::LobeRecord<Option<T>>]) -> Vec<Option<T>> {
    let weights = (0..m.channels.len()).flat_map(|c| list.iter().map(move |l| l.weight[c]));
    let shapes = list.iter().flat_map(|l| l.shape.iter().map(|(_, v)| v.get(0).flatten()));
    weights.chain(shapes).collect()
}

/// Every number of a result is finite, every interval holds its value.
pub fn assert_finite(m: &Material) {
    let r = record(m);
    for (l, lobe) in m.lobes.iter().enumerate() {
        assert!(lobe.weight.iter().all(|w| w.is_finite() && *w >= 0.0), "{m:?}");
        for c in 0..m.channels.len() {
            assert!(lobe.shape_of(c).unwrap_or_default().iter().all(|n| n.is_finite() && *n >= 0.0), "{m:?}");
            let error = r.standard_error[l].weight[c];
            assert!(error.is_none_or(|e| e.is_finite() && e >= 0.0), "{m:?}");
            if let Some((low, high)) = r.interval_95[l].weight[c] {
                assert!(low <= lobe.weight[c] && lobe.weight[c] <= high && high.is_finite(), "lobe {l}: {m:?}");
            }
        }
        for (_, list) in &r.standard_error[l].shape {
            let all = match list {
                PerChannel::Shared(e) => vec![*e],
                PerChannel::Each(list) => list.clone(),
            };
            assert!(all.iter().flatten().all(|e| e.is_finite() && *e >= 0.0), "{m:?}");
        }
    }
    for v in [r.cost, r.rmse, r.seconds] {
        assert!(v.is_finite() && v >= 0.0, "{m:?}");
    }
    if let Some(residual) = &r.residual {
        let all = [residual.noise_rmse, residual.model_rmse, residual.structured_share, residual.effective_samples];
        assert!(all.iter().all(|v| v.is_finite() && *v >= 0.0), "{residual:?}");
    }
}

/// What is stated and wrong: parameters with a 95 % interval whose truth lies more than four times as far off as its end (normal errors do that
/// once in 10¹⁴ fits). For an exponent, whose error is even on the logarithmic scale, upwards by the farther of the two scales.
pub fn made_up(got: &Material, truth: &[f64], slack: f64) -> Option<String> {
    let weights = got.channels.len() * got.lobes.len();
    let off = parameters(got).into_iter().zip(intervals(got)).zip(truth).enumerate().any(
        |(i, ((value, interval), truth))| {
            interval.is_some_and(|(low, high)| {
                let slack = slack * truth.abs();
                let ratio = if i >= weights && value > 0.0 { value * (high / value).powi(4) } else { 0.0 };
                let most = f64::max(value + 4.0 * (high - value), ratio);
                *truth < value - 4.0 * (value - low) - slack || *truth > most + slack
            })
        },
    );
    off.then(|| format!("{:?} in {:?}, true {truth:?}", parameters(got), intervals(got)))
}

pub fn assert_nothing_made_up(got: &Material, truth: &[f64], slack: f64, case: &str) {
    let wrong = made_up(got, truth, slack);
    assert!(wrong.is_none(), "{case}: {wrong:?}");
}

pub fn undetermined(m: &Material) -> &[String] {
    &record(m).undetermined
}

pub fn draws(index: u64) -> Stream {
    stream(2026, Purpose::Study, index)
}

pub fn normal(rng: &mut Stream) -> f64 {
    StandardNormal.sample(rng)
}
