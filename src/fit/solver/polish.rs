//! The last digits: undamped steps, accepted by the length of the step that follows.
//!
//! Near a minimum the cost is flat: a step of relative offset ε changes it by the share ε², so below ε ≈ 1e-8 its differences are rounding. The
//! undamped (Gauss–Newton) step is not: it is linear in the distance. So the polish follows the fixed-point map p ↦ p + δ(p) and
//! accepts a point when |Jδ| / |r| there is smaller. Where the residuals are large that map contracts slowly; Anderson mixing (1965) of the
//! last few points, in the norm |J·|, makes up for it.

use nalgebra::{DMatrix, DVector};

use super::local::{Local, Step};
use super::qr::PivotedQr;
use super::summary::Stop;

/// Points that the mixing looks back at, besides the newest.
const DEPTH: usize = 5;

/// Directions of the mixing below this share of the longest are rounding.
const MIXING_TOL: f64 = 1e-10;

/// Share of the cost that a polishing step may add, beyond what it was predicted to take away: its rounding.
const COST_ROUNDING: f64 = 1e-8;

/// The state of a polish.
#[derive(Debug, Clone)]
pub(super) struct Polish {
    /// What the search stopped with; `None` where it only made way.
    pub found: Option<Stop>,
    /// Undamped step from the best point.
    pub step: Step,
    /// |Jδ| / |r| of it.
    pub offset: f64,
    /// Linearisations spent.
    pub tried: u32,
    /// Steps accepted.
    pub accepted: u32,
    /// Accepted points with their undamped steps, oldest first.
    trail: Vec<(DVector<f64>, DVector<f64>)>,
}

impl Polish {
    pub fn new(here: &Local, step: Step, found: Option<Stop>) -> Self {
        let offset = here.offset(&step.delta);
        let trail = vec![(here.p.clone(), step.delta.clone())];
        Self { found, step, offset, tried: 0, accepted: 0, trail }
    }

    /// The point to try next, before projection.
    pub fn proposal(&self, here: &Local) -> DVector<f64> {
        if self.is_mixing() { self.mixed(here) } else { self.step.to.clone() }
    }

    pub fn is_mixing(&self) -> bool {
        self.trail.len() > 1
    }

    /// Anderson's extrapolation: the combination of the last points whose combined step is shortest, moved by that step.
    fn mixed(&self, here: &Local) -> DVector<f64> {
        let newest = self.trail.len() - 1;
        let difference = |k: usize| {
            let ((p, f), (older_p, older_f)) = (&self.trail[k + 1], &self.trail[k]);
            (p - older_p, f - older_f)
        };
        let (dp, df): (Vec<_>, Vec<_>) = (0..newest).map(difference).unzip();
        let changed = DMatrix::from_columns(&df.iter().map(|f| &here.at.factor * f).collect::<Vec<_>>());
        let share = PivotedQr::new(changed, &here.at.factor * &self.step.delta, MIXING_TOL).solve();
        let mut to = self.step.to.clone();
        (0..newest).for_each(|k| to -= (&dp[k] + &df[k]) * share[k]);
        to
    }

    /// Whether a trial point is nearer to the fixed point.
    pub fn improves(&self, here: &Local, trial: &Local, step: &Step) -> bool {
        let slack = here.at.cost * (self.offset * self.offset).max(COST_ROUNDING);
        trial.offset(&step.delta) < self.offset && trial.at.cost <= here.at.cost + slack
    }

    pub fn accept(&mut self, trial: &Local, step: Step) {
        self.offset = trial.offset(&step.delta);
        self.trail.push((trial.p.clone(), step.delta.clone()));
        if self.trail.len() > DEPTH + 1 {
            self.trail.remove(0);
        }
        self.step = step;
        self.accepted += 1;
    }

    /// Forgets all points but the newest, so that the next step is a plain one.
    pub fn forget(&mut self) {
        self.trail.drain(..self.trail.len() - 1);
    }
}
