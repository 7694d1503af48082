//! What accuracy of a simulated measurement costs: orders of quadratures and effects in the computer's time; readings, dwell and step of the scan in
//! the instrument's.

use std::time::Instant;

use super::curve::{About, Beside, Sweep, curves, words};
use super::design::{Cost, Law, Measure, Series, Setting, Theory};
use super::knob::Knob;
use super::sweep::{Effort, limited, run};
use crate::chain::{ChainError, Source};
use crate::control::Control;
use crate::gonio::{self, Instrument, Scan, lit_rows};
use crate::measurement::Directions;

mod bench;
pub(in crate::tradeoff) mod laws;

pub(in crate::tradeoff) use bench::largest_change;
pub use bench::relative_change;
use bench::{Bench, Read};
use laws::Shown;

/// What is swept.
#[derive(Debug)]
pub struct SimulateSweep<'a> {
    /// What is measured, and what it is called.
    pub source: &'a Source,
    /// Its name.
    pub name: &'a str,
    /// What it is measured with.
    pub instrument: &'a Instrument,
    /// Where.
    pub scan: &'a Scan,
    /// Relative errors that means over cones may have, as by `--target-error`.
    pub quadrature: Vec<f64>,
    /// Orders of the rules over cones and spot.
    pub orders: Vec<u32>,
    /// Whether each effect is left out in turn.
    pub effects: bool,
    /// Readings averaged at each pair of directions.
    pub readings: Vec<u32>,
    /// Exposures, as multiples of the instrument's own.
    pub dwell: Vec<f64>,
    /// Steps of the scan, degrees, where it has any.
    pub steps: Vec<f64>,
}

/// The errors that each trial tells, so that advice can be asked for.
pub const TOLD: [&str; 3] = ["reading", "brdf", "parameters"];

const MEASURES: [Measure; 3] = [
    Measure {
        name: "reading",
        what: "root mean square of relative changes of readings by the quadrature or the effect that is left out; else by noise, after averages",
    },
    Measure {
        name: "brdf",
        what: "the same of the reduced BRDF: what the reduction leaves of that; else against the truth",
    },
    Measure {
        name: "parameters",
        what: "root mean square of relative errors of fitted weights and shapes: likewise; else against the truth",
    },
];

const KINKED: Law = Law {
    theory: Theory::AtMost(-2.0),
    why: "a table has kinks at its values: each cell that one crosses is off by the cell's square",
};

/// Sweeps the knobs of a simulated measurement.
///
/// # Errors
/// [`ChainError`] where it can't be made or reduced.
pub fn sweep(what: &SimulateSweep<'_>, effort: &Effort, control: Control<'_>) -> Result<Sweep, ChainError> {
    limited(effort, control, |control| swept(what, effort, control))
}

fn swept(what: &SimulateSweep<'_>, effort: &Effort, control: Control<'_>) -> Result<Sweep, ChainError> {
    let began = Instant::now();
    let mut bench = Bench::new(what, effort.seed, control);
    let (mut series, settings) = design(what);
    // Steps that a scan does not take are not tried.
    let steps: Vec<f64> = what.steps.iter().copied().filter(|step| stepped(what.scan, *step).is_some()).collect();
    let mut shown = vec![Shown::NOTHING; series.len()];
    let runs = run(&settings, effort, control, |index, turn| {
        let (trial, own) = bench.trial(&settings[index].what, turn)?;
        let of_series = &mut shown[settings[index].series];
        *of_series = of_series.and(own);
        Ok::<_, ChainError>(trial)
    })?;
    for (series, shown) in series.iter_mut().zip(shown) {
        let laws = laws::of(series.knob, (what.instrument, what.source), &steps, shown);
        series.laws = laws.unwrap_or_else(|| std::mem::take(&mut series.laws));
    }
    let found = curves(&series, &settings, &MEASURES, &runs, &Beside::NOTHING);
    let about = About {
        stage: "simulate",
        subject: format!("{} along {}", what.name, what.scan),
        commands: vec![words(["goniofit", "simulate", "--material", what.name, "--scan", &what.scan.to_string()])],
        reference: bench.said(),
        notes: bench.notes(),
    };
    Ok(about.sweep(MEASURES.to_vec(), found, effort, runs.ended, began))
}

/// One series a knob.
fn design(what: &SimulateSweep<'_>) -> (Vec<Series>, Vec<Setting<Read>>) {
    let mut all = Designed { what, series: Vec::new(), settings: Vec::new() };
    all.of_readings();
    all.of_quadrature();
    all.of_orders();
    all.of_effects();
    (all.series, all.settings)
}

struct Designed<'a> {
    what: &'a SimulateSweep<'a>,
    series: Vec<Series>,
    settings: Vec<Setting<Read>>,
}

impl Designed<'_> {
    fn begin(&mut self, name: &str, knob: Knob, cost: Cost, main: usize, laws: Vec<Option<Law>>) {
        self.series.push(Series {
            name: name.into(),
            knob,
            cost,
            main,
            laws,
            whole: 0.0,
            advisable: !matches!(knob, Knob::Effects | Knob::Order),
        });
    }

    fn push(&mut self, size: f64, text: String, read: Read) {
        let instrument_s = match &read {
            Read::Noisy { instrument, scan } => scan
                .directions()
                .map(|(directions, _)| gonio::seconds(instrument, &directions, &lit_rows(&directions, scan.rows()))),
            _ => None,
        };
        let setting = Setting::sized(self.series.len() - 1, size, text, read);
        self.settings.push(Setting { instrument_s, ..setting });
    }

    /// What the instrument's time is spent on.
    fn of_readings(&mut self) {
        let SimulateSweep { instrument, scan, readings, dwell, steps, source, .. } = self.what;
        let main = if matches!(source, Source::Fitted(_)) { 2 } else { 1 };
        // What theory says depends on what trials show.
        let laws = || vec![None; 3];
        let noisy =
            |instrument: Instrument, scan: &Scan| Read::Noisy { instrument: Box::new(instrument), scan: scan.clone() };
        if !readings.is_empty() {
            self.begin("readings averaged", Knob::Readings, Cost::Instrument, main, laws());
        }
        for &n in readings {
            let more = Instrument { readings: n, ..(*instrument).clone() };
            self.push(f64::from(n), Knob::Readings.typed(f64::from(n), 0.0), noisy(more, scan));
        }
        if !dwell.is_empty() {
            self.begin("exposure", Knob::Dwell, Cost::Instrument, main, laws());
        }
        for &factor in dwell {
            let mut longer = (*instrument).clone();
            longer.detector.exposures_s.iter_mut().for_each(|s| *s *= factor);
            self.push(factor, Knob::Dwell.typed(factor, 0.0), noisy(longer, scan));
        }
        if !steps.is_empty() {
            self.begin("step of the scan", Knob::Step, Cost::Instrument, main, laws());
        }
        for &step in steps {
            let Some((finer, pairs)) = stepped(scan, step) else { continue };
            let text = format!("--scan {finer}");
            self.push(pairs, text, noisy((*instrument).clone(), &finer));
        }
    }

    fn of_quadrature(&mut self) {
        if self.what.quadrature.is_empty() {
            return;
        }
        self.begin("means over cones", Knob::Quadrature, Cost::Computer, 0, vec![None; 3]);
        for &accuracy in &self.what.quadrature {
            self.push(accuracy, Knob::Quadrature.typed(accuracy, 0.0), Read::Quadrature(accuracy));
            if let Some(setting) = self.settings.last_mut() {
                setting.promise = Some(accuracy);
            }
        }
    }

    fn of_orders(&mut self) {
        if self.what.orders.is_empty() {
            return;
        }
        // Of a smooth material errors fall faster than by any power; of scattered directions nothing is known.
        let is_grid = |source: &Source| matches!(source, Source::Measured(table) if matches!(table.directions, Directions::Merl(_)));
        let law = Some(KINKED).filter(|_| is_grid(self.what.source));
        self.begin("order of the rules", Knob::Order, Cost::Computer, 0, vec![law, None, None]);
        for &order in &self.what.orders {
            self.push(f64::from(order), Knob::Order.typed(f64::from(order), 0.0), Read::Order(order));
        }
    }

    fn of_effects(&mut self) {
        let plan = gonio::plan(self.what.instrument, self.what.source.channels());
        let on: Vec<&'static str> = plan.effects.iter().filter(|e| e.on).map(|e| e.name).collect();
        if !self.what.effects || on.is_empty() {
            return;
        }
        self.begin("an effect left out", Knob::Effects, Cost::Computer, 0, vec![None; 3]);
        let series = self.series.len() - 1;
        self.settings.push(Setting::named(series, "all effects".into(), Read::Without(None)));
        let without = |name| Setting::named(series, format!("without {name}"), Read::Without(Some(name)));
        self.settings.extend(on.into_iter().map(without));
    }
}

/// The scan with another step, and how many pairs of directions above the horizon it has; `None` of one without a step.
fn stepped(scan: &Scan, step_deg: f64) -> Option<(Scan, f64)> {
    let finer = match scan {
        Scan::InPlane { .. } => Scan::InPlane { step_deg },
        Scan::Hemisphere { .. } => Scan::Hemisphere { step_deg },
        Scan::Flat { .. } => Scan::Flat { step_deg },
        _ => return None,
    };
    let (directions, _) = finer.directions()?;
    let pairs = lit_rows(&directions, &[]).len() as f64;
    Some((finer, pairs))
}
