//! The film: passes over the picture, and what every pixel has gathered.

use std::time::Instant;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::RenderError;
use super::camera::Camera;
use super::integrator::{PathResult, Strategy, Tracer, Watch};
use super::layers::{Gathered, LayerSet, Sight, layer};
use super::packet::{FlatScene, Found, Packets, Plan};
use super::pixel::Pixel;
use super::scene::{Scene, SceneSpec};
use crate::control::Control;
use crate::image::{Image, Metadata};
use crate::numeric::random::RngExt;
use crate::numeric::simd::LANES;

/// Samples of a pixel in one pass at most.
const PASS: u32 = 32;

/// Pixels of a picture at most: 8192 × 8192, which takes about 12 GB, and with all of [`LayerSet::NAMED`] about 2.5 times that.
pub const MAX_PIXELS: u64 = 1 << 26;

/// What to render.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Width, pixels, 1 to 16384; width × height at most 2²⁶.
    pub width: u32,
    /// Height, pixels, 1 to 16384.
    pub height: u32,
    /// Samples per pixel, 1 to 2²⁴.
    pub samples: u32,
    /// Key of all random numbers.
    pub seed: u64,
    /// How lights are found.
    pub strategy: Strategy,
    /// Layers to gather beside the radiance; none by default, which takes no time.
    pub layers: LayerSet,
}

impl Default for Options {
    fn default() -> Self {
        let (strategy, layers) = (Strategy::default(), LayerSet::default());
        Self { width: 512, height: 512, samples: 64, seed: 0, strategy, layers }
    }
}

impl Options {
    /// The resolution and samples that a scene file asks for.
    #[must_use]
    pub fn of(spec: &SceneSpec) -> Self {
        let [width, height] = spec.film.resolution;
        Self { width, height, samples: spec.film.samples, ..Self::default() }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`RenderError::Field`] for the first field that is out of range.
    pub fn validate(&self) -> Result<(), RenderError> {
        let fields = [("width", self.width, 16384), ("height", self.height, 16384), ("samples", self.samples, 1 << 24)];
        for (field, value, most) in fields {
            if !(1..=most).contains(&value) {
                let (origin, field, value) = ("render options".into(), field.into(), value.to_string());
                return Err(RenderError::Field { origin, field, value, constraint: format!("from 1 to {most}") });
            }
        }
        if u64::from(self.width) * u64::from(self.height) > MAX_PIXELS {
            let value = format!("{} × {}", self.width, self.height);
            let constraint = format!("at most {MAX_PIXELS} pixels (8192 × 8192)");
            let (origin, field) = ("render options".into(), "width × height".into());
            return Err(RenderError::Field { origin, field, value, constraint });
        }
        Ok(())
    }
}

/// A rendered picture: per pixel and channel the mean of its samples and its standard error. Row 0 is on top.
#[derive(Debug, Clone)]
pub struct Film {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Wall-clock time that it took, s.
    pub seconds: f64,
    /// Samples that were not finite; each of them leaves its pixel not finite. Always 0 but for a mistake of the program.
    pub not_finite: u64,
    scene: String,
    plan: String,
    seed: u64,
    pixels: Vec<Pixel>,
    layers: LayerSet,
    /// One for each pixel where there are layers, else none.
    gathered: Vec<Gathered>,
}

impl Film {
    /// Mean radiance of the pixel in column x and row y, W/(sr·m²); `None` outside of the picture.
    #[must_use]
    pub fn radiance(&self, x: u32, y: u32) -> Option<DVec3> {
        Some(self.pixel(x, y)?.mean())
    }

    /// Standard error of [`Film::radiance`]; infinite below two samples.
    #[must_use]
    pub fn standard_error(&self, x: u32, y: u32) -> Option<DVec3> {
        Some(self.pixel(x, y)?.standard_error())
    }

    /// Number of samples of the pixel with the fewest: fewer than asked for where the work was stopped.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.pixels.iter().map(|p| p.samples).min().unwrap_or(0)
    }

    /// Number of all samples taken.
    #[must_use]
    pub fn total_samples(&self) -> u64 {
        self.pixels.iter().map(|p| u64::from(p.samples)).sum()
    }

    /// The picture with its layers. `mask` is the mean over the pixel's paths of the largest weight at which each asked for a value
    /// that nobody measured: the expected share of the pixel's light that is unknown, whatever the number of samples.
    ///
    /// A pixel without samples (of a render that was stopped early) has radiance 0, an infinite standard error and the mask 1,
    /// so it takes part in no comparison; where there is one, `metadata.samples` is `Some(0)`.
    #[must_use]
    pub fn to_image(&self) -> Image {
        let share = |p: &Pixel| if p.samples == 0 { 1.0 } else { p.unknown / f64::from(p.samples) };
        Image {
            width: self.width as usize,
            height: self.height as usize,
            radiance: self.pixels.iter().map(|p| p.mean().to_array()).collect(),
            standard_error: Some(self.pixels.iter().map(|p| p.standard_error().to_array()).collect()),
            mask: Some(self.pixels.iter().map(share).collect()),
            metadata: Metadata {
                scene: Some(self.scene.clone()),
                seed: Some(self.seed),
                samples: Some(self.samples()),
                seconds: Some(self.seconds),
                program: Some(format!("goniofit {}", env!("CARGO_PKG_VERSION"))),
                plan: Some(self.plan.clone()),
            },
            layers: self.layers.kinds().filter_map(|kind| layer(kind, &self.gathered)).collect(),
        }
    }

    fn pixel(&self, x: u32, y: u32) -> Option<&Pixel> {
        (x < self.width).then(|| self.pixels.get(y as usize * self.width as usize + x as usize))?
    }
}

/// Renders a scene on the current thread pool.
///
/// The picture is rendered in passes of a growing number of samples per pixel. When the work is stopped, every pixel keeps what
/// it has, so a stop after the first pass leaves a whole picture with fewer samples. The bits of the result depend on nothing
/// but the scene, the options and, when stopped, on the number of samples that each pixel got.
///
/// # Errors
/// [`RenderError::Field`] where an option is out of range, [`RenderError::Memory`] where the picture does not fit.
pub fn render(scene: &Scene, options: &Options, control: Control<'_>) -> Result<Film, RenderError> {
    options.validate()?;
    let start = Instant::now();
    let width = options.width as usize;
    let count = u64::from(options.width) * u64::from(options.height);
    let mut pixels = reserved(options, count as usize)?;
    let mut gathered = Vec::new();
    if !options.layers.is_empty() {
        gathered = reserved(options, count as usize)?;
        gathered.resize(count as usize, Gathered::default());
    }
    (0..count as usize).into_par_iter().map(|i| Pixel::new(options.seed, i as u64)).collect_into_vec(&mut pixels);
    let mut film = Film {
        width: options.width,
        height: options.height,
        seconds: 0.0,
        not_finite: 0,
        scene: scene.name.clone(),
        plan: plan(scene, options),
        seed: options.seed,
        pixels,
        layers: options.layers,
        gathered,
    };
    let camera = Camera::new(&scene.camera, scene.origin, options.width, options.height);
    let tracer = Tracer::new(scene, options.strategy);
    let flat = FlatScene::of(scene).filter(|_| options.strategy == Strategy::Combined);
    let packets = flat.as_ref().map(|scene| Packets { scene, plan: Plan::of(scene), camera, seed: options.seed });
    control.progress.start("render", u64::from(options.samples) * u64::from(options.height));
    let mut done = 0;
    while done < options.samples && !control.stop.requested() {
        let least = if packets.is_some() { LANES as u32 } else { 1 };
        let pass = done.clamp(least, PASS).min(options.samples - done);
        let mut gathered: Vec<_> = film.gathered.chunks_mut(width).map(Some).collect();
        gathered.resize_with(options.height as usize, || None);
        let rows = film.pixels.par_chunks_mut(width).zip(gathered).enumerate();
        let bad = rows.map(|(y, (row, gathered))| {
            if control.stop.requested() {
                return 0;
            }
            let bad = match (gathered, &packets) {
                (None, Some(packets)) => packet_row(packets, y, row, (done, pass)),
                (None, None) => render_row(&tracer, &camera, y, row, pass, |_, (): &(), _| {}),
                (Some(g), _) => {
                    render_row(&tracer, &camera, y, row, pass, |x, sight: &Sight, path| g[x].add(sight, path.radiance))
                }
            };
            control.progress.advance(u64::from(pass));
            bad
        });
        film.not_finite += bad.sum::<u64>();
        done += pass;
    }
    control.progress.finish();
    film.seconds = start.elapsed().as_secs_f64();
    Ok(film)
}

/// Room for `count` pixels: a picture that does not fit into memory is an error, not the end of the program.
fn reserved<T>(options: &Options, count: usize) -> Result<Vec<T>, RenderError> {
    let mut pixels = Vec::new();
    let refused = |_| {
        let bytes = count as f64 * size_of::<T>() as f64;
        RenderError::Memory { width: options.width, height: options.height, gigabytes: bytes * 1e-9 }
    };
    pixels.try_reserve_exact(count).map_err(refused)?;
    Ok(pixels)
}

/// In one line, what is computed.
fn plan(scene: &Scene, options: &Options) -> String {
    let lights = match options.strategy {
        Strategy::Combined => "lights sampled by position and by material",
        Strategy::MaterialOnly => "lights sampled by material",
        Strategy::LightsOnly => "lights sampled by position",
    };
    let layers = if options.layers.is_empty() { "none".into() } else { options.layers.names() };
    format!("paths of at most {} scattering events, {lights}; further layers: {layers}", scene.max_bounces)
}

/// Adds `samples` paths to every pixel of a row, and tells `gather` of each, with its column and what was watched; the number of
/// those that were not finite.
fn render_row<W: Watch + Default>(
    tracer: &Tracer<'_>,
    camera: &Camera,
    y: usize,
    row: &mut [Pixel],
    samples: u32,
    mut gather: impl FnMut(usize, &W, &PathResult),
) -> u64 {
    let mut bad = 0;
    for (x, pixel) in row.iter_mut().enumerate() {
        for _ in 0..samples {
            let jitter = DVec2::new(pixel.rng.random(), pixel.rng.random());
            let ray = camera.ray(DVec2::new(x as f64, y as f64) + jitter);
            let mut watch = W::default();
            let path = tracer.trace(ray, &mut pixel.rng, &mut watch);
            debug_assert!(path.radiance.is_finite(), "pixel ({x}, {y}): radiance {}", path.radiance);
            bad += u64::from(!path.radiance.is_finite());
            pixel.add(&path);
            gather(x, &watch, &path);
        }
    }
    bad
}

/// The same by packets: those of the last that are too many don't count.
fn packet_row(packets: &Packets<'_>, y: usize, row: &mut [Pixel], (done, samples): (u32, u32)) -> u64 {
    let mut bad = 0;
    let width = row.len();
    let mut take = |x: usize, packet: u32, found: &Found| {
        let left = (samples as usize - packet as usize * LANES).min(LANES);
        for ((r, g), b) in found[0].iter().zip(&found[1]).zip(&found[2]).take(left) {
            let radiance = DVec3::new(*r, *g, *b);
            debug_assert!(radiance.is_finite(), "pixel ({x}, {y}): radiance {radiance}");
            bad += u64::from(!radiance.is_finite());
            row[x].add(&PathResult { radiance, unknown: 0.0 });
        }
    };
    packets.row(y, width, done, samples.div_ceil(LANES as u32), &mut take);
    bad
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_have_at_most_as_many_pixels_as_stated() {
        let of = |width, height| Options { width, height, ..Options::default() }.validate();
        for (width, height) in [(8192, 8192), (16384, 4096), (1, 16384)] {
            assert!(of(width, height).is_ok(), "{width} × {height}");
        }
        for (width, height) in [(16384, 16384), (8192, 8193), (16384, 4097)] {
            let message = of(width, height).expect_err("too large").to_string();
            let names = message.contains(&format!("`width × height` is {width} × {height}"));
            assert!(names && message.contains("67108864"), "{message}");
        }
    }

    #[test]
    fn memory_that_is_not_there_is_an_error() {
        let error = reserved::<Pixel>(&Options::default(), usize::MAX / 2).expect_err("more than there is");
        assert!(matches!(error, RenderError::Memory { width: 512, height: 512, .. }), "{error}");
    }
}
