//! The materials that a scene file writes out: a Lambert lobe and any number of normalised Phong lobes.

use std::f64::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::scene::MaterialSpec;
use crate::brdf::{Brdf, Sample};
use crate::geometry::{mirror, sampling};

/// The BRDF of a material that is written out as lobes.
pub fn inline_brdf(spec: &MaterialSpec) -> Arc<dyn Brdf> {
    Arc::new(LobeSum::new(spec))
}

/// kd/π + Σ ks (n+2)/(2π) cosⁿα.
#[derive(Debug)]
struct LobeSum {
    kd: DVec3,
    phong: Vec<PhongLobe>,
    /// Probability with which the Lambert lobe is drawn.
    diffuse_share: f64,
}

#[derive(Debug)]
struct PhongLobe {
    ks: DVec3,
    exponent: f64,
    share: f64,
}

impl LobeSum {
    fn new(spec: &MaterialSpec) -> Self {
        let kd = DVec3::from(spec.kd.unwrap_or_default());
        let total = kd.element_sum() + spec.phong.iter().map(|lobe| lobe.ks.iter().sum::<f64>()).sum::<f64>();
        let share = |weight: f64| if total > 0.0 { weight / total } else { 0.0 };
        let phong = spec.phong.iter().map(|lobe| PhongLobe {
            ks: lobe.ks.into(),
            exponent: lobe.n,
            share: share(lobe.ks.iter().sum()),
        });
        Self { kd, phong: phong.collect(), diffuse_share: if total > 0.0 { share(kd.element_sum()) } else { 1.0 } }
    }
}

impl PhongLobe {
    /// cosⁿα. Near the peak 1 − cosα = |r − wo|²/2 keeps the digits that r·wo loses.
    fn shape(&self, wi: DVec3, wo: DVec3) -> f64 {
        let r = mirror(wi);
        let cos_alpha = r.dot(wo);
        if cos_alpha <= 0.0 {
            return 0.0;
        }
        let gap = 0.5 * (r - wo).length_squared();
        let ln_cos = if gap < 0.5 { f64::ln_1p(-gap) } else { cos_alpha.ln() };
        (self.exponent * ln_cos).exp()
    }
}

impl Brdf for LobeSum {
    fn channels(&self) -> usize {
        3
    }

    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let mut f = DVec3::ZERO;
        if wi.z > 0.0 && wo.z > 0.0 {
            f = FRAC_1_PI * self.kd;
            for lobe in &self.phong {
                f += (lobe.exponent + 2.0) / TAU * lobe.shape(wi, wo) * lobe.ks;
            }
        }
        out.copy_from_slice(&f.to_array());
        true
    }

    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        if wo.z <= 0.0 {
            return None;
        }
        let square = DVec2::new(u[1], u[2]);
        let mut rest = u[0] - self.diffuse_share;
        let drawn = self.phong.iter().find(|lobe| {
            let before = rest;
            rest -= lobe.share;
            before >= 0.0 && rest < 0.0
        });
        let wi = match drawn {
            Some(lobe) => sampling::cosine_power(mirror(wo), lobe.exponent, square),
            None => sampling::cosine_hemisphere(square),
        };
        let pdf = self.pdf(wi, wo);
        (pdf > 0.0).then_some(Sample { wi, pdf })
    }

    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return 0.0;
        }
        let diffuse = self.diffuse_share * sampling::cosine_hemisphere_pdf(wi);
        let lobes = self.phong.iter().map(|lobe| lobe.share * (lobe.exponent + 1.0) / TAU * lobe.shape(wi, wo));
        diffuse + lobes.sum::<f64>()
    }
}
