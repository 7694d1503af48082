//! Whether a fit is of the measurement that it is shown beside, and fits are of one, as far as their records tell.

use super::RunFit;
use crate::brdf::{FitRecord, PerChannel};
use crate::fit::{FitOptions, Loss, WeightMode, judged};
use crate::geometry::theta_of;
use crate::measurement::Measurement;
use crate::report::words::number;

/// By which share an rmse over the same samples may be off the record's, what files round; of a robust fit, whose last scale may not be the record's, more.
const SAME: f64 = 1e-3;
const SAME_ROBUST: f64 = 0.05;
/// What sums of squares of the largest value leave of an rmse, as a share of that value.
const ROUNDING: f64 = 1e-7;
/// A part of the samples, whichever it is, is taken to have an rmse within this factor of that over all of them.
const PART: f64 = 3.0;
/// Where all fits end, degrees.
const HORIZON: f64 = 90.0;

/// Directions that a fit was made of, or that it had to choose its samples from.
fn directions(record: &FitRecord) -> u64 {
    record.subset.as_ref().map_or(record.samples, |subset| subset.of)
}

/// The warning that fits are not all of one measurement: two whose channels or directions differ; nothing where all may be.
pub(super) fn unlike(fits: &[RunFit]) -> Option<String> {
    let of = |fit: &RunFit| {
        let record = fit.material().fit.as_ref()?;
        Some((directions(record), fit.material().channels.join(", ")))
    };
    let mut all = fits.iter().filter_map(|fit| Some((fit, of(fit)?)));
    let (first, own) = all.next()?;
    let (other, its) = all.find(|(_, of)| *of != own)?;
    let [own, its] = [own, its].map(|(directions, channels)| format!("{directions} directions ({channels})"));
    Some(format!(
        "The fits are of different measurements, or took different samples: {} is of {own}, {} of {its}. Their rmse do not compare, and none is called the best.",
        first.label, other.label
    ))
}

/// Why a fit can't be of this measurement: what its record has, and what is found; nothing where it may be of it.
pub(super) fn mismatch(measurement: &Measurement, fit: &RunFit) -> Option<String> {
    let record = fit.material().fit.as_ref()?;
    let [own, here] = [&fit.material().channels, &measurement.channels].map(|names| names.join(", "));
    if own != here {
        return Some(format!("expected its channels, {own}, found {here}"));
    }
    let options = options(fit, record)?;
    let judge = |max_angle_deg: f64| {
        let options = FitOptions { max_angle_deg, ..options.clone() };
        judged(measurement, fit.material(), &options, &record.robust_scale).ok()
    };
    let of = directions(record);
    // Where a fit that is asked for nothing else ends.
    let (rmse, found) = judge(options.max_angle_deg)?;
    // Without its instrument it predicts other values than those that its rmse is of.
    let is_seen = record.through.is_none() || fit.through.is_some();
    let is_whole = found as u64 == of && record.subset.is_none();
    let rounding = ROUNDING * largest(measurement).max(1.0);
    let (low, high) = if is_whole {
        let share = if record.robust.is_some() { SAME_ROBUST } else { SAME };
        (rmse / (1.0 + share), rmse * (1.0 + share))
    } else {
        let (_, most) = judge(HORIZON)?;
        if of > most as u64 {
            return Some(format!("expected the {of} directions that it was made of, found {most} with a value"));
        }
        // Towards grazing values and errors may grow by any factor; a limit to the angles leaves as many as these.
        let (within, _) = judge(angle_of(measurement, of))?;
        (rmse.min(within) / PART, rmse.max(within) * PART)
    };
    let is_other = is_seen && !(low - rounding..=high + rounding).contains(&record.rmse);
    is_other
        .then(|| format!("expected its rmse, {}, found {} over {found} directions", number(record.rmse), number(rmse)))
}

/// What a fit was asked for, as far as its record says: not which part of the samples it took.
fn options(fit: &RunFit, record: &FitRecord) -> Option<FitOptions> {
    let has_own = |shape: &Vec<PerChannel<f64>>| shape.iter().any(|s| matches!(s, PerChannel::Each(_)));
    let is_apart = fit.material().lobes.iter().any(|lobe| lobe.shape.as_ref().is_some_and(has_own));
    let robust = record.robust.as_ref().map(|text| text.parse()).transpose().ok()?;
    Some(FitOptions {
        loss: Loss::from_name(&record.loss)?,
        weights: if record.weights == "uniform" { WeightMode::Uniform } else { WeightMode::SolidAngle },
        use_sigma: record.weights == "sigma",
        robust,
        per_channel: is_apart || record.robust_scale.len() > 1,
        through: fit.predicted.sight(),
        ..FitOptions::new(fit.material().model().parse().ok()?)
    })
}

/// The largest value, without its sign.
fn largest(measurement: &Measurement) -> f64 {
    measurement.values.iter().filter(|v| !v.is_nan()).fold(0.0, |most, v| v.abs().max(most))
}

/// The limit to both angles that leaves so many directions with a value, degrees.
fn angle_of(measurement: &Measurement, directions: u64) -> f64 {
    let has_value = |i: &usize| (0..measurement.channels.len()).any(|c| measurement.value(c, *i).is_some());
    let larger = |i: usize| {
        let (wi, wo) = measurement.directions.pair(i);
        theta_of(wi).max(theta_of(wo)).to_degrees()
    };
    let mut angles: Vec<f64> = (0..measurement.len()).filter(has_value).map(larger).collect();
    let Some(last) = angles.len().checked_sub(1) else { return HORIZON };
    let place = usize::try_from(directions.saturating_sub(1)).unwrap_or(last).min(last);
    angles.select_nth_unstable_by(place, f64::total_cmp).1.min(HORIZON)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{LobeKind, Material, SubsetRecord};
    use crate::report::views::Predicted;

    fn fit(label: &str, channel: &str, samples: u64, of: Option<u64>) -> RunFit {
        let mut material = Material::new(vec![channel.into()], vec![(LobeKind::Lambert, vec![0.5], vec![])]);
        let subset = of.map(|of| SubsetRecord { samples, of, rmse_excess: 0.0, rmse_excess_95: 0.0 });
        material.fit = Some(FitRecord { samples, subset, ..FitRecord::default() });
        RunFit {
            label: label.into(),
            file: format!("{label}.json"),
            predicted: Predicted::new(&material, None),
            through: None,
            image: None,
            is_of_other: false,
        }
    }

    #[test]
    fn fits_are_of_one_measurement_where_channels_and_directions_are_the_same() {
        assert_eq!(unlike(&[]), None);
        assert_eq!(unlike(&[fit("a", "r", 100, None), fit("b", "r", 10, Some(100))]), None, "a part of the same");
        let said = unlike(&[fit("a", "r", 100, None), fit("b", "r", 100, None), fit("c", "r", 90, None)]);
        assert!(said.is_some_and(|said| said.contains("a is of 100 directions (r), c of 90 directions (r)")));
        assert!(unlike(&[fit("a", "r", 100, None), fit("b", "450nm", 100, None)]).is_some());
    }
}
