//! Environments from pictures: against constant light, an independent integral, and what a bad file says.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use std::f64::consts::PI;
use std::path::Path;

use common::{excess, mean, one_pixel, picture, spot_camera};
use glam::DVec3;
use goniofit::image::{Image, encode_exr};
use goniofit::render::{Materials, RenderError, Scene, SceneSpec};

const GROUND: &str = "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n";

fn write(folder: &Path, width: usize, height: usize, value: impl Fn(usize, usize) -> [f64; 3]) {
    let radiance = (0..width * height).map(|i| value(i % width, i / width)).collect();
    let bytes = encode_exr(&Image { width, height, radiance, ..Image::default() }).expect("encodes");
    std::fs::write(folder.join("sky.exr"), bytes).expect("written");
}

fn build(folder: &Path, text: &str) -> Result<Scene, RenderError> {
    Scene::build(&SceneSpec::parse(text, "test.toml")?, folder, &Materials::new())
}

/// A spot of a diffuse or glossy floor under the sky in `folder`.
fn floor(folder: &Path, from: DVec3, material: &str, sky: &str) -> Scene {
    let head = spot_camera(from, DVec3::ZERO, 1);
    let text = format!("{head}[materials]\nm = {{ {material} }}\n{GROUND}[light.environment]\n{sky}\n");
    build(folder, &text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

#[test]
fn a_uniform_picture_is_the_constant_environment() {
    let folder = tempfile::tempdir().expect("folder");
    for (width, height) in [(1, 2), (7, 3), (64, 33)] {
        write(folder.path(), width, height, |_, _| [0.5, 1.0, 0.25]);
        let mut spec = goniofit::render::scene::builtin("furnace").expect("built in");
        spec.materials.get_mut("ball").expect("a ball").phong =
            vec![goniofit::render::scene::PhongLobeSpec { ks: [0.3; 3], n: 40.0 }];
        let of = |environment: &str| {
            let mut spec = spec.clone();
            spec.lights.environment = Some(toml::from_str(environment).expect("environment"));
            mean(&picture(&Scene::build(&spec, folder.path(), &Materials::new()).expect("builds"), 48, 64, 3))
        };
        let (want, noise) = of("radiance = [1, 2, 0.5]");
        let (got, other) = of("file = \"sky.exr\"\nscale = 2\nrotate_deg = 33");
        let sigma = (noise * noise + other * other).map(f64::sqrt);
        assert!(excess(got, want, 5.0 * sigma) <= 1.0, "{width} x {height}: {got} vs {want} ± {sigma}");
        assert!(sigma.max_element() < 0.01, "{width} x {height}: noise {sigma}");
    }
}

#[test]
fn a_white_furnace_made_of_a_picture_shows_the_directional_albedo() {
    let folder = tempfile::tempdir().expect("folder");
    write(folder.path(), 32, 17, |_, _| [1.0; 3]);
    // Albedos by quadrature outside of this program.
    for (n, cos, want) in
        [(1.0, 0.9, 0.90954), (1.0, 0.1, 0.36990), (10.0, 0.5, 0.50474), (100.0, 0.25, 0.25017), (1000.0, 0.75, 0.75)]
    {
        let camera = DVec3::new(f64::sqrt(1.0 - cos * cos), cos, 0.0);
        let material = format!("phong = [{{ ks = [1, 1, 1], n = {n} }}]");
        let (got, noise) = one_pixel(&floor(folder.path(), camera, &material, "file = \"sky.exr\""), 20_000);
        let z = excess(got, DVec3::splat(want), 5.0 * noise + 6e-6);
        assert!(z <= 1.0, "n {n} cos {cos}: {got} ± {noise} vs {want}");
    }
}

/// Irradiance on a floor from the picture, by the midpoint rule and a look-up of its own, as the scene file's documentation states it.
fn irradiance(width: usize, height: usize, turn_deg: f64, value: impl Fn(usize, usize) -> [f64; 3]) -> DVec3 {
    let fine = 24;
    let (rows, columns) = (fine * (height - 1) * 2, fine * width);
    let mut sum = DVec3::ZERO;
    for j in 0..rows / 2 {
        let theta = PI / 2.0 * (j as f64 + 0.5) / (rows / 2) as f64;
        for i in 0..columns {
            let phi = 2.0 * PI * (i as f64 + 0.5) / columns as f64;
            // Light seen at azimuth φ comes from the picture's φ + turn.
            let column = ((phi + turn_deg.to_radians()) / (2.0 * PI) * width as f64 - 0.5).rem_euclid(width as f64);
            let row = theta / PI * (height - 1) as f64;
            let (x, y) = (column.fract(), row.fract());
            let at = |di: usize, dj: usize| {
                DVec3::from(value((column as usize + di) % width, (row as usize + dj).min(height - 1)))
            };
            let radiance = at(0, 0).lerp(at(1, 0), x).lerp(at(0, 1).lerp(at(1, 1), x), y);
            sum += radiance * theta.sin() * theta.cos();
        }
    }
    sum * (PI / 2.0 / (rows / 2) as f64) * (2.0 * PI / columns as f64)
}

#[test]
fn a_small_sun_lights_a_floor_by_its_irradiance_and_without_fireflies() {
    let folder = tempfile::tempdir().expect("folder");
    for (sun_row, turn) in [(3, 0.0), (12, 77.0), (0, 0.0)] {
        let sky = move |i: usize, j: usize| {
            let sun = j.abs_diff(sun_row) < 2 && i / 2 == 5;
            let s = if sun { 1e5 } else { 0.0 };
            [0.3 + s, 0.2 + 0.9 * s, 0.01 * j as f64 + 0.8 * s]
        };
        write(folder.path(), 64, 33, sky);
        let text = format!("file = \"sky.exr\"\nrotate_deg = {turn}");
        let built = floor(folder.path(), DVec3::new(0.3, 1.0, 0.2), "kd = [0.8, 0.5, 0.2]", &text);
        let (got, noise) = one_pixel(&built, 20_000);
        let want = DVec3::new(0.8, 0.5, 0.2) / PI * irradiance(64, 33, turn, sky);
        let z = excess(got, want, 5.0 * noise + 2e-3 * want);
        assert!(z <= 1.0, "sun in row {sun_row}, turned by {turn}: {got} ± {noise} vs {want}");
        // A direction found by chance weighs next to nothing beside one drawn from the sky: no sample stands out.
        let relative = noise / got * f64::sqrt(20_000.0);
        assert!(relative.max_element() < 1.5, "sun in row {sun_row}: one sample's spread is {relative} of the mean");
    }
}

#[test]
fn the_camera_sees_the_picture_as_its_convention_says() {
    let folder = tempfile::tempdir().expect("folder");
    // A quarter of the sphere's azimuth each: −z, +x, +z, −x are 0 to 3.
    write(folder.path(), 64, 33, |i, _| [((i + 8) % 64 / 16) as f64; 3]);
    let seen = |direction: DVec3, turn: f64| {
        let head = spot_camera(DVec3::ZERO, direction, 1);
        let text = format!("{head}[light.environment]\nfile = \"sky.exr\"\nrotate_deg = {turn}\n");
        one_pixel(&build(folder.path(), &text).expect("builds"), 2).0.x
    };
    assert_eq!([-DVec3::Z, DVec3::X, DVec3::Z, -DVec3::X].map(|d| seen(d, 0.0)), [0.0, 1.0, 2.0, 3.0]);
    // Counter-clockwise by a quarter, seen from above: what was at −z is now at −x.
    assert_eq!([-DVec3::X, -DVec3::Z, DVec3::X, DVec3::Z].map(|d| seen(d, 90.0)), [0.0, 1.0, 2.0, 3.0]);
    assert_eq!([-DVec3::X, -DVec3::Z, DVec3::X, DVec3::Z].map(|d| seen(d, -630.0)), [0.0, 1.0, 2.0, 3.0]);
}

#[test]
fn a_bad_environment_says_where_and_what() {
    let folder = tempfile::tempdir().expect("folder");
    let of = |sky: &str| {
        let head = spot_camera(DVec3::ZERO, DVec3::X, 1);
        build(folder.path(), &format!("{head}[light.environment]\n{sky}\n"))
    };
    let error = |sky: &str| of(sky).expect_err(sky).to_string();
    for (value, words) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (-0.5, "-0.5")] {
        write(folder.path(), 8, 5, |i, j| if (i, j) == (6, 2) { [1.0, 1.0, value] } else { [1.0; 3] });
        let message = error("file = \"sky.exr\"");
        let place = format!("sky.exr, column 6, row 2, blue: radiance is {words}, expected a finite number");
        assert!(message.contains(&place), "{message}");
    }
    write(folder.path(), 8, 1, |_, _| [1.0; 3]);
    assert!(error("file = \"sky.exr\"").contains("found 8 x 1"));
    std::fs::write(folder.path().join("sky.exr"), "not a picture").expect("written");
    assert!(error("file = \"sky.exr\"").contains("sky.exr: not a valid OpenEXR file"));
    assert!(error("file = \"none.exr\"").contains("none.exr"));
    for (sky, words) in [
        ("", "`light.environment` is 0 kinds of environment"),
        ("radiance = [1, 1, 1]\nfile = \"sky.exr\"", "is 2 kinds of environment"),
        ("file = \"sky.exr\"\nscale = -1", "`light.environment.scale` is -1.0"),
        ("file = \"sky.exr\"\nrotate_deg = inf", "`light.environment.rotate_deg` is inf"),
        ("radiance = [1, 1, 1]\nscale = 2", "`light.environment.scale` is 2.0, but must be left out"),
    ] {
        let message = error(sky);
        assert!(message.contains(words), "{message}");
    }
    // Black is no light, and no error.
    for (value, scale) in [(0.0, 1.0), (1.0, 0.0)] {
        write(folder.path(), 8, 5, |_, _| [value; 3]);
        let dark = of(&format!("file = \"sky.exr\"\nscale = {scale}")).expect("builds");
        assert_eq!(one_pixel(&dark, 4).0, DVec3::ZERO);
    }
}

#[test]
fn pictures_of_radiance_1e_minus_20_and_1e20_scale() {
    let folder = tempfile::tempdir().expect("folder");
    write(folder.path(), 16, 9, |i, j| [(i * j) as f64, 1.0, i as f64]);
    let of = |scale: f64| {
        let sky = format!("file = \"sky.exr\"\nscale = {scale:e}");
        one_pixel(&floor(folder.path(), DVec3::Y, "kd = [0.5, 0.5, 0.5]", &sky), 256)
    };
    let (one, noise) = of(1.0);
    for scale in [1e-20, 1e20] {
        let (got, spread) = of(scale);
        assert!(excess(got, scale * one, 1e-12 * scale * one) <= 1.0, "{scale:e}: {got} vs {one}");
        assert!(excess(spread, scale * noise, 1e-6 * scale * noise) <= 1.0, "{scale:e}: {spread} vs {noise}");
    }
}

#[test]
fn a_lobe_of_exponent_1e6_mirrors_a_small_sun() {
    // The sun is even over more than the lobe's 10⁻³ rad round the mirror direction: the lobe shows its radiance times cosθ.
    let folder = tempfile::tempdir().expect("folder");
    let sky =
        |i: usize, j: usize| if (i == 120 || i == 121) && (j == 64 || j == 65) { [1e5, 1.0, 1e-3] } else { [0.0; 3] };
    write(folder.path(), 512, 257, sky);
    let (phi, theta) = (2.0 * PI * 121.0 / 512.0, PI * 64.5 / 256.0);
    let sun = DVec3::new(phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin());
    let camera = DVec3::new(-sun.x, sun.y, -sun.z);
    let built = floor(folder.path(), camera, "phong = [{ ks = [1, 1, 1], n = 1e6 }]", "file = \"sky.exr\"");
    let (got, noise) = one_pixel(&built, 10_000);
    let want = theta.cos() * DVec3::new(1e5, 1.0, 1e-3);
    assert!(excess(got, want, 5.0 * noise + 1e-3 * want) <= 1.0, "{got} ± {noise} vs {want}");
    assert!((noise / got).max_element() < 0.01, "noise {noise} of {got}");
}
