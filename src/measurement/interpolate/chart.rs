//! Two charts of the light's direction for a given `wo`: one that spreads the neighbourhood of the mirror direction, one that
//! spreads the neighbourhood of `wo` itself, where retro-reflectors send the light back.
//!
//! Each is a polar system whose angle is spaced by squares, so that its cells shrink towards the pole. A function is split
//! between the two by a smooth partition of unity; each part is then smooth, and narrow only where its own chart is fine.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use crate::numeric::float::sqrt_nonneg;

/// The plane of incidence of `wo`: a frame about the normal in which `wo` = (sinθo, 0, cosθo).
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    /// (sinθo, 0, cosθo).
    pub(super) wo: DVec3,
    cos_phi: f64,
    sin_phi: f64,
}

impl Plane {
    pub(super) fn new(wo: DVec3) -> Self {
        let sin_theta = wo.x.hypot(wo.y);
        let (cos_phi, sin_phi) = if sin_theta > 0.0 { (wo.x / sin_theta, wo.y / sin_theta) } else { (1.0, 0.0) };
        Self { wo: DVec3::new(sin_theta, 0.0, wo.z), cos_phi, sin_phi }
    }

    /// Turns `w` into the plane's frame.
    pub(super) fn enter(&self, w: DVec3) -> DVec3 {
        DVec3::new(self.cos_phi * w.x + self.sin_phi * w.y, self.cos_phi * w.y - self.sin_phi * w.x, w.z)
    }

    /// Turns `w` of the plane's frame back.
    pub(super) fn leave(&self, w: DVec3) -> DVec3 {
        DVec3::new(self.cos_phi * w.x - self.sin_phi * w.y, self.sin_phi * w.x + self.cos_phi * w.y, w.z)
    }
}

/// A polar system of directions to the light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Chart {
    /// The half vector about the normal, 0 to 90°.
    Half,
    /// The light about `wo`, 0 to 180°.
    Retro,
}

/// A place in a chart: sin²(θ/2) of the polar angle, which keeps its digits near the pole and is uniform in solid angle, and
/// the azimuth's cosine and sine, 0 in the plane of incidence.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polar {
    pub(super) v: f64,
    pub(super) cos_phi: f64,
    pub(super) sin_phi: f64,
}

impl Polar {
    /// On the near (1) or the far (−1) side of the plane of incidence.
    pub(super) fn on_side(self, side: f64) -> Self {
        Self { sin_phi: side * self.sin_phi, ..self }
    }
}

impl Chart {
    pub(super) const BOTH: [Self; 2] = [Self::Half, Self::Retro];

    /// Largest polar angle (rad).
    pub(super) fn theta_max(self) -> f64 {
        match self {
            Self::Half => FRAC_PI_2,
            Self::Retro => PI,
        }
    }

    /// The light (in the plane's frame) at a place of the chart, and dω of the light per dω of the chart; `None` below the
    /// horizon.
    pub(super) fn light(self, plane: &Plane, at: Polar) -> Option<(DVec3, f64)> {
        let (cos_t, sin_t) = (1.0 - 2.0 * at.v, 2.0 * sqrt_nonneg(at.v * (1.0 - at.v)));
        let (x, y) = (sin_t * at.cos_phi, sin_t * at.sin_phi);
        let wo = plane.wo;
        let (wi, stretch) = match self {
            Self::Half => {
                let h = DVec3::new(x, y, cos_t);
                let cos_d = wo.dot(h);
                (2.0 * cos_d * h - wo, 4.0 * cos_d)
            }
            Self::Retro => (x * DVec3::new(wo.z, 0.0, -wo.x) + DVec3::new(0.0, y, 0.0) + cos_t * wo, 1.0),
        };
        (wi.z > 0.0 && stretch > 0.0).then_some((wi.normalize(), stretch))
    }

    /// The place of the light `wi` (in the plane's frame), and dω of the light per dω of the chart.
    pub(super) fn place(self, plane: &Plane, wi: DVec3) -> Option<(Polar, f64)> {
        let wo = plane.wo;
        match self {
            Self::Half => {
                let h = (wi + wo).try_normalize()?;
                let stretch = 4.0 * wo.dot(h);
                let v = 0.25 * (h - DVec3::Z).length_squared();
                (stretch > 0.0).then_some((polar(v, h.x, h.y), stretch))
            }
            Self::Retro => {
                let v = 0.25 * (wi - wo).length_squared();
                Some((polar(v, wi.x * wo.z - wi.z * wo.x, wi.y), 1.0))
            }
        }
    }

    /// The share of `wi` (in the plane's frame) that this chart answers for; the two shares add up to 1. Near the mirror
    /// direction it is all [`Chart::Half`]'s, near `wo` all [`Chart::Retro`]'s.
    pub(super) fn share(self, plane: &Plane, wi: DVec3) -> f64 {
        let wo = plane.wo;
        let from_wo = (wi - wo).length_squared();
        let from_mirror = (wi - DVec3::new(-wo.x, 0.0, wo.z)).length_squared();
        let sum = from_wo + from_mirror;
        if sum <= 0.0 {
            return 0.5;
        }
        match self {
            Self::Half => from_wo / sum,
            Self::Retro => from_mirror / sum,
        }
    }
}

fn polar(v: f64, x: f64, y: f64) -> Polar {
    let r = x.hypot(y);
    let (cos_phi, sin_phi) = if r > 0.0 { (x / r, y / r) } else { (1.0, 0.0) };
    Polar { v: v.min(1.0), cos_phi, sin_phi }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::direction;

    #[test]
    fn places_and_lights_invert_each_other_and_shares_add_up_to_one() {
        for theta_o in [0.0, 1e-6, 0.4, 1.2, 1.55] {
            let plane = Plane::new(direction(theta_o, 0.7));
            for theta_i in [0.0, 1e-7, 0.3, 1.0, 1.5] {
                for phi in [0.0, 0.5, 2.0, 3.0] {
                    let wi = direction(theta_i, phi);
                    for chart in Chart::BOTH {
                        let (at, stretch) = chart.place(&plane, wi).expect("a place");
                        let (back, again) = chart.light(&plane, at).expect("a light");
                        assert!((back - wi).length() < 1e-14 / stretch.min(1.0), "{chart:?} {wi} {back}");
                        assert!((stretch - again).abs() < 1e-14);
                    }
                    let sum: f64 = Chart::BOTH.iter().map(|c| c.share(&plane, wi)).sum();
                    assert!((sum - 1.0).abs() < 1e-15);
                    assert!((plane.leave(plane.enter(wi)) - wi).length() < 1e-15);
                }
            }
        }
    }
}
