//! How to make all of it again.

use std::path::Path;

use crate::report::run::{Kind, Made, Run};
use crate::report::typed;

/// A command and what it makes.
pub(super) struct Command {
    pub makes: String,
    pub typed: String,
}

pub(super) struct Reproduce {
    pub program: String,
    pub folder: String,
    pub seed: String,
    pub run: Option<String>,
    pub commands: Vec<Command>,
}

pub(super) fn reproduce(run: &Run) -> Reproduce {
    let own = concat!("goniofit ", env!("CARGO_PKG_VERSION"));
    let program = match &run.made.program {
        Some(program) if program != own => format!("{program}; this page: {own}"),
        _ => own.into(),
    };
    Reproduce {
        program,
        folder: run.made.folder.as_ref().map_or("–".into(), |f| f.display().to_string()),
        seed: run.seed.map_or("–".into(), |s| s.to_string()),
        run: (!run.made.command.is_empty()).then(|| typed(&run.made.command)),
        commands: commands(run),
    }
}

/// A file as it is typed where the run was made.
pub(super) fn as_typed<'a>(run: &Run, file: &'a str) -> &'a str {
    let within = run.made.folder.as_deref().and_then(|folder| Path::new(file).strip_prefix(folder).ok());
    within.and_then(Path::to_str).unwrap_or(file)
}

fn commands(run: &Run) -> Vec<Command> {
    let mut list = Vec::new();
    let mut push = |makes: &str, words: &[&str]| {
        list.push(Command { makes: makes.into(), typed: typed(words) });
    };
    let path = run.table.as_ref().ok().map(|t| t.path.display().to_string());
    let files: Vec<&str> = run.fits.iter().map(|f| as_typed(run, &f.file)).collect();
    if let Some(path) = &path {
        push("what is in the measurement", &["goniofit", "info", path]);
        push("the map of the hemisphere", &["goniofit", "plot", "coverage", path, "--out", "coverage.svg"]);
        push("polar lobes", &[&["goniofit", "plot", "polar", path][..], &files, &["--out", "lobes.svg"]].concat());
        push("slices", &[&["goniofit", "plot", "slice", path][..], &files, &["--out", "slices.svg"]].concat());
        for (fit, file) in run.fits.iter().zip(&files) {
            let mut words = vec!["goniofit", "plot", "residuals", path, file];
            if let Some(instrument) = &fit.through {
                words.extend(["--through", instrument]);
            }
            words.extend(["--out", "residuals.svg"]);
            push("residual maps", &words);
        }
    }
    if let Some((first, others)) = run.pictures.split_first().filter(|(first, _)| first.label == run.reference) {
        for other in others {
            let [a, b] = [&other.file, &first.file].map(|f| run.folder.join(f).display().to_string());
            push("numbers of the pictures", &["goniofit", "compare", &a, &b]);
        }
    }
    for sweep in run.sweeps.iter().filter(|sweep| !sweep.file.as_os_str().is_empty()) {
        // The run's own command stands above.
        let made = Made::of(&sweep.run).command;
        if !made.is_empty() && made != run.made.command {
            push("what accuracy costs", &made.iter().map(String::as_str).collect::<Vec<_>>());
        }
        push(
            "curves of accuracy against time",
            &["goniofit", "plot", "tradeoff", &sweep.file.display().to_string(), "--out", "curves.svg"],
        );
    }
    let folder = run.folder.display().to_string();
    if run.kind != Kind::Fit {
        push("this page", &["goniofit", "report", &folder]);
    }
    list
}
