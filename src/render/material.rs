//! What a surface does with light, as the tracer sees it.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use crate::brdf::Brdf;
use crate::radiometry::PhongShading;

/// The materials that a caller puts in the place of a scene's names.
pub type Materials = BTreeMap<String, Material>;

/// What a surface does with light. The side away from the normal is black.
#[derive(Clone)]
pub enum Material {
    /// A BRDF of one channel (grey) or three (linear RGB).
    Brdf(Arc<dyn Brdf>),
    /// Phong's equation, a shading rule.
    PhongEquation(PhongEquation),
    /// Reflects nothing.
    Black,
}

impl std::fmt::Debug for Material {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Brdf(brdf) => f.debug_struct("Brdf").field("channels", &brdf.channels()).finish(),
            Self::PhongEquation(equation) => equation.fmt(f),
            Self::Black => f.write_str("Black"),
        }
    }
}

/// Phong's equation `L = r_a I_a + Σ (r_d I_d max(0, n·s) + r_s I_s max(0, r·b)^α)` over the lights that the point sees, with s the
/// direction to the light, b to the eye and r the mirror image of s about the normal n (Phong 1975).
///
/// It is a rule for shading, not a BRDF: a light's distance, size and power don't enter (no 1/r²; the products r I are the
/// radiances to show), nothing is normalised, and light does not travel on: a path ends here. A quad or sphere light stands at its centre,
/// and a quad shines on either side; a spot light is seen from inside its cone; a mesh light is not seen; an environment is
/// the ambient term's business.
///
/// The rule itself is [`PhongShading`], which knows no horizon. The tracer adds one: a light below the surface's horizon is not
/// seen, so it adds nothing, no highlight either.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhongEquation {
    /// `r_a I_a`, radiance per channel.
    pub ambient: DVec3,
    /// `r_d I_d`, radiance per channel.
    pub diffuse: DVec3,
    /// `r_s I_s`, radiance per channel.
    pub specular: DVec3,
    /// α, at least 0.
    pub alpha: f64,
}

impl PhongEquation {
    /// One light's term, for unit vectors `s` and `b` in the local frame; 0 for a light that is not above the horizon.
    /// NaN where a number is not finite or α < 0.
    #[must_use]
    pub fn light_term(&self, s: DVec3, b: DVec3) -> DVec3 {
        if s.z <= 0.0 {
            return DVec3::ZERO;
        }
        let rule = PhongShading { ambient: 0.0, diffuse: 1.0, specular: 1.0, exponent: self.alpha };
        let term = |c: usize| rule.value(DVec3::Z, s, b, [0.0, self.diffuse[c], self.specular[c]]).unwrap_or(f64::NAN);
        DVec3::new(term(0), term(1), term(2))
    }
}

/// Value of a BRDF of one or three channels as RGB, 1/sr, and whether it is known.
pub fn eval_rgb(brdf: &dyn Brdf, wi: DVec3, wo: DVec3) -> (DVec3, bool) {
    let mut rgb = [0.0; 3];
    if brdf.channels() == 1 {
        let known = brdf.eval(wi, wo, &mut rgb[..1]);
        return (DVec3::splat(rgb[0]), known);
    }
    let known = brdf.eval(wi, wo, &mut rgb);
    (DVec3::from(rgb), known)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::direction;

    #[test]
    fn phong_s_equation_is_the_rule_above_the_horizon_and_nothing_below() {
        let equation = PhongEquation {
            ambient: DVec3::ONE,
            diffuse: DVec3::new(0.5, 0.4, 0.0),
            specular: DVec3::new(0.7, 0.0, 0.2),
            alpha: 3.0,
        };
        let rule = |c: usize| PhongShading {
            ambient: 0.0,
            diffuse: equation.diffuse[c],
            specular: equation.specular[c],
            exponent: 3.0,
        };
        for theta in [0.0, 0.4, 1.5, 1.6, 2.5] {
            for (theta_b, phi_b) in [(0.0, 0.0), (0.5, 3.0), (1.2, 0.3), (1.5, 3.2)] {
                let (s, b) = (direction(theta, 0.1), direction(theta_b, phi_b));
                let got = equation.light_term(s, b);
                for c in 0..3 {
                    let bare = rule(c).value(DVec3::Z, s, b, [1.0; 3]).expect("finite");
                    let want = if s.z > 0.0 { bare } else { 0.0 };
                    assert!((got[c] - want).abs() < 1e-15, "theta {theta}, channel {c}: {} vs {want}", got[c]);
                }
            }
        }
        // Behind the surface the bare rule still has a highlight.
        let (s, b) = (direction(1.7, 0.1), direction(1.4, 3.2));
        assert!(rule(0).value(DVec3::Z, s, b, [1.0; 3]).expect("finite") > 0.1);
        assert_eq!(equation.light_term(s, b), DVec3::ZERO);
        assert!(PhongEquation { alpha: -1.0, ..equation }.light_term(DVec3::Z, DVec3::Z).is_nan());
    }
}
