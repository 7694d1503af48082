//! The way back: raw readings to BRDF ± σ, with what readings share.
//!
//! Per reading f = (s − b)/(r − b) · f_ref cosθref share_ref/(cosθo share), all of them rates: s the sample's, b the blank's (else the dark's), r the
//! reference's, b and r interpolated between the visits before and after. Without a reference the gain is taken as stated. What is
//! measured is f averaged over the cones of source and aperture, weighed by cosθo: ⟨f cosθo⟩/⟨cosθo⟩.

mod alike;
mod bend;
mod budget;
mod curve;
mod effect;
mod noise;
pub(super) mod positions;
mod scatter;
mod shared;
mod spread;
mod stops;
mod visits;

use glam::DVec3;

pub use budget::{Budget, Line, Type};
pub(super) use stops::limit as saturation_limit;

use self::noise::Noise;
use self::shared::Shared;
use self::stops::{Rate, Stop};
use self::visits::Visits;
use super::effects::footprint::Footprint;
use super::effects::light::{Standard, reference_pair};
use super::effects::shadow::may_be_shadowed;
use super::instrument::Instrument;
use super::raw::Raw;
use super::reading::Kind;
use super::simulate::Truth;
use super::spot::Spot;
use crate::control::counted;
use crate::measurement::reason::{self, MaskReason};
use crate::measurement::{Dimension, Masked, Measurement};

/// Why raw readings can't be reduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReduceError {
    /// No reading of the sample.
    #[error("no reading of the sample")]
    NoSample,
    /// A reference is described, but was not read.
    #[error(
        "instrument.reference.reflectance = {reflectance} describes a reference, and no reading of it is there; expected one at least (kind `reference`), or \
         a description without one (reflectance = 0), the gain being known (instrument.electrons)"
    )]
    UnreadReference {
        /// Its certificate.
        reflectance: f64,
    },
    /// Readings of the reference without its certificate.
    #[error("the reference was read, but its reflectance is not stated (instrument.reference.reflectance)")]
    NoCertificate,
    /// Of one channel no reading of the reference can be used.
    #[error(
        "channel {channel}: every reading of the reference is saturated or missing; expected one below the full well at least (shorter exposures?)"
    )]
    UnreadableReference {
        /// The channel.
        channel: String,
    },
    /// The reference is no brighter than what is read without it.
    #[error(
        "channel {channel}: the reference reads {rate} a second at {time_s} s, expected more than the blank's or dark's {base} a second"
    )]
    DarkReference {
        /// The channel.
        channel: String,
        /// When, s.
        time_s: f64,
        /// Signal a second.
        rate: f64,
        /// Signal a second of blank or dark at that time.
        base: f64,
    },
}

/// Readings, reduced.
#[derive(Debug)]
pub struct Reduction {
    /// The BRDF with σ and shared components.
    pub measurement: Measurement,
    /// Where the uncertainty comes from.
    pub budget: Budget,
    /// Why σ is not stated, where it is not.
    pub unstated: Option<String>,
}

/// Reduces readings that an instrument of this description made. `model` is what is read, about (the material's mean over source
/// and aperture): errors of positions are worked out from its
/// slopes; without it they are left out, and a note says so.
///
/// # Errors
/// [`ReduceError`].
pub fn reduce(
    name: &str,
    raw: &Raw,
    instrument: &Instrument,
    model: Option<&Truth<'_>>,
) -> Result<Reduction, ReduceError> {
    let summaries = stops::summaries(raw, instrument);
    let noise = Noise::of(raw, &summaries, instrument);
    let stops: Vec<Stop> = summaries.iter().map(|summary| summary.stop(&noise, instrument)).collect();
    let has_reference = stops.iter().any(|s| s.kind == Kind::Reference);
    if !stops.iter().any(|s| s.kind == Kind::Sample) {
        return Err(ReduceError::NoSample);
    }
    if has_reference != instrument.has_reference() {
        let unread = || ReduceError::UnreadReference { reflectance: instrument.reference.reflectance };
        return Err(if has_reference { ReduceError::NoCertificate } else { unread() });
    }
    let visits = Visits::new(&stops, raw, instrument)?;
    let mut notes = noise.notes(raw, &summaries, instrument);
    notes.extend(visits.unmatched(&stops));
    let work = Work { raw, instrument, noise, scale: Scale::new(instrument, raw.dimension), visits };
    let mut reduction = work.run(name, &stops, model);
    reduction.measurement.notes.extend(notes);
    Ok(reduction)
}

/// What turns a net rate into a BRDF.
struct Scale {
    footprint: Option<Footprint>,
    spot: Option<Spot>,
    /// The mean of cosθo over the aperture, over its value in the middle.
    mean_cos: f64,
    /// f_ref cosθref share_ref; where there is no reference, 1 over the gain.
    reference: f64,
}

impl Scale {
    fn new(instrument: &Instrument, dimension: Dimension) -> Self {
        let footprint = Footprint::of(instrument, dimension);
        let (wi, wo) = reference_pair(&instrument.reference);
        let share = footprint.map_or(1.0, |f| f.share(wi, wo));
        let standard = Standard::new(&instrument.reference, 0.0, dimension);
        let mean_cos = mean_cos(instrument, dimension);
        let spot = Spot::of(instrument, dimension);
        let of_standard = of_reference(&standard, spot.as_ref(), (wi, wo)) * mean_cos * share;
        Self {
            footprint,
            spot,
            mean_cos,
            reference: if instrument.has_reference() { of_standard } else { 1.0 / instrument.gain() },
        }
    }

    /// BRDF over (net rate / reference's net rate), or over the net rate; not a number where there is none.
    fn of(&self, wi: DVec3, wo: DVec3) -> f64 {
        if self.spot.as_ref().is_some_and(|spot| !spot.is_within((wi, wo))) {
            return f64::NAN;
        }
        let cosine = self.spot.as_ref().map_or(wo.z, |spot| spot.cosine((wi, wo)));
        self.reference / (cosine * self.mean_cos * self.footprint.map_or(1.0, |f| f.share(wi, wo)))
    }
}

/// The mean of the standard's f·cosθo over the spot.
fn of_reference(standard: &Standard, spot: Option<&Spot>, (wi, wo): (DVec3, DVec3)) -> f64 {
    let Some(spot) = spot else { return standard.value(wi, wo) * wo.z };
    spot.mean((wi, wo), |wi, wo| standard.value(wi, wo) * wo.z)
}

/// The mean of cosθo over the aperture, over its value in the middle.
fn mean_cos(instrument: &Instrument, dimension: Dimension) -> f64 {
    let half = instrument.detector.half_angle();
    match dimension {
        Dimension::Space => (0.5 * half).cos().powi(2),
        Dimension::Flat if half == 0.0 => 1.0,
        Dimension::Flat => half.sin() / half,
    }
}

struct Work<'a> {
    raw: &'a Raw,
    instrument: &'a Instrument,
    noise: Noise,
    scale: Scale,
    visits: Visits,
}

impl Work<'_> {
    fn run(self, name: &str, stops: &[Stop], model: Option<&Truth<'_>>) -> Reduction {
        let (n, width) = (self.raw.directions.len(), self.raw.channels.len());
        let mut table = Table { values: vec![f64::NAN; n * width], variance: vec![0.0; n * width] };
        let end_s = self.raw.readings.last().map_or(0.0, |r| r.time_s + r.exposure_s);
        let mut shared = Shared::new(n, width, (&self.visits, end_s), self.instrument);
        let mut left = vec![None; n];
        let samples: Vec<(&Stop, usize)> = stops
            .iter()
            .filter(|s| s.kind == Kind::Sample)
            .filter_map(|s| s.entry.map(|e| (s, e as usize)).filter(|(_, e)| *e < n))
            .collect();
        // Of a pair that was read at several stops the mean counts.
        let mut times = vec![0u32; n * width];
        for (stop, entry) in &samples {
            (0..width).filter(|c| stop.rates[*c].is_some()).for_each(|c| times[c * n + entry] += 1);
        }
        for (stop, entry) in samples {
            self.entry(stop, entry, &times, &mut table, &mut shared, &mut left);
        }
        if let Some(model) = model {
            positions::add(self.raw, self.instrument, model, &mut table, &mut shared);
        }
        let budget = shared.budget(&table);
        let row = shared.row(&table, width).filter(|_| self.noise.is_known());
        shared.own_into(&mut table);
        let mut notes = notes_of(&left);
        if model.is_none() && positions::matter(self.instrument) {
            notes.push(
                "errors of positions are not in σ: there was no model of the material to tell their effect".into(),
            );
        }
        let marked = table.values.iter().filter(|v| v.is_nan()).count() as u64;
        let measurement = Measurement {
            notes,
            origin: format!("reduced from {}{}", counted(self.raw.readings.len() as u64, "reading"), self.noise.said()),
            dimension: self.raw.dimension,
            weights: self.raw.weights.clone(),
            masked: Masked { marked, ..Masked::default() },
            reasons: if left.iter().all(Option::is_none) { Vec::new() } else { left },
            sigma: self.noise.is_known().then(|| table.sigma()),
            common: shared.planes(),
            row,
            ..Measurement::new(name, self.raw.directions.clone(), self.raw.channels.clone(), table.values)
        };
        Reduction { measurement, budget, unstated: self.noise.unstated() }
    }

    /// Reduces one stop at a pair of directions.
    fn entry(
        &self,
        stop: &Stop,
        entry: usize,
        times: &[u32],
        table: &mut Table,
        shared: &mut Shared<'_>,
        left: &mut [Option<MaskReason>],
    ) {
        let (wi, wo) = self.raw.directions.pair(entry);
        let factor = self.scale.of(wi, wo);
        let n = self.raw.directions.len();
        for (c, rate) in stop.rates.iter().enumerate() {
            let place = c * n + entry;
            if may_be_shadowed(wi, wo, self.instrument) {
                left[entry] = Some(MaskReason::Shadowed);
                continue;
            }
            if !factor.is_finite() || wi.z <= 0.0 || wo.z <= 0.0 {
                left[entry] = Some(MaskReason::Unlit);
                continue;
            }
            let &Some(rate) = rate else {
                if times[place] == 0 {
                    let reason = if stop.saturated[c] { MaskReason::Saturated } else { MaskReason::Unread };
                    left[entry] = Some(left[entry].map_or(reason, |other| other.min(reason)));
                }
                continue;
            };
            let at = self.visits.at(stop.time_s, c, rate.exposure_s);
            let share = 1.0 / f64::from(times[place]);
            let conversion = share * factor / at.reference;
            let value = conversion * (rate.mean - at.base);
            let sum = &mut table.values[place];
            *sum = if sum.is_nan() { value } else { *sum + value };
            shared.reading(place, c, &Reduced { value, conversion, rate, at, time_s: stop.time_s });
        }
    }
}

/// Values and their independent variances, channel-major.
struct Table {
    values: Vec<f64>,
    variance: Vec<f64>,
}

impl Table {
    /// Independent σ of every value, NaN where there is none.
    fn sigma(&self) -> Vec<f64> {
        let of = |(value, variance): (&f64, &f64)| if value.is_nan() { f64::NAN } else { variance.sqrt() };
        self.values.iter().zip(&self.variance).map(of).collect()
    }
}

/// A reduced reading, and what it was made from.
struct Reduced {
    value: f64,
    /// BRDF over net rate.
    conversion: f64,
    rate: Rate,
    at: visits::At,
    time_s: f64,
}

/// What to tell of the pairs that are masked.
fn notes_of(reasons: &[Option<MaskReason>]) -> Vec<String> {
    let note = |(reason, count): (MaskReason, usize)| {
        let are = if count == 1 { "is" } else { "are" };
        format!("{} of directions {are} masked: {}", counted(count as u64, "pair"), reason.said())
    };
    reason::counts(reasons).into_iter().map(note).collect()
}
