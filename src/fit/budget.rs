//! Accuracy against time: a fit to a part of the samples, and how far it may be from the fit to all.

use std::time::{Duration, Instant};

use super::bootstrap::{self, Redrawn};
use super::covariance::Uncertainty;
use super::limits::Ranges;
use super::loss::Loss;
use super::options::{FitError, FitOptions};
use super::part::{self, Part};
use super::samples::{Samples, Thin};
use super::timed;
use crate::brdf::{FitRecord, ModelSpec};
use crate::measurement::{Directions, Measurement};
use crate::numeric::stats::chi_square_quantile;

/// A part of the samples, and what that costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Subset {
    /// Directions there are.
    pub of: usize,
    /// Expected excess of the rmse over all samples, as a share of the best fit's.
    pub excess: f64,
    /// What it exceeds with probability 5 % at most.
    pub excess_95: f64,
    /// Whether the time ended the work, not the accuracy.
    pub out_of_time: bool,
}

/// When work has to end, where it has to. It is looked at between the parts of a fit: what is under way is finished, what only makes the answer surer is
/// not begun.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Deadline(Option<Instant>);

impl Deadline {
    /// No end.
    pub const NEVER: Self = Self(None);

    /// At the end of a time that began at `clock`.
    pub fn of(clock: Instant, time: Option<Duration>) -> Self {
        Self(time.and_then(|time| clock.checked_add(time)))
    }

    /// Whether it is past.
    pub fn is_past(self) -> bool {
        self.0.is_some_and(|end| Instant::now() >= end)
    }

    /// The end.
    pub fn end(self) -> Option<Instant> {
        self.0
    }
}

/// Each round takes so many times the samples of the one before.
const GROWTH: usize = 4;
/// Fewer entries than this are not worth thinning out.
const WORTH: usize = 20_000;
/// Entries of the first round.
const FIRST: usize = 6000;
/// A whole table that is quick takes at most this many times as long as the first round.
const WHOLE: f64 = 4.0;
/// What is kept of the time for what a prediction misses.
const RESERVE: f64 = 0.8;

/// The time that one of `left` fits may take, of what is left of the budget: all alike, whatever the earlier ones took.
pub(super) fn share(budget: Duration, elapsed: Duration, left: usize) -> Duration {
    budget.saturating_sub(elapsed) / u32::try_from(left.max(1)).unwrap_or(u32::MAX)
}

/// Fits growing parts of the samples until the target is met or the time would be exceeded; all of them where that is possible.
/// What is asked for beside the fit is made of the samples that it ended with, and its time counts too; drawings end with the time.
pub(super) fn fit(
    measurement: &Measurement,
    model: &ModelSpec,
    ranges: &Ranges,
    options: &FitOptions,
    channels: &[usize],
    time: Option<Duration>,
) -> Result<Part, FitError> {
    let clock = Instant::now();
    let deadline = Deadline::of(clock, time);
    let whole_is_quick = whole_is_quick(measurement, options);
    let mut thin = if measurement.len() < WORTH { 1 } else { (measurement.len() / FIRST).max(1) };
    let mut before: Option<Part> = None;
    loop {
        let began = Instant::now();
        let gathered = Samples::gather(measurement, model, options, channels, Thin { step: thin, run: 1 });
        if thin > 1 && matches!(gathered, Err(FitError::NothingToFit { .. })) {
            thin = next(thin).0; // what counts may be among the others
            continue;
        }
        let (mut samples, transforms) = gathered?;
        samples.are_drawn = thin > 1;
        let part = part::fit(&samples, transforms, model, ranges, options, deadline);
        if let Err(error) = timed::check(options) {
            // The round before this one is what the time was enough for.
            return before.map(Part::out_of_time).ok_or(error);
        }
        let mut part = part?;
        let round = began.elapsed();
        let listed = bootstrap::listed(&samples, options);
        if thin > 1 {
            let mut subset = Subset::of(&part, thin);
            let met = options.target_rmse_excess.is_some_and(|target| subset.excess_95 <= target);
            let (next, longer) = if whole_is_quick { (1, WHOLE) } else { next(thin) };
            if let Some(time) = time.filter(|_| !met) {
                let drawings = bootstrap::predicted(listed.as_ref(), &part, model, ranges, options)?;
                let needed = round.mul_f64(longer) + drawings.mul_f64(thin as f64 / next as f64);
                subset.out_of_time = !fits(time, clock.elapsed() + needed);
            }
            part.subset = Some(subset);
            if !met && !subset.out_of_time {
                (thin, before) = (next, Some(part));
                continue;
            }
        }
        part.bootstrap = bootstrap::bootstrap(listed.as_ref(), &part, model, ranges, options, deadline.end())?;
        return timed::check(options).map(|()| part);
    }
}

impl Part {
    /// A round after which the time ended.
    fn out_of_time(mut self) -> Self {
        self.subset = self.subset.map(|subset| Subset { out_of_time: true, ..subset });
        self
    }
}

/// What is done however little time there is.
const FIRST_ROUND: &str = "a first round of samples, one descent and its standard errors";
/// A budget that is exceeded by less is not worth a word.
const WORD: f64 = 1.02;

/// Tells the record what the time left undone, and by how much it was exceeded.
pub(super) fn tell(record: &mut FitRecord, parts: &[Part], options: &FitOptions, elapsed: Duration) {
    if let Some((asked, record_of)) = options.bootstrap.zip(record.bootstrap.as_mut()) {
        // Channels fitted apart may have been drawn differently often; the least is told.
        let drawn = parts.iter().filter_map(|p| p.bootstrap.as_ref()).map(|b: &Redrawn| b.replicates).min();
        record_of.replicates = u64::from(drawn.unwrap_or(0));
        if drawn.is_some_and(|drawn| drawn < asked.replicates) {
            record.warnings.push(format!(
                "the time ended after {} of {} drawings of the bootstrap",
                record_of.replicates, asked.replicates
            ));
        }
    }
    if parts.iter().any(|p| p.report.cut) {
        record
            .warnings
            .push("the time ended the search early: other minima were not looked for, or not followed".into());
    }
    if parts.iter().any(|p| p.report.unsettled) {
        record.warnings.push("the time ended while the robust scale settled".into());
    }
    if parts.iter().any(|p| p.lacks_profiles) {
        let said = "the time left out profiles: where intervals need one they are estimate ± t·σ, which may be too short there";
        record.warnings.push(said.into());
    }
    if let Some(budget) = options.time_budget.filter(|budget| elapsed > budget.mul_f64(WORD)) {
        let least = match options.bootstrap {
            Some(_) => format!("{FIRST_ROUND} and {} drawings", bootstrap::LEAST),
            None => FIRST_ROUND.into(),
        };
        record.warnings.push(format!(
            "the fit took {}, {} more than its time budget: {least} always run",
            in_words(elapsed),
            in_words(elapsed.saturating_sub(budget))
        ));
    }
}

/// A time to two digits or so.
fn in_words(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    match seconds {
        s if s >= 10.0 => format!("{s:.0} s"),
        s if s >= 1.0 => format!("{s:.1} s"),
        s if s >= 0.01 => format!("{:.0} ms", 1e3 * s),
        s => format!("{:.1} ms", 1e3 * s),
    }
}

impl Subset {
    /// Of a fit to one of every `thin` samples.
    fn of(part: &Part, thin: usize) -> Self {
        let (excess, excess_95) = excess(&part.uncertainty, 1.0 / thin as f64);
        Self { of: part.samples * thin, excess, excess_95, out_of_time: false }
    }
}

/// The next round's step, and how many times as long as the one before it may take.
fn next(thin: usize) -> (usize, f64) {
    let next = (thin / GROWTH).max(1);
    (next, thin as f64 / next as f64)
}

/// Whether a whole table is folded in one pass, which takes no longer than listing a part of it. What a bootstrap redraws is listed.
fn whole_is_quick(measurement: &Measurement, options: &FitOptions) -> bool {
    let folds = options.loss.is_linear() && options.loss != Loss::Relative && options.robust.is_none();
    let plain = !options.use_sigma && options.stride == 1 && options.bootstrap.is_none();
    folds && plain && matches!(measurement.directions, Directions::Merl(_))
}

fn fits(budget: Duration, needed: Duration) -> bool {
    needed.as_secs_f64() <= RESERVE * budget.as_secs_f64()
}

/// Expected excess of the rmse over all samples of a fit to the share `share` of them, and its 95 % bound.
///
/// The parameters of the part scatter about those of the whole by the part's own covariance times (1 − share), whatever the residuals
/// are: it is the drawing of the part that is random. The cost over all exceeds its minimum by δᵀAδ, a sum of χ² variables whose first two
/// moments give the bound (Satterthwaite 1946).
fn excess(part: &Uncertainty, share: f64) -> (f64, f64) {
    let known: Vec<usize> = (0..part.errors.len()).filter(|&i| part.errors[i].is_some()).collect();
    let pick = |m: &nalgebra::DMatrix<f64>| m.select_rows(&known).select_columns(&known);
    let product = pick(&part.normal) * pick(&part.drawn);
    let (first, second) = (product.trace(), (&product * &product).trace());
    if !(first > 0.0 && second > 0.0 && part.cost > 0.0) {
        return (0.0, 0.0);
    }
    let relative = |rise: f64| (1.0 + (1.0 - share) * rise / part.cost).sqrt() - 1.0;
    let bound = second / first * chi_square_quantile(0.95, first * first / second);
    (relative(first), relative(bound))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_has_its_share_of_what_is_left() {
        let ms = Duration::from_millis;
        assert_eq!(share(ms(300), ms(0), 3), ms(100));
        // The first took less than its share, then more.
        assert_eq!(share(ms(300), ms(40), 2), ms(130));
        assert_eq!(share(ms(300), ms(220), 2), ms(40));
        assert_eq!(share(ms(300), ms(200), 1), ms(100));
        assert_eq!(share(ms(300), ms(400), 1), Duration::ZERO);
    }
}
