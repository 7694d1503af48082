//! `goniofit fit`: an analytic model for each measurement.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::failure::Failure;
use super::info::Reading;
use super::output::{check_folder, write_text};
use super::ui::{self, Ui};
use crate::brdf::{FitRecord, Material, ModelSpec, PerChannel};
use crate::fit::{FitOptions, Fitted, Loss, WeightMode, fit};
use crate::measurement::formats;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit fit gold.binary --out gold.json
  goniofit fit *.binary --model lambert+phong --out-dir fits/")]
pub(super) struct Args {
    /// Measurements; `-` is stdin
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Lobes joined by +
    #[arg(long, default_value = "lambert+phong", value_name = "SPEC")]
    model: ModelSpec,
    /// What is minimised
    #[arg(long, default_value = "cosine-l2", value_parser = parse_loss, value_name = "l2|cosine-l2")]
    loss: Loss,
    /// How samples count
    #[arg(long, default_value = "solid-angle", value_parser = parse_weights, value_name = "solid-angle|uniform")]
    weights: WeightMode,
    /// Leave out samples with θi or θo above this, degrees
    #[arg(long, default_value_t = 80.0, value_name = "DEG", allow_negative_numbers = true)]
    max_angle: f64,
    /// Where to write the fit of one measurement; `-` is stdout
    #[arg(long, value_name = "FIT.json", conflicts_with = "out_dir")]
    out: Option<PathBuf>,
    /// Folder to write the fits of several measurements to, each under its own name
    #[arg(long, value_name = "D")]
    out_dir: Option<PathBuf>,
    /// Print every step of the search on stderr
    #[arg(long)]
    log: bool,
    #[command(flatten)]
    reading: Reading,
}

fn parse_loss(text: &str) -> Result<Loss, String> {
    Loss::from_name(text).ok_or_else(|| format!("known are {}", Loss::ALL.map(Loss::name).join(", ")))
}

fn parse_weights(text: &str) -> Result<WeightMode, String> {
    [WeightMode::SolidAngle, WeightMode::Uniform]
        .into_iter()
        .find(|w| w.name() == text)
        .ok_or_else(|| "known are solid-angle, uniform".into())
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let targets = targets(args)?;
    if let Some(out) = &args.out {
        check_folder(out)?;
    }
    if let Some(folder) = &args.out_dir {
        std::fs::create_dir_all(folder).map_err(|e| Failure::output(folder, &e))?;
    }
    let (mut text, mut results, mut failures) = (String::new(), Vec::new(), Vec::new());
    for (file, target) in args.files.iter().zip(&targets) {
        if ui::stop().requested() {
            break;
        }
        match one(args, file, target.as_deref(), ui) {
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

/// Where each fit goes; two files of one name are refused before anything is written.
fn targets(args: &Args) -> Result<Vec<Option<PathBuf>>, Failure> {
    if args.out.is_some() && args.files.len() > 1 {
        return Err(Failure::usage("--out takes one measurement; use --out-dir for several"));
    }
    let Some(folder) = &args.out_dir else { return Ok(vec![args.out.clone(); args.files.len()]) };
    let mut targets: Vec<PathBuf> = Vec::new();
    for file in &args.files {
        let stem = match file.file_stem() {
            Some(stem) if stem != "-" => stem.to_string_lossy().into_owned(),
            _ => "stdin".into(),
        };
        let target = folder.join(format!("{stem}.json"));
        if targets.contains(&target) {
            return Err(Failure::usage(format!("two measurements would be written to {}", target.display())));
        }
        targets.push(target);
    }
    Ok(targets.into_iter().map(Some).collect())
}

fn one(args: &Args, file: &Path, target: Option<&Path>, ui: &Ui) -> Result<(String, Value), Failure> {
    let table = formats::read(file, &args.reading.options())?;
    for note in &table.notes {
        ui.note(&format!("{}: note: {note}", file.display()));
    }
    let options = FitOptions {
        loss: args.loss,
        weights: args.weights,
        max_angle_deg: args.max_angle,
        ..FitOptions::new(args.model.clone())
    };
    let fitted = fit(&table, &options)?;
    if args.log {
        log(&fitted, ui);
    }
    let text = fitted.material.to_json().map_err(|e| Failure::work(e.to_string()))?;
    if let Some(target) = target {
        write_text(target, &(text.clone() + "\n"))?;
    }
    let mut object: Value = serde_json::from_str(&text).map_err(|e| Failure::work(e.to_string()))?;
    object["file"] = json!(file);
    object["out"] = json!(target);
    object["history"] = json!(history(&fitted));
    let said = describe(&file.display().to_string(), &fitted.material)
        + &target.map_or(String::new(), |t| format!("  written to {}\n", t.display()));
    Ok((said, object))
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
    ui.note(&format!("  stopped: {:?}", fitted.stop));
}

/// A fit in words: every parameter with its standard error.
pub(super) fn describe(name: &str, material: &Material) -> String {
    let mut t = String::new();
    let default = FitRecord::default();
    let record = material.fit.as_ref().unwrap_or(&default);
    let _ = writeln!(
        t,
        "{name}: {}, {}, {} samples, rmse {:.6}, {:.3} s",
        material.model(),
        record.status,
        record.samples,
        record.rmse,
        record.seconds
    );
    for (l, lobe) in material.lobes.iter().enumerate() {
        let name = material.lobe_name(l);
        for (c, weight) in lobe.weight.iter().enumerate() {
            let error = record.standard_error.get(l).and_then(|r| r.weight.get(c).copied().flatten());
            let label = format!("{name}.weight[{}]", material.channels[c]);
            let _ = writeln!(t, "  {label:22} {}", plus_minus(*weight, error));
        }
        let Some(shape) = &lobe.shape else {
            let _ = writeln!(t, "  {:22} undetermined: the lobe has no weight", format!("{name}.*"));
            continue;
        };
        for (i, parameter) in lobe.kind.lobe().parameters().iter().enumerate() {
            let error = match record.standard_error.get(l).and_then(|r| r.shape.get(i)) {
                Some((_, PerChannel::Shared(error))) => *error,
                _ => None,
            };
            let value = shape.get(i).and_then(|v| v.get(0)).unwrap_or(f64::NAN);
            let _ = writeln!(t, "  {:22} {}", format!("{name}.{}", parameter.name), plus_minus(value, error));
        }
    }
    for warning in &record.warnings {
        let _ = writeln!(t, "  warning: {warning}");
    }
    t
}

/// `0.3201 ± 0.0004`: the error to two digits, the value to the same place; powers of ten where that would be long.
pub(super) fn plus_minus(value: f64, error: Option<f64>) -> String {
    let Some(error) = error else { return format!("{value:.6} (undetermined)") };
    if error == 0.0 {
        return format!("{value}");
    }
    let places = 1.0 - error.log10().floor();
    if (0.0..=9.0).contains(&places) {
        let places = places as usize;
        return format!("{value:.places$} ± {error:.places$}");
    }
    format!("{value:.9} ± {error:.1e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_shown_to_two_digits() {
        assert_eq!(plus_minus(0.320_123, Some(0.000_41)), "0.32012 ± 0.00041");
        assert_eq!(plus_minus(312.49, Some(12.3)), "312 ± 12");
        assert_eq!(plus_minus(0.314, Some(7e29)), "0.314000000 ± 7.0e29");
        assert_eq!(plus_minus(0.3, Some(1e-15)), "0.300000000 ± 1.0e-15");
        assert_eq!(plus_minus(0.5, Some(0.0)), "0.5");
        assert_eq!(plus_minus(1.5, None), "1.500000 (undetermined)");
    }
}
