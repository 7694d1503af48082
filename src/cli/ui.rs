//! What a command says and shows: results on stdout, everything else on stderr.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::failure::Failure;
use super::text::folded;
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
        Self { json, quiet, start: Instant::now(), bar: Bar::new(quiet) }
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
            print_text(text.trim_end());
        }
    }
}

/// A positive number to three significant digits.
pub(super) fn significant(x: f64) -> String {
    let digits = if x > 0.0 && x.is_finite() { (2 - x.log10().floor() as i32).clamp(0, 12) } else { 0 };
    format!("{x:.*}", digits as usize)
}

/// The text as it fits a terminal's columns; as it is where there is none, for programs read lines.
fn fitting(text: &str, terminal: &console::Term) -> String {
    match terminal.size_checked() {
        Some((_, columns)) if terminal.is_term() && columns >= 40 => folded(text, columns.into()),
        _ => text.to_owned(),
    }
}

/// Prints a line on stderr; a closed pipe is no error.
fn print_aside(text: &str) {
    let text = fitting(text, &console::Term::stderr());
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Prints text for people on stdout.
fn print_text(text: &str) {
    print_line(&fitting(text, &console::Term::stdout()));
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
            print_text(found.0.trim_end());
        }
        print_aside(&format!("error: {message}"));
    }
    ExitCode::from(failure.code)
}

/// Progress: a bar on a terminal, a line now and then elsewhere.
struct Bar {
    quiet: bool,
    current: Mutex<Option<ProgressBar>>,
    plain: Mutex<Option<Plain>>,
}

/// Progress where there is no terminal.
struct Plain {
    label: String,
    total: u64,
    done: u64,
    state: String,
    start: Instant,
    said: Instant,
}

/// Between two lines of it.
const NOW_AND_THEN: Duration = Duration::from_secs(10);

impl Plain {
    /// What there is to say, if it is time.
    fn due(&mut self, now: Instant) -> Option<String> {
        if now - self.said < NOW_AND_THEN || self.done == 0 {
            return None;
        }
        self.said = now;
        let (elapsed, share) = ((now - self.start).as_secs_f64(), self.done as f64 / self.total.max(1) as f64);
        let left = elapsed * (1.0 / share - 1.0).max(0.0);
        let state = if self.state.is_empty() { String::new() } else { format!(", {}", self.state) };
        Some(format!("{}: {:.0} %, {elapsed:.0} s, {left:.0} s to go{state}", self.label, 100.0 * share.min(1.0)))
    }
}

impl Bar {
    fn new(quiet: bool) -> Self {
        Self { quiet, current: Mutex::new(None), plain: Mutex::new(None) }
    }

    fn bar(&self) -> MutexGuard<'_, Option<ProgressBar>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn plain(&self) -> MutexGuard<'_, Option<Plain>> {
        self.plain.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Prints without tearing the bar.
    fn aside(&self, print: impl FnOnce()) {
        match &*self.bar() {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }
}

impl Progress for Bar {
    fn is_seen(&self) -> bool {
        !self.quiet
    }

    fn start(&self, label: &str, total: u64) {
        if self.quiet {
            return;
        }
        if !std::io::stderr().is_terminal() {
            let now = Instant::now();
            let (label, state) = (label.to_owned(), String::new());
            *self.plain() = Some(Plain { label, total, done: 0, state, start: now, said: now });
            return;
        }
        let bar = ProgressBar::new(total).with_message(label.to_owned());
        let template = "{msg:20} {bar:16} {percent:>3} % {elapsed:>4}, {eta} to go, {per_sec} {prefix}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        *self.bar() = Some(bar);
    }

    fn advance(&self, steps: u64) {
        if let Some(bar) = &*self.bar() {
            bar.inc(steps);
        }
        let line = self.plain().as_mut().and_then(|plain| {
            plain.done += steps;
            plain.due(Instant::now())
        });
        line.into_iter().for_each(|line| print_aside(&line));
    }

    fn tell(&self, state: &str) {
        if let Some(bar) = &*self.bar() {
            bar.set_prefix(state.to_owned());
        }
        if let Some(plain) = &mut *self.plain() {
            state.clone_into(&mut plain.state);
        }
    }

    fn finish(&self) {
        if let Some(bar) = self.bar().take() {
            bar.finish_and_clear();
        }
        *self.plain() = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_is_shown_on_the_bar_or_in_the_lines() {
        let bar = Bar::new(false);
        bar.start("render", 10);
        for state in ["error 2.31 %", "error 1.16 %"] {
            bar.tell(state);
            // Whether the tests' stderr is a terminal decides which.
            let on_bar = bar.bar().as_ref().map(ProgressBar::prefix);
            let in_lines = bar.plain().as_ref().map(|plain| plain.state.clone());
            assert_eq!(on_bar.or(in_lines).as_deref(), Some(state));
        }
        bar.finish();
        assert!(bar.bar().is_none() && bar.plain().is_none());
    }

    #[test]
    fn without_a_terminal_progress_is_a_line_now_and_then() {
        let start = Instant::now();
        let mut plain =
            Plain { label: "render".into(), total: 200, done: 50, state: "error 2 %".into(), start, said: start };
        assert_eq!(plain.due(start + Duration::from_secs(9)), None);
        let said = plain.due(start + Duration::from_secs(10));
        assert_eq!(said.as_deref(), Some("render: 25 %, 10 s, 30 s to go, error 2 %"));
        assert_eq!(plain.due(start + Duration::from_secs(19)), None);
        plain.done = 0;
        assert_eq!(plain.due(start + Duration::from_secs(99)), None);
    }
}
