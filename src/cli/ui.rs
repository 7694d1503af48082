//! What a command says and shows: results on stdout, everything else on stderr.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::failure::Failure;
use crate::control::{Control, Progress, Stop};

static STOP: Stop = Stop::new();
/// Whether work runs that can be stopped with something to show for it.
static WORKING: AtomicBool = AtomicBool::new(false);
/// Whether stdout refused a result, for another reason than a closed pipe.
static LOST: AtomicBool = AtomicBool::new(false);

/// Whether a result could not be printed.
pub(super) fn lost_output() -> bool {
    LOST.load(Ordering::Relaxed)
}

/// The flag that Ctrl-C raises.
pub(super) fn stop() -> &'static Stop {
    &STOP
}

/// Ctrl-C asks the work to stop with the best so far; a second one, or one while there is nothing to keep, ends the process at
/// once.
pub(super) fn install_stop() {
    // Without a handler Ctrl-C ends the process at once, which is no reason not to work.
    let _ = ctrlc::set_handler(|| {
        if STOP.requested() || !WORKING.load(Ordering::Relaxed) {
            std::process::exit(130);
        }
        STOP.request();
    });
}

/// How a command talks.
pub(super) struct Ui {
    json: bool,
    quiet: bool,
    bar: Bar,
    start: Instant,
}

impl Ui {
    pub fn new(json: bool, quiet: bool) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        Self { json, quiet, start: Instant::now(), bar: Bar { shown, current: Mutex::new(None) } }
    }

    /// When the command began.
    pub fn start(&self) -> Instant {
        self.start
    }

    /// Whether stdout holds one JSON object and nothing else.
    pub fn is_json(&self) -> bool {
        self.json
    }

    /// Progress on a terminal, and the wish to stop.
    pub fn control(&self) -> Control<'_> {
        self.has_something_to_keep();
        Control { progress: &self.bar, stop: &STOP }
    }

    /// From here on Ctrl-C asks to stop instead of ending the process: there is something to finish.
    #[allow(clippy::unused_self)] // the flag is the process's, for a signal handler sees nothing else
    pub fn has_something_to_keep(&self) {
        WORKING.store(true, Ordering::Relaxed);
    }

    /// A remark on stderr, unless quiet.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            self.bar.aside(|| print_aside(text));
        }
    }

    /// A warning on stderr, unless quiet.
    pub fn warn(&self, text: &str) {
        self.note(&format!("warning: {text}"));
    }

    /// The command's result: `text` for people, or the JSON object.
    pub fn result(&self, text: &str, json: &serde_json::Value) {
        if self.json {
            print_line(&json.to_string());
        } else if !text.is_empty() {
            print_line(text.trim_end());
        }
    }
}

/// A positive number to three significant digits.
pub(super) fn significant(x: f64) -> String {
    let digits = if x > 0.0 && x.is_finite() { (2 - x.log10().floor() as i32).clamp(0, 12) } else { 0 };
    format!("{x:.*}", digits as usize)
}

/// Prints a line on stderr; a closed pipe is no error.
fn print_aside(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Prints a line on stdout; a closed pipe is no error.
fn print_line(text: &str) {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            LOST.store(true, Ordering::Relaxed);
            print_aside(&format!("error: stdout: {e}"));
        }
        _ => {}
    }
}

/// Says why a command failed, as `{"error": …}` on stdout or as text on stderr.
pub(super) fn report_failure(failure: &Failure, json: bool) -> ExitCode {
    let message = failure.message.strip_prefix("error: ").unwrap_or(&failure.message);
    if json {
        let mut object = failure.found.as_ref().map_or_else(|| serde_json::json!({}), |found| found.1.clone());
        object["error"] = message.into();
        print_line(&object.to_string());
    } else {
        if let Some(found) = &failure.found {
            print_line(found.0.trim_end());
        }
        print_aside(&format!("error: {message}"));
    }
    ExitCode::from(failure.code)
}

/// A progress bar, on a terminal only.
struct Bar {
    shown: bool,
    current: Mutex<Option<ProgressBar>>,
}

impl Bar {
    fn with(&self, f: impl FnOnce(&mut Option<ProgressBar>)) {
        if self.shown {
            f(&mut self.current.lock().unwrap_or_else(std::sync::PoisonError::into_inner));
        }
    }

    /// Prints without tearing the bar.
    fn aside(&self, print: impl FnOnce()) {
        let bar = self.current.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        match &*bar {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }
}

impl Progress for Bar {
    fn start(&self, label: &str, total: u64) {
        self.with(|current| {
            let bar = ProgressBar::new(total).with_message(label.to_owned());
            if let Ok(style) =
                ProgressStyle::with_template("{msg:24} {bar:30} {percent:>3} %  {elapsed} of {duration}  {prefix}")
            {
                bar.set_style(style);
            }
            bar.enable_steady_tick(Duration::from_millis(200));
            *current = Some(bar);
        });
    }

    fn advance(&self, steps: u64) {
        self.with(|current| {
            if let Some(bar) = current {
                bar.inc(steps);
            }
        });
    }

    fn tell(&self, state: &str) {
        self.with(|current| {
            if let Some(bar) = current {
                bar.set_prefix(state.to_owned());
            }
        });
    }

    fn finish(&self) {
        self.with(|current| {
            if let Some(bar) = current.take() {
                bar.finish_and_clear();
            }
        });
    }
}
