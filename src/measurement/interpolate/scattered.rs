//! Listed samples of an isotropic surface, measured at a few incidences each.
//!
//! A sample stands at (θi, offset of `wo` from the mirror direction), the offset in projected direction cosines with the
//! light's azimuth turned to 0, and folded over the plane of incidence. Within an incidence values are interpolated over a
//! triangulation ([`super::mesh`]), between incidences linearly in θi at a constant offset; where one of the two does not
//! cover the offset, the other stands alone, and where neither does (between incidences, a thin crescent at grazing angles on
//! the sides), the pair is unmeasured. A table whose features move with the light rather than with its mirror image (a
//! retro-reflector) is read about the light's direction instead ([`super::anchor`]).
//!
//! Two symmetries extend what was measured without extrapolating. The incidence −θ is the incidence θ turned by 180°: between
//! the first incidence and its own turned copy lies the normal; this is used when that gap is no wider than twice the widest gap
//! between incidences. And f(wi, wo) = f(wo, wi): a pair that is not covered is looked up with its directions exchanged. Where
//! a pair is covered itself, its own samples are used alone, so that each measured value comes back as it is.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::anchor::Anchor;
use super::mesh::Mesh;
use crate::geometry::theta_of;
use crate::measurement::{Dimension, Measurement};

/// Incidences closer than this (rad) are one: 0.02°.
const SAME_INCIDENCE: f64 = 3.5e-4;
/// Neighbouring incidences are at least this far apart (rad), at the median: 0.1°. Else no incidence repeats.
const APART: f64 = 1.75e-3;
/// An incidence counts when it has this many valid samples …
const FEWEST_SAMPLES: usize = 8;
/// … and reaches this far out of the plane of incidence, and this far in polar angle, in direction cosines: about 3°.
const EXTENT: f64 = 0.05;
/// Samples at the same place from several azimuths of incidence may differ by this relative standard deviation.
const ISOTROPIC: f64 = 0.25;
/// Azimuths over half a turn at which a profile measured at normal incidence is repeated.
const SPIN: usize = 36;

/// What was measured at one polar angle of the light.
pub(super) struct Incidence {
    /// θi, rad.
    theta: f64,
    /// sin θi.
    pub(super) sine: f64,
    pub(super) mesh: Mesh,
}

/// A list of samples as a function of two directions.
pub(super) struct Scattered {
    incidences: Vec<Incidence>,
    anchor: Anchor,
    /// `wo` repeats, not `wi`: the two have exchanged their parts.
    exchanged: bool,
    /// The gap across the normal is bridged.
    bridged: bool,
}

impl Scattered {
    /// Reads the given channels of a list, or says why it can't be interpolated.
    pub(super) fn new(
        measurement: &Measurement,
        wi: &[DVec3],
        wo: &[DVec3],
        channels: &[usize],
        notes: &mut Vec<String>,
    ) -> Result<Self, String> {
        if measurement.dimension == Dimension::Flat {
            return Err("a flat-world table (2-D) can't be rendered in space; render a fit of a 3-D measurement".into());
        }
        let list = List { measurement, wi, wo, channels };
        list.check()?;
        let direct = list.incidences(notes);
        let exchanged = direct.is_err();
        let incidences = match direct {
            Ok(found) => found,
            // The reason that stands in the end is that of the light's incidences.
            Err(reason) => List { wi: wo, wo: wi, ..list }.incidences(notes).map_err(|_| reason)?,
        };
        let anchor = Anchor::of(&incidences, channels.len());
        let bridged = reaches_normal(&incidences);
        let table = Self { incidences, anchor, exchanged, bridged };
        table.describe(notes);
        Ok(table)
    }

    fn describe(&self, notes: &mut Vec<String>) {
        let degrees = |i: Option<&Incidence>| i.map_or(f64::NAN, |i| i.theta.to_degrees());
        let (first, last) = (degrees(self.incidences.first()), degrees(self.incidences.last()));
        let count = self.incidences.len();
        notes.push(format!(
            "interpolated between {count} incidences from {first:.2}° to {last:.2}°, taken as isotropic"
        ));
        if self.anchor == Anchor::Retro {
            notes.push("incidences agree best about the retro direction: offsets are counted from it".into());
        }
        if self.exchanged {
            notes.push(
                "outgoing directions repeat, incidences do not: read with the two exchanged (reciprocity)".into(),
            );
        }
        if first > 0.0 && self.bridged {
            notes.push(format!("below {first:.2}° interpolated across the normal, by isotropy"));
        }
    }

    /// Polar angles (rad) at which what is covered changes abruptly: the last incidence, and just beyond.
    pub(super) fn breaks(&self) -> Vec<f64> {
        let last = self.incidences.last().map(|incidence| incidence.theta);
        last.into_iter().flat_map(|theta| [theta, theta + SAME_INCIDENCE]).collect()
    }

    /// The interpolated value of every channel; `false`, with `out` undefined, outside of what was measured.
    pub(super) fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let (a, b) = if self.exchanged { (wo, wi) } else { (wi, wo) };
        self.look_up(a, b, out) || self.look_up(b, a, out)
    }

    /// The value for the incidence of `light` at `other`.
    fn look_up(&self, light: DVec3, other: DVec3, out: &mut [f64]) -> bool {
        let theta = theta_of(light);
        let sine = light.x.hypot(light.y);
        let Some(neighbours) = self.neighbours(theta) else { return false };
        let at = turned(light, other);
        let mut total = 0.0;
        out.fill(0.0);
        for Neighbour { incidence, turned, weight } in neighbours {
            if weight > 0.0 {
                let its_sine = if turned { -incidence.sine } else { incidence.sine };
                let x = at.x + self.anchor.shift(sine, its_sine);
                let p = DVec2::new(if turned { -x } else { x }, at.y);
                total += incidence.mesh.add_interpolated(p, weight, out);
            }
        }
        if total > 0.0 {
            for value in out.iter_mut() {
                *value /= total;
            }
        }
        total > 0.0
    }

    /// The two incidences that enclose θi, with weights that add up to 1; `None` outside.
    fn neighbours(&self, theta: f64) -> Option<[Neighbour<'_>; 2]> {
        let above = self.incidences.partition_point(|i| i.theta <= theta);
        let straight = |incidence, weight| Neighbour { incidence, turned: false, weight };
        match (above.checked_sub(1).and_then(|below| self.incidences.get(below)), self.incidences.get(above)) {
            (Some(low), Some(high)) => {
                let t = (theta - low.theta) / (high.theta - low.theta);
                Some([straight(low, 1.0 - t), straight(high, t)])
            }
            (Some(last), None) if theta < last.theta + SAME_INCIDENCE => {
                Some([straight(last, 1.0), straight(last, 0.0)])
            }
            (None, Some(first)) if self.bridged || theta > first.theta - SAME_INCIDENCE => {
                let t = 0.5 * (1.0 + theta / first.theta);
                Some([Neighbour { incidence: first, turned: true, weight: 1.0 - t }, straight(first, t)])
            }
            _ => None,
        }
    }
}

/// An incidence that takes part in a value.
struct Neighbour<'a> {
    incidence: &'a Incidence,
    /// Turned by 180° about the normal.
    turned: bool,
    weight: f64,
}

/// Whether the first incidence is as near to the normal as neighbouring incidences are to each other.
fn reaches_normal(incidences: &[Incidence]) -> bool {
    let widest = incidences.windows(2).map(|pair| pair[1].theta - pair[0].theta).fold(0.0, f64::max);
    incidences.first().is_some_and(|first| first.theta <= widest + SAME_INCIDENCE)
}

/// Direction cosines of `other` with the azimuth of `light` turned to 0, folded to y ≥ 0.
fn turned(light: DVec3, other: DVec3) -> DVec2 {
    let sine = light.x.hypot(light.y);
    let (cos_phi, sin_phi) = if sine > 0.0 { (light.x / sine, light.y / sine) } else { (1.0, 0.0) };
    DVec2::new(cos_phi * other.x + sin_phi * other.y, (cos_phi * other.y - sin_phi * other.x).abs())
}

/// The samples to read; `wi` is the direction whose polar angle repeats.
#[derive(Clone, Copy)]
struct List<'a> {
    measurement: &'a Measurement,
    wi: &'a [DVec3],
    wo: &'a [DVec3],
    channels: &'a [usize],
}

impl List<'_> {
    /// Samples with both directions above the horizon (`wo` may lie on it).
    fn above_horizon(&self) -> Vec<usize> {
        (0..self.wi.len()).filter(|&i| self.wi[i].z > 1e-9 && self.wo[i].z > -1e-9).collect()
    }

    /// Refuses what no choice of incidences can mend.
    fn check(&self) -> Result<(), String> {
        let samples: Vec<usize> =
            self.above_horizon().into_iter().filter(|&i| self.row(i).all(f64::is_finite)).collect();
        if samples.is_empty() {
            return Err("no sample is valid in all of the channels to render".into());
        }
        if samples.iter().all(|&i| self.wi[i].distance(self.wo[i]) < 1e-6) {
            return Err(
                "every sample has wi = wo: a one-dimensional slice, which says nothing of other directions; fit a \
                        model and render that"
                    .into(),
            );
        }
        let in_plane = |&i: &usize| {
            let (wi, wo) = (self.wi[i], self.wo[i]);
            theta_of(wi) < SAME_INCIDENCE || turned(wi, wo).y < EXTENT
        };
        if samples.iter().all(in_plane) {
            return Err(
                "all directions lie in the plane of incidence: an in-plane scan says nothing of the rest of the \
                        hemisphere; fit a model and render that"
                    .into(),
            );
        }
        Ok(())
    }

    fn row(&self, i: usize) -> impl Iterator<Item = f64> {
        self.channels.iter().map(move |&c| self.measurement.plane(c)[i])
    }

    /// The incidences that cover enough to be interpolated, by ascending θi.
    fn incidences(&self, notes: &mut Vec<String>) -> Result<Vec<Incidence>, String> {
        let groups = self.groups()?;
        let found = groups.len();
        let incidences: Vec<Incidence> = groups
            .iter()
            .map(|(theta, group)| self.incidence(*theta, group))
            .filter_map(Result::transpose)
            .collect::<Result<_, _>>()?;
        if incidences.len() < 2 {
            return Err(format!(
                "{} of {found} incidences cover the hemisphere (at least {FEWEST_SAMPLES} valid samples, in and out of the \
                 plane of incidence); interpolation needs at least 2; fit a model and render that",
                incidences.len()
            ));
        }
        if incidences.len() < found {
            notes.push(format!("{} incidences with too few samples are left out", found - incidences.len()));
        }
        Ok(incidences)
    }

    /// The samples by incidence: (θi, indices), by ascending θi.
    fn groups(&self) -> Result<Vec<(f64, Vec<usize>)>, String> {
        let mut order: Vec<(f64, usize)> =
            self.above_horizon().into_iter().map(|i| (theta_of(self.wi[i]), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut groups: Vec<(f64, Vec<usize>)> = Vec::new();
        for (theta, i) in order {
            match groups.last_mut() {
                Some((first, group)) if theta - *first < SAME_INCIDENCE => group.push(i),
                _ => groups.push((theta, vec![i])),
            }
        }
        if groups.len() > 2 && median_gap(&groups) < APART {
            return Err(format!(
                "no incidence repeats: the samples stand at {} different θi, a median of {:.4}° apart; interpolation needs a \
                 few incidences with many outgoing directions each; fit a model and render that",
                groups.len(),
                median_gap(&groups).to_degrees()
            ));
        }
        Ok(groups)
    }

    /// One incidence; `None` when it covers too little.
    fn incidence(&self, theta: f64, group: &[usize]) -> Result<Option<Incidence>, String> {
        let normal = theta < SAME_INCIDENCE;
        let mut points: Vec<DVec2> =
            group.iter().map(|&i| turned(if normal { DVec3::Z } else { self.wi[i] }, self.wo[i])).collect();
        let mut values: Vec<f64> = group.iter().flat_map(|&i| self.row(i)).collect();
        let flat = points.iter().all(|p| p.y < EXTENT);
        if flat && normal {
            (points, values) = spun(&points, &values, self.channels.len());
        } else if flat || on_a_ring(&points) {
            return Ok(None);
        }
        let Some(mesh) = Mesh::new(&points, &values, self.channels.len()) else { return Ok(None) };
        if mesh.valid() < FEWEST_SAMPLES {
            return Ok(None);
        }
        if !normal && mesh.disagreement > ISOTROPIC && self.azimuths_differ(group) {
            return Err(format!(
                "the surface is not isotropic: at θi = {:.2}° the values change with the azimuth of incidence (by {:.0} %, one \
                 standard deviation); only isotropic lists can be interpolated",
                theta.to_degrees(),
                100.0 * mesh.disagreement
            ));
        }
        Ok(Some(Incidence { theta, sine: theta.sin(), mesh }))
    }

    fn azimuths_differ(&self, group: &[usize]) -> bool {
        let azimuth = |i: usize| self.wi[i].truncate().normalize_or_zero();
        group.first().is_some_and(|&first| group.iter().any(|&i| azimuth(i).distance(azimuth(first)) > 0.01))
    }
}

/// Whether all points are at one polar angle: what a single incidence looks like when the directions are exchanged.
fn on_a_ring(points: &[DVec2]) -> bool {
    let radii = points.iter().map(|p| p.length());
    let (low, high) = radii.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| (low.min(r), high.max(r)));
    high - low < EXTENT
}

fn median_gap(groups: &[(f64, Vec<usize>)]) -> f64 {
    let mut gaps: Vec<f64> = groups.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied().unwrap_or(f64::INFINITY)
}

/// A profile measured at normal incidence, repeated at many azimuths: there all planes are the same.
fn spun(points: &[DVec2], values: &[f64], channels: usize) -> (Vec<DVec2>, Vec<f64>) {
    let (mut places, mut all) = (Vec::new(), Vec::new());
    for k in 0..=SPIN {
        let (sin_phi, cos_phi) = (PI * k as f64 / SPIN as f64).sin_cos();
        for (point, value) in points.iter().zip(values.chunks(channels)) {
            places.push(point.length() * DVec2::new(cos_phi, sin_phi.abs()));
            all.extend_from_slice(value);
        }
    }
    (places, all)
}
