//! `goniofit render`: one picture.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::json;

use super::failure::Failure;
use super::fit::{parse_time, parse_tolerance};
use super::output::{check_folder, distinct_outputs, keeps_inputs, read_text, stdout_is_free, write_bytes};
use super::ui::{self, Ui, significant};
use crate::chain::{self, Stage};
use crate::control::counted;
use crate::image::{Image, LayerKind, develop, encode_exr, encode_png, exposure_for};
use crate::render::{LayerSet, Options, SceneSpec};

/// About what a value of a picture takes to be written, s: this much of a time budget is kept for that.
const WRITING: f64 = 6e-8;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit render --scene sphere-on-plane --material gold.json --out gold.exr --png gold.png
  goniofit render --scene cornell --target-error 2% --out cornell.exr
  goniofit render --scene cornell --time-budget 5s --out cornell.exr --png cornell.png
  goniofit render my-scene.toml --samples 256 --out picture.exr --layers albedo,normal,depth")]
pub(super) struct Args {
    /// A scene file; `-` is stdin
    #[arg(value_name = "SCENE.toml", conflicts_with = "scene")]
    file: Option<PathBuf>,
    #[command(flatten)]
    picture: PictureArgs,
    /// Material of the scene's subject: a built-in name, a fitted .json or a measurement
    #[arg(long, value_name = "FILE")]
    material: Option<String>,
    /// Where to write the linear picture
    #[arg(long, value_name = "IMG.exr")]
    out: PathBuf,
    /// Also write a preview: exposed, clipped, sRGB
    #[arg(long, value_name = "IMG.png")]
    png: Option<PathBuf>,
    /// Exposure of the preview, stops (default: the brightest 1 % clips, lamps left aside)
    #[arg(long, allow_negative_numbers = true, requires = "png", value_parser = parse_exposure)]
    exposure: Option<f64>,
    /// Relative error that the picture may have, 1% say: renders until it is met with 95 % confidence, most where it is noisy
    #[arg(long, value_name = "E", value_parser = parse_tolerance)]
    target_error: Option<f64>,
    /// Time from the program's start to the picture (500ms, 5s, 2m): the best within that
    #[arg(long, value_name = "T", value_parser = parse_time)]
    time_budget: Option<Duration>,
    /// Further layers of the linear picture: albedo, normal, depth, samples, direct, indirect
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', value_parser = parse_layer)]
    layers: Vec<LayerKind>,
}

/// What pictures are made of.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct PictureArgs {
    /// A built-in scene (see `goniofit scenes`) [default: sphere-on-plane]
    #[arg(long, value_name = "NAME")]
    pub scene: Option<String>,
    /// Size in pixels, WIDTHxHEIGHT or one number for both [default: as the scene says]
    #[arg(long, value_parser = parse_size, value_name = "SIZE")]
    pub size: Option<(u32, u32)>,
    /// Samples per pixel [default: as the scene says]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub samples: Option<u32>,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
    /// Channels to show as red, green and blue
    #[arg(long, value_parser = parse_rgb, value_name = "A,B,C")]
    pub rgb: Option<[String; 3]>,
}

/// Stops: a number from −100 to 100.
pub(super) fn parse_exposure(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|v| (-100.0..=100.0).contains(v));
    value.ok_or_else(|| "expected a number of stops from -100 to 100".into())
}

fn parse_layer(text: &str) -> Result<LayerKind, String> {
    let known = LayerSet::NAMED.into_iter().find(|(name, _)| *name == text.trim());
    known
        .map(|(_, kind)| kind)
        .ok_or_else(|| format!("expected layers out of {}", LayerSet::NAMED.map(|(name, _)| name).join(", ")))
}

pub(super) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |t: &str| t.parse::<u32>().ok().filter(|v| (1..=16384).contains(v));
    let pair = text.split_once('x').map_or_else(|| side(text).map(|s| (s, s)), |(w, h)| side(w).zip(side(h)));
    pair.ok_or_else(|| "expected WIDTHxHEIGHT or one number, 1 to 16384".into())
}

pub(super) fn parse_rgb(text: &str) -> Result<[String; 3], String> {
    let names: Vec<String> = text.split(',').map(|s| s.trim().to_owned()).collect();
    names.try_into().map_err(|_| "expected three channel names with commas between".into())
}

impl PictureArgs {
    /// The built-in scene asked for.
    pub fn stage(&self) -> Result<Stage, Failure> {
        Ok(Stage::built_in(self.scene.as_deref().unwrap_or("sphere-on-plane"))?)
    }

    /// Render options: what was typed, else what the scene says.
    pub fn options(&self, stage: &Stage) -> Options {
        let mut options = Options { seed: self.seed, ..Options::of(&stage.spec) };
        if let Some((width, height)) = self.size {
            (options.width, options.height) = (width, height);
        }
        options.samples = self.samples.unwrap_or(options.samples);
        options
    }
}

impl Args {
    /// Whether pixels get as many samples as they need.
    fn adapts(&self) -> bool {
        self.target_error.is_some() || self.time_budget.is_some()
    }

    fn options(&self, stage: &Stage, ui: &Ui) -> Options {
        let asked = self.picture.options(stage);
        // Without a number, the target or the time says when it is enough.
        let samples = if self.adapts() { self.picture.samples.unwrap_or(1 << 24) } else { asked.samples };
        let planes = 7 + self.layers.len() * 3;
        let writing =
            Duration::from_secs_f64(WRITING * f64::from(asked.width) * f64::from(asked.height) * planes as f64);
        let deadline = self.time_budget.map(|time| ui.start() + time.saturating_sub(writing));
        Options { samples, target_error: self.target_error, deadline, layers: LayerSet::of(&self.layers), ..asked }
    }
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let outputs = [("--out", Some(&args.out)), ("--png", args.png.as_ref())];
    for (option, out) in outputs {
        let inputs = [args.file.as_deref(), args.material.as_deref().map(Path::new)];
        out.map_or(Ok(()), |out| keeps_inputs(option, out, inputs.into_iter().flatten()))?;
    }
    let stage = match &args.file {
        Some(path) => read_stage(path)?,
        None => args.picture.stage()?,
    };
    let files: Vec<PathBuf> = stage.spec.files().map(|file| stage.base.join(file)).collect();
    for (option, out) in outputs {
        out.map_or(Ok(()), |out| keeps_inputs(option, out, files.iter().map(PathBuf::as_path)))?;
    }
    check_outputs(args, ui)?;
    let options = args.options(&stage, ui);
    let image = match &args.material {
        Some(name) => chain::picture_of(name, args.picture.rgb.as_ref(), &stage, &options, ui.control())?,
        None => chain::picture(&stage, None, &options, ui.control())?,
    };
    if let (Some(time), Some(0.0)) = (args.time_budget, image.metadata.mean_samples) {
        let time = time.as_secs_f64();
        return Err(Failure::work(format!(
            "{time} s is too short for {}: no sample was taken by then, so nothing is written; give more time",
            stage.spec.name
        )));
    }
    write_bytes(&args.out, &encode_exr(&image)?)?;
    if let Some(png) = &args.png {
        let exposure = args.exposure.unwrap_or_else(|| exposure_for(&image));
        write_bytes(png, &encode_png(&develop(&image, exposure))?)?;
    }
    warn(args, &image, ui);
    let taken = [Some(&args.out), args.png.as_ref()].into_iter().flatten().any(|p| p.as_os_str() == "-");
    if !taken {
        tell(args, &stage, &image, options.seed, ui);
    }
    Ok(())
}

/// Whether the pictures can be written, before anything is computed.
fn check_outputs(args: &Args, ui: &Ui) -> Result<(), Failure> {
    check_extension(&args.out, "exr", "--out")?;
    check_folder(&args.out)?;
    stdout_is_free(&args.out, ui)?;
    if let Some(png) = &args.png {
        check_extension(png, "png", "--png")?;
        check_folder(png)?;
        stdout_is_free(png, ui)?;
        distinct_outputs(("--out", &args.out), ("--png", png))?;
    }
    Ok(())
}

/// Whether the picture is as good as was asked for.
fn target_met(args: &Args, image: &Image) -> bool {
    image.metadata.relative_error.is_some_and(|[_, most]| args.target_error.is_none_or(|t| most <= t))
}

/// What whoever looks at the picture should know.
fn warn(args: &Args, image: &Image, ui: &Ui) {
    let not_finite = image.radiance.iter().flatten().filter(|r| !r.is_finite()).count();
    if not_finite > 0 {
        let values = counted(not_finite as u64, "value");
        ui.warn(&format!("{values} of the picture: not finite, by a mistake of the program; please report the scene"));
    }
    if ui::stop().requested() {
        ui.warn("stopped: the picture has fewer samples than asked for");
    }
    if let (Some(target), false) = (args.target_error, target_met(args, image)) {
        ui.warn(&format!("the relative error asked for, {} %, was not reached", significant(100.0 * target)));
    }
    if image.metadata.samples == Some(1) {
        ui.warn("pixels with one sample have no standard error: nobody can tell what is noise; take two or more");
    }
    let empty = share_of(image, |i| image.standard_error.as_ref().is_some_and(|e| e[i][0].is_infinite()));
    if empty > 0.0 && ended_early(image) {
        ui.warn(&format!(
            "{:.1} % of the pixels have too few samples to be judged, or none: give more time, or a smaller --size",
            100.0 * empty
        ));
    }
    let unknown = unknown_share(image);
    if unknown > 0.0 {
        ui.warn(&format!(
            "{:.1} % of the pixels met directions that were not measured: they are marked in the layer `mask`",
            100.0 * unknown
        ));
    }
}

/// What was rendered, how well and how long it took.
fn tell(args: &Args, stage: &Stage, image: &Image, seed: u64, ui: &Ui) {
    let (samples, seconds) = (image.metadata.samples.unwrap_or(0), image.metadata.seconds.unwrap_or(0.0));
    let Image { width, height, .. } = image;
    let error = image.metadata.relative_error;
    let noise = error.map_or(", relative error unknown below 2 samples".into(), |[relative, most]| {
        let percent = |x: f64| significant(100.0 * x);
        format!(", relative error {} % (95 % sure: below {} %)", percent(relative), percent(most))
    });
    let mean = image.metadata.mean_samples.unwrap_or(0.0);
    let samples_text = if args.adapts() { format!("{mean:.1} (at least {samples})") } else { samples.to_string() };
    let (out, name) = (args.out.display(), &stage.spec.name);
    let text = format!("{out}: {name} {width}×{height}, {samples_text} samples a pixel, {seconds:.2} s{noise}");
    let object = json!({
        "out": args.out, "png": args.png, "scene": stage.spec.name, "width": width, "height": height,
        "samples": samples, "seconds": seconds, "seed": seed, "unmeasured_share": unknown_share(image),
        "mean_samples": image.metadata.mean_samples, "mean": mean_of(image),
        "relative_error": error.map(|e| e[0]), "relative_error_95": error.map(|e| e[1]), "target_error": args.target_error,
        "target_met": args.target_error.map(|_| target_met(args, image)), "time_budget": args.time_budget.map(|t| t.as_secs_f64()),
        "layers": image.layers.iter().map(|l| l.kind).collect::<Vec<_>>(),
    });
    ui.result(&text, &object);
}

/// The scene in a file, `-` being stdin.
pub(super) fn read_stage(path: &Path) -> Result<Stage, Failure> {
    stage_of(&read_text(path)?, path)
}

/// The scene in the text of a file.
pub(super) fn stage_of(text: &str, path: &Path) -> Result<Stage, Failure> {
    let base = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let spec = SceneSpec::parse(text, &path.display().to_string()).map_err(|e| match path.extension() {
        Some(extension) if extension != "toml" => {
            Failure::usage(format!("{e}\n(SCENE.toml describes a scene; a measurement or fit goes with --material)"))
        }
        _ => e.into(),
    })?;
    Ok(Stage { spec, base })
}

/// What a picture is written as follows from the option, so another extension is a mistake.
fn check_extension(path: &Path, wanted: &str, option: &str) -> Result<(), Failure> {
    let right = path.extension().is_some_and(|e| e.eq_ignore_ascii_case(wanted));
    let device = std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir());
    if right || device || path == Path::new("-") {
        return Ok(());
    }
    Err(Failure::usage(format!("{option}: expected a name that ends in .{wanted}, found {}", path.display())))
}

/// Share of the pixels that are masked for what was not measured, not for want of samples.
fn unknown_share(image: &Image) -> f64 {
    let without = |i: usize| image.standard_error.as_ref().is_some_and(|e| e[i][0].is_infinite());
    share_of(image, |i| image.is_masked(i) && !(ended_early(image) && without(i)))
}

/// Whether there are pixels without samples.
fn ended_early(image: &Image) -> bool {
    image.metadata.samples == Some(0)
}

fn share_of(image: &Image, is: impl Fn(usize) -> bool) -> f64 {
    let pixels = image.radiance.len();
    (0..pixels).filter(|i| is(*i)).count() as f64 / pixels.max(1) as f64
}

fn mean_of(image: &Image) -> [f64; 3] {
    let n = image.radiance.len().max(1) as f64;
    std::array::from_fn(|c| image.radiance.iter().map(|p| p[c]).sum::<f64>() / n)
}
