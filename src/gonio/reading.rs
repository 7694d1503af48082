//! Single readings: what was read, when, and for how long.

/// What stands before the detector in a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The sample, at a pair of directions.
    Sample,
    /// Nothing that reflects: stray light and dark signal.
    Blank,
    /// The reference standard.
    Reference,
    /// The closed shutter.
    Dark,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Sample, Self::Blank, Self::Reference, Self::Dark];

    /// Its name in a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::Blank => "blank",
            Self::Reference => "reference",
            Self::Dark => "dark",
        }
    }
}

/// One reading of all channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// What was read.
    pub kind: Kind,
    /// Which pair of directions, of those that were measured; of a sample only.
    pub entry: Option<u32>,
    /// When it began, seconds from the start.
    pub time_s: f64,
    /// How long the shutter was open, s.
    pub exposure_s: f64,
    /// How often the same was read before at this stop.
    pub repeat: u32,
    /// Counts the stops of the axes, and the turns to something else.
    pub stop: u32,
}
