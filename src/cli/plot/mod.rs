//! `goniofit plot`: one figure as SVG or PNG, in the style that papers use.

mod kinds;
mod subject;
mod tradeoff;

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::failure::Failure;
use super::info::Reading;
use super::output::{check_folder, keeps_inputs, stdout_is_free, write_bytes};
use super::ui::Ui;
use crate::report::plot::Figure;
use kinds::{CurveArgs, ResidualArgs};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit plot polar gold.binary gold.json --incidence 15,45,75 --out lobes.svg
  goniofit plot slice lab.csv lab.json --incidence 30 --log --out slice.png
  goniofit plot residuals lab.csv lab.json --out residuals.svg
  goniofit plot coverage lab.csv --out coverage.svg
  goniofit plot tradeoff out/tradeoff.json --out curves.svg")]
pub(super) struct Args {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Debug, clap::Subcommand)]
enum Kind {
    /// Lobes in the plane of incidence: the longer a ray, the more is reflected that way
    Polar(CurveArgs),
    /// Reflectance over θo in the plane of incidence
    Slice(CurveArgs),
    /// Residuals of a fit over θh and θd, and over θi and θo
    Residuals(ResidualArgs),
    /// Where on the hemisphere readings were taken
    Coverage(CoverageArgs),
    /// What accuracy costs in time: the curves of a sweep
    Tradeoff(tradeoff::Args),
}

/// Where a figure of a measurement goes, and how that is read.
#[derive(Debug, Clone, clap::Args)]
struct OutputArgs {
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten, next_help_heading = "Reading")]
    reading: Reading,
}

/// Where a figure goes.
#[derive(Debug, Clone, clap::Args)]
struct FigureArgs {
    /// Where to write the figure: .svg or .png
    #[arg(long, value_name = "FIGURE.svg|png")]
    out: PathBuf,
    /// Width of a PNG, pixels [default: three for each of the drawing's own]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(16..=20_000))]
    width: Option<u32>,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit plot coverage lab.csv --out coverage.svg")]
struct CoverageArgs {
    /// The measurement
    measurement: PathBuf,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let (output, inputs): (_, Vec<&Path>) = match &args.kind {
        Kind::Polar(a) | Kind::Slice(a) => (&a.output.figure, a.files.iter().map(Path::new).collect()),
        Kind::Residuals(a) => (&a.output.figure, vec![&a.measurement, Path::new(&a.fit)]),
        Kind::Coverage(a) => (&a.output.figure, vec![&a.measurement]),
        Kind::Tradeoff(a) => (&a.output, vec![&a.sweep]),
    };
    output.check(&inputs, ui)?;
    let (figure, mut object) = match &args.kind {
        Kind::Polar(a) => kinds::curves(a, true, ui)?,
        Kind::Slice(a) => kinds::curves(a, false, ui)?,
        Kind::Residuals(a) => kinds::residuals(a, ui)?,
        Kind::Coverage(a) => kinds::coverage(&a.measurement, &a.output.reading)?,
        Kind::Tradeoff(a) => tradeoff::curves(a)?,
    };
    output.write(&figure)?;
    object["out"] = json!(output.out);
    let said =
        if output.out == Path::new("-") { String::new() } else { format!("written to {}", output.out.display()) };
    ui.result(&said, &object);
    Ok(())
}

/// A figure, and the numbers in it.
type Drawn = (Figure, Value);

impl FigureArgs {
    /// Before anything is read: the name says a format, and the figure destroys no input.
    fn check(&self, inputs: &[&Path], ui: &Ui) -> Result<(), Failure> {
        stdout_is_free(&self.out, ui)?;
        self.is_png()?;
        keeps_inputs("--out", &self.out, inputs.iter().copied())?;
        check_folder(&self.out)
    }

    /// Whether a PNG is asked for; SVG on stdout.
    fn is_png(&self) -> Result<bool, Failure> {
        let extension = self.out.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(true),
            Some("svg") => Ok(false),
            None if self.out == Path::new("-") => Ok(false),
            _ => Err(Failure::usage(format!(
                "--out: expected a name that ends in .svg or .png, or -, found {}",
                self.out.display()
            ))),
        }
    }

    fn write(&self, figure: &Figure) -> Result<(), Failure> {
        if !self.is_png()? {
            return write_bytes(&self.out, (figure.to_svg() + "\n").as_bytes());
        }
        let width = self.width.unwrap_or((3.0 * figure.size().0) as u32);
        let png = figure.to_png(width).map_err(|e| Failure::work(format!("{}: {e}", self.out.display())))?;
        write_bytes(&self.out, &png)
    }
}
