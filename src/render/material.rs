//! What a surface does with light, as the tracer sees it.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use crate::brdf::Brdf;
use crate::geometry::mirror;

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
/// radiances to show), nothing is normalised, and light does not travel on: a path ends here. A quad light stands at its centre, and
/// shines on either side of it; a constant environment is the ambient term's business. A light below the horizon is not seen.
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
    /// One light's term, for unit vectors `s` and `b` in the local frame.
    #[must_use]
    pub fn light_term(&self, s: DVec3, b: DVec3) -> DVec3 {
        if s.z <= 0.0 {
            return DVec3::ZERO;
        }
        let cos_alpha = mirror(s).dot(b);
        let highlight = if cos_alpha > 0.0 { cos_alpha.powf(self.alpha) } else { 0.0 };
        self.diffuse * s.z + self.specular * highlight
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
