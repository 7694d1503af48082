//! The fits, one file after the other.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::{Args, Wanted};
use super::plan::targets;
use super::print::{describe, hanging};
use crate::cli::failure::Failure;
use crate::cli::output::{check_folder, make_folder, write_text};
use crate::cli::report;
use crate::cli::ui::{self, Ui};
use crate::fit::{FitError, FitOptions, Fitted, fit, fit_best_model};
use crate::measurement::{Measurement, formats};
use crate::report::run::Run;

/// Fits file by file.
pub(in crate::cli) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let targets = targets(args)?;
    let options = args.options()?;
    if let Some(out) = &args.out {
        check_folder(out)?;
    }
    if let Some(folder) = &args.out_dir {
        make_folder("--out-dir", folder)?;
    }
    let reading = args.reading.options();
    let (mut text, mut results, mut failures) = (String::new(), Vec::new(), Vec::new());
    // The next file is read while this one is fitted.
    let done = std::thread::scope(|scope| {
        let (scope, reading) = (scope, &reading);
        let read = |file: &PathBuf| {
            let file = file.clone();
            scope.spawn(move || formats::read(&file, reading))
        };
        let mut ahead = args.files.first().map(&read);
        for (k, (file, target)) in args.files.iter().zip(&targets).enumerate() {
            let table = ahead.take().map(std::thread::ScopedJoinHandle::join);
            if ui::stop().requested() {
                break;
            }
            ahead = args.files.get(k + 1).map(&read);
            let table = match table {
                Some(Ok(read)) => read.map_err(Failure::from),
                _ => Err(Failure::work(format!("{}: the reader failed", file.display()))),
            };
            match table.and_then(|table| one(args, &options, file, table, target.as_deref(), ui)) {
                Ok((said, object)) => {
                    ui.has_something_to_keep();
                    text.push_str(&said);
                    results.push(object);
                }
                // Several files: the others are still fitted, and the failures told at the end.
                Err(failure) if args.files.len() > 1 => {
                    ui.warn(&failure.message);
                    results.push(json!({ "file": file, "error": failure.message }));
                    failures.push(failure);
                }
                Err(failure) => return Err(failure),
            }
        }
        Ok(())
    });
    done?;
    let object = match (args.files.len(), results.pop()) {
        (1, Some(only)) => only,
        (_, last) => json!({ "fits": results.into_iter().chain(last).collect::<Vec<_>>() }),
    };
    if let Some(first) = failures.first() {
        let code = failures.iter().map(|f| f.code).min().unwrap_or(1);
        let count = failures.len();
        let message =
            format!("{count} of {} files could not be fitted; the first: {}", args.files.len(), first.message);
        return Err(Failure { code, ..Failure::work(message).beside(text, object) });
    }
    if !targets.iter().any(|t| t.as_deref() == Some(Path::new("-"))) {
        ui.result(&text, &object);
    }
    Ok(())
}

fn one(
    args: &Args,
    options: &FitOptions,
    file: &Path,
    table: Measurement,
    target: Option<&Path>,
    ui: &Ui,
) -> Result<(String, Value), Failure> {
    for note in &table.notes {
        ui.note(&format!("{}: note: {note}", file.display()));
    }
    let fitted = match args.model {
        Wanted::Auto => fit_best_model(&table, options),
        Wanted::Model(_) => fit(&table, options),
    };
    let mut fitted = fitted.map_err(|error| refused(args, file, error))?;
    if let Some(record) = &mut fitted.material.fit {
        record.instrument = args.shared.through.clone().filter(|name| name != "-");
    }
    if args.log {
        log(&fitted, ui);
    }
    let text = fitted.material.to_json().map_err(|e| Failure::work(e.to_string()))?;
    if let Some(target) = target {
        write_text(target, &(text.clone() + "\n"))?;
    }
    let page = if args.report { target.map(|t| t.with_extension("html")) } else { None };
    if let (Some(page), Some(target)) = (&page, target) {
        let through = args.shared.through.clone().map(|name| (name, options.through.clone()));
        let run =
            Run::of_fit(file, table, &target.display().to_string(), &fitted.material, through, report::this_run());
        report::write(&run, page)?;
    }
    let mut object: Value = serde_json::from_str(&text).map_err(|e| Failure::work(e.to_string()))?;
    object["file"] = json!(file);
    object["out"] = json!(target);
    if let Some(page) = page {
        object["report"] = json!(page);
    }
    object["history"] = json!(history(&fitted));
    let said = describe(&file.display().to_string(), &fitted.material)
        + &target.map_or(String::new(), |t| hanging(&format!("written to {}", t.display())));
    Ok((said, object))
}

/// Why there is no fit, with the options named as they were typed, and the file where the error does not name it.
fn refused(args: &Args, file: &Path, error: FitError) -> Failure {
    let held = |name: &str| args.shared.fix.iter().any(|limit| limit.parameter.to_string() == name);
    let several = args.files.len() > 1;
    let own = format!("{}: ", file.display());
    let (before, after) = match &error {
        FitError::Limit { name, .. } if held(name) => ("--fix ", String::new()),
        FitError::Limit { .. } => ("--bound ", String::new()),
        FitError::Infeasible { .. } => ("", " (--fix or --bound asks for them)".to_owned()),
        FitError::NothingToFit { weightless: 1.., .. } if args.shared.use_sigma => {
            ("", " (--use-sigma gives weight 0 where sigma is not positive)".to_owned())
        }
        FitError::NothingToFit { beyond: 1.., .. } => ("", " (--max-angle sets that limit)".to_owned()),
        FitError::Solver { .. } => (&own[..], String::new()),
        FitError::Option { .. } if several => ("", format!(" ({})", file.display())),
        _ => ("", String::new()),
    };
    let failure = Failure::from(error);
    Failure { message: format!("{before}{}{after}", failure.message), ..failure }
}

fn history(fitted: &Fitted) -> Vec<Value> {
    let step = |s: &crate::fit::solver::Iteration| {
        let shapes: Vec<f64> = s.parameters.iter().map(|t| t.exp()).collect();
        json!({ "cost": s.cost, "shapes": shapes, "damping": s.damping })
    };
    fitted.history.iter().map(step).collect()
}

fn log(fitted: &Fitted, ui: &Ui) {
    for (i, step) in fitted.history.iter().enumerate() {
        let shapes: Vec<String> = step.parameters.iter().map(|t| format!("{:.10}", t.exp())).collect();
        ui.note(&format!("  step {i:2}  cost {:.12e}  shape {}", step.cost, shapes.join(" ")));
    }
    ui.note(&format!("  stopped: {}", fitted.stop));
}
