//! What each effect contributes: how far readings would be off without it, what the reduction leaves of that, and what it costs.
//!
//! The scan at hand is read with this seed's errors, without noise, and again with one effect left out by name. Changes are relative,
//! |a − b|/max(|a|, |b|), so that they lie between 0 and 1 whatever is 0; of noise it is σ over the reading, 1 at most. What acts on the flux or the
//! electrons only starts from light that is worked out once.

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use super::actual::Actual;
use super::effects::{self, Block, EXPOSURE, LIGHT, Maker, NOISE, Step, quantisation};
use super::forward::{Job, blocks_of};
use super::raw::Raw;
use super::reading::{Kind, Reading};
use super::reduce::reduce;
use crate::control::{Control, Stop};

/// A relative change over readings, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Change {
    /// The largest.
    pub largest: f64,
    /// Root of the mean square.
    pub rms: f64,
}

/// One effect on the scan at hand.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Contribution {
    /// Its name.
    pub effect: &'static str,
    /// Whether it is simulated.
    pub on: bool,
    /// Because of what.
    pub why: String,
    /// Whether it is by chance in every reading: then changes are σ over the reading.
    pub noise: bool,
    /// Change of the raw readings of the sample when it is left out; none where it is off, or where the work was stopped.
    pub reading: Option<Change>,
    /// Error that means over cones may add to the largest change.
    pub uncertain: f64,
    /// Change of the reduced BRDF against that of an instrument without its cause: what the reduction leaves of it. None of noise.
    pub reduced: Option<Change>,
    /// Values that are masked because of it.
    pub masked: u64,
    /// Processor time that leaving it out saves, s.
    pub seconds: f64,
    /// Of the simulation's.
    pub share: f64,
}

/// All effects on the scan at hand.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Contributions {
    /// In the order in which they act.
    pub effects: Vec<Contribution>,
    /// Readings that were made, of the sample and of what it is compared with.
    pub readings: usize,
    /// Processor time of all passes, s.
    pub seconds: f64,
    /// Largest relative error of means over source and aperture.
    pub quadrature_error: f64,
}

impl Job<'_> {
    /// What every effect contributes to the readings of this job.
    #[must_use]
    pub fn contributions(&self, control: Control<'_>) -> Contributions {
        let (readings, actual) = self.prepare();
        Study::new(self, &readings, &actual, Control::silent().stop).contributions(control)
    }
}

/// Readings without noise, and the light that they started from.
pub(super) struct Study<'a> {
    job: &'a Job<'a>,
    readings: &'a [Reading],
    actual: &'a Actual,
    stop: &'a Stop,
    fresh: Vec<Block<'a>>,
    lit: Vec<Block<'a>>,
    /// Electrons before the detector.
    exposed: Vec<f64>,
    base: Vec<f64>,
    /// Seconds of every pass, noise among them.
    times: Vec<(&'static str, f64)>,
    pub quadrature_error: f64,
}

impl<'a> Study<'a> {
    /// Once `stop` is requested what it says means nothing.
    pub fn new(job: &'a Job<'a>, readings: &'a [Reading], actual: &'a Actual, stop: &'a Stop) -> Self {
        let block = |range: Range<usize>| job.block(&readings[range.clone()], range.start);
        let fresh: Vec<Block<'a>> = blocks_of(readings).into_iter().map(block).collect();
        let maker = Maker { stop, ..job.maker(actual) };
        let all = effects::passes(&maker, job.left_out);
        let (lit, mut times) = apply(&fresh, &all[..after(&all, LIGHT)]);
        times.extend(apply(&lit, &all[after(&all, LIGHT)..]).1);
        let quiet = effects::passes(&maker, &[job.left_out, &NOISE[..]].concat());
        let (exposed, _) = apply(&lit, &quiet[after(&quiet, LIGHT)..after(&quiet, EXPOSURE)]);
        let (base, _) = apply(&exposed, &quiet[after(&quiet, EXPOSURE)..]);
        let quadrature_error = worst(&lit);
        let (exposed, base) = (joined(&exposed), joined(&base));
        Self { job, readings, actual, stop, fresh, lit, exposed, base, times, quadrature_error }
    }

    pub fn contributions(&self, control: Control<'_>) -> Contributions {
        let seconds: f64 = self.times.iter().map(|(_, s)| s).sum();
        let plan = effects::plan(self.job.instrument, self.job.channels).effects;
        let base = self.reduced(self.base.clone(), None);
        control.progress.start("effects", plan.len() as u64);
        let one = |effect: crate::control::Effect| {
            let on = effect.on && !self.job.left_out.contains(&effect.name);
            let mut found = blank(effect.name, on, effect.why);
            if on && !control.stop.requested() {
                self.study(&mut found, base.as_deref());
                found.share = if seconds > 0.0 { found.seconds / seconds } else { 0.0 };
            }
            control.progress.advance(1);
            found
        };
        let effects = plan.into_iter().map(one).collect();
        control.progress.finish();
        Contributions { effects, readings: self.readings.len(), seconds, quadrature_error: self.quadrature_error }
    }

    /// Fills in what is found of an effect that is on.
    fn study(&self, found: &mut Contribution, base: Option<&[f64]>) {
        let name = found.effect;
        found.seconds = self.seconds_of(name);
        if found.noise {
            found.reading = Some(self.noise(name));
            return;
        }
        let (less, light_seconds, error) = self.without(&[name]);
        found.reading = Some(self.change(&less));
        if effects::turns_light(name) {
            found.uncertain = self.quadrature_error + error;
        }
        if effects::is_mean(name) {
            found.seconds = (self.seconds_of(LIGHT) - light_seconds).max(0.0);
        }
        if let (Some(base), Some(less)) = (base, self.reduced(less, Some(name))) {
            found.reduced = Some(summary(base.iter().copied().zip(less.iter().copied())));
            found.masked = base.iter().zip(&less).filter(|(a, b)| a.is_nan() && !b.is_nan()).count() as u64;
        }
    }

    /// Readings without noise and without these effects, the seconds of their light, and the error of their means over cones.
    pub fn without(&self, names: &[&str]) -> (Vec<f64>, f64, f64) {
        let left_out = [self.job.left_out, &NOISE[..], names].concat();
        let maker = Maker { stop: self.stop, ..self.job.maker(self.actual) };
        let steps = effects::passes(&maker, &left_out);
        let anew = names.iter().any(|name| effects::turns_light(name));
        let (from, first) = if anew { (&self.fresh, 0) } else { (&self.lit, after(&steps, LIGHT)) };
        let (blocks, times) = apply(from, &steps[first..]);
        let light = times.iter().filter(|(name, _)| *name == LIGHT).map(|(_, s)| s).sum();
        (joined(&blocks), light, worst(&blocks))
    }

    /// By how much the sample's readings differ from these.
    pub fn change(&self, less: &[f64]) -> Change {
        summary(self.of_sample().map(|i| (self.base[i], less[i])))
    }

    /// σ of a noise over the sample's readings.
    fn noise(&self, name: &str) -> Change {
        let instrument = self.job.instrument;
        let sigma = |i: usize| match NOISE.iter().position(|n| *n == name) {
            Some(0) => self.exposed[i].max(0.0).sqrt(),
            Some(1) => instrument.read_noise,
            _ => quantisation::step(&instrument.detector) / 12f64.sqrt(),
        };
        let share = |i: usize| {
            let (sigma, signal) = (sigma(i), self.base[i].abs());
            if sigma >= signal && sigma > 0.0 { 1.0 } else { sigma / signal.max(f64::MIN_POSITIVE) }
        };
        gathered(self.of_sample().map(share))
    }

    /// Places of the sample's signals.
    fn of_sample(&self) -> impl Iterator<Item = usize> {
        let width = self.job.channels.len();
        let sample = self.readings.iter().enumerate().filter(|(_, r)| r.kind == Kind::Sample);
        sample.flat_map(move |(i, _)| i * width..(i + 1) * width)
    }

    /// What signals reduce to, by an instrument without the cause of one effect.
    fn reduced(&self, signal: Vec<f64>, left_out: Option<&str>) -> Option<Vec<f64>> {
        let instrument = self.job.instrument;
        let instrument = left_out.map_or_else(|| instrument.clone(), |name| effects::without(instrument, name));
        let raw: Raw = self.job.raw(self.readings.to_vec(), signal, 0.0);
        reduce("", &raw, &instrument, None).ok().map(|reduction| reduction.measurement.values)
    }

    fn seconds_of(&self, name: &str) -> f64 {
        self.times.iter().filter(|(n, _)| *n == name).map(|(_, s)| s).sum()
    }
}

fn blank(effect: &'static str, on: bool, why: String) -> Contribution {
    let noise = NOISE.contains(&effect);
    Contribution {
        effect,
        on,
        why,
        noise,
        reading: None,
        uncertain: 0.0,
        reduced: None,
        masked: 0,
        seconds: 0.0,
        share: 0.0,
    }
}

/// How many steps there are up to and with this one.
fn after(steps: &[Step<'_>], name: &str) -> usize {
    steps.iter().position(|s| s.name == name).map_or(0, |at| at + 1)
}

/// Copies of blocks, taken through some steps, and the seconds of each.
fn apply<'b>(blocks: &[Block<'b>], steps: &[Step<'_>]) -> (Vec<Block<'b>>, Vec<(&'static str, f64)>) {
    let through = |block: &Block<'b>| {
        let mut block = block.clone();
        let timed = |step: &Step<'_>| {
            let clock = Instant::now();
            step.pass.apply(&mut block);
            clock.elapsed().as_secs_f64()
        };
        let seconds: Vec<f64> = steps.iter().map(timed).collect();
        (block, seconds)
    };
    let (blocks, seconds): (Vec<Block<'b>>, Vec<Vec<f64>>) = blocks.par_iter().map(through).collect();
    let sum = |k: usize| seconds.iter().map(|of_block| of_block[k]).sum();
    (blocks, steps.iter().enumerate().map(|(k, step)| (step.name, sum(k))).collect())
}

fn joined(blocks: &[Block<'_>]) -> Vec<f64> {
    blocks.iter().flat_map(|b| b.signal.iter().copied()).collect()
}

fn worst(blocks: &[Block<'_>]) -> f64 {
    blocks.iter().map(|b| b.error).fold(0.0, f64::max)
}

/// Relative change of pairs of which both are known.
fn summary(pairs: impl Iterator<Item = (f64, f64)>) -> Change {
    let known = pairs.filter(|(a, b)| a.is_finite() && b.is_finite());
    gathered(known.map(|(a, b)| if a == b { 0.0 } else { ((a - b).abs() / a.abs().max(b.abs())).min(1.0) }))
}

fn gathered(changes: impl Iterator<Item = f64>) -> Change {
    let (mut largest, mut squares, mut count) = (0.0f64, 0.0, 0u64);
    for change in changes.filter(|c| c.is_finite()) {
        largest = largest.max(change);
        squares += change * change;
        count += 1;
    }
    Change { largest, rms: (squares / count.max(1) as f64).sqrt() }
}
