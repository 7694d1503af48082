//! The budget against Monte Carlo (GUM Supplement 1): each line is the scatter of readings when its error alone is drawn, the combined standard uncertainty
//! that of all together.

use crate::experiment::{CLASSES, Experiment, sigma};
use goniofit::control::Control;
use goniofit::gonio::{Actual, Job, Reading, Reduction, reduce, series};
use goniofit::numeric::stats::{normal_quantile, sidak};
use rayon::prelude::*;

const DRAWS: u64 = 2000;

/// A line of the budget, and what draws its error alone: the others stay at nothing.
type Line = (&'static str, fn(Actual) -> Actual);

fn lines() -> Vec<Line> {
    vec![
        ("certificate of the reference", |drawn| Actual { certificate: drawn.certificate, ..Actual::nominal() }),
        ("source drift", |drawn| Actual { power: drawn.power, ..Actual::nominal() }),
        ("dark drift", |drawn| Actual { dark: drawn.dark, ..Actual::nominal() }),
        ("nonlinearity", |drawn| Actual { nonlinearity: drawn.nonlinearity, ..Actual::nominal() }),
        ("axis zeros", |drawn| Actual { zeros: drawn.zeros, ..Actual::nominal() }),
        ("sample tilt", |drawn| Actual { tilt: drawn.tilt, ..Actual::nominal() }),
        ("sample height", |drawn| Actual { height_m: drawn.height_m, ..Actual::nominal() }),
    ]
}

/// Effects that draw at every reading.
const NOISE: [&str; 5] = ["shot noise", "read noise", "quantisation", "axis jitter", "saturation"];

/// The values that readings reduce to, draw by draw.
fn values(
    of: &Experiment,
    draw: impl Fn(&[Reading], u64) -> Actual + Sync,
    left_out: &[&str],
    draws: u64,
) -> Vec<Vec<f64>> {
    let entries: Vec<u32> = (0..of.directions.len() as u32).collect();
    let readings = series(&of.described, &of.directions, &entries);
    let one = |seed: u64| {
        of.with_job(seed, |job| {
            let raw = Job { left_out, ..*job }.read(readings.clone(), &draw(&readings, seed), Control::silent());
            reduce("m", &raw, &of.described, None).expect("reduced").measurement.values
        })
    };
    (0..draws).into_par_iter().map(one).collect()
}

/// Standard deviation of every reading about its mean.
fn deviations(runs: &[Vec<f64>]) -> Vec<f64> {
    let count = runs.len() as f64;
    (0..runs[0].len())
        .map(|i| {
            let mean = runs.iter().map(|r| r[i]).sum::<f64>() / count;
            (runs.iter().map(|r| (r[i] - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt()
        })
        .collect()
}

/// Kurtosis of one reading, 3 of a normal one.
fn kurtosis(runs: &[Vec<f64>], i: usize) -> f64 {
    let count = runs.len() as f64;
    let mean = runs.iter().map(|r| r[i]).sum::<f64>() / count;
    let moment = |power: i32| runs.iter().map(|r| (r[i] - mean).powi(power)).sum::<f64>() / count;
    moment(4) / moment(2).powi(2)
}

/// Standard deviation of every reading over draws of one error.
fn scatter(of: &Experiment, draw: impl Fn(&[Reading], u64) -> Actual + Sync, left_out: &[&str]) -> Vec<f64> {
    deviations(&values(of, draw, left_out, DRAWS))
}

/// By how much a line may be off: the standard deviation of 2,000 draws is known to 1.6 %, and the surrogate that slopes come from is fitted to noisy
/// readings.
const OFF: f64 = 0.1;

/// One line of a budget against the scatter of its error alone.
fn compare(name: &str, reduction: &Reduction, line: &str, found: &[f64]) {
    let k = reduction.budget.lines.iter().position(|l| l.name == line).unwrap_or_else(|| panic!("{line} of {name}"));
    let valid = |i: &usize| found[*i].is_finite() && reduction.measurement.value(0, *i).is_some();
    let indices: Vec<usize> = (0..found.len()).filter(valid).collect();
    // Summed up over the scan, as a budget is.
    let rms =
        |of: &dyn Fn(usize) -> f64| (indices.iter().map(|i| of(*i).powi(2)).sum::<f64>() / indices.len() as f64).sqrt();
    let (says, is) = (rms(&|i| reduction.budget.contribution(k, i)), rms(&|i| found[i]));
    println!("{name}, {line}: budget {says:.3e}, Monte Carlo {is:.3e}, {:+.1} %", 100.0 * (says / is - 1.0));
    assert!((says / is - 1.0).abs() < OFF, "{name}, {line}: {says:e} {is:e}");
}

/// Every line of the budget of one instrument, over a glossy material's readings.
fn check(name: &str) {
    let of = Experiment::new(name, CLASSES[1].1);
    let reduction = of.reduced(1);
    for (line, draw) in lines() {
        let found = scatter(&of, |r, seed| draw(Actual::draw(&of.described, r, seed)), &NOISE);
        compare(name, &reduction, line, &found);
    }
    let found = scatter(&of, |_, _| Actual::nominal(), &["shot noise", "read noise", "quantisation"]);
    compare(name, &reduction, "axis jitter", &found);
}

#[test]
fn the_budget_of_a_standards_laboratory_is_what_monte_carlo_finds() {
    check("standards-lab");
}

#[test]
fn the_budget_of_a_commercial_instrument_is_what_monte_carlo_finds() {
    check("commercial");
}

/// A reading's noise and the noise of visits together: nothing but noise is drawn. The classroom's converter has steps wider than its noise, whose rounding
/// is an error that drawing noise anew does not show: there the budget must say more, step²/12 of a reading at most.
#[test]
fn noise_is_what_monte_carlo_finds() {
    for name in ["standards-lab", "commercial", "classroom"] {
        let mut of = Experiment::new(name, CLASSES[1].1);
        // Where axes stop at the reference counts as noise of its readings.
        of.described.axes.jitter_deg = 0.0;
        let reduction = of.reduced(1);
        let noise: Vec<usize> = (0..reduction.budget.lines.len() - 1)
            .filter(|k| reduction.budget.lines[*k].name.starts_with("noise"))
            .collect();
        let found = scatter(&of, |_, _| Actual::nominal(), &[]);
        let (mut says, mut is) = (0.0, 0.0);
        for i in (0..found.len()).filter(|i| found[*i].is_finite() && reduction.measurement.value(0, *i).is_some()) {
            let own: f64 = noise.iter().map(|k| reduction.budget.contribution(*k, i).powi(2)).sum();
            says += own / of.expected(i).powi(2);
            is += (found[i] / of.expected(i)).powi(2);
        }
        let ratio = (says / is).sqrt();
        println!("{name}, noise: budget over Monte Carlo {ratio:.3}");
        let most = if name == "classroom" { 1.3 } else { 1.1 };
        assert!((0.9..most).contains(&ratio), "{name}: {ratio}");
    }
}

/// No built-in instrument has errors of exposure times. The glossy peak is read in a shorter one than the reference, of which the error of both is left;
/// without a reference every reading has its own, and what the electronics add to each no exposure changes.
#[test]
fn errors_of_exposure_times_are_what_monte_carlo_finds() {
    for (name, electrons, reflectance, offset) in
        [("standards-lab", 2e7, 0.99, 0.0), ("standards-lab", 2e7, 0.0, 0.0), ("commercial", 1e6, 0.99, 5e3)]
    {
        let mut of = Experiment::new(name, CLASSES[1].1);
        of.described.electrons = electrons;
        of.described.detector.exposure_u = 5e-3;
        of.described.detector.offset = offset;
        of.described.reference.reflectance = reflectance;
        let draw = |r: &[Reading], seed: u64| Actual {
            exposures: Actual::draw(&of.described, r, seed).exposures,
            ..Actual::nominal()
        };
        let found = scatter(&of, draw, &NOISE);
        compare(name, &of.reduced(1), "exposure times", &found);
    }
}

/// All errors drawn at once (GUM Supplement 1): the standard deviation of each reading is its combined standard uncertainty, and the central 95 % of the
/// draws end at ±1.96 of it. `GONIOFIT_DRAWS=100000` takes as many.
///
/// Of N draws of kurtosis κ a standard deviation scatters by √((κ − 1)/(4N)), which is 1/√(2N) of normal ones, a quantile by √(p(1 − p)/N) over its density,
/// here a normal one's; that one of all that are compared is farther off than allowed has a probability of 1 %. To this comes what a line may be off.
fn check_joint(name: &str) {
    let of = Experiment::new(name, CLASSES[1].1);
    let draws = std::env::var("GONIOFIT_DRAWS").map_or(DRAWS, |count| count.parse().expect("a count"));
    let m = of.reduced(1).measurement;
    let runs = values(&of, |r, seed| Actual::draw(&of.described, r, seed), &[], draws);
    let is_valid = |i: &usize| m.value(0, *i).is_some() && runs.iter().all(|r| r[*i].is_finite());
    let valid: Vec<usize> = (0..m.len()).filter(is_valid).collect();
    assert!(2 * valid.len() > m.len(), "{name}: {} of {}", valid.len(), m.len());
    let (k, count) = (normal_quantile(0.975), draws as f64);
    let z = normal_quantile(1.0 - 0.5 * sidak(0.01, 3 * valid.len()));
    let density = (-0.5 * k * k).exp() / std::f64::consts::TAU.sqrt();
    let of_sigma = |kurtosis: f64| OFF + z * ((kurtosis - 1.0) / (4.0 * count)).sqrt();
    let of_end = OFF + z * (0.025 * 0.975 / count).sqrt() / density / k;
    let deviations = deviations(&runs);
    let mut ratios = Vec::new();
    for i in valid {
        let (truth, stated) = (of.expected(i), sigma(&m, i));
        let of_sigma = of_sigma(kurtosis(&runs, i));
        let mut errors: Vec<f64> = runs.iter().map(|r| r[i] - truth).collect();
        errors.sort_by(f64::total_cmp);
        let end = |p: f64| errors[(p * count) as usize] / (k * stated);
        let found = [deviations[i] / stated, -end(0.025), end(0.975)];
        let fine = (found[0] - 1.0).abs() < of_sigma && found[1..].iter().all(|end| (end - 1.0).abs() < of_end);
        assert!(fine, "{name}, reading {i}: {found:?}, allowed {of_sigma} and {of_end}");
        ratios.push(found);
    }
    let range = |k: usize| {
        let all = || ratios.iter().map(|r| r[k]);
        (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max))
    };
    let [deviation, lower, upper] = [0, 1, 2].map(range);
    println!(
        "{name}, {draws} draws, {} readings: over what is stated, standard deviations {deviation:.3?}, ends of 95 % {lower:.3?} and {upper:.3?}",
        ratios.len()
    );
}

#[test]
fn all_errors_of_a_standards_laboratory_together_are_what_monte_carlo_finds() {
    check_joint("standards-lab");
}

#[test]
fn all_errors_of_a_commercial_instrument_together_are_what_monte_carlo_finds() {
    check_joint("commercial");
}
