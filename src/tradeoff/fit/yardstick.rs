//! What fits are measured with: the fit to all samples of every model, the rmse over all samples, and a picture.

use crate::brdf::{Material, ModelSpec};
use crate::chain::{ChainError, Source, Stage, render_material, scene};
use crate::control::Control;
use crate::fit::{FitOptions, fit, rmse_of};
use crate::measurement::{Dimension, Measurement};
use crate::render::{self, Film, Options};

use super::laws::Residuals;
use super::parameter_error;

/// A ball under a point light: its pictures have no noise but that of the pixels' edges, which all share.
const SCENE: &str = "sphere";
const SIDE: u32 = 96;
const SAMPLES: u32 = 8;

/// The references.
pub(super) struct Yardstick<'a> {
    measurement: &'a Measurement,
    options: FitOptions,
    /// Of each model the fit to all samples.
    whole: Vec<Whole>,
    /// The least rmse among them.
    best: f64,
    /// Under a robust loss the s that all fits are judged by, for each has one of its own: that of the whole fit with the least one.
    scales: Vec<f64>,
}

struct Whole {
    material: Material,
    /// By the yardstick's own way, once there is one.
    rmse: f64,
    picture: Option<Film>,
    model: String,
}

impl<'a> Yardstick<'a> {
    /// Fits every model to all samples.
    pub fn new(measurement: &'a Measurement, options: &FitOptions, models: &[ModelSpec]) -> Result<Self, ChainError> {
        let plain = FitOptions {
            stride: 1,
            part: 1,
            draw: 0,
            target_rmse_excess: None,
            time_budget: None,
            bootstrap: None,
            ..options.clone()
        };
        let whole = |model: &ModelSpec| {
            let material = fit(measurement, &FitOptions { model: model.clone(), ..plain.clone() })?.material;
            Ok::<_, ChainError>(Whole {
                rmse: f64::NAN,
                picture: picture(measurement, &material),
                material,
                model: model.to_string(),
            })
        };
        let whole = models.iter().map(whole).collect::<Result<Vec<_>, _>>()?;
        let scales = least_scales(&whole);
        let mut found = Self { measurement, options: plain, whole, best: f64::NAN, scales };
        for k in 0..found.whole.len() {
            found.whole[k].rmse = found.rmse(&found.whole[k].material)?;
        }
        found.best = found.whole.iter().map(|w| w.rmse).fold(f64::INFINITY, f64::min);
        Ok(found)
    }

    /// Whether a model's fit to all samples is the best one.
    pub fn is_best(&self, model: usize) -> bool {
        self.whole[model].rmse <= self.best
    }

    /// What is known of the residuals of a model's fit to all samples.
    pub fn residuals(&self, model: usize) -> Residuals {
        Residuals::of(self.whole[model].material.fit.as_ref())
    }

    /// The errors of a fit of a model.
    pub fn errors(&self, fitted: &Material, model: usize) -> Result<Vec<f64>, ChainError> {
        let whole = &self.whole[model];
        // The fit to all samples is its own reference: what rounding leaves is no error.
        let excess = (self.rmse(fitted)? / self.best - 1.0).max(0.0);
        let best = self.whole.iter().find(|w| w.rmse <= self.best).and_then(|w| w.picture.as_ref());
        let off = picture(self.measurement, fitted).zip(best).map(|(own, all)| own.off_by(all));
        let parameters = parameter_error(fitted, &whole.material);
        let is_rounding = excess < 1e-12 && parameters < 1e-6;
        let errors = vec![excess, parameters, off.unwrap_or(f64::NAN)];
        Ok(if is_rounding { errors.into_iter().map(|e| 0.0 * e).collect() } else { errors })
    }

    /// The rmse over all samples of a material as it stands.
    fn rmse(&self, material: &Material) -> Result<f64, ChainError> {
        Ok(rmse_of(self.measurement, material, &self.options, &self.scales)?)
    }

    /// What the references are.
    pub fn said(&self) -> Vec<String> {
        let of = |w: &Whole| {
            let record = w.material.fit.as_ref();
            let samples = record.map_or(0, |r| r.samples);
            let search = record.and_then(|r| r.search.as_ref());
            let sure = search
                .map_or(String::new(), |s| format!(", the lowest minimum from {} of {} starts", s.reached, s.starts));
            format!("{} fitted to all {samples} samples: rmse {:.4e}{sure}", w.model, w.rmse)
        };
        let judged = self.options.robust.map(|robust| {
            let s: Vec<String> = self.scales.iter().map(|s| format!("{s:.4e}")).collect();
            format!("all fits are judged by {robust} with the s of one of these, {}", s.join(", "))
        });
        self.whole.iter().map(of).chain(judged).collect()
    }
}

/// The least s of these fits, one for each group of channels; none without a robust loss.
fn least_scales(whole: &[Whole]) -> Vec<f64> {
    let scales = whole.iter().filter_map(|w| Some(&w.material.fit.as_ref()?.robust_scale));
    let least = scales.min_by(|a, b| a.iter().sum::<f64>().total_cmp(&b.iter().sum()));
    least.cloned().unwrap_or_default()
}

/// The ball of this material; none in the flat world, or where channels are not to be shown.
fn picture(measurement: &Measurement, material: &Material) -> Option<Film> {
    if measurement.dimension == Dimension::Flat {
        return None;
    }
    let subject = render_material(&measurement.name, &Source::Fitted(Box::new(material.clone())), None).ok()?;
    let scene = scene(&Stage::built_in(SCENE).ok()?, Some(subject)).ok()?;
    let options = Options { width: SIDE, height: SIDE, samples: SAMPLES, ..Options::default() };
    render::render(&scene, &options, Control::silent()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::{BuiltInMaterial, measure};
    use crate::gonio::{Instrument, Scan};

    #[test]
    fn a_fit_to_all_is_its_own_reference_and_another_s_rmse_is_that_of_its_values() {
        let truth = BuiltInMaterial::find("glossy-paint").expect("built in").material();
        let source = Source::Fitted(Box::new(truth.clone()));
        let scan = Scan::Hemisphere { step_deg: 15.0 };
        let table = measure("t", &source, &Instrument::default(), &scan, 3, Control::silent()).expect("measures");
        let models = ["lambert+phong", "lambert"].map(|m| m.parse::<ModelSpec>().expect("a model"));
        let yardstick = Yardstick::new(&table, &FitOptions::new(models[0].clone()), &models).expect("fits");
        assert!(yardstick.is_best(0) && !yardstick.is_best(1));
        let own = yardstick.whole[0].material.clone();
        assert_eq!(yardstick.errors(&own, 0).expect("errors"), [0.0; 3]);
        let other = yardstick.errors(&yardstick.whole[1].material.clone(), 1).expect("errors");
        let want = yardstick.whole[1].rmse / yardstick.whole[0].rmse - 1.0;
        assert!((other[0] / want - 1.0).abs() < 1e-9 && other[1] == 0.0, "{other:?} of {want}");
        // The truth is nearly as good as the best.
        let errors = yardstick.errors(&truth, 0).expect("errors");
        assert!(errors[0] > 0.0 && errors[0] < 0.1, "{errors:?}");
        assert!(errors[1] > 0.0 && errors[1] < 0.01 && errors[2] > 0.0 && errors[2] < 0.01, "{errors:?}");
    }
}
