//! What `target_error` and a deadline promise, in 100 trials each, and what the plan of effects is worth: `cargo bench --bench render_accuracy` prints
//! Markdown tables; `-- --trials 10` takes fewer trials, `-- --plans` and `-- --promises` print one part.
#![allow(clippy::expect_used, clippy::panic)] // a bench may fail loudly

use std::path::Path;
use std::time::{Duration, Instant};

use goniofit::control::Control;
use goniofit::render::scene::builtin;
use goniofit::render::{Film, Materials, Options, Plan, Scene, SceneSpec, render};

const SIDE: u32 = 64;

fn built(name: &str) -> Scene {
    Scene::build(&builtin(name).expect("built in"), Path::new("."), &Materials::new()).expect("builds")
}

fn picture(scene: &Scene, options: Options) -> Film {
    render(scene, &Options { width: SIDE, height: SIDE, ..options }, Control::silent()).expect("options are in range")
}

/// Mean radiance of a picture, W/(sr·m²).
fn mean(film: &Film) -> f64 {
    let pixels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
    pixels.filter_map(|(x, y)| film.radiance(x, y)).map(glam::DVec3::element_sum).sum::<f64>()
        / f64::from(3 * SIDE * SIDE)
}

/// The mean of relative differences with its standard error, that of the truth's own mean added: what samples that decide where more are taken
/// are biased by.
fn bias(off_by: &[f64], truth: &Film) -> String {
    let n = off_by.len() as f64;
    let average = off_by.iter().sum::<f64>() / n;
    let spread = off_by.iter().map(|x| (x - average).powi(2)).sum::<f64>() / (n - 1.0) / n;
    let pixels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
    // Channels of a pixel rise and fall together: their errors add.
    let own: f64 = pixels.filter_map(|(x, y)| truth.standard_error(x, y)).map(|e| e.element_sum().powi(2)).sum();
    let own = own.sqrt() / f64::from(3 * SIDE * SIDE) / mean(truth);
    format!("{:+.3} ± {:.3} %", 100.0 * average, 100.0 * spread.sqrt().hypot(own))
}

fn targets(trials: u64) {
    println!(
        "| scene | target | met in trials of {trials} | error, mean | stated, mean | samples a pixel | pictures' mean off by |\n|---|---|---|---|---|---|---|"
    );
    // With the samples of the truth: it is off by less than a seventh of the target.
    for (name, target, good) in [
        ("sphere", 0.005, 1 << 15),
        ("sphere-on-plane", 0.02, 1 << 15),
        ("cornell", 0.05, 1 << 13),
        ("cornell", 0.02, 1 << 15),
        ("preview", 0.03, 1 << 13),
    ] {
        let scene = built(name);
        let truth = picture(&scene, Options { samples: good, seed: 1, ..Options::default() });
        let (mut met, mut error, mut stated, mut samples) = (0, 0.0, 0.0, 0.0);
        let mut off_by = Vec::new();
        for trial in 0..trials {
            let options =
                Options { samples: 1 << 20, seed: 100 + trial, target_error: Some(target), ..Options::default() };
            let film = picture(&scene, options);
            let off = film.off_by(&truth);
            met += u64::from(off <= target);
            error += off;
            off_by.push(mean(&film) / mean(&truth) - 1.0);
            stated += film.error().expect("samples enough").relative;
            samples += film.total_samples() as f64 / f64::from(SIDE * SIDE);
        }
        let n = trials as f64;
        let percent = |x: f64| format!("{:.3} %", 100.0 * x / n);
        println!(
            "| {name} | {} % | {met} | {} | {} | {:.0} | {} |",
            100.0 * target,
            percent(error),
            percent(stated),
            samples / n,
            bias(&off_by, &truth)
        );
    }
}

fn deadlines(trials: u64) {
    println!("\n| scene | time | kept within 10 % or 50 ms in trials of {trials} | longest over |\n|---|---|---|---|");
    for (name, millis) in [("cornell", 50), ("cornell", 300), ("mesh-env", 300), ("sphere-on-plane", 1000)] {
        let scene = built(name);
        let budget = Duration::from_millis(millis);
        let (mut kept, mut worst) = (0, 0.0f64);
        for seed in 0..trials {
            let start = Instant::now();
            picture(&scene, Options { samples: 1 << 24, seed, deadline: Some(start + budget), ..Options::default() });
            let over = start.elapsed().as_secs_f64() - budget.as_secs_f64();
            kept += u64::from(over <= (0.1 * budget.as_secs_f64()).max(0.05));
            worst = worst.max(over);
        }
        println!("| {name} | {millis} ms | {kept} | {:.1} ms |", 1e3 * worst);
    }
}

/// A glossy ball under a quad that nothing can hide.
fn lone(n: f64) -> Scene {
    let text = format!(
        "version = 1\nname = \"lone\"\nmax_bounces = 4\n[camera]\nposition = [0, 1, 4]\ntarget = [0, 0, 0]\nfov_deg = 35\n[materials]\n\
         a = {{ kd = [0.2, 0.2, 0.2], phong = [{{ ks = [0.4, 0.4, 0.4], n = {n} }}] }}\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"a\"\n\
         [[light.quad]]\ncenter = [1.2, 1.8, 1.6]\nu = [1, 0, 0]\nv = [0, -0.4, 0.9]\nradiance = [10, 10, 10]\n"
    );
    let spec = SceneSpec::parse(&text, "lone").expect("a scene");
    Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds")
}

/// 256 samples a pixel by the plan of the scene, without closed forms, one path at a time, and by the full integrator: rays, time, the error that the picture
/// states, and the time after which it would be 1 %.
fn plans() {
    println!("| scene | plan | rays a sample | time | relative error | time to 1 % |\n|---|---|---|---|---|---|");
    let named =
        ["sphere", "furnace", "sphere-on-plane", "cornell", "preview", "mesh-env"].map(|n| (n.to_owned(), built(n)));
    let balls = [2.0, 20.0, 200.0, 1000.0].map(|n| (format!("ball, n = {n}"), lone(n)));
    for (name, scene) in named.into_iter().chain(balls) {
        let derived = Plan::of(&scene);
        let sampled = Plan { closed_forms: false, chance: true, ..derived };
        let one_by_one = Plan { packets: false, closed_forms: false, chance: true, ..derived };
        let mut ways = vec![("of the scene", derived)];
        if derived.closed_forms {
            ways.push(("the same, without closed forms", sampled));
        }
        ways.extend([("the same, one path at a time", one_by_one), ("everything", Plan::FULL)]);
        for (words, plan) in ways {
            let film = picture(&scene, Options { samples: 256, plan: Some(plan), ..Options::default() });
            let error = film.error().expect("samples enough").relative;
            let rays = film.rays as f64 / film.total_samples() as f64;
            // The error falls with the root of the time or faster: samples are even.
            let to_target = film.seconds * (error / 0.01).powi(2);
            let (seconds, percent) = (film.seconds, 100.0 * error);
            println!("| {name} | {words} | {rays:.2} | {seconds:.3} s | {percent:.3} % | {to_target:.3} s |");
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let place = arguments.iter().position(|a| a == "--trials");
    let trials = place.and_then(|i| arguments.get(i + 1)?.parse().ok()).unwrap_or(100);
    let asked = |part: &str| arguments.iter().any(|a| a == part);
    if !asked("--promises") {
        plans();
        println!();
    }
    if !asked("--plans") {
        targets(trials);
        deadlines(trials);
    }
}
