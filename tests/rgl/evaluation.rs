//! Evaluation against other programs, and its speed.

use std::path::Path;

use goniofit::brdf::Brdf;
use goniofit::geometry::angles::direction_deg;

use super::{brdf, fixture, real, root, rows};

/// Deviations from a reference table relative to the row's largest value, over θ ≤ 85° and θi > 0.
fn deviations(file: &Path, reference: &Path) -> Vec<f64> {
    let brdf = brdf(file);
    let compare = |row: &Vec<f64>| {
        let mut out = [0.0; 3];
        assert!(brdf.eval(direction_deg(row[0], row[1]), direction_deg(row[2], row[3]), &mut out));
        let scale = row[4..7].iter().fold(1e-30f64, |m, v| m.max(v.abs()));
        out.iter().zip(&row[4..7]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale
    };
    rows(reference).iter().filter(|r| r[0] > 0.0 && r[0] <= 85.0 && r[2] <= 85.0).map(compare).collect()
}

#[test]
fn real_files_evaluate_as_mitsuba_does() {
    for (file, reference) in real("real_files_evaluate_as_mitsuba_does") {
        let all = deviations(&file, &reference);
        let (worst, above) = (all.iter().fold(0.0f64, |w, d| w.max(*d)), all.iter().filter(|d| **d > 1e-4).count());
        println!("{}: {} pairs, largest deviation {worst:.1e}, {above} above 1e-4", file.display(), all.len());
        // The reference is f32. It deviates by more than 1e-4 in 4 of the 1720 pairs: half vectors beyond 80°, where D is 10⁴ to
        // 10⁶ times below its peak and ragged; an f64 evaluation in numpy that shares no code sides with this one in all 4.
        assert!(all.len() > 300 && worst < 4e-4 && above <= 2, "{}: {worst:e}, {above}", file.display());
    }
}

#[test]
fn anisotropic_files_evaluate_as_mitsuba_does() {
    for name in ["rgl-half-turn", "rgl-two-planes", "rgl-full-turn"] {
        let reference = root().join(format!("data-fixtures/reference/{name}.csv"));
        let all = deviations(&fixture(&format!("{name}.bsdf")), &reference);
        let worst = all.iter().fold(0.0f64, |worst, d| worst.max(*d));
        println!("{name}: {} pairs, largest deviation {worst:.1e}", all.len());
        assert!(all.len() == 120 && worst < 1e-5, "{name}: {worst:e}");
    }
}
