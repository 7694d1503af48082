//! What is swept: series of settings, what is measured of each, and what theory says.

use serde::{Deserialize, Serialize};

use super::knob::Knob;

/// An error that trials tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Measure {
    /// Its name, as `--advise` and files have it.
    pub name: &'static str,
    /// What it is, in words.
    pub what: &'static str,
}

/// Whose time a series spends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Cost {
    /// The computer's, measured.
    Computer,
    /// The instrument's, known from its description.
    Instrument,
    /// The instrument's and the computer's, one after the other.
    Both,
}

/// A power of the size that an error follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", content = "slope")]
pub enum Theory {
    /// This one.
    Exactly(f64),
    /// This one or a steeper one.
    AtMost(f64),
    /// This one or a flatter one.
    AtLeast(f64),
    /// One between a steep one and a flat one, both included.
    Between(f64, f64),
    /// None is known: what a law needs is not given.
    Unknown,
}

impl Theory {
    /// The exponents that it names.
    #[must_use]
    pub fn slopes(self) -> Vec<f64> {
        match self {
            Self::Exactly(slope) | Self::AtMost(slope) | Self::AtLeast(slope) => vec![slope],
            Self::Between(steep, flat) => vec![steep, flat],
            Self::Unknown => Vec::new(),
        }
    }

    /// The exponent in words, numbers written by `number`.
    #[must_use]
    pub fn said(self, number: impl Fn(f64) -> String) -> String {
        match self {
            Self::Exactly(slope) => number(slope),
            Self::AtMost(slope) => format!("{} or steeper", number(slope)),
            Self::AtLeast(slope) => format!("{} or flatter", number(slope)),
            Self::Between(steep, flat) => format!("{} to {}", number(steep), number(flat)),
            Self::Unknown => "none".into(),
        }
    }
}

/// What theory says of a measure, and why.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Law {
    /// The exponent, if there is one.
    pub theory: Theory,
    /// Why.
    pub why: &'static str,
}

/// Settings that differ in one knob.
#[derive(Debug, Clone)]
pub struct Series {
    /// What they share, in words.
    pub name: String,
    /// What they differ in.
    pub knob: Knob,
    /// Whose time counts.
    pub cost: Cost,
    /// Which measure counts, an index.
    pub main: usize,
    /// What theory says of each measure against the size.
    pub laws: Vec<Option<Law>>,
    /// All of what the size is a part of, where it is one.
    pub whole: f64,
    /// Whether one can ask for its settings as for the whole work: advice takes no others.
    pub advisable: bool,
}

/// One setting to try.
#[derive(Debug, Clone)]
pub struct Setting<S> {
    /// Its series, an index.
    pub series: usize,
    /// How much of what the knob turns.
    pub size: Option<f64>,
    /// What of the size theory speaks of, where that is not all: of a part of a whole the errors beside the whole's.
    pub effective: Option<f64>,
    /// How it is typed, or said.
    pub text: String,
    /// What the setting promises that its series' main measure stays below, with 95 % confidence.
    pub promise: Option<f64>,
    /// Seconds of the instrument.
    pub instrument_s: Option<f64>,
    /// The setting itself.
    pub what: S,
}

impl<S> Setting<S> {
    /// A setting of a series with a size.
    pub fn sized(series: usize, size: f64, text: String, what: S) -> Self {
        Self { series, size: Some(size), effective: None, text, promise: None, instrument_s: None, what }
    }

    /// A setting of a series that is one of several kinds.
    pub fn named(series: usize, text: String, what: S) -> Self {
        Self { series, size: None, effective: None, text, promise: None, instrument_s: None, what }
    }
}
