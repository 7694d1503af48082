//! Visits to the reference, the blank and the dark, and what they say of the time between them.

use super::positions;
use super::stops::Stop;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::reading::Kind;

/// What was read at one visit, channel by channel.
#[derive(Debug, Clone)]
struct Visit {
    time_s: f64,
    /// Rate without the sample's light, and its variance.
    base: Vec<(f64, f64)>,
    /// The reference's net rate and the variance of its own reading.
    reference: Vec<(f64, f64)>,
    /// Signal of one reading of the reference.
    signal: Vec<f64>,
}

/// All visits, in order of time.
pub(super) struct Visits {
    visits: Vec<Visit>,
    /// Whether there is a base, and a reference.
    pub has: [bool; 2],
}

/// What the visits say of one moment and channel.
#[derive(Debug, Clone, Copy)]
pub(super) struct At {
    /// Rate without the sample's light.
    pub base: f64,
    /// The reference's net rate; 1 where there is none.
    pub reference: f64,
    /// The visit before and the one after, and the share of each.
    pub visits: [(usize, f64); 2],
    /// σ of the base at those visits.
    pub base_sigma: [f64; 2],
    /// σ of the reference's reading at those visits.
    pub reference_sigma: [f64; 2],
    /// Signal of one reading of the reference.
    pub reference_signal: f64,
    /// Seconds between those visits.
    pub span_s: f64,
}

impl Visits {
    pub fn new(stops: &[Stop], raw: &Raw, instrument: &Instrument) -> Self {
        let (width, jitter) = (raw.channels.len(), positions::of_reference(instrument, raw.dimension));
        let runs = stops.chunk_by(|a, b| (a.kind == Kind::Sample) == (b.kind == Kind::Sample));
        let visits: Vec<Visit> =
            runs.filter(|run| run[0].kind != Kind::Sample).map(|run| Visit::new(run, width, jitter)).collect();
        let any = |kinds: &[Kind]| stops.iter().any(|s| kinds.contains(&s.kind));
        let has = [any(&[Kind::Blank, Kind::Dark]), any(&[Kind::Reference])];
        Self { visits, has }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.visits.len()
    }

    /// What they say of `time_s`: linear between two, the nearest before the first and after the last.
    pub fn at(&self, time_s: f64, channel: usize) -> At {
        if self.visits.is_empty() {
            let none = [(0, 0.0); 2];
            let (base_sigma, reference_sigma) = ([0.0; 2], [0.0; 2]);
            return At {
                base: 0.0,
                reference: 1.0,
                visits: none,
                base_sigma,
                reference_sigma,
                reference_signal: 0.0,
                span_s: 0.0,
            };
        }
        let after = self.visits.partition_point(|v| v.time_s < time_s);
        let (a, b) = (after.saturating_sub(1), after.min(self.visits.len() - 1));
        let (before, next) = (&self.visits[a], &self.visits[b]);
        let span_s = next.time_s - before.time_s;
        let late = if span_s > 0.0 { (time_s - before.time_s) / span_s } else { 0.0 };
        let mix = |of: fn(&Visit) -> &Vec<(f64, f64)>| {
            let (x, y) = (of(before)[channel], of(next)[channel]);
            ((1.0 - late) * x.0 + late * y.0, [x.1.sqrt(), y.1.sqrt()])
        };
        let (base, base_sigma) = mix(|v| &v.base);
        let (reference, reference_sigma) = mix(|v| &v.reference);
        let reference_signal = before.signal[channel];
        let visits = [(a, 1.0 - late), (b, late)];
        At { base, reference, visits, base_sigma, reference_sigma, reference_signal, span_s }
    }
}

impl Visit {
    /// From the stops of one visit; `jitter` is the relative σ of where the axes stop at the reference.
    fn new(run: &[Stop], width: usize, jitter: f64) -> Self {
        let of = |kind: Kind| run.iter().rfind(|s| s.kind == kind);
        let rate = |kind: Kind, c: usize| of(kind).and_then(|s| s.rates[c]);
        let base: Vec<(f64, f64)> = (0..width)
            .map(|c| rate(Kind::Blank, c).or(rate(Kind::Dark, c)).map_or((0.0, 0.0), |r| (r.mean, r.variance)))
            .collect();
        let reference = |(c, base): (usize, &(f64, f64))| match (of(Kind::Reference), rate(Kind::Reference, c)) {
            (_, Some(r)) => (r.mean - base.0, r.variance + (jitter * (r.mean - base.0)).powi(2)),
            (Some(_), None) => (f64::NAN, f64::NAN), // saturated
            (None, None) => (1.0, 0.0),
        };
        let reference = base.iter().enumerate().map(reference).collect();
        let signal = (0..width).map(|c| rate(Kind::Reference, c).map_or(0.0, |r| r.signal)).collect();
        let time_s = run.iter().map(|s| s.time_s).sum::<f64>() / run.len() as f64;
        Self { time_s, base, reference, signal }
    }
}
