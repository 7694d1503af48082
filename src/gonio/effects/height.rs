//! Height: the surface stands h above the axes' crossing, so source and detector see the spot from nearer and from
//! another side.
//!
//! A detector at r in the direction w sees the spot at h·z along w·r − h·z: to first order it takes in 2(h/r)cosθ more,
//! and θ is larger by (h/r)sinθ. With a source at a finite distance the same holds of it, and irradiance goes as 1/r².
//! Where the beam falls on the sample beside the detector's axis is not followed. h is one draw of σ =
//! `sample.height_u_m`, m; r is `detector.distance_m` and `source.distance_m`, m.
//!
//! Realistic: σ from 1e-5 (gauge or autocollimator) to 1e-3 (by eye), typical. PTB found 0.04 mm over a turn of the
//! sample, 0.01 % of the signal (proceedings of a conference at PMOD/WRC, p. 196, yumpu.com document 25400364).

use glam::DVec3;

use super::{Block, Entry, Maker, Pass, stated};
use crate::measurement::Dimension;

pub(super) const EFFECT: Entry = Entry {
    name: "sample height",
    calls: |i, _| {
        let seen = i.detector.distance_m > 0.0 || i.source.distance_m > 0.0;
        stated(i.sample.height_u_m, "sample.height_u_m", " m")
            .and_then(|why| if seen { Ok(why) } else { Err("source and detector are far away".into()) })
    },
    remove: |i| i.sample.height_u_m = 0.0,
    make: |maker: &Maker<'_>| {
        let (source, detector) = (maker.instrument.source.distance_m, maker.instrument.detector.distance_m);
        Some(Box::new(Height { above: maker.actual.height_m, source, detector, dimension: maker.dimension }))
    },
};

struct Height {
    above: f64,
    source: f64,
    detector: f64,
    dimension: Dimension,
}

impl Pass for Height {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            let (wi, near_i) = seen(block.wi[i], self.above, self.source, self.dimension);
            let (wo, near_o) = seen(block.wo[i], self.above, self.detector, self.dimension);
            (block.wi[i], block.wo[i]) = (wi, wo);
            // The signal is 1 yet: what the light's pass multiplies.
            block.scale(i, near_i * near_o);
        }
    }
}

/// The direction and the factor 1/r² (1/r in the flat world) of what stands `distance` away along `w`, seen from `height` above the crossing; 0 is
/// far away.
pub(in crate::gonio) fn seen(w: DVec3, height: f64, distance: f64, dimension: Dimension) -> (DVec3, f64) {
    if distance == 0.0 {
        return (w, 1.0);
    }
    let from_spot = w - DVec3::Z * (height / distance);
    let r = from_spot.length();
    (from_spot / r, if dimension == Dimension::Flat { 1.0 / r } else { 1.0 / (r * r) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along the normal: nearer by h, no other direction. To first order 1 + 2 h cosθ/r and an angle of h sinθ/r away from the normal.
    #[test]
    fn a_higher_surface_is_nearer_and_seen_from_lower_down() {
        let space = Dimension::Space;
        assert_eq!(seen(DVec3::Z, 0.1, 1.0, space), (DVec3::Z, 1.0 / (0.9 * 0.9)));
        assert_eq!(seen(DVec3::Z, 0.1, 1.0, Dimension::Flat), (DVec3::Z, 1.0 / 0.9));
        assert_eq!(seen(DVec3::Z, 0.1, 0.0, space), (DVec3::Z, 1.0));
        let w = DVec3::new(0.6, 0.0, 0.8);
        for height in [1e-3, 1e-4, 1e-5] {
            let (from, near) = seen(w, height, 2.0, space);
            let angle = from.x.atan2(from.z) - w.x.atan2(w.z);
            assert!((near - 1.0 - height * 0.8).abs() < height * height);
            assert!((angle - 0.5 * height * 0.6).abs() < height * height);
        }
    }
}
