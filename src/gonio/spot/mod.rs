//! The spot: each of its points sees source and detector in directions of its own, and a reading is the mean over it.
//!
//! In: an instrument whose beam has a size and whose source or detector stands at a distance. Out: pairs of directions with weights. From a point p of the
//! sample's plane, what stands at r along w is seen along v = w − p/r, so the detector takes in cosψ/|v|² = c/|v|³ of what it does from the middle, with
//! c = w·v = 1 − w·p/r (an aperture that faces the middle), and the cosine there is w_z/|v|. A beam that is even across it at the middle brings 1/c³
//! (in the flat world detectors take in c/v², and beams bring 1/c²). Edges of the beam are taken as those of a parallel one.
//!
//! The rule of order m is Gauss–Legendre in the square of the share of the way to the edge times equal steps of the edge's own angle (Gauss–Legendre
//! in it between corners): on an ellipse exact for polynomials of degree 2m − 1.

pub(super) mod outline;

use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

use glam::DVec3;

use self::outline::Piece;
use super::effects::footprint::Footprint;
use super::instrument::Instrument;
use crate::geometry::angles::theta_of;
use crate::geometry::mirror;
use crate::measurement::Dimension;
use crate::numeric::quadrature::gauss_legendre;

/// Finest order of the rule.
pub(super) const FINEST: usize = 128;
/// Relative error of the mean cosine.
const EXACT: f64 = 1e-11;
/// How much of the way to source or detector a spot may reach: beyond there is no beam that is even across, and orders would not end.
const NEAREST: f64 = 0.9;

/// A pair of directions.
type Pair = (DVec3, DVec3);

/// The spot of an instrument.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    footprint: Footprint,
    /// 1/m; 0 is far away.
    source: f64,
    detector: f64,
    dimension: Dimension,
}

/// One order: where on the way from the middle to the edge, the share of its square, and what it counts; steps of a whole edge.
#[derive(Debug)]
struct Rule {
    way: Vec<(f64, f64)>,
    steps: Vec<f64>,
}

impl Rule {
    /// The one of order `m`, [`FINEST`] at most.
    fn of(m: usize) -> &'static Self {
        static RULES: [OnceLock<Rule>; FINEST + 1] = [const { OnceLock::new() }; FINEST + 1];
        let m = m.min(FINEST);
        RULES[m].get_or_init(|| {
            let way = gauss_legendre(m).iter().map(|(x, w)| ((0.5 * (1.0 + x)).sqrt(), 0.5 * w)).collect();
            let around = 2 * m + 2;
            Self { way, steps: (0..around).map(|k| TAU * k as f64 / around as f64).collect() }
        })
    }
}

/// A point of the spot as it sees source and detector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub wi: DVec3,
    pub wo: DVec3,
    /// Share of the spot times what source and detector are nearer; without cosθo.
    pub weight: f64,
}

/// What points of a spot's edge see.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// How far (rad) they see the detector from the mirror direction, at most, beside the middle.
    pub smear: f64,
    /// Largest polar angles of source and detector, rad.
    pub theta: [f64; 2],
}

impl Spot {
    /// That of an instrument; `None` where all of its spot sees one pair of directions.
    pub fn of(instrument: &Instrument, dimension: Dimension) -> Option<Self> {
        let (source, detector) = (instrument.source.nearness(), instrument.detector.nearness());
        let matters = instrument.source.beam_diameter_m > 0.0 && source + detector > 0.0;
        matters.then(|| Self { footprint: Footprint::of_beam(instrument, dimension), source, detector, dimension })
    }

    /// Calls `add` with the points of the rule of order `m`; their shares of the spot add up to 1. None below the horizon.
    pub fn points(&self, (wi, wo): Pair, m: usize, mut add: impl FnMut(Point)) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return;
        }
        let mut at = |p: DVec3, share: f64| {
            let ((wi, of_source), (wo, of_detector)) = (self.lit(wi, p), self.seen(wo, p));
            add(Point { wi, wo, weight: share * of_source * of_detector });
        };
        if self.dimension == Dimension::Flat {
            let half = self.footprint.length(wi, wo);
            gauss_legendre(2 * m).iter().for_each(|(x, w)| at(DVec3::X * (half * x), 0.5 * w));
            return;
        }
        let (rule, edge) = (Rule::of(m), self.footprint.edge(wi, wo));
        let area: f64 = edge.iter().map(Piece::area).sum();
        for piece in &edge {
            let mut ring = |own: f64, share: f64| {
                let rim = piece.at(own);
                rule.way.iter().for_each(|(way, w)| at(rim * *way, share * w));
            };
            if piece.is_whole {
                rule.steps.iter().for_each(|step| ring(*step, 1.0 / rule.steps.len() as f64));
                continue;
            }
            let (middle, half) = (0.5 * (piece.from + piece.to), 0.5 * (piece.to - piece.from));
            let of_area = 0.25 * half * piece.area_per_turn() / area;
            for (x, w) in gauss_legendre(m + 2).iter() {
                let own = middle + half * x;
                ring(own, of_area * w);
                ring(own + PI, of_area * w);
            }
        }
    }

    /// Where a point sees the source, and the irradiance there over that in the middle.
    fn lit(&self, wi: DVec3, p: DVec3) -> (DVec3, f64) {
        if self.source == 0.0 {
            return (wi, 1.0);
        }
        let Some((v, c)) = apart(wi, p * self.source) else { return (wi, 0.0) };
        let brings = if self.dimension == Dimension::Flat { c * c } else { c * c * c };
        (v.normalize(), 1.0 / brings)
    }

    /// Where a point sees the detector, and what it takes in over what it does from the middle.
    fn seen(&self, wo: DVec3, p: DVec3) -> (DVec3, f64) {
        if self.detector == 0.0 {
            return (wo, 1.0);
        }
        let Some((v, c)) = apart(wo, p * self.detector) else { return (wo, 0.0) };
        let r = v.length();
        (v / r, c / if self.dimension == Dimension::Flat { r * r } else { r * r * r })
    }

    /// ⟨cosθo⟩ over the spot, what is nearer counting more: what a diffuse surface's reading is in proportion to.
    pub fn cosine(&self, pair: Pair) -> f64 {
        self.mean(pair, |_, wo| wo.z)
    }

    /// The mean of a function of both directions that changes no faster than cosines do.
    pub fn mean(&self, pair: Pair, f: impl Fn(DVec3, DVec3) -> f64) -> f64 {
        let mut sum = 0.0;
        self.points(pair, self.smooth_order(pair, EXACT), |point| sum += point.weight * f(point.wi, point.wo));
        sum
    }

    /// How much of the way to source and to detector the spot reaches.
    fn nearness(&self, (wi, wo): Pair) -> [f64; 2] {
        let reach = match self.dimension {
            Dimension::Flat => self.footprint.length(wi, wo),
            Dimension::Space => self.footprint.edge(wi, wo).iter().map(Piece::reach).fold(0.0, f64::max),
        };
        [reach * self.source, reach * self.detector]
    }

    /// Whether the spot ends well before source and detector; at grazing incidence one that nothing cuts may not.
    pub fn is_within(&self, pair: Pair) -> bool {
        pair.0.z <= 0.0 || pair.1.z <= 0.0 || self.nearness(pair).iter().all(|near| *near < NEAREST)
    }

    /// The order that makes the mean of a smooth function as good as `accuracy`: terms fall by the square of how much of the distance the spot reaches.
    pub fn smooth_order(&self, pair: Pair, accuracy: f64) -> usize {
        let near: f64 = self.nearness(pair).iter().sum();
        let order = 1.0 + 0.5 * accuracy.ln() / near.min(NEAREST).ln();
        (order.ceil() as usize).clamp(1, FINEST)
    }

    /// What points of its edge see.
    pub fn view(&self, pair: Pair) -> View {
        let offset = |wi: DVec3, wo: DVec3| wo - mirror(wi);
        let middle = offset(pair.0, pair.1);
        let mut view = View { smear: 0.0, theta: [theta_of(pair.0), theta_of(pair.1)] };
        let mut at = |p: DVec3| {
            let (wi, wo) = (self.lit(pair.0, p).0, self.seen(pair.1, p).0);
            view.smear = view.smear.max((offset(wi, wo) - middle).length());
            view.theta = [view.theta[0].max(theta_of(wi)), view.theta[1].max(theta_of(wo))];
        };
        if self.dimension == Dimension::Flat {
            let half = self.footprint.length(pair.0, pair.1);
            [-half, half].into_iter().for_each(|x| at(DVec3::X * x));
            return view;
        }
        for piece in self.footprint.edge(pair.0, pair.1) {
            for k in 0..4 {
                let own = piece.from + (piece.to - piece.from) * f64::from(k) / 4.0;
                [own, own + PI].into_iter().for_each(|own| at(piece.at(own)));
            }
        }
        view
    }

    /// The order whose points see a peak of this half width (rad) at distances of three half widths at most; `smear` as above.
    pub fn order_for(smear: f64, width: f64) -> usize {
        (2.0 * smear / width).ceil().clamp(1.0, 1e6) as usize
    }
}

/// w − p and w·(w − p), p in units of the distance; `None` where p lies beyond what stands there.
fn apart(w: DVec3, p: DVec3) -> Option<(DVec3, f64)> {
    let v = w - p;
    let c = w.dot(v);
    (c > 0.0).then_some((v, c))
}
