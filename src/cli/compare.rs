//! `goniofit compare`: in which numbers two pictures differ.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::comparison::{METRICS, describe, metric};
use super::failure::Failure;
use super::output::{check_folder, keeps_inputs, stdout_is_free, write_bytes};
use super::render::parse_exposure;
use super::ui::Ui;
use crate::image::{
    Comparison, Image, compare_at, comparison_sheet, decode_exr, difference, encode_exr, encode_png, read_exr,
};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit compare fit-1.exr table.exr --fail-above rel_mse=1e-3
  goniofit compare fit-1.exr table.exr --out maps.png")]
pub(super) struct Args {
    /// The picture (EXR); `-` is stdin
    image: PathBuf,
    /// What it should look like (EXR); `-` is stdin
    reference: PathBuf,
    /// Exit with 1 where the metric (rmse, rel_mse, max_abs, max_z, block_max_z, flip, hdr_flip, delta_e_76, delta_e_2000; of
    /// the last four the mean) is above X
    #[arg(long, value_name = "METRIC=X", value_parser = parse_limit)]
    fail_above: Vec<(String, f64)>,
    /// Also write maps of the difference: a .png with scale bars, or an .exr with the values (radiance less reference, layers
    /// `relative` and `flip`)
    #[arg(long, value_name = "MAP.png|MAP.exr")]
    out: Option<PathBuf>,
    /// Exposure at which looks are compared, stops (default: by the reference, lamps left aside)
    #[arg(long, allow_negative_numbers = true, value_parser = parse_exposure)]
    exposure: Option<f64>,
}

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
    if let Some(out) = &args.out {
        check_map(out, args, ui)?;
    }
    let (image, reference) = (picture(&args.image)?, picture(&args.reference)?);
    let comparison = compare_at(&image, &reference, args.exposure)?;
    let mut object = serde_json::to_value(&comparison).map_err(|e| Failure::work(e.to_string()))?;
    if let Some(out) = &args.out {
        object["out"] = serde_json::json!(out);
    }
    let text = describe(&comparison);
    if let Some(refusal) = refusal(&comparison, args) {
        return Err(refusal.beside(text, object));
    }
    if let Some(out) = &args.out {
        write_bytes(out, &map(out, args, (&image, &reference), &comparison)?)?;
    }
    for (name, limit) in &args.fail_above {
        let value = metric(&comparison, name).ok_or_else(|| {
            Failure::usage(format!("{name}: it needs noise that is not known, or a reference that is not black"))
                .beside(text.clone(), object.clone())
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

/// Why two pictures can't be compared although they have one size.
fn refusal(c: &Comparison, args: &Args) -> Option<Failure> {
    if let Some(first) = &c.first_not_finite {
        let file = if first.in_reference { &args.reference } else { &args.image };
        let (x, y, channel) = first.at;
        return Some(Failure::usage(format!(
            "{}: the value of pixel ({x}, {y}), channel {channel}, is not finite; of all known pixels of both pictures {} are not, \
             so they have no metrics",
            file.display(),
            values(c.not_finite)
        )));
    }
    (c.pixels == 0).then(|| {
        Failure::work(format!(
            "nothing to compare: the masks cover all {} pixels of the picture or its reference",
            c.masked
        ))
    })
}

fn values(count: usize) -> String {
    if count == 1 { "1 value".into() } else { format!("{count} values") }
}

/// A map is a picture, named as such, and no input.
fn check_map(out: &Path, args: &Args, ui: &Ui) -> Result<(), Failure> {
    if out == Path::new("-") || !(has_extension(out, "png") || has_extension(out, "exr")) {
        return Err(Failure::usage(format!(
            "--out: expected a name that ends in .png or .exr, found {}",
            out.display()
        )));
    }
    keeps_inputs("--out", out, [args.image.as_path(), args.reference.as_path()])?;
    check_folder(out)?;
    stdout_is_free(out, ui)
}

fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(wanted))
}

/// The bytes of the map.
fn map(out: &Path, args: &Args, pictures: (&Image, &Image), comparison: &Comparison) -> Result<Vec<u8>, Failure> {
    let (image, reference) = pictures;
    if has_extension(out, "exr") {
        return Ok(encode_exr(&difference(image, reference, args.exposure)?)?);
    }
    let name = |path: &Path| path.file_name().map_or_else(|| "stdin".into(), |n| n.to_string_lossy().into_owned());
    let (ours, theirs) = (name(&args.image), name(&args.reference));
    let sheet = comparison_sheet((&ours, image), (&theirs, reference), comparison, args.exposure)?;
    Ok(encode_png(&sheet.draw()?)?)
}
