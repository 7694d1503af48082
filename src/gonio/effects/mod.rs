//! The effects of a real instrument, one file each, as passes over blocks of readings.
//!
//! In: readings with the directions that were meant. Out: electrons, as the converter counts them. Each effect is a [`Pass`] that exists only if
//! the instrument calls for it; what is off is not among the passes, so that it costs nothing and changes no bit.

mod aperture;
mod band;
pub(super) mod cone;
mod dark;
mod divergence;
mod exposure;
pub(super) mod footprint;
pub(super) mod height;
mod jitter;
pub(super) mod light;
mod nonlinearity;
mod offset;
mod power;
pub(super) mod quantisation;
mod read_noise;
mod saturation;
pub(super) mod shadow;
mod shot;
mod spot;
mod stray;
pub(super) mod tilt;
mod zero;

use glam::DVec3;

use super::actual::Actual;
use super::afford::Deadline;
use super::instrument::Instrument;
use super::reading::Reading;
use super::simulate::Truth;
use crate::brdf::Material;
use crate::control::{Plan, Stop};
use crate::measurement::Dimension;

/// Some readings in a row, on their way from directions to electrons.
#[derive(Clone)]
pub(super) struct Block<'a> {
    /// Index of the first in the series.
    pub first: usize,
    /// The readings.
    pub readings: &'a [Reading],
    /// Directions to source and detector, in the frame of what is read.
    pub wi: Vec<DVec3>,
    pub wo: Vec<DVec3>,
    /// Channels that are read.
    pub width: usize,
    /// Electrons a second, later electrons: those of a reading's channels together. NaN where the truth is not known.
    pub signal: Vec<f64>,
    /// Largest share by which a quadrature may be off.
    pub error: f64,
    /// How many of the readings are done; fewer than there are where a pass was stopped.
    pub done: usize,
}

impl Block<'_> {
    /// Multiplies all channels of reading `i`.
    fn scale(&mut self, i: usize, factor: f64) {
        self.of(i).iter_mut().for_each(|s| *s *= factor);
    }

    /// Adds to all channels of reading `i`.
    fn add(&mut self, i: usize, more: f64) {
        self.of(i).iter_mut().for_each(|s| *s += more);
    }

    fn of(&mut self, i: usize) -> &mut [f64] {
        &mut self.signal[i * self.width..(i + 1) * self.width]
    }
}

/// One step of a reading.
pub(super) trait Pass: Sync {
    /// Works on all readings of the block.
    fn apply(&self, block: &mut Block<'_>);
}

/// What the passes are made from.
pub(super) struct Maker<'a> {
    pub instrument: &'a Instrument,
    pub dimension: Dimension,
    pub channels: &'a [String],
    pub actual: &'a Actual,
    pub truth: &'a Truth<'a>,
    /// The truth where it is a sum of lobes.
    pub lobes: Option<&'a Material>,
    /// Whether the truth has kinks.
    pub kinked: bool,
    pub seed: u64,
    /// Relative error that quadratures may have.
    pub accuracy: f64,
    /// The order that they have whatever that leaves, where it is set.
    pub order: Option<u32>,
    /// Looked at between readings where one takes long.
    pub stop: &'a Stop,
    /// When means over cones have to be done, where that is asked for.
    pub deadline: Option<Deadline>,
}

/// The effect of a file: its name, and whether and why an instrument calls for it in these channels.
struct Entry {
    name: &'static str,
    /// `Ok` with the reason for it, `Err` with that against it.
    calls: fn(&Instrument, &[String]) -> Result<String, String>,
    /// Makes an instrument one without it.
    remove: fn(&mut Instrument),
    /// Its pass, where it has one of its own.
    make: for<'a> fn(&Maker<'a>) -> Option<Box<dyn Pass + 'a>>,
}

/// Effects on where light comes from and goes to.
const GEOMETRY: [Entry; 7] =
    [zero::EFFECT, jitter::EFFECT, tilt::EFFECT, height::EFFECT, spot::EFFECT, divergence::EFFECT, aperture::EFFECT];
/// Effects on the flux, electrons a second.
const FLUX: [Entry; 6] = [band::EFFECT, footprint::EFFECT, shadow::EFFECT, stray::EFFECT, power::EFFECT, dark::EFFECT];
/// Effects on the electrons of a reading.
const DETECTOR: [Entry; 7] = [
    exposure::EFFECT,
    shot::EFFECT,
    offset::EFFECT,
    saturation::EFFECT,
    nonlinearity::EFFECT,
    read_noise::EFFECT,
    quantisation::EFFECT,
];

fn effects() -> impl Iterator<Item = &'static Entry> {
    GEOMETRY.iter().chain(&FLUX).chain(&DETECTOR)
}

/// Which effects the instrument calls for when it reads a material of these channels, in the order in which they act, and why.
#[must_use]
pub fn plan(instrument: &Instrument, channels: &[String]) -> Plan {
    let mut plan = Plan::default();
    for effect in effects() {
        match (effect.calls)(instrument, channels) {
            Ok(why) => plan.push(effect.name, true, why),
            Err(why) => plan.push(effect.name, false, why),
        }
    }
    plan
}

/// The effects that make readings means over directions, of those that the instrument calls for: the only ones that an accuracy, or the time for it, is asked for.
#[must_use]
pub fn means(instrument: &Instrument, channels: &[String]) -> Vec<&'static str> {
    plan(instrument, channels).effects.iter().filter(|e| e.on && is_mean(e.name)).map(|e| e.name).collect()
}

/// Effects by chance, anew in every reading: what they do is a standard deviation.
pub(super) const NOISE: [&str; 3] = [shot::EFFECT.name, read_noise::EFFECT.name, quantisation::EFFECT.name];
/// The two passes that every reading takes.
pub(super) const LIGHT: &str = "light";
pub(super) const EXPOSURE: &str = "exposure";

/// Whether the light itself must be worked out anew to tell what the effect does.
pub(super) fn turns_light(name: &str) -> bool {
    GEOMETRY.iter().any(|e| e.name == name)
}

/// Whether the effect is one of the means over directions, which have no pass of their own.
pub(super) fn is_mean(name: &str) -> bool {
    [spot::EFFECT.name, divergence::EFFECT.name, aperture::EFFECT.name].contains(&name)
}

/// The instrument without an effect's cause.
pub(super) fn without(instrument: &Instrument, name: &str) -> Instrument {
    let mut less = instrument.clone();
    effects().filter(|e| e.name == name).for_each(|e| (e.remove)(&mut less));
    less
}

/// A pass and the effect's name.
pub(super) struct Step<'a> {
    pub name: &'static str,
    pub pass: Box<dyn Pass + 'a>,
}

/// The passes of those effects that are on, and not left out by name, among the two that every reading takes: the light and the exposure.
pub(super) fn passes<'a>(maker: &Maker<'a>, left_out: &[&str]) -> Vec<Step<'a>> {
    let on = |e: &&Entry| (e.calls)(maker.instrument, maker.channels).is_ok() && !left_out.contains(&e.name);
    let step = |e: &Entry| (e.make)(maker).map(|pass| Step { name: e.name, pass });
    let of = |list: &'static [Entry]| list.iter().filter(on).filter_map(step).collect::<Vec<_>>();
    let [geometry, flux, detector] = [of(&GEOMETRY), of(&FLUX), of(&DETECTOR)];
    let light = Step { name: LIGHT, pass: light::pass(maker, left_out) };
    let exposure = Step { name: EXPOSURE, pass: Box::new(light::Exposure) };
    geometry.into_iter().chain([light]).chain(flux).chain([exposure]).chain(detector).collect()
}

/// "on" with a number and its unit, "off" for 0.
fn stated(value: f64, name: &str, unit: &str) -> Result<String, String> {
    if value > 0.0 { Ok(format!("{name} = {value}{unit}")) } else { Err(format!("{name} = 0")) }
}
