//! What theory says of fits to parts of a table.
//!
//! A part's parameters are off those of the whole by a weighted mean of residuals. Independent residuals make that fall as the root of the number of
//! samples, however evenly a part is spread. The model's own error is alike from one direction to the next: parts that are spread evenly find its mean sooner
//! than random ones, and steps that meet the table's periods later, so that no power holds.

use crate::brdf::FitRecord;
use crate::tradeoff::design::{Law, Theory};
use crate::tradeoff::knob::Knob;

/// Share of structure in the residuals' variance up to which they count as independent: it moves the slope of a squared error by as much at most where the
/// structure's own part falls twice as fast.
const MISFIT: f64 = 0.1;

const SQUARED: Law = Law {
    theory: Theory::Exactly(-1.0),
    why: "the cost is a square about its minimum, and parameters scatter as the root of the number of samples; of a part of n out of N samples by 1/n − 1/N",
};
const SCATTER: Law = Law {
    theory: Theory::Exactly(-0.5),
    why: "independent samples; of a part of n out of N by the root of 1/n − 1/N",
};
const MISFITTED: Law = Law {
    theory: Theory::Unknown,
    why: "theory is of independent residuals, and these are the model's own error, alike from one direction to the next: parts spread evenly find its mean sooner \
          than random ones, and steps that meet the table's periods later",
};
const UNTOLD: Law = Law {
    theory: Theory::Unknown,
    why: "theory is of independent residuals, and whether these are can't be told: too few samples are neighbours, and no σ is stated",
};
const IN_STEP: Law = Law {
    theory: Theory::Unknown,
    why: "every N-th entry may keep step with the table's rows: such parts are not like the whole",
};

/// What is known of the residuals of a fit to all samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Residuals {
    /// Noise, for the most part.
    Independent,
    /// Error of the model.
    Misfit,
    /// Nothing.
    Untold,
}

impl Residuals {
    /// Of this fit.
    pub fn of(fit: Option<&FitRecord>) -> Self {
        match fit.and_then(|record| record.residual.as_ref()) {
            Some(residual) if residual.structured_share <= MISFIT => Self::Independent,
            Some(_) => Self::Misfit,
            None => Self::Untold,
        }
    }

    /// What there is to say of excess, parameters and picture of parts by this knob. A loss that is not the yardstick's ends at errors of its own, and so
    /// does a model that is not the best one, but for its parameters.
    pub fn laws(self, knob: Knob, is_own_loss: bool, is_best: bool) -> Vec<Option<Law>> {
        let law = |own: Law| match (knob, self) {
            (Knob::Stride, _) => IN_STEP,
            (_, Self::Independent) => own,
            (_, Self::Misfit) => MISFITTED,
            (_, Self::Untold) => UNTOLD,
        };
        vec![
            Some(law(SQUARED)).filter(|_| is_own_loss && is_best),
            Some(law(SCATTER)).filter(|_| is_own_loss),
            Some(law(SCATTER)).filter(|_| is_own_loss && is_best),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::ResidualRecord;

    #[test]
    fn theory_is_of_independent_residuals() {
        let residual = |structured_share: f64| ResidualRecord {
            noise_rmse: 1.0,
            model_rmse: 1.0,
            structured_share,
            noise_from: "neighbours".into(),
            effective_samples: 1e3,
        };
        let fit = |residual: Option<ResidualRecord>| FitRecord { residual, ..FitRecord::default() };
        let of = |share: Option<f64>| Residuals::of(Some(&fit(share.map(residual))));
        let theories = |residuals: Residuals, knob: Knob, own: bool, best: bool| -> Vec<Option<Theory>> {
            residuals.laws(knob, own, best).into_iter().map(|law| law.map(|law| law.theory)).collect()
        };
        let (exact, none) = (Theory::Exactly, Some(Theory::Unknown));
        assert_eq!(of(Some(0.02)), Residuals::Independent);
        let noise = theories(of(Some(0.02)), Knob::Part, true, true);
        assert_eq!(noise, [exact(-1.0), exact(-0.5), exact(-0.5)].map(Some));
        assert_eq!(theories(of(Some(0.9)), Knob::Part, true, true), [none; 3]);
        assert_eq!(theories(of(None), Knob::Part, true, true), [none; 3]);
        assert_eq!(theories(of(Some(0.0)), Knob::Stride, true, true), [none; 3]);
        // A richer model leaves a floor; its own parameters scatter all the same. Another loss has a minimum of its own.
        assert_eq!(theories(of(Some(0.0)), Knob::Part, true, false), [None, Some(exact(-0.5)), None]);
        assert_eq!(theories(of(Some(0.0)), Knob::Part, false, true), [None; 3]);
    }
}
