//! `goniofit demo`: the whole chain, no input needed.

use std::fmt::Write;
use std::path::PathBuf;

use super::costs;
use super::failure::Failure;
use super::fit::plus_minus;
use super::instrument::read_instrument;
use super::output::make_folder;
use super::report;
use super::ui::{self, Ui};
use crate::brdf::PerChannel;
use crate::chain::{Demo, DemoFit, DemoOptions, demo};
use crate::image::Comparison;
use crate::report::run::RunOptions;

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  goniofit demo --out my-demo --report\n  goniofit demo --instrument commercial --out lab-demo"
)]
pub(super) struct Args {
    /// Folder to write to
    #[arg(long, default_value = "out/demo", value_name = "DIR")]
    out: PathBuf,
    /// What measures: a built-in instrument (see `goniofit instruments`) or a simulation file whose [instrument] counts; without it a noisy
    /// detector alone
    #[arg(long, value_name = "I")]
    instrument: Option<String>,
    /// Seed of noise and pictures
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Width and height of the pictures
    #[arg(long, default_value_t = DemoOptions::default().size, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Samples per pixel
    #[arg(long, default_value_t = DemoOptions::default().samples, value_parser = clap::value_parser!(u32).range(2..=1 << 20))]
    samples: u32,
    /// Also write report.html, the run on one page
    #[arg(long)]
    report: bool,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    make_folder("--out", &args.out)?;
    let instrument = match &args.instrument {
        Some(name) => Some((name.clone(), read_instrument(name)?)),
        None => None,
    };
    let options =
        DemoOptions { size: args.size, samples: args.samples, seed: args.seed, instrument, run: Some(report::made()) };
    let demo = demo(&args.out, &options, ui.control())?;
    if ui::stop().requested() {
        ui.warn("stopped: pictures are missing or have fewer samples than asked for");
    }
    let mut object = demo.numbers();
    object["out"] = serde_json::json!(args.out);
    let mut look = "sheet.png".to_owned();
    if args.report {
        costs::of_demo(&args.out, &demo, args.seed, ui);
        let page = report::of_folder(&args.out, &RunOptions::default())?;
        object["report"] = serde_json::json!(page);
        look += " and report.html";
    }
    ui.result(&(describe(&demo) + &format!("\nWritten to {}: look at {look}\n", args.out.display())), &object);
    Ok(())
}

fn describe(demo: &Demo) -> String {
    let mut t = format!(
        "{}: {} direction pairs measured with {}, then fitted (± is one standard error)\n\n",
        demo.name, demo.pairs, demo.instrument
    );
    let _ = write!(t, "  {:18} {:>10}", "parameter", "truth");
    for fit in &demo.fits {
        let _ = write!(t, "  {:>22}", fit.label);
    }
    t.push('\n');
    for (l, lobe) in demo.truth.lobes.iter().enumerate() {
        for (c, weight) in lobe.weight.iter().enumerate() {
            let name = format!("{}.weight[{}]", lobe.kind.name(), demo.truth.channels[c]);
            row(&mut t, &name, *weight, &demo.fits, |fit| weight_of(fit, l, c));
        }
        for (i, parameter) in lobe.kind.lobe().parameters().iter().enumerate() {
            let truth = lobe.shape_of(0).and_then(|s| s.get(i).copied()).unwrap_or(f64::NAN);
            row(&mut t, &format!("{}.{}", lobe.kind.name(), parameter.name), truth, &demo.fits, |fit| {
                shape_of(fit, l, i)
            });
        }
    }
    t.push('\n');
    let number = |t: &mut String, label: &str, f: &dyn Fn(&DemoFit) -> String| {
        let _ = write!(t, "  {label:29}");
        for fit in &demo.fits {
            let _ = write!(t, "  {:>22}", f(fit));
        }
        t.push('\n');
    };
    let rmse = |f: &DemoFit| f.material.fit.as_ref().map_or(f64::NAN, |r| r.rmse);
    number(&mut t, "rmse of the fit [1/sr]", &|f| format!("{:.3e}", rmse(f)));
    let of_image = |f: &DemoFit, get: fn(&Comparison) -> f64| match &f.image {
        Some(image) => format!("{:.3e}", get(image)),
        None => "not rendered".into(),
    };
    number(&mut t, "rmse of the picture", &|f| of_image(f, |c| c.rmse));
    number(&mut t, "relMSE of the picture", &|f| of_image(f, |c| c.rel_mse));
    let verdict = |f: &DemoFit| match f.image.as_ref().and_then(|c| c.significance.as_ref()) {
        Some(s) if s.pixels_differing == 0 => "none".to_owned(),
        Some(s) => format!("{:.1} %", 100.0 * s.pixels_differing as f64 / s.pixels as f64),
        None => "–".to_owned(),
    };
    number(&mut t, "pixels beyond their noise", &verdict);
    t.push_str("\n  times [s]  ");
    let times: Vec<String> = demo.times.iter().map(|(label, s)| format!("{label} {s:.2}")).collect();
    t.push_str(&times.join(", "));
    t.push('\n');
    t
}

fn row(t: &mut String, name: &str, truth: f64, fits: &[DemoFit], of: impl Fn(&DemoFit) -> Option<(f64, Option<f64>)>) {
    let _ = write!(t, "  {name:18} {truth:>10}");
    for fit in fits {
        let text = of(fit).map_or("–".into(), |(value, error)| plus_minus(value, error));
        let _ = write!(t, "  {text:>22}");
    }
    t.push('\n');
}

fn weight_of(fit: &DemoFit, lobe: usize, channel: usize) -> Option<(f64, Option<f64>)> {
    let record = fit.material.fit.as_ref()?;
    let value = *fit.material.lobes.get(lobe)?.weight.get(channel)?;
    Some((value, record.standard_error.get(lobe)?.weight.get(channel).copied().flatten()))
}

fn shape_of(fit: &DemoFit, lobe: usize, parameter: usize) -> Option<(f64, Option<f64>)> {
    let record = fit.material.fit.as_ref()?;
    let value = fit.material.lobes.get(lobe)?.shape.as_ref()?.get(parameter)?.get(0)?;
    let error = match &record.standard_error.get(lobe)?.shape.get(parameter)?.1 {
        PerChannel::Shared(error) => *error,
        PerChannel::Each(_) => None,
    };
    Some((value, error))
}
