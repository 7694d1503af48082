//! The curves of a sweep, from the file that `tradeoff` wrote.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::{Drawn, FigureArgs};
use crate::cli::failure::Failure;
use crate::report::plot::{Figure, Series};
use crate::report::views::{Sweep, SweepPlot};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  goniofit plot tradeoff out/tradeoff.json --only error-time,error-samples --out curves.svg")]
pub(super) struct Args {
    /// What `goniofit tradeoff … --out DIR` or `--json` wrote
    #[arg(value_name = "tradeoff.json")]
    pub sweep: PathBuf,
    /// The plots to draw, by the names of the files that `tradeoff` writes [default: all]
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    only: Vec<String>,
    #[command(flatten)]
    pub(super) output: FigureArgs,
}

/// The plots that were asked for, side by side.
pub(super) fn curves(args: &Args) -> Result<Drawn, Failure> {
    let file = args.sweep.display();
    let sweep = read(&args.sweep)?;
    let mut plots = sweep.plots();
    if plots.is_empty() {
        return Err(Failure::usage(format!("{file}: expected a curve of two settings or more, found none")));
    }
    let known: Vec<&str> = plots.iter().map(|p| p.name.as_str()).collect();
    if let Some(name) = args.only.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(Failure::usage(format!("--only: expected any of {}, found {name}", known.join(", "))));
    }
    plots.retain(|p| args.only.is_empty() || args.only.contains(&p.name));
    let object = json!({ "plots": plots.iter().map(numbers).collect::<Vec<_>>() });
    if plots.len() == 1 {
        return Ok((plots.swap_remove(0).figure, object));
    }
    let panels: Vec<Figure> = plots.into_iter().map(|p| p.figure).collect();
    Ok((Figure::grid(&panels, 2, &format!("{}: {}", sweep.stage, sweep.subject)), object))
}

fn read(path: &Path) -> Result<Sweep, Failure> {
    let refused = |why: &dyn std::fmt::Display| Failure::usage(format!("{}: {why}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|e| refused(&e))?;
    serde_json::from_str(&text)
        .map_err(|e| refused(&format!("expected the tradeoff.json that `goniofit tradeoff` writes, found {e}")))
}

fn numbers(plot: &SweepPlot) -> Value {
    let curve = |s: &Series| {
        let list =
            |of: &dyn Fn(&crate::report::plot::Point) -> Option<f64>| s.points.iter().map(of).collect::<Vec<_>>();
        json!({
            "name": s.name, "x": list(&|p| Some(p.x)), "y": list(&|p| Some(p.y)),
            "low": list(&|p| p.bar.map(|b| b.0)), "high": list(&|p| p.bar.map(|b| b.1)),
        })
    };
    json!({ "name": plot.name, "curves": plot.series.iter().map(curve).collect::<Vec<_>>() })
}
