//! What every reading takes: the light that the sample reflects to the detector, and the exposure.
//!
//! A beam whose spot lies on the sample brings each cone of directions the same flux wherever it comes from, so a reading is gain · ⟨f(wi, wo) cosθo⟩
//! electrons a second, ⟨·⟩ over the cones of source and aperture, where they have a size.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::cone::{Cones, largest_move};
use super::{Block, Maker, Pass};
use crate::brdf::{LobeTerm, Material};
use crate::control::Stop;
use crate::gonio::afford::{COARSEST, Deadline};
use crate::gonio::parts::Reference;
use crate::gonio::reading::Kind;
use crate::gonio::sight;
use crate::gonio::simulate::Truth;
use crate::gonio::spot::{FINEST, Spot};
use crate::measurement::Dimension;

/// The pass that turns directions into electrons a second: f·cosθo where spot, source and aperture are points, else its mean.
pub(super) fn pass<'a>(maker: &Maker<'a>, left_out: &[&str]) -> Box<dyn Pass + 'a> {
    let unless_out = |half_angle: f64, name: &str| if left_out.contains(&name) { 0.0 } else { half_angle };
    let instrument = maker.instrument;
    let source = unless_out(instrument.source.half_angle(), super::divergence::EFFECT.name);
    let detector = unless_out(instrument.detector.half_angle(), super::aperture::EFFECT.name);
    let uncut = left_out.contains(&super::footprint::EFFECT.name);
    let lit = if uncut { &super::without(instrument, super::footprint::EFFECT.name) } else { instrument };
    let spot = Spot::of(lit, maker.dimension).filter(|_| !left_out.contains(&super::spot::EFFECT.name));
    let light = Light {
        gain: instrument.gain(),
        truth: maker.truth,
        standard: Standard::new(&instrument.reference, maker.actual.certificate, maker.dimension),
    };
    if source == 0.0 && detector == 0.0 && spot.is_none() {
        return Box::new(light);
    }
    let cones = |accuracy: f64| {
        let cones = Cones::new([source, detector], accuracy, maker.dimension);
        if let Some(order) = maker.order { cones.fixed(order) } else { cones }
    };
    let late = maker.deadline.map(|deadline| (deadline, cones(COARSEST)));
    // Half of the error is the spot's, half that of what its points see.
    let accuracy = if spot.is_some() { 0.5 * maker.accuracy } else { maker.accuracy };
    let lobes = Lobes::of(maker, (source, detector), accuracy).filter(|_| maker.order.is_none());
    // The coarsest accuracy takes the lowest orders that there are, whatever they leave.
    let kinked = maker.kinked && maker.accuracy < COARSEST;
    let order = maker.order.map(|order| order as usize);
    Box::new(Spread { light, cones: cones(accuracy), kinked, spot, accuracy, order, late, lobes, stop: maker.stop })
}

/// A truth that is a sum of lobes, of which means over both cones are known without a sum over directions.
struct Lobes<'a> {
    material: &'a Material,
    cones: sight::Cones,
    accuracy: f64,
}

impl<'a> Lobes<'a> {
    /// `None` where sums are as quick, and in the flat world.
    fn of(maker: &Maker<'a>, (source, detector): (f64, f64), accuracy: f64) -> Option<Self> {
        let material = maker.lobes.filter(|_| maker.dimension == Dimension::Space)?;
        let cones = sight::Cones::new(source, detector, None)?;
        let wide = |term: &LobeTerm, c: usize| {
            term.shape_of(c).is_some_and(|shape| shape.first().is_some_and(|n| cones.are_wide_for(*n)))
        };
        let worth = material.lobes.iter().any(|term| (0..material.channels.len()).any(|c| wide(term, c)));
        worth.then_some(Self { material, cones, accuracy })
    }

    /// Writes the mean of f·cosθo times `gain` where it is known, and returns its error; that of `sum` where it is not as good as is asked for, and the sum is
    /// better. There is no time for a sum where it is late, and no need of one at a point of the spot, which counts beside brighter ones.
    fn mean(
        &self,
        (wi, wo): (DVec3, DVec3),
        gain: f64,
        how: &How<'_>,
        out: &mut [f64],
        mut sum: impl FnMut(&mut [f64]) -> f64,
    ) -> f64 {
        let Some(error) = self.cones.write_flux(self.material, wi, wo, out) else { return sum(out) };
        out.iter_mut().for_each(|value| *value *= gain);
        if error <= self.accuracy || how.is_part || how.late.is_some() {
            return error;
        }
        let mut summed = vec![0.0; out.len()];
        let of_sum = sum(&mut summed);
        if of_sum < error {
            out.copy_from_slice(&summed);
        }
        error.min(of_sum)
    }
}

/// The BRDF of the reference standard.
#[derive(Debug, Clone, Copy)]
pub(in crate::gonio) struct Standard {
    level: f64,
    shape: f64,
    /// cosθi cosθo at the geometry of the certificate.
    certified: f64,
}

impl Standard {
    /// The standard whose certificate is off by the share `error`.
    pub fn new(reference: &Reference, error: f64, dimension: Dimension) -> Self {
        let certified = reference.theta_i_deg.to_radians().cos() * reference.theta_o_deg.to_radians().cos();
        // 1/π, in the flat world 1/2, of what is reflected.
        let even = if dimension == Dimension::Flat { 0.5 } else { FRAC_1_PI };
        Self { level: reference.reflectance * (1.0 + error) * even, shape: reference.shape, certified }
    }

    /// 1/sr; 1/rad in the flat world.
    pub fn value(&self, wi: DVec3, wo: DVec3) -> f64 {
        self.level * (1.0 + self.shape * (wi.z * wo.z - self.certified))
    }
}

/// The geometry that the standard is read at.
pub(in crate::gonio) fn reference_pair(reference: &Reference) -> (DVec3, DVec3) {
    use crate::geometry::angles::direction_deg;
    (direction_deg(reference.theta_i_deg, 180.0), direction_deg(reference.theta_o_deg, 0.0))
}

struct Light<'a> {
    gain: f64,
    truth: &'a Truth<'a>,
    standard: Standard,
}

impl Light<'_> {
    /// Adds weight · f cosθo of what is read; nothing is reflected below the horizon. Where the truth is not known the sum becomes NaN.
    fn add(&self, kind: Kind, (wi, wo): (DVec3, DVec3), weight: f64, f: &mut [f64], out: &mut [f64]) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return;
        }
        match kind {
            Kind::Sample if (self.truth)(wi, wo, f) => {}
            Kind::Sample => f.fill(f64::NAN),
            Kind::Reference => f.fill(self.standard.value(wi, wo)),
            Kind::Blank | Kind::Dark => return,
        }
        out.iter_mut().zip(f).for_each(|(out, f)| *out += weight * wo.z * *f);
    }
}

impl Pass for Light<'_> {
    fn apply(&self, block: &mut Block<'_>) {
        let (mut f, mut out) = (vec![0.0; block.width], vec![0.0; block.width]);
        for (i, reading) in block.readings.iter().enumerate() {
            out.fill(0.0);
            self.add(reading.kind, (block.wi[i], block.wo[i]), self.gain, &mut f, &mut out);
            block.of(i).iter_mut().zip(&out).for_each(|(s, out)| *s *= out);
        }
    }
}

/// Light from a source, on a spot and to a detector of some size.
struct Spread<'a> {
    light: Light<'a>,
    cones: Cones,
    /// Whether the truth may have kinks that are to be looked for.
    kinked: bool,
    spot: Option<Spot>,
    accuracy: f64,
    /// The only order, where it is set.
    order: Option<usize>,
    /// What counts for readings that would be late.
    late: Option<(Deadline, Cones)>,
    lobes: Option<Lobes<'a>>,
    stop: &'a Stop,
}

/// How a mean over cones is to be made.
struct How<'a> {
    /// By these, where it would be late otherwise.
    late: Option<&'a Cones>,
    /// Whether it is one point's of the spot.
    is_part: bool,
}

/// Directions that a mean over the spot may take before it is as good as it gets.
const MANY: usize = 300_000;

impl Spread<'_> {
    /// Writes the mean over the cones as a point of the spot sees them, and returns its error. `evaluations` counts directions.
    fn at_point(
        &self,
        kind: Kind,
        (wi, wo): (DVec3, DVec3),
        how: &How<'_>,
        evaluations: &mut usize,
        out: &mut [f64],
    ) -> f64 {
        let (gain, mut f) = (self.light.gain, vec![0.0; out.len()]);
        let mut add = |wi: DVec3, wo: DVec3, weight: f64, out: &mut [f64]| {
            *evaluations += 1;
            self.light.add(kind, (wi, wo), gain * weight, &mut f, out);
        };
        let kinked = self.kinked && how.late.is_none() && kind == Kind::Sample;
        let mut sum = |out: &mut [f64]| how.late.unwrap_or(&self.cones).mean(wi, wo, kinked, &mut add, out);
        match self.lobes.as_ref().filter(|_| kind == Kind::Sample) {
            Some(lobes) => lobes.mean((wi, wo), gain, how, out, sum),
            None => sum(out),
        }
    }

    /// Writes the mean over the spot, and returns its error: orders double from where a lobe's peak can't fall between the points.
    fn over(&self, spot: &Spot, kind: Kind, pair: (DVec3, DVec3), late: Option<&Cones>, out: &mut [f64]) -> f64 {
        if !spot.is_within(pair) {
            out.fill(f64::NAN); // no such beam
            return 0.0;
        }
        let smear = spot.view(pair).smear;
        let mut f = vec![0.0; out.len()];
        let mut add = |wi: DVec3, wo: DVec3, weight: f64, out: &mut [f64]| {
            self.light.add(kind, (wi, wo), weight, &mut f, out);
        };
        let peak = late.unwrap_or(&self.cones).peak(pair.0, pair.1, smear + self.cones.reach(), &mut add, out);
        let needed = peak.map_or(1, |width| Spot::order_for(smear, width));
        let [mut before, mut of_point, mut off] = [(); 3].map(|()| vec![0.0; out.len()]);
        let how = How { late, is_part: true };
        let (mut evaluations, mut change) = (0, f64::INFINITY);
        let lowest = if late.is_some() { 1 } else { needed.min(FINEST / 2) };
        let mut order = self.order.unwrap_or(lowest);
        let first = order;
        let inner = loop {
            out.fill(0.0);
            off.fill(0.0);
            spot.points(pair, order, |point| {
                if self.stop.requested() {
                    return;
                }
                let error = self.at_point(kind, (point.wi, point.wo), &how, &mut evaluations, &mut of_point);
                for (c, value) in of_point.iter().enumerate() {
                    out[c] += point.weight * value;
                    off[c] += point.weight * value.abs() * error;
                }
            });
            let inner = off.iter().zip(&*out).map(|(off, value)| share(*off, *value)).fold(0.0, f64::max);
            if order > first {
                change = largest_move(out, &before);
            }
            if out.iter().any(|mean| mean.is_nan()) || self.stop.requested() {
                return 0.0; // not known at a point of the spot, or not wanted any more
            }
            let is_good = change <= self.accuracy || late.is_some() && order > first || self.order.is_some();
            if is_good || 2 * order > FINEST || order > first && 5 * evaluations > MANY {
                break inner;
            }
            before.copy_from_slice(out);
            order *= 2;
        };
        // A peak between the points of the last order is not known at all.
        let missed = if needed > order { 1.0 } else { 0.0 };
        (change + inner).max(missed)
    }
}

impl Pass for Spread<'_> {
    fn apply(&self, block: &mut Block<'_>) {
        let mut out = vec![0.0; block.width];
        let mut last = None;
        for (i, reading) in block.readings.iter().enumerate() {
            if self.stop.requested() {
                block.done = i;
                return;
            }
            // Repeats and exposures of one stop have the same mean.
            let (kind, pair) = (reading.kind, (block.wi[i], block.wo[i]));
            if Some((kind, pair)) != last {
                let late = self.late.as_ref().filter(|(deadline, _)| deadline.presses(block.first + i));
                let late = late.map(|(_, coarse)| coarse);
                let is_lit = matches!(kind, Kind::Sample | Kind::Reference);
                let error = match self.spot.as_ref().filter(|_| is_lit) {
                    Some(spot) => self.over(spot, kind, pair, late, &mut out),
                    None => self.at_point(kind, pair, &How { late, is_part: false }, &mut 0, &mut out),
                };
                if self.stop.requested() {
                    block.done = i;
                    return;
                }
                block.error = block.error.max(error);
                last = Some((kind, pair));
            }
            block.of(i).iter_mut().zip(&out).for_each(|(s, out)| *s *= out);
        }
    }
}

/// An error over its value; none of nothing.
fn share(off: f64, value: f64) -> f64 {
    if off > 0.0 { off / value.abs() } else { 0.0 }
}

/// Electrons a second to electrons.
pub(super) struct Exposure;

impl Pass for Exposure {
    fn apply(&self, block: &mut Block<'_>) {
        let readings = block.readings;
        readings.iter().enumerate().for_each(|(i, reading)| block.scale(i, reading.exposure_s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_has_its_certificate_s_value_at_the_certificate_s_geometry() {
        let reference = Reference { reflectance: 0.98, shape: 0.3, ..Reference::default() };
        let (wi, wo) = reference_pair(&reference);
        let standard = Standard::new(&reference, 0.01, Dimension::Space);
        assert!((standard.value(wi, wo) * std::f64::consts::PI / (0.98 * 1.01) - 1.0).abs() < 1e-15);
        assert!(standard.value(wi, DVec3::new(0.999, 0.0, 0.044)) < standard.value(wi, wo));
    }
}
