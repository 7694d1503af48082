//! What is in a measurement, in numbers.

use std::collections::BTreeMap;

use serde::Serialize;

use super::reason::{MaskReason, counts};
use super::table::{Dimension, Directions, Masked, Measurement};
use crate::geometry::{phi_of, theta_of};
use crate::numeric::sum::map_blocks;

/// What is in a measurement.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Its name.
    pub name: String,
    /// Its format or origin, in words.
    pub origin: String,
    /// 2 or 3.
    pub dimension: u8,
    /// Direction pairs, below the horizon or not.
    pub entries: usize,
    /// Pairs with a direction at or below the horizon.
    pub below_horizon: usize,
    /// Values (pairs × channels) that are valid, and what share that is.
    pub valid: usize,
    /// Share of valid values.
    pub valid_share: f64,
    /// Masked values by reason.
    pub masked: Masked,
    /// Pairs by why they have no value in a channel, where a reduction tells.
    pub mask_reasons: BTreeMap<MaskReason, usize>,
    /// What the entries' weights stand for.
    pub weights: &'static str,
    /// Range of θi over valid entries, degrees; `None` without any.
    pub theta_i_deg: Option<(f64, f64)>,
    /// Range of θo over valid entries, degrees.
    pub theta_o_deg: Option<(f64, f64)>,
    /// Distinct θi, degrees, of a listed table with at most 32 of them.
    pub incidences_deg: Option<Vec<f64>>,
    /// Channel by channel.
    pub channels: Vec<ChannelSummary>,
    /// How well f(wi, wo) = f(wo, wi) holds, where the table has swapped pairs.
    pub reciprocity: Option<Reciprocity>,
    /// Integrated scatter that the file states, (θi in degrees, value).
    pub stated_scatter: Vec<(f64, f64)>,
    /// The reader's notes.
    pub notes: Vec<String>,
}

/// One channel of a measurement.
#[derive(Debug, Clone, Serialize)]
pub struct ChannelSummary {
    /// Its name.
    pub name: String,
    /// Valid values.
    pub valid: usize,
    /// Negative ones among them.
    pub negative: usize,
    /// Smallest valid value, 1/sr (1/rad in the flat world).
    pub min: Option<f64>,
    /// Largest valid value.
    pub max: Option<f64>,
    /// Largest over smallest positive value, in decades.
    pub dynamic_range_decades: Option<f64>,
    /// Median of σ over value, where σ is known.
    pub median_relative_sigma: Option<f64>,
}

/// How reciprocal a table is, taken as an isotropic material's.
#[derive(Debug, Clone, Serialize)]
pub struct Reciprocity {
    /// Values compared with the one of the swapped pair.
    pub pairs: usize,
    /// Median of |a − b| / ((|a| + |b|)/2).
    pub median_relative_difference: f64,
}

impl Measurement {
    /// What is in it.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let ranges = angle_ranges(self);
        let channels: Vec<ChannelSummary> = (0..self.channels.len()).map(|c| channel(self, c)).collect();
        let valid = channels.iter().map(|c| c.valid).sum();
        Summary {
            name: self.name.clone(),
            origin: self.origin.clone(),
            dimension: if self.dimension == Dimension::Flat { 2 } else { 3 },
            entries: self.len(),
            below_horizon: ranges.below,
            valid,
            valid_share: valid as f64 / self.values.len().max(1) as f64,
            masked: self.masked.clone(),
            mask_reasons: counts(&self.reasons),
            weights: self.weights.name(),
            theta_i_deg: ranges.theta_i,
            theta_o_deg: ranges.theta_o,
            incidences_deg: incidences(self),
            channels,
            reciprocity: reciprocity(self),
            stated_scatter: self.stated_scatter.clone(),
            notes: self.notes.clone(),
        }
    }
}

struct Ranges {
    below: usize,
    theta_i: Option<(f64, f64)>,
    theta_o: Option<(f64, f64)>,
}

fn widen(range: &mut Option<(f64, f64)>, value: f64) {
    let (low, high) = range.get_or_insert((value, value));
    *low = low.min(value);
    *high = high.max(value);
}

fn angle_ranges(table: &Measurement) -> Ranges {
    let mut all = Ranges { below: 0, theta_i: None, theta_o: None };
    let parts = map_blocks(table.len(), |block| {
        let mut part = Ranges { below: 0, theta_i: None, theta_o: None };
        for i in block {
            let (wi, wo) = table.directions.pair(i);
            part.below += usize::from(!(wi.z > 0.0 && wo.z > 0.0));
            if (0..table.channels.len()).any(|c| table.value(c, i).is_some()) {
                widen(&mut part.theta_i, theta_of(wi).to_degrees());
                widen(&mut part.theta_o, theta_of(wo).to_degrees());
            }
        }
        part
    });
    for part in parts {
        all.below += part.below;
        for (total, range) in [(&mut all.theta_i, part.theta_i), (&mut all.theta_o, part.theta_o)] {
            if let Some((low, high)) = range {
                widen(total, low);
                widen(total, high);
            }
        }
    }
    all
}

fn incidences(table: &Measurement) -> Option<Vec<f64>> {
    let Directions::List { wi, .. } = &table.directions else { return None };
    let mut angles: Vec<i64> = wi.iter().map(|w| (theta_of(*w).to_degrees() * 1e6).round() as i64).collect();
    angles.sort_unstable();
    angles.dedup();
    (angles.len() <= 32).then(|| angles.iter().map(|a| *a as f64 / 1e6).collect())
}

fn channel(table: &Measurement, c: usize) -> ChannelSummary {
    let valid = || table.plane(c).iter().copied().filter(|v| !v.is_nan());
    let positive = valid().filter(|v| *v > 0.0).min_by(f64::total_cmp);
    let max = valid().max_by(f64::total_cmp);
    let relative = table.sigma_plane(c).map(|sigma| {
        let pairs = table.plane(c).iter().zip(sigma).filter(|(v, s)| v.abs() > 0.0 && s.is_finite());
        pairs.map(|(v, s)| s / v.abs()).collect::<Vec<f64>>()
    });
    ChannelSummary {
        name: table.channels[c].clone(),
        valid: valid().count(),
        negative: valid().filter(|v| *v < 0.0).count(),
        min: valid().min_by(f64::total_cmp),
        max,
        dynamic_range_decades: max.zip(positive).filter(|(a, _)| *a > 0.0).map(|(a, b)| (a / b).log10()),
        median_relative_sigma: relative.and_then(median),
    }
}

/// The middle value; the mean of the two in the middle of an even number.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let odd = values.len() % 2 == 1;
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = if odd { None } else { below.iter().copied().max_by(f64::total_cmp) };
    Some(lower.map_or(upper, |lower| 0.5 * (lower + upper)))
}

/// Compares every value with that of the swapped pair (same angles to 10⁻³°, azimuths folded), as it should be for an isotropic
/// material: `None` where the values depend on the azimuth of incidence. The MERL grid has no swapped pairs of its own: its
/// coordinates are reciprocal by construction.
fn reciprocity(table: &Measurement) -> Option<Reciprocity> {
    let Directions::List { wi, wo } = &table.directions else { return None };
    let key = |a: glam::DVec3, b: glam::DVec3| {
        let round = |angle: f64| (angle.to_degrees() * 1e3).round() as i64;
        let (ta, tb) = (round(theta_of(a)), round(theta_of(b)));
        let turn = (phi_of(b) - phi_of(a)).rem_euclid(std::f64::consts::TAU);
        let folded = turn.min(std::f64::consts::TAU - turn);
        (ta, tb, if ta == 0 || tb == 0 { 0 } else { round(folded) })
    };
    let mut seen = BTreeMap::new();
    for i in 0..table.len() {
        let first = *seen.entry(key(wi[i], wo[i])).or_insert(i);
        let swapped = !turned(wi[first], wo[i]) && !turned(wo[first], wi[i]);
        if turned(wi[first], wi[i]) && !swapped && !same_values(table, first, i) {
            return None;
        }
    }
    let mut differences = Vec::new();
    for (&(ta, tb, turn), &i) in seen.range(..) {
        let Some(&j) = seen.get(&(tb, ta, turn)).filter(|_| ta < tb) else { continue };
        for c in 0..table.channels.len() {
            if let (Some(a), Some(b)) = (table.value(c, i), table.value(c, j)) {
                let size = 0.5 * (a.abs() + b.abs());
                differences.push(if size > 0.0 { (a - b).abs() / size } else { 0.0 });
            }
        }
    }
    let pairs = differences.len();
    Some(Reciprocity { pairs, median_relative_difference: median(differences)? })
}

/// Whether two directions differ by more than 10⁻³°.
fn turned(a: glam::DVec3, b: glam::DVec3) -> bool {
    (a - b).length() > 1e-3f64.to_radians()
}

/// Whether two entries agree to 10⁻⁹ of the value in every channel that both hold.
fn same_values(table: &Measurement, i: usize, j: usize) -> bool {
    (0..table.channels.len()).all(|c| match (table.value(c, i), table.value(c, j)) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * a.abs().max(b.abs()),
        _ => true,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    #[test]
    fn a_small_table_is_counted_as_by_hand() {
        // (30°, 0°) → (60°, 180°) and its swap, a masked value, a direction below the horizon.
        let wi: Vec<_> = [30.0, 60.0, 30.0, 30.0].iter().map(|t| direction_deg(*t, 0.0)).collect();
        let wo: Vec<_> = [60.0, 30.0, 10.0, 100.0].iter().map(|t| direction_deg(*t, 180.0)).collect();
        let values = vec![1.0, 1.1, f64::NAN, f64::NAN];
        let mut table = Measurement::new("t", Directions::List { wi, wo }, vec!["v".into()], values);
        table.masked.marked = 2;
        let s = table.summary();
        assert_eq!((s.entries, s.valid, s.below_horizon, s.masked.total()), (4, 2, 1, 2));
        assert_eq!(s.incidences_deg, Some(vec![30.0, 60.0]));
        let (low, high) = s.theta_o_deg.expect("valid ones");
        assert!((low - 30.0).abs() < 1e-12 && (high - 60.0).abs() < 1e-12);
        let r = s.reciprocity.expect("one pair");
        assert_eq!(r.pairs, 1);
        assert!((r.median_relative_difference - 0.1 / 1.05).abs() < 1e-12);
        assert_eq!((s.channels[0].min, s.channels[0].max), (Some(1.0), Some(1.1)));
    }

    #[test]
    fn the_median_of_an_even_number_lies_between_the_middle_two() {
        assert_eq!(median(vec![]), None);
        assert_eq!(median(vec![3.0]), Some(3.0));
        assert_eq!(median(vec![9.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 8.0, 2.0]), Some(3.0));
    }

    /// A table of pairs (θi, φi, θo, φo) in degrees.
    fn listed(angles: &[[f64; 4]], values: Vec<f64>) -> Measurement {
        let wi = angles.iter().map(|a| direction_deg(a[0], a[1])).collect();
        let wo = angles.iter().map(|a| direction_deg(a[2], a[3])).collect();
        Measurement::new("t", Directions::List { wi, wo }, vec!["v".into()], values)
    }

    #[test]
    fn azimuths_of_incidence_are_not_compared_with_each_other_where_they_matter() {
        // (30°, 60°) in the plane of incidence and its swap, then the first turned by 90°.
        let angles = [[30.0, 0.0, 60.0, 180.0], [60.0, 0.0, 30.0, 180.0], [30.0, 90.0, 60.0, 270.0]];
        let of = |turned: f64| listed(&angles, vec![1.0, 1.0, turned]).summary().reciprocity;
        assert!(of(2.0).is_none() && of(1.0 + 1e-8).is_none());
        assert_eq!(of(1.0).expect("isotropic").pairs, 1);
        // The same azimuth again, and a swap at one polar angle, may differ by noise.
        let mut noisy = angles.to_vec();
        noisy[2] = angles[0];
        noisy.extend([[40.0, 0.0, 40.0, 90.0], [40.0, 90.0, 40.0, 0.0]]);
        assert_eq!(listed(&noisy, vec![1.0, 1.1, 1.2, 2.0, 2.1]).summary().reciprocity.expect("pairs").pairs, 1);
    }
}
