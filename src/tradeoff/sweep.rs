//! The sweep: trials of all settings, round after round, in an order that drifts of the machine do not favour.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use super::design::Setting;
use crate::control::{Control, Stop};
use crate::numeric::random::mix;

/// What one trial told.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Trial {
    /// Wall-clock time of the work itself, s.
    pub seconds: f64,
    /// The errors, measure by measure; NaN where one could not be told.
    pub errors: Vec<f64>,
}

/// How much is tried.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Trials of each setting.
    pub trials: u32,
    /// Key of all seeds.
    pub seed: u64,
    /// When the sweep has to be over.
    pub deadline: Option<Instant>,
}

/// Which trial it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Turn {
    /// Which round, the same for all settings.
    pub round: u32,
    /// A seed that no other trial has.
    pub seed: u64,
    /// Whether it was made before, and is made again for its time alone: all else comes out as it did.
    pub again: bool,
}

/// What came of the trials of every setting, and why there are not all of them, where that is so.
#[derive(Debug, Default)]
pub(super) struct Runs {
    pub trials: Vec<Vec<Trial>>,
    pub ended: Option<String>,
}

/// A series' first trial is made again, with the same seed, where it takes less than this, and the second time counts: what is made once (tables,
/// threads, pages of memory) would be a large part of the first. Errors are the same either way, whatever the clock says.
const WARM: Duration = Duration::from_millis(500);

/// How often it is looked whether to stop.
const WATCH: Duration = Duration::from_millis(10);

/// Work that is asked to stop when its caller is, or when the effort's time is up.
pub(super) fn limited<R>(effort: &Effort, control: Control<'_>, work: impl FnOnce(Control<'_>) -> R) -> R {
    let Some(end) = effort.deadline else { return work(control) };
    let stop = Stop::new();
    // Dropped when the work is over, whichever way it ends.
    let (over, watched) = channel::<()>();
    thread::scope(|scope| {
        let _over = over;
        let (stop, outer) = (&stop, control.stop);
        scope.spawn(move || {
            let goes_on = || watched.recv_timeout(WATCH) == Err(RecvTimeoutError::Timeout);
            while goes_on() {
                if outer.requested() || Instant::now() >= end {
                    stop.request();
                    break;
                }
            }
        });
        work(Control { stop, ..control })
    })
}

/// Why work that was asked to stop was.
fn why_stopped(effort: &Effort) -> String {
    if effort.deadline.is_some_and(|end| Instant::now() >= end) { LATE.into() } else { "stopped".into() }
}

const LATE: &str = "the time ended it";

/// Tries every setting in every round. `trial` gets the setting's index.
///
/// # Errors
/// What `trial` returns.
pub(super) fn run<S, E>(
    settings: &[Setting<S>],
    effort: &Effort,
    control: Control<'_>,
    mut trial: impl FnMut(usize, Turn) -> Result<Trial, E>,
) -> Result<Runs, E> {
    let count = settings.len();
    let mut runs = Runs { trials: vec![Vec::new(); count], ended: None };
    let mut lasted: Vec<Option<Duration>> = vec![None; count];
    control.progress.start("trials", u64::from(effort.trials) * count as u64);
    'rounds: for round in 0..effort.trials {
        // There and back, so that what grows warm or busy does so for small and large sizes alike.
        let order: Vec<usize> = if round % 2 == 0 { (0..count).collect() } else { (0..count).rev().collect() };
        for index in order {
            if control.stop.requested() {
                runs.ended = Some(why_stopped(effort));
                break 'rounds;
            }
            if effort.deadline.is_some_and(|end| is_late(end, predicted(settings, &lasted, index))) {
                runs.ended = Some(LATE.into());
                control.progress.advance(1);
                continue;
            }
            let is_first = round == 0 && (index == 0 || settings[index].series != settings[index - 1].series);
            let seed = mix(effort.seed ^ mix(u64::from(round) << 32 | (index as u64) << 1 | u64::from(is_first)));
            let turn = |again: bool| Turn { round, seed, again };
            let mut began = Instant::now();
            let mut found = trial(index, turn(false))?;
            if is_first && began.elapsed() < WARM {
                began = Instant::now();
                found = trial(index, turn(true))?;
            }
            if control.stop.requested() {
                runs.ended = Some(why_stopped(effort));
                break 'rounds; // half a trial says nothing
            }
            lasted[index] = Some(began.elapsed());
            runs.trials[index].push(found);
            control.progress.advance(1);
        }
    }
    control.progress.finish();
    Ok(runs)
}

fn is_late(end: Instant, needed: Duration) -> bool {
    end.saturating_duration_since(Instant::now()) <= needed
}

/// How long a trial may take: as long as the last one, or in proportion to the size of the largest one known of the series.
fn predicted<S>(settings: &[Setting<S>], lasted: &[Option<Duration>], index: usize) -> Duration {
    if let Some(known) = lasted[index] {
        return known;
    }
    let alike = |k: &usize| settings[*k].series == settings[index].series;
    let known = (0..settings.len()).filter(alike).filter_map(|k| Some((settings[k].size?, lasted[k]?)));
    let (Some((size, time)), Some(own)) = (known.max_by(|a, b| a.0.total_cmp(&b.0)), settings[index].size) else {
        return Duration::ZERO;
    };
    time.mul_f64((own / size).clamp(0.0, 1e6))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{Progress, Quiet, Stop};

    fn settings(sizes: &[f64]) -> Vec<Setting<()>> {
        sizes.iter().map(|size| Setting::sized(0, *size, String::new(), ())).collect()
    }

    fn effort(trials: u32, deadline: Option<Instant>) -> Effort {
        Effort { trials, seed: 7, deadline }
    }

    #[test]
    fn every_trial_has_a_seed_of_its_own_and_a_quick_first_one_is_made_again() {
        let mut seen: Vec<(usize, Turn)> = Vec::new();
        let runs = run::<_, ()>(&settings(&[1.0, 2.0, 4.0]), &effort(4, None), Control::silent(), |index, turn| {
            seen.push((index, turn));
            Ok(Trial { seconds: 1.0, errors: vec![index as f64] })
        })
        .expect("runs");
        assert_eq!(runs.ended, None);
        assert!(runs.trials.iter().enumerate().all(|(i, t)| t.len() == 4 && t.iter().all(|t| t.errors[0] == i as f64)));
        let order: Vec<usize> = seen.iter().map(|s| s.0).collect();
        assert_eq!(order, [0, 0, 1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0], "one warm-up, then there and back");
        assert!(seen.iter().enumerate().all(|(k, s)| s.1.again == (k == 1)));
        assert_eq!(seen[0].1.seed, seen[1].1.seed);
        let mut seeds: Vec<u64> = seen[1..].iter().map(|s| s.1.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), seen.len() - 1);
    }

    /// A machine on which the first trial takes longer than [`WARM`] counts the same ones.
    #[test]
    fn what_counts_does_not_depend_on_how_long_it_takes() {
        let counted = |pause: Duration| {
            let mut pause = Some(pause);
            run::<_, ()>(&settings(&[1.0, 2.0]), &effort(3, None), Control::silent(), |_, turn| {
                pause.take().into_iter().for_each(std::thread::sleep);
                Ok(Trial { seconds: 1.0, errors: vec![turn.seed as f64] })
            })
            .expect("runs")
            .trials
        };
        assert_eq!(counted(Duration::ZERO), counted(WARM));
    }

    #[test]
    fn what_would_end_too_late_is_not_begun() {
        let end = Instant::now() + Duration::from_millis(200);
        let runs = run::<_, ()>(&settings(&[1.0, 1e6]), &effort(3, Some(end)), Control::silent(), |index, _| {
            assert_eq!(index, 0, "a million times as long as the first");
            std::thread::sleep(Duration::from_millis(5));
            Ok(Trial { seconds: 1.0, errors: vec![] })
        })
        .expect("runs");
        assert_eq!((runs.trials[0].len(), runs.trials[1].len()), (3, 0));
        assert!(runs.ended.is_some());
    }

    /// A trial without end.
    #[test]
    fn what_still_runs_when_time_is_up_is_stopped() {
        let end = Instant::now() + Duration::from_millis(100);
        let effort = effort(3, Some(end));
        let runs = limited(&effort, Control::silent(), |control| {
            run::<_, ()>(&settings(&[1.0, 2.0]), &effort, control, |index, _| {
                while index == 1 && !control.stop.requested() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Ok(Trial { seconds: 1.0, errors: vec![] })
            })
        });
        let runs = runs.expect("runs");
        assert_eq!((runs.trials[0].len(), runs.trials[1].len()), (1, 0));
        assert_eq!(runs.ended.as_deref(), Some(LATE));
    }

    #[test]
    fn a_stop_keeps_the_trials_that_are_whole() {
        let stop = Stop::new();
        let progress: &dyn Progress = &Quiet;
        let mut done = 0;
        let runs = run::<_, ()>(&settings(&[1.0]), &effort(10, None), Control { progress, stop: &stop }, |_, _| {
            done += 1;
            if done == 4 {
                stop.request();
            }
            Ok(Trial { seconds: 1.0, errors: vec![] })
        })
        .expect("runs");
        // The warm-up does not count, and the one that was stopped is not whole.
        assert_eq!(runs.trials[0].len(), 2);
        assert!(runs.ended.is_some_and(|why| why.contains("stopped")));
    }
}
