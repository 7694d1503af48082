//! Sweeps, advice, and trials of what was advised.
#![allow(dead_code, clippy::expect_used, clippy::panic)] // each file uses a part

use std::time::Instant;

use goniofit::brdf::Material;
use goniofit::chain::{BuiltInMaterial, Source, Stage, measure};
use goniofit::control::Control;
use goniofit::fit::FitOptions;
use goniofit::gonio::{Instrument, Scan};
use goniofit::measurement::Measurement;
use goniofit::tradeoff::chain::ChainSweep;
use goniofit::tradeoff::fit::FitSweep;
use goniofit::tradeoff::render::{RenderSweep, Tables, Way};
use goniofit::tradeoff::simulate::SimulateSweep;
use goniofit::tradeoff::{Advice, Effort, Sweep, Trial, Wish, advise};

/// How often a promise was kept.
#[derive(Debug, Default, Clone, Copy)]
pub struct Kept {
    /// Those that can be judged.
    pub trials: usize,
    pub met: usize,
    /// Mean size that was advised.
    pub size: f64,
    /// Time of all, s.
    pub seconds: f64,
}

/// The sweep with a clock that counts what the knob turns instead of seconds: what is advised for an error then depends on errors alone, and is the same on
/// a slow or busy machine.
fn timed_by_size(mut sweep: Sweep) -> Sweep {
    for point in sweep.curves.iter_mut().flat_map(|c| &mut c.points) {
        let size = point.size.expect("a size");
        point.trials.iter_mut().for_each(|t| t.seconds = size);
    }
    sweep
}

/// Sweeps `sweeps` times, each with another seed, and tries what each advises `trials` times.
fn kept(
    sweeps: u64,
    trials: u32,
    wish: &Wish,
    sweep: impl Fn(u64) -> Sweep,
    again: impl Fn(&Advice, Effort) -> Sweep,
) -> Kept {
    let began = Instant::now();
    let mut kept = Kept::default();
    for seed in 0..sweeps {
        let swept = sweep(seed);
        let swept = if matches!(wish, Wish::Error(..)) { timed_by_size(swept) } else { swept };
        let advice = advise(&swept, wish).unwrap_or_else(|why| panic!("{why}"));
        let effort = Effort { trials, seed: 1_000_000 + seed, deadline: None };
        let found = again(&advice, effort);
        let point = &found.curves[0].points[0];
        let measure = found.measure(advice.measure).expect("a measure");
        let (of, most): (fn(&Trial, usize) -> f64, f64) = match wish {
            Wish::Error(_, most) => (|t, m| t.errors[m], *most),
            Wish::Time(most) => (|t, _| t.seconds, *most),
            Wish::InstrumentTime(_) => panic!("the instrument's time is certain"),
        };
        // One too near to the reference says nothing.
        let told: Vec<f64> = point.trials.iter().map(|t| of(t, measure)).filter(|x| !x.is_nan()).collect();
        kept.trials += told.len();
        kept.met += told.iter().filter(|x| **x <= most).count();
        kept.size += advice.size.unwrap_or(f64::NAN) / sweeps as f64;
    }
    Kept { seconds: began.elapsed().as_secs_f64(), ..kept }
}

fn effort(trials: u32, seed: u64) -> Effort {
    Effort { trials, seed, deadline: None }
}

fn paint() -> Material {
    BuiltInMaterial::find("glossy-paint").expect("built in").material()
}

fn painted(step_deg: f64) -> Measurement {
    let source = Source::Fitted(Box::new(paint()));
    let scan = Scan::Hemisphere { step_deg };
    measure("paint", &source, &Instrument::default(), &scan, 1, Control::silent()).expect("measures")
}

/// `fit --part`, for parameters.
pub fn fit(sweeps: u64, trials: u32, step_deg: f64) -> Kept {
    fit_with(
        sweeps,
        trials,
        step_deg,
        &Wish::Error(Some("parameters".into()), if step_deg > 10.0 { 0.01 } else { 1e-3 }),
    )
}

/// `fit --part`, as wished.
pub fn fit_with(sweeps: u64, trials: u32, step_deg: f64, wish: &Wish) -> Kept {
    let table = painted(step_deg);
    let sweep = |parts: Vec<usize>, effort: Effort| {
        let options = FitOptions::new("lambert+phong".parse().expect("a model"));
        let what = FitSweep { options, parts, strides: vec![], targets: vec![], losses: vec![], models: vec![] };
        goniofit::tradeoff::fit::sweep(&table, &what, &effort, Control::silent()).expect("fits")
    };
    let part = |advice: &Advice| {
        let typed = advice.setting.rsplit(' ').next().expect("a number");
        vec![typed.parse().expect("a number")]
    };
    let parts = if step_deg > 10.0 { vec![13, 9, 7, 5, 3] } else { vec![97, 47, 23, 11, 5] };
    kept(sweeps, trials, wish, |seed| sweep(parts.clone(), effort(8, seed)), |advice, e| sweep(part(advice), e))
}

/// `render --samples`, for an error of at most `error`.
pub fn render(scene: &str, sweeps: u64, trials: u32, side: u32, error: f64) -> Kept {
    render_with(scene, sweeps, trials, side, &Wish::Error(None, error))
}

/// `render --samples`, as wished.
pub fn render_with(scene: &str, sweeps: u64, trials: u32, side: u32, wish: &Wish) -> Kept {
    let stage = Stage::built_in(scene).expect("built in");
    let sweep = |samples: Vec<u32>, reference: u32, effort: Effort| {
        let what = RenderSweep {
            size: (side, side),
            samples,
            targets: vec![],
            ways: vec![Way::Scene],
            reference: Some(reference),
            tables: Tables::default(),
        };
        goniofit::tradeoff::render::sweep(&stage, None, &what, &effort, Control::silent()).expect("renders")
    };
    kept(
        sweeps,
        trials,
        wish,
        |seed| sweep(vec![8, 16, 32, 64, 128, 256], 1024, effort(6, seed)),
        |advice, e| sweep(vec![advice.size.expect("a size") as u32], 1024, e),
    )
}

/// What of a simulated measurement is turned.
#[derive(Debug, Clone, Default)]
struct Turned {
    readings: Vec<u32>,
    dwell: Vec<f64>,
    steps: Vec<f64>,
}

impl Turned {
    /// The setting that was advised, alone.
    fn of(advice: &Advice) -> Self {
        let size = advice.size.expect("a size");
        match &advice.curve[..] {
            "readings averaged" => Self { readings: vec![size as u32], ..Self::default() },
            "exposure" => Self { dwell: vec![size], ..Self::default() },
            _ => {
                let step = advice.setting.rsplit(':').next().expect("a step");
                Self { steps: vec![step.parse().expect("a number")], ..Self::default() }
            }
        }
    }
}

/// `simulate`, for parameters: the quickest of all readings, exposures and steps of the scan.
pub fn simulate(sweeps: u64, trials: u32, step_deg: f64) -> Kept {
    let (source, instrument) =
        (Source::Fitted(Box::new(paint())), Instrument { electrons: 1e4, ..Instrument::default() });
    let sweep = |turned: Turned, effort: Effort| {
        let Turned { readings, dwell, steps } = turned;
        let what = SimulateSweep {
            source: &source,
            name: "paint",
            instrument: &instrument,
            scan: &Scan::Hemisphere { step_deg },
            quadrature: vec![],
            orders: vec![],
            effects: false,
            readings,
            dwell,
            steps,
        };
        goniofit::tradeoff::simulate::sweep(&what, &effort, Control::silent()).expect("measures")
    };
    let wish = Wish::Error(Some("parameters".into()), if step_deg > 10.0 { 2e-3 } else { 5e-4 });
    let all = Turned {
        readings: vec![1, 4, 16, 64],
        dwell: vec![1.0, 4.0, 16.0, 64.0],
        steps: [2.0, 1.5, 1.0, 0.75].map(|k| k * step_deg).to_vec(),
    };
    kept(sweeps, trials, &wish, |seed| sweep(all.clone(), effort(8, seed)), |advice, e| sweep(Turned::of(advice), e))
}

/// `chain`, for the picture: readings, stride and samples as they were shared out.
pub fn chain(sweeps: u64, trials: u32, error: f64) -> Kept {
    let material = paint();
    let instrument = Instrument { electrons: 3e4, ..Instrument::default() };
    let stage = Stage::built_in("sphere").expect("built in");
    let sweep = |readings: Vec<u32>, strides: Vec<usize>, samples: Vec<u32>, effort: Effort| {
        let what = ChainSweep {
            material: &material,
            name: "paint",
            instrument: &instrument,
            scan: &Scan::Hemisphere { step_deg: 15.0 },
            model: "lambert+phong".parse().expect("a model"),
            stage: &stage,
            size: (24, 24),
            readings,
            strides,
            samples,
            budgets: vec![],
        };
        let (mut found, _) = goniofit::tradeoff::chain::sweep(&what, &effort, Control::silent()).expect("goes");
        // The whole comes first.
        found.curves.rotate_right(1);
        found
    };
    kept(
        sweeps,
        trials,
        &Wish::Error(None, error),
        |seed| sweep(vec![1, 4, 16], vec![1, 3], vec![4, 16, 64], effort(8, seed)),
        |advice, e| {
            let number = |option: &str| {
                let mut words = advice.setting.split(' ').skip_while(|word| *word != option);
                words.nth(1).expect("a value").parse::<u32>().expect("a number")
            };
            let stride = number("--stride") as usize;
            sweep(vec![number("--readings")], vec![stride], vec![number("--samples")], e)
        },
    )
}
