//! Which effects can be left out: those whose contributions, all together, stay below a tolerance.

use super::contribution::{Contribution, Study};
use super::forward::Job;
use crate::control::Control;

/// An effect that is left out, and what it would have changed at most.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Spared {
    /// Its name.
    pub effect: &'static str,
    /// Largest relative change of a reading of the sample; of noise the largest σ over the reading.
    pub bound: f64,
}

impl Job<'_> {
    /// Effects that may be left out of this job's readings for a relative `tolerance`: what they change in any reading of the sample, noise counted
    /// by its σ, adds up to less, singly measured and measured all at once. None once the work is stopped.
    #[must_use]
    pub fn spared(&self, tolerance: f64, control: Control<'_>) -> Vec<Spared> {
        let (readings, actual) = self.prepare();
        let study = Study::new(self, &readings, &actual, control.stop);
        let contributions = study.contributions(control).effects;
        let mut list: Vec<(Spared, bool)> = contributions.iter().filter_map(bounded).collect();
        list.sort_by(|a, b| a.0.bound.total_cmp(&b.0.bound));
        let mut sum = 0.0;
        let few = list.iter().take_while(|(spared, _)| {
            sum += spared.bound;
            sum < tolerance
        });
        let mut few: Vec<(Spared, bool)> = few.copied().collect();
        while !few.is_empty() && together(&study, &few) >= tolerance {
            few.pop();
        }
        if control.stop.requested() {
            return Vec::new();
        }
        few.into_iter().map(|(spared, _)| spared).collect()
    }
}

/// What an effect that is on changes at most, and whether it is noise.
fn bounded(of: &Contribution) -> Option<(Spared, bool)> {
    let bound = of.reading?.largest + of.uncertain;
    Some((Spared { effect: of.effect, bound }, of.noise))
}

/// What all of them change at once.
fn together(study: &Study<'_>, list: &[(Spared, bool)]) -> f64 {
    let names: Vec<&str> = list.iter().filter(|(_, noise)| !noise).map(|(s, _)| s.effect).collect();
    let noise: f64 = list.iter().filter(|(_, noise)| *noise).map(|(s, _)| s.bound).sum();
    let (less, _, error) = study.without(&names);
    study.change(&less).largest + study.quadrature_error + error + noise
}
