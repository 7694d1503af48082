//! The plan of effects changes nothing: whatever a scene calls for, its picture is that of the full integrator.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;
mod furnace_support;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use common::{both_ways, excess, mean, picture, picture_by, scene};
use furnace_support::Opaque;
use glam::DVec3;
use goniofit::brdf::Reflectance;
use goniofit::image::{Image, compare, encode_exr};
use goniofit::numeric::random::{Purpose, RngExt, Stream, stream};
use goniofit::render::{Film, Material, Materials, Plan, Scene, SceneSpec};

/// The picture by the full integrator.
fn full(scene: &Scene, size: u32, samples: u32, seed: u64) -> Film {
    picture_by(Plan::FULL, scene, size, samples, seed)
}

/// Pixel by pixel and block by block, as `compare` tests pictures, both at this level.
fn same(by_plan: &Film, by_all: &Film, level: f64, what: &str) {
    assert_eq!((by_plan.not_finite, by_all.not_finite), (0, 0), "{what}");
    let (by_plan, by_all) = (by_plan.to_image(), by_all.to_image());
    let Some(found) = compare(&by_plan, &by_all).expect("pictures of one size").significance else {
        assert_eq!(by_plan.radiance, by_all.radiance, "without noise: {what}");
        return;
    };
    let (z, at, block) = (found.max_z, found.at, found.block);
    let (p, p_blocks) = (found.p, found.blocks.p);
    assert!(p > level && p_blocks > level, "{z} σ at {at:?}, block {block}: p {p:e}, {p_blocks:e}: {what}");
}

fn number(rng: &mut Stream, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

fn triple(rng: &mut Stream, low: f64, high: f64) -> String {
    format!("[{:.3}, {:.3}, {:.3}]", number(rng, low, high), number(rng, low, high), number(rng, low, high))
}

/// True once in so many times.
fn once_in(rng: &mut Stream, times: u32) -> bool {
    rng.random_range(0..times) == 0
}

/// A scene of a few shapes under a few lights. Where it is called "opaque", its material "a" is to tell no one that it is
/// a sum of lobes.
fn generated(rng: &mut Stream) -> String {
    let name = if once_in(rng, 8) { "opaque" } else { "generated" };
    let bounces = 1 + rng.random_range(0..4u32);
    let lens = if once_in(rng, 4) { "lens_radius = 0.2\n" } else { "" };
    let head = format!(
        "version = 1\nname = \"{name}\"\nmax_bounces = {bounces}\n[camera]\nposition = [0, 1.5, 6]\n\
         target = [0, 0.7, 0]\nfov_deg = 40\n{lens}"
    );
    head + &materials(rng) + &shapes(rng) + &lights(rng)
}

/// Two materials, diffuse or with a lobe of exponent 0.1 to 1000.
fn materials(rng: &mut Stream) -> String {
    let mut text = String::from("[materials]\n");
    for name in ["a", "b"] {
        let lobe = if once_in(rng, 2) {
            String::new()
        } else {
            format!("{{ ks = {}, n = {:.2} }}", triple(rng, 0.1, 0.5), 10f64.powf(number(rng, -1.0, 3.0)))
        };
        let _ = writeln!(text, "{name} = {{ kd = {}, phong = [{lobe}] }}", triple(rng, 0.05, 0.5));
    }
    text
}

/// A ball alone, or one to three with perhaps a floor, a tetrahedron and a wall.
fn shapes(rng: &mut Stream) -> String {
    let mut text = String::new();
    let count = [0u32, 1, 1, 2, 3][rng.random_range(0..5usize)];
    for _ in 0..count.max(1) {
        let _ = writeln!(
            text,
            "[[sphere]]\ncenter = [{:.3}, {:.3}, {:.3}]\nradius = {:.3}\nmaterial = \"{}\"",
            number(rng, -1.2, 1.2),
            number(rng, 0.3, 1.4),
            number(rng, -1.0, 1.0),
            number(rng, 0.2, 0.7),
            if rng.random::<bool>() { "a" } else { "b" }
        );
    }
    if count > 0 && rng.random::<bool>() {
        text += "[[plane]]\npoint = [0, -0.5, 0]\nnormal = [0, 1, 0]\nmaterial = \"b\"\n";
    }
    if count > 0 && once_in(rng, 6) {
        let _ = writeln!(
            text,
            "[[mesh]]\nfile = \"tetrahedron.obj\"\nmaterial = \"a\"\n[[mesh.instance]]\nscale = {:.3}\naxis = {}\n\
             rotate_deg = {:.1}\ntranslate = {}",
            number(rng, 0.3, 0.7),
            triple(rng, 0.1, 1.0),
            number(rng, 0.0, 360.0),
            triple(rng, -0.5, 1.0)
        );
    }
    if count > 1 && rng.random::<bool>() {
        text += "[[quad]]\ncenter = [0, 1, -2]\nu = [2, 0, 0]\nv = [0, 1.5, 0]\nmaterial = \"a\"\n";
    }
    text
}

/// Lights of all kinds, some of them or none.
fn lights(rng: &mut Stream) -> String {
    let mut text = String::new();
    let lights = rng.random_range(1..64u32);
    if lights & 1 == 1 {
        let _ = writeln!(
            text,
            "[[light.point]]\nposition = [{:.3}, 4, 3]\nintensity = [20, 15, 10]",
            number(rng, -3.0, 3.0)
        );
    }
    if lights & 2 == 2 {
        text += "[[light.directional]]\ntoward = [1, 2, 1]\nirradiance = [0.5, 1, 1.5]\n";
    }
    if lights & 4 == 4 {
        let (x, size) = (number(rng, -2.0, 2.0), number(rng, 0.2, 1.2));
        let _ = writeln!(
            text,
            "[[light.quad]]\ncenter = [{x:.3}, 3.5, 1]\nu = [{size:.3}, 0, 0.1]\nv = [0, 0, {size:.3}]\nradiance = [3, 4, 5]"
        );
    }
    if lights & 0b1_1000 == 0b1_1000 {
        let sky = if once_in(rng, 3) { "file = \"sky.exr\"" } else { "radiance = [0.3, 0.2, 0.4]" };
        let _ = writeln!(text, "[light.environment]\n{sky}");
    }
    if lights & 0b11_0000 == 0b11_0000 {
        text += "[[light.sphere]]\ncenter = [-3, 3, 2]\nradius = 0.4\nradiance = [5, 5, 5]\n";
    }
    if once_in(rng, 8) {
        let (x, inner, outer) = (number(rng, -2.0, 2.0), number(rng, 2.0, 10.0), number(rng, 12.0, 30.0));
        let _ = writeln!(
            text,
            "[[light.spot]]\nposition = [{x:.3}, 4, 2]\ndirection = [{:.3}, -3.3, -2]\nintensity = [30, 25, 20]\n\
             inner_deg = {inner:.1}\nouter_deg = {outer:.1}",
            -x
        );
    }
    text
}

/// What generated scenes ask for: a tetrahedron about the origin, and a sky of 8 × 4 pixels, one of them bright.
fn write_files(folder: &Path) {
    let tetrahedron = "v 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";
    std::fs::write(folder.join("tetrahedron.obj"), tetrahedron).expect("written");
    let pixel = |i: usize| if i == 10 { [5.0, 4.0, 3.0] } else { [0.1, 0.2, 0.03 * (i % 8) as f64] };
    let sky = Image { width: 8, height: 4, radiance: (0..32).map(pixel).collect(), ..Image::default() };
    std::fs::write(folder.join("sky.exr"), encode_exr(&sky).expect("encodes")).expect("written");
}

/// A generated scene, whose files lie in the folder.
fn build(text: &str, folder: &Path) -> Scene {
    let spec = SceneSpec::parse(text, "test").unwrap_or_else(|e| panic!("{e}\n{text}"));
    let materials = if spec.name == "opaque" { opaque(&spec, "a") } else { Materials::new() };
    Scene::build(&spec, folder, &materials).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The material of this name, of which the tracer doesn't know that it is a sum of lobes.
fn opaque(spec: &SceneSpec, name: &str) -> Materials {
    let own = &spec.materials[name];
    let phong = own.phong.iter().map(|lobe| (lobe.ks.to_vec(), lobe.n));
    let lobes = Reflectance::lobes(own.kd.unwrap_or_default().to_vec(), phong);
    Materials::from([(name.to_owned(), Material::Brdf(Arc::new(Opaque(Arc::new(lobes)))))])
}

#[test]
fn every_plan_shows_what_the_full_integrator_shows() {
    let folder = tempfile::tempdir().expect("folder");
    write_files(folder.path());
    let mut plans = BTreeSet::new();
    let mut rng = stream(11, Purpose::Study, 0);
    let cases = 80;
    for case in 0..cases {
        let text = generated(&mut rng);
        let built = build(&text, folder.path());
        let plan = Plan::of(&built);
        plans.insert([plan.shadows, plan.interreflection, plan.chance, plan.closed_forms, plan.packets]);
        let (by_plan, by_all) = (picture(&built, 24, 64, 2 * case), full(&built, 24, 64, 2 * case + 1));
        // 1 % for both tests of all cases together.
        let level = 0.005 / f64::from(cases as u32);
        same(&by_plan, &by_all, level, &format!("case {case}, {plan:?}\n{text}"));
    }
    assert!(plans.len() >= 10, "too few kinds of plans: {plans:?}");
    for k in 0..5 {
        assert!(plans.iter().any(|p| p[k]) && plans.iter().any(|p| !p[k]), "flag {k} is the same in all: {plans:?}");
    }
}

/// A box or a part of one, black pieces and balls in it, a lamp of one or two quads that touch, perhaps light from all around.
fn boxed(rng: &mut Stream) -> String {
    let mut text = format!(
        "version = 1\nname = \"boxed\"\nmax_bounces = {}\n[camera]\nposition = [0, 1, 2.8]\ntarget = [0, 0.9, 0]\nfov_deg = 50\n\
         [materials]\nnone = {{ black = true }}\nplain = {{ kd = {} }}\nother = {{ kd = {} }}\n\
         glossy = {{ kd = {}, phong = [{{ ks = {}, n = {:.1} }}] }}\n",
        rng.random_range(1..6u32),
        triple(rng, 0.2, 0.8),
        triple(rng, 0.2, 0.8),
        triple(rng, 0.05, 0.4),
        triple(rng, 0.1, 0.5),
        number(rng, 0.0, 120.0),
    );
    // Six walls that look inwards; the box is closed in half of the scenes.
    let walls = [
        "center = [0, 0, 1]\nu = [1, 0, 0]\nv = [0, 0, -2]",
        "center = [0, 2, 1]\nu = [1, 0, 0]\nv = [0, 0, 2]",
        "center = [0, 1, -1]\nu = [1, 0, 0]\nv = [0, 1, 0]",
        "center = [-1, 1, 1]\nu = [0, 0, -2]\nv = [0, 1, 0]",
        "center = [1, 1, 1]\nu = [0, 0, 2]\nv = [0, 1, 0]",
        "center = [0, 1, 3]\nu = [-1, 0, 0]\nv = [0, 1, 0]",
    ];
    let closed = rng.random::<bool>();
    for (k, wall) in walls.iter().enumerate() {
        if closed || k == 0 || rng.random_range(0..3u32) > 0 {
            let material = ["plain", "other", "plain", "glossy"][rng.random_range(0..4usize)];
            let _ = writeln!(text, "[[quad]]\n{wall}\nmaterial = \"{material}\"");
        }
    }
    for _ in 0..rng.random_range(0..3u32) {
        let (center, u, v) = (triple(rng, -0.5, 0.5), triple(rng, 0.1, 0.4), triple(rng, -0.4, -0.1));
        let _ = writeln!(text, "[[quad]]\ncenter = {center}\nu = {u}\nv = {v}\nmaterial = \"none\"");
    }
    for _ in 0..rng.random_range(0..3u32) {
        let material = ["plain", "glossy", "none"][rng.random_range(0..3usize)];
        let (x, y, r) = (number(rng, -0.5, 0.5), number(rng, 0.4, 1.2), number(rng, 0.15, 0.4));
        let _ = writeln!(
            text,
            "[[sphere]]\ncenter = [{x:.3}, {y:.3}, {:.3}]\nradius = {r:.3}\nmaterial = \"{material}\"",
            number(rng, -0.4, 0.8)
        );
    }
    let (x, size, height) = (number(rng, -0.3, 0.3), number(rng, 0.1, 0.4), number(rng, 1.5, 1.99));
    for k in 0..rng.random_range(1..3u32) {
        // The second lies beside the first, edge to edge.
        let z = 0.3 + 2.0 * size * f64::from(k);
        let _ = writeln!(
            text,
            "[[light.quad]]\ncenter = [{x:.3}, {height:.3}, {z:.6}]\nu = [{size:.3}, 0, 0]\nv = [0, 0, {size:.3}]\nradiance = [9, 8, {}]",
            4 + k
        );
    }
    if rng.random_range(0..3u32) == 0 {
        text += "[light.environment]\nradiance = [0.3, 0.2, 0.4]\n";
    }
    text
}

#[test]
fn boxes_lamps_and_black_pieces_look_as_by_the_full_integrator() {
    let mut plans = BTreeSet::new();
    let mut rng = stream(13, Purpose::Study, 0);
    let cases = 24;
    for case in 0..cases {
        let text = boxed(&mut rng);
        let built = scene(&text);
        let plan = Plan::of(&built);
        assert!(plan.packets, "{plan:?}");
        plans.insert([plan.shadows, plan.interreflection, plan.chance, plan.closed_forms]);
        let (by_plan, by_all) = (picture(&built, 32, 64, 2 * case), full(&built, 32, 64, 2 * case + 1));
        // 1 % for both tests of all cases together.
        let level = 0.005 / f64::from(cases as u32);
        same(&by_plan, &by_all, level, &format!("case {case}, {plan:?}\n{text}"));
    }
    assert!(plans.len() >= 2, "too few kinds of plans: {plans:?}");
}

/// Where nothing is left to chance but the point in the pixel, which both take alike.
#[test]
fn without_sampling_plans_agree_to_rounding() {
    let mut rng = stream(12, Purpose::Study, 0);
    for _ in 0..10 {
        let text = format!(
            "version = 1\nname = \"lone\"\nmax_bounces = 5\n[camera]\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\nfov_deg = 40\n\
             lens_radius = 0.1\n[materials]\na = {{ kd = {}, phong = [{{ ks = {}, n = {:.2} }}] }}\n[[sphere]]\ncenter = [0, 0, 0]\n\
             radius = 1\nmaterial = \"a\"\n[[light.point]]\nposition = {}\nintensity = [9, 8, 7]\n[[light.directional]]\n\
             toward = [1, 2, 3]\nirradiance = [1, 2, 3]\n",
            triple(&mut rng, 0.1, 0.5),
            triple(&mut rng, 0.1, 0.5),
            number(&mut rng, 0.0, 500.0),
            triple(&mut rng, 2.0, 4.0),
        );
        let built = scene(&text);
        let plan = Plan::of(&built);
        assert!(!plan.shadows && !plan.interreflection && !plan.chance && plan.packets, "{plan:?}");
        let (a, b) = (picture(&built, 32, 8, 1), full(&built, 32, 8, 1));
        let (mut far, pixels) = (0, (0..32).flat_map(|y| (0..32).map(move |x| (x, y))));
        for (x, y) in pixels {
            let (p, q) = (a.radiance(x, y).expect("pixel"), b.radiance(x, y).expect("pixel"));
            far += u32::from(excess(p, q, 1e-9 * q.abs() + DVec3::splat(1e-15)) > 1.0);
        }
        // A ray that just grazes the outline may miss it by rounding.
        assert!(far <= 1, "{far} pixels differ\n{text}");
    }
}

/// A floor, a tilted wall and two balls, which may cut each other, under a point and parallel light that they hide from
/// each other.
fn hard_shadows(rng: &mut Stream) -> String {
    let mut text = format!(
        "version = 1\nname = \"shadows\"\nmax_bounces = 1\n[camera]\nposition = [0, 2, 5]\ntarget = [0, 0.5, 0]\n\
         fov_deg = 40\nlens_radius = 0.1\n[materials]\na = {{ kd = {}, phong = [{{ ks = {}, n = {:.2} }}] }}\nb = {{ kd = {} }}\n\
         [[plane]]\npoint = [0, 0, 0]\nnormal = [0.05, 1, 0.02]\nmaterial = \"b\"\n\
         [[quad]]\ncenter = [{:.3}, 0.8, -1]\nu = [0.9, 0.1, {:.3}]\nv = [0.2, 0.7, {:.3}]\nmaterial = \"a\"\n\
         [[light.point]]\nposition = {}\nintensity = [9, 8, 7]\n[[light.directional]]\n\
         toward = [{:.3}, 2, 1.5]\nirradiance = [1, 2, 3]\n",
        triple(rng, 0.1, 0.5),
        triple(rng, 0.1, 0.5),
        number(rng, 0.0, 500.0),
        triple(rng, 0.1, 0.5),
        number(rng, -0.8, 0.8),
        number(rng, -0.5, 0.5),
        number(rng, -0.5, 0.5),
        triple(rng, 1.5, 3.0),
        number(rng, -2.0, 1.0)
    );
    for (x, material) in [(-0.6, "a"), (0.6, "b")] {
        let (x, y, z) = (x + number(rng, -0.3, 0.3), number(rng, 0.2, 0.8), number(rng, -0.5, 0.7));
        let _ = writeln!(
            text,
            "[[sphere]]\ncenter = [{x:.3}, {y:.3}, {z:.3}]\nradius = {:.3}\nmaterial = \"{material}\"",
            number(rng, 0.3, 0.6)
        );
    }
    text
}

/// One sample a pixel, so that no mean evens anything out. A point that lies within rounding of an outline or a shadow's edge,
/// 10⁻¹² of a pixel say, may fall on either side of it: hardly one of a million.
#[test]
fn without_sampling_hard_shadows_agree_to_rounding() {
    let mut rng = stream(16, Purpose::Study, 0);
    let (mut far, mut hidden, mut all) = (0, 0, 0);
    for _ in 0..20 {
        let text = hard_shadows(&mut rng);
        let built = scene(&text);
        let [derived, everything] = both_ways(&built);
        assert!(derived.shadows && !derived.interreflection && !derived.chance, "{derived:?}\n{text}");
        let of = |plan| picture_by(plan, &built, 48, 1, 1);
        let (by_plan, by_all, open) = (of(derived), of(everything), of(Plan { shadows: false, ..derived }));
        for (x, y) in (0..48).flat_map(|y| (0..48).map(move |x| (x, y))) {
            let [p, q, lit] = [&by_plan, &by_all, &open].map(|film| film.radiance(x, y).expect("pixel"));
            far += u32::from(excess(p, q, 1e-9 * q.abs() + DVec3::splat(1e-15)) > 1.0);
            hidden += u32::from(lit != p);
            all += 1;
        }
    }
    println!("{far} of {all} pixels differ, {hidden} have shadows");
    assert!(far <= 3, "{far} of {all} pixels differ");
    assert!(hidden > all / 50, "{hidden} of {all} pixels have shadows");
}

/// What has a closed form has no noise but that of the outline, and the value that sampling finds.
#[test]
fn closed_forms_leave_no_noise() {
    let lone = |material: &str, light: &str, [position, target]: [&str; 2]| {
        scene(&format!(
            "version = 1\nname = \"closed\"\nmax_bounces = 4\n[camera]\nposition = {position}\ntarget = {target}\nfov_deg = 1e-4\n\
             [materials]\na = {material}\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"a\"\n{light}"
        ))
    };
    let quad = "[[light.quad]]\ncenter = [1, 2, 2]\nu = [1, 0, 0]\nv = [0, -1, 1]\nradiance = [1, 2, 3]\n";
    let sky = "[light.environment]\nradiance = [1, 2, 3]\n";
    let diffuse = "{ kd = [0.5, 0.4, 0.3] }";
    let phong = "{ kd = [0.1, 0.2, 0.3], phong = [{ ks = [0.4, 0.3, 0.2], n = 30 }] }";
    let two =
        "{ kd = [0.1, 0.2, 0.3], phong = [{ ks = [0.3, 0.2, 0.2], n = 0.5 }, { ks = [0.2, 0.2, 0.3], n = 200 }] }";
    let middle = ["[0, 0, 3]", "[0, 0, 0]"];
    // The quad's centre lies in the mirror direction.
    let shining = ["[-1, -2, 2]", "[0, 0, 1]"];
    for (material, light, camera) in [
        (diffuse, quad, middle),
        (diffuse, sky, middle),
        (phong, sky, middle),
        (phong, quad, middle),
        (two, quad, shining),
    ] {
        let built = lone(material, light, camera);
        assert!(Plan::of(&built).closed_forms && !Plan::of(&built).chance);
        let (closed, noise) = mean(&picture(&built, 2, 64, 1));
        assert!(excess(noise, DVec3::ZERO, 1e-5 * closed) <= 1.0, "{noise} of {closed}");
        let (sampled, noise) = mean(&full(&built, 8, 4096, 2));
        assert!(excess(closed, sampled, 4.5 * noise + 1e-6 * closed) <= 1.0, "{closed} against {sampled} ± {noise}");
        assert!(noise.max_element() < 2e-3 * sampled.max_element(), "the check is sharp");
    }
    let sharp = lone("{ kd = [0.1, 0.2, 0.3], phong = [{ ks = [0.4, 0.3, 0.2], n = 2e4 }] }", quad, middle);
    assert!(!Plan::of(&sharp).closed_forms && Plan::of(&sharp).chance, "a lobe so sharp finds the light by chance");
}

/// A lamp that lies flush in a tilted surface, both facing the same way: its corners lie above or below the surface's horizon by rounding alone.
#[test]
fn hard_case_a_lamp_in_the_plane_of_a_surface_does_not_light_it() {
    let mut rng = stream(15, Purpose::Study, 0);
    for _ in 0..4 {
        // Two directions at right angles to each other, by turning x and z about random axes.
        let (a, b) = (number(&mut rng, -1.0, 1.0), number(&mut rng, -1.0, 1.0));
        let u = DVec3::new(1.0, a, b).normalize();
        let v = u.cross(DVec3::new(b, 1.0, a)).normalize();
        let at = |x: f64, y: f64| {
            let p = x * u + y * v;
            format!("[{}, {}, {}]", p.x, p.y, p.z)
        };
        let eye = 3.0 * u.cross(v);
        let text = format!(
            "version = 1\nname = \"flush\"\nmax_bounces = 1\n[camera]\nposition = [{}, {}, {}]\ntarget = [0, 0, 0]\nfov_deg = 20\n\
             [materials]\na = {{ kd = [0.5, 0.4, 0.3], phong = [{{ ks = [0.4, 0.3, 0.2], n = 5 }}] }}\n[[quad]]\ncenter = [0, 0, 0]\nu = {}\n\
             v = {}\nmaterial = \"a\"\n[[light.quad]]\ncenter = {}\nu = {}\nv = {}\nradiance = [1, 2, 3]\n",
            eye.x,
            eye.y,
            eye.z,
            at(1.0, 0.0),
            at(0.0, 1.0),
            at(2.5, 0.3),
            at(0.7, 0.0),
            at(0.0, 0.7),
        );
        let built = scene(&text);
        assert!(Plan::of(&built).closed_forms, "{text}");
        let seen = picture(&built, 32, 4, 1);
        for k in 0..32 * 32 {
            let radiance = seen.radiance(k % 32, k / 32).expect("a pixel");
            assert!(radiance.max_element() < 1e-9, "{radiance}\n{text}");
        }
    }
}

/// What nothing can hide: a ball under a quad that its horizon cuts, or a floor of pieces under two quads of one plane. Its materials are diffuse, with a blunt
/// and a glossy lobe, and, on the floor, with one too sharp for a closed form.
fn unhidden(rng: &mut Stream, ball: bool) -> String {
    let mut text = String::from(
        "version = 1\nname = \"unhidden\"\nmax_bounces = 3\n[camera]\nposition = [0, 2, 5]\ntarget = [0, 0, 0]\nfov_deg = 45\n[materials]\n",
    );
    let (blunt, glossy) = (number(rng, 0.0, 3.0), number(rng, 5.0, 900.0));
    for (k, exponents) in [&[blunt, glossy][..], &[], &[3e3]].into_iter().enumerate().take(if ball { 1 } else { 3 }) {
        let lobe = |n: &f64| format!("{{ ks = {}, n = {n:.2} }}", triple(&mut *rng, 0.1, 0.4));
        let lobes = exponents.iter().map(lobe).collect::<Vec<_>>().join(", ");
        let _ = writeln!(text, "m{k} = {{ kd = {}, phong = [{lobes}] }}", triple(rng, 0.05, 0.4));
    }
    if ball {
        text += "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1.5\nmaterial = \"m0\"\n";
    } else {
        for (k, x) in [-1.6, 0.0, 1.6].into_iter().enumerate() {
            let _ = writeln!(
                text,
                "[[quad]]\ncenter = [{x}, 0, 0]\nu = [0.8, 0, 0]\nv = [0, 0, -1.5]\nmaterial = \"m{k}\""
            );
        }
    }
    // Both face the camera and the floor, in the plane y = z + 3.
    for x in if ball { &[-1.0][..] } else { &[-1.5, 1.5] } {
        let (size, y) = (number(rng, 0.2, 1.0), number(rng, 1.4, 2.0));
        let _ = writeln!(
            text,
            "[[light.quad]]\ncenter = [{x}, {y}, {}]\nu = [{size:.3}, 0, 0]\nv = [0, {size:.3}, {size:.3}]\nradiance = [3, 4, 5]",
            y - 3.0
        );
    }
    text
}

#[test]
fn closed_forms_of_lobes_show_what_the_full_integrator_shows() {
    let mut rng = stream(14, Purpose::Study, 0);
    for case in 0..8 {
        let text = unhidden(&mut rng, case % 2 == 0);
        let built = scene(&text);
        let plan = Plan::of(&built);
        assert!(plan.packets && plan.closed_forms && plan.chance != (case % 2 == 0), "{plan:?}\n{text}");
        let (by_plan, by_all) = (picture(&built, 32, 64, 2 * case), full(&built, 32, 64, 2 * case + 1));
        // 1 % for both tests of all cases together.
        same(&by_plan, &by_all, 6e-4, &format!("case {case}\n{text}"));
    }
}

#[test]
fn a_plan_says_what_is_on_and_why() {
    let of = |name: &str| {
        let spec = goniofit::render::scene::builtin(name).expect("built in");
        let built =
            Scene::build(&spec, std::path::Path::new("."), &goniofit::render::Materials::new()).expect("builds");
        let plan = Plan::of(&built);
        (plan, plan.effects(&built))
    };
    let (sphere, words) = of("sphere");
    assert!(!sphere.shadows && !sphere.interreflection && !sphere.chance && sphere.packets);
    assert!(words.effects.iter().all(|e| !e.why.is_empty()));
    let (plane, _) = of("sphere-on-plane");
    assert!(plane.shadows && plane.interreflection && plane.chance);
    let (furnace, _) = of("furnace");
    assert!(furnace.closed_forms && !furnace.chance && !furnace.shadows);
    let (mesh, _) = of("mesh-env");
    assert!(mesh.shadows && !mesh.packets);
}
