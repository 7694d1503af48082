//! Half and difference angles (Rusinkiewicz 1998), in the convention of the MERL tables.

use std::f64::consts::TAU;

use glam::DVec3;

use super::angles::{mirror, phi_of, theta_of};

/// The unit half vector of `wi` and `wo`; `None` when they are opposite.
#[must_use]
pub fn half_vector(wi: DVec3, wo: DVec3) -> Option<DVec3> {
    (wi + wo).try_normalize()
}

/// An isotropic pair of directions by its half and difference angles (rad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfDiff {
    /// Polar angle of the half vector, [0, π/2].
    pub theta_h: f64,
    /// Angle from the half vector to `wi`, [0, π/2].
    pub theta_d: f64,
    /// Azimuth of `wi` about the half vector, [0, 2π); 0 where θi = θh + θd.
    pub phi_d: f64,
}

impl HalfDiff {
    /// The angles of a pair; `None` when `wi` and `wo` are opposite.
    #[must_use]
    pub fn from_pair(wi: DVec3, wo: DVec3) -> Option<Self> {
        let h = half_vector(wi, wo)?;
        let theta_h = theta_of(h);
        // wi turned about z by −φh, then about y by −θh.
        let (sin_p, cos_p) = phi_of(h).sin_cos();
        let turned = DVec3::new(cos_p * wi.x + sin_p * wi.y, cos_p * wi.y - sin_p * wi.x, wi.z);
        let (sin_h, cos_h) = theta_h.sin_cos();
        let d = DVec3::new(cos_h * turned.x - sin_h * turned.z, turned.y, sin_h * turned.x + cos_h * turned.z);
        Some(Self { theta_h, theta_d: theta_of(d), phi_d: phi_of(d).rem_euclid(TAU) })
    }

    /// A pair (wi, wo) with these angles, its half vector at azimuth 0. Either may lie below the horizon.
    #[must_use]
    pub fn to_pair(self) -> (DVec3, DVec3) {
        let (sin_h, cos_h) = self.theta_h.sin_cos();
        let (sin_d, cos_d) = self.theta_d.sin_cos();
        let (sin_p, cos_p) = self.phi_d.sin_cos();
        // wo is wi with φd turned by 180°: the same as 2(wi·h)h − wi, without its rounding.
        let rotate = |x: f64, y: f64| DVec3::new(cos_h * x + sin_h * cos_d, y, cos_h * cos_d - sin_h * x);
        (rotate(sin_d * cos_p, sin_d * sin_p), rotate(-sin_d * cos_p, -sin_d * sin_p))
    }
}

/// r·wo, the cosine of the angle α between the mirror image of `wi` and `wo`.
#[must_use]
pub fn cos_alpha(wi: DVec3, wo: DVec3) -> f64 {
    mirror(wi).dot(wo)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::direction;

    #[test]
    fn pairs_and_angles_invert_each_other() {
        for (th, td, pd) in [(0.0, 0.3, 1.0), (0.4, 0.0, 0.0), (0.7, 0.5, 2.0), (1.2, 1e-7, 5.0), (1e-7, 1.3, 3.0)] {
            let (wi, wo) = HalfDiff { theta_h: th, theta_d: td, phi_d: pd }.to_pair();
            let back = HalfDiff::from_pair(wi, wo).expect("not opposite");
            assert!((back.theta_h - th).abs() < 1e-15, "{back:?}");
            assert!((back.theta_d - td).abs() < 1e-15, "{back:?}");
            if td > 0.0 && th > 1e-6 {
                assert!((back.phi_d - pd).abs() < 1e-8, "{back:?} {pd}");
            }
        }
    }

    #[test]
    fn phi_d_zero_means_theta_i_is_theta_h_plus_theta_d() {
        let (wi, wo) = HalfDiff { theta_h: 0.3, theta_d: 0.5, phi_d: 0.0 }.to_pair();
        assert!((theta_of(wi) - 0.8).abs() < 1e-15 && (theta_of(wo) - 0.2).abs() < 1e-15);
        let h = half_vector(wi, wo).expect("half");
        assert!((wo - (2.0 * wi.dot(h) * h - wi)).length() < 1e-15);
    }

    #[test]
    fn angles_do_not_depend_on_a_common_rotation() {
        let a = HalfDiff::from_pair(direction(0.5, 0.1), direction(1.0, 2.0)).expect("a");
        let b = HalfDiff::from_pair(direction(0.5, 1.4), direction(1.0, 3.3)).expect("b");
        assert!((a.theta_h - b.theta_h).abs() < 1e-14 && (a.phi_d - b.phi_d).abs() < 1e-14);
    }
}
