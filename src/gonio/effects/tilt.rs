//! Tilt: the normal of the sample, and of the standard in its place, is off the axes' by a small angle about x and y.
//!
//! wi and wo are turned into the frame of a normal that leans by two draws of σ = `sample.tilt_u_deg`, degrees. A lean
//! of τ in the plane of incidence moves a mirror direction by 2τ and a matte reading by τ·tanθo: 0.01° is 0.03 % at
//! 60°.
//!
//! Realistic: 0.005° to 0.5° (typical): an autocollimator at a flat sample (Havran, doi 10.2312/mam.20161250) 0.01°, a
//! laser spot sent back over metres 0.05°, propped up by hand 0.5°.

use glam::{DQuat, DVec3};

use super::{Block, Entry, Maker, Pass, stated};

pub(super) const EFFECT: Entry = Entry {
    name: "sample tilt",
    calls: |i, _| stated(i.sample.tilt_u_deg, "sample.tilt_u_deg", "°"),
    remove: |i| i.sample.tilt_u_deg = 0.0,
    make: |maker: &Maker<'_>| Some(Box::new(Tilt(frame(maker.actual.tilt)))),
};

/// Turns directions of the axes' frame into the sample's, whose normal leans by `tilt` towards +x and +y.
pub(crate) fn frame([x, y]: [f64; 2]) -> DQuat {
    DQuat::from_scaled_axis(DVec3::new(y, -x, 0.0))
}

struct Tilt(DQuat);

impl Pass for Tilt {
    fn apply(&self, block: &mut Block<'_>) {
        block.wi.iter_mut().chain(&mut block.wo).for_each(|w| *w = self.0 * *w);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The normal stands where its lean says, seen from the axes; so in the sample's frame that direction is the pole.
    #[test]
    fn the_normal_leans_the_way_that_is_said() {
        let tilt = [0.02, -0.05];
        let normal = DVec3::new(0.02, -0.05, 1.0).normalize();
        assert!((frame(tilt) * normal - DVec3::Z).length() < 1e-4);
        assert_eq!(frame([0.0; 2]) * normal, normal);
    }
}
