//! Sphere, spot and mesh lights against closed forms, and where they touch what they light.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

use common::{excess, mean, one_pixel, picture, spot_camera, toml};
use glam::DVec3;
use goniofit::control::Control;
use goniofit::radiometry::{Radiance, irradiance_from_cone, irradiance_from_polygon};
use goniofit::render::{Materials, Options, Scene, SceneSpec, Strategy, render};

const KD: DVec3 = DVec3::new(0.8, 0.5, 0.2);
const GROUND: &str = "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n";

/// A spot of a diffuse floor at the origin under a light.
fn floor(folder: &Path, camera: DVec3, light: &str) -> Scene {
    let head = spot_camera(camera, DVec3::ZERO, 1);
    let text = format!("{head}[materials]\nm = {{ kd = [0.8, 0.5, 0.2] }}\n{GROUND}{light}");
    build(folder, &text)
}

fn build(folder: &Path, text: &str) -> Scene {
    let spec = SceneSpec::parse(text, "test").unwrap_or_else(|e| panic!("{e}\n{text}"));
    Scene::build(&spec, folder, &Materials::new()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn sphere_light(center: DVec3, radius: f64, radiance: f64) -> String {
    let center = toml(center);
    format!(
        "[[light.sphere]]\ncenter = {center}\nradius = {radius:?}\nradiance = [{radiance:?}, {radiance:?}, {radiance:?}]\n"
    )
}

/// Writes triangles as an OBJ file.
fn obj(folder: &Path, name: &str, triangles: &[[DVec3; 3]]) {
    let mut text = String::new();
    for p in triangles.iter().flatten() {
        writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z).expect("string");
    }
    (0..triangles.len()).for_each(|i| writeln!(text, "f {} {} {}", 3 * i + 1, 3 * i + 2, 3 * i + 3).expect("string"));
    std::fs::write(folder.join(name), text).expect("written");
}

#[test]
fn a_sphere_light_gives_pi_l_sin2_cos() {
    let side = DVec3::new(-0.3, 0.004, 0.5);
    for (center, radius) in [
        (DVec3::new(0.0, 2.0, 0.0), 0.5),
        (DVec3::new(1.0, 2.0, -0.5), 1.5),
        (DVec3::new(30.0, 40.0, 0.0), 1e-3),
        (DVec3::new(0.0, 1.001, 0.0), 1.0),
        (DVec3::new(0.0, 1e4, 0.0), 9.99e3),
        (DVec3::new(3.0, 3.001, 0.0), 3.0),
        (DVec3::new(2e3, 1e3, 0.0), 1e-5),
    ] {
        let (distance, radiance) = (center.length(), 2.0 / (radius / center.length()).powi(2));
        let (got, noise) = one_pixel(&floor(Path::new("."), side, &sphere_light(center, radius, radiance)), 20_000);
        let half_angle = (radius / distance).asin();
        let want =
            irradiance_from_cone(Radiance::new(radiance), half_angle, center.y / distance).expect("above").value();
        // The spot is 10⁻⁷ wide; 10⁻³ from the light that moves the answer by less than 10⁻⁴.
        let z = excess(got, KD / PI * want, 5.0 * noise + 1e-4 * KD * want);
        assert!(z <= 1.0, "light at {center}, radius {radius}: {got} ± {noise} vs {want}");
        assert!((noise / got).max_element() < 0.02, "light at {center}: noise {noise}");
    }
}

#[test]
fn a_sphere_light_is_seen_from_outside_and_black_inside() {
    let light = sphere_light(DVec3::new(0.0, 2.0, 0.0), 1.0, 3.0);
    let seen = |from: DVec3, to: DVec3| one_pixel(&build(Path::new("."), &(spot_camera(from, to, 1) + &light)), 2).0;
    assert_eq!(seen(DVec3::new(5.0, 2.0, 0.3), DVec3::new(0.0, 2.0, 0.0)), DVec3::splat(3.0));
    assert_eq!(seen(DVec3::new(0.3, 2.0, 0.0), DVec3::new(0.0, 7.0, 0.0)), DVec3::ZERO);
    assert_eq!(seen(DVec3::new(5.0, 2.0, 0.0), DVec3::new(0.0, 5.0, 0.0)), DVec3::ZERO);
}

#[test]
fn a_sphere_light_that_touches_or_surrounds_what_it_lights_gives_finite_pictures() {
    // Touching the floor, cutting it, round the camera, round everything, sharing a ball's surface.
    let ball = "[[sphere]]\ncenter = [0, 1, 0]\nradius = 1\nmaterial = \"m\"\n";
    for (center, radius) in [
        ([2.0, 1.0, 0.0], 1.0),
        ([2.0, 0.5, 0.0], 1.0),
        ([0.0, 2.5, 6.0], 0.5),
        ([0.0, 0.0, 0.0], 50.0),
        ([0.0, 1.0, 0.0], 1.0),
    ] {
        let text = format!(
            "version = 1\nname = \"touch\"\nmax_bounces = 4\n[camera]\nposition = [0, 2.5, 6]\ntarget = [0, 0.8, 0]\nfov_deg = 50\n\
             [materials]\nm = {{ kd = [0.8, 0.5, 0.2] }}\n{GROUND}{ball}{}",
            sphere_light(center.into(), radius, 1.0)
        );
        let film = picture(&build(Path::new("."), &text), 48, 16, 1);
        assert_eq!(film.not_finite, 0);
        let image = film.to_image();
        assert!(image.radiance.iter().flatten().all(|x| (0.0..50.0).contains(x)), "light at {center:?}");
    }
}

#[test]
fn a_spot_light_follows_its_formula() {
    // The lamp stands at (0, 3, 0) and shines down along an axis tilted by `tilt`: the origin is seen at that angle from the axis.
    for (inner, outer, tilt) in [
        (10.0, 30.0, 0.0f64),
        (10.0, 30.0, 9.9),
        (10.0, 30.0, 20.0),
        (10.0, 30.0, 29.0),
        (10.0, 30.0, 31.0),
        (0.0, 180.0, 60.0),
        (20.0, 20.0, 19.9),
        (20.0, 20.0, 20.1),
        (1e-3, 3e-3, 2e-3),
    ] {
        let t = tilt.to_radians();
        let light = format!(
            "[[light.spot]]\nposition = [0, 3, 0]\ndirection = {}\nintensity = [9, 9, 9]\ninner_deg = {inner:?}\nouter_deg = {outer:?}\n",
            toml(2.0 * DVec3::new(t.sin(), -t.cos(), 0.0))
        );
        let x: f64 = if tilt <= inner { 1.0 } else { ((outer - tilt) / (outer - inner)).clamp(0.0, 1.0) };
        let want = KD / PI * 9.0 / 9.0 * x * x * (3.0 - 2.0 * x);
        let (got, _) = one_pixel(&floor(Path::new("."), DVec3::new(0.3, 1.0, 0.2), &light), 4);
        // The spot seen is 10⁻⁷ wide: the narrowest edge is 3.5·10⁻⁵ rad, 10⁻⁴ m on the floor.
        let bound = if outer < 1.0 { 1e-2 } else { 1e-5 };
        assert!(excess(got, want, bound * want) <= 1.0, "{inner} to {outer} at {tilt}: {got} vs {want}");
    }
}

#[test]
fn a_mesh_light_gives_lambert_s_polygon_irradiance() {
    let folder = tempfile::tempdir().expect("folder");
    let quad = |c: DVec3, u: DVec3, v: DVec3| [c - u - v, c + u - v, c + u + v, c - u + v];
    // High; low and wide; upright with an edge on the ground; small and far; tilted; next to the point, a needle.
    for corners in [
        quad(DVec3::new(0.3, 2.0, 0.1), DVec3::X, DVec3::Z),
        quad(DVec3::new(0.0, 0.05, 0.0), 4.0 * DVec3::X, 3.0 * DVec3::Z),
        quad(DVec3::new(0.5, 1.0, 0.0), DVec3::Y, -2.0 * DVec3::Z),
        quad(DVec3::new(10.0, 40.0, -5.0), 0.01 * DVec3::X, 0.02 * DVec3::Z),
        quad(DVec3::new(1e3, 4e3, 0.0), 0.01 * DVec3::X, 0.02 * DVec3::Z),
        quad(DVec3::new(1.0, 1.5, 0.0), DVec3::X, DVec3::new(0.7, 0.0, 0.8)),
        quad(DVec3::new(0.5, 0.6, 0.0), 2.0 * DVec3::X, 1e-4 * DVec3::Z),
    ] {
        let corners = corners.map(|p| p.max(DVec3::new(f64::NEG_INFINITY, 0.0, f64::NEG_INFINITY)));
        let triangles = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]];
        obj(folder.path(), "lamp.obj", &triangles);
        let want = irradiance_from_polygon(&corners, Radiance::new(1.0), DVec3::ZERO, DVec3::Y)
            .expect("off its border")
            .value();
        let radiance = 1.0 / want;
        assert!(want > 0.0 && radiance.is_finite(), "{corners:?}: {want}");
        let light =
            format!("[[light.mesh]]\nfile = \"lamp.obj\"\nradiance = [{radiance:?}, {radiance:?}, {radiance:?}]\n");
        let camera = DVec3::new(-0.2, 0.02, 0.4);
        let (got, noise) = one_pixel(&floor(folder.path(), camera, &light), 40_000);
        let z = excess(got, KD / PI, 5.0 * noise + 1e-6 * KD);
        assert!(z <= 1.0, "{corners:?}: {got} ± {noise} vs {}", KD / PI);
        assert!((noise / got).max_element() < 0.03, "{corners:?}: noise {noise}");
    }
}

/// A triangulated unit sphere about 0: a grid of latitudes and longitudes.
fn ball(rows: usize) -> Vec<[DVec3; 3]> {
    let at = |j: usize, i: usize| {
        let (theta, phi) = (PI * j as f64 / rows as f64, PI * (i % (2 * rows)) as f64 / rows as f64);
        DVec3::new(phi.sin() * theta.sin(), theta.cos(), phi.cos() * theta.sin())
    };
    let cell = |k: usize| {
        let (j, i) = (k / (2 * rows), k % (2 * rows));
        [[at(j, i), at(j + 1, i), at(j + 1, i + 1)], [at(j, i), at(j + 1, i + 1), at(j, i + 1)]]
    };
    (0..2 * rows * rows).flat_map(cell).filter(|[a, b, c]| (b - a).cross(c - a).length() > 1e-12).collect()
}

#[test]
fn a_round_mesh_light_is_a_sphere_light() {
    let folder = tempfile::tempdir().expect("folder");
    obj(folder.path(), "lamp.obj", &ball(24));
    let text = |light: &str| {
        format!(
            "version = 1\nname = \"lamp\"\nmax_bounces = 3\n[camera]\nposition = [0, 2.5, 6]\ntarget = [0, 0.8, 0]\nfov_deg = 50\n\
             [materials]\nm = {{ kd = [0.4, 0.4, 0.4], phong = [{{ ks = [0.4, 0.4, 0.4], n = 30 }}] }}\n{GROUND}\
             [[sphere]]\ncenter = [0, 1, 0]\nradius = 1\nmaterial = \"m\"\n{light}"
        )
    };
    let of = |light: &str, strategy, seed| {
        let options = Options { width: 24, height: 24, samples: 400, seed, strategy, ..Options::default() };
        mean(&render(&build(folder.path(), &text(light)), &options, Control::silent()).expect("renders"))
    };
    let round = sphere_light(DVec3::new(1.8, 2.5, 0.5), 0.4, 5.0);
    let mesh = "[[light.mesh]]\nfile = \"lamp.obj\"\nradiance = [5, 5, 5]\nplace = { scale = 0.4, axis = [1, 2, 3], rotate_deg = 40, \
                translate = [1.8, 2.5, 0.5] }\n";
    let (want, noise) = of(&round, Strategy::Combined, 1);
    for (light, strategy, seed) in [
        (round.as_str(), Strategy::MaterialOnly, 2),
        (&round, Strategy::LightsOnly, 3),
        (mesh, Strategy::Combined, 4),
        (mesh, Strategy::MaterialOnly, 5),
        (mesh, Strategy::LightsOnly, 6),
    ] {
        let (got, other) = of(light, strategy, seed);
        // The mesh's cross-section is smaller by at most 1 − cos²(π/48)·…: less than 1 %.
        let bound = 5.0 * (noise * noise + other * other).map(f64::sqrt)
            + if light == mesh { 0.01 * want } else { DVec3::ZERO };
        assert!(excess(got, want, bound) <= 1.0, "{light}{strategy:?}: {got} ± {other} vs {want} ± {noise}");
    }
}

#[test]
fn lights_of_two_triangles_and_a_quad_give_the_same_picture() {
    let folder = tempfile::tempdir().expect("folder");
    let c = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| DVec3::new(2.0 + a, 4.0, 2.0 + b));
    obj(folder.path(), "lamp.obj", &[[c[0], c[1], c[2]], [c[0], c[2], c[3]]]);
    let spec = goniofit::render::scene::builtin("sphere-on-plane").expect("built in");
    let mut other = spec.clone();
    other.lights.quad.clear();
    other.lights.mesh = vec![toml::from_str("file = \"lamp.obj\"\nradiance = [10, 10, 10]").expect("light")];
    let of = |spec, seed| {
        mean(&picture(&Scene::build(spec, folder.path(), &Materials::new()).expect("builds"), 48, 64, seed))
    };
    let ((want, noise), (got, spread)) = (of(&spec, 1), of(&other, 2));
    assert!(
        excess(got, want, 5.0 * (noise * noise + spread * spread).map(f64::sqrt)) <= 1.0,
        "{got} vs {want} ± {noise}"
    );
    assert!(spread.max_element() < 1.3 * noise.max_element(), "picking a triangle costs little: {spread} vs {noise}");
}

#[test]
fn scenes_lit_by_spheres_and_meshes_can_be_scaled_and_moved() {
    let folder = tempfile::tempdir().expect("folder");
    obj(folder.path(), "lamp.obj", &ball(6));
    let of = |scale: f64, moved: DVec3| {
        let at = |p: DVec3| toml(scale * p + moved);
        let text = format!(
            "version = 1\nname = \"scaled\"\nmax_bounces = 3\n[camera]\nposition = {}\ntarget = {}\nfov_deg = 40\n\
             [materials]\nm = {{ kd = [0.5, 0.5, 0.5] }}\n\
             [[quad]]\ncenter = {}\nu = {}\nv = {}\nmaterial = \"m\"\n[[sphere]]\ncenter = {}\nradius = {:?}\nmaterial = \"m\"\n{}\
             [[light.mesh]]\nfile = \"lamp.obj\"\nradiance = [4, 4, 4]\nplace = {{ scale = {:?}, translate = {} }}\n\
             [[light.spot]]\nposition = {}\ndirection = [0, -1, 0]\nintensity = {:?}\ninner_deg = 5\nouter_deg = 20\n",
            at(DVec3::new(0.0, 2.5, 6.0)),
            at(DVec3::new(0.0, 0.8, 0.0)),
            at(DVec3::ZERO),
            toml(10.0 * scale * DVec3::X),
            toml(-10.0 * scale * DVec3::Z),
            at(DVec3::Y),
            scale,
            sphere_light(scale * DVec3::new(-2.0, 3.0, 1.0) + moved, 0.5 * scale, 3.0),
            0.3 * scale,
            at(DVec3::new(1.5, 0.3, 1.5)),
            at(DVec3::new(1.0, 4.0, 1.0)),
            [10.0 * scale * scale; 3],
        );
        mean(&picture(&build(folder.path(), &text), 32, 32, 5))
    };
    let (want, noise) = of(1.0, DVec3::ZERO);
    assert!(want.x > 0.1);
    for scale in [1e-4, 1e3, 1e6] {
        let (got, _) = of(scale, DVec3::ZERO);
        assert!(excess(got, want, 2.0 * noise) <= 1.0, "scaled by {scale:e}: {got} vs {want} ± {noise}");
    }
    for moved in [DVec3::new(1e6, 0.0, 0.0), DVec3::new(-1e6, 3e5, 1e6)] {
        let (got, other) = of(1.0, moved);
        assert!(excess(got, want, 5.0 * (noise + other)) <= 1.0, "moved by {moved}: {got} vs {want} ± {noise}");
    }
}

#[test]
fn a_lobe_of_exponent_1e6_mirrors_lights_larger_and_smaller_than_itself() {
    // The light's disc of half-angle σ stands in the mirror direction: ∫ (n+2)/(2π)·cosⁿα dω = (n+2)/(n+1)·(1 − cosⁿ⁺¹σ), times cosθ.
    let folder = tempfile::tempdir().expect("folder");
    obj(folder.path(), "lamp.obj", &ball(60));
    let (n, cos) = (1e6, f64::sqrt(0.5));
    let camera = DVec3::new(-1.0, 1.0, 0.0);
    for sigma in [1e-5, 1e-4, 1e-3, 3e-3, 0.1] {
        let (center, radius) = (DVec3::new(cos, cos, 0.0) * 10.0, 10.0 * f64::sin(sigma));
        let mesh = format!(
            "[[light.mesh]]\nfile = \"lamp.obj\"\nradiance = [1, 1, 1]\nplace = {{ scale = {radius:?}, translate = {} }}\n",
            toml(center)
        );
        let want =
            (n + 2.0) / (n + 1.0) * -f64::exp_m1((n + 1.0) * f64::ln_1p(-2.0 * f64::sin(0.5 * sigma).powi(2))) * cos;
        for (light, flat) in [(sphere_light(center, radius, 1.0), 1e-5), (mesh, 5e-3)] {
            let head = spot_camera(camera, DVec3::ZERO, 1);
            let text = format!("{head}[materials]\nm = {{ phong = [{{ ks = [1, 1, 1], n = 1e6 }}] }}\n{GROUND}{light}");
            let (got, noise) = one_pixel(&build(folder.path(), &text), 10_000);
            let bound = 5.0 * noise + DVec3::splat((flat + sigma * sigma + 1e-4) * want);
            assert!(excess(got, DVec3::splat(want), bound) <= 1.0, "σ {sigma:e}: {got} ± {noise} vs {want}\n{light}");
            assert!((noise / got).max_element() < 0.05, "σ {sigma:e}: noise {noise} of {got}\n{light}");
        }
    }
}

#[test]
fn phong_s_equation_sees_spheres_at_their_centre_spots_in_their_cone_and_no_meshes() {
    let folder = tempfile::tempdir().expect("folder");
    obj(folder.path(), "lamp.obj", &ball(6));
    let of = |light: &str| {
        let head = spot_camera(DVec3::new(0.3, 1.0, 0.2), DVec3::ZERO, 1);
        let text = format!(
            "{head}[materials.m.equation]\nambient = [0.1, 0.1, 0.1]\ndiffuse = [1, 1, 1]\nspecular = [0, 0, 0]\nalpha = 1\n{GROUND}{light}"
        );
        one_pixel(&build(folder.path(), &text), 2).0.x
    };
    let spot = |direction: &str| {
        format!(
            "[[light.spot]]\nposition = [3, 4, 0]\ndirection = {direction}\nintensity = [7, 7, 7]\ninner_deg = 5\nouter_deg = 10\n"
        )
    };
    for (light, want) in [
        (sphere_light(DVec3::new(3.0, 4.0, 0.0), 1.0, 9.0), 0.1 + 0.8),
        (spot("[-3, -4, 0]"), 0.1 + 0.8),
        (spot("[0, -1, 0]"), 0.1),
        ("[[light.mesh]]\nfile = \"lamp.obj\"\nradiance = [1, 1, 1]\nplace = { translate = [0, 4, 0] }\n".into(), 0.1),
    ] {
        assert!((of(&light) - want).abs() < 1e-6, "{light}: {}", of(&light));
    }
}
