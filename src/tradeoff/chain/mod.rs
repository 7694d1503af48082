//! The whole chain under a budget: readings, fit, picture, and where the next second buys most.
//!
//! What readings and fit leave of error in the picture is measured with pictures that share their noise, the noise of pixels on its own; both are
//! independent, so that their squares add up. The setting for each budget is then tried as a whole, beside what was predicted of it.

use std::time::Instant;

use super::curve::{About, Beside, Curve, Sweep, curves};
use super::design::{Cost, Law, Measure, Series, Setting, Theory};
use super::knob::Knob;
use super::simulate::laws::{self, Shown};
use super::sweep::{Effort, Runs, Trial, limited, run};
use crate::brdf::{Material, ModelSpec};
use crate::chain::{ChainError, Stage};
use crate::control::Control;
use crate::gonio::{Instrument, Scan};
use crate::numeric::estimate::median;

mod links;
mod shares;

use links::{Links, Try};
pub use shares::{Next, Share};

/// What is swept.
#[derive(Debug)]
pub struct ChainSweep<'a> {
    /// The truth, and what it is called.
    pub material: &'a Material,
    /// Its name.
    pub name: &'a str,
    /// What measures it.
    pub instrument: &'a Instrument,
    /// Where.
    pub scan: &'a Scan,
    /// What is fitted.
    pub model: ModelSpec,
    /// What is rendered.
    pub stage: &'a Stage,
    /// Width and height of the pictures, pixels.
    pub size: (u32, u32),
    /// Readings averaged at each pair of directions.
    pub readings: Vec<u32>,
    /// Every how many-th pair is fitted.
    pub strides: Vec<usize>,
    /// Samples per pixel.
    pub samples: Vec<u32>,
    /// Times of instrument and computer together, s; of a range where none is given.
    pub budgets: Vec<f64>,
}

/// The errors that each trial tells, so that advice can be asked for.
pub const TOLD: [&str; 3] = ["image", "parameters", "brdf"];

const MEASURES: [Measure; 3] = [
    Measure {
        name: "image",
        what: "relative error of the picture, root of the mean of (x − truth)²/(truth² + (L̄/10)²)",
    },
    Measure { name: "parameters", what: "root mean square of relative errors of fitted weights and shapes" },
    Measure { name: "brdf", what: "root mean square of relative changes of the reduced BRDF against the truth" },
];

const MISFITTED: Law =
    Law { theory: Theory::AtLeast(-0.5), why: "noise averages out, what the model can't follow of the material stays" };
const SOBOL: Law =
    Law { theory: Theory::AtMost(-0.5), why: "scrambled Sobol' points are at least as good as independent ones" };

/// Sweeps the links of the chain, shares each budget out among them, and tries the whole.
///
/// # Errors
/// [`ChainError`] where a link fails.
pub fn sweep(what: &ChainSweep<'_>, effort: &Effort, control: Control<'_>) -> Result<(Sweep, Vec<Share>), ChainError> {
    limited(effort, control, |control| swept(what, effort, control))
}

fn swept(what: &ChainSweep<'_>, effort: &Effort, control: Control<'_>) -> Result<(Sweep, Vec<Share>), ChainError> {
    let began = Instant::now();
    let mut links = Links::new(what, effort.seed, control)?;
    let (mut series, settings) = design(what, &links);
    let mut shown = vec![Shown::NOTHING; series.len()];
    let runs = run(&settings, effort, control, |index, turn| {
        let (trial, own) = links.trial(settings[index].what, turn.seed)?;
        let of_series = &mut shown[settings[index].series];
        *of_series = of_series.and(own);
        Ok::<_, ChainError>(trial)
    })?;
    for (series, shown) in series.iter_mut().zip(shown).filter(|(series, _)| series.knob == Knob::Readings) {
        series.laws = of_readings(what, shown).map(Some).to_vec();
    }
    let mut found = curves(&series, &settings, &MEASURES, &runs, &Beside::NOTHING);
    let mut shares = shares::all(what, &settings, &runs);
    let notes = shares::notes(what, &settings, &runs);
    let mut ended = runs.ended;
    if ended.is_none() && !shares.is_empty() {
        let (whole, more) = tried(&mut links, &mut shares, effort, control)?;
        found.extend(whole);
        ended = more;
    }
    let about = About {
        stage: "chain",
        subject: format!("{} along {} into {}", what.name, what.scan, what.stage.spec.name),
        commands: Vec::new(),
        reference: vec![links.said()],
        notes,
    };
    Ok((about.sweep(MEASURES.to_vec(), found, effort, ended, began), shares))
}

/// The whole chain as it was shared out.
fn tried(
    links: &mut Links<'_>,
    shares: &mut [Share],
    effort: &Effort,
    control: Control<'_>,
) -> Result<(Vec<Curve>, Option<String>), ChainError> {
    let name = "whole chain, time shared out".to_owned();
    let series = [Series {
        name,
        knob: Knob::Shares,
        cost: Cost::Both,
        main: 0,
        laws: vec![None; 3],
        whole: 0.0,
        advisable: true,
    }];
    let settings: Vec<Setting<Try>> = shares
        .iter()
        .map(|s| Setting {
            instrument_s: Some(s.instrument_s),
            ..Setting::sized(0, s.seconds(), s.typed(), Try::Whole(s.readings, s.stride, s.samples))
        })
        .collect();
    let effort = Effort { seed: effort.seed ^ 0x5eed, ..*effort };
    let runs: Runs =
        run(&settings, &effort, control, |index, turn| links.trial(settings[index].what, turn.seed).map(|(t, _)| t))?;
    let found = curves(&series, &settings, &MEASURES, &runs, &Beside::NOTHING);
    for point in found.iter().flat_map(|c| &c.points) {
        let own = shares.iter_mut().filter(|s| s.typed() == point.setting);
        own.for_each(|share| share.measured = point.errors[0]);
    }
    Ok((found, runs.ended))
}

/// One series a stride, over the readings; and one of samples. Each leaves out what the other brings, so that neither is what the whole chain would come to.
fn design(what: &ChainSweep<'_>, links: &Links<'_>) -> (Vec<Series>, Vec<Setting<Try>>) {
    let (mut series, mut settings) = (Vec::new(), Vec::new());
    for &stride in &what.strides {
        let name = if stride == 1 {
            "readings, all fitted".into()
        } else {
            format!("readings, fitted with --stride {stride}")
        };
        series.push(Series {
            name,
            knob: Knob::Readings,
            cost: Cost::Instrument,
            main: 0,
            laws: vec![None; 3], // what theory says depends on what trials show
            whole: 0.0,
            advisable: false,
        });
        for &n in &what.readings {
            let text = Knob::Readings.typed(f64::from(n), 0.0);
            let setting = Setting::sized(series.len() - 1, f64::from(n), text, Try::Data(n, stride));
            settings.push(Setting { instrument_s: links.instrument_s(n), ..setting });
        }
    }
    let name = "pixels".to_owned();
    series.push(Series {
        name,
        knob: Knob::Samples,
        cost: Cost::Computer,
        main: 0,
        laws: vec![Some(SOBOL), None, None],
        whole: 0.0,
        advisable: false,
    });
    for &n in &what.samples {
        let text = Knob::Samples.typed(f64::from(n), 0.0);
        settings.push(Setting::sized(series.len() - 1, f64::from(n), text, Try::Pixels(n)));
    }
    (series, settings)
}

/// What theory says of errors of picture, parameters and reduced BRDF against the readings averaged.
fn of_readings(what: &ChainSweep<'_>, shown: Shown) -> [Law; 3] {
    let [_, brdf, parameters] = laws::of_readings(what.instrument, shown);
    // The picture follows the parameters.
    let is_own = what.model.to_string() == what.material.model();
    let fitted = if is_own { parameters } else { MISFITTED };
    [fitted, fitted, brdf]
}

/// Mean square of the main errors, and the median time, of a setting; `None` where it has no trial, or an error could not be told.
fn summary(trials: &[Trial]) -> Option<(f64, f64)> {
    let seconds = median(&trials.iter().map(|t| t.seconds).collect::<Vec<_>>())?.value;
    let square = trials.iter().map(|t| t.errors[0].powi(2)).sum::<f64>() / trials.len() as f64;
    (!square.is_nan()).then_some((square, seconds))
}
