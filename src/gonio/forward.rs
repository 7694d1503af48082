//! The forward simulation: a truth, an instrument and directions to raw readings.

use glam::DVec3;
use rayon::prelude::*;

use super::actual::Actual;
use super::effects::light::reference_pair;
use super::effects::{self, Block, Maker};
use super::instrument::Instrument;
use super::raw::Raw;
use super::reading::{Kind, Reading};
use super::series::series;
use super::simulate::Truth;
use crate::control::Control;
use crate::measurement::{Dimension, Directions, Weights};
use crate::numeric::sum::BLOCK;

/// What is to be read, and how.
pub struct Job<'a> {
    /// What stands on the holder.
    pub truth: &'a Truth<'a>,
    /// Names of its channels.
    pub channels: &'a [String],
    /// The instrument.
    pub instrument: &'a Instrument,
    /// Flat world or space; in the flat world directions lie in the xz plane, and so do all errors of theirs.
    pub dimension: Dimension,
    /// Pairs of directions to measure.
    pub directions: &'a Directions,
    /// What each of them stands for.
    pub weights: &'a Weights,
    /// Which of them are read, in order, as often as they occur; each once where it is empty.
    pub rows: &'a [u32],
    /// Seed of the noise and of the instrument's own errors.
    pub seed: u64,
    /// Relative error that means over source and aperture may have.
    pub accuracy: f64,
    /// Effects that are left out, by name.
    pub left_out: &'a [&'a str],
}

/// The relative error of means over source and aperture, if nothing else is asked for.
pub const ACCURACY: f64 = 1e-6;

/// The pairs of directions above the horizon in the order in which `rows` has them; all in their own order where it is empty.
#[must_use]
pub fn lit_rows(directions: &Directions, rows: &[u32]) -> Vec<u32> {
    let is_lit = |entry: &u32| {
        let (wi, wo) = directions.pair(*entry as usize);
        wi.z > 0.0 && wo.z > 0.0
    };
    let all = || (0..directions.len() as u32).filter(is_lit).collect();
    if rows.is_empty() { all() } else { rows.iter().copied().filter(is_lit).collect() }
}

impl Job<'_> {
    /// Reads all pairs of directions above the horizon, with this instrument's own errors.
    #[must_use]
    pub fn run(&self, control: Control<'_>) -> Raw {
        let (readings, actual) = self.prepare();
        self.read(readings, &actual, control)
    }

    /// The readings that are to be made, and what the instrument is really like.
    pub(super) fn prepare(&self) -> (Vec<Reading>, Actual) {
        let readings = series(self.instrument, self.directions, &lit_rows(self.directions, self.rows));
        let actual = Actual::draw(self.instrument, &readings, self.seed).within(self.dimension);
        (readings, actual)
    }

    /// Reads everything by an instrument with the errors `actual`.
    #[must_use]
    pub fn read(&self, readings: Vec<Reading>, actual: &Actual, control: Control<'_>) -> Raw {
        let passes = effects::passes(&self.maker(actual), self.left_out);
        let (n, width) = (readings.len(), self.channels.len());
        control.progress.start("reading", n as u64);
        let blocks: Vec<(Vec<f64>, f64)> = (0..n.div_ceil(BLOCK))
            .into_par_iter()
            .map(|b| {
                let range = b * BLOCK..((b + 1) * BLOCK).min(n);
                let mut block = self.block(&readings[range.clone()], range.start);
                if control.stop.requested() {
                    block.signal.fill(f64::NAN); // not read
                } else {
                    passes.iter().for_each(|step| step.pass.apply(&mut block));
                }
                control.progress.advance(range.len() as u64);
                (block.signal, block.error)
            })
            .collect();
        control.progress.finish();
        let quadrature_error = blocks.iter().map(|b| b.1).fold(0.0, f64::max);
        let mut signal = Vec::with_capacity(n * width);
        blocks.into_iter().for_each(|(part, _)| signal.extend(part));
        self.raw(readings, signal, quadrature_error)
    }

    /// What passes are made from.
    pub(super) fn maker<'b>(&'b self, actual: &'b Actual) -> Maker<'b> {
        let Self { truth, channels, instrument, seed, accuracy, dimension, .. } = *self;
        Maker { instrument, dimension, channels, actual, truth, seed, accuracy }
    }

    /// Readings with these signals.
    pub(super) fn raw(&self, readings: Vec<Reading>, signal: Vec<f64>, quadrature_error: f64) -> Raw {
        Raw {
            channels: self.channels.to_vec(),
            dimension: self.dimension,
            directions: self.directions.clone(),
            weights: self.weights.clone(),
            readings,
            signal,
            quadrature_error,
        }
    }

    /// Readings in the directions that are meant, the signal 1 yet.
    pub(super) fn block<'b>(&self, readings: &'b [Reading], first: usize) -> Block<'b> {
        let pair = |reading: &Reading| match (reading.kind, reading.entry) {
            (Kind::Sample, Some(entry)) => self.directions.pair(entry as usize),
            (Kind::Reference, _) => reference_pair(&self.instrument.reference),
            _ => (DVec3::Z, DVec3::Z),
        };
        let (wi, wo) = readings.iter().map(pair).unzip();
        let width = self.channels.len();
        Block { first, readings, wi, wo, width, signal: vec![1.0; readings.len() * width], error: 0.0 }
    }
}
