//! The film: passes over the picture, and what every pixel has gathered.

use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::prelude::*;

use super::RenderError;
use super::camera::Camera;
use super::integrator::{PathResult, Strategy, Tracer, Watch};
use super::layers::{Gathered, LayerSet, Sight, layer};
use super::noise::{DOUBT_OF_ONE, Noise, PictureError, relative_squares, standard_errors};
use super::packet::{FlatScene, Packets};
use super::pixel::Pixel;
use super::plan::Plan;
use super::points::{Draws, keys_of};
use super::scene::{Scene, SceneSpec};
use super::schedule::Schedule;
use super::tiles::{TILE, TILE_ROOM, Tile, Tiles};
use crate::control::Control;
use crate::image::{Image, Metadata};

/// Samples that a tile's pixels get between two looks at the clock and the wish to stop.
const PASS: u32 = 32;

/// How often the error so far is told, at most, where no target asks for it: it takes a pass over the picture.
const TOLD_EVERY: Duration = Duration::from_secs(1);

/// Pixels of a picture at most, which take about 12 GB, and with all of [`LayerSet::NAMED`] about 3.4 times that.
pub const MAX_PIXELS: u64 = crate::image::MAX_PIXELS;

/// What to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Width, pixels, 1 to 16384; width × height at most 2²⁶.
    pub width: u32,
    /// Height, pixels, 1 to 16384.
    pub height: u32,
    /// Samples per pixel, 1 to 2²⁴; where there is a target or a budget, the most that a pixel may get.
    pub samples: u32,
    /// Relative error that the picture may have ([`PictureError::at_most`]), above 0: samples go where it is noisy until that is met.
    pub target_error: Option<f64>,
    /// When work ends at the latest: the best by then, or what meets the target.
    pub deadline: Option<Instant>,
    /// Key of all random numbers.
    pub seed: u64,
    /// How lights are found.
    pub strategy: Strategy,
    /// Layers to gather beside the radiance; none by default, which takes no time.
    pub layers: LayerSet,
    /// What to compute; by default what the scene calls for.
    pub plan: Option<Plan>,
}

impl Default for Options {
    fn default() -> Self {
        let (strategy, layers) = (Strategy::default(), LayerSet::default());
        let (target_error, deadline) = (None, None);
        Self { width: 512, height: 512, samples: 64, target_error, deadline, seed: 0, strategy, layers, plan: None }
    }
}

impl Options {
    /// The resolution and samples that a scene file asks for.
    #[must_use]
    pub fn of(spec: &SceneSpec) -> Self {
        let [width, height] = spec.film.resolution;
        Self { width, height, samples: spec.film.samples, ..Self::default() }
    }

    /// What is computed for a scene.
    fn plan_for(&self, scene: &Scene) -> Plan {
        let plan = self.plan.unwrap_or_else(|| Plan::of(scene));
        // Packets know one way to find lights, and gather no layers.
        let packets = plan.packets && self.strategy == Strategy::Combined && self.layers.is_empty();
        // Without closed forms light must be found.
        let chance = if plan.closed_forms && !packets { scene.rays_find_light() } else { plan.chance };
        Plan { packets, chance, closed_forms: plan.closed_forms && packets, ..plan }
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
        if let Some(target) = self.target_error.filter(|t| !(*t > 0.0 && t.is_finite())) {
            let (origin, field, value) = ("render options".into(), "target_error".into(), target.to_string());
            return Err(RenderError::Field { origin, field, value, constraint: "above 0 and finite".into() });
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
    /// Rays that were sent out, those towards lights among them where something may hide these.
    pub rays: u64,
    scene: String,
    plan: String,
    seed: u64,
    tiles: Tiles,
    /// Tile after tile.
    pixels: Vec<Pixel>,
    layers: LayerSet,
    /// One for each pixel where there are layers, else none.
    gathered: Vec<Gathered>,
    /// The chance that the bound of its error doesn't hold.
    doubt: f64,
}

impl Film {
    /// Mean radiance of the pixel in column x and row y, W/(sr·m²); `None` outside of the picture.
    #[must_use]
    pub fn radiance(&self, x: u32, y: u32) -> Option<DVec3> {
        Some(self.pixels[self.slot(x, y)?].mean())
    }

    /// Standard error of [`Film::radiance`]; infinite below two samples.
    #[must_use]
    pub fn standard_error(&self, x: u32, y: u32) -> Option<DVec3> {
        let slot = self.slot(x, y)?;
        let index = slot / TILE_ROOM;
        Some(standard_errors(self.tiles.tile(index), self.tile_pixels(index))[slot % TILE_ROOM])
    }

    /// Standard deviation of one sample of the pixel; infinite below two samples. Samples of one pixel are more even than independent
    /// ones, so [`Film::standard_error`] is usually less than this over the root of their number.
    #[must_use]
    pub fn sample_deviation(&self, x: u32, y: u32) -> Option<DVec3> {
        let pixel = &self.pixels[self.slot(x, y)?];
        Some((pixel.scatter() * f64::from(pixel.samples)).map(f64::sqrt))
    }

    /// Number of samples of the pixel with the fewest: fewer than asked for where the work was stopped.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.tiles.slots().map(|slot| self.pixels[slot].samples).min().unwrap_or(0)
    }

    /// Number of all samples taken.
    #[must_use]
    pub fn total_samples(&self) -> u64 {
        self.tiles.slots().map(|slot| u64::from(self.pixels[slot].samples)).sum()
    }

    /// How far off the picture is, as far as its noise says; `None` where a pixel has fewer than two samples.
    #[must_use]
    pub fn error(&self) -> Option<PictureError> {
        (self.samples() >= 2).then(|| Noise::all(&self.noise()).error(self.doubt))
    }

    /// How far the picture is off another of its size, which stands for the truth, measured as [`PictureError`] is; pixels that one of them lacks
    /// don't count.
    #[must_use]
    pub fn off_by(&self, truth: &Self) -> f64 {
        let mean = truth.mean();
        let pixels = (0..truth.height).flat_map(|y| (0..truth.width).map(move |x| (x, y)));
        let pairs = pixels.filter_map(|(x, y)| Some((self.radiance(x, y)?, truth.radiance(x, y)?)));
        let sum: f64 = pairs.map(|(p, q)| relative_squares((p - q) * (p - q), q, mean)).sum();
        (sum / (3.0 * f64::from(truth.width) * f64::from(truth.height))).sqrt()
    }

    /// The picture with its layers. `mask` is the mean over the pixel's paths of the largest weight at which each asked for a value
    /// that nobody measured: the expected share of the pixel's light that is unknown, whatever the number of samples.
    ///
    /// A pixel without samples (of a render that was stopped early) has radiance 0, an infinite standard error and the mask 1,
    /// so it takes part in no comparison; where there is one, `metadata.samples` is `Some(0)`.
    #[must_use]
    pub fn to_image(&self) -> Image {
        let share = |p: &Pixel| if p.samples == 0 { 1.0 } else { p.unknown / f64::from(p.samples) };
        let errors = |i: usize| standard_errors(self.tiles.tile(i), self.tile_pixels(i));
        let errors: Vec<DVec3> = (0..self.tiles.count()).into_par_iter().flat_map_iter(errors).collect();
        let slots = || self.tiles.slots();
        let gathered: Vec<&Gathered> = slots().filter_map(|slot| self.gathered.get(slot)).collect();
        Image {
            width: self.width as usize,
            height: self.height as usize,
            radiance: slots().map(|slot| self.pixels[slot].mean().to_array()).collect(),
            standard_error: Some(slots().map(|slot| errors[slot].to_array()).collect()),
            mask: Some(slots().map(|slot| share(&self.pixels[slot])).collect()),
            metadata: Metadata {
                scene: Some(self.scene.clone()),
                seed: Some(self.seed),
                samples: Some(self.samples()),
                mean_samples: Some(self.total_samples() as f64 / (f64::from(self.width) * f64::from(self.height))),
                seconds: Some(self.seconds),
                relative_error: self.error().map(|e| [e.relative, e.at_most]),
                program: Some(format!("goniofit {}", env!("CARGO_PKG_VERSION"))),
                plan: Some(self.plan.clone()),
            },
            layers: self.layers.kinds().filter_map(|kind| layer(kind, &gathered)).collect(),
        }
    }

    fn slot(&self, x: u32, y: u32) -> Option<usize> {
        (x < self.width && y < self.height).then(|| self.tiles.slot(x as usize, y as usize))
    }

    fn tile_pixels(&self, index: usize) -> &[Pixel] {
        &self.pixels[index * TILE_ROOM..][..TILE_ROOM]
    }

    /// Mean radiance of the picture.
    fn mean(&self) -> f64 {
        let part = |i: usize| -> f64 {
            let pixels = self.tile_pixels(i);
            self.tiles.tile(i).slots().map(|slot| pixels[slot].mean().element_sum()).sum()
        };
        let parts: Vec<f64> = (0..self.tiles.count()).into_par_iter().map(part).collect();
        parts.iter().sum::<f64>() / (3 * self.width as usize * self.height as usize) as f64
    }

    /// How far off its tiles are.
    fn noise(&self) -> Vec<Noise> {
        let mean = self.mean();
        let noise = |i: usize| Noise::of(self.tiles.tile(i), self.tile_pixels(i), mean);
        (0..self.tiles.count()).into_par_iter().map(noise).collect()
    }
}

/// Renders a scene on the current thread pool.
///
/// The picture is rendered in rounds of a growing number of samples per pixel. When the work is stopped, every pixel keeps what
/// it has, so a stop after the first round leaves a whole picture with fewer samples. The bits of the result depend on nothing
/// but the scene, the options and, when stopped or out of time, on the number of samples that each pixel got.
///
/// # Errors
/// [`RenderError::Field`] where an option is out of range, [`RenderError::Memory`] where the picture does not fit.
pub fn render(scene: &Scene, options: &Options, control: Control<'_>) -> Result<Film, RenderError> {
    options.validate()?;
    let plan = options.plan_for(scene);
    let start = Instant::now();
    let tiles = Tiles { width: options.width as usize, height: options.height as usize };
    let room = tiles.count() * TILE_ROOM;
    let mut film = Film {
        width: options.width,
        height: options.height,
        seconds: 0.0,
        not_finite: 0,
        rays: 0,
        scene: scene.name.clone(),
        plan: in_words(scene, plan, options),
        seed: options.seed,
        tiles,
        pixels: filled(options, room)?,
        layers: options.layers,
        gathered: if options.layers.is_empty() { Vec::new() } else { filled(options, room)? },
        doubt: DOUBT_OF_ONE,
    };
    let camera = Camera::new(&scene.camera, scene.origin, scene.filter, options.width, options.height);
    let flat = FlatScene::of(scene).filter(|_| plan.packets);
    let packets = flat.as_ref().map(|scene| Packets::new(scene, plan, camera, options.seed));
    let tracer = Tracer::new(scene, options.strategy, plan);
    let painter = Painter { tracer, camera, seed: options.seed, packets };
    let mut schedule = Schedule::new(options, tiles.count(), start);
    if !schedule.adapts() {
        control.progress.start("render", u64::from(options.samples) * tiles.count() as u64);
    }
    let mut more = Some(schedule.first(if painter.packets.is_some() { 8 } else { 1 }));
    let (mut state, mut told) = (String::new(), start);
    while let Some(round) = more.take() {
        if schedule.adapts() {
            control.progress.start("render, next round", round.iter().map(|n| u64::from(*n)).sum());
            control.progress.tell(&state);
        }
        let counts = paint(&painter, &mut film, &schedule, &round, control);
        film.not_finite += counts.not_finite;
        film.rays += counts.rays;
        schedule.advance(&round);
        let over = control.stop.requested() || schedule.deadline().is_some_and(|end| Instant::now() >= end);
        if !over {
            let is_time = control.progress.is_seen() && told.elapsed() >= TOLD_EVERY && film.samples() >= 2;
            let noise = if schedule.adapts() || is_time { film.noise() } else { Vec::new() };
            if !noise.is_empty() {
                told = Instant::now();
                state = format!("error {:.2} %", 100.0 * Noise::all(&noise).relative());
                control.progress.tell(&state);
            }
            more = schedule.next(&noise);
            film.doubt = schedule.doubt();
        }
    }
    control.progress.finish();
    film.seconds = start.elapsed().as_secs_f64();
    Ok(film)
}

/// Room for `count` values: a picture that does not fit into memory is an error, not the end of the program.
fn filled<T: Clone + Default>(options: &Options, count: usize) -> Result<Vec<T>, RenderError> {
    let mut values = Vec::new();
    let refused = |_| {
        let bytes = count as f64 * size_of::<T>() as f64;
        RenderError::Memory { width: options.width, height: options.height, gigabytes: bytes * 1e-9 }
    };
    values.try_reserve_exact(count).map_err(refused)?;
    values.resize(count, T::default());
    Ok(values)
}

/// In one line, what is computed.
fn in_words(scene: &Scene, plan: Plan, options: &Options) -> String {
    let lights = match options.strategy {
        Strategy::Combined => "lights sampled by position and by material",
        Strategy::MaterialOnly => "lights sampled by material",
        Strategy::LightsOnly => "lights sampled by position",
    };
    let layers = if options.layers.is_empty() { "none".into() } else { options.layers.names() };
    let effects = plan.effects(scene).effects;
    let names = |on: bool| effects.iter().filter(|e| e.on == on).map(|e| e.name).collect::<Vec<_>>().join(", ");
    let events = plan.events(scene.max_bounces);
    format!(
        "paths of at most {events} scattering events, {lights}; on: {}; off: {}; further layers: {layers}",
        names(true),
        names(false)
    )
}

/// What is counted beside the picture.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    /// Samples that were not finite.
    not_finite: u64,
    rays: u64,
}

impl Counts {
    fn add(&mut self, path: &PathResult) {
        self.not_finite += u64::from(!path.radiance.is_finite());
        self.rays += u64::from(path.rays);
    }

    fn and(self, other: Self) -> Self {
        Self { not_finite: self.not_finite + other.not_finite, rays: self.rays + other.rays }
    }
}

/// Adds so many samples to the pixels of every tile.
fn paint(painter: &Painter<'_>, film: &mut Film, schedule: &Schedule, round: &[u32], control: Control<'_>) -> Counts {
    let tiles = film.tiles;
    let mut gathered: Vec<_> = film.gathered.chunks_mut(TILE_ROOM).map(Some).collect();
    gathered.resize_with(tiles.count(), || None);
    let deadline = schedule.deadline();
    let over = || control.stop.requested() || deadline.is_some_and(|end| Instant::now() >= end);
    let work = film.pixels.par_chunks_mut(TILE_ROOM).zip(gathered).enumerate();
    let counts = work.map(|(i, (pixels, mut gathered))| {
        let (mut done, end) = (schedule.have()[i], schedule.have()[i] + round[i]);
        let mut counts = Counts::default();
        while done < end && !over() {
            let pass = PASS.min(end - done);
            counts = counts.and(painter.paint(tiles.tile(i), pixels, gathered.as_deref_mut(), (done, pass)));
            done += pass;
            control.progress.advance(u64::from(pass));
        }
        counts
    });
    counts.reduce(Counts::default, Counts::and)
}

/// Follows paths through the pixels of a tile.
struct Painter<'a> {
    tracer: Tracer<'a>,
    camera: Camera,
    seed: u64,
    packets: Option<Packets<'a>>,
}

impl Painter<'_> {
    /// Adds `samples` paths to every pixel of a tile whose pixels have `done`.
    fn paint(&self, tile: Tile, pixels: &mut [Pixel], gathered: Option<&mut [Gathered]>, of: (u32, u32)) -> Counts {
        match (gathered, &self.packets) {
            (None, Some(packets)) => by_packets(packets, tile, pixels, of),
            (None, None) => self.one_by_one(tile, pixels, of, |_, (): &(), _| {}),
            (Some(gathered), _) => self.one_by_one(tile, pixels, of, |slot, sight: &Sight, path| {
                gathered[slot].add(sight, path.radiance);
            }),
        }
    }

    /// The same, one path at a time, telling `gather` of each, with its pixel's place and what was watched.
    fn one_by_one<W: Watch + Default>(
        &self,
        tile: Tile,
        pixels: &mut [Pixel],
        (done, samples): (u32, u32),
        mut gather: impl FnMut(usize, &W, &PathResult),
    ) -> Counts {
        let mut counts = Counts::default();
        let follow = self.tracer.follow::<W>();
        for slot in tile.slots() {
            let (x, y) = (tile.x + slot % TILE, tile.y + slot / TILE);
            let keys = keys_of(self.seed, x as u32, y as u32);
            for sample in done..done + samples {
                let draws = Draws::new(keys, sample);
                let ray = self.camera.ray(x, y, draws);
                let mut watch = W::default();
                let path = follow(&self.tracer, ray, draws, &mut watch);
                debug_assert!(path.radiance.is_finite(), "pixel ({x}, {y}): radiance {}", path.radiance);
                counts.add(&path);
                pixels[slot].add(&path);
                gather(slot, &watch, &path);
            }
        }
        counts
    }
}

/// The same by packets.
fn by_packets(packets: &Packets<'_>, tile: Tile, pixels: &mut [Pixel], (done, samples): (u32, u32)) -> Counts {
    let mut not_finite = 0;
    let mut take = |slot: usize, radiance: DVec3| {
        debug_assert!(radiance.is_finite(), "tile at ({}, {}), {slot}: radiance {radiance}", tile.x, tile.y);
        not_finite += u64::from(!radiance.is_finite());
        pixels[slot].add(&PathResult { radiance, unknown: 0.0, rays: 0 });
    };
    let rays = packets.tile(tile, done, samples, &mut take);
    Counts { not_finite, rays }
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
        let error = filled::<Pixel>(&Options::default(), usize::MAX / 2).expect_err("more than there is");
        assert!(matches!(error, RenderError::Memory { width: 512, height: 512, .. }), "{error}");
    }
}
