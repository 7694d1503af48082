//! Jitter: at each stop an axis comes to rest a little off, by a new draw of σ = `axes.jitter_deg`, degrees.
//!
//! θ and φ of source and detector have a draw each. A matte reading moves by tanθo times the error of θo, a lobe cosⁿγ
//! by n·tanγ times that of γ, its peak falls by nσ²/2 for each angle that moves it.
//!
//! Realistic: 0.001° to 0.3°. Six-axis robots repeat to 87 µrad (0.005°; an ABB IRB 1600, Slamani, Nubiola and Bonev
//! 2012) and below 0.01° (TUBITAK UME's BRDF robot, 2025), EPFL's pgII on the fly to 1 mrad (0.057°); a protractor's
//! lines every degree make 1/√12 = 0.29°.

use rand_distr::{Distribution, StandardNormal};

use super::{Block, Entry, Maker, Pass, stated};
use crate::geometry::angles::turned;
use crate::measurement::Dimension;
use crate::numeric::random::{Purpose, stream};

pub(super) const EFFECT: Entry = Entry {
    name: "axis jitter",
    calls: |i, _| stated(i.axes.jitter_deg, "axes.jitter_deg", "°"),
    remove: |i| i.axes.jitter_deg = 0.0,
    make: |maker: &Maker<'_>| {
        let sigma = maker.instrument.axes.jitter_deg.to_radians();
        Some(Box::new(Jitter { seed: maker.seed, sigma, is_flat: maker.dimension == Dimension::Flat }))
    },
};

struct Jitter {
    seed: u64,
    /// rad.
    sigma: f64,
    /// Whether axes of azimuth are none.
    is_flat: bool,
}

impl Pass for Jitter {
    fn apply(&self, block: &mut Block<'_>) {
        for (i, reading) in block.readings.iter().enumerate() {
            let rng = &mut stream(self.seed, Purpose::Jitter, u64::from(reading.stop));
            let mut draw = || -> f64 { self.sigma * Distribution::<f64>::sample(&StandardNormal, rng) };
            let [theta_i, phi_i, theta_o, phi_o] = [draw(), draw(), draw(), draw()];
            let round = if self.is_flat { 0.0 } else { 1.0 };
            block.wi[i] = turned(block.wi[i], theta_i, round * phi_i);
            block.wo[i] = turned(block.wo[i], theta_o, round * phi_o);
        }
    }
}
