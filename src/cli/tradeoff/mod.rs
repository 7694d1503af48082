//! `goniofit tradeoff`: what accuracy costs in time, for the fit, the picture, the simulated measurement and the whole chain.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::failure::Failure;
use super::fit::parse_time;
use super::output::{keeps_inputs, make_folder};
use super::report::made;
use super::ui::{self, Ui};
use crate::report::run::SWEEP;
use crate::tradeoff::{Effort, Sweep};

mod advice;
mod chain;
mod fit;
mod print;
mod render;
mod simulate;
mod write;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit tradeoff fit gold.binary --out tradeoff/
  goniofit tradeoff render --scene cornell --material gold.json --advise error=2%
  goniofit tradeoff simulate lab.toml --material satin --advise instrument=30m
  goniofit tradeoff chain --material gold.json --instrument commercial --budget 2h")]
pub(super) struct Args {
    #[command(subcommand)]
    stage: Stage,
}

#[derive(Debug, clap::Subcommand)]
enum Stage {
    /// Samples used, loss, model: against excess rmse, parameters, picture
    Fit(fit::Args),
    /// Samples, plan of effects, depth, how lights are found, resolution of a table: against error, noise, bias, ꟻLIP
    Render(render::Args),
    /// Quadratures and effects in the computer's time; readings, exposure, step in the instrument's
    Simulate(simulate::Args),
    /// The whole chain: where does the next second buy most?
    Chain(chain::Args),
}

/// What all stages take.
#[derive(Debug, clap::Args)]
struct Common {
    /// Trials of each setting, each with a seed of its own
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    trials: u32,
    /// Time for all of it, references too (30s, 5m): a trial is not begun where earlier ones say that it would end too late, and one that still runs
    /// then does not count
    #[arg(long, value_name = "T", value_parser = parse_time)]
    time_budget: Option<Duration>,
    /// The setting for a wanted error (error=1e-3, flip=0.01, …), time (time=2s) or time of the instrument (instrument=30m), with 95 % confidence; may
    /// be repeated
    #[arg(long, value_name = "NAME=X", value_parser = advice::parse)]
    advise: Vec<advice::Asked>,
    /// Folder to write tradeoff.csv, tradeoff.json and the plots to
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Common {
    fn effort(&self, seed: u64, ui: &Ui) -> Effort {
        let deadline = self.time_budget.map(|time| ui.start() + time);
        Effort { trials: self.trials, seed, deadline }
    }

    /// What can be known to be wrong before long work starts: errors that no trial of the stage tells, outputs that are inputs. Makes the folder for outputs.
    fn prepare(&self, told: &[&str], inputs: &[&Path]) -> Result<(), Failure> {
        self.advise.iter().try_for_each(|asked| asked.is_told(told))?;
        let Some(folder) = &self.out else { return Ok(()) };
        for name in [write::TABLE, SWEEP] {
            keeps_inputs("--out", &folder.join(name), inputs.iter().copied())?;
        }
        make_folder("--out", folder)
    }

    /// Says and writes what was found.
    fn finish(&self, sweep: &Sweep, more: Option<(String, serde_json::Value)>, ui: &Ui) -> Result<(), Failure> {
        if sweep.curves.is_empty() {
            return Err(match &sweep.ended {
                _ if ui::stop().requested() => {
                    Failure::stopped("stopped before the first trial was over: nothing is written")
                }
                Some(why) => {
                    Failure::work(format!("no trial was made: {why}; give more time, or fewer or smaller settings"))
                }
                None => Failure::work("nothing to try: what was swept has none of what these knobs turn"),
            });
        }
        let advice = advice::all(&self.advise, sweep);
        let mut object = serde_json::to_value(sweep).map_err(|e| Failure::work(e.to_string()))?;
        object["run"] = made();
        object["advice"] = advice::json(&advice, sweep);
        let mut text = print::text(sweep);
        if let Some((said, found)) = more {
            text.push_str(&said);
            object["chain"] = found;
        }
        text.push_str(&advice::text(&advice, sweep));
        if let Some(folder) = &self.out {
            let written = write::all(folder, sweep, &object)?;
            text.push_str(&print::filled(&format!("\nwritten to {}: {}", folder.display(), written.join(", ")), 2));
        }
        if let Some(why) = &sweep.ended {
            ui.warn(&format!("{why}: some settings have fewer than {} trials, or none", sweep.trials));
        }
        let unmet: Vec<String> =
            advice.iter().filter_map(|(_, found)| found.as_ref().err().map(ToString::to_string)).collect();
        if !unmet.is_empty() {
            return Err(Failure::work(unmet.join("; ")).beside(text, object));
        }
        ui.result(&text, &object);
        Ok(())
    }
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    match &args.stage {
        Stage::Fit(args) => fit::run(args, ui),
        Stage::Render(args) => render::run(args, ui),
        Stage::Simulate(args) => simulate::run(args, ui),
        Stage::Chain(args) => chain::run(args, ui),
    }
}

/// A step of a scan, degrees, from a list.
fn parse_step(text: &str) -> Result<f64, String> {
    parse_positive(text)
        .ok()
        .filter(|step| (0.1..=45.0).contains(step))
        .ok_or_else(|| "expected steps from 0.1 to 45 degrees".into())
}

/// A number above 0 and finite, from a list.
fn parse_positive(text: &str) -> Result<f64, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|x: &f64| *x > 0.0 && x.is_finite())
        .ok_or_else(|| "expected numbers above 0".into())
}
