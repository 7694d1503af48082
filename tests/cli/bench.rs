//! A folder of its own for each test, and the command run in it.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use goniofit::image::{Image, read_exr};
use serde_json::Value;
use tempfile::TempDir;

/// What a run of the command left behind.
#[derive(Debug)]
pub struct Ran {
    pub code: Option<i32>,
    pub out: Vec<u8>,
    pub err: String,
}

impl Ran {
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.out).into_owned()
    }

    /// The one JSON value that stdout holds; more or less than one is a failure.
    pub fn json(&self) -> Value {
        let value: Value = serde_json::from_slice(&self.out)
            .unwrap_or_else(|e| panic!("stdout is not one JSON value: {e}\n{}\n{}", self.text(), self.err));
        assert!(value.is_object(), "{value}");
        value
    }
}

pub fn goniofit() -> Command {
    Command::new(env!("CARGO_BIN_EXE_goniofit"))
}

/// A temporary folder in which commands run.
pub struct Bench(TempDir);

impl Bench {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).expect("writes");
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).expect("text")
    }

    pub fn json_file(&self, name: &str) -> Value {
        serde_json::from_slice(&self.bytes(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn exr(&self, name: &str) -> Image {
        read_exr(&self.path(name)).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Names in a folder, hidden ones too, sorted.
    pub fn list(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).unwrap_or_else(|e| panic!("{folder}: {e}"));
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = goniofit();
        command.args(args).current_dir(self.0.path());
        command
    }

    pub fn run_on(&self, args: &[&str], stdin: &[u8]) -> Ran {
        let mut command = self.command(args);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("starts");
        let mut pipe = child.stdin.take().expect("a pipe");
        let input = stdin.to_vec();
        // A command that does not read its input closes the pipe: not this writer's business.
        let writer = std::thread::spawn(move || pipe.write_all(&input).is_ok());
        let output = child.wait_with_output().expect("ends");
        writer.join().expect("writes");
        let err = String::from_utf8_lossy(&output.stderr).into_owned();
        Ran { code: output.status.code(), out: output.stdout, err }
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        self.run_on(args, b"")
    }

    /// Runs a command that must succeed.
    pub fn ok(&self, args: &[&str]) -> Ran {
        let ran = self.run(args);
        assert_eq!(ran.code, Some(0), "{args:?}: {} {}", ran.err, ran.text());
        ran
    }

    /// The JSON object of a command that must succeed.
    pub fn json(&self, args: &[&str]) -> Value {
        self.ok(&[args, &["--json"]].concat()).json()
    }

    /// A small noisy measurement of gloss paint: 2601 direction pairs, polar angles 0°, 10° … 80°.
    pub fn paint(&self, name: &str) {
        self.ok(&["simulate", "--material", "glossy-paint", "--scan", "hemisphere:10", "--seed", "3", "--out", name]);
    }

    /// Such a measurement, and its fit.
    pub fn fitted(&self, csv: &str, json: &str) {
        self.paint(csv);
        self.ok(&["fit", csv, "--out", json]);
    }

    /// A small picture; `args` come on top.
    pub fn picture(&self, out: &str, args: &[&str]) -> Ran {
        self.run(&[&["render", "--size", "24", "--samples", "4", "--out", out], args].concat())
    }
}

/// A CSV measurement of one channel from (θi, θo, φo, value) rows, incidence at φi = 180°.
pub fn csv(rows: &[(f64, f64, f64, f64)]) -> String {
    let mut text = String::from("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r\n");
    for (theta_i, theta_o, phi_o, value) in rows {
        writeln!(text, "{theta_i},180,{theta_o},{phi_o},{value}").expect("writes");
    }
    text
}

/// A laboratory with a reference, two exposures, moves and a shadow; no errors of its own.
pub const LAB: &str = "version = 1
[instrument]
electrons = 1e6
[instrument.detector]
full_well = 4e5
exposures_s = [0.02, 0.5]
[instrument.reference]
reflectance = 0.985
[instrument.axes]
move_s = 2
[instrument.surroundings]
stray_per_sr = 2e-3
shadow_deg = 3
[instrument.protocol]
block = 100
repeats = 8
";

/// All its samples lie beyond the default angular limit.
pub fn nothing_to_fit() -> String {
    csv(&[(30.0, 85.0, 0.0, 1.0), (30.0, 86.0, 0.0, 1.0)])
}

/// A header without rows.
pub fn broken() -> String {
    csv(&[])
}

pub fn fixture(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-fixtures").join(name).to_string_lossy().into_owned()
}

/// Pictures are the same where every decoded layer is; how long they took may differ.
pub fn assert_same_picture(a: &Image, b: &Image, what: &str) {
    assert_eq!((a.width, a.height), (b.width, b.height), "{what}");
    assert!(a.radiance == b.radiance, "{what}: radiance differs");
    assert!(a.standard_error == b.standard_error, "{what}: standard errors differ");
    assert!(a.mask == b.mask, "{what}: masks differ");
    let timeless = |i: &Image| (i.metadata.scene.clone(), i.metadata.seed, i.metadata.samples);
    assert_eq!(timeless(a), timeless(b), "{what}");
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("not a number: {value}"))
}

pub fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap_or_else(|| panic!("not an object: {value}")).keys().map(String::as_str).collect()
}
