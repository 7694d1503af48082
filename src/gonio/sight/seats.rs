//! The points of the spot, as lobes are seen from them.

use std::collections::HashMap;
use std::sync::{Arc, PoisonError, RwLock};

use glam::DVec3;

use crate::brdf::Place;
use crate::geometry::mirror;
use crate::gonio::spot::Spot;

/// Most points that are kept: some 100 MB, with what finds them. Nothing makes room: what comes later is made anew.
const MOST: usize = 2_000_000;

/// From one point: α, cosθi/cosθo, and what it counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seat {
    pub alpha: f64,
    pub ratio: f64,
    pub weight: f64,
}

/// The points of the rule of an order, what they count adding up to 1.
pub(super) fn of(spot: &Spot, place: &Place, order: usize) -> Vec<Seat> {
    let (mut list, mut all) = (Vec::new(), 0.0);
    spot.points((place.wi, place.wo), order, |point| {
        let (alpha, ratio) = (angle(mirror(point.wi), point.wo), point.wi.z / point.wo.z);
        let weight = point.weight * point.wo.z;
        all += weight;
        list.push(Seat { alpha, ratio, weight });
    });
    list.iter_mut().for_each(|seat| seat.weight /= all);
    list
}

/// Points of pairs of directions by order, up to so many: a fit's passes ask for the same pairs, and hardly ever for another order.
#[derive(Debug, Default)]
pub(super) struct Kept(RwLock<Known>);

#[derive(Debug, Default)]
struct Known {
    lists: HashMap<([u64; 6], usize), Arc<[Seat]>>,
    points: usize,
}

impl Kept {
    /// Those of a pair, made if they aren't there.
    pub fn get(&self, place: &Place, order: usize, make: impl FnOnce() -> Vec<Seat>) -> Arc<[Seat]> {
        let [a, b] = [place.wi, place.wo].map(|w| w.to_array().map(f64::to_bits));
        let key = ([a[0], a[1], a[2], b[0], b[1], b[2]], order);
        if let Some(known) = self.0.read().unwrap_or_else(PoisonError::into_inner).lists.get(&key) {
            return known.clone();
        }
        let made: Arc<[Seat]> = make().into();
        let mut known = self.0.write().unwrap_or_else(PoisonError::into_inner);
        if known.points + made.len() <= MOST && known.lists.insert(key, made.clone()).is_none() {
            known.points += made.len();
        }
        made
    }
}

/// The angle between two unit vectors by its chord, good to 1e-15 up to a right angle; by the opposite one's beyond.
fn angle(a: DVec3, b: DVec3) -> f64 {
    let squared = (a - b).length_squared();
    if squared <= 2.0 {
        return 2.0 * (0.5 * squared.sqrt()).asin();
    }
    std::f64::consts::PI - 2.0 * (0.5 * (a + b).length()).min(1.0).asin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::{angle_between, direction_deg};

    #[test]
    fn angles_are_those_of_both_chords() {
        for theta in [0.0, 1e-9, 1e-3, 0.3, 45.0, 89.999, 90.0, 90.001, 135.0, 179.9, 180.0] {
            let (a, b) = (direction_deg(20.0, 30.0), direction_deg(20.0 + theta, 30.0));
            let (found, other) = (angle(a, b), angle_between(a, b));
            assert!((found - other).abs() < 1e-15 + 4e-16 * other, "{theta}: {found} {other}");
        }
    }
}
