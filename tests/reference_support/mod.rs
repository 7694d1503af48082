//! Pictures against converged ones of another renderer (Mitsuba 3.9.1), where those are present: z-tests of pixels and of blocks of them.
#![allow(dead_code, clippy::expect_used, clippy::panic)] // each file uses a part

use std::path::{Path, PathBuf};

use goniofit::control::Control;
use goniofit::image::{Image, Significance, compare, read_exr};
use goniofit::numeric::stats::two_sided_p;
use goniofit::render::scene::{PhongLobeSpec, builtin};
use goniofit::render::{Film, Materials, Options, Scene, SceneSpec, render};

/// The pictures: file, scene, samples per pixel of the reference.
pub fn references() -> [(&'static str, SceneSpec, f64); 6] {
    let plain = |name: &str| builtin(name).expect("built in");
    [
        ("S1.exr", plain("sphere"), 4096.0),
        ("S2.exr", plain("sphere-on-plane"), 4096.0),
        ("S2-phong.exr", phong("sphere-on-plane", [0.35, 0.12, 0.06], 60.0), 3072.0),
        ("S3.exr", plain("cornell"), 2304.0),
        ("S3-phong.exr", phong("cornell", [0.1, 0.2, 0.4], 40.0), 2048.0),
        ("S4.exr", plain("mesh-env"), 3072.0),
    ]
}

/// A scene whose ball is a Phong lobe over a Lambert lobe.
fn phong(name: &str, kd: [f64; 3], n: f64) -> SceneSpec {
    let mut spec = builtin(name).expect("built in");
    let ball = spec.materials.get_mut("ball").expect("a ball");
    ball.kd = Some(kd);
    ball.phong = vec![PhongLobeSpec { ks: [0.5; 3], n }];
    spec
}

/// A reference picture; says so where it is not there.
pub fn reference_file(name: &str) -> Option<PathBuf> {
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

/// A picture of a scene, and its reference.
pub struct Shot {
    film: Film,
    full: Image,
    by: usize,
    samples: u32,
    /// Samples that each of its pixels has in the reference.
    theirs: f64,
}

impl Shot {
    /// Renders the scene at the reference's size over `by`; `None` where there is no reference.
    pub fn of((file, spec, theirs): &(&str, SceneSpec, f64), samples: u32, by: usize) -> Option<Self> {
        let full = read_exr(&reference_file(file)?).expect("reads");
        let built = Scene::build(spec, Path::new("."), &Materials::new()).expect("builds");
        let size = (full.width / by) as u32;
        let options = Options { width: size, height: size, samples, seed: 7, ..Options::default() };
        let film = render(&built, &options, Control::silent()).expect("renders");
        Some(Self { film, full, by, samples, theirs: theirs * (by * by) as f64 })
    }

    /// Both with their noise.
    pub fn with(&self, noise: Noise) -> Pair {
        let reference = shrink(&self.full, self.by);
        let (image, reference) = match noise {
            Noise::Careful => {
                let edges = variance_of_edges(&self.full, self.by);
                with_noise(&self.film, &reference, &edges, f64::from(self.samples), self.theirs)
            }
            Noise::Own => with_own_noise(&self.film, &reference, self.theirs),
        };
        Pair { image, reference }
    }
}

/// A picture and its reference with the noise of both.
pub struct Pair {
    pub image: Image,
    pub reference: Image,
}

/// How the noise of both pictures is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// From the picture's own samples: of the reference by its number of them, and 10⁻⁶ of the value.
    Own,
    /// The largest of that, the neighbours' and that of edges.
    Careful,
}

impl Pair {
    /// Tests means over blocks of `blocks` × `blocks` pixels at 1 %.
    pub fn tested(&self, blocks: usize) -> Significance {
        let (image, reference) = (shrink(&self.image, blocks), shrink(&self.reference, blocks));
        compare(&image, &reference).expect("same size").significance.expect("noise is known")
    }

    /// Largest |z| of means over blocks, mean z², and the probability of the largest (Šidák) if all were normally distributed.
    pub fn plain(&self, blocks: usize) -> (f64, f64, f64) {
        let (a, b) = (shrink(&self.image, blocks), shrink(&self.reference, blocks));
        let errors = |image: &Image| image.standard_error.clone().expect("noise is known");
        let (of_a, of_b) = (errors(&a), errors(&b));
        let z = |i: usize, c: usize| (a.radiance[i][c] - b.radiance[i][c]) / of_a[i][c].hypot(of_b[i][c]);
        let all = (0..a.radiance.len()).flat_map(|i| [0, 1, 2].map(|c| z(i, c))).filter(|z| !z.is_nan());
        let (max, sum, count) = all.fold((0.0f64, 0.0, 0usize), |(m, s, n), z| (m.max(z.abs()), s + z * z, n + 1));
        let p = -f64::exp_m1(count as f64 * f64::ln_1p(-two_sided_p(max)));
        (max, sum / count as f64, p)
    }
}

/// As the reference's own description says: the variance of the picture's single samples over the reference's number of them, and 10⁻⁶ of the value.
fn with_own_noise(film: &Film, reference: &Image, reference_samples: f64) -> (Image, Image) {
    let image = film.to_image();
    let theirs = |i: usize| {
        let at = |n: usize| u32::try_from(n).expect("a picture");
        let deviation = film.sample_deviation(at(i % image.width), at(i / image.width)).expect("a pixel");
        [0, 1, 2].map(|c| (deviation[c] / reference_samples.sqrt()).hypot(1e-6 * reference.radiance[i][c]))
    };
    let theirs =
        Image { standard_error: Some((0..reference.radiance.len()).map(theirs).collect()), ..reference.clone() };
    (image, theirs)
}
