//! `goniofit tradeoff simulate`.

use super::{Common, parse_positive, parse_step};
use crate::cli::failure::Failure;
use crate::cli::fit::parse_tolerance;
use crate::cli::simulation::{Plan, What};
use crate::cli::text::{command, option};
use crate::cli::ui::Ui;
use crate::gonio::{self, MOST_ORDER, Scan};
use crate::tradeoff::simulate::{SimulateSweep, TOLD, sweep};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit tradeoff simulate lab.toml --material satin --out tradeoff/
  goniofit tradeoff simulate --material gold.json --instrument commercial --scan in-plane:5 --advise parameters=1%
  goniofit tradeoff simulate lab.toml --material satin --knobs readings,step --steps 10,5,2.5")]
pub(super) struct Args {
    #[command(flatten)]
    what: What,
    /// What to turn: readings, exposure and step take the instrument's time, quadrature, order and effects the computer's
    #[arg(long, value_delimiter = ',', value_name = "KNOB,…", default_value = "readings,exposure,step,quadrature,effects", value_parser = parse_knob)]
    knobs: Vec<&'static str>,
    /// Readings averaged at each pair of directions
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", default_value = "1,2,4,8,16,32", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    average: Vec<u32>,
    /// Exposures, as multiples of the instrument's
    #[arg(long, value_delimiter = ',', value_name = "X,X,…", default_value = "0.25,0.5,1,2,4", value_parser = parse_positive)]
    exposures: Vec<f64>,
    /// Steps of the scan, degrees, 0.1 to 45
    #[arg(long, value_delimiter = ',', value_name = "DEG,…", default_value = "15,10,7.5,5", value_parser = parse_step)]
    steps: Vec<f64>,
    /// Relative errors that means over cones may have, as by `simulate --target-error`
    #[arg(long, value_delimiter = ',', value_name = "E,E,…", default_value = "0.1,0.01,1e-3,1e-4,1e-6,1e-8", value_parser = parse_tolerance)]
    target_errors: Vec<f64>,
    /// Orders of the rules over cones and spot, for the knob `order`
    #[arg(long, value_delimiter = ',', value_name = "M,M,…", default_value = "1,2,3,4", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_ORDER)))]
    orders: Vec<u32>,
    #[command(flatten)]
    common: Common,
}

const KNOBS: [&str; 6] = ["readings", "exposure", "step", "quadrature", "order", "effects"];

fn parse_knob(text: &str) -> Result<&'static str, String> {
    KNOBS.into_iter().find(|k| *k == text.trim()).ok_or_else(|| format!("known are {}", KNOBS.join(", ")))
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    args.common.prepare(&TOLD, &args.what.inputs())?;
    let plan = Plan::new(&args.what, None)?;
    let (source, name) = plan.load()?;
    if matches!(plan.scan, Scan::Adaptive { .. }) {
        return Err(Failure::usage(
            "--scan adaptive: its directions are chosen anew for each reading; expected a scan that is the same for all settings",
        ));
    }
    let on = |knob: &str| args.knobs.contains(&knob);
    let mut steps = list(on("step"), &args.steps);
    steps.sort_by(|a, b| b.total_cmp(a));
    let has_means = !gonio::means(&plan.instrument, source.channels()).is_empty();
    let mut quadrature = list(on("quadrature") && has_means, &args.target_errors);
    quadrature.sort_by(|a, b| b.total_cmp(a));
    let what = SimulateSweep {
        source: &source,
        name: &name,
        instrument: &plan.instrument,
        scan: &plan.scan,
        quadrature,
        orders: list(on("order") && has_means, &args.orders),
        effects: on("effects"),
        readings: list(on("readings") && plan.instrument.is_noisy(), &args.average),
        dwell: list(on("exposure") && plan.instrument.is_noisy(), &args.exposures),
        steps,
    };
    let mut found = sweep(&what, &args.common.effort(plan.seed, ui), ui.control())?;
    found.commands = vec![base(&args.what, &plan)];
    args.common.finish(&found, None, ui)
}

/// The command that settings go with.
pub(super) fn base(what: &What, plan: &Plan) -> Vec<String> {
    let options = [
        what.spec.iter().map(|spec| spec.display().to_string()).collect(),
        option("material", Some(&plan.material)),
        option("instrument", what.instrument.as_ref()),
        option("electrons", what.electrons),
        option("read-noise", what.read_noise),
        option("readings", what.readings),
        what.noiseless.then(|| "--noiseless".to_owned()).into_iter().collect(),
        option("scan", Some(&plan.scan)),
        option("seed", Some(plan.seed)),
        option("out", Some("OUT.csv")),
    ];
    command(&["goniofit", "simulate"], options)
}

/// The values of a knob that is turned.
fn list<T: Clone>(on: bool, values: &[T]) -> Vec<T> {
    if on { values.to_vec() } else { Vec::new() }
}
