//! Why a pair of directions has no value.

use std::collections::BTreeMap;

use serde::Serialize;

/// Why a pair of directions has no value, in one channel at least; of several reasons the first one here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MaskReason {
    /// Even the shortest exposure saturated the detector.
    Saturated,
    /// No reading is there; of a simulation, nothing is known of the material.
    Unread,
    /// Source and detector stand in each other's light, or may.
    Shadowed,
    /// A direction below the horizon, no light of the beam that counts, or a spot that reaches up to source or detector.
    Unlit,
}

impl MaskReason {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Saturated, Self::Unread, Self::Shadowed, Self::Unlit];

    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Saturated => "saturated",
            Self::Unread => "unread",
            Self::Shadowed => "shadowed",
            Self::Unlit => "unlit",
        }
    }

    /// The one of this name.
    #[must_use]
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|reason| reason.name() == name)
    }

    /// In words, for a user.
    #[must_use]
    pub fn said(self) -> &'static str {
        match self {
            Self::Saturated => "even the shortest exposure saturated, in one channel at least",
            Self::Unread => "nothing was read, or the material is not known there, in one channel at least",
            Self::Shadowed => "source and detector shadow each other there, or may",
            Self::Unlit => {
                "below the horizon, or no light of the beam counts there, or the spot reaches up to source or detector"
            }
        }
    }
}

/// How many pairs have each reason, of those that some have.
#[must_use]
pub fn counts(reasons: &[Option<MaskReason>]) -> BTreeMap<MaskReason, usize> {
    let mut counts = BTreeMap::new();
    reasons.iter().flatten().for_each(|reason| *counts.entry(*reason).or_default() += 1);
    counts
}
