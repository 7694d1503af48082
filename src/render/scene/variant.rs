//! Variants: a material with one property changed, so that a scene can show a row of them.

use std::sync::Arc;

use glam::DVec3;

use super::super::material::Material;
use super::spec::VariantSpec;
use crate::brdf::{Brdf, Reflectance, Sample};

/// The material with its highlight's exponent changed, or, where it has no highlight to change, all that it reflects scaled.
pub(super) fn vary(base: &Material, variant: &VariantSpec) -> Material {
    match (base, variant.exponent, variant.scale) {
        (Material::PhongEquation(equation), Some(n), _) => {
            Material::PhongEquation(super::super::PhongEquation { alpha: n, ..*equation })
        }
        (Material::Brdf(brdf), exponent, scale) => match (brdf.lobes(), exponent, scale) {
            (Some(lobes), Some(n), _) if has_highlight(lobes) => Material::Brdf(Arc::new(with_exponent(lobes, n))),
            (Some(lobes), _, Some(factor)) => Material::Brdf(Arc::new(scaled(lobes, factor))),
            (None, _, Some(factor)) => Material::Brdf(Arc::new(Scaled { base: Arc::clone(brdf), factor })),
            _ => base.clone(),
        },
        _ => base.clone(),
    }
}

fn has_highlight(lobes: &Reflectance) -> bool {
    lobes.parts().2.any(|(weight, _, _)| weight.iter().any(|w| *w != 0.0))
}

fn with_exponent(lobes: &Reflectance, exponent: f64) -> Reflectance {
    let (diffuse, _, glossy) = lobes.parts();
    Reflectance::lobes(diffuse.to_vec(), glossy.map(|(weight, _, _)| (weight.to_vec(), exponent)))
}

fn scaled(lobes: &Reflectance, factor: f64) -> Reflectance {
    let times = |weight: &[f64]| weight.iter().map(|w| w * factor).collect::<Vec<f64>>();
    let (diffuse, _, glossy) = lobes.parts();
    Reflectance::lobes(times(diffuse), glossy.map(|(weight, exponent, _)| (times(weight), exponent)))
}

/// A BRDF times a factor, drawn from as without it.
struct Scaled {
    base: Arc<dyn Brdf>,
    factor: f64,
}

impl Brdf for Scaled {
    fn channels(&self) -> usize {
        self.base.channels()
    }

    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let known = self.base.eval(wi, wo, out);
        out.iter_mut().for_each(|value| *value *= self.factor);
        known
    }

    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        self.base.sample(wo, u)
    }

    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        self.base.pdf(wi, wo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::direction;

    /// A BRDF that is no sum of lobes.
    struct Flat;

    impl Brdf for Flat {
        fn channels(&self) -> usize {
            1
        }
        fn eval(&self, wi: DVec3, _: DVec3, out: &mut [f64]) -> bool {
            out[0] = 0.25;
            wi.z > 0.5
        }
        fn sample(&self, _: DVec3, _: [f64; 3]) -> Option<Sample> {
            None
        }
        fn pdf(&self, _: DVec3, _: DVec3) -> f64 {
            0.125
        }
    }

    fn value(material: &Material, wi: DVec3, wo: DVec3) -> (Vec<f64>, bool) {
        let Material::Brdf(brdf) = material else { panic!("{material:?}") };
        let mut out = vec![0.0; brdf.channels()];
        let known = brdf.eval(wi, wo, &mut out);
        (out, known)
    }

    fn brdf(brdf: impl Brdf + 'static) -> Material {
        Material::Brdf(Arc::new(brdf))
    }

    #[test]
    fn a_highlight_changes_its_exponent_and_what_has_none_is_scaled() {
        let variant = VariantSpec { of: "ball".into(), exponent: Some(7.0), scale: Some(0.5) };
        let (wi, wo) = (direction(0.4, 0.0), direction(0.5, 3.0));
        let two = |n: f64, m: f64| Reflectance::lobes(vec![0.2], [(vec![0.3], n), (vec![0.1], m)]);
        assert_eq!(value(&vary(&brdf(two(100.0, 3.0)), &variant), wi, wo), value(&brdf(two(7.0, 7.0)), wi, wo));
        // A lobe of no weight is no highlight.
        let dull = |kd: f64| Reflectance::lobes(vec![kd], [(vec![0.0], 100.0)]);
        for base in [dull(0.5), Reflectance::lambert(vec![0.5])] {
            assert_eq!(value(&vary(&brdf(base), &variant), wi, wo), value(&brdf(dull(0.25)), wi, wo));
        }
        for (low, known) in [(wi, true), (direction(1.4, 0.0), false)] {
            assert_eq!(value(&vary(&brdf(Flat), &variant), low, wo), (vec![0.125], known));
        }
    }

    #[test]
    fn what_a_variant_does_not_name_stays() {
        let (wi, wo) = (direction(0.4, 0.0), direction(0.5, 3.0));
        let glossy = || brdf(Reflectance::lobes(vec![0.2], [(vec![0.3], 40.0)]));
        let only = |exponent, scale| VariantSpec { of: "ball".into(), exponent, scale };
        assert_eq!(value(&vary(&brdf(Flat), &only(Some(3.0), None)), wi, wo), (vec![0.25], true));
        let half = value(&glossy(), wi, wo).0[0] * 0.5;
        assert!((value(&vary(&glossy(), &only(None, Some(0.5))), wi, wo).0[0] - half).abs() < 1e-16);
        assert!(matches!(vary(&Material::Black, &only(Some(3.0), Some(0.5))), Material::Black));
    }
}
