//! Errors of the axes' zeros: every direction is off by the same angles.
//!
//! θ and φ of source and detector are each off by a draw of σ = `axes.zero_u_deg`, degrees. To first order a reading
//! changes by ∂f/∂angle times the error: matte by tanθo, a lobe cosⁿγ by n·tanγ.
//!
//! Realistic: 0.005° to 0.3°. Positions of the goniometer RiGO 801 (Innovent Jena) are better than 0.02°; a goniometer
//! for surfaces is specified to 0.1° (doi 10.1109/TIM.2008.924929), one for reflectors to 10′ (Janecek and Moses 2008).
//! An uncalibrated robot turns accurately to 2.8 mrad, 0.16° (Slamani, Nubiola and Bonev 2012).

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
