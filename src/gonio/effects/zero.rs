//! Errors of the axes' zeros: every direction is off by the same angles.
//!
//! θ and φ of source and detector are each off by a draw of σ = `axes.zero_u_deg`. To first order a reading changes by ∂f/∂angle times the error.

use super::{Block, Entry, Maker, Pass, stated};
use crate::geometry::angles::turned;

pub(super) const EFFECT: Entry = Entry {
    name: "axis zeros",
    calls: |i, _| stated(i.axes.zero_u_deg, "axes.zero_u_deg", "°"),
    remove: |i| i.axes.zero_u_deg = 0.0,
    make: |maker: &Maker<'_>| Some(Box::new(Zeros(maker.actual.zeros))),
};

struct Zeros([f64; 4]);

impl Pass for Zeros {
    fn apply(&self, block: &mut Block<'_>) {
        let [theta_i, phi_i, theta_o, phi_o] = self.0;
        block.wi.iter_mut().for_each(|w| *w = turned(*w, theta_i, phi_i));
        block.wo.iter_mut().for_each(|w| *w = turned(*w, theta_o, phi_o));
    }
}
