//! A fit through an instrument in a given time. Lobes averaged over its cones take longer than all the rest: they are made as long as the time lasts,
//! and a fit that needed more has no answer.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use glam::DVec3;

use super::options::{FitError, FitOptions};
use crate::brdf::{LobeKind, Place, Sight};

/// What lasts less is no making of anything.
const INSTANT: Duration = Duration::from_micros(50);
/// Exponents an octave apart in the range that is searched, and how many times as long as for these a whole fit takes.
const SEARCHED: f64 = 34.0;
const WHOLE: f64 = 3.0;

/// A sight that makes nothing new once its time is over: lobes are 0 then, and what a fit finds from there on is thrown away.
#[derive(Debug)]
struct Timed {
    sight: Arc<dyn Sight>,
    until: Instant,
    ended: AtomicBool,
    /// Shapes that something was made for.
    made: AtomicU32,
}

impl Timed {
    /// Whether there is what a shape needs.
    fn prepared(&self, kind: LobeKind, shape: &[f64]) -> bool {
        let began = Instant::now();
        let is_there = !self.ended.load(Ordering::Relaxed) && self.sight.prepare(kind, shape, self.until);
        if !is_there {
            self.ended.store(true, Ordering::Relaxed);
        } else if began.elapsed() > INSTANT {
            self.made.fetch_add(1, Ordering::Relaxed);
        }
        is_there
    }
}

impl Sight for Timed {
    fn describe(&self) -> String {
        self.sight.describe()
    }

    fn place(&self, wi: DVec3, wo: DVec3) -> Option<Place> {
        self.sight.place(wi, wo)
    }

    fn made_when_ended(&self) -> Option<u32> {
        self.ended.load(Ordering::Relaxed).then(|| self.made.load(Ordering::Relaxed))
    }

    fn fill(&self, kind: LobeKind, shape: &[f64], places: &[Place], values: &mut [f64], derivatives: &mut [Vec<f64>]) {
        if self.prepared(kind, shape) {
            return self.sight.fill(kind, shape, places, values, derivatives);
        }
        values.fill(0.0);
        derivatives.iter_mut().for_each(|list| list.fill(0.0));
    }
}

/// The same options, with lobes seen through an instrument for as long as the time budget lasts that began at `clock`.
pub(super) fn timed(options: &FitOptions, clock: Instant) -> FitOptions {
    let until = options.time_budget.and_then(|budget| clock.checked_add(budget));
    let through = options.through.clone().zip(until).map(|(sight, until)| {
        let timed: Arc<dyn Sight> =
            Arc::new(Timed { sight, until, ended: AtomicBool::new(false), made: AtomicU32::new(0) });
        timed
    });
    FitOptions { through: through.or_else(|| options.through.clone()), ..options.clone() }
}

/// Refuses what was found since the time was over.
pub(super) fn check(options: &FitOptions) -> Result<(), FitError> {
    let ended = options.through.as_ref().and_then(|sight| sight.made_when_ended());
    match ended.zip(options.time_budget) {
        Some((made, budget)) => Err(FitError::OutOfTime { budget, made, needed: needed(budget, made) }),
        None => Ok(()),
    }
}

/// About the time that a whole fit takes, in which so many shapes were made in `budget`: up to one digit.
fn needed(budget: Duration, made: u32) -> Duration {
    let share = (f64::from(made.max(1)) / (WHOLE * SEARCHED)).min(0.5);
    let seconds = budget.as_secs_f64() / share;
    let digit = 10f64.powf(seconds.log10().floor());
    Duration::from_secs_f64((seconds / digit).ceil() * digit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes its time for each shape.
    #[derive(Debug)]
    struct Slow;

    impl Sight for Slow {
        fn describe(&self) -> String {
            String::new()
        }

        fn place(&self, _wi: DVec3, _wo: DVec3) -> Option<Place> {
            None
        }

        fn prepare(&self, _kind: LobeKind, _shape: &[f64], until: Instant) -> bool {
            let is_early = Instant::now() < until;
            if is_early {
                std::thread::sleep(Duration::from_millis(20));
            }
            is_early
        }

        fn fill(&self, _: LobeKind, _: &[f64], _: &[Place], values: &mut [f64], _: &mut [Vec<f64>]) {
            values.fill(1.0);
        }
    }

    #[test]
    fn lobes_are_made_until_the_time_is_over_and_nothing_counts_from_there_on() {
        let budget = Some(Duration::from_millis(50));
        let options = FitOptions {
            through: Some(Arc::new(Slow)),
            time_budget: budget,
            ..FitOptions::new("phong".parse().expect("a model"))
        };
        let options = timed(&options, Instant::now());
        let value = || {
            let mut value = [f64::NAN];
            let sight = options.through.as_ref().expect("one");
            sight.fill(LobeKind::Phong, &[3.0], &[Place::default()], &mut value, &mut [vec![0.0]]);
            value[0]
        };
        let values: Vec<f64> = (0..6).map(|_| value()).collect();
        let early = values.iter().filter(|v| **v == 1.0).count();
        assert!((1..=3).contains(&early) && values[early..].iter().all(|v| *v == 0.0), "{values:?}");
        let made = early as u32;
        assert!(matches!(check(&options), Err(FitError::OutOfTime { made: m, .. }) if m == made), "{values:?}");
    }

    #[test]
    fn what_a_fit_needs_is_told_by_what_was_done() {
        let ms = Duration::from_millis;
        // 3 × 34 exponents at 50 ms each; all of the search in 0.3 s.
        assert_eq!(needed(ms(50), 1), Duration::from_secs(6));
        assert_eq!(needed(ms(50), 0), Duration::from_secs(6));
        assert_eq!(needed(ms(300), 34), ms(900));
        assert_eq!(needed(ms(300), 1000), ms(600));
    }
}
