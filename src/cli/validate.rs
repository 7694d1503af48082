//! `goniofit validate`: a table and its fits under the same light; the fits alone where the table does not cover enough.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::comparison::sentence;
use super::failure::Failure;
use super::info::Reading;
use super::output::{keeps_inputs, make_folder, write_json};
use super::render::{PictureArgs, parse_exposure};
use super::report;
use super::text::indented;
use super::ui::{self, Ui};
use crate::brdf::Material;
use crate::chain::{self, ChainError, Shown, Source, Stage};
use crate::image::{Appearance, Comparison};
use crate::measurement::{Dimension, Measurement, MeasurementError, formats};
use crate::render::{Material as Subject, Options};
use crate::report::run::RunOptions;

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit validate gold.binary gold.json --scene sphere-on-plane --out gold/")]
pub(super) struct Args {
    /// The measurement; of one that does not cover enough to be rendered, an in-plane scan say, the fits are shown alone
    measurement: PathBuf,
    /// Fits of it
    #[arg(required = true, value_name = "FIT.json")]
    fits: Vec<String>,
    #[command(flatten)]
    picture: PictureArgs,
    /// Exposure of the previews, stops (default: by the table's picture, lamps left aside)
    #[arg(long, allow_negative_numbers = true, value_parser = parse_exposure)]
    exposure: Option<f64>,
    /// Folder to write to: table.exr, fit-1.exr, difference-1.exr, maps-1.png …, previews, sheet.png, numbers.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Also write report.html, the run on one page
    #[arg(long)]
    report: bool,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let inputs = args.fits.iter().map(Path::new).chain([args.measurement.as_path()]);
    keeps_inputs("--out", &args.out.join("numbers.json"), inputs)?;
    let stage = args.picture.stage()?;
    let table = formats::read(&args.measurement, &args.reading.options())?;
    for note in &table.notes {
        ui.note(&format!("{}: note: {note}", args.measurement.display()));
    }
    let name = table.name.clone();
    let fits = args.fits.iter().map(|f| chain::load_material(f).map(|m| (f, m))).collect::<Result<Vec<_>, _>>()?;
    let options = args.picture.options(&stage);
    // Everything is resolved before anything is written.
    let (subjects, missing) = subjects(args, table, &fits)?;
    if let Some(reason) = &missing {
        ui.warn(&alone(&args.measurement, reason, fits.len()));
    }
    make_folder("--out", &args.out)?;
    let mut shown = Vec::new();
    for (k, subject) in subjects.into_iter().enumerate() {
        if !ui::stop().requested() {
            shown.push(take(k, subject, &stage, &options, ui)?);
        }
    }
    shown.retain(|shown| shown.image.metadata.samples != Some(0));
    let Some((reference, others)) = shown.split_first() else {
        return Err(Failure::work("stopped before the first picture had any sample: nothing was written"));
    };
    let stopped = ui::stop().requested();
    if stopped {
        ui.warn("stopped: pictures are missing or have fewer samples than asked for");
    }
    let subtitle =
        format!("{} scene, {} samples a pixel", stage.spec.name, reference.image.metadata.samples.unwrap_or(0));
    let gallery = chain::write_gallery(&args.out, &name, &subtitle, reference, others, args.exposure)?;
    // A fit that is the reference itself is compared with nothing.
    let of_reference = usize::from(missing.is_some());
    let compared = std::iter::repeat_n(None, of_reference).chain(gallery.comparisons.iter().map(Some));
    let rows: Vec<_> = fits.iter().map(|(file, m)| (file.as_str(), m)).zip(compared).collect();
    let mut not_rendered = Vec::new();
    for (file, fit) in fits.iter().skip(rows.len()) {
        ui.warn(&format!("{file}: not rendered"));
        not_rendered.push(json!({ "fit": file, "model": fit.model() }));
    }
    let object = json!({
        "measurement": args.measurement, "scene": stage.spec.name, "samples": options.samples, "seed": options.seed,
        "exposure": gallery.exposure, "reference": format!("{}.exr", reference.file), "table_not_rendered": missing,
        "fits": rows.iter().enumerate().map(numbers).collect::<Vec<_>>(), "not_rendered": not_rendered, "out": args.out,
        "stopped": stopped, "run": report::made(),
    });
    write_json(&args.out.join("numbers.json"), &object)?;
    if args.report {
        let options = RunOptions { measurement: Some(args.measurement.clone()), reading: args.reading.options() };
        report::of_folder(&args.out, &options)?;
    }
    let head = format!("{name}, {} scene, {} samples a pixel", stage.spec.name, options.samples);
    for note in rows.iter().filter_map(|(_, c)| c.and_then(|c| c.note.as_ref())) {
        ui.warn(note);
    }
    let [head, end] = [head, format!("written to {}", args.out.display())].map(|line| indented(&line, 2));
    ui.result(&format!("{head}\n{}  {end}\n", text(&rows)), &object);
    Ok(())
}

/// A fit's file and material, and its picture's comparison with the reference, if it is not that.
type Row<'a> = ((&'a str, &'a Material), Option<&'a Comparison>);

/// What is rendered, the reference first.
struct Rendered {
    file: String,
    difference_file: String,
    label: String,
    material: Subject,
}

/// The table and its fits; the fits alone, with the reason, where the table does not cover enough to be rendered.
fn subjects(
    args: &Args,
    table: Measurement,
    fits: &[(&String, Material)],
) -> Result<(Vec<Rendered>, Option<String>), Failure> {
    let rgb = args.picture.rgb.as_ref();
    let is_flat = table.dimension == Dimension::Flat;
    let measured = chain::render_material(&args.measurement.to_string_lossy(), &Source::Measured(Box::new(table)), rgb);
    let (measured, missing) = match measured {
        Ok(material) => (Some(material), None),
        Err(ChainError::Measurement(MeasurementError::Unsupported { reason, .. })) if !is_flat => (None, Some(reason)),
        Err(error) => return Err(error.into()),
    };
    let of_table = measured.map(|material| Rendered {
        file: "table".into(),
        difference_file: String::new(),
        label: "table".into(),
        material,
    });
    let of_fit = |(k, (file, fit)): (usize, &(&String, Material))| {
        Ok(Rendered {
            file: format!("fit-{}", k + 1),
            difference_file: format!("difference-{}", k + 1),
            label: label(file, fit, fits.len()),
            material: chain::render_material(file, &Source::Fitted(Box::new(fit.clone())), rgb)?,
        })
    };
    let of_fits = fits.iter().enumerate().map(of_fit).collect::<Result<Vec<_>, Failure>>()?;
    Ok((of_table.into_iter().chain(of_fits).collect(), missing))
}

/// What a table that can't be rendered leaves to see, and what to do about it.
fn alone(measurement: &Path, reason: &str, fits: usize) -> String {
    // The fits are there.
    let reason = reason.trim_end_matches("; fit a model and render that");
    let rest = match fits {
        1 => "the picture is of the fit alone, compared with nothing; give another fit to see them side by side",
        _ => "pictures are of the fits alone, each compared with the first",
    };
    format!(
        "{}: the table itself can't be rendered: {reason}: {rest}. How well a fit meets the readings is its own rmse; to see it beside the table, \
         measure the hemisphere (--scan hemisphere:5, say)",
        measurement.display()
    )
}

/// A fit in numbers.json.
fn numbers((k, ((file, fit), compared)): (usize, &Row<'_>)) -> Value {
    json!({
        "fit": file, "model": fit.model(), "picture": format!("fit-{}.exr", k + 1),
        "maps": compared.map(|_| format!("maps-{}.png", k + 1)), "image": compared, "statement": compared.map(sentence),
        "rmse_of_fit": fit.fit.as_ref().map(|f| f.rmse),
    })
}

/// Columns of a fit's name in the table.
const NAME: usize = 26;

/// All fits as text.
fn text(rows: &[Row<'_>]) -> String {
    let mut text = String::new();
    if rows.iter().any(|(_, c)| c.is_some()) {
        // Writing to a String can't fail.
        let _ = writeln!(
            text,
            "  {:NAME$} {:>9} {:>9} {:>6} {:>7} {:>6} {:>7}",
            "", "rmse", "relMSE", "PSNR", "FLIP", "ΔE2000", "masked"
        );
    }
    for ((file, fit), compared) in rows {
        let label = format!("{file} ({})", fit.model());
        if let Some(c) = compared {
            text.push_str(&row(&label, c));
            continue;
        }
        let of_fit = fit.fit.as_ref().map_or(String::new(), |f| format!(", rmse {:.2e} over the readings", f.rmse));
        let _ = writeln!(text, "  {}", indented(&format!("{label}: rendered alone{of_fit}"), 4));
    }
    text
}

/// The numbers of one fit, and what they mean.
fn row(label: &str, c: &Comparison) -> String {
    let psnr = c.psnr.map_or("–".into(), |p| format!("{p:.1}"));
    let looks = |f: fn(&Appearance) -> String| c.appearance.as_ref().map_or("–".into(), f);
    let flip = looks(|a| format!("{:.4}", a.flip.mean));
    let delta_e = looks(|a| format!("{:.2}", a.delta_e_2000.mean));
    // A longer name has a line of its own.
    let is_long = label.chars().count() > NAME;
    let (above, beside) = if is_long { (format!("  {}\n", indented(label, 4)), "") } else { (String::new(), label) };
    let (rmse, rel_mse, masked) = (c.rmse, c.rel_mse, c.masked);
    let said: Vec<String> = sentence(c).split_inclusive(';').map(|part| indented(part.trim(), 4)).collect();
    let said = said.join("\n    ");
    format!(
        "{above}  {beside:NAME$} {rmse:>9.2e} {rel_mse:>9.2e} {psnr:>6} {flip:>7} {delta_e:>6} {masked:>7}\n    {said}\n"
    )
}

/// What stands above a fit's picture: its model, and its file where there are several.
fn label(file: &str, material: &Material, fits: usize) -> String {
    let stem = Path::new(file).file_stem().map_or_else(|| file.into(), |s| s.to_string_lossy());
    if fits == 1 { format!("fit: {}", material.model()) } else { format!("{stem}: {}", material.model()) }
}

/// The `k`-th picture; each has a seed of its own, so that their errors are independent.
fn take(k: usize, subject: Rendered, stage: &Stage, options: &Options, ui: &Ui) -> Result<Shown, Failure> {
    let options = Options { seed: options.seed.wrapping_add(k as u64), ..*options };
    let Rendered { file, difference_file, label, material } = subject;
    let image = chain::picture(stage, Some(material), &options, ui.control())?;
    Ok(Shown { file, difference_file, label, image })
}
