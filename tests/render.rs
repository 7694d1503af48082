//! Laws of the tracer: radiometry against closed forms, and what must not change the picture.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use common::{excess, mean, one_pixel, picture, scene, scene_with, spot_camera, toml, transformed};
use glam::DVec3;
use goniofit::brdf::{Brdf, Sample};
use goniofit::control::{Control, Progress, Stop};
use goniofit::geometry::{direction, sampling};
use goniofit::image::{Image, compare};
use goniofit::render::{Material, Materials, Options, PhongEquation, Plan, Scene, Strategy, render};

/// A spot camera that looks at the point `at` of a Lambertian surface.
fn lambert_spot(from: DVec3, at: DVec3, shape_and_light: &str) -> Scene {
    scene(&format!("{}[materials]\nm = {{ kd = [0.8, 0.5, 0.2] }}\n{shape_and_light}", spot_camera(from, at, 1)))
}

const KD: DVec3 = DVec3::new(0.8, 0.5, 0.2);
const GROUND: &str = "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 3, 0]\nmaterial = \"m\"\n";

#[test]
fn a_diffuse_point_under_point_lights_is_the_closed_form() {
    // L = (kd/π) Σ I cosθ/r², on a plane and on a sphere; several lights add up.
    for (light, at) in
        [(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO), (DVec3::new(-30.0, 0.01, 4.0), DVec3::new(1.0, 0.0, 2.0))]
    {
        let lamp = |p: DVec3| format!("[[light.point]]\nposition = {}\nintensity = [10, 20, 30]\n", toml(p));
        let irradiance =
            |p: DVec3, n: DVec3| (p - at).dot(n) / (p - at).length().powi(3) * DVec3::new(10.0, 20.0, 30.0);
        let second = DVec3::new(0.5, 7.0, -2.0);
        let world = format!("{GROUND}{}{}", lamp(light), lamp(second));
        let (got, noise) = one_pixel(&lambert_spot(DVec3::new(3.0, 4.0, 5.0), at, &world), 16);
        let want = KD / PI * (irradiance(light, DVec3::Y) + irradiance(second, DVec3::Y));
        assert!(excess(got, want, want * 1e-6) <= 1.0, "light {light}: {got} vs {want}");
        assert!(noise.max_element() <= 1e-6 * want.max_element(), "a point light has no noise: {noise}");
    }
    let normal = direction(0.6, 1.1);
    let at = DVec3::new(5.0, -2.0, 1.0) + 0.3 * normal;
    let ball = "[[sphere]]\ncenter = [5, -2, 1]\nradius = 0.3\nmaterial = \"m\"\n\
                [[light.point]]\nposition = [6, 0, 4]\nintensity = [1, 1, 1]\n";
    let to = DVec3::new(6.0, 0.0, 4.0) - at;
    let (got, _) = one_pixel(&lambert_spot(at + 2.0 * normal, at, ball), 4);
    let want = KD / PI * (to.dot(normal) / to.length().powi(3));
    assert!(excess(got, want, want * 1e-6) <= 1.0, "sphere: {got} vs {want}");
}

#[test]
fn parallel_light_gives_its_irradiance_times_the_cosine() {
    for theta in [0.0, 0.5, 1.2, 1.57, 1.6] {
        let toward = DVec3::new(f64::sin(theta), f64::cos(theta), 0.0);
        let light = format!("[[light.directional]]\ntoward = {}\nirradiance = [3, 3, 3]\n", toml(7.0 * toward));
        let (got, _) =
            one_pixel(&lambert_spot(DVec3::new(0.0, 2.0, 1.0), DVec3::ZERO, &(GROUND.to_owned() + &light)), 4);
        let want = KD / PI * 3.0 * toward.y.max(0.0);
        assert!(excess(got, want, want * 1e-12) <= 1.0, "theta {theta}: {got} vs {want}");
    }
}

/// Irradiance at the origin, normal +y, from a polygon of radiance 1 above the horizon (Lambert 1760): ½ Σ γ n·Γ.
fn polygon_irradiance(corners: [DVec3; 4]) -> f64 {
    let sum: f64 = (0..4)
        .map(|i| {
            let (a, b) = (corners[i].normalize(), corners[(i + 1) % 4].normalize());
            let cross = a.cross(b);
            cross.length().atan2(a.dot(b)) * cross.normalize().y
        })
        .sum();
    0.5 * sum.abs()
}

#[test]
fn a_quad_light_gives_lambert_s_polygon_irradiance() {
    // High above; low and wide; upright with an edge on the ground; small and far; a parallelogram; tilted.
    let lights = [
        (DVec3::new(0.3, 2.0, 0.1), DVec3::X, DVec3::Z),
        (DVec3::new(0.0, 0.05, 0.0), 4.0 * DVec3::X, 3.0 * DVec3::Z),
        (DVec3::new(0.5, 1.0, 0.0), DVec3::Y, 2.0 * DVec3::Z),
        (DVec3::new(10.0, 40.0, -5.0), 0.01 * DVec3::X, 0.02 * DVec3::Z),
        (DVec3::new(1.0, 1.5, 0.0), DVec3::X, DVec3::new(0.7, 0.0, 0.8)),
        (DVec3::new(-1.0, 1.5, 0.5), DVec3::new(0.6, 0.8, 0.0), DVec3::Z),
    ];
    for (center, u, v) in lights {
        // Turned so that its front sees the origin.
        let (u, v) = if u.cross(v).dot(center) < 0.0 { (u, v) } else { (v, u) };
        let quad = format!(
            "[[light.quad]]\ncenter = {}\nu = {}\nv = {}\nradiance = [2, 2, 2]\n",
            toml(center),
            toml(u),
            toml(v)
        );
        let camera = DVec3::new(-0.2, 0.02, 0.4);
        let (got, noise) = one_pixel(&lambert_spot(camera, DVec3::ZERO, &(GROUND.to_owned() + &quad)), 20_000);
        let corners = [center - u - v, center + u - v, center + u + v, center - u + v];
        let want = KD / PI * 2.0 * polygon_irradiance(corners);
        // The spot is 4·10⁻⁸ wide; seen from 5 cm that moves the answer by less than 10⁻⁶.
        let z = excess(got, want, 5.0 * noise + 1e-6 * want);
        assert!(z <= 1.0, "light at {center}: {got} ± {noise} vs {want}");
        assert!(noise.max_element() < 0.02 * got.max_element(), "light at {center}: noise {noise}");
    }
}

#[test]
fn a_light_is_seen_at_its_radiance_and_its_back_is_black() {
    let quad = "[[light.quad]]\ncenter = [0, 2, 0]\nu = [1, 0, 0]\nv = [0, 0, 1]\nradiance = [3, 2, 1]\n";
    let from = |camera| one_pixel(&lambert_spot(camera, DVec3::new(0.1, 2.0, 0.1), &(GROUND.to_owned() + quad)), 2).0;
    assert_eq!(from(DVec3::new(0.3, 0.5, 0.2)), DVec3::new(3.0, 2.0, 1.0));
    assert_eq!(from(DVec3::new(0.3, 5.0, 0.2)), DVec3::ZERO);
    // The ground above it, seen through nothing: the back blocks the light of a lamp that stands behind it.
    let lamp = "[[light.point]]\nposition = [0, 4, 0]\nintensity = [9, 9, 9]\n";
    let shadow = lambert_spot(
        DVec3::new(3.0, 1.0, 0.0),
        DVec3::ZERO,
        &format!("{GROUND}{lamp}{}", quad.replace("[3, 2, 1]", "[0, 0, 0]")),
    );
    assert_eq!(one_pixel(&shadow, 8).0, DVec3::ZERO);
}

#[test]
fn a_white_furnace_shows_the_directional_albedo() {
    // (kd, ks, n) and the albedo at these cosines, by quadrature outside of this program.
    let cosines = [1.0, 0.9, 0.75, 0.5, 0.25, 0.1];
    let table = [
        (0.7, 0.0, 1.0, [0.7; 6]),
        (0.5, 0.5, 50.0, [1.0, 0.95, 0.875, 0.750, 0.62598, 0.55982]),
        (0.0, 1.0, 1.0, [1.0, 0.90954, 0.78800, 0.60900, 0.45331, 0.36990]),
        (0.0, 1.0, 10.0, [1.0, 0.90000, 0.75011, 0.50474, 0.28496, 0.17916]),
        (0.0, 1.0, 100.0, [1.0, 0.9, 0.75, 0.5, 0.25017, 0.10821]),
        (0.0, 1.0, 1000.0, [1.0, 0.9, 0.75, 0.5, 0.25, 0.10001]),
    ];
    for (kd, ks, n, albedo) in table {
        for (cos, want) in cosines.into_iter().zip(albedo) {
            let camera = DVec3::new(f64::sqrt(1.0 - cos * cos), cos, 0.0);
            let world = format!(
                "{}[materials]\nm = {{ kd = [{kd}, {kd}, {kd}], phong = [{{ ks = [{ks}, {ks}, {ks}], n = {n} }}] }}\n\
                 {GROUND}[light.environment]\nradiance = [1, 1, 1]\n",
                spot_camera(camera, DVec3::ZERO, 1)
            );
            let (got, noise) = one_pixel(&scene(&world), 20_000);
            // The table is rounded to 5 digits.
            let z = excess(got, DVec3::splat(want), 5.0 * noise + 6e-6);
            assert!(z <= 1.0, "kd {kd} ks {ks} n {n} cos {cos}: {got} ± {noise} vs {want}");
        }
    }
}

#[test]
fn the_sphere_scene_has_its_closed_form() {
    let spec = goniofit::render::scene::builtin("sphere").expect("built in");
    let built = Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds");
    let film = picture(&built, 256, 16, 1);
    let (got, noise) = mean(&film);
    // Stated to 7 digits; mean of the picture within its own noise.
    assert!(excess(got, DVec3::splat(0.100_993_9), 5.0 * noise + 5e-8) <= 1.0, "{got} ± {noise}");
    // The brightest point faces the light: 0.5/π · 100/(√50 − 1)². A pixel is 0.01 wide there, so its mean is lower by at most
    // 10⁻⁴ of it.
    let want = 0.5 / PI * 100.0 / (50f64.sqrt() - 1.0).powi(2);
    let brightest = film.to_image().radiance.iter().map(|p| p[0]).fold(0.0, f64::max);
    assert!((0.0..1e-4 * want).contains(&(want - brightest)), "{brightest} vs {want}");
}

#[test]
fn phong_s_equation_is_evaluated_as_written() {
    let equation = PhongEquation {
        ambient: DVec3::new(0.01, 0.02, 0.03),
        diffuse: DVec3::new(0.5, 0.4, 0.3),
        specular: DVec3::splat(0.7),
        alpha: 5.0,
    };
    let materials = Materials::from([("m".to_owned(), Material::PhongEquation(equation))]);
    let (eye, lamp) = (DVec3::new(2.0, 1.5, 0.3), DVec3::new(-3.0, 2.0, 0.5));
    let world = |height: f64| {
        format!(
            "{}[materials]\nm = {{ black = true }}\n{GROUND}[[light.point]]\nposition = {}\nintensity = [1, 1, 1]\n\
             [[sphere]]\ncenter = [-1.5, {height}, 0.25]\nradius = 0.2\nmaterial = \"m\"\n",
            spot_camera(eye, DVec3::ZERO, 3),
            toml(lamp)
        )
    };
    let (n, s, b) = (DVec3::Y, lamp.normalize(), eye.normalize());
    let r = 2.0 * n.dot(s) * n - s;
    let want = equation.ambient + equation.diffuse * n.dot(s) + equation.specular * r.dot(b).max(0.0).powi(5);
    let got = one_pixel(&scene_with(&world(10.0), &materials), 4).0;
    assert!(excess(got, want, want * 1e-6) <= 1.0, "{got} vs {want}");
    // With a ball in the way only the ambient term is left.
    assert_eq!(one_pixel(&scene_with(&world(1.0), &materials), 4).0, equation.ambient);
}

#[test]
fn the_ways_of_finding_light_agree() {
    let phong = "kd = [0.2, 0.3, 0.1], phong = [{ ks = [0.5, 0.4, 0.3], n = 20 }]";
    let glossy = |name: &str| {
        let text = goniofit::render::scene::BUILT_IN.iter().find(|s| s.name == name).expect("built in").toml;
        let from = text.find("ball = {").expect("a ball");
        let to = from + text[from..].find('}').expect("end");
        format!("{}ball = {{ {phong} {}", &text[..from], &text[to..])
    };
    for (name, samples) in [("sphere-on-plane", 400), ("furnace", 400)] {
        let built = scene(&glossy(name));
        let of = |strategy, seed| {
            let plan = Some(Plan::FULL); // no closed forms
            let options = Options { width: 24, height: 24, samples, seed, strategy, plan, ..Options::default() };
            mean(&render(&built, &options, Control::silent()).expect("renders"))
        };
        let (combined, noise) = of(Strategy::Combined, 1);
        for (strategy, seed) in [(Strategy::MaterialOnly, 2), (Strategy::LightsOnly, 3)] {
            let (other, other_noise) = of(strategy, seed);
            let z = excess(combined, other, (noise * noise + other_noise * other_noise).map(f64::sqrt));
            assert!(z < 5.0, "{name}, {strategy:?}: {combined} vs {other}: {z} sigma");
            // Where lights alone do better, by points that are all theirs, it is not by much.
            let ratio = noise.max_element() / other_noise.max_element();
            println!("{name}, {strategy:?}: {ratio:.2} times the noise");
            assert!(ratio <= 1.7, "{name}, {strategy:?}: combining must not add noise, and has {ratio} times as much");
        }
    }
}

#[test]
fn the_picture_does_not_depend_on_threads_or_passes() {
    let spec = goniofit::render::scene::builtin("cornell").expect("built in");
    let built = Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds");
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        let film = pool.install(|| picture(&built, 40, 12, 9));
        (film.to_image().radiance, film.to_image().standard_error)
    };
    let one = of(1);
    assert!(one == of(2) && one == of(8));
}

#[test]
fn scaling_a_scene_does_not_change_its_picture() {
    for name in ["sphere", "sphere-on-plane", "cornell"] {
        let of = |scale: f64| {
            let spec = transformed(name, scale, DVec3::ZERO);
            picture(&Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds"), 32, 8, 4)
        };
        let (plain, noise) = mean(&of(1.0));
        let bits = of(1.0).to_image().radiance;
        for exponent in [-40, -13, 7, 20, 60] {
            // Powers of two round nothing: the same bits.
            assert!(of(f64::exp2(f64::from(exponent))).to_image().radiance == bits, "{name} scaled by 2^{exponent}");
        }
        for scale in [1e-4, 1e-2, 1e3, 1e6] {
            let film = of(scale);
            let same = film.to_image().radiance.iter().zip(&bits).filter(|(a, b)| close(a, b, 1e-6)).count();
            // A path changes only where rounding moves it across an edge.
            assert!(same > 1024 * 98 / 100, "{name} scaled by {scale:e}: {same} of 1024 pixels agree");
            assert!(excess(mean(&film).0, plain, 2.0 * noise) <= 1.0, "{name} scaled by {scale:e}");
        }
    }
}

fn close(a: &[f64; 3], b: &[f64; 3], tolerance: f64) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() <= tolerance * x.abs().max(y.abs()))
}

#[test]
fn moving_a_scene_does_not_change_its_picture() {
    for name in ["sphere", "sphere-on-plane", "cornell"] {
        let of = |moved: DVec3| {
            let spec = transformed(name, 1.0, moved);
            picture(&Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds"), 32, 16, 4)
        };
        let (plain, noise) = mean(&of(DVec3::ZERO));
        for moved in [DVec3::splat(10.0), DVec3::new(1e6, 0.0, 0.0), DVec3::new(-1e6, 3e5, 1e6)] {
            let (got, other) = mean(&of(moved));
            assert!(
                excess(got, plain, 5.0 * (noise + other)) <= 1.0,
                "{name} moved by {moved}: {got} vs {plain} ± {noise}"
            );
        }
    }
}

#[test]
fn radiance_scales_with_the_light_over_forty_decades() {
    let of = |gain: f64| {
        let mut spec = goniofit::render::scene::builtin("sphere-on-plane").expect("built in");
        spec.lights.quad[0].radiance = [gain, 2.0 * gain, 0.0];
        let film = picture(&Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds"), 16, 16, 2);
        assert_eq!(film.not_finite, 0);
        film.to_image()
    };
    let one = of(1.0);
    for gain in [1e-20, 1e20] {
        let scaled = of(gain);
        let errors = one.standard_error.iter().flatten().zip(scaled.standard_error.iter().flatten());
        for (a, b) in one.radiance.iter().zip(&scaled.radiance).chain(errors) {
            assert!(close(&a.map(|x| x * gain), b, 1e-7), "{a:?} times {gain:e} is not {b:?}");
        }
    }
}

#[test]
fn what_gets_no_light_is_exactly_black() {
    let camera = "version = 1\nname = \"dark\"\nmax_bounces = 6\n[camera]\nposition = [0, 0, 0]\ntarget = [0, 0, -1]\nfov_deg = 90\n\
                  [materials]\nm = { kd = [0.9, 0.9, 0.9] }\nb = { black = true }\n";
    let ball = "[[sphere]]\ncenter = [0, 0, 0]\nradius = 2\nmaterial = \"m\"\n";
    let lamps =
        "[light.environment]\nradiance = [5, 5, 5]\n[[light.point]]\nposition = [0, 1, 0]\nintensity = [1, 1, 1]\n";
    let black_ball = "[[sphere]]\ncenter = [0, 0, -3]\nradius = 2\nmaterial = \"b\"\n";
    for (what, world) in [
        ("no lights", ball.replace("[0, 0, 0]", "[0, 0, -3]")),
        ("nothing at all", String::new()),
        ("inside a sphere, which is lit outside", format!("{ball}{lamps}")),
        ("a black material", format!("{black_ball}[[light.point]]\nposition = [0, 1, 0]\nintensity = [1, 1, 1]\n")),
    ] {
        let film = picture(&scene(&format!("{camera}{world}")), 16, 4, 1);
        assert_eq!(mean(&film), (DVec3::ZERO, DVec3::ZERO), "{what}");
    }
}

/// A diffuse BRDF of one channel that was measured only where the light is not low.
struct Partial;

impl Brdf for Partial {
    fn channels(&self) -> usize {
        1
    }
    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let known = wi.z >= 0.5;
        out[0] = if known && wi.z > 0.0 && wo.z > 0.0 { 0.5 / PI } else { 0.0 };
        known
    }
    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        let wi = sampling::cosine_hemisphere(glam::DVec2::new(u[1], u[2]));
        (wo.z > 0.0 && wi.z > 0.0).then(|| Sample { wi, pdf: sampling::cosine_hemisphere_pdf(wi) })
    }
    fn pdf(&self, wi: DVec3, _wo: DVec3) -> f64 {
        sampling::cosine_hemisphere_pdf(wi)
    }
}

#[test]
fn unmeasured_directions_are_shown_as_a_mask() {
    let lamp = |height: f64| {
        let world = format!(
            "{}[materials]\nm = {{ file = \"partial.csv\" }}\n{GROUND}\
             [[light.point]]\nposition = [1, {height}, 0]\nintensity = [1, 1, 1]\n",
            spot_camera(DVec3::new(0.0, 1.0, 0.3), DVec3::ZERO, 1)
        );
        let materials = Materials::from([("m".to_owned(), Material::Brdf(Arc::new(Partial)))]);
        picture(&scene_with(&world, &materials), 1, 8, 1).to_image()
    };
    assert_eq!(lamp(1.0).mask, Some(vec![0.0]));
    assert!(lamp(1.0).radiance[0][0] > 0.0);
    assert_eq!(lamp(0.3).mask, Some(vec![1.0]));
}

/// A BRDF with gaps: unknown where the light stands lower than the cosine `above`; else diffuse with albedo ½.
struct Gap {
    above: f64,
}

impl Brdf for Gap {
    fn channels(&self) -> usize {
        1
    }
    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let known = wi.z > self.above;
        out[0] = if known && wi.z > 0.0 && wo.z > 0.0 { 0.5 / PI } else { 0.0 };
        known
    }
    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        Partial.sample(wo, u)
    }
    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        Partial.pdf(wi, wo)
    }
}

fn with_gap(above: f64) -> Materials {
    Materials::from([("gap".to_owned(), Material::Brdf(Arc::new(Gap { above })))])
}

#[test]
fn more_samples_do_not_mask_more_pixels() {
    let sky = "version = 1\nname = \"test\"\nmax_bounces = 1\n[camera]\nposition = [0, 4, 0]\ntarget = [0, 0, 0]\nup = [1, 0, 0]\n\
               fov_deg = 20\n[materials]\ngap = { file = \"gap.csv\" }\n[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\n\
               material = \"gap\"\n[light.environment]\nradiance = [1, 1, 1]\n";
    // A path draws two directions, each in the gap with probability 0.05² = 0.0025: the share is 0.5 %, below 2 %.
    let masked = |samples: u32| {
        let image = picture(&scene_with(sky, &with_gap(0.05)), 32, samples, 1).to_image();
        let share = image.mask.iter().flatten().sum::<f64>() / 1024.0;
        let paths = f64::from(1024 * samples);
        assert!((share - 0.005).abs() < 5.0 * (0.005 / paths).sqrt(), "{samples} samples: {share}");
        (0..1024).filter(|i| image.is_masked(*i)).count()
    };
    // One of 16 paths is 6 %, as is bound to happen in 8 % of the pixels; 6 of 256 happen in 0.2 % of them.
    let (few, many) = (masked(16), masked(256));
    assert!(many <= few && many <= 10, "16 samples mask {few}, 256 mask {many}");
    // Nothing is known: all is masked.
    let image = picture(&scene_with(sky, &with_gap(1.0)), 8, 16, 1).to_image();
    assert_eq!(image.mask, Some(vec![1.0; 64]));
}

#[test]
fn gaps_seen_by_way_of_another_surface_count_by_its_reflectance() {
    // The floor is seen; every path goes on to the ceiling, lit from below, of which nothing is known.
    for (kd, want) in [([0.3, 0.1, 0.2], 0.3), ([0.01, 0.0, 0.01], 0.01), ([1.0; 3], 1.0)] {
        let world = |lamp: f64| {
            format!(
                "{}[materials]\nm = {{ kd = {kd:?} }}\ngap = {{ file = \"gap.csv\" }}\n{GROUND}\
                 [[plane]]\npoint = [0, 2, 0]\nnormal = [0, -1, 0]\nmaterial = \"gap\"\n\
                 [[light.point]]\nposition = [0, {lamp}, 0]\nintensity = [1, 1, 1]\n",
                spot_camera(DVec3::new(0.0, 1.0, 0.3), DVec3::ZERO, 2)
            )
        };
        let share = |lamp| {
            let image = picture(&scene_with(&world(lamp), &with_gap(1.0)), 1, 64, 1).to_image();
            image.mask.expect("rendered")[0]
        };
        assert!((share(1.0) - want).abs() < 1e-12, "kd {kd:?}: {} vs {want}", share(1.0));
        // A lamp behind the ceiling does not light it, so nothing is missing.
        assert_eq!(share(3.0), 0.0);
    }
}

#[test]
fn a_hidden_light_asks_for_nothing() {
    let share = |ball: f64| {
        let world = format!(
            "{}[materials]\ngap = {{ file = \"gap.csv\" }}\nb = {{ black = true }}\n[[plane]]\npoint = [0, 0, 0]\n\
             normal = [0, 1, 0]\nmaterial = \"gap\"\n[[light.point]]\nposition = [2, 2, 0]\nintensity = [1, 1, 1]\n\
             [[sphere]]\ncenter = [1, {ball}, 0]\nradius = 0.2\nmaterial = \"b\"\n",
            spot_camera(DVec3::new(0.0, 1.0, 0.3), DVec3::ZERO, 1)
        );
        picture(&scene_with(&world, &with_gap(1.0)), 1, 4, 1).to_image().mask.expect("rendered")[0]
    };
    assert_eq!((share(1.0), share(9.0)), (0.0, 1.0));
}

/// Asks to stop after a number of reports.
struct StopAfter<'a> {
    stop: &'a Stop,
    left: AtomicU64,
}

impl Progress for StopAfter<'_> {
    fn start(&self, _label: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {
        if self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.stop.request();
        }
    }
    fn finish(&self) {}
}

#[test]
fn a_stopped_render_keeps_what_it_has() {
    let built = scene(goniofit::render::scene::BUILT_IN[1].toml);
    let options = Options { width: 32, height: 32, samples: 1 << 20, ..Options::default() };
    // 32² pixels are 4 tiles of 16², whose pixels get 8 samples at a time at first.
    for tiles in [1, 4, 20] {
        let stop = Stop::new();
        let progress = StopAfter { stop: &stop, left: AtomicU64::new(tiles) };
        let film = render(&built, &options, Control { progress: &progress, stop: &stop }).expect("renders");
        let image = film.to_image();
        let masked = image.mask.iter().flatten().filter(|m| **m == 1.0).count();
        assert!(film.total_samples() >= 2048 * tiles && film.samples() < 200, "{tiles}: {}", film.total_samples());
        assert_eq!(masked == 0, tiles >= 4, "{tiles} tiles: {masked} pixels without samples");
        assert!(image.radiance.iter().flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn a_render_stopped_before_it_began_is_all_mask() {
    let built = scene(goniofit::render::scene::BUILT_IN[0].toml);
    let stop = Stop::new();
    stop.request();
    let control = Control { stop: &stop, ..Control::silent() };
    let film = render(&built, &Options { width: 8, height: 8, ..Options::default() }, control).expect("renders");
    let image = film.to_image();
    assert_eq!((film.samples(), image.metadata.samples), (0, Some(0)));
    assert_eq!((image.mask, image.radiance), (Some(vec![1.0; 64]), vec![[0.0; 3]; 64]));
    assert!(image.standard_error.iter().flatten().flatten().all(|e| *e == f64::INFINITY));
}

/// Standard errors are those of the points that were drawn, which are more even than independent ones: over pairs of pictures that
/// differ by their seeds, the mean of z² is 1.
#[test]
fn standard_errors_are_honest() {
    for (name, samples) in
        [("cornell", 8), ("cornell", 64), ("sphere-on-plane", 16), ("sphere-on-plane", 128), ("mesh-env", 16)]
    {
        let spec = goniofit::render::scene::builtin(name).expect("built in");
        let built = Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds");
        let (mut sum, mut count) = (0.0, 0.0);
        for pair in 0..4 {
            let [a, b] = [0, 1].map(|k| picture(&built, 48, samples, 40 + 2 * pair + k).to_image());
            let errors = |image: &Image| image.standard_error.clone().expect("rendered");
            for ((p, q), (e, f)) in a.radiance.iter().zip(&b.radiance).zip(errors(&a).iter().zip(&errors(&b))) {
                for c in 0..3 {
                    let variance = e[c] * e[c] + f[c] * f[c];
                    if variance > 0.0 {
                        // A pixel that saw an edge in one picture only would outweigh all others.
                        sum += ((p[c] - q[c]).powi(2) / variance).min(25.0);
                        count += 1.0;
                    }
                }
            }
        }
        println!("{name}, {samples} samples: mean z² {:.3}", sum / count);
        assert!((0.75..1.2).contains(&(sum / count)), "{name}, {samples} samples: mean z² {}", sum / count);
    }
}

/// A built-in scene at 48 × 48 pixels, the albedo of its ball multiplied by `gain`.
fn shot(name: &str, gain: f64, samples: u32, seed: u64) -> Image {
    let mut spec = goniofit::render::scene::builtin(name).expect("built in");
    let ball = spec.materials.get_mut("ball").expect("a ball");
    ball.kd = ball.kd.map(|kd| kd.map(|k| gain * k));
    picture(&Scene::build(&spec, Path::new("."), &Materials::new()).expect("builds"), 48, samples, seed).to_image()
}

/// In how many of ten pairs of pictures with different seeds the difference is said to be more than noise.
fn flagged(name: &str, gain: f64, samples: (u32, u32)) -> usize {
    let differs = |k: u64| {
        let (a, b) = (shot(name, 1.0, samples.0, 100 + 2 * k), shot(name, gain, samples.1, 101 + 2 * k));
        compare(&a, &b).expect("same size").significance.expect("enough samples")
    };
    let found: Vec<_> = (0..10).map(differs).collect();
    let (z, mean) = (found.iter().map(|s| s.max_z), found.iter().map(|s| s.mean_z2).sum::<f64>() / 10.0);
    println!("{name} × {gain}, {samples:?} samples: |z| up to {:.2}, mean z² {mean:.2}", z.fold(0.0, f64::max));
    // The comparison takes the larger of a pixel's standard error and its noisiest neighbours', so well below 1.
    assert!(gain != 1.0 || (0.25..1.1).contains(&mean), "{name}: mean z² {mean}");
    found.iter().filter(|s| s.differs).count()
}

#[test]
fn noise_is_not_taken_for_a_difference() {
    for samples in [(16, 16), (64, 64), (16, 256)] {
        // Of 20 tests at 1 % more than 2 raise a false alarm with probability 0.001.
        let alarms: usize = ["cornell", "sphere-on-plane"].map(|name| flagged(name, 1.0, samples)).iter().sum();
        assert!(alarms <= 2, "{samples:?} samples: {alarms} of 20");
    }
}

#[test]
fn an_albedo_wrong_by_five_percent_is_found_with_64_samples() {
    for name in ["cornell", "sphere-on-plane"] {
        let found = flagged(name, 1.05, (64, 64));
        assert!(found >= 9, "{name}: {found} of 10");
    }
}

#[test]
fn few_samples_are_not_judged() {
    let c = compare(&shot("cornell", 1.0, 4, 1), &shot("cornell", 1.0, 64, 2)).expect("same size");
    assert!(c.significance.is_none() && c.note.is_some_and(|note| note.contains("too few samples (4)")));
}
