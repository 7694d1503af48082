//! What runs through the whole house: progress reports, the wish to stop, output files.
//!
//! In: nothing. Out: the two small types that any long work takes, and the one way to write a file. A library caller who wants neither passes
//! [`Control::silent`]; the command line passes a progress bar and a flag that Ctrl-C sets.

mod files;
mod plan;

pub use files::write_whole;
pub use plan::{Effect, Plan};

use std::sync::atomic::{AtomicBool, Ordering};

/// Receives the progress of long work. Called from several threads.
pub trait Progress: Sync {
    /// A stage named `label` begins; it consists of `total` steps.
    fn start(&self, label: &str, total: u64);
    /// `steps` more steps of the current stage are done.
    fn advance(&self, steps: u64);
    /// How good the current stage's result is by now, in a few words.
    fn tell(&self, _state: &str) {}
    /// Whether anybody sees it: what is told takes work to find out.
    fn is_seen(&self) -> bool {
        true
    }
    /// The current stage is over.
    fn finish(&self);
}

/// A [`Progress`] that shows nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn is_seen(&self) -> bool {
        false
    }
    fn start(&self, _label: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn finish(&self) {}
}

/// A wish to stop, raised once and seen by all threads.
#[derive(Debug, Default)]
pub struct Stop(AtomicBool);

impl Stop {
    /// A flag that is not raised.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicBool::new(false))
    }

    /// Asks the work to stop at its next opportunity, keeping the best result so far.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked to stop.
    #[must_use]
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// "1 pair", "2 pairs".
#[must_use]
pub fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// How long work talks to its caller: where progress goes, and whether to stop.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Where progress goes.
    pub progress: &'a dyn Progress,
    /// Looked at between steps.
    pub stop: &'a Stop,
}

impl std::fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control").field("stop", self.stop).finish_non_exhaustive()
    }
}

impl Control<'_> {
    /// The same wish to stop, without a progress report: for steps of a longer work that has its own.
    #[must_use]
    pub fn quiet(self) -> Self {
        Self { progress: &Quiet, ..self }
    }
}

impl Control<'static> {
    /// No progress report, never stopped.
    #[must_use]
    pub fn silent() -> Self {
        static NEVER: Stop = Stop::new();
        Self { progress: &Quiet, stop: &NEVER }
    }
}
