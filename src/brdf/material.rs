//! A material: lobes with their weights and shapes, and its evaluation as a BRDF.

use glam::{DVec2, DVec3};

use super::lobe::{Lobe, LobeKind, MAX_PARAMETERS, ln_cos_alpha};
use super::{Brdf, Sample, phong};
use crate::brdf::file::FitRecord;
use crate::geometry::sampling::{cosine_hemisphere, cosine_hemisphere_pdf, cosine_power};
use crate::geometry::{mirror, theta_of};

/// A shape parameter's value: one for all channels, or one a channel.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(untagged)]
pub enum PerChannel<T> {
    /// The same for all channels.
    Shared(T),
    /// One value a channel.
    Each(Vec<T>),
}

impl<T: Copy> PerChannel<T> {
    /// The value of one channel; `None` past the end of a list.
    pub fn get(&self, channel: usize) -> Option<T> {
        match self {
            Self::Shared(v) => Some(*v),
            Self::Each(list) => list.get(channel).copied(),
        }
    }
}

/// One lobe of a material.
#[derive(Debug, Clone, PartialEq)]
pub struct LobeTerm {
    /// Which lobe.
    pub kind: LobeKind,
    /// Linear weight of each channel (dimensionless).
    pub weight: Vec<f64>,
    /// Shape parameters in the order of [`Lobe::parameters`]; `None` for a lobe whose weights are all 0.
    pub shape: Option<Vec<PerChannel<f64>>>,
}

/// A sum of lobes, and what is known of the fit that found it.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Channel names.
    pub channels: Vec<String>,
    /// The lobes in the model's order.
    pub lobes: Vec<LobeTerm>,
    /// How it was fitted, if it was.
    pub fit: Option<FitRecord>,
}

impl LobeTerm {
    /// The shape of one channel; `None` where the lobe has none.
    #[must_use]
    pub fn shape_of(&self, channel: usize) -> Option<Vec<f64>> {
        self.shape.as_ref()?.iter().map(|p| p.get(channel)).collect()
    }
}

impl Material {
    /// A material from lobes `(kind, weight per channel, shape shared by all channels)`.
    #[must_use]
    pub fn new(channels: Vec<String>, lobes: Vec<(LobeKind, Vec<f64>, Vec<f64>)>) -> Self {
        let term = |(kind, weight, shape): (LobeKind, Vec<f64>, Vec<f64>)| LobeTerm {
            kind,
            weight,
            shape: Some(shape.into_iter().map(PerChannel::Shared).collect()),
        };
        Self { channels, lobes: lobes.into_iter().map(term).collect(), fit: None }
    }

    /// The model's specification, lobes joined by `+`.
    #[must_use]
    pub fn model(&self) -> String {
        self.lobes.iter().map(|l| l.kind.name()).collect::<Vec<_>>().join("+")
    }

    /// What lobe `l` is called beside its fellows: `phong`, `phong[1]` for the second of the kind.
    #[must_use]
    pub fn lobe_name(&self, l: usize) -> String {
        let kind = self.lobes[l].kind;
        match self.lobes[..l].iter().filter(|other| other.kind == kind).count() {
            0 => kind.name().into(),
            k => format!("{}[{k}]", kind.name()),
        }
    }

    /// Whether it belongs to the flat world.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        self.lobes.iter().any(|l| l.kind.is_flat())
    }

    /// The value of every channel, 1/sr (1/rad in the flat world).
    #[must_use]
    pub fn value(&self, wi: DVec3, wo: DVec3) -> Vec<f64> {
        let mut out = vec![0.0; self.channels.len()];
        self.write_value(wi, wo, &mut out);
        out
    }

    /// Writes [`Material::value`] into `out`, one number a channel.
    pub fn write_value(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) {
        out.fill(0.0);
        for term in &self.lobes {
            let lobe = term.kind.lobe();
            let coordinate = lobe.coordinate(wi, wo);
            let mut gradient = [0.0; MAX_PARAMETERS];
            let gradient = &mut gradient[..lobe.parameters().len()];
            for (c, value) in out.iter_mut().enumerate() {
                if let Some(shape) = term.shape_of(c) {
                    *value += term.weight[c] * lobe.value(&shape, coordinate, gradient);
                }
            }
        }
    }

    /// Directional albedo of each channel at polar angle `theta` (rad): what share of the light from there it reflects.
    /// `None` in the flat world.
    #[must_use]
    pub fn directional_albedo(&self, theta: f64) -> Option<Vec<f64>> {
        let mut albedo = vec![0.0; self.channels.len()];
        for term in &self.lobes {
            for (c, a) in albedo.iter_mut().enumerate() {
                let Some(shape) = term.shape_of(c) else { continue };
                *a += term.weight[c]
                    * match term.kind {
                        LobeKind::Lambert => 1.0,
                        LobeKind::Phong => phong::directional_albedo(shape[0], theta),
                        LobeKind::Lambert2d | LobeKind::Phong2d => return None,
                    };
            }
        }
        Some(albedo)
    }

    /// The material as a BRDF of the given channels (indices into [`Material::channels`]); `None` in the flat world or for an
    /// index past the end.
    #[must_use]
    pub fn reflectance(&self, channels: &[usize]) -> Option<Reflectance> {
        let pick = |list: &[f64]| channels.iter().map(|&c| list.get(c).copied()).collect::<Option<Vec<f64>>>();
        let mut diffuse = vec![0.0; channels.len()];
        let (mut glossy, mut count) = (Vec::new(), 0);
        for term in &self.lobes {
            let weight = pick(&term.weight)?;
            match term.kind {
                LobeKind::Lambert => diffuse.iter_mut().zip(&weight).for_each(|(d, w)| *d += w),
                LobeKind::Phong => {
                    glossy.extend(glossy_terms(term, channels, weight, count)?);
                    count += 1;
                }
                LobeKind::Lambert2d | LobeKind::Phong2d => return None,
            }
        }
        Some(Reflectance::new(diffuse, glossy))
    }
}

/// One Phong term for a shared exponent, or one a channel, of a material's Phong lobe with this number.
fn glossy_terms(term: &LobeTerm, channels: &[usize], weight: Vec<f64>, lobe: usize) -> Option<Vec<GlossyTerm>> {
    let exponent = match term.shape.as_deref() {
        None | Some([]) => return Some(Vec::new()),
        Some([exponent, ..]) => exponent,
    };
    let mut terms = Vec::new();
    match exponent {
        PerChannel::Shared(n) => terms.push(GlossyTerm { weight, exponent: *n, lobe }),
        PerChannel::Each(list) => {
            for (slot, (&c, &w)) in channels.iter().zip(&weight).enumerate() {
                let mut single = vec![0.0; channels.len()];
                single[slot] = w;
                terms.push(GlossyTerm { weight: single, exponent: *list.get(c)?, lobe });
            }
        }
    }
    Some(terms)
}

#[derive(Debug, Clone)]
struct GlossyTerm {
    weight: Vec<f64>,
    exponent: f64,
    /// Which of the material's Phong lobes it is, or a channel of.
    lobe: usize,
}

/// A sum of Lambert and Phong lobes, ready to be evaluated and sampled: each lobe is drawn in proportion to what it reflects, about.
#[derive(Debug, Clone)]
pub struct Reflectance {
    diffuse: Vec<f64>,
    glossy: Vec<GlossyTerm>,
    /// Mean weight of the diffuse lobe, then of each glossy one, in proportion to which they are drawn head on.
    share: Vec<f64>,
}

impl Reflectance {
    /// Without terms of which all weights are 0.
    fn new(diffuse: Vec<f64>, mut glossy: Vec<GlossyTerm>) -> Self {
        glossy.retain(|term| term.weight.iter().any(|w| *w != 0.0));
        let mean = |w: &[f64]| w.iter().map(|x| x.abs()).sum::<f64>() / w.len().max(1) as f64;
        let mut share: Vec<f64> =
            std::iter::once(mean(&diffuse)).chain(glossy.iter().map(|g| mean(&g.weight))).collect();
        let total: f64 = share.iter().sum();
        if total > 0.0 {
            share.iter_mut().for_each(|s| *s /= total);
        } else {
            share[0] = 1.0; // black: draw from the diffuse lobe, whose value is 0
        }
        Self { diffuse, glossy, share }
    }

    /// A diffuse BRDF of these albedos, one a channel.
    #[must_use]
    pub fn lambert(albedo: Vec<f64>) -> Self {
        Self::new(albedo, Vec::new())
    }

    /// A Lambert lobe and any number of Phong lobes (weights, exponent ≥ 0), one weight a channel.
    #[must_use]
    pub fn lobes(diffuse: Vec<f64>, phong: impl IntoIterator<Item = (Vec<f64>, f64)>) -> Self {
        let term = |(lobe, (weight, exponent))| GlossyTerm { weight, exponent, lobe };
        Self::new(diffuse, phong.into_iter().enumerate().map(term).collect())
    }

    /// What lobes are drawn in proportion to for an eye at cosθo = `cos`: the Lambert lobe (`None`), then the Phong lobes.
    fn chances(&self, cos: f64) -> impl Iterator<Item = (Option<&GlossyTerm>, f64)> {
        let glossy = self.glossy.iter().zip(&self.share[1..]);
        let glossy = glossy.map(move |(term, share)| (Some(term), share * phong::seen(term.exponent, cos)));
        std::iter::once((None, self.share[0])).chain(glossy)
    }

    /// The Lambert lobe's weights and its share; of each Phong lobe weights, exponent and share. Shares add up to 1; lobes are drawn in proportion to them, those
    /// of Phong lobes times [`phong::seen`].
    #[allow(clippy::type_complexity)] // two lobes' parts
    pub fn parts(&self) -> (&[f64], f64, impl Iterator<Item = (&[f64], f64, f64)>) {
        let glossy = self.glossy.iter().zip(&self.share[1..]);
        (&self.diffuse, self.share[0], glossy.map(|(term, share)| (&term.weight[..], term.exponent, *share)))
    }

    /// Whether it reflects nothing.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.glossy.is_empty() && self.diffuse.iter().all(|w| *w == 0.0)
    }

    /// Calls `add` with what lobes contribute to the BRDF, 1/sr: 0 for the Lambert lobe and k for the k-th Phong lobe of the material, weights, and the value of a
    /// lobe of weight 1.
    pub fn split(&self, wi: DVec3, wo: DVec3, mut add: impl FnMut(usize, &[f64], f64)) {
        let base = super::lambert::Lambert.value(&[], super::lambert::Lambert.coordinate(wi, wo), &mut []);
        add(0, &self.diffuse, base);
        if base == 0.0 || self.glossy.is_empty() {
            return;
        }
        let coordinate = ln_cos_alpha(wi, wo);
        for term in &self.glossy {
            add(1 + term.lobe, &term.weight, phong::Phong.value(&[term.exponent], coordinate, &mut [0.0]));
        }
    }

    /// Directional albedo of each channel for light to or from `w`.
    #[must_use]
    pub fn directional_albedo(&self, w: DVec3) -> Vec<f64> {
        let theta = theta_of(w);
        let mut albedo = self.diffuse.clone();
        for term in &self.glossy {
            let a = phong::directional_albedo(term.exponent, theta);
            albedo.iter_mut().zip(&term.weight).for_each(|(sum, weight)| *sum += weight * a);
        }
        albedo
    }
}

impl Brdf for Reflectance {
    fn channels(&self) -> usize {
        self.diffuse.len()
    }

    fn lobes(&self) -> Option<&Reflectance> {
        Some(self)
    }

    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        out.fill(0.0);
        self.split(wi, wo, |_, weight, lobe| out.iter_mut().zip(weight).for_each(|(o, w)| *o += w * lobe));
        true
    }

    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        if wo.z <= 0.0 {
            return None;
        }
        let point = DVec2::new(u[1], u[2]);
        let mut rest = u[0] * self.chances(wo.z).map(|(_, chance)| chance).sum::<f64>();
        let mut chosen = None;
        for (term, chance) in self.chances(wo.z) {
            chosen = term;
            if rest < chance {
                break;
            }
            rest -= chance;
        }
        let wi = match chosen {
            None => cosine_hemisphere(point),
            Some(term) => cosine_power(mirror(wo), term.exponent, point),
        };
        let pdf = self.pdf(wi, wo);
        (wi.z > 0.0 && pdf > 0.0).then_some(Sample { wi, pdf })
    }

    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        let (mut all, mut drawn) = (0.0, 0.0);
        self.chances(wo.z).for_each(|(term, chance)| {
            all += chance;
            drawn +=
                chance * term.map_or_else(|| cosine_hemisphere_pdf(wi), |t| phong::sampling_pdf(t.exponent, wi, wo));
        });
        drawn / all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::check;
    use crate::geometry::{Frame, direction, phi_of};
    use crate::numeric::quadrature::integrate;
    use crate::numeric::random::{Purpose, RngExt, stream};
    use crate::numeric::stats::chi_square_test;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    fn models() -> Vec<(&'static str, Reflectance)> {
        let two = Material::new(
            vec!["x".into()],
            vec![
                (LobeKind::Lambert, vec![0.2], vec![]),
                (LobeKind::Phong, vec![0.3], vec![8.0]),
                (LobeKind::Phong, vec![0.4], vec![500.0]),
            ],
        );
        vec![
            ("lambert", Reflectance::lambert(vec![0.7])),
            ("phong 0", Reflectance::lobes(vec![0.0], [(vec![1.0], 0.0)])),
            ("phong 30", Reflectance::lobes(vec![0.0], [(vec![1.0], 30.0)])),
            ("lambert + phong 200", Reflectance::lobes(vec![0.3], [(vec![0.6], 200.0)])),
            ("two lobes", two.reflectance(&[0]).expect("in space")),
        ]
    }

    /// Bins of equal area of (cosine-warped) rings and azimuth about the mirror direction, graded towards it.
    fn rings() -> Vec<f64> {
        (0..=14).map(|i| FRAC_PI_2 * 2.0 * (f64::from(i) / 14.0).powi(2)).collect()
    }

    #[test]
    fn samples_follow_the_density_and_the_rest_falls_below_the_horizon() {
        let (rings, sectors) = (rings(), 8usize);
        for (name, model) in models() {
            for theta in [0.0, 0.7, 1.4] {
                let wo = direction(theta, 0.4);
                let frame = Frame::from_normal(mirror(wo));
                let mut expected = vec![0.0; (rings.len() - 1) * sectors];
                for (bin, e) in expected.iter_mut().enumerate() {
                    let (r, s) = (bin / sectors, bin % sectors);
                    let (low, high) = (TAU * s as f64 / sectors as f64, TAU * (s as f64 + 1.0) / sectors as f64);
                    // Finely in both directions: the horizon cuts the bins.
                    for part in 0..16 {
                        let step = (high - low) / 16.0;
                        let phi = low + step * (f64::from(part) + 0.5);
                        *e += step
                            * integrate(rings[r], rings[r + 1], 40, |a| {
                                a.sin() * model.pdf(frame.to_world(direction(a, phi)), wo)
                            });
                    }
                }
                let draws = 40_000;
                let mut counts = vec![0.0; expected.len() + 1];
                let mut rng = stream(3, Purpose::Study, theta.to_bits());
                for _ in 0..draws {
                    let bin =
                        model.sample(wo, [rng.random(), rng.random(), rng.random()]).map_or(expected.len(), |s| {
                            let local = frame.to_local(s.wi);
                            let sector = (phi_of(local).rem_euclid(TAU) / TAU * sectors as f64) as usize;
                            let ring = rings.partition_point(|a| *a <= theta_of(local)).clamp(1, rings.len() - 1) - 1;
                            ring * sectors + sector.min(sectors - 1)
                        });
                    counts[bin] += 1.0;
                }
                let inside: f64 = expected.iter().sum();
                assert!(inside < 1.0 + 2e-3, "{name}, theta {theta}: density integrates to {inside}");
                expected.push((1.0 - inside).max(0.0));
                expected.iter_mut().for_each(|e| *e *= f64::from(draws));
                let (chi2, freedom, p) = chi_square_test(&counts, &expected);
                assert!(p > 1e-4, "{name}, theta {theta}: chi2 {chi2} of {freedom}, p {p}");
            }
        }
    }

    #[test]
    fn every_model_is_reciprocal_and_reflects_at_most_its_weights() {
        for (name, model) in models() {
            for k in 0..30 {
                let (a, b) = (direction(0.05 * f64::from(k), 0.0), direction(1.5 - 0.04 * f64::from(k), 2.5));
                assert!(check::reciprocity_error(&model, a, b) < 1e-12, "{name}");
            }
            for theta in [0.0, 0.5, 1.0, 1.4] {
                let wo = direction(theta, 0.0);
                let closed = model.directional_albedo(wo)[0];
                let quadrature = check::directional_albedo(&model, wo, 0, 400);
                assert!((closed - quadrature).abs() < 2e-4, "{name} theta {theta}: {closed} vs {quadrature}");
                assert!(closed <= 1.0 + 1e-12, "{name}: {closed}");
            }
        }
    }

    #[test]
    fn sampling_estimates_the_albedo() {
        for (name, model) in models() {
            let wo = direction(1.1, 1.0);
            let (mut sum, mut squares, draws) = (0.0, 0.0, 20_000);
            let mut rng = stream(5, Purpose::Study, 1);
            for _ in 0..draws {
                if let Some(s) = model.sample(wo, [rng.random(), rng.random(), rng.random()]) {
                    let mut f = [0.0];
                    model.eval(s.wi, wo, &mut f);
                    let x = f[0] * s.wi.z / s.pdf;
                    sum += x;
                    squares += x * x;
                }
            }
            let n = f64::from(draws);
            let (mean, want) = (sum / n, model.directional_albedo(wo)[0]);
            let error = crate::numeric::float::sqrt_nonneg((squares / n - mean * mean) / n);
            assert!((mean - want).abs() < 5.0 * error + 1e-9, "{name}: {mean} ± {error} vs {want}");
        }
    }

    #[test]
    fn a_material_and_its_reflectance_agree() {
        let mut material = Material::new(
            vec!["r".into(), "g".into(), "b".into()],
            vec![(LobeKind::Lambert, vec![0.1, 0.2, 0.3], vec![]), (LobeKind::Phong, vec![0.4, 0.0, 0.1], vec![40.0])],
        );
        material.lobes[1].shape = Some(vec![PerChannel::Each(vec![10.0, 20.0, 40.0])]);
        let picked = material.reflectance(&[2, 0]).expect("in space");
        let (wi, wo) = (direction(0.5, 0.0), direction(0.7, PI));
        let mut out = [0.0; 2];
        assert!(picked.eval(wi, wo, &mut out));
        let all = material.value(wi, wo);
        assert!((out[0] - all[2]).abs() < 1e-15 && (out[1] - all[0]).abs() < 1e-15);
        assert!(material.reflectance(&[3]).is_none());
        assert_eq!(material.model(), "lambert+phong");
        assert!((material.directional_albedo(0.0).expect("space")[0] - 0.5).abs() < 1e-12);
    }
}
