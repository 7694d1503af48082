//! The retro zone: where source and detector stand in each other's way no light gets from one to the other.
//!
//! A reading of the sample is 0 of its light where the angle between wi and wo is below `surroundings.shadow_deg`,
//! degrees.
//!
//! Realistic: 0° (a beam splitter) to 15°, typical: half of the detector's head and half of the beam over the distance;
//! 4 cm before a beam of 17 mm at 0.6 m make 2.7°. No published figure was found.

use glam::DVec3;

use super::{Block, Entry, Maker, Pass, stated};
use crate::geometry::angles::angle_between;
use crate::gonio::instrument::Instrument;
use crate::gonio::reading::Kind;

pub(super) const EFFECT: Entry = Entry {
    name: "shadow",
    calls: |i, _| stated(i.surroundings.shadow_deg, "surroundings.shadow_deg", "°"),
    remove: |i| i.surroundings.shadow_deg = 0.0,
    make: |maker: &Maker<'_>| Some(Box::new(Shadow(maker.instrument.surroundings.shadow_deg.to_radians()))),
};

/// Least angle between source and detector, rad.
struct Shadow(f64);

/// Whether the pair can't be measured, or may not where axes are off by what their uncertainties make likely: four σ of the angle between two.
pub(in crate::gonio) fn may_be_shadowed(wi: DVec3, wo: DVec3, instrument: &Instrument) -> bool {
    let (shadow, axes) = (instrument.surroundings.shadow_deg, instrument.axes);
    let unsure = 4.0 * (2.0 * (axes.zero_u_deg.powi(2) + axes.jitter_deg.powi(2))).sqrt();
    shadow > 0.0 && angle_between(wi, wo) < (shadow + unsure).to_radians()
}

impl Pass for Shadow {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            if block.readings[i].kind == Kind::Sample && angle_between(block.wi[i], block.wo[i]) < self.0 {
                block.scale(i, 0.0);
            }
        }
    }
}
