//! What an aperture does to a fitted exponent, and what fitting through the instrument does about it: `cargo bench --bench through` prints a Markdown
//! table; `-- --csv FILE` writes the numbers too, which `benches/through.py` plots. Exits with 1 where an interval of a fit through the instrument
//! holds the truth too rarely or its mean is off by more than chance.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Instant;

use goniofit::brdf::Material;
use goniofit::fit::{FitOptions, fit};
use goniofit::geometry::{Frame, direction, mirror};
use goniofit::gonio::Instrument;
use goniofit::gonio::parts::Detector;
use goniofit::gonio::sight::Cones;
use goniofit::measurement::{Directions, Weights};
use rayon::prelude::*;

#[allow(dead_code)] // the tests use more of it
#[path = "../tests/instrument/support.rs"]
mod support;

use support::{material, read, reduced};

const EXPONENTS: [f64; 5] = [10.0, 1e2, 1e3, 1e4, 1e5];
const APERTURES_DEG: [f64; 4] = [0.1, 0.3, 1.0, 3.0];
/// Instruments of each cell.
const DRAWS: u64 = 100;
/// Photoelectrons a second of 1/sr: a usual light, and one so weak that an aperture may hide the lobe's width.
const ELECTRONS: [f64; 2] = [1e5, 30.0];

/// What one fit found: the exponent, its standard error where it is determined, whether the interval holds the truth.
struct Found {
    exponent: f64,
    error: Option<f64>,
    holds: bool,
}

/// Pairs about the mirror direction, in the plane of incidence and across it, as far apart as the lobe or the aperture asks for, and a coarse
/// rest of the plane.
fn scan(n: f64, aperture_deg: f64) -> (Directions, Weights) {
    let width = f64::max(n.powf(-0.5), 0.5 * aperture_deg.to_radians());
    let (mut wi, mut wo) = (Vec::new(), Vec::new());
    for theta_deg in [15.0f64, 45.0] {
        let i = direction(theta_deg.to_radians(), 0.0);
        let frame = Frame::from_normal(mirror(i));
        let mut push = |o: glam::DVec3| {
            if o.z > 0.2 {
                wi.push(i);
                wo.push(o);
            }
        };
        for k in -16..=16 {
            let (s, c) = (0.25 * width * f64::from(k)).sin_cos();
            push(frame.to_world(glam::DVec3::new(s, 0.0, c)));
            push(frame.to_world(glam::DVec3::new(0.0, s, c)));
        }
        (-7..=7).for_each(|k| {
            push(direction(10f64.to_radians() * f64::from(k).abs(), if k < 0 { 0.0 } else { std::f64::consts::PI }));
        });
    }
    (Directions::List { wi, wo }, Weights::Uniform)
}

/// An instrument, and what is seen through it.
struct Through {
    instrument: Instrument,
    cones: Arc<Cones>,
}

/// The plain fit and the one through the instrument, of one simulated measurement.
fn both(truth: &Material, n: f64, through: &Through, scan: &(Directions, Weights), seed: u64) -> [Found; 2] {
    let Through { instrument, cones } = through;
    let readings = reduced(&read(truth, instrument, scan, seed), instrument, truth).measurement;
    let plain = FitOptions { use_sigma: true, ..FitOptions::new("lambert+phong".parse().expect("a model")) };
    let through = FitOptions { through: Some(cones.clone()), ..plain.clone() };
    [plain, through].map(|options| {
        let found = fit(&readings, &options).expect("fits").material;
        let record = found.fit.as_ref().expect("a record");
        let error = record.standard_error[1].shape[0].1.get(0).flatten();
        let interval = record.interval_95[1].shape[0].1.get(0).flatten();
        Found {
            exponent: found.lobes[1].shape_of(0).map_or(f64::NAN, |s| s[0]),
            error,
            holds: interval.is_none_or(|(low, high)| (low..=high).contains(&n)),
        }
    })
}

/// A cell of the table, in numbers.
struct Cell {
    plain_bias: f64,
    bias: f64,
    /// Standard deviation of the exponents over n, and the median of the stated errors.
    scatter: f64,
    stated: f64,
    determined: f64,
    holds: f64,
}

fn cell(n: f64, aperture_deg: f64, electrons: f64) -> Cell {
    let instrument =
        Instrument { electrons, detector: Detector { aperture_deg, ..Detector::default() }, ..Instrument::default() };
    let through = Through { cones: Arc::new(Cones::of(&instrument).expect("an aperture")), instrument };
    let (truth, scan) = (material(0.2, 0.1, n), scan(n, aperture_deg));
    let found: Vec<[Found; 2]> =
        (0..DRAWS).into_par_iter().map(|seed| both(&truth, n, &through, &scan, seed)).collect();
    let determined: Vec<&[Found; 2]> = found.iter().filter(|f| f[1].error.is_some()).collect();
    let count = determined.len().max(1) as f64;
    // Exponents are compared on the scale on which they are searched.
    let mean = |which: usize| determined.iter().map(|f| (f[which].exponent / n).ln()).sum::<f64>() / count;
    let bias = mean(1);
    let spread = determined.iter().map(|f| ((f[1].exponent / n).ln() - bias).powi(2)).sum::<f64>() / count;
    let mut stated: Vec<f64> = determined.iter().filter_map(|f| f[1].error.map(|e| e / f[1].exponent)).collect();
    stated.sort_by(f64::total_cmp);
    Cell {
        plain_bias: mean(0).exp() - 1.0,
        bias,
        scatter: spread.sqrt(),
        stated: stated.get(stated.len() / 2).copied().unwrap_or(f64::NAN),
        determined: determined.len() as f64 / DRAWS as f64,
        holds: found.iter().filter(|f| f[1].holds).count() as f64 / DRAWS as f64,
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let csv = arguments.iter().position(|a| a == "--csv").and_then(|i| arguments.get(i + 1));
    let clock = Instant::now();
    let mut text =
        String::from("electrons,aperture_deg,exponent,plain_bias,through_bias,scatter,stated,determined,holds\n");
    let mut fine = true;
    for electrons in ELECTRONS {
        println!("\n{electrons:e} electrons a second of 1/sr, kd 0.2, ks 0.1, {DRAWS} measurements a cell:\n");
        println!(
            "| aperture | n | plain fit is off by | through: off by | its scatter | stated | determined | holds |"
        );
        println!("|---|---|---|---|---|---|---|---|");
        for aperture in APERTURES_DEG {
            for n in EXPONENTS {
                let c = cell(n, aperture, electrons);
                let percent = |x: f64| format!("{:.2} %", 100.0 * x);
                println!(
                    "| {aperture}° | {n:e} | {} | {} | {} | {} | {:.0} % | {:.1} % |",
                    percent(c.plain_bias),
                    percent(c.bias),
                    percent(c.scatter),
                    percent(c.stated),
                    100.0 * c.determined,
                    100.0 * c.holds
                );
                let _ = writeln!(
                    text,
                    "{electrons:e},{aperture},{n:e},{},{},{},{},{},{}",
                    c.plain_bias, c.bias, c.scatter, c.stated, c.determined, c.holds
                );
                // Four standard deviations of a mean, and of a share, over the draws; a tenth of σ for what a skewed estimate is off by.
                let count = DRAWS as f64 * c.determined;
                let judged = c.determined > 0.99 && c.stated < 0.1;
                fine &= !judged || c.bias.abs() < (4.0 / count.sqrt() + 0.1) * c.scatter;
                fine &= c.holds > 0.95 - 4.0 * (0.95f64 * 0.05 / DRAWS as f64).sqrt();
            }
        }
    }
    println!("\n{:.0} s on {} threads.", clock.elapsed().as_secs_f64(), rayon::current_num_threads());
    if let Some(path) = csv {
        std::fs::write(path, text).expect("the CSV is written");
    }
    if !fine {
        eprintln!("a fit through the instrument is off");
        std::process::exit(1);
    }
}
