//! Pictures against converged ones of another renderer (Mitsuba 3.9.1), where those are present; `cargo bench --bench reference` does the same with every pixel
//! of theirs.
//!
//! The reference is averaged over squares of 8 × 8 pixels, which are the pixels of a picture of the eighth resolution, so that a
//! short render has enough samples per pixel for its mean to be normally distributed.

#![allow(clippy::expect_used, clippy::panic)] // these are tests

mod reference_support;

use goniofit::render::SceneSpec;
use goniofit::render::scene::builtin;
use reference_support::{Noise, Shot, references};

const SHRINK: usize = 8;

/// Whether pixels, and blocks of 4 × 4 of them, agree; `None` where there is no reference.
fn agrees(of: &(&str, SceneSpec, f64), samples: u32) -> Option<bool> {
    let pair = Shot::of(of, samples, SHRINK)?.with(Noise::Careful);
    let found = [1, 4].map(|blocks| pair.tested(blocks));
    for (s, blocks) in found.iter().zip([1, 4]) {
        println!(
            "{}: blocks of {blocks}, max |z| {:.2} at {:?}, mean z² {:.3}, p {:.3}",
            of.0, s.max_z, s.at, s.mean_z2, s.p
        );
    }
    Some(found.iter().all(|s| !s.differs))
}

fn check(k: usize, samples: u32) {
    let of = &references()[k];
    assert_ne!(agrees(of, samples), Some(false), "{}", of.0);
}

#[test]
fn sphere() {
    check(0, 1024);
}

#[test]
fn sphere_on_plane() {
    check(1, 1024);
}

#[test]
fn sphere_on_plane_phong() {
    check(2, 1024);
}

#[test]
fn cornell() {
    check(3, 512);
}

#[test]
fn cornell_phong() {
    check(4, 512);
}

#[test]
fn mesh_env() {
    check(5, 512);
}

#[test]
fn a_sky_turned_by_three_degrees_is_found() {
    let mut spec = builtin("mesh-env").expect("built in");
    spec.lights.environment.as_mut().expect("a sky").rotate_deg = Some(3.0);
    assert_ne!(agrees(&("S4.exr", spec, 3072.0), 512), Some(true));
}

#[test]
fn a_material_wrong_by_two_percent_is_found() {
    for (file, name, samples) in [("S1.exr", "sphere", 3072.0), ("S2.exr", "sphere-on-plane", 4096.0)] {
        let mut spec = builtin(name).expect("built in");
        spec.materials.get_mut("ball").expect("a ball").kd = Some([0.51; 3]);
        assert_ne!(agrees(&(file, spec, samples), 1024), Some(true), "{file}");
    }
}
