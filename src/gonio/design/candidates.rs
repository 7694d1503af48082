//! Pairs of directions that a plan chooses from.

use glam::DVec3;

use super::MAX_ANGLE_DEG;
use super::pair::Pair;
use crate::geometry::angles::direction_deg;
use crate::gonio::effects::shadow::may_be_shadowed;
use crate::gonio::instrument::Instrument;

/// Step of incidences, and of the detector's ring off the plane, degrees.
const INCIDENCE_DEG: f64 = 5.0;
const POLAR_DEG: f64 = 10.0;
const AZIMUTH_DEG: f64 = 20.0;
/// The least angle from the mirror direction in widths 1/√n of the sharpest lobe, and by how much each angle exceeds the one before. A reading's
/// information changes by a few per cent from one to the next.
const LEAST: f64 = 0.2;
const RATIO: f64 = 1.15;

/// In the plane of incidence angles from the mirror direction, graded down to a part of the width of a lobe with exponent `sharpest`; off the plane a
/// coarse grid of one side, for the other is its mirror image. None in the shadow.
pub(super) fn pairs(sharpest: f64, instrument: &Instrument) -> Vec<Pair> {
    let mut list = Vec::new();
    for theta_i in steps(0.0, MAX_ANGLE_DEG, INCIDENCE_DEG) {
        let wi = direction_deg(theta_i, 180.0);
        let in_plane = from_mirror(sharpest).map(|a| theta_i + a).filter(|t| t.abs() <= MAX_ANGLE_DEG);
        list.extend(in_plane.map(|theta_o| (wi, direction_deg(theta_o, 0.0))));
        if theta_i > 0.0 {
            list.extend(off_plane().map(|wo| (wi, wo)));
        }
    }
    list.retain(|(wi, wo)| !may_be_shadowed(*wi, *wo, instrument));
    list
}

/// Signed angles from the mirror direction, degrees.
fn from_mirror(sharpest: f64) -> impl Iterator<Item = f64> {
    let first = (LEAST / sharpest.sqrt()).to_degrees();
    let graded = std::iter::successors(Some(first), |a| Some(a * RATIO)).take_while(|a| *a <= 2.0 * MAX_ANGLE_DEG);
    std::iter::once(0.0).chain(graded.flat_map(|a| [a, -a]))
}

fn off_plane() -> impl Iterator<Item = DVec3> {
    let around = |theta: f64| steps(AZIMUTH_DEG, 160.0, AZIMUTH_DEG).map(move |phi| direction_deg(theta, phi));
    steps(POLAR_DEG, MAX_ANGLE_DEG, POLAR_DEG).flat_map(around)
}

fn steps(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    let n = ((to - from) / step + 1e-9).floor() as usize;
    (0..=n).map(move |k| from + k as f64 * step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::{angle_between, mirror, theta_of};
    use crate::gonio::parts::Surroundings;

    #[test]
    fn pairs_lie_above_the_horizon_out_of_the_shadow_and_close_to_every_mirror_direction() {
        let surroundings = Surroundings { shadow_deg: 7.0, ..Surroundings::default() };
        let instrument = Instrument { surroundings, ..Instrument::default() };
        let list = pairs(1e4, &instrument);
        for (wi, wo) in &list {
            assert!(theta_of(*wi).max(theta_of(*wo)).to_degrees() < MAX_ANGLE_DEG + 1e-9);
            assert!(angle_between(*wi, *wo).to_degrees() > 7.0 - 1e-9);
        }
        // A lobe of exponent 10⁴ is 0.57° wide: at θi = 30° several pairs lie on its flank.
        let near = |(wi, wo): &&Pair| {
            (theta_of(*wi).to_degrees() - 30.0).abs() < 1e-9 && angle_between(mirror(*wi), *wo).to_degrees() < 0.57
        };
        assert!(list.iter().filter(near).count() > 10);
        assert!(list.len() < 5000, "{}", list.len());
    }
}
