//! Advice: the setting for a wanted error or time, from what was measured.
//!
//! A trial of a setting stays below its prediction limit with probability 95 %: Student's, of the logarithms, whose scatter all settings of a curve
//! share. Between two settings of a knob that is a dial the limits are joined by a power law; beyond the last one the curve's slope carries on, at the
//! end of its interval that promises less, for a few times the size.

mod adviser;
mod forecast;
#[cfg(test)]
mod tests;

use serde::Serialize;

use super::curve::{Curve, Sweep};
use super::design::Cost;
pub use adviser::Adviser;
use adviser::limit;
pub use forecast::Forecast;

/// What is wanted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Wish {
    /// An error of at most this, with 95 % confidence, in as little time as possible. The measure by its name; none is each curve's main one.
    Error(Option<String>, f64),
    /// A computation of at most so many seconds, with 95 % confidence, with as small an error as possible.
    Time(f64),
    /// The same of the instrument's seconds, which are certain.
    InstrumentTime(f64),
}

/// A setting to take.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Advice {
    /// The curve that it is on.
    pub curve: String,
    /// Its options.
    pub setting: String,
    /// How much of what the knob turns.
    pub size: Option<f64>,
    /// Name of the measure.
    pub measure: &'static str,
    /// The error.
    pub error: Forecast,
    /// The computer's time, s.
    pub seconds: Forecast,
    /// The instrument's time, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument_s: Option<f64>,
    /// Whether the size lies beyond all that were measured.
    pub beyond: bool,
}

/// Why there is no advice.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoAdvice {
    /// No such measure.
    #[error("expected an error out of {known}, found {name}")]
    Measure {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// Nothing that was measured is good enough, or fast enough.
    #[error("nothing that was measured has {wanted} with 95 % confidence; {nearest}")]
    OutOfReach {
        /// What was wanted.
        wanted: String,
        /// What comes nearest.
        nearest: String,
    },
}

/// The setting that meets a wish best, out of curves that one can ask for: the fastest with an error small enough, or the most accurate that is fast enough.
///
/// # Errors
/// [`NoAdvice`] where the sweep has no such measure, or nothing meets the wish.
pub fn advise(sweep: &Sweep, wish: &Wish) -> Result<Advice, NoAdvice> {
    let named = match wish {
        Wish::Error(Some(name), _) => Some(sweep.measure(name).ok_or_else(|| NoAdvice::Measure {
            name: name.clone(),
            known: sweep.measures.iter().map(|m| m.name).collect::<Vec<_>>().join(", "),
        })?),
        _ => None,
    };
    let curves: Vec<&Curve> = sweep.curves.iter().filter(|curve| curve.advisable).collect();
    let wants_instrument = match wish {
        Wish::InstrumentTime(_) => true,
        Wish::Time(_) => false,
        Wish::Error(..) => curves.first().is_some_and(|c| c.cost != Cost::Computer),
    };
    let advisers: Vec<Adviser<'_>> = curves
        .iter()
        .filter(|curve| (curve.cost != Cost::Computer) == wants_instrument)
        .filter_map(|curve| Some(Adviser::new(sweep, curve, named.or_else(|| sweep.measure(curve.main))?)))
        .collect();
    let priced = |adviser: &Adviser<'_>| {
        adviser.candidates(wish).into_iter().map(|a| (adviser.price(&a, wish), a)).collect::<Vec<_>>()
    };
    let all = advisers.iter().flat_map(priced);
    let other = if curves.is_empty() {
        "no setting of the whole was tried"
    } else if wants_instrument {
        "its settings take the computer's time: ask for time=T"
    } else {
        "its settings take the instrument's time: ask for instrument=T"
    };
    let best = all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, advice)| advice);
    best.ok_or_else(|| out_of_reach(&advisers, wish, other))
}

/// `other` says why nothing was tried.
fn out_of_reach(advisers: &[Adviser<'_>], wish: &Wish, other: &str) -> NoAdvice {
    let all = || advisers.iter().flat_map(|a| a.known.iter().map(move |k| (a, k)));
    let (wanted, nearest) = match wish {
        Wish::Error(_, most) => (
            format!("an error of {most:.3e}"),
            all().min_by(|a, b| a.1.error.at_most.total_cmp(&b.1.error.at_most)).map(|(a, k)| {
                format!("the best, {}, stays below {} = {:.3e}", k.point.setting, a.measure, k.error.at_most)
            }),
        ),
        _ => (
            format!("a time of {:.3e} s", limit(wish)),
            all().min_by(|a, b| a.1.seconds.at_most.total_cmp(&b.1.seconds.at_most)).map(|(_, k)| {
                let time = k.cost(wish).map_or(f64::NAN, |f| f.at_most);
                format!("the fastest, {}, stays below {time:.3e} s", k.point.setting)
            }),
        ),
    };
    let untried = if advisers.is_empty() { other } else { "no setting was tried twice" };
    let nearest = nearest.unwrap_or_else(|| untried.into());
    NoAdvice::OutOfReach { wanted, nearest }
}
