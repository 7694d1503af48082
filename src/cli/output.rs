//! Output files of the commands.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::failure::Failure;
use super::ui::Ui;
use crate::control::write_whole;
use crate::measurement::{Format, Measurement, MeasurementError, formats};

/// `--json` and an output on stdout exclude each other: only one of them can have stdout.
pub(super) fn stdout_is_free(out: &Path, ui: &Ui) -> Result<(), Failure> {
    if out == Path::new("-") && ui.is_json() {
        return Err(Failure::usage("--json: stdout is taken by --out -; write to a file"));
    }
    Ok(())
}

/// What messages call an input.
pub(super) fn input_name(path: &Path) -> String {
    if path == Path::new("-") { "stdin".into() } else { path.display().to_string() }
}

/// The text of a file; `-` is stdin.
pub(super) fn read_text(path: &Path) -> Result<String, Failure> {
    let name = input_name(path);
    if path != Path::new("-") && path.is_dir() {
        return Err(Failure::usage(format!("{name}: expected a file, found a folder")));
    }
    let mut bytes = Vec::new();
    let read = if path == Path::new("-") {
        io::stdin().lock().read_to_end(&mut bytes).map(|_| ())
    } else {
        std::fs::read(path).map(|all| bytes = all)
    };
    read.map_err(|e| Failure::usage(format!("{name}: {e}")))?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let place = e.utf8_error().valid_up_to();
        not_utf8(&name, place, e.as_bytes())
    })?;
    match text.find('\0') {
        Some(place) => Err(not_utf8(&name, place, text.as_bytes())),
        None => Ok(text),
    }
}

/// An input that is no text in UTF-8 from byte `place` on, with what it may be instead.
fn not_utf8(name: &str, place: usize, bytes: &[u8]) -> Failure {
    let found = match bytes {
        [0xff, 0xfe, ..] => "the mark of UTF-16, little-endian",
        [0xfe, 0xff, ..] => "the mark of UTF-16, big-endian",
        _ if bytes.contains(&0) => "bytes that are 0: UTF-16 without its mark, or no text",
        _ => "a byte of another encoding, Windows-1252 or Latin-1 perhaps",
    };
    Failure::usage(format!("{name}, byte {place}: expected text in UTF-8, found {found}; save the file as UTF-8"))
}

/// Writes a text file whole, or to stdout for `-` (where a closed pipe is no error).
pub(super) fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_bytes(path, text.as_bytes())
}

/// Writes an object as a JSON file for people and programs, whole.
pub(super) fn write_json(path: &Path, object: &Value) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(object).map_err(|e| Failure::work(e.to_string()))?;
    write_text(path, &(text + "\n"))
}

/// Writes a file whole, or to stdout for `-`.
pub(super) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if path == Path::new("-") {
        let mut out = io::stdout().lock();
        return closed_pipe_is_fine(out.write_all(bytes).and_then(|()| out.flush()))
            .map_err(|e| Failure::output(path, &e));
    }
    write_whole::<_, io::Error>(path, |w| w.write_all(bytes)).map_err(|e| Failure::output(path, &e))
}

fn closed_pipe_is_fine(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// An output that is one of the inputs would destroy it; `option` is what the output was named by. Links and `./` are looked through;
/// what is no regular file (a terminal, `/dev/null`) can be both.
pub(super) fn keeps_inputs<'a>(
    option: &str,
    out: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let file =
        |path: &Path| if path == Path::new("-") { None } else { path.canonicalize().ok().filter(|p| p.is_file()) };
    let Some(target) = file(out) else { return Ok(()) };
    match inputs.into_iter().find(|input| file(input).is_some_and(|f| f == target)) {
        None => Ok(()),
        Some(input) => Err(Failure::usage(format!(
            "{option}: writing {} would destroy the input {}; expected another name",
            out.display(),
            input.display()
        ))),
    }
}

/// Two outputs that are one file would leave only the second; each comes with the option that it was named by. What is no regular file
/// (`/dev/null`) can be both, stdout can't.
pub(super) fn distinct_outputs(first: (&str, &Path), second: (&str, &Path)) -> Result<(), Failure> {
    let [a, b] = [first.1, second.1].map(target);
    let is_device = std::fs::metadata(&a).is_ok_and(|m| !m.is_file());
    if a != b || (is_device && a != Path::new("-")) {
        return Ok(());
    }
    let what = if a == Path::new("-") { "stdout".to_owned() } else { first.1.display().to_string() };
    Err(Failure::usage(format!(
        "{}: {} would write over what {} writes to {what}; expected another name",
        second.0,
        second.1.display(),
        first.0
    )))
}

/// The file that a path leads to, whether it is there yet or not.
fn target(path: &Path) -> PathBuf {
    let mut path = path.to_path_buf();
    if path == Path::new("-") {
        return path;
    }
    // A link to a file that is not there yet; more than a few in a row go in circles.
    for _ in 0..40 {
        let Ok(link) = std::fs::read_link(&path) else { break };
        path = path.parent().map_or_else(|| link.clone(), |folder| folder.join(&link));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let there = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(there).unwrap_or(path)
}

/// Makes a folder for outputs where there is none yet.
pub(super) fn make_folder(option: &str, folder: &Path) -> Result<(), Failure> {
    match std::fs::create_dir_all(folder) {
        Ok(()) => Ok(()),
        Err(e) if matches!(e.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory) => {
            Err(Failure::usage(format!("{option}: expected a folder, but {} is or lies in a file", folder.display())))
        }
        Err(e) => Err(Failure::output(folder, &e)),
    }
}

/// The folder of an output must be there before long work starts, and the output be no folder itself.
pub(super) fn check_folder(out: &Path) -> Result<(), Failure> {
    if out == Path::new("-") {
        return Ok(());
    }
    if out.is_dir() {
        return Err(Failure::usage(format!("{}: expected the name of a file, found a folder", out.display())));
    }
    let folder = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    if folder.is_dir() { Ok(()) } else { Err(Failure::usage(format!("{}: there is no such folder", folder.display()))) }
}

/// The format to write a measurement in: as asked, else by the extension, CSV on stdout.
pub(super) fn output_format(path: &Path, asked: Option<Format>) -> Result<Format, Failure> {
    let known = || {
        Failure::usage(format!(
            "{}: its extension names no format that can be written; use .binary (MERL) or .csv",
            path.display()
        ))
    };
    match asked {
        Some(format) => Ok(format),
        None if path == Path::new("-") => Ok(Format::Csv),
        None => Format::from_extension(path).ok_or_else(known),
    }
}

/// What is always written as CSV has a name that says so, or goes to stdout.
pub(super) fn is_csv(option: &str, path: &Path) -> Result<(), Failure> {
    let right = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    let device = std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir());
    if right || device || path == Path::new("-") {
        return Ok(());
    }
    Err(Failure::usage(format!("{option}: expected a name that ends in .csv, or -, found {}", path.display())))
}

enum WriteFailure {
    Content(MeasurementError),
    Disk(io::Error),
}

impl From<io::Error> for WriteFailure {
    fn from(error: io::Error) -> Self {
        Self::Disk(error)
    }
}

/// Writes a measurement whole, and says what its format could not hold.
pub(super) fn write_measurement(table: &Measurement, path: &Path, format: Format, ui: &Ui) -> Result<(), Failure> {
    let write = |out: &mut dyn Write| formats::write(table, format, path, out).map_err(WriteFailure::Content);
    let written = if path == Path::new("-") { write(&mut io::stdout().lock()) } else { write_whole(path, write) };
    let report = match written {
        Ok(report) => report,
        Err(WriteFailure::Content(MeasurementError::Io { source, .. }) | WriteFailure::Disk(source)) => {
            if path == Path::new("-") && source.kind() == io::ErrorKind::BrokenPipe {
                return Ok(());
            }
            return Err(Failure::output(path, &source));
        }
        Err(WriteFailure::Content(error)) => return Err(error.into()),
    };
    let name = format.description();
    if report.lost_negative > 0 {
        ui.warn(&format!(
            "{}: {name} has no negative values (they mean \"not measured\" there): {} readings that noise made negative are \
             written as not measured",
            path.display(),
            report.lost_negative
        ));
    }
    if report.lost_sigma + report.lost_common > 0 {
        ui.warn(&format!("{}: {name} has no place for σ: written without; .csv keeps it", path.display()));
    }
    Ok(())
}
