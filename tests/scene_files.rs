//! Scene files: the built-in ones come back from TOML, and every broken one says where and why.

#![allow(clippy::expect_used)] // these are tests

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use goniofit::brdf::Reflectance;
use goniofit::control::Control;
use goniofit::render::scene::{BUILT_IN, builtin};
use goniofit::render::{Material, Materials, Options, RenderError, Scene, SceneSpec, render};

#[test]
fn built_in_scenes_build_and_survive_a_round_trip() {
    for scene in BUILT_IN {
        let spec = builtin(scene.name).expect("built in");
        assert_eq!(spec.name, scene.name);
        assert!(spec.subject.as_ref().is_some_and(|subject| spec.materials.contains_key(subject)));
        let text = toml::to_string(&spec).expect("written");
        assert_eq!(SceneSpec::parse(&text, scene.name).expect("read"), spec);
        assert!(Scene::build(&spec, Path::new("."), &Materials::new()).is_ok());
    }
    let error = builtin("teapot").expect_err("no such scene").to_string();
    assert!(error.contains("`teapot`") && error.contains("`cornell`"), "{error}");
}

#[test]
fn every_broken_scene_says_where_and_why() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data-fixtures/invalid/scenes");
    let expected = [
        ("newer-version", "`version` is 2, but must be 1"),
        ("field-of-view-180", "`camera.fov_deg` is 180.0, but must be above 0 and below 180"),
        ("unknown-key", "line 8, column 1: unknown field `fov`"),
        ("camera-looks-nowhere", "`camera.target` is [0.0, 0.0, 4.0]"),
        ("camera-up-along-view", "`camera.up` is [0.0, 0.0, 2.0]"),
        ("negative-radius", "`sphere[0].radius` is -1.0"),
        ("text-for-a-number", "line 15, column 10"),
        ("two-coordinates", "line 14, column 10"),
        (
            "unknown-material",
            "`sphere[0].material` is \"bull\", but must be the name of a material of this scene: `ball`",
        ),
        ("unknown-subject", "`subject` is \"teapot\""),
        ("two-kinds-of-material", "`materials.ball` is 2 kinds of material, but must be exactly one of"),
        ("negative-exponent", "`materials.ball.phong[0].n` is -2.0, but must be from 0 to 1e8"),
        ("negative-light", "`light.point[0].intensity` is [100.0, -1.0, 100.0]"),
        ("infinite-light", "`light.point[0].intensity` is [inf, 1.0, 1.0]"),
        ("not-toml", "line 5, column"),
        ("quad-without-area", "`quad[0].v` is [-2.0, 0.0, 0.0], but must be a direction other than that of `u`"),
        ("plane-without-normal", "`plane[0].normal` is [0.0, 0.0, 0.0]"),
        ("no-pixels", "`film.resolution` is [0, 512]"),
        ("no-samples", "`film.samples` is 0"),
        (
            "environment-of-two-kinds",
            "`light.environment` is 2 kinds of environment, but must be exactly one of `radiance`",
        ),
        ("environment-scale-negative", "`light.environment.scale` is -2.0, but must be a finite number of at least 0"),
        ("spot-angles-swapped", "`light.spot[0].inner_deg` is 40.0, but must be from 0 to `outer_deg`"),
        ("sphere-light-without-size", "`light.sphere[0].radius` is 0.0, but must be a finite number above 0"),
        ("mesh-light-negative", "`light.mesh[0].radiance` is [1.0, -1.0, 1.0]"),
        ("mesh-of-nothing", "`mesh[0]` is neither, but must be either a `file` or a `builtin`"),
        (
            "variant-of-nothing",
            "`materials.third.variant.of` is \"bull\", but must be the name of a material of this scene that is no variant",
        ),
        ("variant-of-a-variant", "`materials.third.variant.of` is \"other\""),
        ("variant-scaled-up", "`materials.third.variant.scale` is Some(1.5), but must be from 0 to 1"),
        ("variant-exponent-negative", "`materials.third.variant.exponent` is Some(-1.0), but must be from 0 to 1e8"),
        (
            "mesh-without-vertex-normals",
            "`mesh[0].normals` is Vertex, but must be \"face\" for a mesh without vertex normals",
        ),
        ("instance-without-size", "`mesh[0].instance[0].scale` is 0.0, but must be a finite number above 0"),
    ];
    for (name, words) in expected {
        let path = folder.join(format!("{name}.toml"));
        let message = SceneSpec::read(&path).expect_err(name).to_string();
        assert!(message.contains(words) && message.contains(&format!("{name}.toml")), "{name}: {message}");
    }
    let files = std::fs::read_dir(&folder).expect("folder").count();
    assert_eq!(files, expected.len(), "every fixture is tested");
}

/// Mean radiance of the balls of the sweep, from left to right.
fn balls(subject: Option<Material>) -> Vec<DVec3> {
    let spec = builtin("gradient-sweep").expect("built in");
    let materials: Materials = subject.into_iter().map(|material| ("ball".to_owned(), material)).collect();
    let built = Scene::build(&spec, Path::new("."), &materials).expect("builds");
    let options = Options { width: 240, height: 60, samples: 4, seed: 1, ..Options::default() };
    let film = render(&built, &options, Control::silent()).expect("renders");
    let ball = |k: u32| (21 + 38 * k..30 + 38 * k).flat_map(|x| (22..31).map(move |y| (x, y)));
    (0..6).map(|k| ball(k).filter_map(|(x, y)| film.radiance(x, y)).sum::<DVec3>() / 81.0).collect()
}

#[test]
fn the_sweep_changes_the_exponent_or_where_there_is_none_the_albedo() {
    let spec = builtin("gradient-sweep").expect("built in");
    let variants: Vec<_> =
        spec.spheres.iter().map(|s| spec.materials[&s.material].variant.clone().expect("one")).collect();
    assert_eq!(variants.len(), 6);
    // Each value is said in the description.
    for variant in &variants {
        let (n, percent) = (variant.exponent.expect("an exponent"), 100.0 * variant.scale.expect("a scale"));
        let [n, percent] = [if n < 1e3 { format!("{n}") } else { format!("{n:e}") }, format!("{percent}")];
        let words: Vec<&str> = spec.description.split([' ', ',', ';']).collect();
        assert!(words.contains(&&n[..]) && words.contains(&&percent[..]), "{n}, {percent}: {}", spec.description);
    }
    // A diffuse material without neighbours would reflect in proportion to the scale; light between balls and floor adds to it.
    let matte = balls(Some(Material::Brdf(Arc::new(Reflectance::lambert(vec![0.6; 3])))));
    for (k, variant) in variants.iter().enumerate().take(5) {
        let share = matte[k].x / matte[5].x;
        let scale = variant.scale.expect("a scale");
        assert!((0.7..1.2).contains(&(share / scale)), "ball {k}: {share} of the whole, scale {scale}");
    }
    // A table has no lobe either; a lobe's highlight gets narrower.
    let glossy = |n| Material::Brdf(Arc::new(Reflectance::lobes(vec![0.1; 3], [(vec![0.3; 3], n)])));
    assert_eq!(balls(Some(glossy(7.0))), balls(Some(glossy(70.0))), "the material's own exponent is replaced");
}

#[test]
fn a_picture_of_too_many_pixels_is_refused() {
    let text = BUILT_IN[0].toml;
    let from = text.find("[film]").expect("a film");
    let of = |size: &str| {
        let text = format!("{}[film]\nresolution = {size}\n{}", &text[..from], &text[from + "[film]".len()..]);
        SceneSpec::parse(&text, "test")
    };
    assert!(of("[8192, 8192]").is_ok());
    let message = of("[16384, 16384]").expect_err("too many").to_string();
    assert!(message.contains("`film.resolution` is [16384, 16384]") && message.contains("67108864"), "{message}");
}

#[test]
fn files_that_are_not_there_or_not_loaded_are_named() {
    let error = SceneSpec::read(Path::new("no/such/scene.toml")).expect_err("missing");
    assert!(matches!(error, RenderError::Io { .. }) && error.to_string().contains("no/such/scene.toml"), "{error}");
    let text = BUILT_IN[0].toml.replace("ball = { kd = [0.5, 0.5, 0.5] }", "ball = { file = \"gold.json\" }");
    let spec = SceneSpec::parse(&text, "test").expect("parses");
    assert_eq!(spec.material_files().collect::<Vec<_>>(), [("ball", Path::new("gold.json"))]);
    let message = Scene::build(&spec, Path::new("."), &Materials::new()).expect_err("not loaded").to_string();
    assert!(message.contains("`ball`") && message.contains("gold.json"), "{message}");
}
