//! Paths through a tile, a wave at a time.

use glam::DVec3;

use super::super::camera::Camera;
use super::super::plan::Plan;
use super::super::points::{Decision, keys_of};
use super::super::tiles::{TILE, Tile};
use super::flat::FlatScene;
use super::lobes::cosine_hemisphere;
use super::outline::Rules;
use super::shapes::Rays;
use super::surround::Surround;
use super::wave::{Group, Row, WAVE, Wave};
use crate::numeric::lanes::{LANES, Lanes, Mask, Vec3};
use crate::numeric::simd::{Kernel, Simd, vectorised};

/// Walks through a scene in packets.
#[derive(Debug)]
pub(in crate::render) struct Packets<'a> {
    pub(super) scene: &'a FlatScene<'a>,
    pub(super) plan: Plan,
    camera: Camera,
    seed: u64,
    /// The environment's closed form, where the plan has it.
    pub(super) surround: Option<Surround>,
    /// For lobes under quads that nothing can hide.
    pub(super) rules: Rules,
}

/// What takes a pixel's place in its tile, and the radiance of one of its samples: pixel by pixel, in their order.
type Take<'a> = &'a mut dyn FnMut(usize, DVec3);

impl<'a> Packets<'a> {
    /// Walks through a scene by a plan.
    pub fn new(scene: &'a FlatScene<'a>, plan: Plan, camera: Camera, seed: u64) -> Self {
        let surround = scene.surround().filter(|_| plan.closed_forms);
        Self { scene, plan, camera, seed, surround, rules: Rules::default() }
    }

    /// Whether what any quad shines on surfaces of most materials has a closed form.
    fn closes(&self) -> bool {
        self.plan.closed_forms && self.scene.closed.contains(&true)
    }

    /// Number of a decision.
    #[inline(always)]
    pub(super) fn decision(&self, bounce: u32, decision: Decision) -> u32 {
        decision.number(bounce, self.scene.lights.len())
    }

    /// Follows so many paths through every pixel of a tile, after the `done` that each has; how many rays they sent out.
    pub fn tile(&self, tile: Tile, done: u32, samples: u32, take: Take<'_>) -> u64 {
        vectorised(Work { packets: self, tile, done, samples, take })
    }

    /// Follows the paths of a wave to their ends; the code for closed forms of quads is there only where some are used.
    #[inline(always)]
    fn follow<S: Simd, const CLOSED: bool>(&self, simd: S, wave: &mut Wave) {
        let most = self.plan.events(self.scene.max_bounces);
        for bounce in 0..=most {
            wave.count_rays();
            for group in wave.groups() {
                self.arrive::<S, CLOSED>(simd, group, bounce);
            }
            wave.close_ranks();
            if wave.running() == 0 {
                return;
            }
            // Groups of paths that are at surfaces without Phong lobes don't compute any.
            let glossy = if self.scene.lobes > 0 { wave.sort(|owner| self.scene.is_glossy(owner)) } else { 0 };
            for (g, group) in wave.groups().iter_mut().enumerate() {
                if g * LANES < glossy {
                    self.shade::<S, true, CLOSED>(simd, group, bounce);
                } else {
                    self.shade::<S, false, CLOSED>(simd, group, bounce);
                }
            }
            wave.close_ranks();
        }
    }

    /// Begins the paths of a group.
    #[inline(always)]
    fn start<S: Simd>(&self, simd: S, group: &mut Group, (x, y): (Lanes<S>, Lanes<S>)) {
        let rays = self.camera_rays(simd, group, (x, y));
        let none = Vec3::splat(simd, DVec3::ZERO);
        group.put3(Row::Origin, rays.origin);
        group.put3(Row::Direction, rays.direction);
        group.put3(Row::Throughput, Vec3::splat(simd, DVec3::ONE));
        group.put3(Row::Radiance, none);
        group.put3(Row::Position, rays.origin);
        group.put3(Row::Normal, none);
        group.put(Row::Spread, Lanes::splat(simd, 0.0));
        group.put(Row::Aimed, Lanes::splat(simd, 0.0));
        group.note(simd, Row::Plain, Mask::splat(simd, false));
        group.note(simd, Row::Closed, Mask::splat(simd, false));
    }

    #[inline(always)]
    fn camera_rays<S: Simd>(&self, simd: S, group: &Group, (x, y): (Lanes<S>, Lanes<S>)) -> Rays<S> {
        let camera = &self.camera;
        let points = group.points();
        let (mut u, mut v) = points.pair(self.decision(0, Decision::Pixel));
        camera.filter.spread(&mut u);
        camera.filter.spread(&mut v);
        let (u, v) = (Lanes::load(simd, &u), Lanes::load(simd, &v));
        let one = Lanes::splat(simd, 1.0);
        let across = (u + x) * one.number(camera.pixel.x) - one;
        let down = (v + y) * one.number(camera.pixel.y) - one;
        let forward = Vec3::splat(simd, camera.forward);
        let sideways = forward.vector(camera.across).scaled_plus(across, forward);
        let direction = forward.vector(camera.down).scaled_plus(down, sideways);
        let t_max = one.number(f64::INFINITY);
        let position = forward.vector(camera.position);
        let Some(lens) = &camera.lens else {
            return Rays { origin: position, direction: direction.normalize(), t_max };
        };
        let (x, y) = points.pair(self.decision(0, Decision::Lens));
        let disc = cosine_hemisphere(Lanes::load(simd, &x), Lanes::load(simd, &y));
        let shift = forward.vector(lens.right).scaled_plus(disc.x, forward.vector(lens.up) * disc.y);
        let direction = direction.scaled_plus(one.number(lens.focus), -shift);
        Rays { origin: position + shift, direction: direction.normalize(), t_max }
    }
}

/// Paths of a tile's pixels.
struct Work<'a> {
    packets: &'a Packets<'a>,
    tile: Tile,
    done: u32,
    samples: u32,
    take: Take<'a>,
}

/// A path's pixel in its tile, the keys of that, and its sample.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    x: usize,
    y: usize,
    keys: [u64; 2],
    sample: u32,
}

impl Work<'_> {
    #[inline(always)]
    fn place(&self, x: usize, y: usize) -> Place {
        let keys = keys_of(self.packets.seed, (self.tile.x + x) as u32, (self.tile.y + y) as u32);
        Place { x, y, keys, sample: self.done }
    }

    /// The path after another: all of a pixel's, then the next one's, row after row.
    #[inline(always)]
    fn after(&self, place: Place) -> Place {
        let sample = place.sample.wrapping_add(1);
        if sample.wrapping_sub(self.done) < self.samples {
            Place { sample, ..place }
        } else if place.x + 1 < self.tile.width {
            self.place(place.x + 1, place.y)
        } else {
            self.place(0, place.y + 1)
        }
    }
}

impl Kernel for Work<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        if self.packets.closes() { self.walk::<S, true>(simd) } else { self.walk::<S, false>(simd) }
    }
}

impl Work<'_> {
    #[inline(always)]
    fn walk<S: Simd, const CLOSED: bool>(self, simd: S) -> u64 {
        let (packets, tile) = (self.packets, self.tile);
        let paths = tile.width * tile.height * self.samples as usize;
        let mut wave = Wave::new();
        let mut places = vec![Place::default(); WAVE];
        let mut next = self.place(0, 0);
        for first in (0..paths).step_by(WAVE) {
            let count = WAVE.min(paths - first);
            for place in &mut places[..count] {
                *place = next;
                next = self.after(next);
            }
            wave.begin(count, |path| (places[path].keys, places[path].sample));
            for (g, group) in wave.groups().iter_mut().enumerate() {
                let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
                for k in 0..LANES {
                    let place = &places[(g * LANES + k).min(count - 1)];
                    (x[k], y[k]) = ((tile.x + place.x) as f64, (tile.y + place.y) as f64);
                }
                packets.start(simd, group, (Lanes::load(simd, &x), Lanes::load(simd, &y)));
            }
            packets.follow::<S, CLOSED>(simd, &mut wave);
            for (place, radiance) in places.iter().zip(&wave.found()[..count]) {
                (self.take)(place.y * TILE + place.x, *radiance);
            }
        }
        wave.rays()
    }
}
