//! Output files of the commands.

use std::io::{self, Write};
use std::path::Path;

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

/// The text of a file; `-` is stdin.
pub(super) fn read_text(path: &Path) -> Result<String, Failure> {
    let read =
        if path == Path::new("-") { io::read_to_string(io::stdin().lock()) } else { std::fs::read_to_string(path) };
    read.map_err(|e| Failure::usage(format!("{}: {e}", path.display())))
}

/// Writes a text file whole, or to stdout for `-` (where a closed pipe is no error).
pub(super) fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_bytes(path, text.as_bytes())
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
