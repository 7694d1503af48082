//! Phong's equation of 1975, kept as it was: a shading rule, not a BRDF.
//!
//! No 1/r², no normalisation, not reciprocal once divided by the cosine. It stands beside the normalised lobe so that the
//! difference can be seen.

use glam::DVec3;

/// Coefficients of the classic Phong equation, per channel: each is the product of a material's reflectance and a light's
/// intensity, both in the arbitrary units that the equation leaves open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhongEquation {
    /// `r_a` · `I_a`.
    pub ambient: DVec3,
    /// `r_d` · `I_d`.
    pub diffuse: DVec3,
    /// `r_s` · `I_s`.
    pub specular: DVec3,
    /// α ≥ 0.
    pub exponent: f64,
}

impl PhongEquation {
    /// L = `r_a I_a` + `r_d I_d` max(0, n·s) + `r_s I_s` max(0, r·b)^α, for unit vectors `b` to the eye and `s` to the light in the
    /// local frame (n = +z); r = 2(n·s)n − s. The specular term is 0 where r·b ≤ 0 or the light is below the horizon.
    #[must_use]
    pub fn radiance(&self, b: DVec3, s: DVec3) -> DVec3 {
        self.ambient + self.reflected(b, s)
    }

    /// The two terms that need the light to be visible.
    #[must_use]
    pub fn reflected(&self, b: DVec3, s: DVec3) -> DVec3 {
        if s.z <= 0.0 || b.z <= 0.0 {
            return DVec3::ZERO;
        }
        let along = crate::geometry::half_diff::cos_alpha(s, b);
        let gloss = if along > 0.0 { along.powf(self.exponent) } else { 0.0 };
        self.diffuse * s.z + self.specular * gloss
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::direction;

    #[test]
    fn the_equation_term_by_term() {
        let p = PhongEquation {
            ambient: DVec3::splat(0.1),
            diffuse: DVec3::new(0.5, 0.25, 0.0),
            specular: DVec3::splat(0.4),
            exponent: 10.0,
        };
        let s = direction(0.5, 0.0);
        let mirror = direction(0.5, std::f64::consts::PI);
        let at_peak = p.radiance(mirror, s);
        assert!((at_peak - (p.ambient + p.diffuse * 0.5f64.cos() + p.specular)).length() < 1e-14);
        assert_eq!(p.radiance(mirror, direction(2.0, 0.0)), p.ambient);
        // Not reciprocal once divided by the cosine to the light.
        let b = direction(0.9, std::f64::consts::PI);
        assert!((p.reflected(b, s) / s.z - p.reflected(s, b) / b.z).length() > 0.01);
    }
}
