//! The cases that break tracers, one test each: no pixel that is not finite, no acne, no leaks, and within the confidence of what
//! the picture must be: a closed form, or the same picture made in another way.
//! Others stand with what they concern: `render_furnace.rs` (directional albedo), `render_lights.rs` and `render_environment.rs` (lobes of
//! exponent 10⁶ under small lights and suns), `render_mesh.rs` (closed meshes).

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::Path;

use common::{both_ways, excess, mean, one_pixel_by, picture, picture_by, scene, spot_camera, toml, transformed};
use glam::DVec3;
use goniofit::control::Control;
use goniofit::geometry::{Frame, direction};
use goniofit::image::compare;
use goniofit::render::scene::builtin;
use goniofit::render::{Film, Materials, Options, Plan, Scene, SceneSpec, Strategy, render};

fn build(spec: &SceneSpec, folder: &Path) -> Scene {
    Scene::build(spec, folder, &Materials::new()).unwrap_or_else(|e| panic!("{e}"))
}

fn build_text(text: &str, folder: &Path) -> Scene {
    build(&SceneSpec::parse(text, "test").unwrap_or_else(|e| panic!("{e}\n{text}")), folder)
}

/// Two pictures of one thing: every sample is finite, and no pixel and no block of pixels differs by more than its noise, at 1 % for
/// all pixels × channels and blocks together.
fn same(a: &Film, b: &Film, what: &str) {
    assert_eq!((a.not_finite, b.not_finite), (0, 0), "{what}");
    let (a, b) = (a.to_image(), b.to_image());
    match compare(&a, &b).expect("of one size").significance {
        Some(found) => assert!(!found.differs && found.pixels_differing == 0, "{what}: {found:?}"),
        None => assert_eq!(a.radiance, b.radiance, "{what}: without noise"),
    }
}

#[test]
fn hard_case_a_scene_scaled_by_1e_minus_4_to_1e6_and_moved_by_1e6() {
    let here = Path::new(".");
    let far = DVec3::new(-1e6, 3e5, 1e6);
    for name in ["sphere", "sphere-on-plane", "cornell"] {
        let plain = picture(&build(&builtin(name).expect("built in"), here), 48, 64, 1);
        for (scale, moved) in [(1e-4, DVec3::ZERO), (1e-4, DVec3::X), (1e6, DVec3::ZERO), (1e6, far), (1.0, far)] {
            let built = build(&transformed(name, scale, moved), here);
            for plan in both_ways(&built) {
                let what = format!("{name} × {scale:e} + {moved}, packets {}", plan.packets);
                same(&picture_by(plan, &built, 48, 64, 2), &plain, &what);
            }
        }
    }
    let plain = picture(&build(&builtin("mesh-env").expect("built in"), here), 48, 64, 1);
    for (scale, moved) in [(1e-4, DVec3::ZERO), (1e6, DVec3::ZERO), (1.0, far)] {
        let mut spec = transformed("mesh-env", scale, moved);
        let place = format!("scale = {scale:?}\ntranslate = {}", toml(moved));
        spec.meshes[0].instances = vec![toml::from_str(&place).expect("a placement")];
        same(&picture(&build(&spec, here), 48, 64, 2), &plain, &format!("mesh-env × {scale:e} + {moved}"));
    }
}

/// An OBJ file.
fn obj(folder: &Path, name: &str, points: &[DVec3], faces: &[[usize; 3]]) {
    let mut text = String::new();
    points.iter().for_each(|p| writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z).expect("text"));
    faces.iter().for_each(|[a, b, c]| writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("text"));
    std::fs::write(folder.join(name), text).expect("written");
}

/// The square [−2, 2]² at y = 0 in 2·`n` needles from edge to edge, or as fans of `n` needles about a corner.
fn needles(n: usize, fan: bool) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let at = |i: usize| 4.0 * i as f64 / n as f64 - 2.0;
    if !fan {
        let points = (0..=n).flat_map(|i| [DVec3::new(at(i), 0.0, -2.0), DVec3::new(at(i), 0.0, 2.0)]).collect();
        let faces = (0..n).flat_map(|i| [[2 * i, 2 * i + 1, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 2]]).collect();
        return (points, faces);
    }
    let sides = (0..=n).map(|i| DVec3::new(at(i), 0.0, 2.0)).chain((0..n).rev().map(|i| DVec3::new(2.0, 0.0, at(i))));
    let points: Vec<DVec3> = std::iter::once(DVec3::new(-2.0, 0.0, -2.0)).chain(sides).collect();
    let faces = (1..points.len() - 1).map(|i| [0, i, i + 1]).collect();
    (points, faces)
}

#[test]
fn hard_case_needle_triangles() {
    // A floor of needles 2·10⁻⁴ wide and 4 long, and of needles that all meet in a corner, over a lamp of 10⁶: one ray through a seam
    // would show.
    let folder = tempfile::tempdir().expect("folder");
    let world = |floor: &str| {
        format!(
            "version = 1\nname = \"needles\"\nmax_bounces = 3\n[camera]\nposition = [0.3, 1.5, 2.5]\ntarget = [0, 0.2, 0]\nfov_deg = 40\n\
             [materials]\nm = {{ kd = [0.8, 0.5, 0.2] }}\n{floor}\
             [[sphere]]\ncenter = [0, 0.5, 0]\nradius = 0.5\nmaterial = \"m\"\n\
             [[light.point]]\nposition = [1, 3, 2]\nintensity = [9, 9, 9]\n\
             [[light.quad]]\ncenter = [0, -0.1, 0]\nu = [0, 0, 1.5]\nv = [1.5, 0, 0]\nradiance = [1e6, 1e6, 1e6]\n"
        )
    };
    let quad = "[[quad]]\ncenter = [0, 0, 0]\nu = [0, 0, 2]\nv = [2, 0, 0]\nmaterial = \"m\"\n";
    let want = picture(&build_text(&world(quad), folder.path()), 64, 64, 1);
    for fan in [false, true] {
        // A fan's boxes overlap, so that a ray meets most of them: fewer.
        let (points, faces) = needles(if fan { 500 } else { 20_000 }, fan);
        obj(folder.path(), "floor.obj", &points, &faces);
        let built = build_text(&world("[[mesh]]\nfile = \"floor.obj\"\nmaterial = \"m\"\n"), folder.path());
        same(&picture(&built, 64, 64, 2), &want, if fan { "fan" } else { "strips" });
    }
}

#[test]
fn hard_case_coincident_surfaces() {
    // A plane, a quad and two triangles in one plane, each alone and together, tilted and off the origin so that they are rounded
    // differently; parallel light: every pixel is the closed form, and a shadow of one on another would be a black one.
    let folder = tempfile::tempdir().expect("folder");
    let frame = Frame::from_normal(direction(0.7, 0.4));
    let center = DVec3::new(3.1, -2.7, 1.3);
    let at = |x: f64, y: f64| center + frame.to_world(DVec3::new(x, y, 0.0));
    let (u, v) = (at(50.0, 0.0) - center, at(0.0, 50.0) - center);
    obj(folder.path(), "two.obj", &[at(-60.0, -60.0), at(60.0, -60.0), at(0.0, 70.0)], &[[0, 1, 2]]);
    let shapes = [
        format!("[[plane]]\npoint = {}\nnormal = {}\nmaterial = \"m\"\n", toml(at(1.7, 0.3)), toml(frame.normal)),
        format!("[[quad]]\ncenter = {}\nu = {}\nv = {}\nmaterial = \"m\"\n", toml(center), toml(u), toml(v)),
        "[[mesh]]\nfile = \"two.obj\"\nmaterial = \"m\"\n".to_owned(),
        "[[mesh]]\nfile = \"two.obj\"\nmaterial = \"m\"\n[[mesh.instance]]\nrotate_deg = 0.0\n".to_owned(),
    ];
    let together =
        [vec![0], vec![1], vec![2], vec![3], vec![0, 1], vec![1, 2], vec![0, 2], vec![2, 3], vec![0, 1, 2, 3]];
    let (theta, kd) = (1.1, DVec3::new(0.8, 0.5, 0.2));
    let toward = frame.to_world(direction(theta, 2.0));
    let want = kd / PI * theta.cos();
    for chosen in together {
        let world: String = chosen.iter().map(|i| shapes[*i].as_str()).collect();
        let text = format!(
            "version = 1\nname = \"coincident\"\nmax_bounces = 2\n\
             [camera]\nposition = {}\ntarget = {}\nfov_deg = 40\n[materials]\nm = {{ kd = {} }}\n{world}\
             [[light.directional]]\ntoward = {}\nirradiance = [1, 1, 1]\n",
            toml(center + frame.to_world(DVec3::new(2.0, 3.0, 4.0))),
            toml(center),
            toml(kd),
            toml(toward)
        );
        let film = picture(&build_text(&text, folder.path()), 64, 16, 1);
        for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x, y))) {
            let got = film.radiance(x, y).expect("a pixel");
            assert!(excess(got, want, 1e-9 * want) <= 1.0, "shapes {chosen:?}, pixel {x} {y}: {got} vs {want}");
        }
    }
}

#[test]
fn hard_case_a_light_that_touches_the_surface() {
    // Upright with an edge on the floor; through the floor; in the floor's plane, up and down; touching the ball; inside it.
    let lights = [
        ("edge on the floor", [0.0, 0.5, -1.5], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]),
        ("through the floor", [0.0, 0.25, -1.5], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]),
        ("in the floor, up", [1.5, 0.0, 0.0], [0.0, 0.0, 0.5], [0.5, 0.0, 0.0]),
        ("in the floor, down", [1.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]),
        ("on the ball's top", [0.0, 2.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]),
        ("cutting the ball", [0.0, 1.0, 0.0], [0.0, 0.0, 1.5], [0.0, 1.5, 0.0]),
    ];
    for (what, center, u, v) in lights {
        let mut spec = builtin("sphere-on-plane").expect("built in");
        let light = &mut spec.lights.quad[0];
        (light.center, light.u, light.v, light.radiance) = (center, u, v, [1.0; 3]);
        spec.max_bounces = 3;
        let built = build(&spec, Path::new("."));
        let of = |strategy, samples, seed| {
            let options = Options { width: 32, height: 32, samples, seed, strategy, ..Options::default() };
            render(&built, &options, Control::silent()).expect("renders")
        };
        let both = of(Strategy::Combined, 256, 1);
        // Nothing reflects more than it gets, and no light is brighter.
        assert!(both.to_image().radiance.iter().flatten().all(|x| (0.0..=1.0 + 1e-6).contains(x)), "{what}");
        same(&both, &of(Strategy::LightsOnly, 256, 2), what);
        // Found by chance the light is rare in some pixels, too rare for a test of each: the whole picture tells.
        let by_chance = of(Strategy::MaterialOnly, 1024, 3);
        let found = compare(&both.to_image(), &by_chance.to_image()).expect("of one size").significance;
        assert!(found.is_none_or(|found| !found.blocks.differs) && by_chance.not_finite == 0, "{what}");
    }
}

#[test]
fn hard_case_a_camera_inside_a_sphere() {
    let world = |height: f64, look: f64| {
        format!(
            "version = 1\nname = \"inside\"\nmax_bounces = 4\n\
             [camera]\nposition = [0, {height:?}, 0]\ntarget = [0, {:?}, 0]\nup = [1, 0, 0]\nfov_deg = 90\n\
             [materials]\nm = {{ kd = [0.8, 0.5, 0.2] }}\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n\
             [[light.directional]]\ntoward = [0, 1, 0]\nirradiance = [1, 1, 1]\n[light.environment]\nradiance = [1e20, 1e20, 1e20]\n",
            height + look
        )
    };
    // Anywhere inside, even where the wall is an ulp away, the inside of a sphere is black.
    for height in [0.0, 0.9, 1.0 - 1e-9, 1.0f64.next_down()] {
        for look in [1.0, -1.0] {
            let built = scene(&world(height, look));
            for plan in both_ways(&built) {
                let film = picture_by(plan, &built, 32, 4, 1);
                let found = (film.not_finite, mean(&film).0);
                assert_eq!(found, (0, DVec3::ZERO), "height {height:?}, look {look}, packets {}", plan.packets);
            }
        }
    }
    // Outside it is lit, however near: the top under parallel light from above.
    for gap in [1e-3, 1e-6, 1e-9, 1e-12] {
        let lit = scene(&world(1.0 + gap, -1.0).replace("[1e20, 1e20, 1e20]", "[0, 0, 0]"));
        let want = DVec3::new(0.8, 0.5, 0.2) / PI;
        // What is seen lies within 2·gap of the top: the cosine there is at least 1 − 2·gap².
        let bound = (2.0 * gap * gap + 1e-9) * want;
        for plan in both_ways(&lit) {
            let film = picture_by(plan, &lit, 16, 16, 1);
            for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
                let got = film.radiance(x, y).expect("a pixel");
                assert!(excess(got, want, bound) <= 1.0, "gap {gap:e}, packets {}: {got} vs {want}", plan.packets);
            }
        }
    }
}

/// A closed box [−1, 1] × [−1, 1] × [−1, 3] of quads, or of triangles, their lit sides outward.
fn closed_box(folder: &Path, of_quads: bool) -> String {
    let sides = [
        ([0, 1, 1], [1, 0, 0], [0, 0, -2]),
        ([0, -1, 1], [1, 0, 0], [0, 0, 2]),
        ([1, 0, 1], [0, 1, 0], [0, 0, 2]),
        ([-1, 0, 1], [0, 0, 2], [0, 1, 0]),
        ([0, 0, 3], [1, 0, 0], [0, 1, 0]),
        ([0, 0, -1], [0, 1, 0], [1, 0, 0]),
    ];
    if of_quads {
        let quad = |(c, u, v): ([i32; 3], [i32; 3], [i32; 3])| {
            format!("[[quad]]\ncenter = {c:?}\nu = {u:?}\nv = {v:?}\nmaterial = \"m\"\n")
        };
        return sides.map(quad).concat();
    }
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for (c, u, v) in sides {
        let [c, u, v] = [c, u, v].map(|p| DVec3::from(p.map(f64::from)));
        let first = points.len();
        points.extend([c - u - v, c + u - v, c + u + v, c - u + v]);
        faces.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    obj(folder, "box.obj", &points, &faces);
    "[[mesh]]\nfile = \"box.obj\"\nmaterial = \"m\"\n".into()
}

#[test]
fn hard_case_grazing_rays_along_an_edge() {
    // A closed box in light of 10²⁰, looked at from inside along its edges and corners: one ray that slips out would show.
    let folder = tempfile::tempdir().expect("folder");
    for of_quads in [true, false] {
        let walls = closed_box(folder.path(), of_quads);
        for gap in [0.0, 1e-15, 1e-9, 1e-3] {
            for (from, to) in [
                ([1.0 - gap, -1.0 + gap, 2.9], [1.0, -1.0, -1.0]),
                ([0.3, 1.0 - gap, -1.0 + gap], [-1.0, 1.0, -1.0]),
                ([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
                ([0.1, 0.2, 0.3], [-1.0, -1.0, 3.0]),
            ] {
                for fov in [60.0, 1e-3, 1e-9] {
                    let text = format!(
                        "version = 1\nname = \"edge\"\nmax_bounces = 3\n\
                         [camera]\nposition = {from:?}\ntarget = {to:?}\nup = [0.1, 0.9, 0.3]\nfov_deg = {fov:?}\n\
                         [materials]\nm = {{ kd = [0.8, 0.5, 0.2] }}\n{walls}[light.environment]\nradiance = [1e20, 1e20, 1e20]\n"
                    );
                    // On the wall itself, gap 0, it is a matter of taste what is seen; it must be a number.
                    let film = picture(&build_text(&text, folder.path()), 48, 4, 1);
                    let black = gap == 0.0 || mean(&film).0 == DVec3::ZERO;
                    assert!(
                        black && film.not_finite == 0,
                        "quads {of_quads}, gap {gap:e}, fov {fov:e}, {from:?}: light inside"
                    );
                }
            }
        }
    }
}

#[test]
fn hard_case_a_floor_seen_along_its_own_plane_has_no_acne() {
    // Parallel light, which leaves no noise: a floor seen at grazing angles down to 10⁻⁷ is the closed form in every pixel that is
    // all floor, as a plane, as a quad and as triangles.
    let folder = tempfile::tempdir().expect("folder");
    let corners = [[-1e3, 0.0, 1e3], [1e3, 0.0, 1e3], [1e3, 0.0, -1e3], [-1e3, 0.0, -1e3]].map(DVec3::from);
    obj(folder.path(), "floor.obj", &corners, &[[0, 1, 2], [0, 2, 3]]);
    let floors = [
        "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n",
        "[[quad]]\ncenter = [0, 0, 0]\nu = [0, 0, 1e3]\nv = [1e3, 0, 0]\nmaterial = \"m\"\n",
        "[[mesh]]\nfile = \"floor.obj\"\nmaterial = \"m\"\n",
    ];
    let toward = DVec3::new(0.9, 1e-3, 0.4).normalize();
    let want = DVec3::new(0.8, 0.5, 0.2) / PI * toward.y;
    for floor in floors {
        for height in [1e-1, 1e-3, 1e-6] {
            let camera = spot_camera(DVec3::new(0.0, height, 0.0), DVec3::new(3.0, 0.0, 10.0), 2);
            let text = format!(
                "{camera}[materials]\nm = {{ kd = [0.8, 0.5, 0.2] }}\n{floor}[[light.directional]]\ntoward = {}\nirradiance = [1, 1, 1]\n",
                toml(toward)
            )
            .replace("fov_deg = 1e-5", "fov_deg = 1e-7");
            let film = picture(&build_text(&text, folder.path()), 16, 16, 1);
            for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
                let got = film.radiance(x, y).expect("a pixel");
                assert!(excess(got, want, 1e-9 * want) <= 1.0, "height {height:e}: {got} vs {want}\n{floor}");
            }
        }
    }
}

/// ∫ (n+2)/(2π) cosⁿα cosθ dω over a square light of half-edge `h` at `distance` in the mirror direction, facing the point at the
/// origin; θ is the light's angle to the normal, the light being small beside it.
fn lobe_over_square(n: f64, h: f64, distance: f64, cos: f64) -> f64 {
    const STEPS: u32 = 2000;
    // Beyond this tangent cosⁿα < e⁻⁴⁰.
    let reach = (h / distance).min((80.0 / n).sqrt());
    let step = |i: u32| reach * (2.0 * (f64::from(i) + 0.5) / f64::from(STEPS) - 1.0);
    let mut sum = 0.0;
    for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
        let r2 = step(i) * step(i) + step(j) * step(j); // tan²α, and dω = cos³α dA
        sum += (-0.5 * (n + 3.0) * r2.ln_1p()).exp();
    }
    (n + 2.0) / TAU * cos * sum * (2.0 * reach / f64::from(STEPS)).powi(2)
}

#[test]
fn hard_case_a_lobe_of_exponent_1e6_under_a_small_square_light() {
    let (n, cos) = (1e6, f64::sqrt(0.5));
    let toward = DVec3::new(cos, cos, 0.0);
    let (u, v) = (DVec3::new(cos, -cos, 0.0), DVec3::Z);
    for h in [1e-4, 1e-3, 1e-2, 3e-2, 0.3] {
        let text = format!(
            "{}[materials]\nm = {{ phong = [{{ ks = [1, 0.5, 0.1], n = 1e6 }}] }}\n\
             [[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n\
             [[light.quad]]\ncenter = {}\nu = {}\nv = {}\nradiance = [1, 1, 1]\n",
            spot_camera(DVec3::new(-1.0, 1.0, 0.0), DVec3::ZERO, 1),
            toml(10.0 * toward),
            toml(h * u),
            toml(h * v)
        );
        let built = scene(&text);
        let want = DVec3::new(1.0, 0.5, 0.1) * lobe_over_square(n, h, 10.0, cos);
        for plan in both_ways(&built) {
            let (got, noise) = one_pixel_by(plan, &built, 20_000);
            let what = format!("half-edge {h:e}, packets {}", plan.packets);
            // cosθ varies over the lobe or the light by its slope, whose mean is 0, and by half its square.
            let bound = 5.0 * noise + (1e-5 + 1e-3 * h) * want;
            assert!(excess(got, want, bound) <= 1.0, "{what}: {got} ± {noise} vs {want}");
            assert!((noise / got).max_element() < 0.05, "{what}: noise {noise} of {got}");
        }
    }
}

#[test]
fn hard_case_near_mirror_interreflection() {
    // Between two near-mirrors one above the other, at 45°: ten reflections, then a lamp. Each multiplies by ks (n+2)/(n+1) cosθ, and
    // beyond the fifth chance ends paths. The lobes' widths add up to 3·10⁻³, the lamp is 40 times wider.
    let mirrors = "[materials]\nm = { phong = [{ ks = [0.95, 0.9, 0.5], n = 1e6 }] }\n\
                   [[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n\
                   [[plane]]\npoint = [0, 1, 0]\nnormal = [0, -1, 0]\nmaterial = \"m\"\n";
    let lamp = "[[light.quad]]\ncenter = [10, 0.5, 0]\nu = [0, 0, 1]\nv = [0, 0.5, 0]\nradiance = [1e5, 1e5, 1e5]\n";
    let of = |bounces| {
        let camera = spot_camera(DVec3::new(0.0, 0.5, 0.0), DVec3::new(1.0, -0.5, 0.0), bounces);
        scene(&format!("{camera}{mirrors}{lamp}"))
    };
    let each = DVec3::new(0.95, 0.9, 0.5) * (1e6 + 2.0) / (1e6 + 1.0) * f64::sqrt(0.5);
    let want = 1e5 * each.powf(10.0);
    let (enough, too_few) = (of(20), of(9));
    for plan in both_ways(&enough) {
        let (got, noise) = one_pixel_by(plan, &enough, 200_000);
        assert!(excess(got, want, 5.0 * noise + 1e-4 * want) <= 1.0, "{plan:?}: {got} ± {noise} vs {want}");
        assert!((noise / got).x < 0.05, "{plan:?}: {got} ± {noise}");
    }
    // One reflection fewer than it takes: nothing arrives, but for the tail of lobes that skips one.
    for plan in both_ways(&too_few) {
        let (dark, _) = one_pixel_by(plan, &too_few, 10_000);
        assert!(dark.max_element() <= 1e-6 * want.max_element(), "{plan:?}: {dark} vs {want}");
    }
}

#[test]
fn hard_case_near_mirrors_at_a_right_angle() {
    // Light comes back the way that it came: two reflections of the surround.
    for theta in [0.3, 0.8, 1.3f64] {
        let at = DVec3::new(1.0, 0.0, 0.0);
        let built = scene(&format!(
            "{}[materials]\nm = {{ phong = [{{ ks = [0.95, 0.9, 0.5], n = 1e6 }}] }}\n\
             [[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n\
             [[plane]]\npoint = [0, 0, 0]\nnormal = [1, 0, 0]\nmaterial = \"m\"\n[light.environment]\nradiance = [1, 1, 1]\n",
            spot_camera(at + 3.0 * DVec3::new(theta.sin(), theta.cos(), 0.0), at, 2)
        ));
        let once = DVec3::new(0.95, 0.9, 0.5) * (1e6 + 2.0) / (1e6 + 1.0);
        let want = once * once * theta.sin() * theta.cos();
        for plan in both_ways(&built) {
            let (got, noise) = one_pixel_by(plan, &built, 20_000);
            // The slopes of the two cosines go together: (10⁻³)², and the same for their squares.
            let bound = 5.0 * noise + 1e-5 * want;
            assert!(excess(got, want, bound) <= 1.0, "θ {theta}, {plan:?}: {got} ± {noise} vs {want}");
        }
    }
}

/// A floor with a ball under one light of a kind, of this strength, or under none.
fn under(kind: &str, gain: f64) -> String {
    let color = format!("[{:?}, {:?}, 0]", gain, 2.0 * gain);
    let light = match kind {
        "point" => format!("[[light.point]]\nposition = [1, 3, 2]\nintensity = {color}\n"),
        "directional" => format!("[[light.directional]]\ntoward = [1, 2, 1]\nirradiance = {color}\n"),
        "spot" => format!(
            "[[light.spot]]\nposition = [1, 4, 2]\ndirection = [-1, -4, -2]\nintensity = {color}\ninner_deg = 10\nouter_deg = 30\n"
        ),
        "quad" => format!("[[light.quad]]\ncenter = [0, 4, 0]\nu = [1, 0, 0]\nv = [0, 0, 1]\nradiance = {color}\n"),
        "sphere" => format!("[[light.sphere]]\ncenter = [2, 4, 2]\nradius = 0.5\nradiance = {color}\n"),
        "environment" => format!("[light.environment]\nradiance = {color}\n"),
        _ => String::new(),
    };
    format!(
        "version = 1\nname = \"strength\"\nmax_bounces = 8\n[camera]\nposition = [0, 2.5, 6]\ntarget = [0, 0.8, 0]\nfov_deg = 40\n\
         [materials]\nball = {{ kd = [0.3, 0.3, 0.3], phong = [{{ ks = [0.5, 0.5, 0.5], n = 1e3 }}] }}\nfloor = {{ kd = [0.4, 0.4, 0.4] }}\n\
         [[sphere]]\ncenter = [0, 1, 0]\nradius = 1\nmaterial = \"ball\"\n[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"floor\"\n{light}"
    )
}

const KINDS: [&str; 6] = ["point", "directional", "spot", "quad", "sphere", "environment"];

/// What the scene calls for, by packets where they can walk through it, and everything one path at a time.
fn plans(scene: &Scene) -> [Plan; 2] {
    [Plan::of(scene), Plan::FULL]
}

/// Every value and standard error of a picture is that of another times `gain`.
fn scales(scaled: &Film, plain: &Film, gain: f64, what: &str) {
    assert_eq!(scaled.not_finite, 0, "{what} × {gain:e}");
    let (scaled, plain) = (scaled.to_image(), plain.to_image());
    let errors = scaled.standard_error.iter().flatten().zip(plain.standard_error.iter().flatten());
    for (got, want) in scaled.radiance.iter().zip(&plain.radiance).chain(errors) {
        for c in 0..3 {
            assert!(
                (got[c] - gain * want[c]).abs() <= 1e-6 * gain * (want[c] + 1e-9), // an error may be rounding alone
                "{what} × {gain:e}: {got:?}, {want:?}"
            );
        }
    }
}

#[test]
fn hard_case_lights_of_1e_minus_20_and_1e20() {
    for kind in KINDS {
        let [one, weak, strong] = [1.0, 1e-20, 1e20].map(|gain| scene(&under(kind, gain)));
        for plan in plans(&one) {
            let what = format!("{kind}, {plan:?}");
            let plain = picture_by(plan, &one, 16, 16, 2);
            assert!(mean(&plain).0.x > 1e-3, "{what}");
            scales(&picture_by(plan, &weak, 16, 16, 2), &plain, 1e-20, &what);
            scales(&picture_by(plan, &strong, 16, 16, 2), &plain, 1e20, &what);
        }
    }
}

#[test]
fn hard_case_no_light_at_all() {
    let built = scene(&under("none", 1.0));
    for plan in both_ways(&built) {
        let film = picture_by(plan, &built, 32, 16, 2);
        assert!(film.to_image().radiance.iter().flatten().all(|x| *x == 0.0), "{plan:?}");
        assert_eq!((film.not_finite, mean(&film)), (0, (DVec3::ZERO, DVec3::ZERO)), "{plan:?}");
    }
}

#[test]
fn hard_case_a_black_scene_and_lights_of_zero() {
    for kind in KINDS {
        let dark = scene(&under(kind, 0.0));
        let black = under(kind, 1.0)
            .replace(
                "kd = [0.3, 0.3, 0.3], phong = [{ ks = [0.5, 0.5, 0.5], n = 1e3 }]",
                "kd = [0, 0, 0], phong = [{ ks = [0, 0, 0], n = 1e3 }]",
            )
            .replace("kd = [0.4, 0.4, 0.4]", "black = true");
        let black = scene(&black);
        for plan in plans(&dark) {
            let film = picture_by(plan, &dark, 16, 16, 2);
            assert_eq!((film.not_finite, mean(&film)), (0, (DVec3::ZERO, DVec3::ZERO)), "{kind}, {plan:?}");
        }
        for plan in plans(&black) {
            let film = picture_by(plan, &black, 16, 16, 2);
            // The lower half sees nothing but the ball and the floor.
            for (x, y) in (8..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
                assert_eq!(film.radiance(x, y), Some(DVec3::ZERO), "{kind}, {plan:?}, pixel {x} {y}");
            }
            assert_eq!(film.not_finite, 0, "{kind}, {plan:?}");
        }
    }
}
