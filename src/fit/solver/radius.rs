//! The trust region: how far the linear model is believed, and the damping that keeps a step within it (Moré 1978).

use nalgebra::DVector;

use super::local::{Bounds, Local, Step};

/// A step may miss the radius by this share of it: finding it more closely costs more than it brings.
const SLACK: f64 = 0.1;

/// Trials of the damping per step; 10 in MINPACK.
const DAMPING_TRIALS: usize = 20;

/// A damped step.
pub(super) struct Damped {
    pub step: Step,
    /// λ of |r + Jδ|² + λ|Dδ|².
    pub damping: f64,
    /// |Dδ|.
    pub length: f64,
}

/// The longest step |Dδ| that is believed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Radius(pub f64);

impl Radius {
    /// The step of the linear model within the radius: the undamped one where it is short enough.
    pub fn step(self, here: &Local, scale: &DVector<f64>, bounds: &Bounds, rank_tol: f64) -> Damped {
        let damped = |damping: f64| {
            let step = here.step(damping, scale, bounds, rank_tol);
            let length = step.delta.component_mul(scale).norm();
            Damped { step, damping, length }
        };
        let undamped = damped(0.0);
        if undamped.length <= (1.0 + SLACK) * self.0 {
            return undamped;
        }
        // 1 / |Dδ| is nearly a straight line in λ (Hebden 1973), at most that of the pure gradient step: |D⁻¹g| / λ.
        let mut low = undamped;
        let mut high = damped(here.gradient.component_div(scale).norm() / self.0);
        for _ in 0..DAMPING_TRIALS {
            if high.length >= (1.0 - SLACK) * self.0 {
                break;
            }
            let middle = damped(between(&low, &high, self.0));
            if middle.length > (1.0 + SLACK) * self.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    /// Shrinks or grows by how well a step's promise was kept: `ratio` is the share of it, `None` where the cost did not fall.
    pub fn update(&mut self, ratio: Option<f64>, tried: &Damped) {
        match ratio {
            Some(kept) if kept >= 0.75 => self.0 = self.0.max(2.0 * tried.length),
            Some(kept) if kept >= 0.25 => {}
            _ => self.0 = 0.5 * tried.length.min(self.0),
        }
    }
}

/// The damping at which the line through 1 / |Dδ| at both ends meets 1 / radius, kept off the ends.
fn between(low: &Damped, high: &Damped, radius: f64) -> f64 {
    let share = (1.0 / radius - 1.0 / low.length) / (1.0 / high.length - 1.0 / low.length);
    let linear = low.damping + share * (high.damping - low.damping);
    let (from, to) = (low.damping.max(1e-3 * linear), high.damping);
    linear.clamp(from + 0.05 * (to - from).min(from), to - 0.05 * (to - from))
}
