//! RGL tensor files against closed forms, Mitsuba's evaluations, and what an independent script counts.

#![allow(clippy::expect_used, clippy::panic)] // a test may stop where it stands

mod evaluation;
mod listing;
mod sampling;
mod weights;

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use goniofit::geometry::half_vector;
use goniofit::measurement::formats::rgl::{self, RglBrdf};
use goniofit::measurement::{Measurement, ReadOptions};

const NAMES: [&str; 5] = ["aurora_white", "cc_ibiza_sunset", "chm_mint", "irid_flake_paint1", "vch_silk_blue"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn fixture(name: &str) -> PathBuf {
    root().join("data-fixtures/measurements").join(name)
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn read(path: &Path) -> Measurement {
    rgl::read(path, &bytes(path), &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn brdf(path: &Path) -> RglBrdf {
    rgl::read_brdf(path, &bytes(path)).unwrap_or_else(|e| panic!("{e}"))
}

/// The five real files and their reference evaluations; none, with a line, where they are absent.
fn real(test: &str) -> Vec<(PathBuf, PathBuf)> {
    let shared = root().join("../shared");
    let pair =
        |n: &&str| (shared.join(format!("data/rgl/{n}_rgb.bsdf")), shared.join(format!("reference/rgl/{n}_rgb.csv")));
    let pairs: Vec<_> = NAMES.iter().map(pair).collect();
    if pairs.iter().all(|(data, reference)| data.exists() && reference.exists()) {
        return pairs;
    }
    println!("{test}: real files skipped, ../shared/data/rgl or ../shared/reference/rgl is absent");
    Vec::new()
}

/// Rows of numbers after the comment and header lines.
fn rows(path: &Path) -> Vec<Vec<f64>> {
    let text = String::from_utf8(bytes(path)).expect("text");
    let lines = text.lines().filter(|l| !l.starts_with('#')).skip(1);
    lines.map(|l| l.split(',').map(|v| v.parse().expect("number")).collect()).collect()
}

/// The closed form behind a fixture (data-fixtures/measurements/rgl.py).
struct Closed {
    file: &'static str,
    alpha: DVec2,
    turn: f64,
    tilt: f64,
}

const CLOSED: [Closed; 5] = [
    Closed { file: "rgl-tiny.bsdf", alpha: DVec2::new(0.35, 0.35), turn: 0.0, tilt: 0.0 },
    Closed { file: "rgl-spectral.bsdf", alpha: DVec2::new(0.35, 0.35), turn: 0.0, tilt: 0.0 },
    Closed { file: "rgl-half-turn.bsdf", alpha: DVec2::new(0.5, 0.25), turn: 0.5, tilt: 0.0 },
    Closed { file: "rgl-two-planes.bsdf", alpha: DVec2::new(0.5, 0.25), turn: 0.0, tilt: 0.0 },
    Closed { file: "rgl-full-turn.bsdf", alpha: DVec2::new(0.5, 0.25), turn: 0.5, tilt: 0.4 },
];

impl Closed {
    fn eval(&self, wi: DVec3, wo: DVec3, channel: usize) -> f64 {
        let (kd, ks) = ([0.3, 0.2, 0.1, 0.05][channel], [0.5, 0.45, 0.4, 0.3][channel]);
        let own = |w: DVec3| DVec2::from_angle(-self.turn).rotate(w.truncate());
        let sigma = |w: DVec3| 0.5 * (w.z + (self.alpha * own(w)).extend(w.z).length());
        let m = half_vector(wi, wo).expect("above the horizon");
        let ndf = 1.0 / (PI * self.alpha.x * self.alpha.y * (own(m) / self.alpha).extend(m.z).length().powi(4));
        kd / PI * (1.0 + self.tilt * (wi.x + wo.x)) + ks * ndf / (4.0 * sigma(wi) * sigma(wo))
    }
}
