//! The directions and values that an RGL file's grid stands for, listed entry by entry.
//!
//! Entry (p, t, j, i) is node (i, j) of the value table at stored incidence (p, t): s = (i/(nx − 1), j/(ny − 1)), m by the warp,
//! wo the reflection of wi about m. Its weight is the solid angle of its cell in s, seen in wo, times that of its incidence's
//! cell in wi. Cells are hat functions, so that neighbours share what lies between them in proportion.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::brdf::{RglBrdf, Symmetry, reflect, solid_angle_per_area};
use super::tensor::entry;
use super::warp::Cell;
use crate::geometry::grid::{cell_borders, polar_cells};
use crate::measurement::Masked;

/// Pieces each way that a cell is cut into at most, to integrate over it.
const FINEST: usize = 8;

/// All entries of a file; values channel-major, NaN where masked.
pub(super) struct Listing {
    pub wi: Vec<DVec3>,
    pub wo: Vec<DVec3>,
    pub values: Vec<f64>,
    pub weights: Vec<f64>,
    pub masked: Masked,
    pub notes: Vec<String>,
}

/// Lists what `brdf` holds. `valid` is the file's field of that name, `values_name` the name of the field of values.
pub(super) fn list(brdf: &RglBrdf, valid: Option<&[u8]>, values_name: &str) -> Listing {
    let slices: Vec<Slice> = (0..brdf.phi_i.len() * brdf.theta_i.len())
        .into_par_iter()
        .map(|k| Slice::new(brdf, k / brdf.theta_i.len(), k % brdf.theta_i.len()))
        .collect();
    let per_slice = brdf.values.nx * brdf.values.ny;
    let wi: Vec<DVec3> = slices.iter().flat_map(|s| std::iter::repeat_n(s.wi, per_slice)).collect();
    let wo: Vec<DVec3> = slices.iter().flat_map(|s| s.wo.iter().copied()).collect();
    let weights = weights(brdf, &slices);
    let factors: Vec<f64> = slices.iter().flat_map(|s| s.factor.iter().copied()).collect();
    let mut notes = Vec::new();
    let measured = match valid.map(|bytes| Validity::read(bytes, &wi, &wo)) {
        None => vec![true; wi.len()],
        Some(validity) => {
            notes.extend(validity.note);
            validity.measured
        }
    };
    let usable: Vec<bool> =
        measured.iter().zip(wi.iter().zip(&wo)).map(|(&m, (i, o))| m && i.z > 0.0 && o.z > 0.0).collect();
    let (values, masked) = values(brdf, &factors, &usable, values_name);
    Listing { wi, wo, values, weights, masked, notes }
}

/// What belongs to one incidence.
struct Slice {
    wi: DVec3,
    wo: Vec<DVec3>,
    /// BRDF per stored value.
    factor: Vec<f64>,
    /// Solid angle of wo, sr.
    solid_angle: Vec<f64>,
}

impl Slice {
    fn new(brdf: &RglBrdf, p: usize, t: usize) -> Self {
        let (nx, ny) = (brdf.values.nx, brdf.values.ny);
        let (incidence, wi) = brdf.stored_incidence(p, t);
        let (mut wo, mut factor) = (Vec::with_capacity(nx * ny), Vec::with_capacity(nx * ny));
        for node in 0..nx * ny {
            let s = DVec2::new((node % nx) as f64 / (nx - 1) as f64, (node / nx) as f64 / (ny - 1) as f64);
            let (u, _) = brdf.vndf.sample(s, &incidence.mix);
            let reflected = reflect(wi, incidence.normal(u));
            factor.push(brdf.scale(&incidence, u) / reflected.z);
            wo.push(reflected);
        }
        Self { wi, wo, factor, solid_angle: solid_angles(brdf, p, t) }
    }
}

/// Solid angle (sr) of wo above the horizon that each node of one incidence stands for.
///
/// The integral ∫ hat(s) dωo runs over u, where dωo = 4 (wi·m) 2π² u sinθm du is smooth and s(u) is the warp's inverse; in s the
/// Jacobian is singular where the density vanishes. A cell of the density's grid is cut the finer the more nodes of s it spans,
/// and finest where the horizon crosses it.
fn solid_angles(brdf: &RglBrdf, p: usize, t: usize) -> Vec<f64> {
    let (nx, ny) = (brdf.values.nx, brdf.values.ny);
    let (incidence, wi) = brdf.stored_incidence(p, t);
    let (cells_x, cells_y) = brdf.vndf.cells();
    let size = DVec2::new(1.0 / cells_x as f64, 1.0 / cells_y as f64);
    let at = |u: DVec2| {
        let m = incidence.normal(u);
        Place { s: brdf.vndf.invert(u, &incidence.mix).0, cos_d: wi.dot(m), rises: reflect(wi, m).z > 0.0 }
    };
    let corner = |k: usize| DVec2::new((k % (cells_x + 1)) as f64, (k / (cells_x + 1)) as f64) * size;
    let corners: Vec<Place> = (0..(cells_x + 1) * (cells_y + 1)).map(|k| at(corner(k))).collect();
    let mut out = vec![0.0; nx * ny];
    for cell in 0..cells_x * cells_y {
        let first = cell / cells_x * (cells_x + 1) + cell % cells_x;
        let around = [first, first + 1, first + cells_x + 1, first + cells_x + 2].map(|k| corners[k]);
        let cuts = cuts(&around, DVec2::new((nx - 1) as f64, (ny - 1) as f64));
        for k in 0..cuts * cuts {
            let u = corner(first) + DVec2::new((k % cuts) as f64 + 0.5, (k / cuts) as f64 + 0.5) * size / cuts as f64;
            let place = at(u);
            if place.rises && place.cos_d > 0.0 {
                let area = size.x * size.y / (cuts * cuts) as f64;
                let solid_angle = 4.0 * place.cos_d * solid_angle_per_area(u.x) * area;
                for (i, j, share) in Cell::at(nx, ny, place.s).corners() {
                    out[j * nx + i] += share * solid_angle;
                }
            }
        }
    }
    out
}

/// A point of the square of normals.
#[derive(Clone, Copy)]
struct Place {
    /// Its preimage under the warp.
    s: DVec2,
    /// wi·m.
    cos_d: f64,
    /// Whether wo is above the horizon.
    rises: bool,
}

/// Pieces each way to cut a cell into, from its corners: none where it lies below the horizon.
fn cuts(corners: &[Place; 4], nodes: DVec2) -> usize {
    match corners.iter().filter(|c| c.rises).count() {
        0 => 0,
        4 => {
            let low = corners.iter().fold(DVec2::ONE, |low, c| low.min(c.s));
            let high = corners.iter().fold(DVec2::ZERO, |high, c| high.max(c.s));
            ((2.0 * ((high - low) * nodes).max_element()).ceil() as usize).clamp(1, FINEST)
        }
        _ => FINEST,
    }
}

/// dωi dωo of every entry, sr².
fn weights(brdf: &RglBrdf, slices: &[Slice]) -> Vec<f64> {
    let azimuth = match (brdf.symmetry, brdf.phi_i.as_slice()) {
        (Symmetry::Isotropic, _) | (_, [] | [_]) => vec![TAU / brdf.phi_i.len() as f64; brdf.phi_i.len()],
        (_, nodes @ [first, .., last]) => cell_borders(nodes, *first, *last).windows(2).map(|b| b[1] - b[0]).collect(),
    };
    let polar = polar_cells(&brdf.theta_i);
    let incidence = azimuth.iter().flat_map(|a| polar.iter().map(move |p| a * p));
    incidence.zip(slices).flat_map(|(cell, slice)| slice.solid_angle.iter().map(move |w| w * cell)).collect()
}

/// BRDF values, channel-major, and what is masked.
fn values(brdf: &RglBrdf, factors: &[f64], usable: &[bool], name: &str) -> (Vec<f64>, Masked) {
    let channels = brdf.channels.len();
    let mut out = Vec::with_capacity(factors.len() * channels);
    let mut masked = Masked::default();
    for c in 0..channels {
        for (k, (factor, &usable)) in factors.iter().zip(usable).enumerate() {
            let stored = f64::from(brdf.values.values[k * channels + c]);
            let value = stored * factor;
            if !stored.is_finite() {
                masked.count_not_finite(|| stored_place(brdf, name, k, c));
            } else if !usable || !value.is_finite() {
                masked.marked += 1;
            }
            out.push(if usable && value.is_finite() { value } else { f64::NAN });
        }
    }
    (out, masked)
}

/// Where channel `c` of entry `k` stands in the file, whose channels are planes.
fn stored_place(brdf: &RglBrdf, name: &str, k: usize, c: usize) -> String {
    let plane = brdf.values.nx * brdf.values.ny;
    entry(name, (k / plane * brdf.channels.len() + c) * plane + k % plane)
}

/// The field `valid`: one bit per entry, most significant first, or one byte per entry. Which of 0 and 1 means *not measured*
/// differs between files; no direction below the horizon can have been measured, which settles it.
struct Validity {
    measured: Vec<bool>,
    note: Option<String>,
}

impl Validity {
    fn read(bytes: &[u8], wi: &[DVec3], wo: &[DVec3]) -> Self {
        let n = wi.len();
        let Some(flags) = flags(bytes, n) else {
            let note = format!("field `valid` ignored: {} bytes for {n} entries", bytes.len());
            return Self { measured: vec![true; n], note: Some(note) };
        };
        // At grazing incidence the horizon is a matter of rounding.
        let grazing = 1e-3;
        let below = || wi.iter().zip(wo).zip(&flags).filter(|((i, o), _)| i.z > grazing && o.z <= 0.0);
        let (hidden, set) = (below().count(), below().filter(|(_, flag)| **flag).count());
        if 10 * set <= hidden {
            return Self { measured: flags, note: None };
        }
        if 10 * set >= 9 * hidden {
            let note = "field `valid` marks with 1 what was not measured (in most files with 0): read so".to_string();
            return Self { measured: flags.iter().map(|f| !f).collect(), note: Some(note) };
        }
        let note = format!("field `valid` ignored: it is set at {set} of {hidden} entries below the horizon");
        Self { measured: vec![true; n], note: Some(note) }
    }
}

fn flags(bytes: &[u8], n: usize) -> Option<Vec<bool>> {
    if bytes.len() == n {
        return Some(bytes.iter().map(|&b| b != 0).collect());
    }
    (bytes.len() == n.div_ceil(8))
        .then(|| bytes.iter().flat_map(|b| (0..8).map(move |k| b & (0x80 >> k) != 0)).take(n).collect())
}
