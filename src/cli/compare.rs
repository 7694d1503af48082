//! `goniofit compare`: in which numbers two pictures differ.

use std::fmt::Write;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::failure::Failure;
use super::ui::Ui;
use crate::image::{Comparison, Image, compare, decode_exr, read_exr};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit compare fit-1.exr table.exr --fail-above rel_mse=1e-3")]
pub(super) struct Args {
    /// The picture (EXR); `-` is stdin
    image: PathBuf,
    /// What it should look like (EXR); `-` is stdin
    reference: PathBuf,
    /// Exit with 1 where the metric (rmse, rel_mse, max_abs, max_z) is above X
    #[arg(long, value_name = "METRIC=X", value_parser = parse_limit)]
    fail_above: Vec<(String, f64)>,
}

const METRICS: [&str; 4] = ["rmse", "rel_mse", "max_abs", "max_z"];

fn parse_limit(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected METRIC=X")?;
    if !METRICS.contains(&name) {
        return Err(format!("known metrics are {}", METRICS.join(", ")));
    }
    let value = value.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or("X must be a finite number")?;
    Ok((name.into(), value))
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    if args.image.as_os_str() == "-" && args.reference.as_os_str() == "-" {
        return Err(Failure::usage("only one of the pictures can come from stdin"));
    }
    let comparison = compare(&picture(&args.image)?, &picture(&args.reference)?)?;
    let object = serde_json::to_value(&comparison).map_err(|e| Failure::work(e.to_string()))?;
    let text = describe(&comparison);
    for (name, limit) in &args.fail_above {
        let value = metric(&comparison, name).ok_or_else(|| {
            Failure::usage(format!("{name}: the noise that it needs is not known")).beside(text.clone(), object.clone())
        })?;
        // A value that is not a number is above any limit.
        if value.is_nan() || value > *limit {
            return Err(Failure::work(format!("{name} is {value:e}, above {limit:e}")).beside(text, object));
        }
    }
    ui.result(&text, &object);
    Ok(())
}

/// The picture in a file, `-` being stdin.
fn picture(path: &Path) -> Result<Image, Failure> {
    if path != Path::new("-") {
        return Ok(read_exr(path)?);
    }
    let mut bytes = Vec::new();
    std::io::stdin().read_to_end(&mut bytes).map_err(|e| Failure::usage(format!("stdin: {e}")))?;
    Ok(decode_exr(Path::new("stdin"), bytes)?)
}

fn metric(c: &Comparison, name: &str) -> Option<f64> {
    match name {
        "rmse" => Some(c.rmse),
        "rel_mse" => Some(c.rel_mse),
        "max_abs" => Some(c.max_abs),
        _ => c.significance.as_ref().map(|s| s.max_z),
    }
}

fn describe(c: &Comparison) -> String {
    let mut t = String::new();
    let _ = writeln!(t, "pixels     {} compared, {} masked", c.pixels, c.masked);
    let _ = writeln!(t, "rmse       {:.6e} W/(sr·m²)", c.rmse);
    let _ = writeln!(t, "relMSE     {:.6e}", c.rel_mse);
    let _ = writeln!(t, "PSNR       {}", c.psnr.map_or("–".into(), |p| format!("{p:.2} dB")));
    let _ = writeln!(t, "largest    {:.6e} W/(sr·m²)", c.max_abs);
    let rgb = |m: &[f64; 3]| format!("{:.6} {:.6} {:.6}", m[0], m[1], m[2]);
    let _ = writeln!(t, "mean       {}  (reference {})", rgb(&c.mean), rgb(&c.reference_mean));
    if c.not_finite > 0 {
        let _ = writeln!(t, "warning: {} values are not finite", c.not_finite);
    }
    match &c.significance {
        Some(s) => {
            let (x, y, c) = s.at;
            let where_ = match s.block {
                1 => format!("pixel ({x}, {y}), channel {c}"),
                n => format!("the {n}×{n} pixels from ({x}, {y}) on, channel {c}"),
            };
            let verdict = if s.differs { "differ by more than their noise" } else { "agree within their noise" };
            let _ = writeln!(
                t,
                "the pictures {verdict}: largest |z| {:.2} in {where_}, p {:.2e}, mean z² {:.3}",
                s.max_z, s.p, s.mean_z2
            );
        }
        None => t.push_str(
            "whether the difference is noise can't be said
",
        ),
    }
    if let Some(note) = &c.note {
        let _ = writeln!(t, "note: {note}");
    }
    t
}
