//! The links of the chain, one by one and all together.

use std::sync::Arc;
use std::time::Instant;

use super::ChainSweep;
use crate::brdf::{Material, Sight};
use crate::chain::{self, ChainError, Source, measure, render_material};
use crate::control::Control;
use crate::fit::{FitOptions, fit};
use crate::gonio::sight::Cones;
use crate::gonio::{self, Instrument, lit_rows};
use crate::image::Image;
use crate::measurement::{Dimension, Measurement};
use crate::render::{self, Film, Options, Scene};
use crate::tradeoff::fit::parameter_error;
use crate::tradeoff::render::accumulate::Truth;
use crate::tradeoff::simulate::laws::Shown;
use crate::tradeoff::simulate::{largest_change, relative_change};
use crate::tradeoff::sweep::Trial;

/// What is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Try {
    /// So many readings a pair, every so many-th pair fitted: the picture of the fit against that of the truth, both with the same noise.
    Data(u32, usize),
    /// So many samples a pixel of the truth.
    Pixels(u32),
    /// Readings, stride and samples: the chain.
    Whole(u32, usize, u32),
}

/// A material measured and fitted.
struct Fitted {
    material: Material,
    /// Time of the fit, s.
    seconds: f64,
    /// Error of what was measured.
    brdf: f64,
    /// The largest change of a value.
    change: f64,
}

/// Samples of pictures that share their noise.
const SHARED: u32 = 128;
/// Times the most samples that half of the reference has.
const BETTER: u32 = 4;

/// What trials need.
pub(super) struct Links<'a> {
    what: &'a ChainSweep<'a>,
    control: Control<'a>,
    through: Option<Arc<dyn Sight>>,
    truth_scene: Scene,
    truth: Truth,
    /// What the scan would read without any error.
    ideal: Vec<f64>,
    said: String,
}

impl<'a> Links<'a> {
    pub fn new(what: &'a ChainSweep<'a>, seed: u64, control: Control<'a>) -> Result<Self, ChainError> {
        let cones = Cones::of(what.instrument).filter(|_| what.scan.dimension() == Dimension::Space);
        let through = cones.map(|cones| Arc::new(cones) as Arc<dyn Sight>);
        let truth_scene = scene_with(what, what.material)?;
        let most = what.samples.iter().copied().max().unwrap_or(SHARED);
        let samples = most.saturating_mul(BETTER).min(1 << 24);
        let half = |k: u64| picture(&truth_scene, what.size, samples, seed.wrapping_add(u64::MAX / 2 + k), control);
        let truth = Truth::of(&half(0)?.to_image(), &half(1)?.to_image());
        let said = truth.said(samples, f64::INFINITY);
        let ideal = measured(what, &Instrument::noiseless(), 0, control)?.values;
        Ok(Self { what, control, through, truth_scene, truth, ideal, said })
    }

    /// What pictures are measured against.
    pub fn said(&self) -> String {
        format!(
            "{}; readings and fits: the truth's own picture with the same seeds, so that noise of pixels is in both",
            self.said
        )
    }

    /// Seconds of the instrument for so many readings a pair.
    pub fn instrument_s(&self, readings: u32) -> Option<f64> {
        let scan = self.what.scan;
        let (directions, _) = scan.directions()?;
        let rows = lit_rows(&directions, scan.rows());
        Some(gonio::seconds(&self.instrument(readings), &directions, &rows))
    }

    fn instrument(&self, readings: u32) -> Instrument {
        Instrument { readings, ..self.what.instrument.clone() }
    }

    /// A trial, and what it shows of noise.
    pub fn trial(&mut self, what: Try, seed: u64) -> Result<(Trial, Shown), ChainError> {
        match what {
            Try::Data(readings, stride) => {
                let Fitted { material: fitted, seconds, brdf, change } = self.fitted(readings, stride, seed)?;
                let shot = |scene: &Scene| picture(scene, self.what.size, SHARED, seed, self.control.quiet());
                let own = shot(&scene_with(self.what, &fitted)?)?;
                let error = own.off_by(&shot(&self.truth_scene)?);
                let parameters = parameter_error(&fitted, self.what.material);
                // An error that could not be told is as large as one may be.
                let off = if parameters.is_nan() { f64::INFINITY } else { parameters };
                let shown = Shown { change, parameters: off, saturates: false };
                Ok((Trial { seconds, errors: vec![error, parameters, brdf] }, shown))
            }
            Try::Pixels(samples) => {
                let film = picture(&self.truth_scene, self.what.size, samples, seed, self.control.quiet())?;
                let errors = vec![self.off(&film.to_image()), f64::NAN, f64::NAN];
                Ok((Trial { seconds: film.seconds, errors }, Shown::NOTHING))
            }
            Try::Whole(readings, stride, samples) => {
                let Fitted { material: fitted, seconds, brdf, .. } = self.fitted(readings, stride, seed)?;
                let film =
                    picture(&scene_with(self.what, &fitted)?, self.what.size, samples, seed, self.control.quiet())?;
                let errors = vec![self.off(&film.to_image()), parameter_error(&fitted, self.what.material), brdf];
                Ok((Trial { seconds: seconds + film.seconds, errors }, Shown::NOTHING))
            }
        }
    }

    /// The error against the reference, without its own.
    fn off(&self, image: &Image) -> f64 {
        self.truth.error(image)
    }

    /// A material measured and fitted.
    fn fitted(&self, readings: u32, stride: usize, seed: u64) -> Result<Fitted, ChainError> {
        let table = measured(self.what, &self.instrument(readings), seed, self.control.quiet())?;
        let options = FitOptions {
            stride,
            draw: seed,
            through: self.through.clone(),
            ..FitOptions::new(self.what.model.clone())
        };
        let clock = Instant::now();
        let material = fit(&table, &options)?.material;
        let (seconds, change) = (clock.elapsed().as_secs_f64(), largest_change(&table.values, &self.ideal));
        Ok(Fitted { material, seconds, brdf: relative_change(&table.values, &self.ideal), change })
    }
}

fn measured(
    what: &ChainSweep<'_>,
    instrument: &Instrument,
    seed: u64,
    control: Control<'_>,
) -> Result<Measurement, ChainError> {
    let source = Source::Fitted(Box::new(what.material.clone()));
    measure(what.name, &source, instrument, what.scan, seed, control)
}

fn scene_with(what: &ChainSweep<'_>, material: &Material) -> Result<Scene, ChainError> {
    let subject = render_material(what.name, &Source::Fitted(Box::new(material.clone())), None)?;
    chain::scene(what.stage, Some(subject))
}

fn picture(scene: &Scene, size: (u32, u32), samples: u32, seed: u64, control: Control<'_>) -> Result<Film, ChainError> {
    let options = Options { width: size.0, height: size.1, samples, seed, ..Options::default() };
    Ok(render::render(scene, &options, control)?)
}
