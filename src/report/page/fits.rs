//! The fits in tables: parameters, residuals, correlations, models compared.

use super::compared::{Choice, Correlations, choice, correlations};
use crate::brdf::{FitRecord, LobeKind, Material, PerChannel};
use crate::fit::Loss;
use crate::measurement::Dimension;
use crate::report::run::{Run, RunFit};
use crate::report::words::{count, number, percent, time, to_error};

/// A parameter of a fit.
pub(super) struct Cell {
    pub value: String,
    /// Standard error, where it has one.
    pub error: Option<String>,
    /// 95 % interval, or what is to be said instead.
    pub note: String,
    /// How far from the truth, standard errors.
    pub off: Option<String>,
    /// How far the model's own error moves it, where that is more than noise does.
    pub model_error: Option<String>,
}

/// A parameter in all fits.
pub(super) struct Row {
    pub name: String,
    pub unit: &'static str,
    pub truth: Option<String>,
    pub cells: Vec<Option<Cell>>,
}

/// A figure of merit in all fits.
pub(super) struct Merit {
    pub name: &'static str,
    pub cells: Vec<String>,
}

pub(super) struct Fits {
    pub labels: Vec<String>,
    pub has_truth: bool,
    pub rows: Vec<Row>,
    pub merits: Vec<Merit>,
    pub correlations: Vec<Correlations>,
    pub choices: Vec<Choice>,
}

pub(super) fn fits(run: &Run) -> Fits {
    Fits {
        labels: run.fits.iter().map(|f| f.label.clone()).collect(),
        has_truth: run.truth.is_some(),
        rows: rows(run),
        merits: merits(run),
        correlations: run.fits.iter().filter_map(correlations).collect(),
        choices: run.fits.iter().filter_map(choice).collect(),
    }
}

/// Every parameter of any fit, in the order of the richest.
fn rows(run: &Run) -> Vec<Row> {
    let mut names: Vec<(String, &'static str)> = Vec::new();
    let truth = run.truth.as_ref().map(|t| parameters(t.material()));
    let of_fits: Vec<Vec<Parameter>> = run.fits.iter().map(|f| parameters(f.material())).collect();
    let mut all: Vec<&Vec<Parameter>> = truth.iter().chain(&of_fits).collect();
    all.sort_by_key(|list| std::cmp::Reverse(list.len()));
    for parameter in all.into_iter().flatten() {
        if !names.iter().any(|(name, _)| *name == parameter.name) {
            names.push((parameter.name.clone(), parameter.unit));
        }
    }
    let find = |list: &[Parameter], name: &str| list.iter().find(|p| p.name == name).cloned();
    let row = |(name, unit): (String, &'static str)| {
        let true_value = truth.as_ref().and_then(|t| find(t, &name)).map(|p| p.value);
        let cells = of_fits.iter().map(|list| find(list, &name).map(|p| p.cell(true_value))).collect();
        Row { truth: true_value.map(number), name, unit, cells }
    };
    names.into_iter().map(row).collect()
}

#[derive(Clone)]
struct Parameter {
    name: String,
    unit: &'static str,
    value: f64,
    error: Option<f64>,
    interval: Option<(f64, f64)>,
    model_error: Option<f64>,
    undetermined: bool,
    fitted: bool,
}

impl Parameter {
    fn cell(&self, truth: Option<f64>) -> Cell {
        let (value, error) = match self.error.filter(|e| *e > 0.0) {
            Some(error) => {
                let (value, error) = to_error(self.value, error);
                (value, Some(error))
            }
            None => (number(self.value), None),
        };
        let note = match (self.interval, self.error) {
            _ if self.undetermined => "the data do not determine it".into(),
            (Some((low, high)), _) if low == high => "held".into(),
            (Some((low, high)), _) => format!("95 %: {} to {}", number_like(low, &value), number_like(high, &value)),
            (None, None) if self.fitted => "at the end of its range".into(),
            _ => String::new(),
        };
        let off = truth.zip(self.error.filter(|e| *e > 0.0)).map(|(truth, error)| {
            let z = (self.value - truth) / error;
            let z = if z.abs() < 100.0 { format!("{z:+.1}") } else { format!("{z:+.0}") };
            crate::report::plot::minus(&format!("{z} σ from truth"))
        });
        let model_error = self.model_error.filter(|m| *m > self.error.unwrap_or(f64::INFINITY));
        Cell { value, error, note, off, model_error: model_error.map(|m| crate::report::words::digits(m, 2)) }
    }
}

/// As many decimals as another number has.
fn number_like(x: f64, other: &str) -> String {
    let places = other.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    if other.contains('·') { number(x) } else { crate::report::plot::minus(&format!("{x:.places$}")) }
}

/// A material's parameters by name, with what its record says of them.
fn parameters(material: &Material) -> Vec<Parameter> {
    let empty = FitRecord::default();
    let record = material.fit.as_ref().unwrap_or(&empty);
    let mut list = Vec::new();
    for (l, lobe) in material.lobes.iter().enumerate() {
        let name = material.lobe_name(l);
        let (errors, intervals) = (record.standard_error.get(l), record.interval_95.get(l));
        let moved = record.model_error.get(l);
        let mut push = |name: String, unit, value, error: Option<f64>, interval, model_error| {
            let undetermined = record.undetermined.contains(&name);
            list.push(Parameter {
                name,
                unit,
                value,
                error,
                interval,
                model_error,
                undetermined,
                fitted: material.fit.is_some(),
            });
        };
        for (c, weight) in lobe.weight.iter().enumerate() {
            let error = errors.and_then(|r| r.weight.get(c).copied().flatten());
            let interval = intervals.and_then(|r| r.weight.get(c).copied().flatten());
            let model_error = moved.and_then(|r| r.weight.get(c).copied().flatten());
            push(format!("{name}.weight[{}]", material.channels[c]), "1", *weight, error, interval, model_error);
        }
        for (i, known) in lobe.kind.lobe().parameters().iter().enumerate() {
            let Some(shape) = lobe.shape.as_ref().and_then(|s| s.get(i)) else { continue };
            let at = |c: usize| errors.and_then(|r| r.shape.get(i)).and_then(|(_, e)| e.get(c)).flatten();
            let within = |c: usize| intervals.and_then(|r| r.shape.get(i)).and_then(|(_, e)| e.get(c)).flatten();
            let model = |c: usize| moved.and_then(|r| r.shape.get(i)).and_then(|(_, e)| e.get(c)).flatten();
            let label = format!("{name}.{}", known.name);
            match shape {
                PerChannel::Shared(value) => push(label, known.unit, *value, at(0), within(0), model(0)),
                PerChannel::Each(values) => {
                    for (c, value) in values.iter().enumerate() {
                        push(
                            format!("{label}[{}]", material.channels[c]),
                            known.unit,
                            *value,
                            at(c),
                            within(c),
                            model(c),
                        );
                    }
                }
            }
        }
    }
    list
}

/// The unit of a fit's residuals; empty where they have none.
pub(super) fn unit_of(fit: &RunFit, record: &FitRecord) -> &'static str {
    let flat = fit.material().lobes.iter().any(|l| matches!(l.kind, LobeKind::Lambert2d | LobeKind::Phong2d));
    let dimension = if flat { Dimension::Flat } else { Dimension::Space };
    Loss::from_name(&record.loss).map_or("", |loss| loss.unit(dimension))
}

/// A residual's size with its unit.
fn with_unit(x: f64, fit: &RunFit, record: &FitRecord) -> String {
    match unit_of(fit, record) {
        "" => number(x),
        unit => format!("{} {unit}", number(x)),
    }
}

/// What of a record stands in a line of the table.
type Said = fn(&RunFit, &FitRecord) -> String;

fn merits(run: &Run) -> Vec<Merit> {
    let lines: [(&'static str, Said); 12] = [
        ("Status", |_, r| r.status.clone()),
        ("Loss", |_, r| r.robust.as_ref().map_or_else(|| r.loss.clone(), |robust| format!("{}, {robust}", r.loss))),
        ("Weights", |_, r| r.weights.clone()),
        ("Seen through", |_, r| match (&r.instrument, &r.through) {
            (Some(name), Some(through)) => format!("{name}: {through}"),
            (None, Some(through)) => through.clone(),
            _ => "–".into(),
        }),
        ("Samples", |_, r| match &r.subset {
            Some(s) => format!("{} of {}", count(s.samples), count(s.of)),
            None => count(r.samples),
        }),
        ("rmse", |f, r| with_unit(r.rmse, f, r)),
        ("of it noise", |f, r| r.residual.as_ref().map_or("–".into(), |x| with_unit(x.noise_rmse, f, r))),
        ("of it the model's own error", |f, r| {
            r.residual.as_ref().map_or("–".into(), |x| with_unit(x.model_rmse, f, r))
        }),
        ("worth so many independent values", |_, r| {
            r.residual.as_ref().map_or("–".into(), |x| count(x.effective_samples.round().max(0.0) as u64))
        }),
        ("Largest directional albedo", |_, r| r.energy.as_ref().map_or("–".into(), |e| percent(e.largest))),
        ("Starts that reached the minimum", |_, r| {
            r.search.as_ref().map_or("–".into(), |s| format!("{} of {}", s.reached, s.starts))
        }),
        ("Time", |_, r| time(r.seconds)),
    ];
    let empty = FitRecord::default();
    let of =
        |say: Said| run.fits.iter().map(|f| say(f, f.material().fit.as_ref().unwrap_or(&empty))).collect::<Vec<_>>();
    let all = lines.into_iter().map(|(name, say)| Merit { name, cells: of(say) });
    all.filter(|m| m.cells.iter().any(|c| c != "–")).collect()
}
