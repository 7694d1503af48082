//! Pictures against converged ones of another renderer (Mitsuba 3.9.1), where those are present.
//!
//! The reference is averaged over squares of 8 × 8 pixels, which are the pixels of a picture of the eighth resolution, so that a
//! short render has enough samples per pixel for its mean to be normally distributed.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use std::path::{Path, PathBuf};

use goniofit::control::Control;
use goniofit::image::{Image, compare, read_exr};
use goniofit::render::scene::{PhongLobeSpec, builtin};
use goniofit::render::{Film, Materials, Options, Scene, SceneSpec, render};

const SHRINK: usize = 8;

fn reference_file(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/reference").join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: the reference picture {name} is not here");
    None
}

/// Means over squares of `by` pixels; standard errors of independent pixels add in squares.
fn shrink(image: &Image, by: usize) -> Image {
    let (width, height) = (image.width / by, image.height / by);
    let n = (by * by) as f64;
    let square = |i: usize| {
        let (x, y) = (by * (i % width), by * (i / width));
        (0..by * by).map(move |k| (y + k / by) * image.width + x + k % by)
    };
    let mean = |i: usize| [0, 1, 2].map(|c| square(i).map(|k| image.radiance[k][c]).sum::<f64>() / n);
    let error = |errors: &[[f64; 3]], i: usize| {
        [0, 1, 2].map(|c| square(i).map(|k| errors[k][c].powi(2)).sum::<f64>().sqrt() / n)
    };
    Image {
        width,
        height,
        radiance: (0..width * height).map(mean).collect(),
        standard_error: image.standard_error.as_ref().map(|e| (0..width * height).map(|i| error(e, i)).collect()),
        ..Image::default()
    }
}

/// Variance over the area of each large pixel of what the reference shows, so without the noise of light paths: between its small
/// pixels, plus within each at most (high − v)(v − low) (Bhatia, Davis 2000), low and high being the range of v's neighbours.
///
/// An edge that covers less of a pixel than one sample is seen by none of them or by one: where a picture's own estimate of
/// its variance misses an edge, this one does not.
fn variance_of_edges(reference: &Image, by: usize) -> Vec<[f64; 3]> {
    let (width, height) = (reference.width, reference.height);
    let within = |x: usize, y: usize, c: usize| {
        let v = reference.radiance[y * width + x][c];
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let near = (y.saturating_sub(1)..(y + 2).min(height)).flat_map(|j| columns.clone().map(move |i| j * width + i));
        let (low, high) = near.map(|k| reference.radiance[k][c]).fold((v, v), |(l, h), v| (l.min(v), h.max(v)));
        (high - v) * (v - low)
    };
    let small = |i: usize| {
        let (x, y) = (by * (i % (width / by)), by * (i / (width / by)));
        (0..by * by).map(move |k| (x + k % by, y + k / by))
    };
    let variance = |i: usize, c: usize| {
        let n = (by * by) as f64;
        let mean = small(i).map(|(x, y)| reference.radiance[y * width + x][c]).sum::<f64>() / n;
        let spread = |(x, y): (usize, usize)| (reference.radiance[y * width + x][c] - mean).powi(2) + within(x, y, c);
        small(i).map(spread).sum::<f64>() / n
    };
    (0..width / by * (height / by)).map(|i| [0, 1, 2].map(|c| variance(i, c))).collect()
}

/// Mean variance over the 5 × 5 pixels round each. Where one light path in some thousands carries much of the light (from the floor
/// to the highlight of the ball), most pixels have seen none, and their own variance says nothing of it; their neighbours' does.
fn variance_nearby(image: &Image) -> Vec<[f64; 3]> {
    let errors = image.standard_error.as_ref().expect("rendered");
    let near = |i: usize, reach: usize, end: usize| i.saturating_sub(reach)..(i + reach + 1).min(end);
    let pooled = |i: usize, c: usize| {
        let (x, y) = (i % image.width, i / image.width);
        let cells = near(y, 2, image.height).flat_map(|j| near(x, 2, image.width).map(move |i| j * image.width + i));
        let (sum, count) = cells.fold((0.0, 0.0), |(sum, count), k| (sum + errors[k][c].powi(2), count + 1.0));
        sum / count
    };
    (0..errors.len()).map(|i| [0, 1, 2].map(|c| pooled(i, c))).collect()
}

/// The picture with the largest of its own variance, that nearby and that of its edges; the reference, which states none, with that of the picture's single samples over
/// its own number of them, or with that of the edges, and 10⁻⁶ of the value.
fn with_noise(
    film: &Film,
    reference: &Image,
    edges: &[[f64; 3]],
    samples: f64,
    reference_samples: f64,
) -> (Image, Image) {
    let image = film.to_image();
    let own = image.standard_error.as_ref().expect("rendered");
    let nearby = variance_nearby(&image);
    let largest = |i: usize, c: usize| own[i][c].powi(2).max(nearby[i][c]).max(edges[i][c] / samples).sqrt();
    let errors: Vec<[f64; 3]> = (0..own.len()).map(|i| [0, 1, 2].map(|c| largest(i, c))).collect();
    let single = |i: usize| {
        let at = |n: usize| u32::try_from(n).expect("a small picture");
        film.sample_deviation(at(i % image.width), at(i / image.width)).expect("a pixel")
    };
    let theirs = |i: usize| {
        let deviation = single(i);
        let variance = |c: usize| (deviation[c] * deviation[c]).max(edges[i][c]) / reference_samples;
        [0, 1, 2].map(|c| variance(c).sqrt().hypot(1e-6 * reference.radiance[i][c]))
    };
    let theirs = Image { standard_error: Some((0..own.len()).map(theirs).collect()), ..reference.clone() };
    (Image { standard_error: Some(errors), ..image }, theirs)
}

/// Renders the scene and tests every pixel, and every block of 4 × 4 of them, against the reference at 1 %. Answers whether
/// they agree; `None` where there is no reference.
fn agrees(file: &str, spec: &SceneSpec, samples: u32, reference_samples: f64) -> Option<bool> {
    let full = read_exr(&reference_file(file)?).expect("reads");
    let built = Scene::build(spec, Path::new("."), &Materials::new()).expect("builds");
    let size = (full.width / SHRINK) as u32;
    let options = Options { width: size, height: size, samples, seed: 7, ..Options::default() };
    let film = render(&built, &options, Control::silent()).expect("renders");
    let edges = variance_of_edges(&full, SHRINK);
    let per_large_pixel = reference_samples * (SHRINK * SHRINK) as f64;
    let (image, reference) = with_noise(&film, &shrink(&full, SHRINK), &edges, f64::from(samples), per_large_pixel);
    let agree = [1, 4].map(|blocks| {
        let comparison = compare(&shrink(&image, blocks), &shrink(&reference, blocks)).expect("same size");
        let s = comparison.significance.expect("noise is known");
        println!(
            "{file}: blocks of {blocks}, max |z| {:.2} at {:?}, mean z² {:.3}, p {:.3}",
            s.max_z, s.at, s.mean_z2, s.p
        );
        !s.differs
    });
    Some(agree == [true; 2])
}

fn check(file: &str, spec: &SceneSpec, samples: u32, reference_samples: f64) {
    assert_ne!(agrees(file, spec, samples, reference_samples), Some(false), "{file}");
}

fn phong(name: &str, kd: [f64; 3], n: f64) -> SceneSpec {
    let mut spec = builtin(name).expect("built in");
    let ball = spec.materials.get_mut("ball").expect("a ball");
    ball.kd = Some(kd);
    ball.phong = vec![PhongLobeSpec { ks: [0.5; 3], n }];
    spec
}

#[test]
fn sphere() {
    check("S1.exr", &builtin("sphere").expect("built in"), 1024, 4096.0);
}

#[test]
fn sphere_on_plane() {
    check("S2.exr", &builtin("sphere-on-plane").expect("built in"), 1024, 4096.0);
}

#[test]
fn sphere_on_plane_phong() {
    check("S2-phong.exr", &phong("sphere-on-plane", [0.35, 0.12, 0.06], 60.0), 1024, 3072.0);
}

#[test]
fn cornell() {
    check("S3.exr", &builtin("cornell").expect("built in"), 512, 2304.0);
}

#[test]
fn cornell_phong() {
    check("S3-phong.exr", &phong("cornell", [0.1, 0.2, 0.4], 40.0), 512, 2048.0);
}

#[test]
fn mesh_env() {
    check("S4.exr", &builtin("mesh-env").expect("built in"), 512, 3072.0);
}

#[test]
fn a_sky_turned_by_three_degrees_is_found() {
    let mut spec = builtin("mesh-env").expect("built in");
    spec.lights.environment.as_mut().expect("a sky").rotate_deg = Some(3.0);
    assert_ne!(agrees("S4.exr", &spec, 512, 3072.0), Some(true));
}

#[test]
fn a_material_wrong_by_two_percent_is_found() {
    for (file, name, samples) in [("S1.exr", "sphere", 3072), ("S2.exr", "sphere-on-plane", 4096)] {
        let mut spec = builtin(name).expect("built in");
        spec.materials.get_mut("ball").expect("a ball").kd = Some([0.51; 3]);
        assert_ne!(agrees(file, &spec, 1024, f64::from(samples)), Some(true), "{file}");
    }
}
