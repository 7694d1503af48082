//! What accuracy of a fit costs: how many samples it takes, the loss, the model.

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Instant;

use super::curve::{About, Beside, Sweep, curves, words};
use super::design::{Cost, Law, Measure, Series, Setting};
use super::knob::Knob;
use super::sweep::{Effort, Trial, limited, run};
use crate::brdf::{Material, ModelSpec};
use crate::chain::ChainError;
use crate::control::Control;
use crate::fit::{FitOptions, Loss, fit};
use crate::measurement::Measurement;

mod laws;
mod yardstick;

use yardstick::Yardstick;

/// What is swept.
#[derive(Debug, Clone)]
pub struct FitSweep {
    /// The fit that everything is measured against, but for the model: its loss is the yardstick.
    pub options: FitOptions,
    /// One of every so many entries is fitted, as by `--part`.
    pub parts: Vec<usize>,
    /// Every how many-th entry is fitted, as by `--stride`.
    pub strides: Vec<usize>,
    /// Shares by which the rmse may exceed the best one, as by `--target-rmse-excess`.
    pub targets: Vec<f64>,
    /// Losses; each with all parts and strides.
    pub losses: Vec<Loss>,
    /// Models, the one of `options` among them or not; each with all parts and strides.
    pub models: Vec<ModelSpec>,
}

/// The errors that each trial tells, so that advice can be asked for.
pub const TOLD: [&str; 3] = ["excess", "parameters", "image"];

const MEASURES: [Measure; 3] = [
    Measure { name: "excess", what: "rmse over all samples over the least one found, less 1" },
    Measure {
        name: "parameters",
        what: "root mean square of relative changes of weights and shapes against the fit to all samples",
    },
    Measure { name: "image", what: "relative error of a ball's picture against that of the best fit to all samples" },
];

/// Of steps below this there are too few parts alike to tell a slope by: a table has no more of them than the step, however often one tries.
const FEW: usize = 10;

/// One way to fit.
struct Way {
    options: FitOptions,
    /// Which model, an index.
    model: usize,
}

/// Sweeps the knobs of a measurement's fit.
///
/// # Errors
/// [`ChainError`] where a fit has no answer.
pub fn sweep(
    measurement: &Measurement,
    what: &FitSweep,
    effort: &Effort,
    control: Control<'_>,
) -> Result<Sweep, ChainError> {
    limited(effort, control, |control| swept(measurement, what, effort, control))
}

fn swept(
    measurement: &Measurement,
    what: &FitSweep,
    effort: &Effort,
    control: Control<'_>,
) -> Result<Sweep, ChainError> {
    let began = Instant::now();
    let models = if what.models.is_empty() { vec![what.options.model.clone()] } else { what.models.clone() };
    let yardstick = Yardstick::new(measurement, &what.options, &models)?;
    let (series, settings) = design(measurement, what, &models, &yardstick);
    let runs = run(&settings, effort, control, |index, turn| {
        let way = &settings[index].what;
        // What the command would make anew is made anew: an instrument's tables of lobes.
        let through = way.options.through.as_ref().map(|sight| sight.anew().unwrap_or_else(|| Arc::clone(sight)));
        let options = FitOptions { draw: turn.seed, through, ..way.options.clone() };
        let clock = Instant::now();
        let fitted = fit(measurement, &options)?.material;
        let seconds = clock.elapsed().as_secs_f64();
        Ok::<_, ChainError>(Trial { seconds, errors: yardstick.errors(&fitted, way.model)? })
    })?;
    let found = curves(&series, &settings, &MEASURES, &runs, &Beside::NOTHING);
    let about = About {
        stage: "fit",
        subject: format!("{}, {} directions", measurement.name, measurement.len()),
        commands: vec![words(["goniofit", "fit", &measurement.name])],
        reference: yardstick.said(),
        notes: notes(what),
    };
    Ok(about.sweep(MEASURES.to_vec(), found, effort, runs.ended, began))
}

fn notes(what: &FitSweep) -> Vec<String> {
    let parts = what.parts.iter().chain(&what.strides).any(|s| *s > 1) || !what.targets.is_empty();
    let said = "trials take parts alike of the samples, each another one; the command itself takes the first";
    parts.then(|| said.to_owned()).into_iter().collect()
}

/// One series a model and loss, and one of targets.
fn design(
    measurement: &Measurement,
    what: &FitSweep,
    models: &[ModelSpec],
    yardstick: &Yardstick<'_>,
) -> (Vec<Series>, Vec<Setting<Way>>) {
    let whole = measurement.len() as f64;
    let mut all = Designed { what, whole, series: Vec::new(), settings: Vec::new() };
    let own_loss = what.options.loss;
    let losses = if what.losses.is_empty() { vec![own_loss] } else { what.losses.clone() };
    for (m, model) in models.iter().enumerate() {
        for &loss in &losses {
            let (is_own, is_best) = (loss == own_loss, yardstick.is_best(m));
            let options = FitOptions { model: model.clone(), loss, ..what.options.clone() };
            let of = Fitted { model: m, name: named(model, loss, losses.len() > 1), options };
            for (knob, steps) in [(Knob::Part, &what.parts), (Knob::Stride, &what.strides)] {
                all.of_parts(&of, knob, steps, yardstick.residuals(m).laws(knob, is_own, is_best));
            }
            all.of_targets(&of, is_own && is_best);
        }
    }
    (all.series, all.settings)
}

/// A model with a loss.
struct Fitted {
    /// Which model, an index.
    model: usize,
    name: String,
    options: FitOptions,
}

struct Designed<'a> {
    what: &'a FitSweep,
    /// Entries of the table.
    whole: f64,
    series: Vec<Series>,
    settings: Vec<Setting<Way>>,
}

impl Designed<'_> {
    fn begin(&mut self, name: String, knob: Knob, laws: Vec<Option<Law>>) {
        let (cost, whole) = (Cost::Computer, self.whole);
        self.series.push(Series { name, knob, cost, main: 0, laws, whole, advisable: true });
    }

    /// Parts of the table, one of every so many entries.
    fn of_parts(&mut self, of: &Fitted, knob: Knob, steps: &[usize], laws: Vec<Option<Law>>) {
        if steps.is_empty() {
            return;
        }
        let Fitted { model, name, options } = of;
        self.begin(if knob == Knob::Part { name.clone() } else { format!("{name}, every N-th entry") }, knob, laws);
        for &step in steps {
            let size = (self.whole / step as f64).max(1.0);
            let (part, stride) = if knob == Knob::Part { (step, 1) } else { (1, step) };
            let way = Way { options: FitOptions { stride, part, ..options.clone() }, model: *model };
            let text = typed(&options.model, options.loss, self.what, &knob.typed(size, self.whole));
            let effective = if step < FEW { f64::INFINITY } else { 1.0 / (1.0 / size - 1.0 / self.whole) };
            let setting = Setting::sized(self.series.len() - 1, size, text, way);
            self.settings.push(Setting { effective: Some(effective), ..setting });
        }
    }

    /// As many samples as a target takes; the best model by the yardstick's own loss promises it.
    fn of_targets(&mut self, of: &Fitted, promises: bool) {
        if self.what.targets.is_empty() {
            return;
        }
        let Fitted { model, name, options } = of;
        self.begin(format!("{name}, as many as a target takes"), Knob::ExcessTarget, vec![None; 3]);
        for &target in &self.what.targets {
            let target_rmse_excess = Some(target);
            let way = Way { options: FitOptions { target_rmse_excess, stride: 1, ..options.clone() }, model: *model };
            let text = typed(&options.model, options.loss, self.what, &Knob::ExcessTarget.typed(target, 0.0));
            let setting = Setting::sized(self.series.len() - 1, target, text, way);
            self.settings.push(Setting { promise: Some(target).filter(|_| promises), ..setting });
        }
    }
}

fn named(model: &ModelSpec, loss: Loss, with_loss: bool) -> String {
    if with_loss { format!("{model}, {}", loss.name()) } else { model.to_string() }
}

/// The options of a setting, without those that are the same in all.
fn typed(model: &ModelSpec, loss: Loss, what: &FitSweep, knob: &str) -> String {
    let mut text = String::new();
    if what.models.len() > 1 {
        let _ = write!(text, "--model {model} ");
    }
    if what.losses.len() > 1 {
        let _ = write!(text, "--loss {} ", loss.name());
    }
    text + knob
}

/// Weights and shapes of a material in a row; none of a lobe without a shape.
fn parameters(material: &Material) -> Option<Vec<f64>> {
    let mut all = Vec::new();
    for lobe in &material.lobes {
        all.extend(&lobe.weight);
        for c in 0..material.channels.len() {
            all.extend(lobe.shape_of(c)?);
        }
    }
    Some(all)
}

/// Root mean square of the relative changes of parameters; NaN where they are not the same ones. A parameter that is 0 in the reference has none.
#[must_use]
pub fn parameter_error(found: &Material, reference: &Material) -> f64 {
    let (Some(a), Some(b)) = (parameters(found), parameters(reference)) else { return f64::NAN };
    if a.len() != b.len() {
        return f64::NAN;
    }
    let changes: Vec<f64> = a.iter().zip(&b).filter(|(_, b)| **b != 0.0).map(|(a, b)| (a - b) / b).collect();
    (changes.iter().map(|c| c * c).sum::<f64>() / changes.len() as f64).sqrt()
}
