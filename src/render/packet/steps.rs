//! What a group's paths do at a scattering event.

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use glam::DVec3;

use super::super::integrator::ROULETTE_AFTER;
use super::super::lights::{Light, QuadLight};
use super::super::points::{Decision, Points};
use super::super::surroundings::Occluders;
use super::flat::light_number;
use super::lights::{Arrivals, between, from_quad, quad_spread};
use super::lobes::{Frames, LobesAt, cosine_hemisphere};
use super::outline::Outline;
use super::path::Packets;
use super::shapes::{Points3, Rays};
use super::wave::{Group, Row};
use crate::numeric::lanes::{LANES, Lanes, Mask, Vec3};
use crate::numeric::simd::Simd;

/// What paths carry.
struct Load<S: Simd> {
    alive: Mask<S>,
    throughput: Vec3<S>,
    radiance: Vec3<S>,
    /// Rays towards lights.
    aimed: Lanes<S>,
}

/// Surfaces and the eye's directions in their frames.
struct Vertices<S: Simd> {
    at: Points3<S>,
    frame: Frames<S>,
    wo: Vec3<S>,
    lobes: LobesAt<S>,
}

/// A scattering event.
#[derive(Clone, Copy)]
struct Event<'a> {
    packets: &'a Packets<'a>,
    points: Points<LANES>,
    bounce: u32,
}

/// Where a light fills at most a steradian (1/density is its `spread`), points of it alone show a surface without Phong lobes
/// more evenly than rays that find it by chance now and then; what they carry is bounded either way.
#[inline(always)]
fn left_to_light<S: Simd>(spread: Lanes<S>) -> Mask<S> {
    spread.number(1.0).at_least(spread)
}

/// The power heuristic's weight of what was drawn with density 1/`spread`, and might have been with `other`.
#[inline(always)]
fn weight<S: Simd>(spread: Lanes<S>, other: Lanes<S>) -> Lanes<S> {
    let ratio = other * spread;
    let one = spread.number(1.0);
    one / ratio.mul_add(ratio, one)
}

impl Packets<'_> {
    /// Meets surfaces, adds what lights and the environment shine there, and notes who goes on.
    #[inline(always)]
    pub(super) fn arrive<S: Simd, const CLOSED: bool>(&self, simd: S, group: &mut Group, bounce: u32) {
        let scene = self.scene;
        let t_max = Lanes::splat(simd, f64::INFINITY);
        let rays = Rays { origin: group.get3(simd, Row::Origin), direction: group.get3(simd, Row::Direction), t_max };
        let met = scene.closest(&rays);
        let zero = t_max.number(0.0);
        let mut alive = group.says(simd, Row::Alive);
        let mut radiance = group.get3(simd, Row::Radiance);
        let throughput = group.get3(simd, Row::Throughput);
        let plain = group.says(simd, Row::Plain);
        let spread = group.get(simd, Row::Spread);
        if let Some(environment) = scene.environment
            && (bounce == 0 || self.surround.is_none())
        {
            let missed = alive & !met.hit;
            let other = group.get3(simd, Row::Normal).dot(rays.direction).max(zero) * zero.number(FRAC_1_PI);
            let light = Vec3::splat(simd, environment) * weight(spread, other);
            radiance = radiance + missed.keep3(throughput.times(light));
        }
        alive = alive & met.hit & zero.above(met.at.normal.dot(rays.direction));
        for (k, light) in scene.shining() {
            let mut found = alive & met.owner.is(zero.number(light_number(k)));
            if CLOSED && scene.closed[k] {
                found = found & !group.says(simd, Row::Closed);
            }
            if found.any() {
                // The first ray is not weighed: it finds what the eye sees.
                let from = group.get3(simd, Row::Position);
                let (other, aimed) = if bounce == 0 {
                    (zero, t_max)
                } else {
                    let aimed = quad_spread(light, from, met.at.position);
                    (zero.number(1.0) / aimed, aimed)
                };
                found = found & !(plain & left_to_light(aimed));
                let shone = Vec3::splat(simd, light.radiance) * weight(spread, other);
                radiance = radiance + found.keep3(throughput.times(shone));
            }
        }
        alive = alive & met.owner.at_least(zero);
        if bounce == self.plan.events(scene.max_bounces) {
            alive = Mask::splat(simd, false);
        }
        group.put3(Row::Radiance, radiance);
        group.note(simd, Row::Alive, alive);
        group.put3(Row::Position, met.at.position);
        group.put3(Row::Normal, met.at.normal);
        group.put3(Row::Error, met.at.error);
        group.put(Row::Owner, met.owner);
    }

    /// Adds the light that is found by aiming at it, and draws where the paths go on.
    #[inline(always)]
    pub(super) fn shade<S: Simd, const GLOSSY: bool, const CLOSED: bool>(
        &self,
        simd: S,
        group: &mut Group,
        bounce: u32,
    ) {
        let at = Points3 {
            position: group.get3(simd, Row::Position),
            error: group.get3(simd, Row::Error),
            normal: group.get3(simd, Row::Normal),
        };
        let frame = Frames::new(at.normal);
        let wo = frame.to_local(-group.get3(simd, Row::Direction));
        let lobes = self.scene.lobes_at::<S, CLOSED>(group.get(simd, Row::Owner));
        let lobes = if GLOSSY { lobes.seen_at(wo.z) } else { lobes };
        let mut load = Load {
            alive: group.says(simd, Row::Alive) & wo.z.above(wo.z.number(0.0)) & !lobes.black,
            throughput: group.get3(simd, Row::Throughput),
            radiance: group.get3(simd, Row::Radiance),
            aimed: group.get(simd, Row::Aimed),
        };
        let vertices = Vertices { at, frame, wo, lobes };
        let event = Event { packets: self, points: group.points(), bounce };
        event.add_direct::<S, GLOSSY, CLOSED>(&vertices, &mut load);
        if bounce + 1 == self.plan.events(self.scene.max_bounces) && !self.plan.chance {
            load.alive = Mask::splat(simd, false);
        }
        if load.alive.any() {
            let (rays, spread) = event.go_on::<S, GLOSSY>(&vertices, &mut load);
            group.put3(Row::Origin, rays.origin);
            group.put3(Row::Direction, rays.direction);
            group.put3(Row::Throughput, load.throughput);
            group.put(Row::Spread, spread);
            group.note(simd, Row::Plain, vertices.lobes.plain);
            if CLOSED {
                group.note(simd, Row::Closed, vertices.lobes.closed);
            }
        }
        group.put3(Row::Radiance, load.radiance);
        group.put(Row::Aimed, load.aimed);
        group.note(simd, Row::Alive, load.alive);
    }
}

impl Event<'_> {
    /// The point of a decision.
    #[inline(always)]
    fn point<S: Simd>(&self, simd: S, decision: Decision) -> (Lanes<S>, Lanes<S>) {
        let (u, v) = self.points.pair(self.packets.decision(self.bounce, decision));
        (Lanes::load(simd, &u), Lanes::load(simd, &v))
    }

    /// The number of a decision.
    #[inline(always)]
    fn single<S: Simd>(&self, simd: S, decision: Decision) -> Lanes<S> {
        Lanes::load(simd, &self.points.single(self.packets.decision(self.bounce, decision)))
    }

    /// Adds light found by aiming at the lights.
    #[inline(always)]
    fn add_direct<S: Simd, const GLOSSY: bool, const CLOSED: bool>(&self, vertices: &Vertices<S>, load: &mut Load<S>) {
        let scene = self.packets.scene;
        let at = &vertices.at;
        let one = vertices.wo.z.number(1.0);
        let (zero, infinite) = (one.number(0.0), one.number(f64::INFINITY));
        let simd = one.simd();
        for (k, light) in scene.lights.iter().enumerate() {
            let (arrivals, strength) = match light {
                Light::Point { position, intensity } => {
                    let to = at.position.vector(*position);
                    let shadow = between(at.above(), to);
                    let distance2 = (to - at.position).length_squared();
                    (Arrivals { some: load.alive, shadow, strength: one / distance2, spread: zero }, *intensity)
                }
                Light::Directional { toward, irradiance } => {
                    let shadow = Rays { origin: at.above(), direction: at.position.vector(*toward), t_max: infinite };
                    (Arrivals { some: load.alive, shadow, strength: one, spread: zero }, *irradiance)
                }
                Light::Quad(quad) => {
                    let is_closed = CLOSED && scene.closed[k];
                    if is_closed {
                        self.add_closed::<S, GLOSSY>(vertices, quad, load);
                        if !GLOSSY || !(load.alive & !vertices.lobes.closed).any() {
                            continue;
                        }
                    }
                    let point = self.point(simd, Decision::Light(k as u32));
                    let mut arrivals = from_quad(quad, at, point);
                    if is_closed {
                        arrivals.some = arrivals.some & !vertices.lobes.closed;
                    }
                    (arrivals, quad.radiance)
                }
                // Scenes with these are not walked through.
                Light::Spot(_) | Light::Sphere(_) | Light::Mesh(_) => continue,
            };
            self.add_unhidden::<S, GLOSSY>(vertices, &arrivals, strength, &scene.before_lights[k], load);
        }
        if let (Some(surround), Some(radiance)) = (&self.packets.surround, scene.environment) {
            let light = surround.albedo(vertices.wo.z.max(one.number(0.0))).times(at.normal.vector(radiance));
            load.radiance = load.radiance + load.alive.keep3(load.throughput.times(light));
        } else if let Some(radiance) = scene.environment {
            let (u, v) = self.point(simd, Decision::Environment);
            let local = cosine_hemisphere(u, v);
            let spread = one.number(PI) / local.z;
            let direction = vertices.frame.to_world(local).normalize();
            let shadow = Rays { origin: at.above(), direction, t_max: infinite };
            let some = local.z.above(zero);
            self.add_unhidden::<S, GLOSSY>(
                vertices,
                &Arrivals { some, shadow, strength: spread, spread },
                radiance,
                &scene.before_environment,
                load,
            );
        }
    }

    /// Adds what surfaces reflect of a light that nothing hides, where that has a closed form.
    #[inline(always)]
    fn add_closed<S: Simd, const GLOSSY: bool>(&self, vertices: &Vertices<S>, light: &QuadLight, load: &mut Load<S>) {
        let (at, wo) = (&vertices.at, vertices.wo);
        let zero = wo.z.number(0.0);
        let normal = at.position.vector(light.quad().normal);
        let to_centre = at.position.vector(light.quad().center) - at.position;
        // A surface in the light's own plane gets nothing; which corners rounding lifts above it would be chance.
        let slack = at.error.dot(normal.abs()) + zero.number(light.quad().error());
        let before = (-slack).above(to_centre.dot(normal));
        let lit = load.alive & before & vertices.lobes.closed;
        if !lit.any() {
            return;
        }
        let outline = Outline::new(light, at);
        let mut reflected = vertices.lobes.diffuse() * (outline.projected_solid_angle() * zero.number(FRAC_1_PI));
        if GLOSSY && (lit & !vertices.lobes.plain).any() {
            let axis = vertices.frame.to_world(Vec3::new(-wo.x, -wo.y, wo.z)).normalize();
            for (weight, exponent) in vertices.lobes.phong() {
                // Sharp lobes elsewhere would ask for many panels.
                let exponent = lit.select(exponent, zero);
                let moment = outline.phong_moment(axis, exponent, &self.packets.rules);
                reflected = weight.scaled_plus(moment * zero.number(1.0 / TAU), reflected);
            }
        }
        let light = reflected.times(at.normal.vector(light.radiance));
        load.radiance = load.radiance + lit.keep3(load.throughput.times(light));
    }

    /// Adds what is reflected of light that arrives, where nothing is in its way.
    #[inline(always)]
    fn add_unhidden<S: Simd, const GLOSSY: bool>(
        &self,
        vertices: &Vertices<S>,
        arrivals: &Arrivals<S>,
        strength: DVec3,
        occluders: &Occluders,
        load: &mut Load<S>,
    ) {
        let wi = vertices.frame.to_local(arrivals.shadow.direction);
        let zero = wi.z.number(0.0);
        let mut lit = load.alive & arrivals.some & wi.z.above(zero);
        if !lit.any() {
            return;
        }
        if self.packets.plan.shadows && !occluders.is_empty() {
            load.aimed = load.aimed + lit.keep(zero.number(1.0));
            lit = lit & !occluders.hide(&arrivals.shadow);
        }
        let (value, pdf) = vertices.lobes.evaluate::<GLOSSY>(wi, vertices.wo);
        let alone = vertices.lobes.plain & left_to_light(arrivals.spread);
        let factor = wi.z * arrivals.strength * weight(arrivals.spread, alone.select(zero, pdf));
        let light = value.times(value.vector(strength)) * factor;
        load.radiance = load.radiance + lit.keep3(load.throughput.times(light));
    }

    /// Draws where the paths go on.
    #[inline(always)]
    fn go_on<S: Simd, const GLOSSY: bool>(&self, vertices: &Vertices<S>, load: &mut Load<S>) -> (Rays<S>, Lanes<S>) {
        let one = vertices.wo.z.number(1.0);
        let simd = one.simd();
        let point = self.point(simd, Decision::Direction);
        let choice = if GLOSSY { self.single(simd, Decision::Lobe) } else { one };
        let wi = vertices.lobes.sample::<GLOSSY>(vertices.wo, choice, point);
        let above = wi.z.above(one.number(0.0));
        let (value, pdf) = vertices.lobes.evaluate::<GLOSSY>(wi, vertices.wo);
        load.alive = load.alive & above & pdf.above(one.number(0.0));
        let spread = one / pdf;
        load.throughput = load.throughput.times(value * (wi.z * spread));
        if self.bounce >= ROULETTE_AFTER {
            let q = load.throughput.abs().largest();
            let may_end = one.above(q);
            let u = self.single(simd, Decision::Roulette);
            load.alive = load.alive & (!may_end | q.above(u));
            load.throughput = load.throughput * may_end.select(one / q, one);
        }
        load.alive = load.alive & load.throughput.abs().largest().above(one.number(0.0));
        let direction = vertices.frame.to_world(wi).normalize();
        (Rays { origin: vertices.at.above(), direction, t_max: one.number(f64::INFINITY) }, spread)
    }
}
