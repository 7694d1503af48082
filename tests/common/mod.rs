//! What the tests of the tracer share.
#![allow(dead_code)] // each test file uses its part
#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

use std::path::Path;

use glam::DVec3;
use goniofit::control::Control;
use goniofit::render::{Film, Materials, Options, Plan, Scene, SceneSpec, render};

/// A scene from the text of a scene file.
pub fn scene(toml: &str) -> Scene {
    scene_with(toml, &Materials::new())
}

/// A scene from the text of a scene file and given materials.
pub fn scene_with(toml: &str, materials: &Materials) -> Scene {
    let spec = SceneSpec::parse(toml, "test").unwrap_or_else(|e| panic!("{e}\n{toml}"));
    Scene::build(&spec, Path::new("."), materials).unwrap_or_else(|e| panic!("{e}\n{toml}"))
}

/// A square picture.
pub fn picture(scene: &Scene, size: u32, samples: u32, seed: u64) -> Film {
    picture_by(Plan::of(scene), scene, size, samples, seed)
}

/// A square picture by a plan.
pub fn picture_by(plan: Plan, scene: &Scene, size: u32, samples: u32, seed: u64) -> Film {
    let options = Options { width: size, height: size, samples, seed, plan: Some(plan), ..Options::default() };
    render(scene, &options, Control::silent()).expect("options are in range")
}

/// What a scene that packets can walk through calls for, and everything one path at a time.
pub fn both_ways(scene: &Scene) -> [Plan; 2] {
    let derived = Plan::of(scene);
    assert!(derived.packets, "{derived:?}");
    [derived, Plan::FULL]
}

/// Radiance and standard error of a picture of one pixel.
pub fn one_pixel(scene: &Scene, samples: u32) -> (DVec3, DVec3) {
    one_pixel_by(Plan::of(scene), scene, samples)
}

/// The same by a plan.
pub fn one_pixel_by(plan: Plan, scene: &Scene, samples: u32) -> (DVec3, DVec3) {
    let film = picture_by(plan, scene, 1, samples, 3);
    (film.radiance(0, 0).expect("pixel"), film.standard_error(0, 0).expect("pixel"))
}

/// Mean over the picture with its standard error.
pub fn mean(film: &Film) -> (DVec3, DVec3) {
    let pixels = || (0..film.height).flat_map(|y| (0..film.width).map(move |x| (x, y)));
    let n = f64::from(film.width) * f64::from(film.height);
    let sum: DVec3 = pixels().filter_map(|(x, y)| film.radiance(x, y)).sum();
    let variance: DVec3 = pixels().filter_map(|(x, y)| film.standard_error(x, y)).map(|e| e * e).sum();
    (sum / n, variance.map(f64::sqrt) / n)
}

/// The largest |a − b| in units of `bound`, over channels; 0 where a = b.
pub fn excess(a: DVec3, b: DVec3, bound: DVec3) -> f64 {
    (0..3).map(|c| if a[c] == b[c] { 0.0 } else { (a[c] - b[c]).abs() / bound[c] }).fold(0.0, f64::max)
}

/// A vector as TOML.
pub fn toml(v: DVec3) -> String {
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}

/// The head of a scene with a camera that sees practically one point: its field of view is 10⁻⁵ degrees.
pub fn spot_camera(from: DVec3, to: DVec3, bounces: u32) -> String {
    let up = if (to - from).normalize().y.abs() > 0.9 { DVec3::X } else { DVec3::Y };
    let (from, to, up) = (toml(from), toml(to), toml(up));
    format!(
        "version = 1\nname = \"test\"\nmax_bounces = {bounces}\n\
         [camera]\nposition = {from}\ntarget = {to}\nup = {up}\nfov_deg = 1e-5\n"
    )
}

/// A built-in scene whose lengths are multiplied by `scale` and then moved; intensities follow, so that the picture stays.
pub fn transformed(name: &str, scale: f64, moved: DVec3) -> SceneSpec {
    let mut spec = goniofit::render::scene::builtin(name).expect("built in");
    let place = |p: &mut [f64; 3]| *p = (scale * DVec3::from(*p) + moved).to_array();
    let stretch = |v: &mut [f64; 3]| *v = (scale * DVec3::from(*v)).to_array();
    place(&mut spec.camera.position);
    place(&mut spec.camera.target);
    for s in &mut spec.spheres {
        place(&mut s.center);
        s.radius *= scale;
    }
    for q in &mut spec.quads {
        place(&mut q.center);
        stretch(&mut q.u);
        stretch(&mut q.v);
    }
    for q in &mut spec.lights.quad {
        place(&mut q.center);
        stretch(&mut q.u);
        stretch(&mut q.v);
    }
    for p in &mut spec.lights.point {
        place(&mut p.position);
        p.intensity = p.intensity.map(|i| i * scale * scale);
    }
    spec
}
