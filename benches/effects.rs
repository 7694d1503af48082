//! What each effect of the instrument costs: `cargo bench --bench effects` prints readings per second, ideal, with each effect alone, and with all; the
//! spectral band, which one channel has not, of a material with 31 of them, beside what they take without it. What `benches/zero-cost.sh` counts instructions of: `-- --once by-hand` reads f·cosθo without any pass, `ideal` an instrument without parts, `without NAME`
//! one with every part but that of an effect, `left-out NAME` one with all parts and the effect left out by name. Both make the same readings, those
//! of blank and dark among them, and neither has parts that ask for the effect's own.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

use std::hint::black_box;
use std::time::Instant;

use glam::DVec3;
use goniofit::brdf::{LobeKind, Material};
use goniofit::control::Control;
use goniofit::gonio::{Actual, Instrument, Job, Scan, lit_rows, series};
use rayon::prelude::*;

/// An effect, and what brings it.
type Part = (&'static str, fn(&mut Instrument));

const PARTS: [Part; 19] = [
    ("axis zeros", |i| i.axes.zero_u_deg = 0.05),
    ("axis jitter", |i| i.axes.jitter_deg = 0.02),
    ("sample tilt", |i| i.sample.tilt_u_deg = 0.05),
    ("sample height", |i| (i.sample.height_u_m, i.detector.distance_m) = (1e-4, 0.5)),
    ("spot extent", |i| (i.source.beam_diameter_m, i.detector.distance_m) = (0.01, 0.5)),
    ("source divergence", |i| i.source.divergence_deg = 0.2),
    ("detector aperture", |i| i.detector.aperture_deg = 1.0),
    (BAND, |i| i.source.bandwidth_nm = 5.0),
    ("footprint", |i| (i.source.beam_diameter_m, i.sample.diameter_m) = (0.01, 0.02)),
    ("shadow", |i| i.surroundings.shadow_deg = 3.0),
    ("stray light", |i| i.surroundings.stray_per_sr = 2e-3),
    ("source drift", |i| i.source.drift_per_sqrt_hour = 5e-3),
    ("dark current", |i| i.detector.dark_per_s = 200.0),
    ("exposure times", |i| i.detector.exposure_u = 1e-3),
    ("electronic offset", |i| i.detector.offset = 50.0),
    ("saturation", |i| i.detector.full_well = 1e9),
    ("nonlinearity", |i| (i.detector.full_well, i.detector.nonlinearity_u) = (1e9, 0.003)),
    ("read noise", |i| i.read_noise = 8.0),
    ("quantisation", |i| (i.detector.full_well, i.detector.bits) = (1e9, 24)),
];

/// The effect that only channels of wavelengths have.
const BAND: &str = "spectral band";

/// Counts electrons, so that every part can be added; its shot noise is left out by name.
fn bare() -> Instrument {
    Instrument { electrons: 1e6, read_noise: 0.0, ..Instrument::default() }
}

fn with(parts: impl Iterator<Item = &'static Part>) -> Instrument {
    let mut instrument = bare();
    parts.for_each(|(_, add)| add(&mut instrument));
    instrument
}

fn material() -> Material {
    let lobes = vec![(LobeKind::Lambert, vec![0.2], vec![]), (LobeKind::Phong, vec![0.1], vec![60.0])];
    Material::new(vec!["y".into()], lobes)
}

/// The same lobes in channels from 400 nm to 700 nm, a diffuse part that rises and falls.
fn spectrum() -> Material {
    let wavelengths: Vec<f64> = (0..31).map(|k| 400.0 + 10.0 * f64::from(k)).collect();
    let diffuse = wavelengths.iter().map(|w| 0.2 + 0.1 * (w / 50.0).sin()).collect();
    let lobes = vec![(LobeKind::Lambert, diffuse, vec![]), (LobeKind::Phong, vec![0.1; wavelengths.len()], vec![60.0])];
    Material::new(wavelengths.iter().map(|w| format!("{w}nm")).collect(), lobes)
}

/// Steps of scans, degrees; of the instructions that all parts together take a part is enough.
const STEP_DEG: f64 = 5.0;
const COARSE_DEG: f64 = 20.0;

/// Readings made, and the seconds that they took: those that an instrument makes itself, or those that `like` would make.
fn read(of: &Material, instrument: &Instrument, like: &Instrument, step_deg: f64, left_out: &[&str]) -> (usize, f64) {
    let truth = |wi, wo, out: &mut [f64]| {
        of.write_value(wi, wo, out);
        true
    };
    let (directions, weights) = Scan::Hemisphere { step_deg }.directions().expect("small");
    let job = Job { seed: 1, left_out, ..Job::new(&truth, &of.channels, instrument, (&directions, &weights)) };
    let clock = Instant::now();
    let readings = series(like, &directions, &lit_rows(&directions, job.rows));
    let actual = Actual::draw(instrument, &readings, job.seed);
    let raw = black_box(job.read(readings, &actual, Control::silent()));
    (raw.readings.len(), clock.elapsed().as_secs_f64())
}

/// The ideal reading, written out: what a program without any effect does.
fn by_hand() -> f64 {
    let of = material();
    let (directions, _) = Scan::Hemisphere { step_deg: STEP_DEG }.directions().expect("small");
    let above: Vec<(DVec3, DVec3)> =
        (0..directions.len()).map(|i| directions.pair(i)).filter(|(wi, wo)| wi.z > 0.0 && wo.z > 0.0).collect();
    let blocks: Vec<Vec<f64>> = above
        .par_chunks(goniofit::numeric::sum::BLOCK)
        .map(|block| {
            let mut f = [0.0];
            let one = |(wi, wo): &(DVec3, DVec3)| {
                of.write_value(*wi, *wo, &mut f);
                1e6 * wo.z * f[0]
            };
            block.iter().map(one).collect()
        })
        .collect();
    black_box(blocks).iter().flatten().sum()
}

/// Parts that ask for what an effect alone would have: where it goes, they do too.
fn built_on(name: &str) -> &'static [&'static str] {
    match name {
        "saturation" => &["nonlinearity", "quantisation"],
        // Whose distance shows the spot from its side.
        "spot extent" => &["sample height"],
        _ => &[],
    }
}

fn once(args: &[String]) {
    let named = || PARTS.iter().find(|(name, _)| Some(*name) == args.get(1).map(String::as_str)).expect("an effect").0;
    let all = || {
        let name = named();
        with(PARTS.iter().filter(move |p| !built_on(name).contains(&p.0)))
    };
    let of = |name: &str| if name == BAND { spectrum() } else { material() };
    let readings = match args.first().map(String::as_str) {
        Some("by-hand") => return println!("{}", by_hand()),
        Some("ideal") => read(&material(), &bare(), &bare(), STEP_DEG, &["shot noise"]),
        Some("without") => {
            let name = named();
            let without = with(PARTS.iter().filter(|p| p.0 != name && !built_on(name).contains(&p.0)));
            read(&of(name), &without, &all(), COARSE_DEG, &["shot noise"])
        }
        Some("left-out") => read(&of(named()), &all(), &all(), COARSE_DEG, &["shot noise", named()]),
        other => panic!("expected by-hand, ideal, without NAME or left-out NAME, found {other:?}"),
    };
    println!("{:?}", readings.0);
}

fn row(name: &str, of: &Material, instrument: &Instrument, left_out: &[&str]) {
    let rate = |(count, seconds): (usize, f64)| count as f64 / seconds;
    let best = (0..5).map(|_| rate(read(of, instrument, instrument, STEP_DEG, left_out))).fold(0.0, f64::max);
    println!("| {name} | {best:.2e} |");
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    if let Some(at) = args.iter().position(|a| a == "--once") {
        return once(&args[at + 1..]);
    }
    println!("| effects | readings a second, {} threads |\n|---|---|", rayon::current_num_threads());
    let (one, spectrum) = (material(), spectrum());
    let alone = |part: &'static Part| with(std::iter::once(part));
    row("none", &one, &bare(), &["shot noise"]);
    row("shot noise", &one, &bare(), &[]);
    let (band, others): (Vec<&Part>, Vec<&Part>) = PARTS.iter().partition(|part| part.0 == BAND);
    others.into_iter().for_each(|part| row(part.0, &one, &alone(part), &["shot noise"]));
    row("all", &one, &with(PARTS.iter()), &[]);
    let channels = spectrum.channels.len();
    row(&format!("none, {channels} channels"), &spectrum, &bare(), &["shot noise"]);
    band.into_iter().for_each(|part| {
        row(&format!("{BAND}, {channels} channels"), &spectrum, &alone(part), &["shot noise"]);
    });
    row(&format!("all, {channels} channels"), &spectrum, &with(PARTS.iter()), &[]);
}
