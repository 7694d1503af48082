//! The grid of a MERL table: 90 × 90 × 180 bins in (θh, θd, φd), θh spaced by squares. Its directions are never stored.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

use crate::geometry::HalfDiff;
use crate::geometry::grid::cos_difference;

/// Which point of a bin a stored value is read at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MerlAngles {
    /// The bin's centre in index space (default).
    #[default]
    Center,
    /// The bin's lower edge, as some tools do.
    Edge,
}

/// The implied directions and solid angles of a MERL table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MerlGrid {
    /// Where in its bin an entry is read.
    pub angles: MerlAngles,
}

impl MerlGrid {
    /// Bins in θh.
    pub const THETA_H: usize = 90;
    /// Bins in θd.
    pub const THETA_D: usize = 90;
    /// Bins in φd, over [0, π).
    pub const PHI_D: usize = 180;
    /// Entries per channel.
    pub const LEN: usize = Self::THETA_H * Self::THETA_D * Self::PHI_D;

    /// (θh, θd, φd) bin indices of entry `index` < [`Self::LEN`].
    #[must_use]
    pub fn bins(index: usize) -> (usize, usize, usize) {
        (index / (Self::THETA_D * Self::PHI_D), index / Self::PHI_D % Self::THETA_D, index % Self::PHI_D)
    }

    /// θh (rad) at the fractional index `i` in [0, 90]: (i/90)²·90°.
    #[must_use]
    pub fn theta_h(i: f64) -> f64 {
        (i / Self::THETA_H as f64).powi(2) * FRAC_PI_2
    }

    /// Half and difference angles that entry `index` is read at.
    #[must_use]
    pub fn half_diff(self, index: usize) -> HalfDiff {
        let (i, j, k) = Self::bins(index);
        let shift = match self.angles {
            MerlAngles::Center => 0.5,
            MerlAngles::Edge => 0.0,
        };
        HalfDiff {
            theta_h: Self::theta_h(i as f64 + shift),
            theta_d: (j as f64 + shift) * FRAC_PI_2 / Self::THETA_D as f64,
            phi_d: (k as f64 + shift) * PI / Self::PHI_D as f64,
        }
    }

    /// (wi, wo) of entry `index`; either may lie below the horizon.
    #[must_use]
    pub fn pair(self, index: usize) -> (DVec3, DVec3) {
        self.half_diff(index).to_pair()
    }

    /// The solid angle that entry `index` stands for, up to a constant: its share of dωi dωo ∝ d cosθh · d sin²θd · dφd.
    #[must_use]
    pub fn solid_angle(index: usize) -> f64 {
        let (i, j, _) = Self::bins(index);
        let polar = cos_difference(Self::theta_h(i as f64), Self::theta_h(i as f64 + 1.0));
        let step = FRAC_PI_2 / Self::THETA_D as f64;
        // sin²b − sin²a = sin(b + a) sin(b − a)
        let difference = ((2 * j + 1) as f64 * step).sin() * step.sin();
        polar * difference * PI / Self::PHI_D as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_sit_where_the_format_s_look_up_finds_them() {
        for index in (0..MerlGrid::LEN).step_by(997) {
            let a = MerlGrid::default().half_diff(index);
            let (wi, wo) = a.to_pair();
            let back = HalfDiff::from_pair(wi, wo).expect("half");
            let i = ((back.theta_h / FRAC_PI_2).sqrt() * 90.0) as usize;
            let j = (back.theta_d / FRAC_PI_2 * 90.0) as usize;
            let k = (back.phi_d.rem_euclid(PI) / PI * 180.0) as usize;
            assert_eq!((i, j, k), MerlGrid::bins(index));
        }
    }

    #[test]
    fn solid_angles_add_up_to_the_whole() {
        // ∫ d cosθh · d sin²θd · dφd = 1 · 1 · π
        let sum: f64 = (0..MerlGrid::LEN).map(MerlGrid::solid_angle).sum();
        assert!((sum / PI - 1.0).abs() < 1e-10, "{sum}");
    }
}
