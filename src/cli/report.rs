//! `goniofit report`: what a run found, as one HTML page; and `--report` of the commands that make runs.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::failure::Failure;
use super::info::Reading;
use super::output::{check_folder, keeps_inputs, stdout_is_free, write_bytes};
use super::ui::Ui;
use crate::report::run::{Made, ReportError, Run, RunOptions};
use crate::report::{Written, page};

/// The page's name in a run's folder.
const NAME: &str = "report.html";

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit report out/demo
  goniofit report tradeoff/
  goniofit report gold/ --measurement gold.binary --out gold.html")]
pub(super) struct Args {
    /// The folder that demo, validate, fit --out-dir or tradeoff --out wrote to
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The measurement, where it is not where the folder's files say
    #[arg(long, value_name = "FILE")]
    measurement: Option<PathBuf>,
    /// Where to write the page; `-` is stdout [default: report.html in DIR]
    #[arg(long, value_name = "PAGE.html")]
    out: Option<PathBuf>,
    #[command(flatten, next_help_heading = "Reading")]
    reading: Reading,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let out = args.out.clone().unwrap_or_else(|| args.folder.join(NAME));
    stdout_is_free(&out, ui)?;
    let inputs = inputs(&args.folder, args.measurement.as_deref());
    keeps_inputs("--out", &out, inputs.iter().map(PathBuf::as_path))?;
    is_page(&out)?;
    let options = RunOptions { measurement: args.measurement.clone(), reading: args.reading.options() };
    let run = Run::read(&args.folder, &options)?;
    // Measurement and fits may lie anywhere.
    let table = run.table.as_ref().ok().map(|table| table.path.as_path());
    keeps_inputs("--out", &out, table.into_iter().chain(run.fits.iter().map(|fit| Path::new(&fit.file))))?;
    check_folder(&out)?;
    let written = write(&run, &out)?;
    for note in &run.notes {
        ui.warn(note);
    }
    for missing in &written.missing {
        ui.note(&format!("not in the report: {missing}"));
    }
    let size = written.html.len();
    let object = json!({
        "out": out, "bytes": size, "missing": written.missing, "warnings": written.warnings, "notes": run.notes,
        "fits": run.fits.iter().map(|f| &f.label).collect::<Vec<_>>(), "pictures": run.pictures.len(),
    });
    let said = format!("{} ({}): open it in any browser", out.display(), size_of(size));
    ui.result(if out == Path::new("-") { "" } else { &said }, &object);
    Ok(())
}

/// Bytes as people read them.
fn size_of(bytes: usize) -> String {
    match bytes as f64 {
        few if few < 1e5 => format!("{:.0} kB", few / 1e3),
        many => format!("{:.1} MB", many / 1e6),
    }
}

/// Files that a page may be made of: the measurement, and all in the folder and its folders that is no page itself.
fn inputs(folder: &Path, measurement: Option<&Path>) -> Vec<PathBuf> {
    let within = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let own = within(folder);
    let deeper: Vec<PathBuf> = own.iter().flat_map(|path| within(path)).collect();
    let others = own.into_iter().chain(deeper).filter(|path| !has_pages_name(path));
    measurement.map(Path::to_path_buf).into_iter().chain(others).collect()
}

fn has_pages_name(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("html") || e.eq_ignore_ascii_case("htm"))
}

/// A page has a page's name, so that a slip does not write one over something else.
fn is_page(out: &Path) -> Result<(), Failure> {
    if out == Path::new("-") || has_pages_name(out) {
        return Ok(());
    }
    Err(Failure::usage(format!("--out: expected a name that ends in .html or .htm, or `-`, found {}", out.display())))
}

/// Writes the page of a folder into it, as `--report` asks.
pub(super) fn of_folder(folder: &Path, options: &RunOptions) -> Result<PathBuf, Failure> {
    let out = folder.join(NAME);
    write(&Run::read(folder, options)?, &out)?;
    Ok(out)
}

/// Writes the page of a run.
pub(super) fn write(run: &Run, out: &Path) -> Result<Written, Failure> {
    let written = page(run)?;
    write_bytes(out, written.html.as_bytes())?;
    Ok(written)
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        match error {
            ReportError::Chain(error) => error.into(),
            ReportError::Page(_) => Self::work(error.to_string()),
            _ => Self::usage(error.to_string()),
        }
    }
}

/// How this run was asked for: program, command and folder. What has no bearing on the result (`--threads`, `--json`, `--quiet`) is left out.
pub(super) fn made() -> Value {
    let words: Vec<String> = std::env::args_os().map(|w| w.to_string_lossy().into_owned()).collect();
    json!({
        "program": concat!("goniofit ", env!("CARGO_PKG_VERSION")),
        "command": command(&words),
        "folder": std::env::current_dir().ok(),
    })
}

/// The same, as a page shows it.
pub(super) fn this_run() -> Made {
    Made::of(&made())
}

/// The words that matter, the program by its name.
fn command(words: &[String]) -> Vec<String> {
    let mut kept = vec!["goniofit".to_owned()];
    let mut words = words.iter().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--json" | "--quiet" => {}
            "--threads" => _ = words.next(),
            word if word.starts_with("--threads=") => {}
            word => kept.push(word.to_owned()),
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_pages_have_their_size_in_kilobytes() {
        assert_eq!([43_210, 100_000, 2_300_000].map(size_of), ["43 kB", "0.1 MB", "2.3 MB"]);
    }

    #[test]
    fn what_does_not_change_the_result_is_left_out_of_the_command() {
        let words = ["/opt/goniofit", "--threads", "2", "demo", "--json", "--out", "x y", "--threads=4", "--quiet"];
        assert_eq!(command(&words.map(str::to_owned)), ["goniofit", "demo", "--out", "x y"]);
    }
}
