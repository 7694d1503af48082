//! Paths, eight abreast.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::super::camera::Camera;
use super::super::integrator::ROULETTE_AFTER;
use super::super::lights::Light;
use super::flat::FlatScene;
use super::lights::{Arrivals, between, from_quad, quad_pdf};
use super::lobes::{Frames, LobesAt, cosine_hemisphere};
use super::points::Points;
use super::shapes::{Points3, Rays};
use crate::numeric::lanes::{Mask, Vec3};
use crate::numeric::random::mix;
use crate::numeric::simd::{Eight, Kernel, LANES, Lanes, Simd, vectorised};

/// Decisions of one scattering event besides those of its lights: environment, direction, lobe and roulette.
const OF_EVENT: u32 = 4;

/// What a scene calls for: what is off is not in the compiled path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::render) struct Plan {
    /// Something may stand between a surface and a light.
    pub shadows: bool,
    /// Light goes on from one surface to the next, or a ray may find a light.
    pub bounces: bool,
    /// There are Phong lobes.
    pub glossy: bool,
}

impl Plan {
    /// That of a scene.
    pub fn of(scene: &FlatScene<'_>) -> Self {
        let alone = !scene.sees_itself();
        Self {
            shadows: !alone,
            bounces: scene.rays_find_light || !alone && scene.max_bounces > 1,
            glossy: scene.lobes > 0,
        }
    }
}

/// What a packet found: radiance of each path, channel by channel.
pub(in crate::render) type Found = [Eight; 3];

/// Walks through a scene in packets.
#[derive(Debug)]
pub(in crate::render) struct Packets<'a> {
    pub scene: &'a FlatScene<'a>,
    pub plan: Plan,
    pub camera: Camera,
    pub seed: u64,
}

/// What takes a pixel's column, how many of its packets came before, and a packet.
type Take<'a> = &'a mut dyn FnMut(usize, u32, &Found);

impl Packets<'_> {
    /// Follows so many packets of every pixel of row `y`, after the `done` samples that each has.
    pub fn row(&self, y: usize, width: usize, done: u32, packets: u32, take: Take<'_>) {
        let row = Row { packets: self, y, width, done, count: packets, take };
        let Plan { shadows, bounces, glossy } = self.plan;
        match (shadows, bounces, glossy) {
            (false, false, false) => vectorised(Planned::<false, false, false>(row)),
            (false, false, true) => vectorised(Planned::<false, false, true>(row)),
            (false, true, false) => vectorised(Planned::<false, true, false>(row)),
            (false, true, true) => vectorised(Planned::<false, true, true>(row)),
            (true, false, false) => vectorised(Planned::<true, false, false>(row)),
            (true, false, true) => vectorised(Planned::<true, false, true>(row)),
            (true, true, false) => vectorised(Planned::<true, true, false>(row)),
            (true, true, true) => vectorised(Planned::<true, true, true>(row)),
        }
    }
}

/// Packets of a row of pixels.
struct Row<'a> {
    packets: &'a Packets<'a>,
    y: usize,
    width: usize,
    done: u32,
    count: u32,
    take: Take<'a>,
}

struct Planned<'a, const SHADOWS: bool, const BOUNCES: bool, const GLOSSY: bool>(Row<'a>);

impl<const SHADOWS: bool, const BOUNCES: bool, const GLOSSY: bool> Kernel for Planned<'_, SHADOWS, BOUNCES, GLOSSY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Row { packets, y, width, done, count, take } = self.0;
        for x in 0..width {
            let pixel = (y as u64) << 32 | x as u64;
            let key = mix(mix(packets.seed ^ 0x51ed_270b_7a11_4e17).wrapping_add(pixel));
            for packet in 0..count {
                let points = Points::new(key, done.wrapping_add(packet * LANES as u32));
                let one = One::<SHADOWS, BOUNCES, GLOSSY> { packets, x: x as f64, y: y as f64, points };
                take(x, packet, &one.traced(simd));
            }
        }
    }
}

/// One packet.
struct One<'a, const SHADOWS: bool, const BOUNCES: bool, const GLOSSY: bool> {
    packets: &'a Packets<'a>,
    x: f64,
    y: f64,
    points: Points,
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
}

/// Surfaces and the eye's directions in their frames.
struct Vertices<S: Simd> {
    at: Points3<S>,
    frame: Frames<S>,
    wo: Vec3<S>,
    lobes: LobesAt<S>,
}

/// The power heuristic's weight of what was drawn with density `own`, and might have been with `other`.
#[inline(always)]
fn weight<S: Simd>(own: Lanes<S>, other: Lanes<S>) -> Lanes<S> {
    let ratio = other / own;
    let one = own.number(1.0);
    one / ratio.mul_add(ratio, one)
}

impl<const SHADOWS: bool, const BOUNCES: bool, const GLOSSY: bool> One<'_, SHADOWS, BOUNCES, GLOSSY> {
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
        };
        for bounce in 0..=scene.max_bounces {
            let Some(vertices) = self.arrive(&rays, bounce, &mut state) else { break };
            self.add_direct(&vertices, bounce, &mut state);
            let last = bounce + 1 == scene.max_bounces && !scene.rays_find_light;
            if !BOUNCES || last {
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
        let (u, v) = self.point(simd, 0);
        let one = Lanes::splat(simd, 1.0);
        let across = (u + one.number(self.x)) * one.number(camera.pixel.x) - one;
        let down = (v + one.number(self.y)) * one.number(camera.pixel.y) - one;
        let forward = Vec3::splat(simd, camera.forward);
        let sideways = forward.vector(camera.across).scaled_plus(across, forward);
        let direction = forward.vector(camera.down).scaled_plus(down, sideways);
        Rays {
            origin: forward.vector(camera.position),
            direction: direction.normalize(),
            t_max: one.number(f64::INFINITY),
        }
    }

    /// The point of a decision.
    #[inline(always)]
    fn point<S: Simd>(&self, simd: S, decision: u32) -> (Lanes<S>, Lanes<S>) {
        let (u, v) = self.points.pair(decision);
        (Lanes::load(simd, &u), Lanes::load(simd, &v))
    }

    /// Number of a decision of the event after so many others.
    #[inline(always)]
    fn decision(&self, bounce: u32, which: u32) -> u32 {
        1 + bounce * (OF_EVENT + self.packets.scene.lights.len() as u32) + which
    }

    /// Meets surfaces and adds what light shines there; `None` where no path goes on.
    #[inline(always)]
    fn arrive<S: Simd>(&self, rays: &Rays<S>, bounce: u32, state: &mut State<S>) -> Option<Vertices<S>> {
        let scene = self.packets.scene;
        let met = scene.closest(rays);
        let zero = state.pdf.number(0.0);
        if let Some(environment) = scene.environment {
            let missed = state.alive & !met.hit;
            let other = state.normal.dot(rays.direction).max(zero) * zero.number(FRAC_1_PI);
            let light = state.normal.vector(environment) * weight(state.pdf, other);
            state.radiance = state.radiance + missed.keep3(state.throughput.times(light));
        }
        state.alive = state.alive & met.hit & zero.above(met.at.normal.dot(rays.direction));
        for (owner, light) in scene.shining() {
            let found = state.alive & met.owner.is(zero.number(owner));
            if found.any() {
                let other = if bounce == 0 { zero } else { quad_pdf(light, state.from, met.at.position) };
                let shone = state.normal.vector(light.radiance) * weight(state.pdf, other);
                state.radiance = state.radiance + found.keep3(state.throughput.times(shone));
            }
        }
        state.alive = state.alive & met.owner.at_least(zero);
        if bounce == scene.max_bounces {
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
                    let point = self.point(simd, self.decision(bounce, OF_EVENT + k as u32));
                    (from_quad(quad, at, point), quad.radiance)
                }
                // Scenes with these are not walked through.
                Light::Spot(_) | Light::Sphere(_) | Light::Mesh(_) => continue,
            };
            self.add_unhidden(vertices, &arrivals, strength, state);
        }
        if let Some(radiance) = scene.environment {
            let (u, v) = self.point(simd, self.decision(bounce, 0));
            let local = cosine_hemisphere(u, v);
            let pdf = local.z * one.number(FRAC_1_PI);
            let direction = vertices.frame.to_world(local).normalize();
            let shadow = Rays { origin: at.above(), direction, t_max: infinite };
            let some = pdf.above(one.number(0.0));
            self.add_unhidden(vertices, &Arrivals { some, shadow, strength: one / pdf, pdf }, radiance, state);
        }
    }

    /// Adds what is reflected of light that arrives, where nothing is in its way.
    #[inline(always)]
    fn add_unhidden<S: Simd>(
        &self,
        vertices: &Vertices<S>,
        arrivals: &Arrivals<S>,
        strength: DVec3,
        state: &mut State<S>,
    ) {
        let wi = vertices.frame.to_local(arrivals.shadow.direction);
        let zero = wi.z.number(0.0);
        let mut lit = state.alive & arrivals.some & wi.z.above(zero);
        if !lit.any() {
            return;
        }
        if SHADOWS {
            lit = lit & !self.packets.scene.occluded(&arrivals.shadow);
        }
        let (value, pdf) = vertices.lobes.evaluate::<GLOSSY>(wi, vertices.wo);
        let factor = wi.z * arrivals.strength * weight(arrivals.pdf, pdf);
        let light = value.times(value.vector(strength)) * factor;
        state.radiance = state.radiance + lit.keep3(state.throughput.times(light));
    }

    /// Draws where the paths go on.
    #[inline(always)]
    fn go_on<S: Simd>(&self, vertices: &Vertices<S>, bounce: u32, state: &mut State<S>) -> Rays<S> {
        let simd = state.pdf.simd();
        let one = state.pdf.number(1.0);
        let point = self.point(simd, self.decision(bounce, 1));
        let choice = if GLOSSY { Lanes::load(simd, &self.points.single(self.decision(bounce, 2))) } else { one };
        let wi = vertices.lobes.sample::<GLOSSY>(vertices.wo, choice, point);
        let above = wi.z.above(one.number(0.0));
        let (value, pdf) = vertices.lobes.evaluate::<GLOSSY>(wi, vertices.wo);
        state.alive = state.alive & above & pdf.above(one.number(0.0));
        state.throughput = state.throughput.times(value * (wi.z / pdf));
        if bounce >= ROULETTE_AFTER {
            let q = state.throughput.abs().largest();
            let may_end = one.above(q);
            let u = Lanes::load(simd, &self.points.single(self.decision(bounce, 3)));
            state.alive = state.alive & (!may_end | q.above(u));
            state.throughput = state.throughput * may_end.select(one / q, one);
        }
        state.alive = state.alive & state.throughput.abs().largest().above(one.number(0.0));
        let direction = vertices.frame.to_world(wi).normalize();
        (state.pdf, state.from, state.normal) = (pdf, vertices.at.position, vertices.at.normal);
        Rays { origin: vertices.at.above(), direction, t_max: one.number(f64::INFINITY) }
    }
}
