//! Adaptive scans beside uniform ones of the plane of incidence: how well readings tell the curve between them, and the exponent.
//! `benches/adaptive.rs` runs the same in numbers.

use goniofit::brdf::{LobeKind, Material};
use goniofit::chain::{Source, measure};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, fit};
use goniofit::geometry::angles::direction_deg;
use goniofit::gonio::{Instrument, Scan, hours, lit_rows};
use goniofit::measurement::{Dimension, Measurement, Weights};
use rayon::prelude::*;

/// Name and exponent; a matte one has no lobe.
pub const MATERIALS: [(&str, f64); 4] = [("Lambert", 0.0), ("glossy", 60.0), ("sharp", 1e3), ("mirror-like", 2e4)];

/// 0.3 diffuse and, with an exponent above 0, 0.1 in a lobe.
pub fn material(exponent: f64) -> Material {
    let mut lobes = vec![(LobeKind::Lambert, vec![0.3], vec![])];
    if exponent > 0.0 {
        lobes.push((LobeKind::Phong, vec![0.1], vec![exponent]));
    }
    Material::new(vec!["y".into()], lobes)
}

/// What is measured along a scan.
pub fn measured(of: &Material, instrument: &Instrument, scan: &Scan, seed: u64) -> Measurement {
    let source = Source::Fitted(Box::new(of.clone()));
    measure("m", &source, instrument, scan, seed, Control::silent()).expect("measured")
}

/// The hours of the scan that was measured.
pub fn hours_of(table: &Measurement, instrument: &Instrument) -> f64 {
    hours(instrument, &table.directions, &lit_rows(&table.directions, &[]))
}

/// The uniform scan of the plane with so many pairs, or a few less: as many θo for each incidence, from −85° to 85°.
pub fn uniform(pairs: usize) -> Scan {
    let half = (pairs / 6 - 1) / 2;
    Scan::InPlane { step_deg: 85.0 / half as f64 }
}

/// The uniform scan of the plane that takes no longer than `hours_most`.
pub fn uniform_in(hours_most: f64, instrument: &Instrument) -> Scan {
    let fits = |half: &usize| {
        let (directions, _) = uniform(6 * (2 * half + 1)).directions().expect("small");
        hours(instrument, &directions, &lit_rows(&directions, &[])) <= hours_most
    };
    let half = (17..1000).take_while(fits).last().expect("more than the first look");
    uniform(6 * (2 * half + 1))
}

/// The list of the directions of a table, read again.
pub fn again(table: &Measurement) -> Scan {
    Scan::List {
        name: "again".into(),
        directions: table.directions.clone(),
        weights: Weights::Uniform,
        dimension: Dimension::Space,
        rows: Vec::new(),
    }
}

/// Signed θo in degrees and value, NaN where masked, of every reading of one incidence, in the order of angles.
pub fn curve(table: &Measurement, theta_i_deg: f64) -> Vec<(f64, f64)> {
    let wanted = direction_deg(theta_i_deg, 0.0);
    let mut list: Vec<(f64, f64)> = (0..table.len())
        .filter_map(|i| {
            let (wi, wo) = table.directions.pair(i);
            ((wi - wanted).length() < 1e-9).then(|| ((-wo.x).atan2(wo.z).to_degrees(), table.plane(0)[i]))
        })
        .collect();
    list.sort_by(|a, b| a.0.total_cmp(&b.0));
    list
}

/// Rms over all incidences of the readings' linear interpolation less the truth, over the rms of the truth, every 0.05° from −80° to 80°, between
/// readings that are not masked.
pub fn interpolation_error(table: &Measurement, of: &Material) -> f64 {
    let (mut off, mut all) = (0.0, 0.0);
    for theta_i in (0..6).map(|k| 15.0 * f64::from(k)) {
        let (curve, wi) = (curve(table, theta_i), direction_deg(theta_i, 0.0));
        for theta in (-1600..=1600).map(|k| 0.05 * f64::from(k)) {
            let truth = of.value(wi, direction_deg(theta, 180.0))[0];
            let right = curve.partition_point(|c| c.0 < theta).clamp(1, curve.len() - 1);
            let ((a, fa), (b, fb)) = (curve[right - 1], curve[right]);
            let found = fa + (fb - fa) * (theta - a) / (b - a);
            if found.is_finite() {
                off += (found - truth).powi(2);
                all += truth * truth;
            }
        }
    }
    (off / all).sqrt()
}

/// ln(found/true) of the exponent; `None` where the fit leaves it open.
pub fn exponent(table: &Measurement, truth: f64, use_sigma: bool) -> Option<f64> {
    let options = FitOptions { use_sigma, ..FitOptions::new("lambert+phong".parse().expect("a model")) };
    let found = fit(table, &options).expect("fitted").material;
    let n = found.lobes[1].shape_of(0)?[0];
    (n > 0.0).then(|| (n / truth).ln())
}

/// Means over seeds: interpolation error, rms of ln(n/truth) with σ and without, and how many fits left the exponent open.
pub struct Found {
    pub interpolation: f64,
    pub exponent: f64,
    pub unweighted: f64,
    pub open: usize,
    pub pairs: usize,
    pub hours: f64,
}

pub fn study(n: f64, instrument: &Instrument, scan: &Scan, seeds: u64) -> Found {
    let of = material(n);
    let one = |seed: u64| {
        let table = measured(&of, instrument, scan, seed);
        let [by_sigma, plain] = [true, false].map(|s| (n > 0.0).then(|| exponent(&table, n, s)).flatten());
        (interpolation_error(&table, &of), by_sigma, plain, table.len(), hours_of(&table, instrument))
    };
    let all: Vec<_> = (0..seeds).into_par_iter().map(one).collect();
    let mean = |list: Vec<f64>| (list.iter().map(|x| x * x).sum::<f64>() / list.len().max(1) as f64).sqrt();
    Found {
        interpolation: mean(all.iter().map(|a| a.0).collect()),
        exponent: mean(all.iter().filter_map(|a| a.1).collect()),
        unweighted: mean(all.iter().filter_map(|a| a.2).collect()),
        open: all.iter().filter(|a| n > 0.0 && a.1.is_none()).count(),
        pairs: all[0].3,
        hours: all.iter().map(|a| a.4).sum::<f64>() / seeds as f64,
    }
}
