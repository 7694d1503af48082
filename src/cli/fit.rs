//! `goniofit fit`: an analytic model for each measurement.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use super::failure::Failure;
use super::info::Reading;
use super::output::{check_folder, keeps_inputs, make_folder, write_text};
use super::ui::{self, Ui};
use crate::brdf::{FitRecord, Material, ModelChoice, ModelSpec, PerChannel, SpecError};
use crate::fit::{Bootstrap, FitError, FitOptions, Fitted, Limit, Loss, Robust, WeightMode, fit, fit_best_model};
use crate::measurement::{Dimension, Measurement, formats};

const MODEL: &str = "Model and loss";
const SAMPLES: &str = "Samples and their weights";
const EFFORT: &str = "Effort";
const OUTPUT: &str = "Output";

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit fit gold.binary --out gold.json
  goniofit fit *.binary --model lambert+phong --out-dir fits/
  goniofit fit gold.binary --model auto
  goniofit fit lab.csv --use-sigma --robust cauchy
  goniofit fit gold.binary --fix phong.exponent=50 --bound lambert.weight=0..0.3
  goniofit fit gold.binary --target-rmse-excess 1%")]
#[allow(clippy::struct_excessive_bools)] // each is an option of its own
pub(super) struct Args {
    /// Measurements; `-` is stdin
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Lobes joined by +, or `auto` to compare models and take the simplest good one
    #[arg(long, default_value = "lambert+phong", value_name = "SPEC|auto", help_heading = MODEL)]
    model: Wanted,
    /// What is minimised; docs/fit.md has the formulas
    #[arg(long, default_value = "cosine-l2", value_parser = parse_loss, value_name = "l2|cosine-l2|log|cuberoot|relative", help_heading = MODEL)]
    loss: Loss,
    /// Let outliers count less; SCALE (1e-3 to 1e6) times the residuals' σ is where they begin [default SCALE: huber 1.345,
    /// cauchy 2.385]
    #[arg(long, value_name = "huber|cauchy[:SCALE]", help_heading = MODEL)]
    robust: Option<Robust>,
    /// How samples count
    #[arg(long, default_value = "solid-angle", value_parser = parse_weights, value_name = "solid-angle|uniform", help_heading = SAMPLES)]
    weights: WeightMode,
    /// Weigh by the σ that the file states, instead of the solid angle
    #[arg(long, conflicts_with = "weights", help_heading = SAMPLES)]
    use_sigma: bool,
    /// Leave out samples with θi or θo above this, degrees
    #[arg(long, default_value_t = 80.0, value_name = "DEG", allow_negative_numbers = true, help_heading = SAMPLES)]
    max_angle: f64,
    /// Use every N-th entry only
    #[arg(long, default_value_t = 1, value_name = "N", help_heading = SAMPLES)]
    stride: usize,
    /// Let every channel have its own shapes
    #[arg(long, help_heading = MODEL)]
    per_channel: bool,
    /// Hold a parameter at a value, phong.exponent=50 say; a second lobe of a kind is phong[1]; may be repeated for others
    #[arg(long, value_name = "NAME=VALUE", value_parser = Limit::fixed, help_heading = MODEL)]
    fix: Vec<Limit>,
    /// Hold a parameter in a range, phong.exponent=1..1e4 or lambert.weight[r]=0..0.5 say; may be repeated for others
    #[arg(long, value_name = "NAME=LOW..HIGH", value_parser = Limit::range, help_heading = MODEL)]
    bound: Vec<Limit>,
    /// Fit under the constraint that no channel reflects more light than it receives
    #[arg(long, help_heading = MODEL)]
    conserve_energy: bool,
    /// Time that the fit may take, bootstrap included, 50ms or 2s say: it uses as many samples as that allows
    #[arg(long, value_name = "TIME", value_parser = parse_time, help_heading = EFFORT)]
    time_budget: Option<Duration>,
    /// Stop at a part of the samples once the rmse over all is within this share of the best (1%, say) with 95 % confidence
    #[arg(long, value_name = "SHARE", value_parser = parse_share, allow_hyphen_values = true, help_heading = EFFORT)]
    target_rmse_excess: Option<f64>,
    /// Also find standard errors by redrawing the data N times; where a budget or target ends the fit early, the samples it ended with
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000), help_heading = EFFORT)]
    bootstrap: Option<u32>,
    /// Seed of the redrawing
    #[arg(long, default_value_t = 0, requires = "bootstrap", value_name = "SEED", help_heading = EFFORT)]
    seed: u64,
    /// Where to write the fit of one measurement; `-` is stdout
    #[arg(long, value_name = "FIT.json", conflicts_with = "out_dir", help_heading = OUTPUT)]
    out: Option<PathBuf>,
    /// Folder to write the fits of several measurements to, each under its own name
    #[arg(long, value_name = "D", help_heading = OUTPUT)]
    out_dir: Option<PathBuf>,
    /// Print every step of the search on stderr
    #[arg(long, help_heading = OUTPUT)]
    log: bool,
    #[command(flatten, next_help_heading = "Reading")]
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

/// `50ms` or `2s`.
fn parse_time(text: &str) -> Result<Duration, String> {
    humantime::parse_duration(text).map_err(|_| "expected a time, 50ms or 2s say".into())
}

/// `1%` or `0.01`.
fn parse_share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    let share: Option<f64> = number.trim().parse().ok().filter(|share: &f64| *share > 0.0 && share.is_finite());
    share.map(|share| share * unit).ok_or_else(|| "expected a positive share, 1% or 0.01 say".into())
}

impl Args {
    fn options(&self) -> Result<FitOptions, Failure> {
        let model = match &self.model {
            Wanted::Model(model) => model.clone(),
            Wanted::Auto => "lambert".parse().map_err(|e: SpecError| Failure::work(e.to_string()))?,
        };
        let limits: Vec<Limit> = self.fix.iter().chain(&self.bound).cloned().collect();
        if let Some((first, second)) = Limit::doubled(&limits) {
            let [first, second] = [first, second].map(|i| format!("{} {}", self.typed_by(i), limits[i]));
            return Err(Failure::usage(format!(
                "{first} and {second} limit the same parameter; expected one limit a parameter"
            )));
        }
        Ok(FitOptions {
            loss: self.loss,
            robust: self.robust,
            weights: self.weights,
            use_sigma: self.use_sigma,
            max_angle_deg: self.max_angle,
            stride: self.stride,
            per_channel: self.per_channel,
            limits,
            conserve_energy: self.conserve_energy,
            time_budget: self.time_budget,
            target_rmse_excess: self.target_rmse_excess,
            bootstrap: self.bootstrap.map(|replicates| Bootstrap { replicates, seed: self.seed }),
            ..FitOptions::new(model)
        })
    }

    /// The option that limit `i` of all was typed with.
    fn typed_by(&self, i: usize) -> &'static str {
        if i < self.fix.len() { "--fix" } else { "--bound" }
    }
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
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

/// Where each fit goes, checked before anything is read: no fit goes where a measurement or another fit is.
fn targets(args: &Args) -> Result<Vec<Option<PathBuf>>, Failure> {
    let targets = named_targets(args)?;
    let option = if args.out_dir.is_some() { "--out-dir" } else { "--out" };
    for target in targets.iter().flatten() {
        keeps_inputs(option, target, args.files.iter().map(PathBuf::as_path))?;
    }
    Ok(targets)
}

/// Where each fit goes by its name; two of one name are refused.
fn named_targets(args: &Args) -> Result<Vec<Option<PathBuf>>, Failure> {
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
        Wanted::Auto => fit_best_model(table, options),
        Wanted::Model(_) => fit(table, options),
    };
    let fitted = fitted.map_err(|error| refused(args, file, error))?;
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

/// Why there is no fit, with the options named as they were typed, and the file where the error does not name it.
fn refused(args: &Args, file: &Path, error: FitError) -> Failure {
    let held = |name: &str| args.fix.iter().any(|limit| limit.parameter.to_string() == name);
    let several = args.files.len() > 1;
    let own = format!("{}: ", file.display());
    let (before, after) = match &error {
        FitError::Limit { name, .. } if held(name) => ("--fix ", String::new()),
        FitError::Limit { .. } => ("--bound ", String::new()),
        FitError::Infeasible { .. } => ("", " (--fix or --bound asks for them)".to_owned()),
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

/// A fit in words: every parameter with its standard error, then what else the record says.
fn describe(name: &str, material: &Material) -> String {
    let mut t = String::new();
    let default = FitRecord::default();
    let record = material.fit.as_ref().unwrap_or(&default);
    let unit = unit_of(record, material);
    let _ = writeln!(
        t,
        "{name}: {}, {}, {} samples, rmse {}{unit}, {:.3} s",
        material.model(),
        record.status,
        record.samples,
        small(record.rmse, 3),
        record.seconds
    );
    for (l, lobe) in material.lobes.iter().enumerate() {
        let name = material.lobe_name(l);
        let (errors, intervals) = (record.standard_error.get(l), record.interval_95.get(l));
        for (c, weight) in lobe.weight.iter().enumerate() {
            let error = errors.and_then(|r| r.weight.get(c).copied().flatten());
            let interval = intervals.and_then(|r| r.weight.get(c).copied().flatten());
            parameter(&mut t, record, &format!("{name}.weight[{}]", material.channels[c]), *weight, (error, interval));
        }
        let Some(shape) = &lobe.shape else {
            let _ = writeln!(t, "  {:22} undetermined: the lobe has no weight", format!("{name}.*"));
            continue;
        };
        for (i, known) in lobe.kind.lobe().parameters().iter().enumerate() {
            let errors = errors.and_then(|r| r.shape.get(i)).map(|(_, e)| e);
            let intervals = intervals.and_then(|r| r.shape.get(i)).map(|(_, e)| e);
            let at = |c: usize| (errors.and_then(|e| e.get(c)).flatten(), intervals.and_then(|e| e.get(c)).flatten());
            let label = format!("{name}.{}", known.name);
            match &shape[i] {
                PerChannel::Shared(value) => parameter(&mut t, record, &label, *value, at(0)),
                PerChannel::Each(values) => {
                    for (c, value) in values.iter().enumerate() {
                        let label = format!("{label}[{}]", material.channels[c]);
                        parameter(&mut t, record, &label, *value, at(c));
                    }
                }
            }
        }
    }
    t.push_str(&evidence(record, material));
    for warning in &record.warnings {
        t.push_str(&hanging(&format!("warning: {warning}")));
    }
    t
}

/// Standard error and 95 % interval of a parameter.
type Stated = (Option<f64>, Option<(f64, f64)>);

/// The unit of the residuals, to be put behind a number; empty where they have none.
fn unit_of(record: &FitRecord, material: &Material) -> String {
    let dimension = if material.is_flat() { Dimension::Flat } else { Dimension::Space };
    match Loss::from_name(&record.loss).map_or("", |loss| loss.unit(dimension)) {
        "" => String::new(),
        unit => format!(" {unit}"),
    }
}

/// Something small, by powers of ten; 0 is 0.
fn small(x: f64, places: usize) -> String {
    if x == 0.0 { "0".into() } else { format!("{x:.places$e}") }
}

/// One line a parameter; its interval only where the error does not tell it: where it is lopsided.
fn parameter(t: &mut String, record: &FitRecord, label: &str, value: f64, (error, interval): Stated) {
    let open = record.undetermined.iter().any(|name| name == label);
    let half_width = interval.map(|(low, high)| (high - low) / 2.0);
    let digits = Digits::of(value, error.or(half_width).unwrap_or(0.0));
    let shown = match error {
        None if !open => format!("{} (at the end of its range)", plain(value)),
        _ => plus_minus(value, error),
    };
    let _ = write!(t, "  {label:22} {shown}");
    if let Some((low, high)) = interval {
        let (below, above) = (value - low, high - value);
        if below.max(above) > LOPSIDED * below.min(above) {
            let _ = write!(t, "  (95 %: {} to {})", digits.show(low), digits.show(high));
        }
    }
    t.push('\n');
}

/// Halves of an interval that differ by more than this factor are shown.
const LOPSIDED: f64 = 1.2;

/// Three digits.
fn digits(x: f64) -> String {
    if x == 0.0 || !(1e-4..1e6).contains(&x.abs()) {
        return if x == 0.0 { "0".into() } else { format!("{x:.2e}") };
    }
    let places = (2.0 - x.abs().log10().floor()).max(0.0) as usize;
    format!("{x:.places$}")
}

/// What else the numbers say: the noise and the model's own error, how the minimum was found, how the model was chosen.
fn evidence(record: &FitRecord, material: &Material) -> String {
    let mut t = String::new();
    let unit = unit_of(record, material);
    let mut say = |text: String| t.push_str(&hanging(&text));
    if let (Some(robust), [first, ..]) = (&record.robust, &record.robust_scale[..]) {
        let others = if record.robust_scale.len() > 1 { " (the first channel's)" } else { "" };
        say(format!("robust {robust}: residuals beyond {}{unit}{others} count less", small(*first, 3)));
    }
    if !record.relative_epsilon.is_empty() {
        let each = material.channels.iter().zip(&record.relative_epsilon).map(|(c, e)| format!("{c} {}", small(*e, 3)));
        let of_value = if material.is_flat() { "1/rad" } else { "1/sr" };
        say(format!("ε of the relative loss: {} {of_value}", each.collect::<Vec<_>>().join(", ")));
    }
    if let Some(r) = &record.residual {
        let from = if r.noise_from == "sigma" { "as the file states" } else { "from neighbours" };
        let model = match r.model_rmse {
            0.0 => "no model error seen".into(),
            rmse => format!("model error {}{unit}", small(rmse, 2)),
        };
        let noise = small(r.noise_rmse, 2);
        let worth = r.effective_samples;
        say(format!("residuals: noise {noise}{unit} ({from}), {model}; worth {worth:.0} independent values"));
    }
    if let Some(e) = &record.energy {
        say(format!("energy: reflects {} of the light at most", percent(e.largest)));
    }
    // A single shape is bracketed over its whole range: nothing to add unless another minimum is nearly as low.
    if let Some(s) =
        record.search.as_ref().filter(|s| s.unseen_chance.is_some() || s.runner_up_excess.is_some_and(|e| e < RIVAL))
    {
        let more = |e: f64| {
            if e < 1.0 { format!("{} more", percent(e)) } else { format!("{} times as much", digits(1.0 + e)) }
        };
        let others = s.runner_up_excess.map_or(String::new(), |e| format!("; the next costs {}", more(e)));
        let unseen = s
            .unseen_chance
            .map_or(String::new(), |p| format!("; another start finds a new one by a chance of {}", percent(p)));
        if s.starts > 1 {
            say(format!("search: {} of {} starts end in the lowest minimum{others}{unseen}", s.reached, s.starts));
        }
    }
    if let Some(s) = &record.subset {
        say(format!(
            "{} of about {} directions used: rmse over all within {} of the best (95 % confidence)",
            s.samples,
            s.of,
            percent(s.rmse_excess_95)
        ));
    }
    if let Some(text) = redrawn(record) {
        say(text);
    }
    if let Some(choice) = &record.choice {
        t.push_str(&comparison(choice, record, &unit));
    }
    t
}

/// Another minimum whose cost exceeds the lowest by less than this share is worth a word.
const RIVAL: f64 = 0.1;

fn percent(share: f64) -> String {
    format!("{} %", digits(100.0 * share))
}

/// How the bootstrap's standard errors compare with the analytic ones.
fn redrawn(record: &FitRecord) -> Option<String> {
    let bootstrap = record.bootstrap.as_ref()?;
    let mut ratios = Vec::new();
    for (drawn, known) in bootstrap.standard_error.iter().zip(&record.standard_error) {
        let mut compare = |pair: (Option<f64>, Option<f64>)| {
            ratios.extend(pair.0.zip(pair.1).filter(|p| p.1 > 0.0).map(|(drawn, known)| drawn / known));
        };
        drawn.weight.iter().copied().zip(known.weight.iter().copied()).for_each(&mut compare);
        for ((_, drawn), (_, known)) in drawn.shape.iter().zip(&known.shape) {
            let list = |p: &PerChannel<Option<f64>>| match p {
                PerChannel::Shared(one) => vec![*one],
                PerChannel::Each(many) => many.clone(),
            };
            list(drawn).into_iter().zip(list(known)).for_each(&mut compare);
        }
    }
    let (least, most) = ratios.iter().fold((f64::INFINITY, 0.0f64), |(a, b), r| (a.min(*r), b.max(*r)));
    (!ratios.is_empty()).then(|| {
        let count = bootstrap.replicates;
        format!("bootstrap: standard errors over {count} drawings are {least:.2} to {most:.2} of those above")
    })
}

/// The models compared, as a table; the rmse in it has a `unit`.
fn comparison(choice: &ModelChoice, record: &FitRecord, unit: &str) -> String {
    let width = choice.candidates.iter().map(|c| c.model.len()).fold(26, usize::max);
    let mut t = format!("  {:width$} par.       rmse   held out       AICc        BIC\n", "model");
    for c in &choice.candidates {
        let mark = if c.model == choice.chosen { "*" } else { " " };
        let _ = writeln!(
            t,
            "{mark} {:width$} {:4} {:10.3e} {:10.3e} {:10.1} {:10.1}",
            c.model, c.parameters, c.rmse, c.held_out_rmse, c.aicc, c.bic
        );
    }
    for line in [basis(choice, record, unit), Some(format!("chosen: {}: {}", choice.chosen, choice.reason))] {
        line.iter().for_each(|line| t.push_str(&hanging(line)));
    }
    t
}

/// What the table's rmse are of: their unit, and why the chosen model's differs from that of the fit.
fn basis(choice: &ModelChoice, record: &FitRecord, unit: &str) -> Option<String> {
    let part = match (choice.samples, &record.subset) {
        (Some(n), _) => Some(format!("of {n} samples spread over the file")),
        (None, Some(_)) => Some("of all samples".to_owned()),
        (None, None) => None,
    };
    let robust = record.robust.as_ref().map(|_| "with the robust scale of the richest model for all".to_owned());
    let unit = (!unit.is_empty()).then(|| format!("in{unit}"));
    let differs = part.is_some() || robust.is_some();
    let facts: Vec<String> = [unit, part, robust].into_iter().flatten().collect();
    let more = if differs { ", so they can differ from the rmse above" } else { "" };
    (!facts.is_empty()).then(|| format!("rmse and held out are {}{more}", facts.join(", ")))
}

/// Columns that prose is wrapped at.
const COLUMNS: usize = 90;

/// A paragraph indented by two, what follows its first line by four.
fn hanging(text: &str) -> String {
    let mut lines = vec![String::from(" ")];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        if lines[last].chars().count() + 1 + word.chars().count() > COLUMNS && lines[last].trim() != "" {
            lines.push(format!("    {word}"));
        } else {
            lines[last].push(' ');
            lines[last].push_str(word);
        }
    }
    lines.join("\n") + "\n"
}

/// `0.3201 ± 0.0004`: the error to two digits, the value to the same place; powers of ten where that would be long.
pub(super) fn plus_minus(value: f64, error: Option<f64>) -> String {
    let Some(error) = error else { return format!("{} (undetermined)", plain(value)) };
    if error == 0.0 {
        return if value == 0.0 || (1e-4..1e9).contains(&value) { value.to_string() } else { format!("{value:e}") };
    }
    let digits = Digits::of(value, error);
    format!("{} ± {}", digits.show(value), digits.show_error(error))
}

/// Six decimals; powers of ten for what is very small or large.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) { format!("{value:.6}") } else { format!("{value:.6e}") }
}

/// To which decimal place numbers about as large as a value are shown.
#[derive(Debug, Clone, Copy)]
struct Digits {
    /// The place of the error's second digit: 10^last.
    last: i32,
    /// Whether by powers of ten.
    powers: bool,
}

impl Digits {
    /// Most decimals without powers of ten.
    const DECIMALS: i32 = 9;

    /// As many as an error of the value leaves; of an error of 0, six decimals.
    fn of(value: f64, error: f64) -> Self {
        let last = if error > 0.0 { error.log10().floor() as i32 - 1 } else { -6 };
        let size = value.abs().max(error);
        Self { last, powers: !((1e-4..1e6).contains(&size) || size == 0.0) }
    }

    fn show(self, x: f64) -> String {
        let decimals = (-self.last).clamp(0, Self::DECIMALS) as usize;
        if !self.powers {
            return format!("{x:.decimals$}");
        }
        if x == 0.0 {
            return "0".into();
        }
        let places = (x.abs().log10().floor() as i32 - self.last).clamp(1, 16) as usize;
        format!("{x:.places$e}")
    }

    fn show_error(self, error: f64) -> String {
        if self.powers || self.last < -Self::DECIMALS { format!("{error:.1e}") } else { self.show(error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paragraphs_hang_and_keep_every_word() {
        let text = "warning: ".to_owned() + &"word ".repeat(60);
        let shown = hanging(text.trim());
        assert!(shown.lines().count() > 3 && shown.lines().all(|l| l.chars().count() <= COLUMNS), "{shown}");
        assert!(
            shown.starts_with("  warning: word") && shown.lines().skip(1).all(|l| l.starts_with("    word")),
            "{shown}"
        );
        assert_eq!(shown.split_whitespace().count(), text.split_whitespace().count());
        assert_eq!(hanging("short"), "  short\n");
    }

    #[test]
    fn three_digits_whatever_the_size() {
        let shown = [0.0, 0.012_34, 1.0, 89.96, 12_345.6, 1e8, 2e-9].map(digits);
        assert_eq!(shown, ["0", "0.0123", "1.00", "90.0", "12346", "1.00e8", "2.00e-9"]);
    }

    #[test]
    fn an_interval_has_the_digits_of_its_value() {
        let shown = |label: &str, value: f64, error: Option<f64>, interval: (f64, f64)| {
            let mut t = String::new();
            parameter(&mut t, &FitRecord::default(), label, value, (error, Some(interval)));
            t
        };
        let text = shown("phong.exponent", 11.9955, Some(0.0033), (11.9921, 12.004));
        assert_eq!(text, "  phong.exponent         11.9955 ± 0.0033  (95 %: 11.9921 to 12.0040)\n");
        let text = shown("phong.exponent", 60.0, None, (60.0, 60.123_4));
        assert!(text.ends_with("60.000000 (at the end of its range)  (95 %: 60.000 to 60.123)\n"), "{text}");
        let text = shown("w", 1e-150, Some(2e-151), (0.0, 3e-150));
        assert!(text.ends_with("1.00e-150 ± 2.0e-151  (95 %: 0 to 3.00e-150)\n"), "{text}");
    }

    #[test]
    fn errors_are_shown_to_two_digits() {
        assert_eq!(plus_minus(0.320_123, Some(0.000_41)), "0.32012 ± 0.00041");
        assert_eq!(plus_minus(312.49, Some(12.3)), "312 ± 12");
        assert_eq!(plus_minus(79.53, Some(134.2)), "80 ± 134");
        assert_eq!(plus_minus(0.314, Some(7e29)), "3.1e-1 ± 7.0e29");
        assert_eq!(plus_minus(1.234_56e-150, Some(1.2e-153)), "1.2346e-150 ± 1.2e-153");
        assert_eq!(plus_minus(1.5e150, Some(2e148)), "1.500e150 ± 2.0e148");
        assert_eq!(plus_minus(1e-150, Some(0.003)), "0.0000 ± 0.0030");
        assert_eq!(plus_minus(2e-150, Some(0.0)), "2e-150");
        assert_eq!(plus_minus(2e-150, None), "2.000000e-150 (undetermined)");
        assert_eq!(plus_minus(0.3, Some(1e-15)), "0.300000000 ± 1.0e-15");
        assert_eq!(plus_minus(0.5, Some(0.0)), "0.5");
        assert_eq!(plus_minus(1.5, None), "1.500000 (undetermined)");
    }
}
