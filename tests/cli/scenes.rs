//! Built-in scenes, printed as files to start from.

use crate::bench::{Bench, assert_same_picture};

#[test]
fn a_scene_printed_to_a_file_renders_as_the_built_in_one() {
    let b = Bench::new();
    let list = b.json(&["scenes"]);
    let scenes: Vec<&str> =
        list["scenes"].as_array().expect("a list").iter().map(|s| s["name"].as_str().expect("a name")).collect();
    for name in ["sphere", "sphere-on-plane", "cornell", "mesh-env"] {
        assert!(scenes.contains(&name), "{scenes:?}");
    }
    for name in scenes {
        let file = format!("{name}.toml");
        b.write(&file, b.ok(&["scenes", name, "--toml"]).out);
        for (out, scene) in [("file.exr", vec![file.as_str()]), ("name.exr", vec!["--scene", name])] {
            for material in [vec![], vec!["--material", "satin"]] {
                let ran = b.picture(&format!("{}{out}", material.len()), &[&scene[..], &material].concat());
                assert_eq!(ran.code, Some(0), "{scene:?}: {}", ran.err);
            }
        }
        for prefix in ["0", "2"] {
            let of = |out: &str| b.exr(&format!("{prefix}{out}"));
            assert_same_picture(&of("file.exr"), &of("name.exr"), name);
        }
        assert!(b.exr("0name.exr").radiance != b.exr("2name.exr").radiance, "{name}: the material is replaced");
    }
}

#[test]
fn a_scene_is_either_a_file_or_a_name() {
    let b = Bench::new();
    b.write("s.toml", b.ok(&["scenes", "sphere", "--toml"]).out);
    assert_eq!(b.picture("x.exr", &["s.toml", "--scene", "sphere"]).code, Some(2));
    b.write("n.toml", b.text("s.toml").replace("version = 1", "version = 2"));
    let newer = b.picture("x.exr", &["n.toml"]);
    assert_eq!(newer.code, Some(2));
    assert!(newer.err.contains("n.toml") && newer.err.contains("version"), "{}", newer.err);
    assert!(!b.path("x.exr").exists());
}

#[test]
fn size_samples_and_seed_are_what_was_asked_for() {
    let b = Bench::new();
    let said = b.json(&["render", "--size", "20x10", "--samples", "3", "--seed", "7", "--out", "r.exr"]);
    let image = b.exr("r.exr");
    assert_eq!((image.width, image.height), (20, 10));
    assert_eq!((image.metadata.samples, image.metadata.seed), (Some(3), Some(7)));
    for (key, want) in [("width", 20), ("height", 10), ("samples", 3), ("seed", 7)] {
        assert_eq!(said[key], want, "{key}");
    }
    b.ok(&["render", "--size", "20x10", "--samples", "3", "--seed", "8", "--out", "other.exr"]);
    assert!(b.exr("other.exr").radiance != image.radiance, "another seed, other noise");
}

#[test]
fn a_rendered_picture_lights_another_scene_and_is_not_overwritten_by_it() {
    let b = Bench::new();
    b.ok(&["render", "--scene", "furnace", "--size", "32x17", "--samples", "2", "--out", "sky.exr"]);
    let scene = b.ok(&["scenes", "furnace", "--toml"]).text();
    b.write("lit.toml", scene.replace("radiance = [1, 1, 1]", "file = \"sky.exr\""));
    let refused = b.picture("sky.exr", &["lit.toml"]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("would destroy the input") && refused.err.contains("sky.exr"), "{}", refused.err);
    let ran = b.picture("lit.exr", &["lit.toml"]);
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    assert!(b.exr("lit.exr").radiance.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
}

#[test]
fn a_target_is_met_and_stated() {
    let b = Bench::new();
    let base = ["render", "--scene", "cornell", "--size", "32", "--out", "c.exr"];
    let with = |more: &[&'static str]| [&base[..], more].concat();
    let found = b.json(&with(&["--target-error", "8%"]));
    assert_eq!(found["target_met"], true);
    assert!(found["relative_error_95"].as_f64().is_some_and(|e| e <= 0.08), "{found}");
    assert!(found["mean_samples"].as_f64() >= found["samples"].as_f64(), "{found}");
    let out_of_reach = b.ok(&with(&["--target-error", "0.1%", "--samples", "16"]));
    assert!(out_of_reach.err.contains("asked for, 0.100 %, was not reached"), "{}", out_of_reach.err);
    assert_eq!(b.exr("c.exr").metadata.samples, Some(16));
    // Less than it takes to write the file.
    let short = b.run(&["render", "--scene", "cornell", "--size", "512", "--time-budget", "1ms", "--out", "short.exr"]);
    assert_eq!(short.code, Some(1), "{}", short.err);
    assert!(short.err.contains("too short for cornell") && !b.path("short.exr").exists(), "{}", short.err);
}

#[test]
fn effects_of_a_scene_say_what_is_on_and_what_it_is_worth() {
    let b = Bench::new();
    let arguments = ["effects", "--scene", "cornell", "--size", "16", "--samples", "32"];
    let found = b.json(&arguments);
    let list = found["effects"].as_array().expect("a list");
    let effect = |name: &str| list.iter().find(|e| e["effect"] == name).expect("is known");
    let noise = found["noise"].as_f64().expect("a number");
    for name in ["shadows", "interreflection", "area lights"] {
        let off_by = effect(name)["off_by"].as_f64().expect("a number");
        assert!(effect(name)["on"] == true && off_by > 2.0 * noise, "{name}: {off_by}, noise {noise}");
    }
    assert!(effect("environment")["on"] == false && effect("environment")["off_by"].is_null());
    assert!(found["full_off_by"].as_f64().is_some_and(|off| off < 2.0 * noise), "{found}");
    let text = b.ok(&arguments).text();
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    assert_eq!(b.run(&["effects", "--scene", "cornell", "--scan", "merl"]).code, Some(2));
}

#[test]
fn a_file_with_a_camera_is_a_scene_for_effects() {
    let b = Bench::new();
    b.write("s.toml", b.ok(&["scenes", "sphere", "--toml"]).out);
    let base = ["effects", "s.toml", "--size", "8", "--samples", "8"];
    let with = |more: &[&'static str]| [&base[..], more].concat();
    let said = b.ok(&with(&[])).text();
    assert!(said.contains("nothing can stand between a surface and a light"), "{said}");
    let wrong = b.run(&with(&["--noiseless"]));
    assert_eq!(wrong.code, Some(2));
    assert!(wrong.err.contains("--noiseless is for simulations, and sphere is a scene"), "{}", wrong.err);
}
