//! Which direction a table's features move with when the incidence changes.

use glam::DVec2;

use super::scattered::Incidence;

/// The direction that an offset is counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    /// The mirror direction: gloss.
    Mirror,
    /// The direction to the light: retro-reflection.
    Retro,
}

/// A table is read about the retro direction only when that makes neighbouring incidences clearly more alike.
const CLEARLY: f64 = 0.7;

impl Anchor {
    /// How far x (the direction cosine along the incidence's azimuth) must move to keep its offset from the anchor, from the
    /// incidence of sine `from` to that of sine `to`.
    pub(super) fn shift(self, from: f64, to: f64) -> f64 {
        match self {
            Self::Mirror => from - to,
            Self::Retro => to - from,
        }
    }

    /// The anchor about which neighbouring incidences are most alike; the mirror direction unless the other is clearly better.
    pub(super) fn of(incidences: &[Incidence], channels: usize) -> Self {
        let [mirror, retro] = [Self::Mirror, Self::Retro].map(|anchor| {
            incidences.windows(2).map(|pair| unlikeness(anchor, &pair[0], &pair[1], channels)).sum::<f64>()
        });
        if retro < CLEARLY * mirror { Self::Retro } else { Self::Mirror }
    }
}

/// How different two incidences are at the same offsets: Σ (√f − √g)² / Σ (f + g) over the samples of both that the other covers,
/// f and g the means of the channels, 0 where negative. In [0, 1].
fn unlikeness(anchor: Anchor, a: &Incidence, b: &Incidence, channels: usize) -> f64 {
    let (mut difference, mut sum) = (0.0, 0.0);
    let mut other = vec![0.0; channels];
    for (here, there) in [(a, b), (b, a)] {
        let shift = DVec2::new(anchor.shift(here.sine, there.sine), 0.0);
        for (i, p) in here.mesh.points.iter().enumerate() {
            other.fill(0.0);
            let covered = there.mesh.add_interpolated(*p + shift, 1.0, &mut other);
            let f = mean(here.mesh.sample(i)).max(0.0);
            let g = mean(&other).max(0.0) / covered;
            if covered > 0.5 && !mean(here.mesh.sample(i)).is_nan() {
                difference += (f.sqrt() - g.sqrt()).powi(2);
                sum += f + g;
            }
        }
    }
    if sum > 0.0 { difference / sum } else { 0.0 }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
