//! From what was typed to a plan: the options of the fit, and where each result goes.

use std::path::{Path, PathBuf};

use super::args::{Args, Wanted};
use crate::brdf::SpecError;
use crate::cli::failure::Failure;
use crate::cli::output::keeps_inputs;
use crate::fit::{Bootstrap, FitOptions};

impl Args {
    /// The fit's options.
    pub fn options(&self) -> Result<FitOptions, Failure> {
        let model = match &self.model {
            Wanted::Model(model) => model.clone(),
            Wanted::Auto => "lambert".parse().map_err(|e: SpecError| Failure::work(e.to_string()))?,
        };
        Ok(FitOptions {
            stride: self.stride,
            part: self.part,
            time_budget: self.time_budget,
            target_rmse_excess: self.target_rmse_excess,
            bootstrap: self.bootstrap.map(|replicates| Bootstrap { replicates, seed: self.seed }),
            ..self.shared.options(model, self.loss)?
        })
    }
}

/// Where each fit goes, checked before anything is read: no fit goes where a measurement or another fit is.
pub(super) fn targets(args: &Args) -> Result<Vec<Option<PathBuf>>, Failure> {
    let targets = named_targets(args)?;
    if args.report && targets.iter().any(|t| t.as_deref().is_none_or(|t| t == Path::new("-"))) {
        return Err(Failure::usage(
            "--report: expected --out FIT.json or --out-dir D, beside which the page is written",
        ));
    }
    let option = if args.out_dir.is_some() { "--out-dir" } else { "--out" };
    for target in targets.iter().flatten() {
        let inputs = || args.files.iter().map(PathBuf::as_path);
        keeps_inputs(option, target, inputs())?;
        if args.report {
            keeps_inputs("--report", &target.with_extension("html"), inputs())?;
        }
    }
    Ok(targets)
}

/// Where each fit goes by its name; two of one name are refused.
fn named_targets(args: &Args) -> Result<Vec<Option<PathBuf>>, Failure> {
    if args.out.is_some() && args.files.len() > 1 {
        return Err(Failure::usage("--out takes one measurement; use --out-dir for several"));
    }
    let Some(folder) = &args.out_dir else { return Ok(vec![args.out.clone(); args.files.len()]) };
    let mut targets: Vec<PathBuf> = Vec::new();
    for file in &args.files {
        let stem = match file.file_stem() {
            Some(stem) if stem != "-" => stem.to_string_lossy().into_owned(),
            _ => "stdin".into(),
        };
        let target = folder.join(format!("{stem}.json"));
        if targets.contains(&target) {
            return Err(Failure::usage(format!("two measurements would be written to {}", target.display())));
        }
        targets.push(target);
    }
    Ok(targets.into_iter().map(Some).collect())
}
