//! The demo, run once for all tests, with its report.

use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

/// A folder with the demo in `demo`.
pub struct Run(TempDir);

impl Run {
    /// The one run.
    pub fn shared() -> &'static Self {
        static RUN: OnceLock<Run> = OnceLock::new();
        RUN.get_or_init(|| {
            let run = Self(tempfile::tempdir().expect("a folder"));
            // Few samples: noise is what makes a page large.
            run.json(&["demo", "--samples", "16", "--out", "demo", "--report"]);
            run
        })
    }

    /// Runs a command that must succeed; the JSON object that it prints.
    pub fn json(&self, args: &[&str]) -> Value {
        let output = Command::new(env!("CARGO_BIN_EXE_goniofit"))
            .args(args)
            .arg("--json")
            .current_dir(self.0.path())
            .output()
            .expect("runs");
        assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stdout));
        serde_json::from_slice(&output.stdout).expect("one JSON object")
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn page(&self) -> PathBuf {
        self.path("demo/report.html")
    }

    pub fn numbers(&self) -> Value {
        serde_json::from_slice(&std::fs::read(self.path("demo/numbers.json")).expect("reads")).expect("JSON")
    }
}

/// Numbers in a text as the page writes them, powers of ten too: `7.374·10⁻⁴`.
pub fn numbers_in(text: &str) -> Vec<f64> {
    let plain: String = text.chars().map(|c| if c == '−' { '-' } else { c }).collect();
    let words = plain.split(|c: char| c.is_whitespace() || ",:()[]°".contains(c));
    words.filter_map(number).collect()
}

fn number(word: &str) -> Option<f64> {
    let Some((digits, power)) = word.split_once("·10") else { return word.parse().ok() };
    let power: String = power
        .chars()
        .filter_map(|c| match c {
            '⁻' => Some('-'),
            '¹' => Some('1'),
            '²' => Some('2'),
            '³' => Some('3'),
            c => char::from_digit((c as u32).checked_sub(0x2070)?, 10),
        })
        .collect();
    Some(digits.parse::<f64>().ok()? * 10f64.powi(power.parse().ok()?))
}

#[test]
fn numbers_are_read_as_the_page_writes_them() {
    assert_eq!(numbers_in("θo = −30°: readings 0.0186 ± 0.0004, fit 1.78"), [-30.0, 0.0186, 0.0004, 1.78]);
    let found = numbers_in("rms 7.374·10⁻⁴ 1/sr");
    assert!((found[0] - 7.374e-4).abs() < 1e-12, "{found:?}");
}
