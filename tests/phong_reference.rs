//! The Phong lobe against values computed with 50 digits for the same f64 vectors.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)] // helpers of tests

use glam::DVec3;
use goniofit::brdf::{Lobe, LobeKind, phong::directional_albedo};
use serde_json::Value;

fn reference() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/data-fixtures/reference/phong_50_digits.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect("part of the project")).expect("JSON")
}

fn vector(v: &Value) -> DVec3 {
    let c: Vec<f64> = v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    DVec3::new(c[0], c[1], c[2])
}

/// 2⁻⁵¹
const ROUNDING: f64 = 4.440_892_098_500_626e-16;

#[test]
fn values_and_derivatives_keep_their_digits_from_exponent_0_to_1e8_and_to_grazing() {
    let reference = reference();
    let exponents: Vec<f64> = reference["exponents"].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect();
    let lobe: &dyn Lobe = LobeKind::Phong.lobe();
    let (mut worst, mut compared, mut zeros) = (0.0f64, 0, 0);
    for entry in reference["lobe"].as_array().unwrap() {
        let (wi, wo) = (vector(&entry["wi"]), vector(&entry["wo"]));
        let cos_alpha: f64 = entry["cos_alpha"].as_str().unwrap().parse().unwrap();
        let coordinate = lobe.coordinate(wi, wo);
        for (i, &n) in exponents.iter().enumerate() {
            let mut slope = [f64::NAN];
            let value = lobe.value(&[n], coordinate, &mut slope);
            assert!(value.is_finite() && slope[0].is_finite(), "n {n}: {entry}");
            // The reciprocal pair has the same bits or nearly so.
            let back = lobe.value(&[n], lobe.coordinate(wo, wi), &mut [0.0]);
            match entry["value"][i].as_str().unwrap() {
                "0" => {
                    assert_eq!(value, 0.0, "n {n}: {entry}");
                    zeros += 1;
                }
                "tiny" => assert!(value <= 1e-289),
                text => {
                    let want: f64 = text.parse().unwrap();
                    let bound = 1e-11 + ROUNDING * n / cos_alpha;
                    let error = (value / want - 1.0).abs();
                    worst = worst.max(error / bound);
                    compared += 1;
                    assert!(error <= bound, "n {n}, error {error:e} above {bound:e}: {value:e} vs {want:e}\n{entry}");
                    assert!((back / want - 1.0).abs() <= bound, "n {n}: reciprocal {back:e} vs {want:e}");
                    if let Ok(want) = entry["d_exponent"][i].as_str().unwrap().parse::<f64>() {
                        // Two terms of opposite sign: judge by their size, f/(n + 2) and f |ln cosα|.
                        let size = value * (1.0 / (n + 2.0) + coordinate.abs());
                        // ln cosα itself is known to half a rounding of 1 − cosα.
                        assert!(
                            (slope[0] - want).abs() <= bound * size + 4.0 * ROUNDING / cos_alpha * value,
                            "slope, n {n}: {} vs {want:e}\n{entry}",
                            slope[0]
                        );
                    }
                }
            }
        }
    }
    println!("{compared} values, worst error {worst:.2} of the bound, {zeros} exact zeros");
    assert!(compared > 500 && zeros > 20);
}

#[test]
fn directional_albedos_match_to_1e_9_and_never_exceed_the_weight() {
    let mut worst = 0.0f64;
    for entry in reference()["albedo"].as_array().unwrap() {
        let number = |key: &str| entry[key].as_str().unwrap().parse::<f64>().unwrap();
        let (theta_deg, n, want) = (number("theta_deg"), number("exponent"), number("albedo"));
        let got = directional_albedo(n, theta_deg.to_radians());
        // The angle in radians is rounded; close to 90° that moves cosθ, and the albedo with it.
        let error = (got - want).abs();
        worst = worst.max(error);
        assert!(error <= 1e-9, "theta {theta_deg}, n {n}: {got} vs {want}");
        assert!(got <= 1.0 + 1e-14);
    }
    println!("worst {worst:.1e}");
}
