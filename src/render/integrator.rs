//! The path tracer: radiance along a ray as the expected value of one random path.

use glam::{DVec2, DVec3};

use super::lights::Arrival;
use super::material::{Material, PhongEquation, eval_rgb};
use super::plan::Plan;
use super::points::{Decision, Draws};
use super::ray::{Ray, SurfacePoint};
use super::scene::Scene;
use super::shapes::{Owner, Surface};
use crate::brdf::Brdf;
use crate::geometry::Frame;

/// Scattering events before paths may end by chance.
pub(super) const ROULETTE_AFTER: u32 = 5;

/// Which directions find the lights that have a surface, and the environment. All three have the same expected value;
/// they differ in noise.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Both ways, combined by the power heuristic (Veach 1997).
    #[default]
    Combined,
    /// Only directions drawn from the material: right, but slow for small lights. Shows that the combination is right.
    MaterialOnly,
    /// Only directions drawn from the lights: right, but slow for sharp lobes. Shows that the combination is right.
    LightsOnly,
}

impl Strategy {
    /// Weight of a contribution found by one way with density `own`, which the `other` way would have found too.
    fn weight(self, own: f64, other: f64, by_material: bool) -> f64 {
        match self {
            Self::Combined => {
                let ratio = other / own;
                1.0 / (1.0 + ratio * ratio)
            }
            Self::MaterialOnly => f64::from(u8::from(by_material)),
            Self::LightsOnly => f64::from(u8::from(!by_material)),
        }
    }
}

/// What one path found.
#[derive(Debug, Clone, Copy)]
pub struct PathResult {
    /// Radiance, W/(sr·m²).
    pub radiance: DVec3,
    /// Largest weight, 0 to 1, at which the path asked for a value that nobody measured: the largest channel of its throughput
    /// there, at most 1. So a gap of the surface that the camera sees counts in full, one that is seen by way of a dark surface
    /// little. A direction towards a light that something hides asks for nothing.
    pub unknown: f64,
    /// Rays that it sent out, those towards lights among them.
    pub rays: u32,
}

/// What somebody may want to know of a path beside its radiance. `()` wants nothing, and costs nothing.
pub trait Watch {
    /// The first surface that the path meets, seen from `eye`, and its material, if it is no light. `draws` are the path's,
    /// about to choose a direction there.
    fn first_surface(&mut self, eye: DVec3, surface: &Surface, material: Option<&Material>, draws: Draws);
    /// From here on light has scattered twice or more; `so_far` is the radiance of the light that has not.
    fn indirect_begins(&mut self, so_far: DVec3);
    /// The first surface reflected this radiance of light that was aimed at, for local directions to the light and to the eye.
    fn first_reflects(&mut self, brdf: &dyn Brdf, directions: (DVec3, DVec3), radiance: DVec3);
    /// The path goes on from the first surface, for local directions onward and to the eye; `so_far` is its radiance until then.
    fn first_goes_on(&mut self, brdf: &dyn Brdf, directions: (DVec3, DVec3), so_far: DVec3);
}

impl Watch for () {
    fn first_surface(&mut self, _: DVec3, _: &Surface, _: Option<&Material>, _: Draws) {}
    fn indirect_begins(&mut self, _: DVec3) {}
    fn first_reflects(&mut self, _: &dyn Brdf, _: (DVec3, DVec3), _: DVec3) {}
    fn first_goes_on(&mut self, _: &dyn Brdf, _: (DVec3, DVec3), _: DVec3) {}
}

/// Where and how the path scattered last.
#[derive(Debug, Clone, Copy)]
struct Scatter {
    position: DVec3,
    normal: DVec3,
    pdf: f64,
}

/// A surface point and the eye's direction, in the local frame of its shading normal.
struct Vertex {
    point: SurfacePoint,
    frame: Frame,
    wo: DVec3,
}

/// Walks through a scene.
#[derive(Debug, Clone, Copy)]
pub struct Tracer<'a> {
    scene: &'a Scene,
    strategy: Strategy,
    shadows: bool,
    chance: bool,
    /// Scattering events of a path at most.
    events: u32,
}

/// Follows one path that starts with a ray at the camera.
pub type Follow<'a, W> = fn(&Tracer<'a>, Ray, Draws, &mut W) -> PathResult;

struct Path {
    radiance: DVec3,
    throughput: DVec3,
    unknown: f64,
    rays: u32,
}

impl Path {
    /// Notes that a value is missing where the path is now.
    fn meet_unknown(&mut self) {
        self.unknown = self.unknown.max(self.throughput.abs().max_element().clamp(0.0, 1.0));
    }
}

impl<'a> Tracer<'a> {
    /// A tracer for a scene, by a plan.
    pub fn new(scene: &'a Scene, strategy: Strategy, plan: Plan) -> Self {
        let chance = plan.chance && strategy != Strategy::LightsOnly;
        Self { scene, strategy, shadows: plan.shadows, chance, events: plan.events(scene.max_bounces) }
    }

    /// What follows paths by the plan: one function for each, in which there is nothing of what is off. To be asked once, not for every path.
    pub fn follow<W: Watch>(&self) -> Follow<'a, W> {
        match (self.shadows, self.chance) {
            (true, true) => Self::trace::<true, true, W>,
            (true, false) => Self::trace::<true, false, W>,
            (false, true) => Self::trace::<false, true, W>,
            (false, false) => Self::trace::<false, false, W>,
        }
    }

    fn trace<const SHADOWS: bool, const CHANCE: bool, W: Watch>(
        &self,
        mut ray: Ray,
        draws: Draws,
        watch: &mut W,
    ) -> PathResult {
        let mut path = Path { radiance: DVec3::ZERO, throughput: DVec3::ONE, unknown: 0.0, rays: 0 };
        let mut last: Option<Scatter> = None;
        for bounce in 0..=self.events {
            path.rays += 1;
            let Some(surface) = self.scene.geometry.closest(&ray) else {
                path.radiance += path.throughput * self.environment_found(&ray, last.as_ref());
                break;
            };
            if bounce == 0 {
                watch.first_surface(
                    ray.origin,
                    &surface,
                    self.material_of(&surface),
                    self.draws_at(draws, 0, Decision::Direction),
                );
            }
            if surface.point.normal.dot(ray.direction) >= 0.0 {
                break; // the back of anything is black
            }
            let material = match surface.owner {
                Owner::Light { light, part } => {
                    let found = self.light_found(light as usize, part as usize, &surface, last.as_ref());
                    path.radiance += path.throughput * found;
                    break;
                }
                Owner::Material(material) => &self.scene.materials[material],
            };
            if bounce == self.events {
                break;
            }
            let vertex = Vertex::new(&surface, -ray.direction);
            if vertex.wo.z <= 0.0 {
                break;
            }
            if bounce == 1 {
                // What the lights send to the second surface will have scattered there and at the first.
                watch.indirect_begins(path.radiance);
            }
            let next = self.scatter::<SHADOWS, CHANCE>(material, &vertex, bounce, &mut path, (draws, watch));
            let Some(next) = next else { break };
            ray = Ray::new(vertex.point.above(), next.0);
            last = Some(next.1);
        }
        PathResult { radiance: path.radiance, unknown: path.unknown, rays: path.rays }
    }

    /// The numbers of a decision.
    fn draws_at(&self, draws: Draws, bounce: u32, decision: Decision) -> Draws {
        draws.at(decision.number(bounce, self.scene.lights.len()))
    }

    /// Whether something lies on a segment towards a light.
    fn hides<const SHADOWS: bool>(&self, segment: &Ray, path: &mut Path) -> bool {
        path.rays += u32::from(SHADOWS);
        SHADOWS && self.scene.geometry.occluded(segment)
    }

    fn material_of(&self, surface: &Surface) -> Option<&'a Material> {
        match surface.owner {
            Owner::Light { .. } => None,
            Owner::Material(material) => Some(&self.scene.materials[material]),
        }
    }

    /// Adds the light that arrives at the vertex directly and draws where the path goes on; `None` where it ends.
    fn scatter<const SHADOWS: bool, const CHANCE: bool>(
        &self,
        material: &Material,
        vertex: &Vertex,
        bounce: u32,
        path: &mut Path,
        (draws, watch): (Draws, &mut impl Watch),
    ) -> Option<(DVec3, Scatter)> {
        let brdf = match material {
            Material::Black => return None,
            Material::PhongEquation(equation) => {
                let shaded = self.shade::<SHADOWS>(equation, vertex, path);
                path.radiance += path.throughput * shaded;
                return None;
            }
            Material::Brdf(brdf) => brdf.as_ref(),
        };
        self.add_direct::<SHADOWS>(brdf, vertex, bounce, path, (draws, watch));
        if bounce + 1 == self.events && !CHANCE {
            return None;
        }
        let drawn = brdf.sample(vertex.wo, self.draws_at(draws, bounce, Decision::Direction).direction())?;
        let (f, known) = eval_rgb(brdf, drawn.wi, vertex.wo);
        if !known {
            path.meet_unknown();
        }
        path.throughput *= f * (drawn.wi.z / drawn.pdf);
        if bounce == 0 {
            watch.first_goes_on(brdf, (drawn.wi, vertex.wo), path.radiance);
        }
        let direction = vertex.frame.to_world(drawn.wi).normalize();
        let above = vertex.point.normal.dot(direction) > 0.0;
        let goes_on = above
            && path.throughput != DVec3::ZERO
            && survives(bounce, path, || self.draws_at(draws, bounce, Decision::Roulette).single());
        let scatter = Scatter { position: vertex.point.position, normal: vertex.frame.normal, pdf: drawn.pdf };
        goes_on.then_some((direction, scatter))
    }

    /// Light found by aiming at the lights.
    fn add_direct<const SHADOWS: bool>(
        &self,
        brdf: &dyn Brdf,
        vertex: &Vertex,
        bounce: u32,
        path: &mut Path,
        (draws, watch): (Draws, &mut impl Watch),
    ) {
        let mut add = |aim: Arrival| {
            let before = path.radiance;
            self.add_unhidden::<SHADOWS>(brdf, vertex, &aim, path);
            if bounce == 0 {
                let wi = vertex.frame.to_local(aim.wi);
                watch.first_reflects(brdf, (wi, vertex.wo), path.radiance - before);
            }
        };
        for (k, light) in self.scene.lights.iter().enumerate() {
            let by_chance = light.has_surface();
            if by_chance && self.strategy == Strategy::MaterialOnly {
                continue;
            }
            let draw = || self.draws_at(draws, bounce, Decision::Light(k as u32)).pair();
            let u = if by_chance { draw() } else { DVec2::ZERO };
            let Some(arrival) = light.sample(&vertex.point, u) else { continue };
            add(arrival);
        }
        if let Some(environment) = &self.scene.environment
            && self.strategy != Strategy::MaterialOnly
        {
            let u = self.draws_at(draws, bounce, Decision::Environment).pair();
            let Some(sky) = environment.sample(&vertex.frame, u) else { return };
            let irradiance = sky.radiance / sky.pdf;
            if irradiance.is_finite() {
                let shadow = Ray::new(vertex.point.above(), sky.wi);
                add(Arrival { wi: sky.wi, irradiance, pdf: Some(sky.pdf), shadow });
            }
        }
    }

    /// Adds what is reflected of the irradiance that arrives from where the path aimed, where nothing is in its way.
    fn add_unhidden<const SHADOWS: bool>(&self, brdf: &dyn Brdf, vertex: &Vertex, aim: &Arrival, path: &mut Path) {
        let reflected = self.reflected(brdf, vertex, aim.wi, aim.pdf);
        let matters = aim.irradiance != DVec3::ZERO && reflected != Some(DVec3::ZERO);
        if !matters || self.hides::<SHADOWS>(&aim.shadow, path) {
            return;
        }
        match reflected {
            Some(reflected) => path.radiance += path.throughput * reflected * aim.irradiance,
            None => path.meet_unknown(),
        }
    }

    /// f·cosθi towards the eye for light from the world direction `wi`, times the weight of having aimed there; `None` where f
    /// is unknown.
    fn reflected(&self, brdf: &dyn Brdf, vertex: &Vertex, wi: DVec3, pdf: Option<f64>) -> Option<DVec3> {
        let local = vertex.frame.to_local(wi);
        if local.z <= 0.0 || vertex.point.normal.dot(wi) <= 0.0 {
            return Some(DVec3::ZERO);
        }
        let (f, known) = eval_rgb(brdf, local, vertex.wo);
        if !known {
            return None;
        }
        let weight = pdf.map_or(1.0, |pdf| match self.strategy {
            Strategy::Combined => self.strategy.weight(pdf, brdf.pdf(local, vertex.wo), false),
            fixed => fixed.weight(pdf, 0.0, false),
        });
        Some(f * (local.z * weight))
    }

    /// Radiance of a light that a ray ran into, times the weight of having found it so.
    fn light_found(&self, light: usize, part: usize, surface: &Surface, last: Option<&Scatter>) -> DVec3 {
        let light = &self.scene.lights[light];
        let weight = last.map_or(1.0, |from| {
            let aimed = light.pdf(part, from.position, surface.point.position);
            self.strategy.weight(from.pdf, aimed, true)
        });
        light.radiance() * weight
    }

    /// Radiance of the environment behind a ray that met nothing, times the weight of having found it so.
    fn environment_found(&self, ray: &Ray, last: Option<&Scatter>) -> DVec3 {
        let Some(environment) = &self.scene.environment else { return DVec3::ZERO };
        let Some(from) = last else { return environment.radiance(ray.direction) };
        let (radiance, pdf) = environment.find(from.normal, ray.direction);
        radiance * self.strategy.weight(from.pdf, pdf, true)
    }

    /// Phong's equation at the vertex.
    fn shade<const SHADOWS: bool>(&self, equation: &PhongEquation, vertex: &Vertex, path: &mut Path) -> DVec3 {
        let mut radiance = equation.ambient;
        for light in &self.scene.lights {
            let Some(segment) = light.as_seen_by_equation(&vertex.point) else { continue };
            let term = equation.light_term(vertex.frame.to_local(segment.direction), vertex.wo);
            let above = vertex.point.normal.dot(segment.direction) > 0.0;
            if above && term != DVec3::ZERO && !self.hides::<SHADOWS>(&segment, path) {
                radiance += term;
            }
        }
        radiance
    }
}

impl Vertex {
    fn new(surface: &Surface, wo: DVec3) -> Self {
        let frame = Frame::from_normal(surface.shading_normal);
        Self { point: surface.point, frame, wo: frame.to_local(wo) }
    }
}

/// Russian roulette: a path whose throughput has fallen to q < 1 goes on with probability q and counts for 1/q. Its largest
/// channel is then 1, so roulette never raises a path above what it started with.
fn survives(bounce: u32, path: &mut Path, draw: impl FnOnce() -> f64) -> bool {
    if bounce < ROULETTE_AFTER {
        return true;
    }
    let q = path.throughput.abs().max_element();
    if q >= 1.0 {
        return true;
    }
    path.throughput /= q;
    draw() < q
}
