//! `goniofit validate`: a table and its fits under the same light.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::comparison::sentence;
use super::failure::Failure;
use super::info::Reading;
use super::output::{keeps_inputs, make_folder, write_text};
use super::render::{PictureArgs, parse_exposure};
use super::ui::{self, Ui};
use crate::brdf::Material;
use crate::chain::{self, Shown, Source, Stage};
use crate::image::{Appearance, Comparison};
use crate::measurement::formats;
use crate::render::{Material as Subject, Options};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit validate gold.binary gold.json --scene sphere-on-plane --out gold/")]
pub(super) struct Args {
    /// The measurement
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
    let rgb = args.picture.rgb.as_ref();
    // Everything is resolved before anything is written.
    let measured =
        chain::render_material(&args.measurement.to_string_lossy(), &Source::Measured(Box::new(table)), rgb)?;
    let mut subjects = vec![("table".to_owned(), measured)];
    for (file, material) in &fits {
        let source = Source::Fitted(Box::new(material.clone()));
        subjects.push((label(file, material, fits.len()), chain::render_material(file, &source, rgb)?));
    }
    make_folder("--out", &args.out)?;
    let mut shown = Vec::new();
    for (k, (label, subject)) in subjects.into_iter().enumerate() {
        if !ui::stop().requested() {
            shown.push(take(k, label, subject, &stage, &options, ui)?);
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
    let rows: Vec<_> = (fits.iter().zip(&gallery.comparisons).enumerate())
        .map(|(k, ((file, m), c))| json!({ "fit": file, "model": m.model(), "picture": format!("fit-{}.exr", k + 1), "maps": format!("maps-{}.png", k + 1), "image": c, "statement": sentence(c) }))
        .collect();
    let object = json!({
        "measurement": args.measurement, "scene": stage.spec.name, "samples": options.samples, "seed": options.seed,
        "exposure": gallery.exposure, "fits": rows, "out": args.out, "stopped": stopped,
    });
    let numbers = serde_json::to_string_pretty(&object).map_err(|e| Failure::work(e.to_string()))?;
    write_text(&args.out.join("numbers.json"), &(numbers + "\n"))?;
    let mut text = format!("{name}, {} scene, {} samples a pixel\n", stage.spec.name, options.samples);
    let _ = writeln!(
        text,
        "  {:24} {:>9} {:>9} {:>6} {:>7} {:>6} {:>7}",
        "", "rmse", "relMSE", "PSNR", "FLIP", "ΔE2000", "masked"
    );
    for (file, _) in fits.iter().skip(gallery.comparisons.len()) {
        ui.warn(&format!("{file}: not rendered"));
    }
    for ((file, m), c) in fits.iter().zip(&gallery.comparisons) {
        if let Some(note) = &c.note {
            ui.warn(note);
        }
        text.push_str(&row(&format!("{file} ({})", m.model()), c));
    }
    let _ = writeln!(text, "  written to {}", args.out.display());
    ui.result(&text, &object);
    Ok(())
}

/// The numbers of one fit, and what they mean.
fn row(label: &str, c: &Comparison) -> String {
    let psnr = c.psnr.map_or("–".into(), |p| format!("{p:.1}"));
    let looks = |f: fn(&Appearance) -> String| c.appearance.as_ref().map_or("–".into(), f);
    let flip = looks(|a| format!("{:.4}", a.flip.mean));
    let delta_e = looks(|a| format!("{:.2}", a.delta_e_2000.mean));
    format!(
        "  {label:24} {:>9.2e} {:>9.2e} {psnr:>6} {flip:>7} {delta_e:>6} {:>7}\n    {}\n",
        c.rmse,
        c.rel_mse,
        c.masked,
        // On two lines, so that it fits a terminal.
        sentence(c).replace("; ", ";\n    ")
    )
}

/// What stands above a fit's picture: its model, and its file where there are several.
fn label(file: &str, material: &Material, fits: usize) -> String {
    let stem = Path::new(file).file_stem().map_or_else(|| file.into(), |s| s.to_string_lossy());
    if fits == 1 { format!("fit: {}", material.model()) } else { format!("{stem}: {}", material.model()) }
}

/// The `k`-th picture; each has a seed of its own, so that their errors are independent.
fn take(
    k: usize,
    label: String,
    subject: Subject,
    stage: &Stage,
    options: &Options,
    ui: &Ui,
) -> Result<Shown, Failure> {
    let options = Options { seed: options.seed.wrapping_add(k as u64), ..*options };
    let image = chain::picture(stage, Some(subject), &options, ui.control())?;
    let file = if k == 0 { "table".into() } else { format!("fit-{k}") };
    Ok(Shown { file, difference_file: format!("difference-{k}"), label, image })
}
