//! The files of a sweep.

use std::path::Path;

use serde_json::Value;

use crate::cli::failure::Failure;
use crate::cli::output::{write_bytes, write_json, write_text};
use crate::report::run::{Made, SWEEP};
use crate::report::{typed, views};
use crate::tradeoff::{Sweep, to_csv};

/// The trials' numbers, a row a setting.
pub(super) const TABLE: &str = "tradeoff.csv";
/// Width of the PNG plots, pixels.
const PIXELS: u32 = 1200;

/// Writes everything, and returns the files' names.
pub(super) fn all(folder: &Path, sweep: &Sweep, object: &Value) -> Result<Vec<String>, Failure> {
    write_text(&folder.join(TABLE), &table(sweep, &Made::of(&object["run"])))?;
    write_json(&folder.join(SWEEP), object)?;
    let mut names = vec![TABLE.to_owned(), SWEEP.to_owned()];
    let drawn: views::Sweep = serde_json::from_value(object.clone()).map_err(|e| Failure::work(e.to_string()))?;
    for plot in drawn.plots() {
        let png = plot.figure.to_png(PIXELS).map_err(|e| Failure::work(format!("{}: {e}", plot.name)))?;
        write_text(&folder.join(format!("{}.svg", plot.name)), &(plot.figure.to_svg() + "\n"))?;
        write_bytes(&folder.join(format!("{}.png", plot.name)), &png)?;
        names.push(format!("{}.svg and .png", plot.name));
    }
    Ok(names)
}

/// The sweep as CSV, below the program and the command that made it.
fn table(sweep: &Sweep, made: &Made) -> String {
    let program = made.program.as_deref().unwrap_or_default();
    format!("# {program}: {}\n{}", typed(&made.command), to_csv(sweep))
}
