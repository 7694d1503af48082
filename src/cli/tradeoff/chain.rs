//! `goniofit tradeoff chain`.

use std::fmt::Write as _;
use std::time::Duration;

use serde_json::json;

use super::print::{filled, time};
use super::{Common, advice::short, simulate};
use crate::brdf::ModelSpec;
use crate::chain::{Source, Stage};
use crate::cli::failure::Failure;
use crate::cli::fit::parse_time;
use crate::cli::render::parse_size;
use crate::cli::simulation::{Plan, What};
use crate::cli::text::{command, option};
use crate::cli::ui::Ui;
use crate::gonio::Scan;
use crate::gonio::sight::Cones;
use crate::measurement::Dimension;
use crate::tradeoff::chain::{ChainSweep, Share, TOLD, sweep};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit tradeoff chain --material glossy-paint --instrument commercial --scan in-plane:5 --budget 1h,4h
  goniofit tradeoff chain lab.toml --material gold.json --scene cornell --out tradeoff/")]
pub(super) struct Args {
    #[command(flatten)]
    what: What,
    /// Times of instrument and computer together (30m, 2h) [default: four from the least to the most of what is swept]
    #[arg(long, value_delimiter = ',', value_name = "T,T,…", value_parser = parse_time)]
    budget: Vec<Duration>,
    /// What is fitted [default: the material's own model]
    #[arg(long, value_name = "SPEC")]
    model: Option<ModelSpec>,
    /// A built-in scene (see `goniofit scenes`)
    #[arg(long, value_name = "NAME", default_value = "sphere-on-plane")]
    scene: String,
    /// Size of the pictures in pixels
    #[arg(long, value_parser = parse_size, value_name = "SIZE", default_value = "64")]
    size: (u32, u32),
    /// Readings averaged at each pair of directions
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", default_value = "1,2,4,8,16,32", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    average: Vec<u32>,
    /// Every how many-th pair of directions to fit
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", default_value = "1,2,5", value_parser = clap::value_parser!(u32).range(1..))]
    strides: Vec<u32>,
    /// Samples per pixel
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", default_value = "4,16,64,256,1024", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    samples: Vec<u32>,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    args.common.prepare(&TOLD, &args.what.inputs())?;
    let plan = Plan::new(&args.what, None)?;
    let (source, name) = plan.load()?;
    let Source::Fitted(material) = &source else {
        return Err(Failure::usage(format!(
            "--material {}: expected a material, built in or fitted, whose parameters are known; found a measurement",
            plan.material
        )));
    };
    if matches!(plan.scan, Scan::Adaptive { .. }) {
        return Err(Failure::usage("--scan adaptive: expected a scan that is the same for all settings"));
    }
    let own = material.model().parse().map_err(|e: crate::brdf::SpecError| Failure::usage(e.to_string()))?;
    let stage = Stage::built_in(&args.scene)?;
    let mut budgets: Vec<f64> = args.budget.iter().map(Duration::as_secs_f64).collect();
    budgets.sort_by(f64::total_cmp);
    let what = ChainSweep {
        material,
        name: &name,
        instrument: &plan.instrument,
        scan: &plan.scan,
        model: args.model.clone().unwrap_or(own),
        stage: &stage,
        size: args.size,
        readings: args.average.clone(),
        strides: args.strides.iter().map(|s| *s as usize).collect(),
        samples: args.samples.clone(),
        budgets,
    };
    let (mut found, shares) = sweep(&what, &args.common.effort(plan.seed, ui), ui.control())?;
    found.commands = base(args, &plan, &what);
    args.common.finish(&found, Some((text(&shares), json!(shares))), ui)
}

/// The commands that a setting's options go with, one each: what is swept is measured, fitted and rendered.
fn base(args: &Args, plan: &Plan, what: &ChainSweep<'_>) -> Vec<Vec<String>> {
    let spec = || args.what.spec.as_ref().map(|spec| spec.display().to_string());
    // Through an instrument of points a fit is the plain one.
    let is_seen = plan.scan.dimension() == Dimension::Space && Cones::of(&plan.instrument).is_some();
    let through = args.what.instrument.clone().or_else(spec).filter(|_| is_seen);
    let model = option("model", Some(&what.model));
    let (width, height) = what.size;
    let picture = [
        option("scene", Some(&args.scene)),
        option("material", Some("OUT.json")),
        option("size", Some(format!("{width}x{height}"))),
        option("seed", Some(plan.seed)),
        option("out", Some("OUT.exr")),
    ];
    vec![
        simulate::base(&args.what, plan),
        command(&["goniofit", "fit", "OUT.csv"], [model, option("through", through), option("out", Some("OUT.json"))]),
        command(&["goniofit", "render"], picture),
    ]
}

/// How each budget is shared out, and what the next second buys.
fn text(shares: &[Share]) -> String {
    let mut text = String::new();
    for share in shares {
        let (data, pixels) = (share.from_data.powi(2), share.from_pixels.powi(2));
        let percent = |part: f64| format!("{:.0} %", 100.0 * part / (data + pixels));
        let _ = write!(
            text,
            "\n{} in all: {}\n{}{}",
            time(share.budget_s),
            share.typed(),
            filled(
                &format!(
                    "  instrument {}, fit {}, picture {}",
                    time(share.instrument_s),
                    time(share.fit_s),
                    time(share.render_s)
                ),
                2
            ),
            filled(
                &format!(
                    "  image {} predicted{}; of its square {} from readings and fit, {} from pixels",
                    short(share.predicted()),
                    share.measured.map_or(String::new(), |m| format!(
                        ", {} measured ({} to {})",
                        short(m.value),
                        short(m.low),
                        short(m.high)
                    )),
                    percent(data),
                    percent(pixels)
                ),
                2
            )
        );
        text.push_str(&next(share));
    }
    text
}

/// What one more of each would buy.
fn next(share: &Share) -> String {
    let mut text = String::new();
    let buys = share.next.iter().filter(|next| next.gain > 0.0);
    for (k, next) in buys.enumerate() {
        let lead = if k == 0 { "  the next second buys most by" } else { "                           then" };
        let (gain, time) = (100.0 * next.gain, signed(next.seconds));
        let _ = writeln!(text, "{lead} {}: {gain:.1} % less error for {time}", next.step);
    }
    if text.is_empty() { "  no larger setting that was tried lowers the error\n".into() } else { text }
}

fn signed(seconds: f64) -> String {
    if seconds < 0.0 { format!("{} less", time(-seconds)) } else { time(seconds) }
}
