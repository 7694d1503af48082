//! Comparing two pictures: what is said, what is written, what is refused.

use goniofit::image::{Image, LayerKind, encode_exr};

use crate::bench::{Bench, number};

/// A file with a picture of `width` × `height` grey pixels.
fn grey(b: &Bench, name: &str, width: usize, height: usize, value: impl Fn(usize) -> f64) {
    let radiance = (0..width * height).map(|i| [value(i); 3]).collect();
    write(b, name, &Image { width, height, radiance, ..Image::default() });
}

fn write(b: &Bench, name: &str, image: &Image) {
    b.write(name, encode_exr(image).expect("encodes"));
}

/// `a.exr` and `b.exr`: one scene with enough samples to tell noise from difference.
fn noisy_pair(b: &Bench) {
    for (name, seed) in [("a.exr", "0"), ("b.exr", "1")] {
        b.ok(&["render", "--size", "24", "--samples", "16", "--seed", seed, "--out", name]);
    }
}

#[test]
fn a_nan_pixel_is_refused_with_its_place_and_the_count() {
    let b = Bench::new();
    grey(&b, "good.exr", 8, 4, |_| 1.0);
    grey(&b, "bad.exr", 8, 4, |i| if i >= 29 { f64::NAN } else { 1.0 });
    let ran = b.run(&["compare", "bad.exr", "good.exr"]);
    assert_eq!(ran.code, Some(2));
    assert!(
        ran.err.contains("bad.exr") && ran.err.contains("(5, 3), channel 0") && ran.err.contains("9 values"),
        "{}",
        ran.err
    );
    let ran = b.run(&["compare", "good.exr", "bad.exr", "--json"]);
    let said = ran.json();
    assert!(said["error"].as_str().expect("an error").contains("bad.exr"));
    assert_eq!((&said["not_finite"], &said["first_not_finite"]["in_reference"]), (&9.into(), &true.into()));
}

#[test]
fn masks_that_cover_everything_are_refused() {
    let b = Bench::new();
    grey(&b, "a.exr", 4, 4, |_| 1.0);
    let mut image = b.exr("a.exr");
    image.mask = Some(vec![1.0; 16]);
    write(&b, "m.exr", &image);
    for pair in [["a.exr", "m.exr"], ["m.exr", "a.exr"]] {
        let ran = b.run(&["compare", pair[0], pair[1], "--out", "map.png"]);
        assert_eq!(ran.code, Some(1));
        assert!(ran.err.contains("masks cover all 16 pixels"), "{}", ran.err);
        assert!(!b.path("map.png").exists());
    }
}

#[test]
fn one_pixel_a_black_reference_and_extreme_radiance_have_numbers() {
    let b = Bench::new();
    for (name, size, value, reference) in
        [("pixel", 1, 0.3, 0.4), ("black", 16, 0.5, 0.0), ("faint", 16, 1e-20, 2e-20), ("bright", 16, 1e20, 2e20)]
    {
        let wave = |v: f64| move |i: usize| v * (1.0 + 0.1 * (i % 3) as f64);
        grey(&b, "a.exr", size, size, wave(value));
        grey(&b, "b.exr", size, size, wave(reference));
        let said = b.json(&["compare", "a.exr", "b.exr", "--out", "maps.png"]);
        let looks = &said["appearance"];
        for key in ["delta_e_76", "delta_e_2000", "flip"] {
            assert!(number(&looks[key]["mean"]) > 0.0, "{name} {key}: {looks}");
        }
        assert!(number(&looks["ssim"]) < 1.0 && said["rmse"].is_number(), "{name}: {said}");
        assert_eq!(looks["hdr_flip"].is_null(), name == "black", "{name}: {looks}");
        assert!(b.bytes("maps.png").starts_with(b"\x89PNG"));
    }
}

#[test]
fn what_is_the_same_is_said_to_be_so() {
    let b = Bench::new();
    b.picture("a.exr", &[]);
    let said = b.json(&["compare", "a.exr", "a.exr"]);
    assert_eq!((&said["rmse"], &said["appearance"]["flip"]["max"]), (&0.0.into(), &0.0.into()));
    assert_eq!(
        (&said["appearance"]["psnr"], &said["appearance"]["hdr_flip"]["mean"]),
        (&serde_json::Value::Null, &0.0.into())
    );
}

#[test]
fn maps_are_written_as_a_picture_or_as_values() {
    let b = Bench::new();
    noisy_pair(&b);
    let said = b.json(&["compare", "a.exr", "b.exr", "--out", "map.exr"]);
    let map = b.exr("map.exr");
    assert_eq!(map.layers.iter().map(|l| l.kind).collect::<Vec<_>>(), [LayerKind::Relative, LayerKind::Flip]);
    let mean = map.layers[1].planes[0].iter().sum::<f64>() / 576.0;
    assert!((mean / number(&said["appearance"]["flip"]["mean"]) - 1.0).abs() < 1e-6);
    assert_eq!(said["significance"]["blocks"]["block"], 32);
    for (out, says) in
        [("map.jpg", ".png or .exr"), ("a.exr", "a.exr"), ("no/map.png", "folder"), ("-", ".png or .exr")]
    {
        let ran = b.run(&["compare", "a.exr", "b.exr", "--out", out]);
        assert!(ran.code == Some(2) && ran.err.contains(says), "{out}: {}", ran.err);
    }
}

#[test]
fn the_table_fits_a_terminal_and_limits_hold_for_looks() {
    let b = Bench::new();
    noisy_pair(&b);
    let text = b.ok(&["compare", "a.exr", "b.exr", "--exposure", "-1.5"]).text();
    assert!(text.lines().all(|l| l.chars().count() <= 80), "{text}");
    for name in ["rmse", "relMSE", "PSNR", "SSIM", "ΔE 1976", "ΔE 2000", "ꟻLIP", "HDR-ꟻLIP", "blocks", "-1.50 stops"]
    {
        assert!(text.contains(name), "{name}: {text}");
    }
    for metric in ["flip", "hdr_flip", "delta_e_76", "delta_e_2000", "block_max_z"] {
        assert_eq!(
            b.run(&["compare", "a.exr", "b.exr", "--fail-above", &format!("{metric}=1e-9")]).code,
            Some(1),
            "{metric}"
        );
        b.ok(&["compare", "a.exr", "b.exr", "--fail-above", &format!("{metric}=1e9")]);
    }
}

#[test]
fn a_picture_can_be_rendered_with_layers_or_without() {
    let b = Bench::new();
    b.picture("plain.exr", &[]);
    let said = b.picture("full.exr", &["--layers", "albedo,normal,depth,samples,direct,indirect", "--json"]).json();
    assert_eq!(said["layers"].as_array().map(Vec::len), Some(6));
    let (plain, full) = (b.exr("plain.exr"), b.exr("full.exr"));
    assert!(plain.layers.is_empty() && full.layers.len() == 6 && plain.radiance.len() == full.radiance.len());
    let plan = full.metadata.plan.expect("a plan");
    assert!(plan.contains("scattering events") && plan.contains("depth"), "{plan}");
    let ran = b.picture("x.exr", &["--layers", "albedo,beauty"]);
    assert!(ran.code == Some(2) && ran.err.contains("indirect"), "{}", ran.err);
}
