//! MERL tables made by the simulated instrument.

use serde_json::Value;

use crate::bench::{Bench, number};

/// Entries of a MERL file whose directions lie within 80°, where bin (i, j, k) is read at (i + at, j + at, k + at).
fn within_80_degrees(at: f64) -> usize {
    let limit = (80.0f64 + 1e-9).to_radians().cos(); // inclusive
    let mut count = 0;
    for i in 0..90 {
        let theta_h = ((f64::from(i) + at) / 90.0).powi(2) * 90.0;
        let (sin_h, cos_h) = theta_h.to_radians().sin_cos();
        for j in 0..90 {
            let (sin_d, cos_d) = (f64::from(j) + at).to_radians().sin_cos();
            for k in 0..180 {
                // cosθ of wi is cosθh cosθd − sinθh sinθd cosφd; wo is on the other side of the half vector.
                let across = sin_h * sin_d * (f64::from(k) + at).to_radians().cos();
                count += usize::from(cos_h * cos_d - across.abs() >= limit);
            }
        }
    }
    count
}

fn exponent(fit: &Value) -> f64 {
    number(&fit["lobes"][1]["shape"]["exponent"])
}

#[test]
fn a_noiseless_merl_table_gives_its_material_back() {
    let b = Bench::new();
    b.ok(&["simulate", "--material", "glossy-paint", "--scan", "merl", "--noiseless", "--out", "m.binary"]);
    assert_eq!(b.bytes("m.binary").len(), 12 + 8 * 3 * 90 * 90 * 180);
    let fit = b.json(&["fit", "m.binary"]);
    assert_eq!(fit["fit"]["samples"], within_80_degrees(0.5));
    for (lobe, want) in [(0, [0.32, 0.06, 0.035]), (1, [0.12; 3])] {
        for c in 0..3 {
            let got = number(&fit["lobes"][lobe]["weight"][c]);
            assert!((got / want[c] - 1.0).abs() < 1e-9, "lobe {lobe} channel {c}: {got} vs {}", want[c]);
        }
    }
    assert!((exponent(&fit) / 90.0 - 1.0).abs() < 1e-9, "{fit}");

    // Read at the bins' lower edges, the same numbers are another material.
    let edge = b.json(&["fit", "m.binary", "--merl-angles", "edge"]);
    assert!((exponent(&edge) / 90.0 - 1.0).abs() > 0.02, "{}", exponent(&edge));
    assert_eq!(edge["fit"]["samples"], within_80_degrees(0.0));
}

#[test]
fn a_fit_sampled_at_either_place_of_the_bin_is_found_again_there() {
    let b = Bench::new();
    b.write("satin.json", b.ok(&["models", "satin"]).out);
    b.ok(&["convert", "satin.json", "edge.binary", "--merl-angles", "edge"]);
    let fit = b.json(&["fit", "edge.binary", "--merl-angles", "edge"]);
    assert!((exponent(&fit) / 12.0 - 1.0).abs() < 1e-9, "{}", exponent(&fit));
}

#[test]
fn readings_that_noise_made_negative_are_told_and_counted() {
    let b = Bench::new();
    let args =
        ["simulate", "--material", "glossy-paint", "--scan", "merl", "--seed", "1", "--out", "m.binary", "--json"];
    let ran = b.ok(&args);
    let line = ran.err.lines().find(|l| l.contains("negative")).expect("a warning");
    let told: u64 = line
        .split(|c: char| !c.is_ascii_digit())
        .filter_map(|w| w.parse().ok())
        .next_back()
        .unwrap_or_else(|| panic!("no count in {line}"));
    let measured = ran.json()["valid"].as_u64().expect("a count");
    let summary = b.json(&["info", "m.binary"]);
    let kept = summary["valid"].as_u64().expect("a count");
    println!("measured {measured}, told lost {told}, kept {kept}");
    assert!(told > 0 && kept + told == measured, "{measured} − {told} ≠ {kept}");
    assert!(ran.err.contains('σ'), "σ is lost too, and that is said: {}", ran.err);
    for channel in summary["channels"].as_array().expect("channels") {
        assert_eq!(channel["negative"], 0, "a negative entry means not measured there");
    }
}

#[test]
fn entries_not_measured_are_told_by_a_fit_to_all_and_to_a_part() {
    let b = Bench::new();
    b.ok(&["simulate", "--material", "satin", "--scan", "merl", "--noiseless", "--out", "m.binary"]);
    let mut bytes = b.bytes("m.binary");
    // At θh = 0 and the least θd both directions are near the normal: four entries of red, one of green.
    for place in [12, 20, 28, 36, 12 + 8 * 90 * 90 * 180] {
        bytes[place..place + 8].copy_from_slice(&(-1.0f64).to_le_bytes());
    }
    b.write("m.binary", bytes);
    for more in [&[][..], &["--stride", "1", "--time-budget", "1us"], &["--per-channel"]] {
        let fit = b.json(&[&["fit", "m.binary"], more].concat());
        let warned = fit["fit"]["warnings"].to_string();
        let want = format!("5 of {} values are missing", 3 * within_80_degrees(0.5));
        assert!(warned.contains(&want), "{more:?}: {warned}");
    }
}
