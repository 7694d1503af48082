//! Synthetic tables for the tests of [`TableBrdf`].
#![allow(dead_code, clippy::expect_used, clippy::float_cmp)] // each test file uses a part; exact zeros are meant

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use goniofit::brdf::Brdf;
use goniofit::geometry::HalfDiff;
use goniofit::geometry::angles::direction_deg;
use goniofit::geometry::sampling::cosine_hemisphere;
use goniofit::measurement::{Directions, Measurement, MerlAngles, MerlGrid, TableBrdf};
use goniofit::numeric::random::{Purpose, RngExt, stream};

/// A MERL table with these channels as functions of the fractional bin (θh, θd, φd).
pub fn merl_of_bins(angles: MerlAngles, channels: &[&dyn Fn(f64, f64, f64) -> f64]) -> Measurement {
    let mut values = Vec::with_capacity(MerlGrid::LEN * channels.len());
    for f in channels {
        values.extend((0..MerlGrid::LEN).map(|index| {
            let (i, j, k) = MerlGrid::bins(index);
            f(i as f64, j as f64, k as f64)
        }));
    }
    let names = (0..channels.len()).map(|c| format!("c{c}")).collect();
    Measurement::new("synthetic", Directions::Merl(MerlGrid { angles }), names, values)
}

/// A MERL table of a BRDF in half and difference angles, read at bin centres.
pub fn merl_of(f: impl Fn(HalfDiff) -> f64) -> Measurement {
    let at = |i: f64, j: f64, k: f64| f(half_diff(i + 0.5, j + 0.5, k + 0.5));
    merl_of_bins(MerlAngles::Center, &[&at])
}

pub fn half_diff(i: f64, j: f64, k: f64) -> HalfDiff {
    HalfDiff { theta_h: MerlGrid::theta_h(i), theta_d: j.to_radians(), phi_d: k.to_radians() }
}

/// A diffuse share, a lobe of slope width `m` round the mirror direction and, on request, one back towards the light.
pub fn lobe(m: f64, retro: f64) -> impl Fn(HalfDiff) -> f64 {
    move |a| {
        let gloss = (-(a.theta_h.tan() / m).powi(2)).exp() / (4.0 * PI * m * m);
        0.03 + 0.4 * gloss * (1.0 + a.theta_d.sin().powi(4)) + retro * (-(a.theta_d / 0.05).powi(2)).exp()
    }
}

/// A hemisphere scan: these incidences (degrees), `wo` every 5° in θ up to 85° and every 10° in azimuth over half a turn.
pub fn scan(incidences: &[f64], f: impl Fn(DVec3, DVec3) -> f64) -> Measurement {
    let (mut lights, mut eyes) = (Vec::new(), Vec::new());
    for &theta_i in incidences {
        for ring in 0..=17 {
            for step in 0..=18 {
                lights.push(direction_deg(theta_i, 0.0));
                eyes.push(direction_deg(5.0 * f64::from(ring), 10.0 * f64::from(step)));
            }
        }
    }
    list(lights, eyes, f)
}

pub fn list(wi: Vec<DVec3>, wo: Vec<DVec3>, f: impl Fn(DVec3, DVec3) -> f64) -> Measurement {
    let values = wi.iter().zip(&wo).map(|(&i, &o)| f(i, o)).collect();
    Measurement::new("scan", Directions::List { wi, wo }, vec!["grey".into()], values)
}

/// A scan as far as the horizon, incidences and outgoing directions every 5° up to 85°, then 88° and 89.95°, in which the retro zone is missing: pairs whose
/// directions are less than `missing_deg` apart have no value, as where the detector would stand in the beam.
pub fn scan_without_retro(missing_deg: f64, f: impl Fn(DVec3, DVec3) -> f64) -> Measurement {
    let thetas = || (0..=17).map(|ring| 5.0 * f64::from(ring)).chain([88.0, 89.95]);
    let around = |theta_o: f64| (0..=18).map(move |step| direction_deg(theta_o, 10.0 * f64::from(step)));
    let of = |theta_i: f64| thetas().flat_map(around).map(move |wo| (direction_deg(theta_i, 0.0), wo));
    let (wi, wo): (Vec<DVec3>, Vec<DVec3>) = thetas().flat_map(of).unzip();
    let nearest = missing_deg.to_radians().cos();
    list(wi, wo, |i, o| if i.dot(o) > nearest { f64::NAN } else { f(i, o) })
}

pub const TENS: [f64; 9] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0];

pub fn table(measurement: &Measurement) -> TableBrdf {
    let all: Vec<usize> = (0..measurement.channels.len()).collect();
    TableBrdf::new(measurement, &all).expect("a table that can be rendered")
}

pub fn grey(brdf: &TableBrdf, wi: DVec3, wo: DVec3) -> Option<f64> {
    let mut out = [f64::NAN];
    let known = brdf.eval(wi, wo, &mut out);
    assert!(known || out == [0.0], "unknown values are zeros: {out:?}");
    known.then_some(out[0])
}

/// Pairs of directions, each with density cosθ/π.
pub fn pairs(n: usize) -> impl Iterator<Item = (DVec3, DVec3)> {
    let mut rng = stream(5, Purpose::Study, n as u64);
    let mut draw = move || cosine_hemisphere(DVec2::new(rng.random(), rng.random()));
    std::iter::repeat_with(move || (draw(), draw())).take(n)
}
