//! The table: directions, values per channel, uncertainty, weights, masks.

use glam::DVec3;

use super::merl_grid::MerlGrid;
use super::reason::MaskReason;
use crate::brdf::Brdf;

/// Whether directions fill space or lie in one plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dimension {
    /// The flat world: directions in the xz plane, values in 1/rad.
    Flat,
    /// Space: values in 1/sr.
    #[default]
    Space,
}

/// The pair of directions of every entry.
#[derive(Debug, Clone, PartialEq)]
pub enum Directions {
    /// Listed, entry by entry. Unit vectors in the local frame; both lists have the same length.
    List {
        /// Directions to the light.
        wi: Vec<DVec3>,
        /// Directions to the detector.
        wo: Vec<DVec3>,
    },
    /// Implied by the MERL grid.
    Merl(MerlGrid),
}

impl Directions {
    /// Number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::List { wi, .. } => wi.len(),
            Self::Merl(_) => MerlGrid::LEN,
        }
    }

    /// Whether there is no entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// (wi, wo) of entry `i`. Either may lie below the horizon.
    #[must_use]
    pub fn pair(&self, i: usize) -> (DVec3, DVec3) {
        match self {
            Self::List { wi, wo } => (wi[i], wo[i]),
            Self::Merl(grid) => grid.pair(i),
        }
    }
}

/// What each entry stands for in an integral over directions.
#[derive(Debug, Clone, PartialEq)]
pub enum Weights {
    /// Nothing is known: every entry counts the same.
    Uniform,
    /// The grid's solid angle ∝ dωi dωo, entry by entry, up to a constant.
    SolidAngle(Vec<f64>),
    /// The solid angle of the MERL grid's bins.
    Merl,
    /// A `weight` column that the file brought.
    Column(Vec<f64>),
}

impl Weights {
    /// Weight of entry `i`, up to a constant.
    #[must_use]
    pub fn get(&self, i: usize) -> f64 {
        match self {
            Self::Uniform => 1.0,
            Self::SolidAngle(w) | Self::Column(w) => w[i],
            Self::Merl => MerlGrid::solid_angle(i),
        }
    }

    /// What they stand for, in a word.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::SolidAngle(_) | Self::Merl => "solid angle of the grid",
            Self::Column(_) => "the file's weight column",
        }
    }

    /// Whether the weights know of a grid (anything but [`Weights::Uniform`]).
    #[must_use]
    pub fn known(&self) -> bool {
        !matches!(self, Self::Uniform)
    }
}

/// How many values (samples × channels) are masked, by reason.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Masked {
    /// The format marks them as not measured (MERL's negative entries, Zemax's zeros, an empty CSV cell).
    pub marked: u64,
    /// NaN or infinite in the file.
    pub not_finite: u64,
    /// Where the first value stands that is not finite.
    pub first_not_finite: Option<String>,
}

impl Masked {
    /// All masked values.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.marked + self.not_finite
    }

    /// Counts a value that is not finite and remembers the first one's place.
    pub fn count_not_finite(&mut self, place: impl FnOnce() -> String) {
        self.not_finite += 1;
        self.first_not_finite.get_or_insert_with(place);
    }
}

/// A measured (or simulated) reflectance table.
///
/// Values are kept channel by channel: channel c's value of entry i stands at c·len + i, in 1/sr (1/rad in the flat world).
/// A masked value is NaN.
pub struct Measurement {
    /// What it is called: the file's stem, or the material simulated.
    pub name: String,
    /// Where it came from, in words for the user ("MERL binary", "simulated").
    pub origin: String,
    /// Flat world or space.
    pub dimension: Dimension,
    /// The pairs of directions.
    pub directions: Directions,
    /// Channel names.
    pub channels: Vec<String>,
    /// BRDF values, channel-major; NaN where masked.
    pub values: Vec<f64>,
    /// Independent 1 σ of each value, in the values' layout and unit, where known.
    pub sigma: Option<Vec<f64>>,
    /// 1 σ of error components shared by all entries (fully correlated), each in the values' layout.
    pub common: Vec<Vec<f64>>,
    /// The part of `sigma` that the channels of one entry share, where there is one: 1 σ, signed, fully correlated among an entry's channels and
    /// independent of other entries, in the values' layout.
    pub row: Option<Vec<f64>>,
    /// What each entry stands for.
    pub weights: Weights,
    /// What is masked, and why.
    pub masked: Masked,
    /// Of each entry, why it has no value in a channel, where the reduction of a stop there tells; empty where none does.
    pub reasons: Vec<Option<MaskReason>>,
    /// The format's own way to evaluate the BRDF anywhere, where it has one (RGL).
    pub evaluator: Option<std::sync::Arc<dyn Brdf>>,
    /// Scatter per incidence that the file itself states (θi in degrees, integral), where it does (Zemax `TIS`).
    pub stated_scatter: Vec<(f64, f64)>,
    /// What the reader must tell the user: assumptions made, oddities found.
    pub notes: Vec<String>,
}

impl Measurement {
    /// A table of space with these directions, channels and values (channel-major, NaN where masked), nothing else known.
    #[must_use]
    pub fn new(name: impl Into<String>, directions: Directions, channels: Vec<String>, values: Vec<f64>) -> Self {
        debug_assert_eq!(values.len(), directions.len() * channels.len());
        Self {
            name: name.into(),
            origin: String::new(),
            dimension: Dimension::Space,
            directions,
            channels,
            values,
            sigma: None,
            common: Vec::new(),
            row: None,
            weights: Weights::Uniform,
            masked: Masked::default(),
            reasons: Vec::new(),
            evaluator: None,
            stated_scatter: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Number of entries (direction pairs).
    #[must_use]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// Whether there is no entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value of entry `i` in channel `channel`, `None` where masked.
    #[must_use]
    pub fn value(&self, channel: usize, i: usize) -> Option<f64> {
        let v = self.values[channel * self.len() + i];
        (!v.is_nan()).then_some(v)
    }

    /// All values of one channel; NaN where masked.
    #[must_use]
    pub fn plane(&self, channel: usize) -> &[f64] {
        let n = self.len();
        &self.values[channel * n..(channel + 1) * n]
    }

    /// Independent 1 σ values of one channel, where known.
    #[must_use]
    pub fn sigma_plane(&self, channel: usize) -> Option<&[f64]> {
        let n = self.len();
        self.sigma.as_ref().map(|s| &s[channel * n..(channel + 1) * n])
    }

    /// The part of a channel's σ that the channels of an entry share, where there is one.
    #[must_use]
    pub fn row_plane(&self, channel: usize) -> Option<&[f64]> {
        let n = self.len();
        self.row.as_ref().map(|s| &s[channel * n..(channel + 1) * n])
    }

    /// Shared error component `k`'s 1 σ values of one channel.
    #[must_use]
    pub fn common_plane(&self, k: usize, channel: usize) -> &[f64] {
        let n = self.len();
        &self.common[k][channel * n..(channel + 1) * n]
    }
}

impl std::fmt::Debug for Measurement {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Measurement")
            .field("name", &self.name)
            .field("origin", &self.origin)
            .field("entries", &self.len())
            .field("channels", &self.channels)
            .field("masked", &self.masked)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_masked_value_is_none_in_its_own_channel_alone() {
        let list = Directions::List { wi: vec![DVec3::Z; 2], wo: vec![DVec3::Z; 2] };
        let table = Measurement::new("t", list, vec!["r".into(), "g".into()], vec![1.0, f64::NAN, 3.0, -4.0]);
        assert_eq!(table.value(0, 1), None);
        assert_eq!(table.value(1, 1), Some(-4.0));
        assert_eq!(table.plane(1), [3.0, -4.0]);
    }
}
