//! The BRDF of an RGL file, as its authors define it: J. Dupuy, W. Jakob, *An Adaptive Parameterization for Efficient
//! Material Acquisition and Rendering*, ACM Transactions on Graphics 37(6), 2018.
//!
//! A direction ω is the point u(ω) = (√(2θ/π), φ/2π + ½) of the unit square. The density `vndf` of visible normals, given per
//! incidence, defines a warp of the square; the value measured at the microfacet normal m stands at s = warp⁻¹(u(m)), where
//! the material looks nearly uniform. With D = `ndf` and σ = `sigma`, f cosθo = value(s; ωi) · D(u(m)) / (4 σ(u(ωi))).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};

use super::warp::{Mix, Table, Warp, interval};
use crate::brdf::{Brdf, Sample};
use crate::geometry::sampling::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::geometry::{direction, half_vector, phi_of, theta_of};

/// What a file says about turning the surface about its normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Symmetry {
    /// Turning changes nothing: azimuths count from that of the incidence.
    Isotropic,
    /// Incidences over the full turn, [−π, π].
    None,
    /// A half turn changes nothing: incidences over [−π, 0].
    HalfTurn,
    /// Mirrored at x = 0 and at y = 0: incidences over [−π, −π/2].
    TwoPlanes,
}

impl Symmetry {
    /// Signs of x and y that take an incidence into the azimuths that are stored.
    fn signs(self, wi: DVec3) -> DVec2 {
        let negative = |v: f64| if v.is_sign_negative() { 1.0 } else { -1.0 };
        match self {
            Self::Isotropic | Self::None => DVec2::ONE,
            Self::HalfTurn => DVec2::splat(negative(wi.y)),
            Self::TwoPlanes => DVec2::new(negative(wi.x), negative(wi.y)),
        }
    }
}

/// A measured BRDF in the adaptive parameterisation. It is evaluated wherever both directions are above the horizon and θi lies
/// between the stored incidences, also in the gaps that the file marks as not measured, as its authors do; negative values are
/// colours out of gamut and are kept.
///
/// Conditioned on the light (θi is the polar angle of `wi`), a file need not be reciprocal. What it stores is f cosθo, which the
/// real files do not let vanish at the horizon: f grows as 1/cosθo over the last degree of θo, and ∫ f cosθi dωi
/// exceeds 1 there (in all five real files that were looked at by θo = 89.9°).
#[derive(Debug, Clone)]
pub struct RglBrdf {
    pub(super) channels: Vec<String>,
    /// Polar angles of incidence (rad), ascending.
    pub(super) theta_i: Vec<f64>,
    /// Azimuths of incidence (rad), ascending.
    pub(super) phi_i: Vec<f64>,
    pub(super) symmetry: Symmetry,
    /// Whether values are to be multiplied by D/(4σ).
    pub(super) scaled: bool,
    /// D over u(m).
    pub(super) ndf: Table,
    /// σ over u(ωi).
    pub(super) sigma: Table,
    /// Density over u(m), one slice per incidence.
    pub(super) vndf: Warp,
    /// Density over s, one slice per incidence, if the file has one.
    pub(super) luminance: Option<Warp>,
    /// Values over s, one slice per incidence.
    pub(super) values: Table,
}

/// What an evaluation depends on through the incidence alone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Incidence {
    /// The slices to mix.
    pub mix: Mix,
    /// Where azimuths count from, a unit vector.
    axis: DVec2,
    /// u(ωi).
    u: DVec2,
}

impl Incidence {
    /// u(m).
    fn square(&self, m: DVec3) -> DVec2 {
        square(theta_of(m), self.axis.perp_dot(m.truncate()).atan2(self.axis.dot(m.truncate())))
    }

    /// The m with u(m) = `u`.
    pub fn normal(&self, u: DVec2) -> DVec3 {
        let m = direction(FRAC_PI_2 * u.x * u.x, (2.0 * u.y - 1.0) * PI);
        self.axis.rotate(m.truncate()).extend(m.z)
    }
}

/// u(θ, φ); φ is folded into [−π, π).
fn square(theta: f64, phi: f64) -> DVec2 {
    let turns = phi / TAU + 0.5;
    DVec2::new((theta / FRAC_PI_2).sqrt(), turns - turns.floor())
}

/// dωm/du: the solid angle of normals per area of the unit square, 2π² u sinθ, sr.
pub(super) fn solid_angle_per_area(u_theta: f64) -> f64 {
    2.0 * PI * PI * u_theta * (FRAC_PI_2 * u_theta * u_theta).sin()
}

/// `w` reflected about `m`.
pub(super) fn reflect(w: DVec3, m: DVec3) -> DVec3 {
    2.0 * w.dot(m) * m - w
}

impl RglBrdf {
    /// Share of samples drawn ∝ cosine instead of by the file's warp. The warp is conditioned on `wo` here, where the value is
    /// conditioned on `wi`, and both it and the luminance have zeros; a share of cosine bounds f cosθi / pdf wherever f is bounded.
    const COSINE_SHARE: f64 = 0.125;

    /// The density of normals as a function of direction is singular, if weakly, at m = n: `vndf` is interpolated linearly
    /// from 0 there and dωm/du vanishes as u³. It is taken no nearer to it than this (θm = 1.6·10⁻¹² rad).
    const NEAREST: f64 = 1e-6;

    /// Rounding of a stored angle (rad): the last place of single precision at π/2 is 1.2·10⁻⁷.
    const ROUNDING: f64 = 1e-6;

    /// Channel names, in the order of the values.
    #[must_use]
    pub fn channel_names(&self) -> &[String] {
        &self.channels
    }

    /// Whether turning the surface about its normal changes nothing.
    #[must_use]
    pub fn is_isotropic(&self) -> bool {
        self.symmetry == Symmetry::Isotropic
    }

    /// Polar angles of incidence (rad) at which the file holds data, ascending.
    #[must_use]
    pub fn incidences(&self) -> &[f64] {
        &self.theta_i
    }

    /// Whether the polar angle of incidence `theta_i` (rad) lies between stored ones, but for their rounding in single precision.
    fn stores(&self, theta_i: f64) -> bool {
        let (first, last) = (self.theta_i.first(), self.theta_i.last());
        first.is_some_and(|f| theta_i >= f - Self::ROUNDING) && last.is_some_and(|l| theta_i <= l + Self::ROUNDING)
    }

    /// The incidence `wi`, already turned into the stored azimuths.
    fn incidence(&self, wi: DVec3) -> Incidence {
        let (theta, phi) = (theta_of(wi), phi_of(wi));
        let ((p, fp), (t, ft)) = (interval(&self.phi_i, phi), interval(&self.theta_i, theta));
        let slice = |p: usize, t: usize| p * self.theta_i.len() + t;
        let mix = Mix::new([
            (slice(p, t), (1.0 - fp) * (1.0 - ft)),
            (slice(p, t + 1), (1.0 - fp) * ft),
            (slice(p + 1, t), fp * (1.0 - ft)),
            (slice(p + 1, t + 1), fp * ft),
        ]);
        self.with_axis(mix, wi, square(theta, phi))
    }

    /// The stored incidence number `p` in azimuth and `t` in polar angle, and its direction.
    pub(super) fn stored_incidence(&self, p: usize, t: usize) -> (Incidence, DVec3) {
        let (theta, phi) = (self.theta_i[t], self.phi_i[p]);
        let wi = direction(theta, phi);
        (self.with_axis(Mix::one(p * self.theta_i.len() + t), wi, square(theta, phi)), wi)
    }

    /// On the normal an incidence has no azimuth: it counts as 0.
    fn with_axis(&self, mix: Mix, wi: DVec3, u: DVec2) -> Incidence {
        let axis = if self.is_isotropic() { wi.truncate().normalize_or(DVec2::X) } else { DVec2::X };
        Incidence { mix, axis, u }
    }

    /// D(u(m)) / (4 σ(u(ωi))), by which stored values are to be multiplied; 1 where a file says so.
    pub(super) fn scale(&self, incidence: &Incidence, u: DVec2) -> f64 {
        if self.scaled { self.ndf.scalar(u) / (4.0 * self.sigma.scalar(incidence.u)) } else { 1.0 }
    }

    /// Density (1/sr) of directions reflected from `w` about normals that the warp draws given `w`.
    fn reflected_pdf(&self, w: DVec3, reflected: DVec3) -> f64 {
        let Some(m) = half_vector(w, reflected) else { return 0.0 };
        let incidence = self.incidence(w);
        let u = incidence.square(m);
        let u = DVec2::new(u.x.max(Self::NEAREST), u.y);
        let (s, visible) = self.vndf.invert(u, &incidence.mix);
        let luminance = self.luminance.as_ref().map_or(1.0, |warp| warp.density(s, &incidence.mix));
        visible * luminance / (solid_angle_per_area(u.x) * 4.0 * w.dot(m))
    }

    fn sample_reflected(&self, w: DVec3, s: DVec2) -> DVec3 {
        let incidence = self.incidence(w);
        let s = self.luminance.as_ref().map_or(s, |warp| warp.sample(s, &incidence.mix).0);
        reflect(w, incidence.normal(self.vndf.sample(s, &incidence.mix).0))
    }
}

impl Brdf for RglBrdf {
    fn channels(&self) -> usize {
        self.channels.len()
    }

    /// Unknown beyond the stored polar angles of incidence, and where the file holds a value that is not finite.
    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        out.fill(0.0);
        if !above(wi, wo) {
            return true;
        }
        if !self.stores(theta_of(wi)) {
            return false;
        }
        let signs = self.symmetry.signs(wi).extend(1.0);
        let (wi, wo) = (wi * signs, wo * signs);
        let Some(m) = half_vector(wi, wo) else { return true };
        let incidence = self.incidence(wi);
        let u = incidence.square(m);
        let (s, _) = self.vndf.invert(u, &incidence.mix);
        self.values.add_at(s, &incidence.mix, self.scale(&incidence, u) / wo.z, out);
        let known = out.iter().all(|v| v.is_finite());
        if !known {
            out.fill(0.0);
        }
        known
    }

    /// By the file's own warp (luminance, then visible normals), conditioned on `wo`, and with a share of cosine.
    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        if !above(wo, wo) {
            return None;
        }
        let square = DVec2::new(u[1], u[2]);
        let wi = if u[0] < Self::COSINE_SHARE {
            cosine_hemisphere(square)
        } else {
            let signs = self.symmetry.signs(wo).extend(1.0);
            self.sample_reflected(wo * signs, square) * signs
        };
        let pdf = self.pdf(wi, wo);
        (pdf > 0.0).then_some(Sample { wi, pdf })
    }

    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        if !above(wi, wo) {
            return 0.0;
        }
        let signs = self.symmetry.signs(wo).extend(1.0);
        let warped = self.reflected_pdf(wo * signs, wi * signs);
        Self::COSINE_SHARE * cosine_hemisphere_pdf(wi) + (1.0 - Self::COSINE_SHARE) * warped
    }
}

fn above(wi: DVec3, wo: DVec3) -> bool {
    wi.z > 0.0 && wo.z > 0.0
}
