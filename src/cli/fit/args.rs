//! What can be typed.

use std::path::PathBuf;
use std::time::Duration;

use crate::brdf::{ModelSpec, SpecError};
use crate::cli::info::Reading;
use crate::fit::Loss;

use super::shared::{MODEL, SAMPLES, Shared};

const EFFORT: &str = "Effort";
const OUTPUT: &str = "Output";

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit fit gold.binary --out gold.json
  goniofit fit *.binary --model lambert+phong --out-dir fits/
  goniofit fit gold.binary --model auto
  goniofit fit lab.csv --use-sigma --robust cauchy
  goniofit fit gold.binary --fix phong.exponent=50 --bound lambert.weight=0..0.3
  goniofit fit satin.csv --through commercial
  goniofit fit gold.binary --target-rmse-excess 1%")]
pub(in crate::cli) struct Args {
    /// Measurements; `-` is stdin
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Lobes joined by +, or `auto` to compare models and take the simplest good one
    #[arg(long, default_value = "lambert+phong", value_name = "SPEC|auto", help_heading = MODEL)]
    pub(super) model: Wanted,
    /// What is minimised; docs/fit.md has the formulas
    #[arg(long, default_value = "cosine-l2", value_parser = parse_loss, value_name = "l2|cosine-l2|log|cuberoot|relative", help_heading = MODEL)]
    pub loss: Loss,
    #[command(flatten)]
    pub shared: Shared,
    /// Use every N-th entry only
    #[arg(long, default_value_t = 1, value_name = "N", help_heading = SAMPLES)]
    pub stride: usize,
    /// Use one of every N entries only, at places that keep step with no grid
    #[arg(long, default_value_t = 1, value_name = "N", conflicts_with_all = ["stride", "time_budget", "target_rmse_excess"], help_heading = SAMPLES)]
    pub part: usize,
    /// Time that the fit may take, bootstrap included, 50ms or 2s say: it uses as many samples, and drawings, as that allows
    #[arg(long, value_name = "TIME", value_parser = parse_time, help_heading = EFFORT)]
    pub time_budget: Option<Duration>,
    /// Stop at a part of the samples once the rmse over all is within this share of the best (1%, say) with 95 % confidence
    #[arg(long, value_name = "SHARE", value_parser = parse_share, allow_hyphen_values = true, help_heading = EFFORT)]
    pub target_rmse_excess: Option<f64>,
    /// Also find standard errors by redrawing the data N times; where a budget or target ends the fit early, the samples it ended with
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000), help_heading = EFFORT)]
    pub bootstrap: Option<u32>,
    /// Seed of the redrawing
    #[arg(long, default_value_t = 0, requires = "bootstrap", value_name = "SEED", help_heading = EFFORT)]
    pub seed: u64,
    /// Where to write the fit of one measurement; `-` is stdout
    #[arg(long, value_name = "FIT.json", conflicts_with = "out_dir", help_heading = OUTPUT)]
    pub out: Option<PathBuf>,
    /// Folder to write the fits of several measurements to, each under its own name
    #[arg(long, value_name = "D", help_heading = OUTPUT)]
    pub out_dir: Option<PathBuf>,
    /// Also write a page about each fit beside it, FIT.html for FIT.json
    #[arg(long, help_heading = OUTPUT)]
    pub report: bool,
    /// Print every step of the search on stderr
    #[arg(long, help_heading = OUTPUT)]
    pub log: bool,
    #[command(flatten, next_help_heading = "Reading")]
    pub reading: Reading,
}

/// A model, or the wish that one be chosen.
#[derive(Debug, Clone)]
pub(super) enum Wanted {
    Auto,
    Model(ModelSpec),
}

impl std::str::FromStr for Wanted {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Model) }
    }
}

pub(in crate::cli) fn parse_loss(text: &str) -> Result<Loss, String> {
    Loss::from_name(text).ok_or_else(|| format!("known are {}", Loss::ALL.map(Loss::name).join(", ")))
}

/// `50ms` or `2s`.
pub(in crate::cli) fn parse_time(text: &str) -> Result<Duration, String> {
    if text.trim() == "0" {
        return Err("expected a time of more than 0, 50ms or 2s say".into());
    }
    match humantime::parse_duration(text) {
        Ok(Duration::ZERO) => Err("expected a time of more than 0, 50ms or 2s say".into()),
        Ok(time) => Ok(time),
        Err(_) => Err("expected a time, 50ms or 2s say".into()),
    }
}

/// A relative tolerance below 1: `1%` or `0.01`.
pub(in crate::cli) fn parse_tolerance(text: &str) -> Result<f64, String> {
    let below_one = parse_share(text).ok().filter(|share| *share < 1.0);
    below_one.ok_or_else(|| "expected a relative tolerance above 0 and below 1, 1% or 0.01 say".into())
}

/// `1%` or `0.01`.
pub(in crate::cli) fn parse_share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    let share: Option<f64> = number.trim().parse().ok().filter(|share: &f64| *share > 0.0 && share.is_finite());
    share.map(|share| share * unit).ok_or_else(|| "expected a positive share, 1% or 0.01 say".into())
}
