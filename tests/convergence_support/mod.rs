//! How fast a picture of a measured table converges beside one of its fit: the same scene, the same samples.
#![allow(dead_code, clippy::expect_used)] // each file uses a part

use std::path::Path;
use std::sync::Arc;

use goniofit::control::Control;
use goniofit::fit::{FitOptions, fit};
use goniofit::image::{Image, compare};
use goniofit::measurement::{Measurement, TableBrdf};
use goniofit::render::scene::builtin;
use goniofit::render::{Material, Materials, Options, Plan, Scene, render};

/// A table and its fit, ready to be rendered.
pub struct Pair {
    pub table: Material,
    pub fit: Material,
    /// Exponent of the fit.
    pub exponent: f64,
}

/// The table as it is and as `lambert+phong`.
pub fn pair(table: &Measurement) -> Pair {
    let fitted = fit(table, &FitOptions::new("lambert+phong".parse().expect("a model"))).expect("a fit").material;
    let brdf = |b: Arc<dyn goniofit::brdf::Brdf>| Material::Brdf(b);
    Pair {
        exponent: fitted.lobes[1].shape_of(0).map_or(f64::NAN, |shape| shape[0]),
        table: brdf(Arc::new(TableBrdf::new(table, &[0, 1, 2]).expect("renders"))),
        fit: brdf(Arc::new(fitted.reflectance(&[0, 1, 2]).expect("of space"))),
    }
}

/// Noise of a picture per sample, relative as relMSE is: of the samples as if they were independent, and what two pictures of
/// different seeds differ by. And the time that a picture takes, s: of the quicker one of the two.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    pub of_samples: f64,
    pub of_pictures: f64,
    pub seconds: f64,
}

impl Noise {
    /// What the time to a given relMSE is in proportion to, where that falls with the number of samples.
    pub fn in_time(&self) -> f64 {
        self.of_pictures * self.seconds
    }
}

/// The noise of a built-in scene with this subject, by the plan of the scene.
pub fn noise(scene: &str, subject: &Material, size: u32, samples: u32) -> Noise {
    noise_by(scene, subject, size, samples, true)
}

/// The same, packets left out unless `packets` says that they may be.
pub fn noise_by(scene: &str, subject: &Material, size: u32, samples: u32, packets: bool) -> Noise {
    let spec = builtin(scene).expect("built in");
    let name = spec.subject.clone().expect("a subject");
    let built = Scene::build(&spec, Path::new("."), &Materials::from([(name, subject.clone())])).expect("builds");
    let plan = Plan::of(&built);
    let plan = Some(Plan { packets: plan.packets && packets, ..plan });
    let shot = |seed| {
        let options = Options { width: size, height: size, samples, seed, plan, ..Options::default() };
        render(&built, &options, Control::silent()).expect("renders").to_image()
    };
    let (a, b) = (shot(1), shot(2));
    let between = compare(&a, &b).expect("of one size").rel_mse;
    let seconds = [&a, &b].map(|image| image.metadata.seconds.expect("rendered"));
    Noise {
        seconds: seconds[0].min(seconds[1]),
        of_samples: 0.5 * (relative_variance(&a) + relative_variance(&b)) * f64::from(samples),
        of_pictures: 0.5 * between * f64::from(samples),
    }
}

/// Mean of σ²/(L² + 0.01) over pixels × channels that are not masked.
fn relative_variance(image: &Image) -> f64 {
    let errors = image.standard_error.as_ref().expect("noise is known");
    let shown = (0..image.radiance.len()).filter(|i| !image.is_masked(*i));
    let terms = shown.flat_map(|i| (0..3).map(move |c| (i, c)));
    let (sum, count) = terms.fold((0.0, 0.0), |(sum, count), (i, c)| {
        (sum + errors[i][c].powi(2) / (image.radiance[i][c].powi(2) + 0.01), count + 1.0)
    });
    sum / count
}
