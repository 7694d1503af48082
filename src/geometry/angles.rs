//! Spherical angles of unit directions.

use std::f64::consts::PI;

use glam::DVec3;

/// The unit direction at polar angle `theta` from +z and azimuth `phi` from +x (rad).
#[must_use]
pub fn direction(theta: f64, phi: f64) -> DVec3 {
    let (sin_t, cos_t) = theta.sin_cos();
    let (sin_p, cos_p) = phi.sin_cos();
    DVec3::new(sin_t * cos_p, sin_t * sin_p, cos_t)
}

/// The unit direction at angles in degrees, exact on the axes: at θ = 90° z is 0, not 6·10⁻¹⁷.
/// A negative θ means |θ| at φ + 180°.
#[must_use]
pub fn direction_deg(theta_deg: f64, phi_deg: f64) -> DVec3 {
    let (sin_t, cos_t) = sin_cos_deg(theta_deg);
    let (sin_p, cos_p) = sin_cos_deg(phi_deg);
    DVec3::new(sin_t * cos_p, sin_t * sin_p, cos_t)
}

/// (sin, cos) of an angle in degrees, exact at multiples of 90°.
#[must_use]
pub fn sin_cos_deg(angle_deg: f64) -> (f64, f64) {
    let turns = (angle_deg / 90.0).round();
    let (s, c) = (angle_deg - 90.0 * turns).to_radians().sin_cos();
    match turns.rem_euclid(4.0) as i64 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// `w` with its polar angle larger by `theta` and its azimuth by `phi` (rad); the axis counts as azimuth 0.
#[must_use]
pub fn turned(w: DVec3, theta: f64, phi: f64) -> DVec3 {
    let (sin_t, (sin_p, cos_p)) = (w.x.hypot(w.y), phi.sin_cos());
    let (x, y) = if sin_t > 0.0 { (w.x / sin_t, w.y / sin_t) } else { (1.0, 0.0) };
    let (s, c) = theta.sin_cos();
    let (sin, cos) = (sin_t * c + w.z * s, w.z * c - sin_t * s);
    DVec3::new(sin * (x * cos_p - y * sin_p), sin * (x * sin_p + y * cos_p), cos)
}

/// Polar angle of `w` from +z, in [0, π] rad; accurate near 0 and π, where acos is not.
#[must_use]
pub fn theta_of(w: DVec3) -> f64 {
    w.x.hypot(w.y).atan2(w.z)
}

/// Azimuth of `w` from +x, in (−π, π] rad; 0 on the axis.
#[must_use]
pub fn phi_of(w: DVec3) -> f64 {
    w.y.atan2(w.x)
}

/// The mirror image of `w` about the normal +z.
#[must_use]
pub fn mirror(w: DVec3) -> DVec3 {
    DVec3::new(-w.x, -w.y, w.z)
}

/// Angle between two unit vectors (rad), accurate near 0 and π (Kahan).
#[must_use]
pub fn angle_between(a: DVec3, b: DVec3) -> f64 {
    2.0 * (a - b).length().atan2((a + b).length())
}

/// Solid angle of the cap of half-angle `theta` (rad), in sr: Ω = 4π sin²(θ/2). The form 2π(1 − cos θ) cancels near 0.
#[must_use]
pub fn cap_solid_angle(theta: f64) -> f64 {
    4.0 * PI * (0.5 * theta).sin().powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_is_turned_by_its_angles() {
        for (theta, phi, more, round) in
            [(0.3, 0.0, 0.1, 0.0), (1.2, 2.0, -0.3, 0.5), (1.5, -3.0, 0.2, -0.1), (0.0, 0.0, 0.2, 1.0)]
        {
            let w = turned(direction(theta, phi), more, round);
            assert!((w - direction(theta + more, phi + round)).length() < 1e-15, "{theta} {phi}");
        }
    }

    #[test]
    fn angles_come_back_from_directions_at_every_scale() {
        for theta in [1e-12, 1e-6, 0.1, 1.0, 1.5, std::f64::consts::FRAC_PI_2, 3.0] {
            for phi in [-3.0, -1.0, 0.0, 0.5, 3.1] {
                let w = direction(theta, phi);
                assert!((theta_of(w) / theta - 1.0).abs() < 1e-14, "theta {theta:e}");
                assert!((phi_of(w) - phi).abs() < 1e-14);
                assert!((angle_between(w, DVec3::Z) / theta - 1.0).abs() < 1e-3, "theta {theta:e}");
            }
        }
    }

    #[test]
    fn degrees_are_exact_on_the_axes() {
        assert_eq!(direction_deg(90.0, 0.0), DVec3::X);
        assert_eq!(direction_deg(90.0, 90.0), DVec3::Y);
        assert_eq!(direction_deg(90.0, 180.0), -DVec3::X);
        assert_eq!(direction_deg(-90.0, 0.0), -DVec3::X);
        assert_eq!(direction_deg(0.0, 45.0), DVec3::Z);
        assert!((direction_deg(-30.0, 20.0) - direction_deg(30.0, 200.0)).length() < 1e-15);
    }

    #[test]
    fn small_caps_keep_their_digits() {
        let theta = 1e-9;
        assert!((cap_solid_angle(theta) / (PI * theta * theta) - 1.0).abs() < 1e-14);
        assert!((cap_solid_angle(PI) - 4.0 * PI).abs() < 1e-14);
    }
}
