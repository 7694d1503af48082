//! `goniofit plan`: where to measure, for a budget of instrument hours.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use super::failure::Failure;
use super::instrument::read_instrument;
use super::output::{check_folder, keeps_inputs, stdout_is_free, write_text};
use super::text::{COLUMNS, wrapped};
use super::ui::{Ui, significant};
use crate::brdf::ModelSpec;
use crate::fit::Limit;
use crate::gonio::design::{self, Plan, Precision, Prior, QUANTILES, Range, Wish, precisions};
use crate::gonio::{Instrument, Scan, lit_rows};
use crate::measurement::Directions;
use crate::measurement::formats::{push_number, spherical_deg};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit plan --budget 2h --instrument lab.toml --out scan.csv
  goniofit plan --model lambert+phong --budget 30min --prior phong.exponent=50..500 --out scan.csv")]
pub(super) struct Args {
    /// The model whose parameters are wanted: lobes joined by +
    #[arg(long, default_value = "lambert+phong", value_name = "SPEC")]
    model: ModelSpec,
    /// Time of the instrument, moves and visits to the reference included: 2h or 30min say
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    budget: Duration,
    /// The instrument: a built-in one (see `goniofit instruments`), or a simulation file whose [instrument] counts [default: that of `simulate`]
    #[arg(long, value_name = "I")]
    instrument: Option<String>,
    /// Where a parameter may lie, evenly on a logarithmic scale; may be repeated for others [default: lambert.weight=0.05..0.8,
    /// phong.weight=0.02..0.3, phong.exponent=10..1000, several lobes sharing the exponents]
    #[arg(long, value_name = "NAME=LOW..HIGH", value_parser = Limit::range)]
    prior: Vec<Limit>,
    /// Where to write the pairs of directions, for `simulate --scan list:SCAN.csv`; equal rows in a row are one stop; `-` is stdout
    #[arg(long, value_name = "SCAN.csv")]
    out: PathBuf,
}

/// Columns of a parameter, and how many of them stand side by side.
const CELL: usize = 15;
const ABREAST: usize = 3;

/// Scans that are usual, to compare with.
const STANDARD: [Scan; 4] = [
    Scan::InPlane { step_deg: 1.0 },
    Scan::InPlane { step_deg: 5.0 },
    Scan::Hemisphere { step_deg: 5.0 },
    Scan::Hemisphere { step_deg: 10.0 },
];

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    check_folder(&args.out)?;
    keeps_inputs("--out", &args.out, args.instrument.as_deref().map(Path::new))?;
    stdout_is_free(&args.out, ui)?;
    let instrument = args.instrument.as_deref().map(read_instrument).transpose()?.unwrap_or_default();
    let prior = prior(args)?;
    let budget_s = args.budget.as_secs_f64();
    let planned =
        |share: f64| design::plan(&Wish { prior: &prior, instrument: &instrument, budget_s: share * budget_s });
    let plan = planned(1.0).map_err(|e| said(&e))?;
    let shorter = LESS.map(|share| planned(share).ok().map(|plan| medians(&plan.precision)));
    if plan.undetermined > 0 {
        let (some, all) = (plan.undetermined, plan.draws);
        ui.warn(&format!(
            "at {some} of {all} points of the prior no scan tells the parameters: planned for the others"
        ));
    }
    let table = Table::new(&prior, &instrument, (plan, shorter), budget_s / 3600.0);
    write_text(&args.out, &table.scan())?;
    if args.out != Path::new("-") {
        ui.result(&table.text(&args.out), &table.object(&args.out));
    }
    Ok(())
}

/// The usual prior with the ranges that were typed.
fn prior(args: &Args) -> Result<Prior, Failure> {
    if let Some((i, j)) = Limit::doubled(&args.prior) {
        return Err(Failure::usage(format!("--prior: {} and {} limit one parameter", args.prior[i], args.prior[j])));
    }
    let range = |limit: &Limit| Range { name: limit.parameter.to_string(), low: limit.low, high: limit.high };
    let usual = Prior::usual(&args.model).map_err(|e| Failure::usage(format!("--{e}")))?;
    let with = |prior: Prior, limit: &Limit| prior.with(range(limit));
    args.prior.iter().try_fold(usual, with).map_err(|e| Failure::usage(format!("--prior {e}")))
}

fn said(wrong: &design::Wrong) -> Failure {
    let option = match wrong {
        design::Wrong::Budget { .. } | design::Wrong::TooMany { .. } => "--",
        _ => "",
    };
    Failure::usage(format!("{option}{wrong}"))
}

/// `2h` or `30min`.
fn parse_time(text: &str) -> Result<Duration, String> {
    humantime::parse_duration(text)
        .ok()
        .filter(|t| !t.is_zero())
        .ok_or_else(|| "expected a time of more than 0, 2h or 30min say".into())
}

/// Shares of the budget for which there are plans of their own.
const LESS: [f64; 2] = [0.25, 0.5];

/// The median error of each parameter.
fn medians(of: &Precision) -> Vec<f64> {
    of.errors.iter().map(|e| e[1]).collect()
}

/// From this relative error on nothing is known of a parameter.
const OPEN: f64 = 100.0;

/// Below this, in per cent, errors are told with an exponent.
const TINY: f64 = 0.01;

/// A relative error in per cent.
fn percent(e: f64) -> String {
    match 100.0 * e {
        _ if e.is_nan() || e >= OPEN => "open".into(),
        p if p < TINY => format!("{p:.1e}"),
        p => significant(p),
    }
}

/// The same in two digits.
fn brief(e: f64) -> String {
    if e.is_nan() || e >= OPEN {
        return percent(e);
    }
    if 100.0 * e < TINY {
        return format!("{:.0e}", 100.0 * e);
    }
    let digits = (1 - (100.0 * e).log10().floor().max(-12.0) as i32).max(0) as usize;
    format!("{:.digits$}", 100.0 * e)
}

/// One scan.
struct Row {
    name: String,
    precision: Precision,
    /// In [`Table::hours`], and in as many as the plan takes; fewer hours than the scan takes once have no meaning.
    in_hours: Vec<Precision>,
    /// Share of the best information a second.
    efficiency: f64,
}

/// The plan beside the usual scans.
struct Table {
    names: Vec<String>,
    scans: Vec<Row>,
    plan: Plan,
    /// Median errors of plans for less than the budget, [`LESS`] of it; nothing where there is none.
    shorter: [Option<Vec<f64>>; 2],
    budget_h: f64,
    /// Readings of a row as the instrument has them.
    own: u32,
}

impl Row {
    /// Hours, efficiency and errors of these parameters, at this precision of it.
    fn line(&self, scan: &Precision, of: &[usize]) -> String {
        let cell = |e: &[f64; 3]| format!("{:>CELL$}", format!("{} ({})", percent(e[1]), brief(e[2])));
        let cells: Vec<String> = of.iter().map(|&k| cell(&scan.errors[k])).collect();
        let hours = significant(scan.hours);
        let share = significant(100.0 * self.efficiency);
        format!("{:13}{:>7}{hours:>8}{share:>7}{}", self.name, scan.stops, cells.join(""))
    }
}

impl Table {
    fn new(
        prior: &Prior,
        instrument: &Instrument,
        (plan, shorter): (Plan, [Option<Vec<f64>>; 2]),
        budget_h: f64,
    ) -> Self {
        let hours: Vec<f64> = Self::hours_of(budget_h).into_iter().chain([plan.precision.hours]).collect();
        let row = |name: String, instrument: &Instrument, directions: &Directions, rows: &[u32]| {
            let (precision, in_hours) = precisions(prior, instrument, (directions, rows), &hours);
            let efficiency = plan.efficiency(&precision);
            Row { name, precision, in_hours, efficiency }
        };
        let longer = Instrument { readings: plan.readings, ..instrument.clone() };
        let mut scans = vec![row("plan".to_owned(), &longer, &plan.directions, &plan.rows)];
        for scan in STANDARD {
            if let Some((directions, _)) = scan.directions() {
                scans.push(row(scan.to_string(), instrument, &directions, &lit_rows(&directions, &[])));
            }
        }
        let names = prior.names().into_iter().map(str::to_owned).collect();
        Self { names, scans, plan, shorter, budget_h, own: instrument.readings }
    }

    /// What a row stands for where it is more than the instrument's own readings.
    fn longer(&self) -> Option<String> {
        let (readings, own) = (self.plan.readings, self.own);
        (readings > own).then(|| {
            format!(
                "each row is {readings} readings, instrument.readings = {readings} (simulate --readings {readings}): with {own} the budget pays for \
                 more rows than a scan may have"
            )
        })
    }

    /// The scan as a file.
    fn scan(&self) -> String {
        let mut text = String::from("# goniofit plan, equal rows in a row are one stop\n");
        text.extend(self.longer().map(|said| format!("# {said}\n")));
        text.push_str("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg\n");
        for &row in &self.plan.rows {
            let (wi, wo) = self.plan.directions.pair(row as usize);
            [spherical_deg(wi), spherical_deg(wo)].into_iter().flatten().for_each(|a| push_number(&mut text, a));
            text.pop(); // the last comma
            text.push('\n');
        }
        text
    }

    fn text(&self, out: &Path) -> String {
        let of = &self.plan.precision;
        let pairs = self.plan.directions.len();
        let head = format!(
            "{}: {pairs} pairs of directions, {} stops, {} readings, {} h of {} h",
            out.display(),
            of.stops,
            of.rows as f64 * f64::from(self.plan.readings) / f64::from(self.own),
            significant(of.hours),
            significant(self.budget_h)
        );
        let mut text = wrapped(&head, COLUMNS).join("\n") + "\n";
        text.extend(self.longer().map(|said| wrapped(&said, COLUMNS).join("\n") + "\n"));
        text.push('\n');
        let names: Vec<usize> = (0..self.names.len()).collect();
        let blocks: Vec<String> = names.chunks(ABREAST).map(|of| self.errors(of)).collect();
        text.push_str(&blocks.join("\n"));
        text.push_str(&self.against_hours());
        let below = "Relative standard errors of a fit with --use-sigma, % (median over the prior, 90 % quantile), one channel, by readings' noise and what they \
             share: positions and the certificate. Against hours stand the medians alone: of plans made for less than the budget, else of the same stops \
             read for so long. Efficiency: the share of the best information an hour by noise alone.";
        text.push_str(&wrapped(below, COLUMNS).join("\n"));
        text
    }

    /// Hours that precision is shown at: shares and multiples of the budget.
    fn hours(&self) -> [f64; 5] {
        Self::hours_of(self.budget_h)
    }

    fn hours_of(budget_h: f64) -> [f64; 5] {
        [LESS[0], LESS[1], 1.0, 2.0, 4.0].map(|times| times * budget_h)
    }

    /// Median errors of scan number `i` in these hours: of plans for less than the budget their own, else of the same stops read for so long; nothing where that
    /// is less than once.
    fn against(&self, i: usize) -> [Option<Vec<f64>>; 5] {
        let (hours, of) = (self.hours(), &self.scans[i]);
        std::array::from_fn(|k| match self.shorter.get(k) {
            Some(plan) if i == 0 => plan.clone(),
            _ => (hours[k] >= of.precision.hours).then(|| medians(&of.in_hours[k])),
        })
    }

    /// Precision against hours, parameter by parameter.
    fn against_hours(&self) -> String {
        let hours = self.hours();
        let cells = |list: [String; 5]| list.map(|cell| format!("{cell:>12}")).concat();
        let medians: Vec<_> = self.scans.iter().enumerate().map(|(i, row)| (&row.name, self.against(i))).collect();
        let of_parameter = |(a, parameter): (usize, &String)| {
            let cell = |errors: &Option<Vec<f64>>| errors.as_ref().map_or("–".into(), |errors| percent(errors[a]));
            let line = |(name, of): &(&String, [_; 5])| format!("  {name:16}{}", cells(of.each_ref().map(cell)));
            let lines: Vec<String> = medians.iter().map(line).collect();
            format!("{parameter}\n{}", lines.join("\n"))
        };
        let blocks: Vec<String> = self.names.iter().enumerate().map(of_parameter).collect();
        format!("\n{:18}{}\n{}\n\n", "hours", cells(hours.map(significant)), blocks.join("\n"))
    }

    /// Errors of these parameters, side by side, scan by scan.
    fn errors(&self, of: &[usize]) -> String {
        // A parameter's lobe stands above its name: `phong[1].exponent` is wider than its numbers.
        let cell = |head: &str| format!("{head:>CELL$}");
        let parts = of.iter().map(|&k| self.names[k].split_once('.').unwrap_or(("", &self.names[k])));
        let (lobes, names): (Vec<String>, Vec<String>) = parts.map(|of| (cell(of.0), cell(of.1))).unzip();
        let mut text = format!("{:35}{}\n", "", lobes.concat());
        // Writing to a String can't fail.
        let _ = writeln!(text, "{:13}{:>7}{:>8}{:>7}{}", "scan", "stops", "hours", "eff. %", names.concat());
        for row in &self.scans {
            let _ = writeln!(text, "{}", row.line(&row.precision, of));
        }
        let _ = writeln!(text, "as many hours as the plan:");
        // A scan that takes longer once can't be read in the plan's hours.
        let hours = self.scans[0].precision.hours;
        for row in self.scans[1..].iter().filter(|row| row.precision.hours <= hours) {
            if let Some(in_the_plans_hours) = row.in_hours.last() {
                let _ = writeln!(text, "{}", row.line(in_the_plans_hours, of));
            }
        }
        text
    }

    fn object(&self, out: &Path) -> Value {
        let finite = |e: f64| if e.is_finite() { json!(e) } else { Value::Null };
        let errors = |of: &Precision| -> Vec<Value> {
            let one = |(name, e): (&String, &[f64; 3])| json!({ "parameter": name, "relative": e.map(finite) });
            self.names.iter().zip(&of.errors).map(one).collect()
        };
        let against = |i: usize| -> Vec<Value> {
            let median = |errors: Option<Vec<f64>>| errors.map(|e| e.into_iter().map(finite).collect::<Vec<_>>());
            let points = self.hours().into_iter().zip(self.against(i));
            points.map(|(hours, errors)| json!({ "hours": hours, "median": median(errors) })).collect()
        };
        let scan = |(i, Row { name, precision: of, efficiency, .. }): (usize, &Row)| {
            json!({
                "scan": name, "stops": of.stops, "readings": of.rows, "hours": of.hours, "efficiency": efficiency,
                "errors": errors(of), "against_hours": against(i),
            })
        };
        let scans: Vec<Value> = self.scans.iter().enumerate().map(scan).collect();
        json!({
            "out": out, "pairs": self.plan.directions.len(), "budget_hours": self.budget_h, "quantiles": QUANTILES,
            "undetermined": self.plan.undetermined, "readings_a_row": self.plan.readings, "draws": self.plan.draws, "scans": scans,
        })
    }
}
