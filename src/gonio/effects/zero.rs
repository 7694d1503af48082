//! Errors of the axes' zeros: every direction is off by the same angles.
//!
//! θ and φ of source and detector are each off by a draw of σ = `axes.zero_u_deg`. To first order a reading changes by ∂f/∂angle times the error. Arms swing
//! through the normal: azimuths beyond ±90° are negative θ of the opposite ones, so in a plane of incidence a zero that is off moves both sides the same way.

use glam::DVec3;

use super::{Block, Entry, Maker, Pass, stated};
use crate::geometry::angles::turned;

pub(super) const EFFECT: Entry = Entry {
    name: "axis zeros",
    calls: |i, _| stated(i.axes.zero_u_deg, "axes.zero_u_deg", "°"),
    remove: |i| i.axes.zero_u_deg = 0.0,
    make: |maker: &Maker<'_>| Some(Box::new(Zeros(maker.actual.zeros))),
};

/// Where an arm that is meant to point along `w` points when θ and φ of its axes are off by so much, rad.
pub(in crate::gonio) fn swung(w: DVec3, theta: f64, phi: f64) -> DVec3 {
    turned(w, if w.x < 0.0 { -theta } else { theta }, phi)
}

struct Zeros([f64; 4]);

impl Pass for Zeros {
    fn apply(&self, block: &mut Block<'_>) {
        let [theta_i, phi_i, theta_o, phi_o] = self.0;
        block.wi.iter_mut().for_each(|w| *w = swung(*w, theta_i, phi_i));
        block.wo.iter_mut().for_each(|w| *w = swung(*w, theta_o, phi_o));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    /// In a plane, on both sides of the normal and through it, the arm is off the same way.
    #[test]
    fn an_arm_is_off_by_the_same_rotation_on_both_sides_of_the_normal() {
        let off = f64::to_radians(0.3);
        for theta in [-60.0f64, -0.2, 0.0, 0.2, 45.0] {
            let signed = |theta: f64| direction_deg(theta.abs(), if theta < 0.0 { 180.0 } else { 0.0 });
            let got = swung(signed(theta), off, 0.0);
            assert!((got - signed(theta + 0.3)).length() < 1e-14, "{theta}: {got}");
        }
    }
}
