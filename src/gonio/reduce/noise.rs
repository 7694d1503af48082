//! The noise of readings, as the description says it; where it does not, as repeats scatter ([`super::scatter`]).

use super::scatter::Scatter;
use super::stops::{Repeats, Summary, before_rounding, rounding};
use crate::gonio::effects::quantisation::step;
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::reading::Kind;

/// By how much repeats may scatter more or less than described, and of that scatter's own σ, before it is said.
const TOLERATED: f64 = 1.2;
const SURE: f64 = 5.0;

/// What is known of the noise of one reading.
pub(super) enum Noise {
    /// Shot noise of what is above the electronics' offset, at least one electron's worth, and the electronics' variance.
    Described(Described),
    /// As repeats scatter.
    Scattered(Scatter),
    /// Nothing, and why.
    Unknown(String),
}

/// A detector that counts electrons.
pub(super) struct Described {
    read: f64,
    offset: f64,
    step: f64,
}

impl Noise {
    /// What description and repeats tell.
    pub fn of(raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Self {
        if instrument.is_noisy() {
            let step = step(&instrument.detector);
            let (read, offset) = (instrument.read_noise.powi(2), instrument.detector.offset);
            return Self::Described(Described { read, offset, step });
        }
        Scatter::of(raw, summaries, instrument).map_or_else(Self::Unknown, Self::Scattered)
    }

    /// Variance of the mean of repeats, in signals².
    pub fn variance(&self, channel: usize, of: &Repeats, instrument: &Instrument) -> f64 {
        let count = of.count as f64;
        match self {
            Self::Described(known) => {
                let noise = (of.signal - known.offset).max(1.0) + known.read;
                let (common, own) = rounding(noise, known.step);
                common + (noise + own) / count
            }
            Self::Scattered(scatter) => {
                let (shown, step) = (scatter.variance(channel, of, instrument), scatter.step(channel));
                // What does not come and go with repeats does not show in them.
                rounding(before_rounding(shown, step), step).0 + shown / count
            }
            Self::Unknown(_) => 0.0,
        }
    }

    /// Whether there is anything to state.
    pub fn is_known(&self) -> bool {
        !matches!(self, Self::Unknown(_))
    }

    /// Where it comes from; nothing where it was described.
    pub fn said(&self) -> String {
        match self {
            Self::Scattered(scatter) => {
                format!(", their noise from the scatter of repeats ({} degrees of freedom)", scatter.freedom().round())
            }
            _ => String::new(),
        }
    }

    /// What a user must know of it, beside why it is not known.
    pub fn notes(&self, raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Vec<String> {
        match self {
            Self::Described(known) => known.contradictions(raw, summaries, instrument),
            Self::Scattered(scatter) => scatter.notes(raw, summaries, instrument),
            Self::Unknown(_) => Vec::new(),
        }
    }

    /// Why σ is not stated.
    pub fn unstated(&self) -> Option<String> {
        let Self::Unknown(why) = self else { return None };
        Some(format!(
            "σ is not stated, in any channel: the detector's noise is not described (instrument.electrons = 0), and repeats don't tell it: {why}"
        ))
    }
}

/// How repeats of one kind and channel scatter beside what is described.
#[derive(Default)]
struct Tally {
    /// Sum of degrees of freedom times s²/expected, its variance, and degrees of freedom.
    sum: f64,
    variance: f64,
    freedom: f64,
    /// Where the ratio is largest.
    worst: (f64, f64),
}

impl Described {
    /// Says of kinds and channels whose repeats scatter clearly more, or less, than described.
    fn contradictions(&self, raw: &Raw, summaries: &[Summary], instrument: &Instrument) -> Vec<String> {
        let mut found: [Option<(f64, String)>; 2] = [None, None];
        for kind in Kind::ALL {
            for (c, channel) in raw.channels.iter().enumerate() {
                let tally = self.tally(summaries.iter().filter(|s| s.kind == kind), c, instrument);
                let ratio = (tally.sum / tally.freedom).sqrt();
                let is_sure = (tally.sum - tally.freedom).abs() > SURE * tally.variance.sqrt();
                let much = if ratio > 1.0 { ratio } else { ratio.recip() };
                if !is_sure || much <= TOLERATED {
                    continue;
                }
                let of = format!("repeats of the {}, channel {channel}, scatter", kind.name());
                let text = if ratio > 1.0 {
                    let (at_s, most) = (tally.worst.1, tally.worst.0.sqrt());
                    format!(
                        "{of} {ratio:.1} times as far as the description says (electrons, read_noise, drift): σ is too small where noise leads; most at \
                         {at_s} s, {most:.1} times"
                    )
                } else {
                    format!(
                        "{of} {ratio:.1e} times as far as the description says (electrons, read_noise, drift): σ is too large; signals are taken for electrons \
                         (electrons = 0 takes σ from the repeats, in any unit)"
                    )
                };
                let place = &mut found[usize::from(ratio < 1.0)];
                if place.as_ref().is_none_or(|(most, _)| much > *most) {
                    *place = Some((much, text));
                }
            }
        }
        found.into_iter().flatten().map(|(_, text)| text).collect()
    }

    fn tally<'a>(&self, of: impl Iterator<Item = &'a Summary>, c: usize, instrument: &Instrument) -> Tally {
        let mut tally = Tally::default();
        for (at_s, repeats) in of.filter_map(|s| Some((s.time_s, s.repeats[c].as_ref()?))) {
            let (own, shot) = (repeats.count as f64 - 1.0, (repeats.signal - self.offset).max(0.0));
            let walked = repeats.walked(instrument);
            let expected = shot + self.read + self.step * self.step / 12.0 + walked;
            if own == 0.0 || expected == 0.0 {
                continue;
            }
            let ratio = repeats.scatter / expected;
            tally.sum += own * ratio;
            // Of s², by the fourth cumulant of electrons that come by chance, and by what walks, as a whole.
            let share = walked / expected;
            let of_ratio = 2.0 / own + shot / (expected * expected * repeats.count as f64) + share * share;
            tally.variance += own * own * of_ratio;
            tally.freedom += own;
            if ratio > tally.worst.0 {
                tally.worst = (ratio, at_s);
            }
        }
        tally
    }
}
