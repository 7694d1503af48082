//! A white furnace: a surface in light of radiance 1 from everywhere shows its directional albedo. Here it is rendered, and found by
//! a plain midpoint rule over directions about the mirror direction, or over half vectors, which shares nothing with the program but the
//! value of the BRDF; for the Phong lobe not even that.
#![allow(dead_code, clippy::expect_used)] // each file uses a part

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use goniofit::brdf::{Brdf, LobeKind, LobeTerm, PerChannel, Sample};
use goniofit::control::Control;
use goniofit::geometry::{Frame, direction, mirror};
use goniofit::render::{Material, Materials, Options, PhongEquation, Plan, Scene, SceneSpec, render};
use rayon::prelude::*;

/// Polar angles of the eye, degrees. Some tables jump at the incidences that were measured, multiples of 5°: a camera whose pixels lie
/// on both sides of one would see the mean of two albedos.
pub const THETAS_DEG: [f64; 8] = [0.1, 21.0, 41.0, 61.0, 76.0, 86.0, 89.0, 89.9];

/// Radiance and its standard error as the renderer finds them, the eye at `theta_deg` from the normal: the mean over 8 × 8 pixels
/// of a camera whose field of view is 10⁻⁵ degrees. Where there is a closed form, it is used or not.
pub fn rendered(material: &Material, theta_deg: f64, samples: u32, seed: u64, closed: bool) -> (DVec3, DVec3) {
    let theta = theta_deg.to_radians();
    let eye = [theta.sin(), theta.cos(), 0.0];
    let text = format!(
        "version = 1\nname = \"white furnace\"\nmax_bounces = 1\n\
         [camera]\nposition = {eye:?}\ntarget = [0, 0, 0]\nup = [0, 0, 1]\nfov_deg = 1e-5\n\
         [materials]\nm = {{ black = true }}\n[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n\
         [light.environment]\nradiance = [1, 1, 1]\n"
    );
    let spec = SceneSpec::parse(&text, "furnace").expect("a scene");
    let materials = Materials::from([("m".to_owned(), material.clone())]);
    let scene = Scene::build(&spec, Path::new("."), &materials).expect("builds");
    let plan = Plan::of(&scene);
    let plan = if closed { plan } else { Plan { closed_forms: false, chance: true, ..plan } };
    let samples = samples.div_ceil(64);
    let options = Options { width: 8, height: 8, samples, seed, plan: Some(plan), ..Options::default() };
    let film = render(&scene, &options, Control::silent()).expect("renders");
    let pixels = (0..8).flat_map(|y| (0..8).map(move |x| (x, y)));
    let (mut sum, mut variance) = (DVec3::ZERO, DVec3::ZERO);
    for (x, y) in pixels {
        sum += film.radiance(x, y).expect("a pixel");
        variance += film.standard_error(x, y).expect("a pixel").powf(2.0);
    }
    (sum / 64.0, variance.map(f64::sqrt) / 64.0)
}

/// ∫ f(wi) cosθi dωi by the midpoint rule in `rows` × `columns` about `axis`, the polar angle going to `reach` by squares.
fn midpoint(axis: DVec3, reach: f64, (rows, columns): (u32, u32), mut f: impl FnMut(DVec3) -> DVec3) -> DVec3 {
    let frame = Frame::from_normal(axis);
    let azimuths: Vec<(f64, f64)> =
        (0..columns).map(|j| (TAU * (f64::from(j) + 0.5) / f64::from(columns)).sin_cos()).collect();
    let mut sum = DVec3::ZERO;
    for i in 0..rows {
        let s = (f64::from(i) + 0.5) / f64::from(rows);
        let (sin_a, cos_a) = (reach * s * s).sin_cos();
        let mut ring = DVec3::ZERO;
        for (sin_b, cos_b) in &azimuths {
            let wi = frame.to_world(DVec3::new(sin_a * cos_b, sin_a * sin_b, cos_a));
            if wi.z > 0.0 {
                ring += f(wi) * wi.z;
            }
        }
        sum += ring * (sin_a * 2.0 * reach * s / f64::from(rows) * TAU / f64::from(columns));
    }
    sum
}

/// Twice, the second time twice as fine: the value, and their difference, which is more than its error.
fn twice(axis: DVec3, reach: f64, mut f: impl FnMut(DVec3) -> DVec3) -> (DVec3, DVec3) {
    let coarse = midpoint(axis, reach, (600, 360), &mut f);
    let fine = midpoint(axis, reach, (1200, 720), f);
    (fine, (fine - coarse).abs())
}

/// ∫ f(wi) cosθi dωi by the midpoint rule in `rows` × `columns` over half vectors h about the normal, their polar angle going to 90° by
/// squares, as a MERL table's rows do: dωi = 4 (wo·h) dωh. Sharp lobes, which are long and narrow at grazing angles, look alike here at all of them.
fn over_half_vectors(wo: DVec3, (rows, columns): (u32, u32), f: impl Fn(DVec3) -> DVec3 + Sync) -> DVec3 {
    let azimuths: Vec<(f64, f64)> =
        (0..columns).map(|j| (TAU * (f64::from(j) + 0.5) / f64::from(columns)).sin_cos()).collect();
    let ring = |i: u32| {
        let s = (f64::from(i) + 0.5) / f64::from(rows);
        let (sin_h, cos_h) = (FRAC_PI_2 * s * s).sin_cos();
        let mut sum = DVec3::ZERO;
        for (sin_p, cos_p) in &azimuths {
            let h = DVec3::new(sin_h * cos_p, sin_h * sin_p, cos_h);
            let cos_d = wo.dot(h);
            let wi = 2.0 * cos_d * h - wo;
            if cos_d > 0.0 && wi.z > 0.0 {
                sum += f(wi.normalize()) * (wi.z * 4.0 * cos_d);
            }
        }
        sum * (sin_h * PI * s / f64::from(rows) * TAU / f64::from(columns))
    };
    let rings: Vec<DVec3> = (0..rows).into_par_iter().map(ring).collect();
    rings.into_iter().sum()
}

/// Relative change of the integral, taken twice as fine, below which it is fine enough: a tenth of what pictures are held to.
const SURE: f64 = 1e-4;

/// The integral over half vectors, finer and finer until it changes by less than [`SURE`] or takes 14 million directions, and its last change, which is more
/// than its error.
fn refined(wo: DVec3, f: impl Fn(DVec3) -> DVec3 + Sync) -> (DVec3, DVec3) {
    let at = |k: u32| over_half_vectors(wo, (300 << k, 180 << k), &f);
    let (mut value, mut change, mut k) = (at(1), DVec3::INFINITY, 1);
    while k < 4 && !change.cmple(SURE * value).all() {
        k += 1;
        let fine = at(k);
        (value, change) = (fine, (fine - value).abs());
    }
    (value, change)
}

/// The value of a BRDF of one or three channels; 0 where it is unknown.
fn rgb(brdf: &dyn Brdf, wi: DVec3, wo: DVec3) -> DVec3 {
    let mut out = [0.0; 3];
    brdf.eval(wi, wo, &mut out[..brdf.channels()]);
    if brdf.channels() == 1 { DVec3::splat(out[0]) } else { DVec3::from(out) }
}

/// Directional albedo of a Phong lobe of weight 1, written out here.
fn phong(n: f64, theta: f64) -> (f64, f64) {
    // Beyond this angle cosⁿα < e⁻⁵⁰.
    let reach = (100.0 / n.max(1e-9)).sqrt().min(FRAC_PI_2);
    let frame = Frame::from_normal(mirror(direction(theta, 0.0)));
    let axis = frame.normal;
    let lobe = |wi: DVec3| {
        let half = 0.25 * (wi - axis).length_squared(); // sin²(α/2)
        DVec3::splat(if 2.0 * half < 1.0 { (n + 2.0) / TAU * (n * f64::ln_1p(-2.0 * half)).exp() } else { 0.0 })
    };
    let (value, error) = twice(axis, reach, lobe);
    (value.x, error.x)
}

/// A material and how its directional albedo is found.
pub struct Case {
    pub name: String,
    pub material: Material,
    albedo: Box<dyn Fn(f64) -> (DVec3, DVec3) + Send + Sync>,
}

impl Case {
    /// The albedo at `theta_deg`, and a bound on its error.
    pub fn albedo(&self, theta_deg: f64) -> (DVec3, DVec3) {
        (self.albedo)(theta_deg.to_radians())
    }

    /// A sum of lobes: kd, and (ks, n) each with one value a channel.
    fn lobes(name: &str, kd: [f64; 3], phongs: &[([f64; 3], [f64; 3])]) -> Self {
        let lambert = LobeTerm { kind: LobeKind::Lambert, weight: kd.to_vec(), shape: Some(vec![]) };
        let glossy = phongs.iter().map(|(ks, n)| LobeTerm {
            kind: LobeKind::Phong,
            weight: ks.to_vec(),
            shape: Some(vec![PerChannel::Each(n.to_vec())]),
        });
        let material = goniofit::brdf::Material {
            channels: ["r", "g", "b"].map(str::to_owned).to_vec(),
            lobes: std::iter::once(lambert).chain(glossy).collect(),
            fit: None,
        };
        let reflectance = material.reflectance(&[0, 1, 2]).expect("of space");
        let phongs = phongs.to_vec();
        let albedo = move |theta: f64| {
            let (mut value, mut error) = (DVec3::from(kd), DVec3::ZERO);
            for (ks, n) in &phongs {
                let mut known: Option<(f64, (f64, f64))> = None;
                for c in 0..3 {
                    let (a, e) =
                        known.filter(|(m, _)| *m == n[c]).map_or_else(|| phong(n[c], theta), |(_, found)| found);
                    known = Some((n[c], (a, e)));
                    value[c] += ks[c] * a;
                    error[c] += ks[c] * e;
                }
            }
            (value, error)
        };
        Self { name: name.into(), material: Material::Brdf(Arc::new(reflectance)), albedo: Box::new(albedo) }
    }

    /// Any BRDF, a table say, by its own values.
    pub fn brdf(name: &str, brdf: Arc<dyn Brdf>) -> Self {
        let own = Arc::clone(&brdf);
        let albedo = move |theta: f64| {
            let wo = direction(theta, 0.0);
            twice(mirror(wo), PI, |wi| rgb(own.as_ref(), wi, wo))
        };
        Self { name: name.into(), material: Material::Brdf(brdf), albedo: Box::new(albedo) }
    }

    /// A measured table by its own values; directions that nobody measured count for nothing, as they do in a picture.
    pub fn measured(name: &str, brdf: Arc<dyn Brdf>) -> Self {
        let own = Arc::clone(&brdf);
        let albedo = move |theta: f64| {
            let wo = direction(theta, 0.0);
            refined(wo, |wi| rgb(own.as_ref(), wi, wo))
        };
        Self { name: name.into(), material: Material::Brdf(brdf), albedo: Box::new(albedo) }
    }

    /// The same material, of which the renderer doesn't know that it is a sum of lobes: the general path.
    pub fn opaque(&self) -> Option<Material> {
        match &self.material {
            Material::Brdf(brdf) => brdf.lobes().map(|_| Material::Brdf(Arc::new(Opaque(Arc::clone(brdf))))),
            _ => None,
        }
    }
}

/// A BRDF that tells no one what it is made of.
pub struct Opaque(pub Arc<dyn Brdf>);

impl Brdf for Opaque {
    fn channels(&self) -> usize {
        self.0.channels()
    }
    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        self.0.eval(wi, wo, out)
    }
    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        self.0.sample(wo, u)
    }
    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        self.0.pdf(wi, wo)
    }
}

/// Every model that can be rendered, over its range; Phong's equation knows no environment and shows its ambient term.
pub fn models() -> Vec<Case> {
    let mut cases = vec![
        Case::lobes("lambert", [0.9, 0.5, 0.1], &[]),
        Case::lobes("three lobes", [0.2, 0.1, 0.0], &[([0.3; 3], [5.0, 8.0, 13.0]), ([0.1, 0.4, 0.6], [900.0; 3])]),
    ];
    for n in [0.0, 1.0, 30.0, 1e3, 1e6, 1e8] {
        cases.push(Case::lobes(&format!("phong {n:e}"), [0.0; 3], &[([1.0, 0.5, 0.25], [n; 3])]));
    }
    let ambient = DVec3::new(0.3, 0.2, 0.1);
    let equation = PhongEquation { ambient, diffuse: DVec3::ONE, specular: DVec3::ONE, alpha: 20.0 };
    cases.push(Case {
        name: "phong's equation".into(),
        material: Material::PhongEquation(equation),
        albedo: Box::new(move |_| (ambient, DVec3::ZERO)),
    });
    cases
}
