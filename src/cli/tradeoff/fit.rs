//! `goniofit tradeoff fit`.

use std::path::PathBuf;

use super::Common;
use crate::brdf::ModelSpec;
use crate::cli::failure::Failure;
use crate::cli::fit::{MODEL, Shared, parse_loss, parse_share};
use crate::cli::info::Reading;
use crate::cli::text::{command, option};
use crate::cli::ui::Ui;
use crate::fit::Loss;
use crate::measurement::formats;
use crate::tradeoff::fit::{FitSweep, TOLD, sweep};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit tradeoff fit gold.binary --out tradeoff/
  goniofit tradeoff fit gold.binary --models lambert,lambert+phong,lambert+phong+phong --losses cosine-l2,log
  goniofit tradeoff fit lab.csv --robust cauchy --through commercial --out tradeoff/
  goniofit tradeoff fit paint.csv --advise excess=1% --advise parameters=1e-3 --advise time=20ms")]
pub(super) struct Args {
    /// The measurement; `-` is stdin
    file: PathBuf,
    /// One of every N entries to fit, spread over the table, as by `fit --part` [default: 1 and, from 7 on, about twice as many each]
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", value_parser = clap::value_parser!(u32).range(1..))]
    parts: Vec<u32>,
    /// Every how many-th entry to fit, as by `fit --stride`: rows of a grid may keep step with it
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", value_parser = clap::value_parser!(u32).range(1..))]
    strides: Vec<u32>,
    /// Shares by which the rmse may exceed the best one, as by `fit --target-rmse-excess`
    #[arg(long, value_delimiter = ',', value_name = "SHARE,…", default_value = "10%,1%,0.1%,0.01%", value_parser = parse_share)]
    targets: Vec<f64>,
    /// Losses to try; the first is the yardstick
    #[arg(long, value_delimiter = ',', value_name = "LOSS,…", default_value = "cosine-l2", value_parser = parse_loss, help_heading = MODEL)]
    losses: Vec<Loss>,
    /// Models to try
    #[arg(long, value_delimiter = ',', value_name = "SPEC,…", default_value = "lambert+phong", help_heading = MODEL)]
    models: Vec<ModelSpec>,
    #[command(flatten)]
    shared: Shared,
    /// Key of all seeds
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    common: Common,
    #[command(flatten, next_help_heading = "Reading")]
    reading: Reading,
}

/// The first step of a part beside the whole, and how each grows into the next.
const FIRST: usize = 7;
const GROWTH: usize = 2;
/// Directions that are left, at least.
const LEAST: usize = 200;

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    args.common.prepare(&TOLD, &[&args.file])?;
    let (Some(model), Some(loss)) = (args.models.first(), args.losses.first()) else {
        return Err(Failure::usage("expected at least one model and one loss"));
    };
    let options = args.shared.options(model.clone(), *loss)?;
    let table = formats::read(&args.file, &args.reading.options())?;
    for note in &table.notes {
        ui.note(&format!("{}: note: {note}", args.file.display()));
    }
    for (option, list) in [("--parts", &args.parts), ("--strides", &args.strides)] {
        if let Some(found) = list.iter().find(|n| **n as usize > table.len()) {
            return Err(Failure::usage(format!(
                "{option}: one of every {found} leaves nothing; {} has {} directions",
                args.file.display(),
                table.len()
            )));
        }
    }
    let mut parts = descending(&args.parts);
    if parts.is_empty() && args.strides.is_empty() {
        parts = usual_parts(table.len());
    }
    let strides = descending(&args.strides);
    let (losses, models) = (args.losses.clone(), args.models.clone());
    let mut targets = args.targets.clone();
    targets.sort_by(|a, b| b.total_cmp(a));
    let what = FitSweep { options, parts, strides, targets, losses, models };
    let mut found = sweep(&table, &what, &args.common.effort(args.seed, ui), ui.control())?;
    found.commands = vec![base(args)];
    args.common.finish(&found, None, ui)
}

/// The command that settings go with: what is the same in all of them.
fn base(args: &Args) -> Vec<String> {
    let model = if let [model] = &args.models[..] { Some(model) } else { None };
    let loss = if let [loss] = &args.losses[..] { Some(loss.name()) } else { None };
    let options = [args.reading.typed(), option("model", model), option("loss", loss), args.shared.typed()];
    command(&["goniofit", "fit", &args.file.to_string_lossy()], options)
}

/// Parts of a table of so many directions that are tried where none are asked for, the smallest first.
fn usual_parts(len: usize) -> Vec<usize> {
    let mut parts: Vec<usize> =
        std::iter::successors(Some(FIRST), |n| Some(n * GROWTH)).take_while(|n| len / n >= LEAST).collect();
    parts.insert(0, 1);
    parts.reverse();
    parts
}

/// The smallest parts first, which are the fastest.
fn descending(list: &[u32]) -> Vec<usize> {
    let mut list: Vec<usize> = list.iter().map(|n| *n as usize).collect();
    list.sort_unstable_by(|a, b| b.cmp(a));
    list.dedup();
    list
}
