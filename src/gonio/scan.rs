//! Where the instrument measures: pairs of directions, with the solid angle that each stands for.

use std::collections::HashMap;

use glam::DVec3;

use crate::geometry::angles::direction_deg;
use crate::geometry::grid::polar_cells;
use crate::measurement::{Dimension, Directions, MerlGrid, Weights};

/// A scan.
#[derive(Debug, Clone, PartialEq)]
pub enum Scan {
    /// The detector moves in the plane of incidence, θo from −85° to 85° every `step_deg`, for incidences 0°, 15°, … 75°.
    InPlane {
        /// Step of θo, degrees.
        step_deg: f64,
    },
    /// Incidences θi = 0, s, 2s … and the whole hemisphere of θo, φo, with s = `step_deg`, all below 90°.
    Hemisphere {
        /// Step of every angle, degrees.
        step_deg: f64,
    },
    /// The 90 × 90 × 180 grid of a MERL table, read at bin centres.
    Merl,
    /// The flat world: θi and θo from −85° to 85° every `step_deg`.
    Flat {
        /// Step of both angles, degrees.
        step_deg: f64,
    },
    /// The plane of incidence, denser where readings bend: so many pairs of directions, chosen while they are read ([`super::adapt`]). It belongs to
    /// either world.
    Adaptive {
        /// How many.
        pairs: u32,
    },
    /// Directions and weights of another measurement.
    List {
        /// What it is called.
        name: String,
        /// The directions.
        directions: Directions,
        /// Their weights.
        weights: Weights,
        /// Flat world or space.
        dimension: Dimension,
        /// The order in which the directions are read, by index, and how often; empty for each once, in their own.
        rows: Vec<u32>,
    },
}

/// Incidences of scans in the plane of incidence, degrees.
pub(super) const IN_PLANE_DEG: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];
/// How far the detector goes to each side of the normal in them, degrees.
pub(super) const MOST_DEG: f64 = 85.0;

/// Most pairs of directions that a scan may have: 16 million with three channels take about 2.5 GB.
pub const MOST_ENTRIES: f64 = 16e6;

impl Scan {
    /// Flat world or space; an adaptive scan belongs to that of the material.
    #[must_use]
    pub fn dimension(&self) -> Dimension {
        match self {
            Self::Flat { .. } => Dimension::Flat,
            Self::List { dimension, .. } => *dimension,
            _ => Dimension::Space,
        }
    }

    /// A list of which a pair of directions that comes more than once is one, read as often as it comes, in one stop where it follows itself.
    /// What it stands for is what its first row says. Other scans stay what they are.
    #[must_use]
    pub fn merged(self) -> Self {
        let Self::List { name, directions: Directions::List { wi, wo }, weights, dimension, .. } = self else {
            return self;
        };
        let (rows, firsts) = distinct(&wi, &wo);
        if firsts.len() == rows.len() {
            return Self::List { name, directions: Directions::List { wi, wo }, weights, dimension, rows: Vec::new() };
        }
        let kept = |list: &[DVec3]| firsts.iter().map(|&i| list[i]).collect();
        let directions = Directions::List { wi: kept(&wi), wo: kept(&wo) };
        Self::List { name, directions, weights: kept_weights(weights, &firsts), dimension, rows }
    }

    /// The order in which the directions are read, by index, and how often; empty for each once, in their own.
    #[must_use]
    pub fn rows(&self) -> &[u32] {
        match self {
            Self::List { rows, .. } => rows,
            _ => &[],
        }
    }

    /// The pairs of directions and what each stands for; `None` where the step asks for more than 16 million, and of an adaptive scan,
    /// which is a list once it is chosen.
    #[must_use]
    pub fn directions(&self) -> Option<(Directions, Weights)> {
        match self {
            Self::InPlane { step_deg } => {
                Some((plane_pairs(&IN_PLANE_DEG, &symmetric_steps(*step_deg)), Weights::Uniform))
            }
            Self::Flat { step_deg } => {
                let angles = symmetric_steps(*step_deg);
                Some((plane_pairs(&angles, &angles), Weights::Uniform))
            }
            Self::Hemisphere { step_deg } => hemisphere(*step_deg),
            Self::Adaptive { .. } => None,
            Self::Merl => Some((Directions::Merl(MerlGrid::default()), Weights::Merl)),
            Self::List { directions, weights, .. } => Some((directions.clone(), weights.clone())),
        }
    }
}

/// Of every pair which of the distinct ones it is, and where each of those comes first.
fn distinct(wi: &[DVec3], wo: &[DVec3]) -> (Vec<u32>, Vec<usize>) {
    let (mut seen, mut firsts) = (HashMap::new(), Vec::new());
    let mut index = |(i, pair): (usize, (&DVec3, &DVec3))| {
        // −0 is 0.
        let key = [pair.0, pair.1].map(|w| w.to_array().map(|x| (x + 0.0).to_bits()));
        *seen.entry(key).or_insert_with(|| {
            firsts.push(i);
            firsts.len() as u32 - 1
        })
    };
    (wi.iter().zip(wo).enumerate().map(&mut index).collect(), firsts)
}

/// What the directions `kept` stand for.
pub(super) fn kept_weights(weights: Weights, kept: &[usize]) -> Weights {
    let of = |list: Vec<f64>| kept.iter().map(|&i| list[i]).collect();
    match weights {
        Weights::SolidAngle(list) => Weights::SolidAngle(of(list)),
        Weights::Column(list) => Weights::Column(of(list)),
        other => other,
    }
}

/// −85° … 85° in steps, 0 among them.
fn symmetric_steps(step_deg: f64) -> Vec<f64> {
    let most = (MOST_DEG / step_deg + 1e-9).floor() as i64;
    (-most..=most).map(|k| k as f64 * step_deg).collect()
}

/// Pairs in the xz plane. A positive θi points to +x; a positive θo to −x, the side of the mirror direction.
fn plane_pairs(incidences_deg: &[f64], detector_deg: &[f64]) -> Directions {
    let (mut wi, mut wo) = (Vec::new(), Vec::new());
    for i in incidences_deg {
        for o in detector_deg {
            wi.push(direction_deg(*i, 0.0));
            wo.push(direction_deg(*o, 180.0));
        }
    }
    Directions::List { wi, wo }
}

/// Of a scan all round: rings about the normal, and directions on each.
fn rings(step_deg: f64) -> (usize, usize) {
    let polar = ((90.0 - 1e-9) / step_deg).floor() as usize;
    (polar, (360.0 / step_deg).round().max(1.0) as usize)
}

/// Pairs of directions of the scan `hemisphere:STEP`, not listed: of every incidence the normal and all that is round it.
#[must_use]
pub fn hemisphere_pairs(step_deg: f64) -> f64 {
    let (polar, around) = rings(step_deg);
    (polar as f64 + 1.0) * (1.0 + polar as f64 * around as f64)
}

/// θi at azimuth 180°, so that the mirror direction lies at φo = 0.
fn hemisphere(step_deg: f64) -> Option<(Directions, Weights)> {
    let (polar, around) = rings(step_deg);
    if hemisphere_pairs(step_deg) > MOST_ENTRIES {
        return None;
    }
    let theta_deg: Vec<f64> = (0..=polar).map(|k| k as f64 * step_deg).collect();
    let cells = polar_cells(&theta_deg.iter().map(|t| t.to_radians()).collect::<Vec<_>>());
    let (mut wi, mut wo, mut weight) = (Vec::new(), Vec::new(), Vec::new());
    let mut push = |i: DVec3, o: DVec3, w: f64| {
        wi.push(i);
        wo.push(o);
        weight.push(w);
    };
    for (ti, cell_i) in theta_deg.iter().zip(&cells) {
        let i = direction_deg(*ti, 180.0);
        for (to, cell_o) in theta_deg.iter().zip(&cells) {
            // The pole is one direction: it stands for its whole cap.
            let columns = if *to == 0.0 { 1 } else { around };
            for k in 0..columns {
                push(i, direction_deg(*to, 360.0 * k as f64 / around as f64), cell_i * cell_o / columns as f64);
            }
        }
    }
    Some((Directions::List { wi, wo }, Weights::SolidAngle(weight)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mirror;

    #[test]
    fn a_hemisphere_scan_s_weights_add_up_to_both_hemispheres() {
        let (directions, weights) = Scan::Hemisphere { step_deg: 10.0 }.directions().expect("small");
        let sum: f64 = (0..directions.len()).map(|i| weights.get(i)).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        assert_eq!(directions.len(), 9 * (1 + 8 * 36));
        for step_deg in [45.0, 10.0, 7.0] {
            let listed = Scan::Hemisphere { step_deg }.directions().expect("small").0.len();
            assert_eq!(hemisphere_pairs(step_deg), listed as f64, "step {step_deg}");
        }
        assert!(Scan::Hemisphere { step_deg: 0.1 }.directions().is_none());
    }

    #[test]
    fn a_list_reads_a_pair_as_often_as_it_comes() {
        let at = |deg: f64| direction_deg(deg, 0.0);
        let list = |degrees: &[f64]| {
            let wo: Vec<DVec3> = degrees.iter().map(|d| at(*d)).collect();
            let directions = Directions::List { wi: vec![DVec3::Z; wo.len()], wo };
            let weights = Weights::Column((0..degrees.len()).map(|i| i as f64).collect());
            let name = "l".into();
            Scan::List { name, directions, weights, dimension: Dimension::Space, rows: vec![] }.merged()
        };
        let once = list(&[10.0, 20.0]);
        assert!(once.rows().is_empty() && once.directions().expect("small").0.len() == 2);
        let scan = list(&[10.0, 10.0, 20.0, 10.0, 30.0]);
        let (directions, weights) = scan.directions().expect("small");
        assert_eq!(scan.rows(), [0, 0, 1, 0, 2]);
        assert_eq!(weights, Weights::Column(vec![0.0, 2.0, 4.0]));
        assert_eq!(directions.pair(2).1, at(30.0));
    }

    #[test]
    fn in_plane_scans_meet_the_mirror_direction() {
        let (directions, _) = Scan::InPlane { step_deg: 1.0 }.directions().expect("small");
        let met = (0..directions.len()).filter(|&i| {
            let (wi, wo) = directions.pair(i);
            (mirror(wi) - wo).length() < 1e-12
        });
        assert_eq!(met.count(), 6);
    }
}
