//! `goniofit fit`: an analytic model for each measurement.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use super::failure::Failure;
use super::info::Reading;
use super::output::{check_folder, write_text};
use super::ui::{self, Ui};
use crate::brdf::{FitRecord, Material, ModelChoice, ModelSpec, PerChannel, SpecError};
use crate::fit::{Bootstrap, FitOptions, Fitted, Limit, Loss, Robust, WeightMode, fit, fit_best_model};
use crate::measurement::{Measurement, formats};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit fit gold.binary --out gold.json
  goniofit fit *.binary --model lambert+phong --out-dir fits/
  goniofit fit gold.binary --model auto                      compare models, take the simplest good one
  goniofit fit lab.csv --use-sigma --robust cauchy           with the file's own sigma, outliers let go
  goniofit fit gold.binary --fix phong.exponent=50 --bound lambert.weight=0..0.3")]
pub(super) struct Args {
    /// Measurements; `-` is stdin
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Lobes joined by +, or `auto` to compare models and take the simplest good one
    #[arg(long, default_value = "lambert+phong", value_name = "SPEC|auto")]
    model: Wanted,
    /// What is minimised
    #[arg(long, default_value = "cosine-l2", value_parser = parse_loss, value_name = "l2|cosine-l2|log|cuberoot|relative")]
    loss: Loss,
    /// Let outliers count less; SCALE multiplies the residuals' σ [defaults: huber 1.345, cauchy 2.385]
    #[arg(long, value_name = "huber|cauchy[:SCALE]")]
    robust: Option<Robust>,
    /// How samples count
    #[arg(long, default_value = "solid-angle", value_parser = parse_weights, value_name = "solid-angle|uniform")]
    weights: WeightMode,
    /// Weigh by the σ that the file states, instead of the solid angle
    #[arg(long)]
    use_sigma: bool,
    /// Leave out samples with θi or θo above this, degrees
    #[arg(long, default_value_t = 80.0, value_name = "DEG", allow_negative_numbers = true)]
    max_angle: f64,
    /// Use every N-th entry only
    #[arg(long, default_value_t = 1, value_name = "N")]
    stride: usize,
    /// Let every channel have its own shapes
    #[arg(long)]
    per_channel: bool,
    /// Hold a parameter at a value, phong.exponent=50 say (a second lobe of a kind: phong[1]); may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = Limit::fixed)]
    fix: Vec<Limit>,
    /// Hold a parameter in a range, phong.exponent=1..1e4 or lambert.weight[r]=0..0.5 say; may be repeated
    #[arg(long, value_name = "NAME=LOW..HIGH", value_parser = Limit::range)]
    bound: Vec<Limit>,
    /// Fit under the constraint that no channel reflects more light than it receives
    #[arg(long)]
    conserve_energy: bool,
    /// Time that the fit may take, 50ms or 2s say: it then uses as many samples as that allows
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    time_budget: Option<Duration>,
    /// Stop at a part of the samples once the rmse over all is within this share of the best, 1% say, with 95 % confidence
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    target_rmse_excess: Option<f64>,
    /// Also find standard errors by redrawing the data N times
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    bootstrap: Option<u32>,
    /// Seed of the redrawing
    #[arg(long, default_value_t = 0, value_name = "SEED")]
    seed: u64,
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

/// A model, or the wish that one be chosen.
#[derive(Debug, Clone)]
enum Wanted {
    Auto,
    Model(ModelSpec),
}

impl std::str::FromStr for Wanted {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Model) }
    }
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

/// `1%` or `0.01`.
fn parse_share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    let share: f64 = number.trim().parse().map_err(|_| format!("\"{text}\" is no share: expected 1% or 0.01, say"))?;
    if share > 0.0 && share.is_finite() { Ok(share * unit) } else { Err("the share must be positive".into()) }
}

impl Args {
    fn options(&self) -> Result<FitOptions, Failure> {
        let model = match &self.model {
            Wanted::Model(model) => model.clone(),
            Wanted::Auto => "lambert".parse().map_err(|e: SpecError| Failure::work(e.to_string()))?,
        };
        Ok(FitOptions {
            loss: self.loss,
            robust: self.robust,
            weights: self.weights,
            use_sigma: self.use_sigma,
            max_angle_deg: self.max_angle,
            stride: self.stride,
            per_channel: self.per_channel,
            limits: self.fix.iter().chain(&self.bound).cloned().collect(),
            conserve_energy: self.conserve_energy,
            time_budget: self.time_budget,
            target_rmse_excess: self.target_rmse_excess,
            bootstrap: self.bootstrap.map(|replicates| Bootstrap { replicates, seed: self.seed }),
            ..FitOptions::new(model)
        })
    }
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let targets = targets(args)?;
    if let Some(out) = &args.out {
        check_folder(out)?;
    }
    if let Some(folder) = &args.out_dir {
        std::fs::create_dir_all(folder).map_err(|e| Failure::output(folder, &e))?;
    }
    let options = args.options()?;
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
            match table.and_then(|table| one(args, &options, file, &table, target.as_deref(), ui)) {
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

fn one(
    args: &Args,
    options: &FitOptions,
    file: &Path,
    table: &Measurement,
    target: Option<&Path>,
    ui: &Ui,
) -> Result<(String, Value), Failure> {
    for note in &table.notes {
        ui.note(&format!("{}: note: {note}", file.display()));
    }
    let fitted = match args.model {
        Wanted::Auto => fit_best_model(table, options)?,
        Wanted::Model(_) => fit(table, options)?,
    };
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
            let error = record.standard_error.get(l).and_then(|r| r.shape.get(i)).map(|(_, e)| e);
            let label = format!("{name}.{}", parameter.name);
            match &shape[i] {
                PerChannel::Shared(value) => {
                    let error = error.and_then(|e| e.get(0)).flatten();
                    let _ = writeln!(t, "  {label:22} {}", plus_minus(*value, error));
                }
                PerChannel::Each(values) => {
                    for (c, value) in values.iter().enumerate() {
                        let error = error.and_then(|e| e.get(c)).flatten();
                        let label = format!("{label}[{}]", material.channels[c]);
                        let _ = writeln!(t, "  {label:22} {}", plus_minus(*value, error));
                    }
                }
            }
        }
    }
    t.push_str(&evidence(record));
    for warning in &record.warnings {
        let _ = writeln!(t, "  warning: {warning}");
    }
    t
}

/// What else the numbers say: the noise and the model's own error, how the minimum was found, how the model was chosen.
fn evidence(record: &FitRecord) -> String {
    let mut t = String::new();
    if let Some(r) = &record.residual {
        let from = if r.noise_from == "sigma" { "as the file states" } else { "from neighbours" };
        let _ = writeln!(
            t,
            "  residuals: noise {:.2e} ({from}), model error {:.2e}; worth {:.0} independent samples",
            r.noise_rmse, r.model_rmse, r.effective_samples
        );
    }
    if let Some(s) = record.search.as_ref().filter(|s| s.starts > 1) {
        let others = match s.runner_up_excess {
            Some(excess) => format!("; the next minimum costs {:.2} % more", 100.0 * excess),
            None => String::new(),
        };
        let unseen = s.unseen_chance.map_or(String::new(), |p| format!("; chance of one not seen {:.1} % a start", 100.0 * p));
        let _ = writeln!(t, "  search: {} of {} starts end in the lowest minimum{others}{unseen}", s.reached, s.starts);
    }
    if let Some(s) = &record.subset {
        let _ = writeln!(
            t,
            "  {} of about {} directions used: rmse over all within {:.2} % of the best (95 %)",
            s.samples,
            s.of,
            100.0 * s.rmse_excess_95
        );
    }
    if let Some(choice) = &record.choice {
        t.push_str(&comparison(choice));
    }
    t
}

/// The models compared, as a table.
fn comparison(choice: &ModelChoice) -> String {
    let mut t = String::from("  model                      parameters  rmse       held out   AICc       BIC\n");
    for c in &choice.candidates {
        let mark = if c.model == choice.chosen { "*" } else { " " };
        let _ = writeln!(
            t,
            "{mark} {:28} {:8}  {:.3e}  {:.3e}  {:9.1}  {:9.1}",
            c.model, c.parameters, c.rmse, c.held_out_rmse, c.aicc, c.bic
        );
    }
    let _ = writeln!(t, "  chosen: {}: {}", choice.chosen, choice.reason);
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
