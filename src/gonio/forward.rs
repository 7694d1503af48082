//! The forward simulation: a truth, an instrument and directions to raw readings.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::actual::Actual;
use super::afford::Deadline;
use super::effects::light::reference_pair;
use super::effects::{self, Block, Maker};
use super::instrument::Instrument;
use super::raw::Raw;
use super::reading::{Kind, Reading};
use super::scan::kept_weights;
use super::series::series;
use super::simulate::Truth;
use crate::brdf::Material;
use crate::control::{Control, counted};
use crate::measurement::{Dimension, Directions, STOPPED, Weights};

/// Of how many readings a block is that a thread takes at once, about: few enough that a small scan is work for all.
pub(super) fn block_of(all: usize) -> usize {
    (all / 32).clamp(32, MOST)
}

/// Readings of a block at most.
const MOST: usize = 4096;

/// Readings in blocks, in order of time: whole stops, whose mean over cones is made once, unless one alone is long.
pub(super) fn blocks_of(readings: &[Reading]) -> Vec<Range<usize>> {
    let (n, size) = (readings.len(), block_of(readings.len()));
    let (mut blocks, mut start) = (Vec::new(), 0);
    for end in 1..=n {
        let is_whole = end == n || readings[end].stop != readings[end - 1].stop;
        if end == n || end - start >= MOST || is_whole && end - start >= size {
            blocks.push(start..end);
            start = end;
        }
    }
    blocks
}

/// What is to be read, and how.
pub struct Job<'a> {
    /// What stands on the holder.
    pub truth: &'a Truth<'a>,
    /// The same where it is a sum of lobes: means over wide cones are then known without sums over directions.
    pub lobes: Option<&'a Material>,
    /// Whether it has kinks, as a table has that is linear between its values: means over cones must then be surer of what they leave.
    pub kinked: bool,
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
    /// One order of the rules over source, aperture and spot, instead of those that `accuracy` asks for: 1 to twice [`MOST_ORDER`]. What it leaves is not
    /// known then: [`Raw::quadrature_error`] is infinite.
    pub order: Option<u32>,
    /// Effects that are left out, by name.
    pub left_out: &'a [&'a str],
}

/// The relative error of means over source and aperture, if nothing else is asked for.
pub const ACCURACY: f64 = 1e-6;
/// Largest order that one may set: two cones and a spot take some 10⁸ directions a reading then.
pub const MOST_ORDER: u32 = 16;

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

impl<'a> Job<'a> {
    /// In space, each pair once, everything on, to [`ACCURACY`]; of the truth no more is known than its values.
    #[must_use]
    pub fn new(
        truth: &'a Truth<'a>,
        channels: &'a [String],
        instrument: &'a Instrument,
        (directions, weights): (&'a Directions, &'a Weights),
    ) -> Self {
        Self {
            truth,
            lobes: None,
            kinked: false,
            channels,
            instrument,
            dimension: Dimension::Space,
            directions,
            weights,
            rows: &[],
            seed: 0,
            accuracy: ACCURACY,
            order: None,
            left_out: &[],
        }
    }
}

impl Job<'_> {
    /// Reads all pairs of directions above the horizon, with this instrument's own errors.
    #[must_use]
    pub fn run(&self, control: Control<'_>) -> Raw {
        self.run_until(None, control)
    }

    /// As [`Job::run`]; readings that would be late take the lowest orders, as [`Raw::quadrature_error`] says.
    #[must_use]
    pub fn run_until(&self, deadline: Option<Deadline>, control: Control<'_>) -> Raw {
        let (readings, actual) = self.prepare();
        self.read_until(readings, &actual, deadline, control)
    }

    /// The readings that are to be made, and what the instrument is really like.
    pub(super) fn prepare(&self) -> (Vec<Reading>, Actual) {
        let readings = series(self.instrument, self.directions, &lit_rows(self.directions, self.rows));
        let actual = Actual::draw(self.instrument, &readings, self.seed).within(self.dimension);
        (readings, actual)
    }

    /// Reads everything by an instrument with the errors `actual`. Where the work is stopped what comes back is the beginning of the run, up to the last
    /// pair of directions after a whole visit, and a note says so.
    #[must_use]
    pub fn read(&self, readings: Vec<Reading>, actual: &Actual, control: Control<'_>) -> Raw {
        self.read_until(readings, actual, None, control)
    }

    fn read_until(
        &self,
        mut readings: Vec<Reading>,
        actual: &Actual,
        deadline: Option<Deadline>,
        control: Control<'_>,
    ) -> Raw {
        let deadline = deadline.map(Deadline::begun_now);
        let passes = effects::passes(&Maker { stop: control.stop, deadline, ..self.maker(actual) }, self.left_out);
        let (width, ranges) = (self.channels.len(), blocks_of(&readings));
        control.progress.start("reading", readings.len() as u64);
        let next = AtomicUsize::new(0);
        // Blocks are taken in order of time, so that what is read before a stop has no holes.
        let worker = |_| {
            let mut done = Vec::new();
            while !control.stop.requested() {
                let b = next.fetch_add(1, Ordering::Relaxed);
                let Some(range) = ranges.get(b) else { break };
                let mut block = self.block(&readings[range.clone()], range.start);
                passes.iter().for_each(|step| step.pass.apply(&mut block));
                control.progress.advance(block.done as u64);
                done.push((b, block.done, block.signal, block.error));
            }
            done
        };
        let workers = 0..rayon::current_num_threads().max(1);
        let mut blocks: Vec<(usize, usize, Vec<f64>, f64)> =
            workers.into_par_iter().with_max_len(1).flat_map_iter(worker).collect();
        control.progress.finish();
        blocks.sort_unstable_by_key(|(b, ..)| *b);
        // Up to the first block that is missing, and with the first that is not whole.
        let is_whole = |(k, (b, done, ..)): &(usize, &(usize, usize, _, _))| k == b && *done == ranges[*b].len();
        let whole = blocks.iter().enumerate().take_while(is_whole).count();
        let part = blocks.get(whole).filter(|(b, ..)| *b == whole).map_or(0, |(_, done, ..)| *done);
        blocks.truncate(whole + usize::from(part > 0));
        let quadrature_error = blocks.iter().map(|b| b.3).fold(0.0, f64::max);
        let (kept, note) = ended(&readings, ranges[..whole].last().map_or(0, |range| range.end) + part);
        let mut signal = Vec::with_capacity(kept * width);
        blocks.into_iter().for_each(|(.., part, _)| signal.extend(part));
        readings.truncate(kept);
        signal.truncate(kept * width);
        let raw = self.raw(readings, signal, quadrature_error);
        if note.is_none() { raw } else { Raw { notes: note.into_iter().collect(), ..of_what_was_read(raw) } }
    }

    /// What passes are made from.
    pub(super) fn maker<'b>(&'b self, actual: &'b Actual) -> Maker<'b> {
        let Self { truth, lobes, kinked, channels, instrument, seed, accuracy, order, dimension, .. } = *self;
        let stop = Control::silent().stop;
        Maker {
            instrument,
            dimension,
            channels,
            actual,
            truth,
            lobes,
            kinked,
            seed,
            accuracy,
            order,
            stop,
            deadline: None,
        }
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
            notes: Vec::new(),
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
        Block {
            first,
            readings,
            wi,
            wo,
            width,
            signal: vec![1.0; readings.len() * width],
            error: 0.0,
            done: readings.len(),
        }
    }
}

/// Without the listed pairs of directions that no reading belongs to; a grid stays whole.
fn of_what_was_read(mut raw: Raw) -> Raw {
    let Directions::List { wi, wo } = &raw.directions else { return raw };
    let mut place = vec![None; wi.len()];
    raw.readings.iter().filter_map(|r| r.entry).for_each(|entry| place[entry as usize] = Some(0));
    let kept: Vec<usize> = (0..place.len()).filter(|i| place[*i].is_some()).collect();
    kept.iter().zip(0..).for_each(|(i, new)| place[*i] = Some(new));
    let of = |list: &[DVec3]| kept.iter().map(|&i| list[i]).collect();
    raw.directions = Directions::List { wi: of(wi), wo: of(wo) };
    raw.weights = kept_weights(raw.weights, &kept);
    raw.readings.iter_mut().for_each(|r| r.entry = r.entry.and_then(|entry| place[entry as usize]));
    raw
}

/// How many of the first `read` readings count, and what to say where that is not all: a visit that was not finished says too little of what it is
/// for.
fn ended(readings: &[Reading], read: usize) -> (usize, Option<String>) {
    let Some(next) = readings.get(read) else { return (read, None) };
    let last = || readings[..read].iter().rposition(|r| r.kind == Kind::Sample).map_or(0, |last| last + 1);
    let kept = if next.kind == Kind::Sample && read > 0 { read } else { last() };
    let (before, after) = readings.split_at(kept);
    let seen: HashSet<u32> = before.iter().filter_map(|r| r.entry).collect();
    let missed: HashSet<u32> = after.iter().filter_map(|r| r.entry).filter(|e| !seen.contains(e)).collect();
    let (pairs, all) = (counted(missed.len() as u64, "pair"), readings.len());
    (kept, Some(format!("{STOPPED}{kept} of {all} readings: {pairs} of directions not read")))
}
