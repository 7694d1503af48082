//! What is minimised over which samples: the options that a fit and a sweep of fits share.

use std::sync::Arc;

use crate::brdf::{ModelSpec, Sight};
use crate::cli::failure::Failure;
use crate::cli::instrument::read_sight;
use crate::cli::text::option;
use crate::fit::{FitOptions, Limit, Loss, Robust, WeightMode};

pub(in crate::cli) const MODEL: &str = "Model and loss";
pub(in crate::cli) const SAMPLES: &str = "Samples and their weights";

/// θi and θo up to which samples count where nothing else is asked for, degrees.
const MAX_ANGLE: f64 = 80.0;

#[derive(Debug, Clone, clap::Args)]
pub(in crate::cli) struct Shared {
    /// Let outliers count less; SCALE (1e-3 to 1e6) times the residuals' σ is where they begin [default SCALE: huber 1.345,
    /// cauchy 2.385]
    #[arg(long, value_name = "huber|cauchy[:SCALE]", help_heading = MODEL)]
    pub robust: Option<Robust>,
    /// Fit the material that this instrument's readings show, averaged over its aperture and its source's divergence as they are, rather
    /// than take the readings for the material's values: a built-in one or a simulation file
    #[arg(long, value_name = "INSTRUMENT", help_heading = MODEL)]
    pub through: Option<String>,
    /// How samples count
    #[arg(long, default_value = "solid-angle", value_parser = parse_weights, value_name = "solid-angle|uniform", help_heading = SAMPLES)]
    pub weights: WeightMode,
    /// Weigh by the errors that the file states, σ and what values share, instead of the solid angle
    #[arg(long, conflicts_with = "weights", help_heading = SAMPLES)]
    pub use_sigma: bool,
    /// Leave out samples with θi or θo above this, degrees
    #[arg(long, default_value_t = MAX_ANGLE, value_name = "DEG", allow_negative_numbers = true, help_heading = SAMPLES)]
    pub max_angle: f64,
    /// Let every channel have its own shapes
    #[arg(long, help_heading = MODEL)]
    pub per_channel: bool,
    /// Hold a parameter at a value, phong.exponent=50 say; a second lobe of a kind is phong[1]; may be repeated for others
    #[arg(long, value_name = "NAME=VALUE", value_parser = Limit::fixed, help_heading = MODEL)]
    pub fix: Vec<Limit>,
    /// Hold a parameter in a range, phong.exponent=1..1e4 or lambert.weight[r]=0..0.5 say; may be repeated for others
    #[arg(long, value_name = "NAME=LOW..HIGH", value_parser = Limit::range, help_heading = MODEL)]
    pub bound: Vec<Limit>,
    /// Fit under the constraint that no channel reflects more light than it receives
    #[arg(long, help_heading = MODEL)]
    pub conserve_energy: bool,
}

fn parse_weights(text: &str) -> Result<WeightMode, String> {
    [WeightMode::SolidAngle, WeightMode::Uniform]
        .into_iter()
        .find(|w| w.name() == text)
        .ok_or_else(|| "known are solid-angle, uniform".into())
}

impl Shared {
    /// The options of a fit of this model by this loss to all samples.
    pub fn options(&self, model: ModelSpec, loss: Loss) -> Result<FitOptions, Failure> {
        let limits: Vec<Limit> = self.fix.iter().chain(&self.bound).cloned().collect();
        if let Some((first, second)) = Limit::doubled(&limits) {
            let [first, second] = [first, second].map(|i| format!("{} {}", self.typed_by(i), limits[i]));
            return Err(Failure::usage(format!(
                "{first} and {second} limit the same parameter; expected one limit a parameter"
            )));
        }
        Ok(FitOptions {
            loss,
            robust: self.robust,
            weights: self.weights,
            use_sigma: self.use_sigma,
            max_angle_deg: self.max_angle,
            per_channel: self.per_channel,
            limits,
            conserve_energy: self.conserve_energy,
            through: self.sight()?,
            ..FitOptions::new(model)
        })
    }

    /// What lobes are seen through.
    fn sight(&self) -> Result<Option<Arc<dyn Sight>>, Failure> {
        self.through.as_deref().map(read_sight).transpose()
    }

    /// The option that limit `i` of all was typed with.
    fn typed_by(&self, i: usize) -> &'static str {
        if i < self.fix.len() { "--fix" } else { "--bound" }
    }

    /// The words that they are typed in, of those that are not as they are without.
    pub fn typed(&self) -> Vec<String> {
        let weights = Some(self.weights.name()).filter(|_| self.weights != WeightMode::default());
        let flag = |name: &str, is_on: bool| is_on.then(|| format!("--{name}"));
        let flags = [("use-sigma", self.use_sigma), ("per-channel", self.per_channel)];
        let mut words = [
            option("robust", self.robust),
            option("through", self.through.as_ref()),
            option("weights", weights),
            option("max-angle", Some(self.max_angle).filter(|angle| *angle != MAX_ANGLE)),
            flags.iter().filter_map(|(name, is_on)| flag(name, *is_on)).collect(),
        ]
        .concat();
        words.extend(self.fix.iter().flat_map(|limit| option("fix", Some(limit))));
        words.extend(self.bound.iter().flat_map(|limit| option("bound", Some(limit))));
        words.extend(flag("conserve-energy", self.conserve_energy));
        words
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;

    #[derive(Debug, clap::Parser)]
    struct Typed {
        #[command(flatten)]
        shared: Shared,
    }

    fn parsed(line: &str) -> Shared {
        let words = std::iter::once("fit").chain(line.split_whitespace());
        Typed::try_parse_from(words).expect("options").shared
    }

    #[test]
    fn options_are_repeated_as_they_are_typed() {
        for line in [
            "",
            "--robust cauchy:3 --through lab.toml --max-angle 70 --use-sigma",
            "--weights uniform --per-channel --fix phong.exponent=50 --fix lambert.weight[r]=0.25",
            "--bound phong.exponent=1..10000 --bound phong[1].exponent=1e8.. --conserve-energy",
        ] {
            let words = parsed(line).typed();
            assert_eq!(words.join(" "), line);
            assert_eq!(parsed(&words.join(" ")).typed(), words);
        }
        // A scale is the same one however it is typed, and what is as without it is not repeated.
        assert_eq!(parsed("--robust huber --weights solid-angle --max-angle 80").typed(), ["--robust", "huber:1.345"]);
    }
}
