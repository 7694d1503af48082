//! `goniofit tradeoff render`.

use std::path::{Path, PathBuf};

use super::{Common, parse_step};
use crate::chain::{self, Source, Stage};
use crate::cli::failure::Failure;
use crate::cli::fit::parse_tolerance;
use crate::cli::render::{parse_rgb, parse_size, read_stage};
use crate::cli::text::{command, option};
use crate::cli::ui::Ui;
use crate::measurement::ReadOptions;
use crate::render::{Material, Strategy};
use crate::tradeoff::Knob;
use crate::tradeoff::render::{RenderSweep, TOLD, Tables, Way, sweep};

/// Longer side of the pictures, pixels, where none is asked for.
const SIDE: f64 = 64.0;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit tradeoff render --scene cornell --out tradeoff/
  goniofit tradeoff render my-scene.toml --material gold.json --advise error=1% --advise time=10s
  goniofit tradeoff render --scene cornell --ways scene,full,independent --depths 1,2,4 --targets 10%,5%,2%
  goniofit tradeoff render --material satin --ways scene --samples 256 --resolutions 15,10,5")]
pub(super) struct Args {
    /// A scene file; `-` is stdin
    #[arg(value_name = "SCENE.toml", conflicts_with = "scene")]
    file: Option<PathBuf>,
    /// A built-in scene (see `goniofit scenes`) [default: sphere-on-plane]
    #[arg(long, value_name = "NAME")]
    scene: Option<String>,
    /// Material of the scene's subject: a built-in name, a fitted .json or a measurement
    #[arg(long, value_name = "FILE")]
    material: Option<String>,
    /// Channels to show as red, green and blue
    #[arg(long, value_parser = parse_rgb, value_name = "A,B,C")]
    rgb: Option<[String; 3]>,
    /// Size of the pictures in pixels, WIDTHxHEIGHT or one number for both [default: 64 at most, in the scene's proportions]
    #[arg(long, value_parser = parse_size, value_name = "SIZE")]
    size: Option<(u32, u32)>,
    /// Samples per pixel to try
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", default_value = "4,8,16,32,64,128,256", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    samples: Vec<u32>,
    /// Relative errors to ask for, as by `render --target-error` (10%,2%)
    #[arg(long, value_delimiter = ',', value_name = "E,E,…", value_parser = parse_tolerance)]
    targets: Vec<f64>,
    /// Ways to render: scene (its own plan), full (everything on, one path at a time), independent (means of pictures of 8
    /// samples that know nothing of each other), chance and aimed (lights found by one way alone)
    #[arg(long, value_delimiter = ',', value_name = "WAY,…", default_value = "scene,full,independent", value_parser = parse_way)]
    ways: Vec<Way>,
    /// Scattering events of a path at most, to try beside the scene's
    #[arg(long, value_delimiter = ',', value_name = "N,N,…", value_parser = clap::value_parser!(u32).range(0..=1000))]
    depths: Vec<u32>,
    /// Steps (degrees, 0.1 to 45) of scans `hemisphere:STEP` to try: the ideal instrument reads the material along each, and the table is rendered in
    /// its place at the most samples, against a reference of its own. A setting is of two commands, which the result names; advice takes none of them
    #[arg(long, value_delimiter = ',', value_name = "STEP,STEP,…", requires = "material", value_parser = parse_step)]
    resolutions: Vec<f64>,
    /// Samples per pixel of each of the reference's two pictures [default: 4 times the most]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    reference: Option<u32>,
    /// Key of all seeds
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    common: Common,
}

fn parse_way(text: &str) -> Result<Way, String> {
    match text.trim() {
        "scene" => Ok(Way::Scene),
        "full" => Ok(Way::Full),
        "independent" => Ok(Way::Independent),
        "chance" => Ok(Way::Lights(Strategy::MaterialOnly)),
        "aimed" => Ok(Way::Lights(Strategy::LightsOnly)),
        _ => Err("known are scene, full, independent, chance, aimed".into()),
    }
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let inputs = [args.file.as_deref(), args.material.as_deref().map(Path::new)];
    args.common.prepare(&TOLD, &inputs.into_iter().flatten().collect::<Vec<_>>())?;
    let (stage, named) = match (&args.file, &args.scene) {
        (Some(file), _) => (read_stage(file)?, vec![file.display().to_string()]),
        (None, name) => {
            let name = name.as_deref().unwrap_or("sphere-on-plane");
            (Stage::built_in(name)?, option("scene", Some(name)))
        }
    };
    let (subject, tables) = match &args.material {
        Some(name) => {
            let source = chain::load(name, &ReadOptions::default())?;
            let subject = chain::render_material(name, &source, args.rgb.as_ref())?;
            let tables = args.tables((name.as_str(), &source), &subject, ui)?;
            (Some(subject), tables)
        }
        None => (None, Tables::default()),
    };
    let [width, height] = stage.spec.film.resolution.map(f64::from);
    let small = |side: f64| (side * (SIDE / width.max(height)).min(1.0)).round().max(1.0) as u32;
    let size = args.size.unwrap_or_else(|| (small(width), small(height)));
    let mut ways = args.ways.clone();
    ways.extend(args.depths.iter().map(|events| Way::Depth(*events)));
    let mut samples = args.samples.clone();
    samples.sort_unstable();
    samples.dedup();
    let most = samples.last().copied().unwrap_or(0);
    if let Some(found) = args.reference.filter(|n| *n < most) {
        return Err(Failure::usage(format!(
            "--reference: expected no fewer samples than the {most} that are tried, found {found}"
        )));
    }
    let what = RenderSweep { size, samples, targets: args.targets.clone(), ways, reference: args.reference, tables };
    let effort = args.common.effort(args.seed, ui);
    let mut found = sweep(&stage, subject.as_ref(), &what, &effort, ui.control())?;
    found.commands = vec![base(args, &named, size, args.material.as_deref())];
    for curve in found.curves.iter_mut().filter(|curve| curve.knob == Knob::Resolution) {
        curve.commands = vec![reading(args), base(args, &named, size, Some(TABLE))];
    }
    args.common.finish(&found, None, ui)
}

impl Args {
    /// The tables that are asked for, the coarsest first.
    fn tables(&self, source: (&str, &Source), subject: &Material, ui: &Ui) -> Result<Tables, Failure> {
        let mut steps = self.resolutions.clone();
        steps.sort_by(|a, b| b.total_cmp(a));
        steps.dedup();
        Ok(Tables::read(source, subject, self.rgb.as_ref(), &steps, ui.control())?)
    }
}

/// What the material is read into.
const TABLE: &str = "OUT.csv";

/// The command that reads a table.
fn reading(args: &Args) -> Vec<String> {
    let options =
        [option("material", args.material.as_ref()), option("instrument", Some("ideal")), option("out", Some(TABLE))];
    command(&["goniofit", "simulate"], options)
}

/// The command that settings go with: the scene is `named` so, the subject's material so.
fn base(args: &Args, named: &[String], (width, height): (u32, u32), material: Option<&str>) -> Vec<String> {
    let options = [
        named.to_vec(),
        option("material", material),
        option("rgb", args.rgb.as_ref().map(|names| names.join(","))),
        option("size", Some(format!("{width}x{height}"))),
        option("out", Some("OUT.exr")),
    ];
    command(&["goniofit", "render"], options)
}
