//! Layers of a picture beside its radiance: what the eye sees first, and how light got there. They cost nothing where none is
//! asked for. Where some are, paths are followed one at a time, so that packets' scenes have other noise.

use glam::DVec3;

use super::integrator::Watch;
use super::material::{Material, eval_rgb};
use super::points::Draws;
use super::shapes::Surface;
use crate::brdf::Brdf;
use crate::geometry::Frame;
use crate::image::{Layer, LayerKind};

/// Which layers a render gathers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LayerSet(u16);

impl LayerSet {
    /// Kinds that a render can have, with the names that the command line gives them.
    pub const NAMED: [(&'static str, LayerKind); 10] = [
        ("albedo", LayerKind::Albedo),
        ("normal", LayerKind::Normal),
        ("depth", LayerKind::Depth),
        ("samples", LayerKind::Samples),
        ("direct", LayerKind::Direct),
        ("indirect", LayerKind::Indirect),
        ("diffuse", LayerKind::Diffuse),
        ("glossy1", LayerKind::Glossy1),
        ("glossy2", LayerKind::Glossy2),
        ("glossy3", LayerKind::Glossy3),
    ];

    /// The set of these kinds; those of two pictures ([`LayerKind::Relative`], [`LayerKind::Flip`]) are left out.
    #[must_use]
    pub fn of(kinds: &[LayerKind]) -> Self {
        let bit = |i: usize| u16::from(kinds.contains(&Self::NAMED[i].1)) << i;
        Self((0..Self::NAMED.len()).map(bit).sum())
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Its kinds.
    pub fn kinds(self) -> impl Iterator<Item = LayerKind> {
        Self::NAMED.into_iter().enumerate().filter(move |(i, _)| self.0 >> i & 1 == 1).map(|(_, (_, kind))| kind)
    }

    /// Their names.
    pub(super) fn names(self) -> String {
        let mine = |(_, kind): &(&'static str, LayerKind)| self.kinds().any(|k| k == *kind);
        Self::NAMED.iter().filter(|n| mine(n)).map(|n| n.0).collect::<Vec<_>>().join(", ")
    }
}

/// Lobes that have a layer: the Lambert lobe, then Phong lobes.
const LOBES: usize = 4;

/// What one pixel has gathered beside its radiance.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gathered {
    samples: u32,
    /// Samples whose ray met a surface.
    hits: u32,
    albedo: DVec3,
    normal: DVec3,
    depth: f64,
    direct: DVec3,
    indirect: DVec3,
    lobes: [DVec3; LOBES],
}

impl Gathered {
    /// Adds a path of this radiance.
    pub fn add(&mut self, sight: &Sight, radiance: DVec3) {
        let direct = sight.direct.unwrap_or(radiance);
        self.samples += 1;
        self.direct += direct;
        self.indirect += radiance - direct;
        self.lobes.iter_mut().zip(sight.of_lobes(radiance)).for_each(|(sum, own)| *sum += own);
        if let Some(first) = &sight.first {
            self.hits += 1;
            self.albedo += first.albedo;
            self.normal += first.normal;
            self.depth += first.depth;
        }
    }

    /// The mean over the samples, 0 where there are none.
    fn mean(&self, sum: DVec3) -> [f64; 3] {
        if self.samples == 0 { [0.0; 3] } else { (sum / f64::from(self.samples)).to_array() }
    }

    fn mean_depth(&self) -> f64 {
        if self.hits == 0 { f64::INFINITY } else { self.depth / f64::from(self.hits) }
    }
}

/// The layer of a kind from what every pixel has gathered; `None` for those of two pictures.
pub(super) fn layer(kind: LayerKind, pixels: &[&Gathered]) -> Option<Layer> {
    let colors = |sum: fn(&Gathered) -> DVec3| {
        let means: Vec<_> = pixels.iter().map(|p| p.mean(sum(p))).collect();
        Some(Layer::of_colors(kind, &means))
    };
    let values = |value: fn(&Gathered) -> f64| Some(Layer::of_values(kind, pixels.iter().map(|p| value(p)).collect()));
    match kind {
        LayerKind::Albedo => colors(|p| p.albedo),
        LayerKind::Normal => colors(|p| p.normal),
        LayerKind::Depth => values(Gathered::mean_depth),
        LayerKind::Samples => values(|p| f64::from(p.samples)),
        LayerKind::Direct => colors(|p| p.direct),
        LayerKind::Indirect => colors(|p| p.indirect),
        LayerKind::Diffuse => colors(|p| p.lobes[0]),
        LayerKind::Glossy1 => colors(|p| p.lobes[1]),
        LayerKind::Glossy2 => colors(|p| p.lobes[2]),
        LayerKind::Glossy3 => colors(|p| p.lobes[3]),
        LayerKind::Relative | LayerKind::Flip => None,
    }
}

/// What one path saw on its way.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sight {
    first: Option<First>,
    /// The radiance after at most one scattering event; none where the path had no more.
    direct: Option<DVec3>,
    /// Radiance that each lobe of the first surface reflected of light that was aimed at.
    lobes: [DVec3; LOBES],
    /// Where the path went on from there: the radiance until then, and the share that each lobe has in what comes.
    onward: Option<(DVec3, [DVec3; LOBES])>,
}

impl Sight {
    /// What each lobe of the first surface reflected, of a path of this radiance.
    fn of_lobes(&self, radiance: DVec3) -> [DVec3; LOBES] {
        let Some((before, shares)) = self.onward else { return self.lobes };
        std::array::from_fn(|k| self.lobes[k] + shares[k] * (radiance - before))
    }
}

/// The share of each lobe in a BRDF's value, channel by channel; 0 of what has no lobes.
fn shares(brdf: &dyn Brdf, wi: DVec3, wo: DVec3) -> [DVec3; LOBES] {
    let (mut all, mut total) = ([DVec3::ZERO; LOBES], DVec3::ZERO);
    let Some(lobes) = brdf.lobes() else { return all };
    lobes.split(wi, wo, |lobe, weight, value| {
        let own = value * DVec3::from_array(std::array::from_fn(|c| weight[c.min(weight.len() - 1)]));
        total += own;
        if let Some(sum) = all.get_mut(lobe) {
            *sum += own;
        }
    });
    let is_some = total.cmpne(DVec3::ZERO);
    all.map(|own| DVec3::select(is_some, own / total, DVec3::ZERO))
}

#[derive(Debug, Clone, Copy)]
struct First {
    albedo: DVec3,
    normal: DVec3,
    depth: f64,
}

impl Watch for Sight {
    fn first_surface(&mut self, eye: DVec3, surface: &Surface, material: Option<&Material>, draws: Draws) {
        let to = surface.point.position - eye;
        let depth = to.length();
        let albedo = material.map_or(DVec3::ZERO, |m| albedo(m, surface, -to / depth, draws));
        self.first = Some(First { albedo, normal: surface.shading_normal, depth });
    }

    fn indirect_begins(&mut self, so_far: DVec3) {
        self.direct = Some(so_far);
    }

    fn first_reflects(&mut self, brdf: &dyn Brdf, (wi, wo): (DVec3, DVec3), radiance: DVec3) {
        let shares = shares(brdf, wi, wo);
        self.lobes.iter_mut().zip(shares).for_each(|(sum, share)| *sum += share * radiance);
    }

    fn first_goes_on(&mut self, brdf: &dyn Brdf, (wi, wo): (DVec3, DVec3), so_far: DVec3) {
        self.onward = Some((so_far, shares(brdf, wi, wo)));
    }
}

/// One estimate of the directional albedo ∫ f cosθ dω: f·cosθ/pdf of a direction that the material draws. The numbers are those
/// that the path goes on with, so the path itself does not change.
fn albedo(material: &Material, surface: &Surface, to_eye: DVec3, draws: Draws) -> DVec3 {
    let Material::Brdf(brdf) = material else { return DVec3::ZERO };
    let wo = Frame::from_normal(surface.shading_normal).to_local(to_eye);
    if wo.z <= 0.0 || surface.point.normal.dot(to_eye) <= 0.0 {
        return DVec3::ZERO;
    }
    let drawn = brdf.sample(wo, draws.direction());
    drawn.map_or(DVec3::ZERO, |drawn| eval_rgb(brdf.as_ref(), drawn.wi, wo).0 * (drawn.wi.z / drawn.pdf))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_keeps_its_kinds_in_one_order() {
        let set = LayerSet::of(&[LayerKind::Indirect, LayerKind::Albedo, LayerKind::Flip]);
        assert_eq!(set.kinds().collect::<Vec<_>>(), [LayerKind::Albedo, LayerKind::Indirect]);
        assert_eq!(set.names(), "albedo, indirect");
        assert!(LayerSet::default().is_empty() && LayerSet::of(&[LayerKind::Flip]).is_empty());
    }

    #[test]
    fn a_pixel_that_sees_nothing_is_infinitely_far() {
        let pixel = Gathered { samples: 3, ..Gathered::default() };
        let depth = layer(LayerKind::Depth, &[&pixel]).unwrap();
        assert_eq!(depth.planes, [[f64::INFINITY]]);
        assert_eq!(layer(LayerKind::Normal, &[&pixel, &Gathered::default()]).unwrap().planes[2], [0.0, 0.0]);
    }
}
