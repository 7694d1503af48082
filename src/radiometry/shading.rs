//! Phong's equation (1975), the shading rule: shown beside the normalised lobe to make the difference visible.

use glam::DVec3;

/// Phong's equation `r_a I_a + r_d I_d max(0, n·s) + r_s I_s max(0, r·b)^α` with s to the light, b to the eye and
/// r = 2(n·s)n − s the mirror image of s about the normal n.
///
/// It is a rule for shading, not a BRDF: its numbers have no unit, nothing falls with 1/r², the highlight is not normalised
/// (a sharper one reflects less), and divided by the cosine n·s it is not reciprocal.
/// ```
/// use goniofit::radiometry::{BrdfValue, PhongShading, Quadrature, Radiance, radiance_from_extended};
/// use goniofit::geometry::direction;
/// use glam::DVec3;
/// let rule = PhongShading { ambient: 0.0, diffuse: 0.0, specular: 1.0, exponent: 20.0 };
/// let (s, b) = (direction(0.3, 0.0), direction(1.0, 3.0));
/// // As a BRDF it would be rule / (n·s). Not reciprocal:
/// let rho = |s: DVec3, b: DVec3| rule.value(DVec3::Z, s, b, [1.0; 3]).unwrap() / s.z;
/// assert!(rho(s, b) < 0.8 * rho(b, s));
/// // Not normalised: seen from above under an even sky it sends 2π/(α + 1) of the sky's radiance back,
/// // more than all of it for small α.
/// let sky = |_: DVec3| Radiance::new(1.0);
/// let l = radiance_from_extended(|wi, wo| BrdfValue::new(rho(wi, wo)), DVec3::Z, sky, &Quadrature::default()).unwrap();
/// assert!((l.value.value() - std::f64::consts::TAU / 21.0).abs() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhongShading {
    /// Share `r_a` of the ambient light.
    pub ambient: f64,
    /// Share `r_d` of the diffuse term.
    pub diffuse: f64,
    /// Share `r_s` of the highlight.
    pub specular: f64,
    /// The highlight's exponent α ≥ 0.
    pub exponent: f64,
}

impl PhongShading {
    /// The shade for unit vectors `n`, `s`, `b` and the lights `[I_a, I_d, I_s]`. The rule knows no horizon: a light behind the
    /// surface still has a highlight (the tracer leaves such lights out: `render::PhongEquation`). `None` when something is not finite or α < 0.
    #[must_use]
    pub fn value(&self, n: DVec3, s: DVec3, b: DVec3, lights: [f64; 3]) -> Option<f64> {
        let r = 2.0 * n.dot(s) * n - s;
        let along = |cos: f64| cos.clamp(0.0, f64::INFINITY);
        let [ambient, diffuse, specular] = lights;
        // 0⁰ is taken for 0: away from the mirror direction there is no highlight, whatever α.
        let cos_r = along(r.dot(b));
        let highlight = if cos_r == 0.0 { 0.0 } else { cos_r.powf(self.exponent) };
        let shade =
            self.ambient * ambient + self.diffuse * diffuse * along(n.dot(s)) + self.specular * specular * highlight;
        (shade.is_finite() && self.exponent >= 0.0).then_some(shade)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // exact results are compared exactly
mod tests {
    use super::*;
    use crate::geometry::{direction, mirror};

    #[test]
    fn each_term_stands_alone() {
        let rule = PhongShading { ambient: 0.1, diffuse: 0.5, specular: 0.4, exponent: 50.0 };
        let (n, s) = (DVec3::Z, direction(0.7, 0.2));
        let value = |b, lights| rule.value(n, s, b, lights).expect("finite");
        assert!((value(DVec3::X, [1.0, 0.0, 0.0]) - 0.1).abs() < 1e-15);
        assert!((value(DVec3::X, [0.0, 1.0, 0.0]) - 0.5 * s.z).abs() < 1e-15);
        assert!((value(mirror(s), [0.0, 0.0, 1.0]) - 0.4).abs() < 1e-13);
        assert_eq!(value(-mirror(s), [0.0, 0.0, 1.0]), 0.0);
        assert_eq!(rule.value(n, DVec3::NAN, n, [1.0; 3]), None);
        assert_eq!(PhongShading { exponent: -1.0, ..rule }.value(n, s, n, [1.0; 3]), None);
    }
}
