//! Centred outlines in the sample's plane: what a beam covers, a sample's edge, a field of view; and what all of them have in common.
//!
//! Each is an ellipse, 1/r² = u cos²(φ − φ₀) + v sin²(φ − φ₀) = c₀ + c₁ cos2φ + s₁ sin2φ: two cross where that is one equation in 2φ, and between
//! crossings the common part is a sector of the nearest, a part of an ellipse's own turn.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

/// A centred ellipse.
#[derive(Debug, Clone, Copy)]
pub(in crate::gonio) struct Outline {
    u: f64,
    v: f64,
    phi: f64,
}

/// A piece of an outline, between two of its own angles.
#[derive(Debug, Clone, Copy)]
pub(in crate::gonio) struct Piece {
    outline: Outline,
    /// rad, half a turn apart where the outline is whole.
    pub from: f64,
    pub to: f64,
    /// Whether this is all of half a turn.
    pub is_whole: bool,
}

impl Piece {
    /// The area between it and the centre.
    pub fn area(&self) -> f64 {
        0.5 * (self.to - self.from) * self.area_per_turn()
    }

    /// r² dφ over the own angle's: a b.
    pub fn area_per_turn(&self) -> f64 {
        1.0 / (self.outline.u * self.outline.v).sqrt()
    }

    /// How far from the centre it gets at most.
    pub fn reach(&self) -> f64 {
        let Outline { u, v, .. } = self.outline;
        // The longer half axis lies at whole or half turns of the own angle, or a quarter beside.
        let from_axis = if u <= v { 0.0 } else { FRAC_PI_2 };
        let next = ((self.from - from_axis) / PI).ceil() * PI + from_axis;
        if self.is_whole || next <= self.to {
            return 1.0 / u.min(v).sqrt();
        }
        self.at(self.from).length().max(self.at(self.to).length())
    }

    /// The point of the outline at an own angle.
    pub fn at(&self, own: f64) -> DVec3 {
        let Outline { u, v, phi } = self.outline;
        let (along, across) = (own.cos() / u.sqrt(), own.sin() / v.sqrt());
        let (sin, cos) = phi.sin_cos();
        DVec3::new(along * cos - across * sin, along * sin + across * cos, 0.0)
    }
}

impl Outline {
    /// A disc; one of an infinite radius has no edge.
    pub fn disc(radius: f64) -> Self {
        let v = radius.powi(-2);
        Self { u: v, v, phi: 0.0 }
    }

    /// What a beam of this radius along `w` covers of the plane.
    pub fn across(w: DVec3, radius: f64) -> Self {
        let v = radius.powi(-2);
        Self { u: v * w.z * w.z, v, phi: w.y.atan2(w.x) }
    }

    /// c₀, c₁ and s₁ of 1/r².
    fn harmonics(&self) -> [f64; 3] {
        let (mean, half) = (0.5 * (self.u + self.v), 0.5 * (self.u - self.v));
        let (sin, cos) = (2.0 * self.phi).sin_cos();
        [mean, half * cos, half * sin]
    }

    /// 1/r².
    pub fn inverse_square(&self, phi: f64) -> f64 {
        let (sin, cos) = (phi - self.phi).sin_cos();
        self.u * cos * cos + self.v * sin * sin
    }

    /// Azimuths in (0, π) where both have the same radius.
    fn crossings(&self, other: &Self) -> Option<[f64; 2]> {
        let (a, b) = (self.harmonics(), other.harmonics());
        let [mean, cos, sin] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let size = cos.hypot(sin);
        if size == 0.0 || mean.abs() >= size {
            return None;
        }
        let (towards, away) = (sin.atan2(cos), (-mean / size).acos());
        Some([towards + away, towards - away].map(|twice| 0.5 * twice.rem_euclid(TAU)))
    }

    /// Whether nothing of it is outside of the other.
    pub fn lies_within(&self, other: &Self) -> bool {
        self.inverse_square(0.0) >= other.inverse_square(0.0) && self.crossings(other).is_none()
    }

    /// The own angle, tan⁻¹(√(v/u) tan(φ − φ₀)), of an azimuth.
    fn own(&self, phi: f64) -> f64 {
        let t = phi - self.phi;
        let quarters = (t / FRAC_PI_2).round();
        let (sin, cos) = t.sin_cos();
        let own = (self.v.sqrt() * sin).atan2(self.u.sqrt() * cos);
        // The own angle is within a quarter of a turn of t: the branch of the arctangent follows.
        own + TAU * ((quarters * FRAC_PI_2 - own) / TAU).round()
    }
}

/// The edge of what all outlines have in common, over half a turn: each is its own image about the centre.
pub(in crate::gonio) fn common(outlines: &[Outline; 3]) -> Vec<Piece> {
    let whole = |outline: Outline| Piece { outline, from: outline.own(0.0), to: outline.own(PI), is_whole: true };
    if outlines[1..].iter().all(|edge| outlines[0].lies_within(edge)) {
        return vec![whole(outlines[0])];
    }
    let mut ends: Vec<f64> = vec![0.0, PI];
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        ends.extend(outlines[a].crossings(&outlines[b]).into_iter().flatten());
    }
    ends.sort_by(f64::total_cmp);
    let nearest = |e: &[f64]| {
        let at = |k: &usize| outlines[*k].inverse_square(0.5 * (e[0] + e[1]));
        (0..outlines.len()).max_by(|a, b| at(a).total_cmp(&at(b))).unwrap_or(0)
    };
    let pieces: Vec<(usize, f64, f64)> = ends.windows(2).map(|e| (nearest(e), e[0], e[1])).collect();
    let first = pieces[0].0;
    if pieces.iter().all(|(k, ..)| *k == first) {
        return vec![whole(outlines[first])];
    }
    let piece = |(k, from, to): (usize, f64, f64)| {
        let outline = outlines[k];
        Piece { outline, from: outline.own(from), to: outline.own(to), is_whole: false }
    };
    pieces.into_iter().map(piece).collect()
}
