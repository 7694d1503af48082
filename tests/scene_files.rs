//! Scene files: the built-in ones come back from TOML, and every broken one says where and why.

use std::path::Path;

use goniofit::render::scene::{BUILT_IN, builtin};
use goniofit::render::{Materials, RenderError, Scene, SceneSpec};

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
