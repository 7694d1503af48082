//! What a material looks like to an instrument, about: a model fitted to readings, whose slopes tell what errors of positions do.

use std::sync::Arc;

use glam::DVec3;

use super::lean;
use crate::brdf::{LobeKind, LobeTerm, Material, Sight};
use crate::fit::{FitOptions, fit};
use crate::gonio::Instrument;
use crate::gonio::sight::Cones;
use crate::measurement::{Dimension, Measurement};

/// The models: the second where residuals of the first are more than noise. A lobe that nothing calls for would fit the noise of single readings, and bend
/// as no material does.
const MODELS: [&str; 2] = ["lambert+phong", "lambert+phong+phong"];
/// Share of the residuals' variance that may be structure.
const STRUCTURED: f64 = 0.05;
/// Share by which source and aperture may lower a lobe's peak before its slopes are not those of a lobe any more.
const SMEARED: f64 = 0.05;
/// How much larger the residual of a fit that conserves energy may be.
const AS_GOOD: f64 = 1.5;
/// Share of a lobe's width from which on it counts that errors of positions move it.
const STANDS_OFF: f64 = 0.2;

/// A fitted model, and the cones through which it was fitted, where they count.
pub(super) struct Surrogate {
    material: Material,
    cones: Option<Cones>,
}

impl Surrogate {
    /// Fits one to reduced readings, with the lean that they show where that counts. `None` where no fit has an answer.
    pub fn of(readings: &Measurement, instrument: &Instrument) -> Option<Self> {
        let upright = Self::fitted(readings, instrument)?;
        if readings.dimension == Dimension::Flat || lean::sigma(instrument) == 0.0 {
            return Some(upright);
        }
        let fitted = |turned: &Measurement| Self::fitted(turned, instrument);
        lean::found(readings, instrument, upright, fitted, |model| may_stand_off(&model.material, instrument))
    }

    /// A plain fit, unless source, aperture and spot smear a lobe that stands out.
    fn fitted(readings: &Measurement, instrument: &Instrument) -> Option<Self> {
        let plain = simplest(readings, None)?;
        let cones = || Cones::of(instrument).filter(|_| readings.dimension == Dimension::Space);
        if let Some(cones) = cones().filter(|_| is_smeared(&plain, instrument)) {
            let cones = Arc::new(cones.rough());
            let sight: Arc<dyn Sight> = cones.clone();
            let fitted = simplest(readings, Some(&sight));
            drop(sight);
            if let Some(material) = fitted {
                return Some(Self { material, cones: Arc::into_inner(cones) });
            }
        }
        Some(Self { material: plain, cones: None })
    }

    /// Writes what is read at (wi, wo), all channels, 1/sr.
    pub fn write_value(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) {
        match &self.cones {
            Some(cones) => cones.write_value(&self.material, wi, wo, out),
            None => self.material.write_value(wi, wo, out),
        }
    }
}

/// The simplest of the models that leaves noise alone, else the last.
fn simplest(readings: &Measurement, through: Option<&Arc<dyn Sight>>) -> Option<Material> {
    let is_noise = |of: &Material| {
        let residual = of.fit.as_ref().and_then(|f| f.residual.as_ref());
        residual.is_some_and(|r| r.structured_share <= STRUCTURED)
    };
    let fitted = |model: &str| {
        let profiles = through.is_none();
        let options = FitOptions { through: through.cloned(), profiles, ..FitOptions::new(model.parse().ok()?) };
        within_reason(readings, &options)
    };
    let [first, second] = MODELS;
    fitted(first).filter(is_noise).or_else(|| fitted(second))
}

/// A fit. One that reflects more light than arrives, as a peak does of which saturated readings left the foot alone, is held to what arrives if that
/// describes the readings nearly as well: in the others, their unit may be another.
fn within_reason(readings: &Measurement, options: &FitOptions) -> Option<Material> {
    let free = fit(readings, options).ok()?.material;
    let facts = |of: &Material| of.fit.as_ref().and_then(|f| Some((f.rmse, f.energy.as_ref()?.largest)));
    let Some((rmse, _)) = facts(&free).filter(|(_, largest)| *largest > 1.0) else { return Some(free) };
    let held = fit(readings, &FitOptions { conserve_energy: true, ..options.clone() }).ok();
    let held = held.map(|f| f.material).filter(|m| facts(m).is_some_and(|(held, _)| held <= AS_GOOD * rmse));
    Some(held.unwrap_or(free))
}

/// Sum of the squares of both cones' half angles and of what the spot smears.
fn spread(instrument: &Instrument) -> f64 {
    let nearness = instrument.source.nearness() + instrument.detector.nearness();
    let spot = 0.5 * instrument.source.beam_diameter_m * nearness;
    instrument.source.half_angle().powi(2) + instrument.detector.half_angle().powi(2) + spot.powi(2)
}

/// Whether the cones change a lobe whose peak stands out of the diffuse part. Of a lobe of exponent n a disc of half angle a takes n a²/4 of the peak.
fn is_smeared(material: &Material, instrument: &Instrument) -> bool {
    has_lobe(material, |n| 0.25 * n * spread(instrument) > SMEARED)
}

/// Whether errors of positions move a lobe by a good part of its width as it is seen, (1/n + a²/4)^½ for half angles a.
fn may_stand_off(material: &Material, instrument: &Instrument) -> bool {
    let moved = 2.0 * lean::sigma(instrument);
    has_lobe(material, |n| moved > STANDS_OFF * (n.recip() + 0.25 * spread(instrument)).sqrt())
}

/// Whether there is a lobe whose peak stands out of the diffuse part, with such an exponent.
fn has_lobe(material: &Material, is: impl Fn(f64) -> bool) -> bool {
    let diffuse = |c: usize| {
        let of = material.lobes.iter().filter(|l| l.kind == LobeKind::Lambert);
        of.map(|l| l.weight[c] / std::f64::consts::PI).sum::<f64>()
    };
    let stands_out = |term: &LobeTerm, c: usize| {
        let exponent = term.shape_of(c).and_then(|shape| shape.first().copied());
        exponent.is_some_and(|n| is(n) && term.weight[c] * (n + 2.0) / std::f64::consts::TAU > diffuse(c))
    };
    let channels = 0..material.channels.len();
    material.lobes.iter().any(|term| channels.clone().any(|c| stands_out(term, c)))
}
