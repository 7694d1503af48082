//! Readings that stand in a list more than once, as in a table pasted twice.

use std::hash::{DefaultHasher, Hash, Hasher};

use glam::DVec3;
use rayon::prelude::*;

use crate::measurement::{Directions, Measurement};

/// Longer lists are not searched.
const MOST: usize = 200_000;
/// sin θ below which a direction is the normal, whatever its azimuth: grids list it once an azimuth.
const POLE: f64 = 1e-9;
/// Where fewer of the directions that occur again do so with the same values, chance or coarse digits explain that.
const SHARE: f64 = 0.5;

/// Says that readings are copies of others: directions that occur again with the same values in all channels. Different values are honest
/// repeats. `counts` says which entries are looked at.
pub(super) fn warning(measurement: &Measurement, counts: impl Fn(usize) -> bool + Sync) -> Option<String> {
    let Directions::List { wi, wo } = &measurement.directions else { return None };
    if wi.len() > MOST {
        return None;
    }
    let key = |entry: usize| {
        let entry = Some(entry).filter(|e| is_tilted(wi[*e]) && is_tilted(wo[*e]) && counts(*e))?;
        Some((hash(wi[entry], wo[entry]), entry))
    };
    let mut keys: Vec<(u64, usize)> = (0..wi.len()).into_par_iter().filter_map(key).collect();
    keys.par_sort_unstable();
    let is_copy = |a: usize, b: usize| wi[a] == wi[b] && wo[a] == wo[b] && has_same_values(measurement, a, b);
    let (mut distinct, mut again, mut copied) = (0usize, 0usize, 0usize);
    for same in keys.chunk_by(|a, b| a.0 == b.0) {
        distinct += 1;
        again += usize::from(same.len() > 1);
        copied += usize::from(same.windows(2).any(|pair| is_copy(pair[0].1, pair[1].1)));
    }
    (copied > 0 && copied as f64 >= SHARE * again as f64).then(|| {
        format!(
            "{copied} of {distinct} directions occur again with identical values: a reading that is copied is counted twice; its \
             noise then looks like the model's error, and errors come out too small"
        )
    })
}

fn is_tilted(direction: DVec3) -> bool {
    direction.x.hypot(direction.y) > POLE
}

/// Whether two entries hold the same values, at least one of them valid.
fn has_same_values(measurement: &Measurement, a: usize, b: usize) -> bool {
    let planes = || (0..measurement.channels.len()).map(|c| measurement.plane(c));
    planes().all(|plane| plane[a].to_bits() == plane[b].to_bits()) && planes().any(|plane| !plane[a].is_nan())
}

/// A number that tells pairs of directions apart.
fn hash(wi: DVec3, wo: DVec3) -> u64 {
    let mut hasher = DefaultHasher::new();
    [wi.to_array(), wo.to_array()].map(|w| w.map(f64::to_bits)).hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    fn table(rows: &[(f64, f64, f64)]) -> Measurement {
        let wi = rows.iter().map(|r| direction_deg(r.0, 180.0)).collect();
        let wo = rows.iter().map(|r| direction_deg(r.1, 0.0)).collect();
        let values = rows.iter().map(|r| r.2).collect();
        Measurement::new("t", Directions::List { wi, wo }, vec!["r".into()], values)
    }

    #[test]
    fn copies_are_counted_and_honest_repeats_are_not() {
        let rows = [(30.0, 10.0, 0.1), (30.0, 20.0, 0.2), (30.0, 30.0, 0.3)];
        let said = |more: &[(f64, f64, f64)]| warning(&table(&[&rows, more].concat()), |_| true);
        assert_eq!(said(&[]), None);
        assert!(said(&rows).is_some_and(|s| s.starts_with("3 of 3 directions")));
        assert!(said(&rows[1..2]).is_some_and(|s| s.starts_with("1 of 3 directions")));
        assert_eq!(said(&[(30.0, 10.0, 0.11), (30.0, 20.0, 0.19)]), None);
        // One of three repeats alike by chance.
        assert_eq!(said(&[(30.0, 10.0, 0.11), (30.0, 20.0, 0.2), (30.0, 30.0, 0.31)]), None);
        // Nothing is copied where nothing is valid, and the normal has no azimuth.
        assert_eq!(said(&[(30.0, 40.0, f64::NAN), (30.0, 40.0, f64::NAN)]), None);
        assert_eq!(said(&[(30.0, 0.0, 0.5), (30.0, 0.0, 0.5)]), None);
        assert_eq!(warning(&table(&[rows, rows].concat()), |entry| entry < 3), None);
    }
}
