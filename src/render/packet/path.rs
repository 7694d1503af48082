//! Paths, eight abreast.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::super::camera::Camera;
use super::super::integrator::ROULETTE_AFTER;
use super::super::lights::{Light, QuadLight};
use super::super::plan::Plan;
use super::super::points::{Decision, Points, key_of};
use super::super::tiles::{TILE, Tile};
use super::closed::{Surround, projected_solid_angle};
use super::flat::{FlatScene, light_number};
use super::lights::{Arrivals, between, from_quad, quad_pdf};
use super::lobes::{Frames, LobesAt, cosine_hemisphere};
use super::occluders::Occluders;
use super::shapes::{Points3, Rays};
use crate::numeric::lanes::{Mask, Vec3};
use crate::numeric::simd::{Eight, Kernel, LANES, Lanes, Simd, vectorised};

/// What a packet found: radiance of each path, channel by channel.
pub(in crate::render) type Found = [Eight; 3];

/// Walks through a scene in packets.
#[derive(Debug)]
pub(in crate::render) struct Packets<'a> {
    scene: &'a FlatScene<'a>,
    plan: Plan,
    camera: Camera,
    seed: u64,
    /// The environment's closed form, where the plan has it.
    surround: Option<Surround>,
}

/// What takes a pixel's place in its tile, how many of its packets came before, and a packet.
type Take<'a> = &'a mut dyn FnMut(usize, u32, &Found);

impl<'a> Packets<'a> {
    /// Walks through a scene by a plan.
    pub fn new(scene: &'a FlatScene<'a>, plan: Plan, camera: Camera, seed: u64) -> Self {
        let surround = scene.surround().filter(|_| plan.closed_forms);
        Self { scene, plan, camera, seed, surround }
    }

    /// Whether what this light shines on surfaces without Phong lobes has a closed form.
    #[inline(always)]
    fn is_closed(&self, light: usize) -> bool {
        self.plan.closed_forms && self.scene.closed[light]
    }

    /// Follows so many packets of every pixel of a tile, after the `done` samples that each has.
    pub fn tile(&self, tile: Tile, done: u32, packets: u32, take: Take<'_>) {
        let work = Work { packets: self, tile, done, count: packets, take };
        if self.scene.lobes > 0 { vectorised(Planned::<true>(work)) } else { vectorised(Planned::<false>(work)) }
    }
}

/// Packets of a tile's pixels.
struct Work<'a> {
    packets: &'a Packets<'a>,
    tile: Tile,
    done: u32,
    count: u32,
    take: Take<'a>,
}

struct Planned<'a, const GLOSSY: bool>(Work<'a>);

impl<const GLOSSY: bool> Kernel for Planned<'_, GLOSSY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Work { packets, tile, done, count, take } = self.0;
        for slot in tile.slots() {
            let (x, y) = (tile.x + slot % TILE, tile.y + slot / TILE);
            let key = key_of(packets.seed, x as u32, y as u32);
            for packet in 0..count {
                let points = Points::new(key, done.wrapping_add(packet * LANES as u32));
                let one = One::<GLOSSY> { packets, x: x as f64, y: y as f64, points };
                take(slot, packet, &one.traced(simd));
            }
        }
    }
}

/// One packet.
struct One<'a, const GLOSSY: bool> {
    packets: &'a Packets<'a>,
    x: f64,
    y: f64,
    points: Points<LANES>,
}

/// Where the paths are.
struct State<S: Simd> {
    alive: Mask<S>,
    throughput: Vec3<S>,
    radiance: Vec3<S>,
    /// How and from where the ray was drawn.
    pdf: Lanes<S>,
    from: Vec3<S>,
    normal: Vec3<S>,
    /// Whether the last surface had no Phong lobes, so that lights in closed form need not be found from there.
    plain: Mask<S>,
}

/// Surfaces and the eye's directions in their frames.
struct Vertices<S: Simd> {
    at: Points3<S>,
    frame: Frames<S>,
    wo: Vec3<S>,
    lobes: LobesAt<S>,
}

/// Where a light fills less than a steradian (its density is above 1/sr), points of it alone show a surface without Phong lobes
/// more evenly than rays that find it by chance now and then; what they carry is bounded either way.
#[inline(always)]
fn left_to_light<S: Simd>(density: Lanes<S>) -> Mask<S> {
    density.at_least(density.number(1.0))
}

/// The power heuristic's weight of what was drawn with density `own`, and might have been with `other`.
#[inline(always)]
fn weight<S: Simd>(own: Lanes<S>, other: Lanes<S>) -> Lanes<S> {
    let ratio = other / own;
    let one = own.number(1.0);
    one / ratio.mul_add(ratio, one)
}

impl<const GLOSSY: bool> One<'_, GLOSSY> {
    #[inline(always)]
    fn traced<S: Simd>(&self, simd: S) -> Found {
        let scene = self.packets.scene;
        let mut rays = self.camera_rays(simd);
        let zero = Lanes::splat(simd, 0.0);
        let none = Vec3::splat(simd, DVec3::ZERO);
        let mut state = State {
            alive: Mask::splat(simd, true),
            throughput: Vec3::splat(simd, DVec3::ONE),
            radiance: none,
            pdf: zero.number(f64::INFINITY),
            from: rays.origin,
            normal: none,
            plain: Mask::splat(simd, false),
        };
        let plan = &self.packets.plan;
        let most = plan.events(scene.max_bounces);
        for bounce in 0..=most {
            let Some(vertices) = self.arrive(&rays, bounce, &mut state) else { break };
            self.add_direct(&vertices, bounce, &mut state);
            if bounce + 1 == most && !plan.chance {
                break;
            }
            rays = self.go_on(&vertices, bounce, &mut state);
        }
        let mut found = [[0.0; LANES]; 3];
        state.radiance.x.store(&mut found[0]);
        state.radiance.y.store(&mut found[1]);
        state.radiance.z.store(&mut found[2]);
        found
    }

    #[inline(always)]
    fn camera_rays<S: Simd>(&self, simd: S) -> Rays<S> {
        let camera = &self.packets.camera;
        let (mut u, mut v) = self.points.pair(self.decision(0, Decision::Pixel));
        camera.filter.spread(&mut u);
        camera.filter.spread(&mut v);
        let (u, v) = (Lanes::load(simd, &u), Lanes::load(simd, &v));
        let one = Lanes::splat(simd, 1.0);
        let across = (u + one.number(self.x)) * one.number(camera.pixel.x) - one;
        let down = (v + one.number(self.y)) * one.number(camera.pixel.y) - one;
        let forward = Vec3::splat(simd, camera.forward);
        let sideways = forward.vector(camera.across).scaled_plus(across, forward);
        let direction = forward.vector(camera.down).scaled_plus(down, sideways);
        let t_max = one.number(f64::INFINITY);
        let position = forward.vector(camera.position);
        let Some(lens) = &camera.lens else {
            return Rays { origin: position, direction: direction.normalize(), t_max };
        };
        let (x, y) = self.point(simd, self.decision(0, Decision::Lens));
        let disc = cosine_hemisphere(x, y);
        let shift = forward.vector(lens.right).scaled_plus(disc.x, forward.vector(lens.up) * disc.y);
        let direction = direction.scaled_plus(one.number(lens.focus), -shift);
        Rays { origin: position + shift, direction: direction.normalize(), t_max }
    }

    /// The point of a decision.
    #[inline(always)]
    fn point<S: Simd>(&self, simd: S, decision: u32) -> (Lanes<S>, Lanes<S>) {
        let (u, v) = self.points.pair(decision);
        (Lanes::load(simd, &u), Lanes::load(simd, &v))
    }

    /// Number of a decision.
    #[inline(always)]
    fn decision(&self, bounce: u32, decision: Decision) -> u32 {
        decision.number(bounce, self.packets.scene.lights.len())
    }

    /// Meets surfaces and adds what light shines there; `None` where no path goes on.
    #[inline(always)]
    fn arrive<S: Simd>(&self, rays: &Rays<S>, bounce: u32, state: &mut State<S>) -> Option<Vertices<S>> {
        let scene = self.packets.scene;
        let met = scene.closest(rays);
        let zero = state.pdf.number(0.0);
        if let Some(environment) = scene.environment
            && (bounce == 0 || self.packets.surround.is_none())
        {
            let missed = state.alive & !met.hit;
            let other = state.normal.dot(rays.direction).max(zero) * zero.number(FRAC_1_PI);
            let light = state.normal.vector(environment) * weight(state.pdf, other);
            state.radiance = state.radiance + missed.keep3(state.throughput.times(light));
        }
        state.alive = state.alive & met.hit & zero.above(met.at.normal.dot(rays.direction));
        for (k, light) in scene.shining() {
            let mut found = state.alive & met.owner.is(zero.number(light_number(k)));
            if self.packets.is_closed(k) {
                found = found & !state.plain;
            }
            if found.any() {
                // The first ray is not weighed: it finds what the eye sees.
                let other = if bounce == 0 { zero } else { quad_pdf(light, state.from, met.at.position) };
                found = found & !(state.plain & left_to_light(other));
                let shone = state.normal.vector(light.radiance) * weight(state.pdf, other);
                state.radiance = state.radiance + found.keep3(state.throughput.times(shone));
            }
        }
        state.alive = state.alive & met.owner.at_least(zero);
        if bounce == self.packets.plan.events(scene.max_bounces) {
            return None;
        }
        let lobes = scene.lobes_at(met.owner);
        let frame = Frames::new(met.at.normal);
        let wo = frame.to_local(-rays.direction);
        state.alive = state.alive & wo.z.above(zero) & !lobes.black;
        if state.alive.any() { Some(Vertices { at: met.at, frame, wo, lobes }) } else { None }
    }

    /// Adds light found by aiming at the lights.
    #[inline(always)]
    fn add_direct<S: Simd>(&self, vertices: &Vertices<S>, bounce: u32, state: &mut State<S>) {
        let scene = self.packets.scene;
        let at = &vertices.at;
        let one = state.pdf.number(1.0);
        let infinite = one.number(f64::INFINITY);
        let simd = one.simd();
        for (k, light) in scene.lights.iter().enumerate() {
            let (arrivals, strength) = match light {
                Light::Point { position, intensity } => {
                    let to = at.position.vector(*position);
                    let shadow = between(at.above(), to);
                    let distance2 = (to - at.position).length_squared();
                    (Arrivals { some: state.alive, shadow, strength: one / distance2, pdf: infinite }, *intensity)
                }
                Light::Directional { toward, irradiance } => {
                    let shadow = Rays { origin: at.above(), direction: at.position.vector(*toward), t_max: infinite };
                    (Arrivals { some: state.alive, shadow, strength: one, pdf: infinite }, *irradiance)
                }
                Light::Quad(quad) => {
                    if self.packets.is_closed(k) {
                        Self::add_closed(vertices, quad, state);
                        if !GLOSSY || !(state.alive & !vertices.lobes.plain).any() {
                            continue;
                        }
                    }
                    let point = self.point(simd, self.decision(bounce, Decision::Light(k as u32)));
                    let mut arrivals = from_quad(quad, at, point);
                    if self.packets.is_closed(k) {
                        arrivals.some = arrivals.some & !vertices.lobes.plain;
                    }
                    (arrivals, quad.radiance)
                }
                // Scenes with these are not walked through.
                Light::Spot(_) | Light::Sphere(_) | Light::Mesh(_) => continue,
            };
            self.add_unhidden(vertices, &arrivals, strength, &scene.before_lights[k], state);
        }
        if let (Some(surround), Some(radiance)) = (&self.packets.surround, scene.environment) {
            let light = surround.albedo(vertices.wo.z.max(one.number(0.0))).times(at.normal.vector(radiance));
            state.radiance = state.radiance + state.alive.keep3(state.throughput.times(light));
        } else if let Some(radiance) = scene.environment {
            let (u, v) = self.point(simd, self.decision(bounce, Decision::Environment));
            let local = cosine_hemisphere(u, v);
            let pdf = local.z * one.number(FRAC_1_PI);
            let direction = vertices.frame.to_world(local).normalize();
            let shadow = Rays { origin: at.above(), direction, t_max: infinite };
            let some = pdf.above(one.number(0.0));
            self.add_unhidden(
                vertices,
                &Arrivals { some, shadow, strength: one / pdf, pdf },
                radiance,
                &scene.before_environment,
                state,
            );
        }
    }

    /// Adds what surfaces without Phong lobes reflect of a light that nothing hides.
    #[inline(always)]
    fn add_closed<S: Simd>(vertices: &Vertices<S>, light: &QuadLight, state: &mut State<S>) {
        let at = &vertices.at;
        let zero = state.pdf.number(0.0);
        let to_centre = at.position.vector(light.quad().center) - at.position;
        let before = zero.above(to_centre.dot(at.position.vector(light.quad().normal)));
        let lit = state.alive & before & vertices.lobes.plain;
        let irradiance = projected_solid_angle(light, at) * zero.number(FRAC_1_PI);
        let light = vertices.lobes.diffuse().times(at.normal.vector(light.radiance)) * irradiance;
        state.radiance = state.radiance + lit.keep3(state.throughput.times(light));
    }

    /// Adds what is reflected of light that arrives, where nothing is in its way.
    #[inline(always)]
    fn add_unhidden<S: Simd>(
        &self,
        vertices: &Vertices<S>,
        arrivals: &Arrivals<S>,
        strength: DVec3,
        occluders: &Occluders,
        state: &mut State<S>,
    ) {
        let wi = vertices.frame.to_local(arrivals.shadow.direction);
        let zero = wi.z.number(0.0);
        let mut lit = state.alive & arrivals.some & wi.z.above(zero);
        if !lit.any() {
            return;
        }
        if self.packets.plan.shadows && !occluders.is_empty() {
            lit = lit & !occluders.hide(&arrivals.shadow);
        }
        let (value, pdf) = vertices.lobes.evaluate::<GLOSSY>(wi, vertices.wo);
        let alone = vertices.lobes.plain & left_to_light(arrivals.pdf);
        let factor = wi.z * arrivals.strength * weight(arrivals.pdf, alone.select(zero, pdf));
        let light = value.times(value.vector(strength)) * factor;
        state.radiance = state.radiance + lit.keep3(state.throughput.times(light));
    }

    /// Draws where the paths go on.
    #[inline(always)]
    fn go_on<S: Simd>(&self, vertices: &Vertices<S>, bounce: u32, state: &mut State<S>) -> Rays<S> {
        let simd = state.pdf.simd();
        let one = state.pdf.number(1.0);
        let point = self.point(simd, self.decision(bounce, Decision::Direction));
        let choice =
            if GLOSSY { Lanes::load(simd, &self.points.single(self.decision(bounce, Decision::Lobe))) } else { one };
        let wi = vertices.lobes.sample::<GLOSSY>(vertices.wo, choice, point);
        let above = wi.z.above(one.number(0.0));
        let (value, pdf) = vertices.lobes.evaluate::<GLOSSY>(wi, vertices.wo);
        state.alive = state.alive & above & pdf.above(one.number(0.0));
        state.throughput = state.throughput.times(value * (wi.z / pdf));
        if bounce >= ROULETTE_AFTER {
            let q = state.throughput.abs().largest();
            let may_end = one.above(q);
            let u = Lanes::load(simd, &self.points.single(self.decision(bounce, Decision::Roulette)));
            state.alive = state.alive & (!may_end | q.above(u));
            state.throughput = state.throughput * may_end.select(one / q, one);
        }
        state.alive = state.alive & state.throughput.abs().largest().above(one.number(0.0));
        let direction = vertices.frame.to_world(wi).normalize();
        (state.pdf, state.from, state.normal) = (pdf, vertices.at.position, vertices.at.normal);
        state.plain = vertices.lobes.plain;
        Rays { origin: vertices.at.above(), direction, t_max: one.number(f64::INFINITY) }
    }
}
