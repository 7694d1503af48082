//! How finely a material is to be measured: tables of it as the ideal instrument reads them, rendered in its place.
//!
//! A table ends below the horizon, and what it does not hold is black. So that its error is that of interpolation it is judged
//! by the material as far as the table is known; what the rest is worth stands beside it.

use std::sync::Arc;

use glam::DVec3;

use crate::brdf::{Brdf, Sample};
use crate::chain::{ChainError, Source, Stage, measure, render_material};
use crate::control::Control;
use crate::gonio::{self, Instrument, MOST_ENTRIES, Scan, hemisphere_pairs, lit_rows};
use crate::measurement::Measurement;
use crate::render::Material;
use crate::tradeoff::design::{Law, Theory};
use crate::tradeoff::simulate::laws::resolves;

/// Tables of one material, from scans of several steps.
#[derive(Debug, Clone, Default)]
pub struct Tables {
    pub(super) all: Vec<Table>,
    /// What theory says of the bias against the step.
    pub(super) law: Option<Law>,
}

/// A table.
#[derive(Debug, Clone)]
pub(super) struct Table {
    /// Step of the scan, degrees.
    pub step_deg: f64,
    /// Time of the ideal instrument, s.
    pub instrument_s: f64,
    /// The table as it is rendered.
    pub material: Material,
    /// The material itself, as far as the table is known.
    pub truth: Material,
}

/// A Gaussian lobe exp(−n x²/2) whose values in steps of h are joined by straight lines has, on average over where those stand,
/// the squared error Σ_{k≥2} (−a)ᵏ/k!·(1/3 − 4/((2k + 1)(2k + 2))) times its square, a = n h²/4, both integrated. Its root goes as h²
/// where a is small, and as h to the power 1.74 at n h² = 2.6, from which on a step is no finer than a lobe.
const SMOOTH: Law = Law {
    theory: Theory::Between(2.0, 1.7),
    why: "straight lines between values are off by the square of the step, by a lower power where a lobe is hardly wider than it",
};
const NARROW: Law = Law {
    theory: Theory::Unknown,
    why: "a lobe is narrower than the coarsest step: how much of it is met depends on where directions stand",
};
const MEASURED: Law =
    Law { theory: Theory::Unknown, why: "of a measured material it is not known how narrow its lobes are" };

impl Tables {
    /// Reads what goes by this name, whose channels `rgb` are rendered as `truth`, in each of the steps (degrees). Once the
    /// work is stopped the rest is left out.
    ///
    /// # Errors
    /// [`ChainError`] where tables have too many directions, or too few to be rendered, or the material can't be measured so.
    pub fn read(
        (name, source): (&str, &Source),
        truth: &Material,
        rgb: Option<&[String; 3]>,
        steps_deg: &[f64],
        control: Control<'_>,
    ) -> Result<Self, ChainError> {
        within_room(steps_deg)?;
        let mut all = Vec::new();
        for &step_deg in steps_deg {
            let read = scanned(name, source, step_deg, control)?;
            if control.stop.requested() {
                break; // half a table says nothing
            }
            all.push(Table::new(read, step_deg, truth, rgb)?);
        }
        Ok(Self { all, law: Some(law(source, steps_deg)) })
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Refuses a scene that turns the exponent of its subject, which a table has not.
    pub(super) fn check(&self, stage: &Stage) -> Result<(), ChainError> {
        let spec = &stage.spec;
        let turned = spec.materials.values().filter_map(|material| material.variant.as_ref());
        let turned = turned.filter(|variant| variant.exponent.is_some() && spec.subject.as_ref() == Some(&variant.of));
        if self.is_empty() || turned.count() == 0 {
            return Ok(());
        }
        Err(ChainError::Mismatch(format!(
            "scene {} shows its subject with other exponents, which a table has not: choose another scene for tables",
            spec.name
        )))
    }
}

impl Table {
    fn new(
        mut read: Measurement,
        step_deg: f64,
        truth: &Material,
        rgb: Option<&[String; 3]>,
    ) -> Result<Self, ChainError> {
        let instrument_s = gonio::seconds(&Instrument::noiseless(), &read.directions, &lit_rows(&read.directions, &[]));
        read.name = format!("{} along {}", read.name, Scan::Hemisphere { step_deg });
        let (name, table) = (read.name.clone(), Source::Measured(Box::new(read)));
        let material = render_material(&name, &table, rgb)?;
        let truth = within(truth, &material);
        Ok(Self { step_deg, instrument_s, material, truth })
    }
}

/// What `simulate --instrument ideal --scan hemisphere:STEP` writes of a material.
///
/// # Errors
/// [`ChainError`] where it belongs to the flat world, can't be interpolated, or the scan has too many directions.
pub fn scanned(name: &str, source: &Source, step_deg: f64, control: Control<'_>) -> Result<Measurement, ChainError> {
    measure(name, source, &Instrument::noiseless(), &Scan::Hemisphere { step_deg }, 0, control)
}

/// Refuses tables that together have more directions than one scan may have.
fn within_room(steps_deg: &[f64]) -> Result<(), ChainError> {
    let found: f64 = steps_deg.iter().map(|step| hemisphere_pairs(*step)).sum();
    if found <= MOST_ENTRIES {
        return Ok(());
    }
    let steps = steps_deg.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    Err(ChainError::TooManyDirections { steps, found: found / 1e6, most: MOST_ENTRIES / 1e6 })
}

/// What theory says of tables with these steps.
fn law(source: &Source, steps_deg: &[f64]) -> Law {
    let coarsest = steps_deg.iter().copied().fold(0.0, f64::max);
    match source {
        Source::Measured(_) => MEASURED,
        Source::Fitted(truth) if resolves(truth, coarsest) => SMOOTH,
        Source::Fitted(_) => NARROW,
    }
}

/// A material as far as a table of it is known.
fn within(truth: &Material, table: &Material) -> Material {
    match (truth, table) {
        (Material::Brdf(truth), Material::Brdf(table)) => {
            Material::Brdf(Arc::new(Within { truth: Arc::clone(truth), table: Arc::clone(table) }))
        }
        // Neither is anything else: both were made to be rendered as measurements or fits.
        _ => truth.clone(),
    }
}

/// A BRDF where another is known too, nowhere else; both have one channel, or three.
struct Within {
    truth: Arc<dyn Brdf>,
    table: Arc<dyn Brdf>,
}

impl Brdf for Within {
    fn channels(&self) -> usize {
        self.truth.channels()
    }

    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let known = self.table.eval(wi, wo, out) && self.truth.eval(wi, wo, out);
        if !known {
            out.fill(0.0);
        }
        known
    }

    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        self.truth.sample(wo, u)
    }

    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        self.truth.pdf(wi, wo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::BuiltInMaterial;
    use crate::geometry::angles::direction_deg;
    use crate::gonio::Preset;

    fn source(name: &str) -> Source {
        Source::Fitted(Box::new(BuiltInMaterial::find(name).expect("built in").material()))
    }

    fn tables(steps_deg: &[f64]) -> Result<Tables, ChainError> {
        let satin = source("satin");
        let truth = render_material("satin", &satin, None)?;
        Tables::read(("satin", &satin), &truth, None, steps_deg, Control::silent())
    }

    #[test]
    fn steps_that_no_table_can_have_are_refused_with_the_reason() {
        for (steps, says) in [
            (
                &[0.5][..],
                "steps of 0.5 degrees: expected at most 16 million pairs of directions in all, found 23.2 million",
            ),
            (&[10.0, 0.7, 0.6], "steps of 10, 0.7, 0.6 degrees"), // 2601, 8.5 and 13.4 million
            (&[45.0], "satin along hemisphere:45"),
        ] {
            let said = tables(steps).expect_err("refused").to_string();
            assert!(said.contains(says), "{steps:?}: {said}");
        }
    }

    #[test]
    fn theory_knows_the_slope_where_lobes_are_wider_than_the_step() {
        let of = |source: &Source, steps: &[f64]| law(source, steps).theory;
        // n = 12 and 90: n h² of 15° is 0.8 and 6.2, of 7.5° a quarter.
        assert_eq!(of(&source("satin"), &[15.0, 10.0, 5.0]), Theory::Between(2.0, 1.7));
        assert_eq!(of(&source("glossy-paint"), &[15.0, 7.5]), Theory::Unknown);
        assert_eq!(of(&source("glossy-paint"), &[7.5]), Theory::Between(2.0, 1.7));
        let table = scanned("satin", &source("satin"), 30.0, Control::silent()).expect("reads");
        assert_eq!(of(&Source::Measured(Box::new(table)), &[5.0]), Theory::Unknown);
    }

    /// What a lobe is off by between values in steps of h, by its series, against the powers that theory names.
    #[test]
    fn a_lobe_is_off_by_the_powers_that_theory_names() {
        let square = |nh2: f64| {
            let (a, mut power, mut sum) = (0.25 * nh2, 1.0, 0.0);
            for k in 1..20 {
                let k = f64::from(k);
                power *= -a / k;
                sum += power * (1.0 / 3.0 - 4.0 / ((2.0 * k + 1.0) * (2.0 * k + 2.0)));
            }
            sum
        };
        // The slope of the root against h is that of the square against h².
        let slope = |nh2: f64| (square(1.001 * nh2) / square(nh2)).ln() / 1.001f64.ln();
        for (nh2, want) in [(0.01, 2.0), (2.6, 1.74)] {
            assert!((slope(nh2) - want).abs() < 0.01, "n h² = {nh2}: {}", slope(nh2));
        }
    }

    #[test]
    fn a_table_is_judged_by_the_material_where_it_is_known() {
        let tables = tables(&[15.0]).expect("reads");
        let Material::Brdf(truth) = &tables.all[0].truth else { panic!("a BRDF") };
        let Material::Brdf(own) = render_material("satin", &source("satin"), None).expect("renders") else {
            panic!("a BRDF")
        };
        let value = |brdf: &dyn Brdf, theta_i: f64, theta_o: f64| {
            let mut out = [f64::NAN; 3];
            let known = brdf.eval(direction_deg(theta_i, 180.0), direction_deg(theta_o, 20.0), &mut out);
            known.then_some(out)
        };
        for (i, o) in [(0.0, 0.0), (22.0, 40.0), (60.0, 70.0)] {
            assert_eq!(value(truth.as_ref(), i, o), value(own.as_ref(), i, o), "{i}, {o}");
        }
        // The last ring is at 75°.
        assert!(value(truth.as_ref(), 30.0, 80.0).is_none() && value(own.as_ref(), 30.0, 80.0).is_some());
        // The normal and five rings of 24, from each of six incidences, in a second each.
        assert_eq!(tables.all[0].instrument_s, 6.0 * (1.0 + 5.0 * 24.0));
    }

    #[test]
    fn the_ideal_instrument_is_the_one_without_noise() {
        let ideal = Preset::find("ideal").expect("built in").spec().expect("a spec").instrument;
        assert_eq!(ideal, Instrument::noiseless());
    }
}
