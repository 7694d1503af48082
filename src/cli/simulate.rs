//! `goniofit simulate`: the simulated gonioreflectometer writes a measurement.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::json;

use super::failure::Failure;
use super::fit::{parse_time, parse_tolerance};
use super::output::{
    check_folder, distinct_outputs, keeps_inputs, output_format, stdout_is_free, write_measurement, write_text,
};
use super::simulation::{Plan, What, finish};
use super::ui::{Ui, significant};
use crate::chain::{self, Source};
use crate::control::counted;
use crate::gonio::{self, Affordable, Job, Raw, Scan, Spared};
use crate::measurement::{Format, Measurement, formats};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit simulate --material glossy-paint --scan hemisphere:5 --seed 1 --out paint.csv
  goniofit simulate --material satin --instrument commercial --scan in-plane:5 --raw raw.csv --out satin.csv
  goniofit simulate lab.toml --material satin --auto 1e-4 --target-error 1e-5 --out satin.csv
  goniofit simulate --material mirror-like --scan adaptive:800 --out mirror.csv
  goniofit simulate --material gold.json --scan merl --noiseless --out gold.binary")]
pub(super) struct Args {
    #[command(flatten)]
    what: What,
    /// Write the raw readings too, as CSV (`-` is stdout); Ctrl-C ends with what was read so far
    #[arg(long, value_name = "RAW.csv")]
    raw: Option<PathBuf>,
    /// Leave out effects that change readings of the sample by less than this relative tolerance (below 1), all together, noise counted by its σ
    #[arg(long, value_name = "TOL", value_parser = parse_tolerance)]
    auto: Option<f64>,
    /// Relative error that means over the cones of source and aperture may have [default: 1e-6]
    #[arg(long, value_name = "E", value_parser = parse_tolerance, conflicts_with = "time_budget")]
    target_error: Option<f64>,
    /// Time from the program's start to the last reading (50ms, 2s, 1m): means over cones and spot are as good as fits into it. Reducing the readings and
    /// writing files come after it; without means nothing depends on it
    #[arg(long, value_name = "T", value_parser = parse_time)]
    time_budget: Option<Duration>,
    /// Where to write; the extension chooses the format (.csv, .binary); `-` is CSV on stdout
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let format = check_outputs(args, ui)?;
    let plan = Plan::new(&args.what, Some(&args.out))?;
    let (source, name) = plan.load()?;
    formats::check_channels(source.channels(), format, &args.out)?;
    if let Some(raw) = &args.raw {
        formats::check_channels(source.channels(), Format::Csv, raw)?;
    }
    for said in gonio::idle(&plan.instrument, source.channels()) {
        ui.warn(&said);
    }
    let (mut table, raw, how) = if args.raw.is_none() && args.auto.is_none() && plan.instrument.is_plain() {
        let table = chain::measure(&name, &source, &plan.instrument, &plan.scan, plan.seed, ui.control())?;
        let (budget_s, seconds) = (args.budget_s(), ui.start().elapsed().as_secs_f64());
        (table, None, How { budget_s, seconds, ..How::default() })
    } else {
        let (table, raw, how) = with_raw(args, &plan, (&source, &name), ui)?;
        (table, Some(raw), how)
    };
    table.notes.extend(below_horizon(&plan.scan, &table));
    for note in &table.notes {
        ui.warn(note);
    }
    how.warn(ui);
    for said in ended_early(&plan, &table).filter(|_| !ui.control().stop.requested()) {
        ui.warn(&said);
    }
    write_measurement(&table, &args.out, format, ui)?;
    let how = How { in_all_s: ui.start().elapsed().as_secs_f64(), ..how };
    let result = report(args, &plan, &table, raw.as_ref(), &how);
    let outputs = [Some(args.out.as_path()), args.raw.as_deref()];
    finish(&table, raw.as_ref(), &plan.instrument, result, &outputs, ui)
}

/// Refuses outputs that can't be written, or would write over something; the format of the measurement.
fn check_outputs(args: &Args, ui: &Ui) -> Result<Format, Failure> {
    let format = output_format(&args.out, None)?;
    check_folder(&args.out)?;
    if let Some(raw) = &args.raw {
        check_folder(raw)?;
        distinct_outputs(("--out", &args.out), ("--raw", raw))?;
        let inputs = [args.what.spec.as_deref(), args.what.instrument.as_deref().map(Path::new)];
        keeps_inputs("--raw", raw, inputs.into_iter().flatten())?;
        stdout_is_free(raw, ui)?;
    }
    keeps_inputs("--out", &args.out, args.what.instrument.as_deref().map(Path::new))?;
    stdout_is_free(&args.out, ui)?;
    Ok(format)
}

/// Takes raw readings, writes them where they are asked for, and reduces them.
fn with_raw(
    args: &Args,
    plan: &Plan,
    (source, name): (&Source, &str),
    ui: &Ui,
) -> Result<(Measurement, Raw, How), Failure> {
    let (raw, how) = chain::with_job(name, source, &plan.instrument, &plan.scan, plan.seed, ui.control(), |job| {
        read(job, args, ui)
    })?;
    if let Some(note) = raw.notes.first().filter(|_| raw.readings.iter().all(|r| r.entry.is_none())) {
        return Err(Failure::stopped(format!("{note}: nothing is written")));
    }
    if let Some(path) = &args.raw {
        write_text(path, &raw.to_csv(&plan.instrument))?;
    }
    // So that `reduce` of the raw file gives the same bytes.
    let raw = raw.as_written();
    let mut table = chain::reduced_until(name, &raw, &plan.instrument, ui.control().stop)?.measurement;
    if args.raw.is_none() {
        table.origin = format!("simulated, scan {}, seed {}", plan.scan, plan.seed);
    }
    Ok((table, raw, how))
}

/// Says where an adaptive scan found no place for all of its pairs.
fn ended_early(plan: &Plan, table: &Measurement) -> impl Iterator<Item = String> {
    let is_short = matches!(plan.scan, Scan::Adaptive { pairs } if table.len() < pairs as usize);
    let said = || {
        let (scan, found) = (&plan.scan, table.len());
        let step = significant(gonio::least_step_deg(&plan.instrument));
        format!("scan {scan}: ended with {found} pairs, no gap between readings is wider than two steps of {step}°")
    };
    is_short.then(said).into_iter()
}

/// Says how many directions of a list can't be measured.
fn below_horizon(scan: &Scan, table: &Measurement) -> Option<String> {
    let below = (table.len() - gonio::lit_rows(&table.directions, &[]).len()) as u64;
    let pairs = counted(below, "pair");
    let are = if below == 1 { "is" } else { "are" };
    (below > 0 && matches!(scan, Scan::List { .. }))
        .then(|| format!("{pairs} of directions {are} masked: at or below the horizon"))
}

/// Why neither accuracy nor time for it change anything: by the instrument, or by what `--auto` left out.
const NO_MEANS: &str = "all was read, for this instrument reads without means over cones or spot";
const MEANS_LEFT_OUT: &str = "all was read, for --auto left out the means over cones and spot";

/// How readings were made.
#[derive(Default)]
struct How {
    spared: Vec<Spared>,
    affordable: Option<Affordable>,
    /// Largest error of a mean over cones, and what it may be.
    error: f64,
    accuracy: f64,
    /// Of a budget, what was left when the readings began, s.
    left_s: f64,
    /// The budget, s.
    budget_s: Option<f64>,
    /// From the program's start to the last reading, s.
    seconds: f64,
    /// To the last file, s.
    in_all_s: f64,
    /// Effects whose means the accuracy is of.
    means: Vec<&'static str>,
    /// Whether there were some, and all were left out.
    means_left_out: bool,
}

/// Where readings end later than the budget by more than this share of it and more than these seconds, it is said.
const LATE: (f64, f64) = (0.1, 0.05);

/// Reads, with the accuracy and the effects that were asked for.
fn read(job: &Job<'_>, args: &Args, ui: &Ui) -> (Raw, How) {
    let accuracy = args.target_error.unwrap_or(job.accuracy);
    let job = Job { accuracy, ..*job };
    let spared = args.auto.map_or_else(Vec::new, |tolerance| {
        // What is to be proved below a tolerance must be known much better.
        Job { accuracy: accuracy.min(0.01 * tolerance), ..job }.spared(tolerance, ui.control())
    });
    let left_out: Vec<&str> = spared.iter().map(|s| s.effect).collect();
    let job = Job { left_out: &left_out, ..job };
    let all = gonio::means(job.instrument, job.channels);
    let means: Vec<&str> = all.iter().copied().filter(|name| !left_out.contains(name)).collect();
    let means_left_out = means.is_empty() && !all.is_empty();
    let left = args.time_budget.map(|time| time.saturating_sub(ui.start().elapsed()));
    // Without means there is nothing to choose.
    let affordable = left.filter(|_| !means.is_empty()).map(|left| job.affordable(left, ui.control().stop));
    let accuracy = affordable.map_or(job.accuracy, |a| a.accuracy);
    let raw = Job { accuracy, ..job }.run_until(affordable.map(|a| a.deadline), ui.control());
    let error = raw.quadrature_error;
    let (left_s, seconds) = (left.unwrap_or_default().as_secs_f64(), ui.start().elapsed().as_secs_f64());
    (
        raw,
        How {
            spared,
            affordable,
            error,
            accuracy,
            left_s,
            budget_s: args.budget_s(),
            seconds,
            in_all_s: seconds,
            means,
            means_left_out,
        },
    )
}

impl Args {
    /// The time budget, s.
    fn budget_s(&self) -> Option<f64> {
        self.time_budget.map(|time| time.as_secs_f64())
    }
}

impl How {
    /// What came of the accuracy that was asked for, or of the time for it; nothing where there is nothing to say.
    fn said(&self, args: &Args) -> String {
        let why = if self.means_left_out { MEANS_LEFT_OUT } else { NO_MEANS };
        let mut text = match (args.time_budget, args.target_error) {
            (None, None) if self.error == 0.0 => return String::new(),
            (Some(_), _) if self.means.is_empty() => format!("; --time-budget changed nothing: {why}"),
            (_, Some(_)) if self.means.is_empty() => format!("; --target-error changed nothing: {why}"),
            _ => format!("; means over cones to {:.1e}", self.error),
        };
        if let Some(budget_s) = self.budget_s {
            let after = self.in_all_s - self.seconds;
            let _ = write!(
                text,
                "; the last reading ended after {:.2} s of {budget_s} s, reducing and writing took {after:.2} s more",
                self.seconds
            );
        }
        text
    }

    /// What came of a time budget, for scripts; null without one.
    fn budget_json(&self) -> serde_json::Value {
        let Some(budget_s) = self.budget_s else { return serde_json::Value::Null };
        let mut object = json!({ "seconds": budget_s, "governs": self.means, "fits": !self.is_late(budget_s) });
        if let Some(Affordable { accuracy, predicted_s, fits, .. }) = self.affordable {
            object["accuracy"] = json!(accuracy);
            object["predicted_s"] = json!(predicted_s);
            object["fits"] = json!(fits);
        }
        object
    }

    fn is_late(&self, budget_s: f64) -> bool {
        self.seconds > budget_s + (LATE.0 * budget_s).max(LATE.1)
    }

    /// Says where what was asked for could not be reached.
    fn warn(&self, ui: &Ui) {
        if self.error > self.accuracy {
            let why =
                if self.affordable.is_some() { "their orders or the time end there" } else { "their orders end there" };
            ui.warn(&format!(
                "means over cones are good to {:.1e} at worst, not to {:.1e}: {why}",
                self.error, self.accuracy
            ));
        }
        let Some(budget_s) = self.budget_s else { return };
        if self.affordable.is_some_and(|a| !a.fits) {
            ui.warn(&format!(
                "even the lowest orders, with which all was read, take longer than --time-budget: the readings ended at {:.2} s, {:.2} s were left when trials began",
                self.seconds, self.left_s
            ));
        } else if self.is_late(budget_s) {
            ui.warn(&format!(
                "the readings ended at {:.2} s, later than the {budget_s} s of --time-budget",
                self.seconds
            ));
        }
    }
}

fn report(args: &Args, plan: &Plan, table: &Measurement, raw: Option<&Raw>, how: &How) -> (String, serde_json::Value) {
    let valid = table.values.len() as u64 - table.masked.total();
    let mut effects = gonio::plan(&plan.instrument, &table.channels).effects;
    for spared in &how.spared {
        effects.iter_mut().filter(|e| e.name == spared.effect).for_each(|e| {
            e.on = false;
            e.why = format!("changes readings by {:.1e} at most", spared.bound);
        });
    }
    // Of a run that was stopped those that it took.
    let stopped = raw.filter(|raw| !raw.notes.is_empty()).and_then(|raw| raw.readings.last());
    let hours = match stopped {
        Some(last) => (last.time_s + last.exposure_s) / 3600.0,
        None => {
            gonio::hours(&plan.instrument, &table.directions, &gonio::lit_rows(&table.directions, plan.scan.rows()))
        }
    };
    let on: Vec<&str> = effects.iter().filter(|e| e.on).map(|e| e.name).collect();
    let mut text = format!(
        "{}: {}, {}, scan {}, seed {}, {} h of the instrument; effects: {}",
        args.out.display(),
        counted(table.len() as u64, "direction pair"),
        counted(valid, "valid value"),
        plan.scan,
        plan.seed,
        significant(hours),
        if on.is_empty() { "none".into() } else { on.join(", ") }
    );
    if args.auto.is_some() {
        let names: Vec<String> = how.spared.iter().map(|s| format!("{} ({:.1e})", s.effect, s.bound)).collect();
        let _ = write!(text, "; left out: {}", if names.is_empty() { "none".into() } else { names.join(", ") });
    }
    text.push_str(&how.said(args));
    let object = json!({
        "out": args.out, "entries": table.len(), "valid": valid, "scan": plan.scan.to_string(), "seed": plan.seed, "instrument_hours": hours,
        "effects": effects, "left_out": how.spared, "quadrature_error": how.error, "time_budget": how.budget_json(),
        "seconds_to_last_reading": how.seconds, "seconds_to_last_file": how.in_all_s,
        "notes": table.notes,
    });
    (text, object)
}
