//! What a table lacks, or has too much of, where a fit looks: masked values, values without σ, channels without a positive one, copies.

use super::copies;
use super::merl_lines::MerlLines;
use super::options::FitOptions;
use super::samples::least_cos;
use crate::measurement::{Directions, Measurement, MerlGrid};
use crate::numeric::sum::map_blocks;

/// What is to be told of values that are missing. `valid` is how many there are within the angular limit, where a fit to all of a grid has
/// counted them.
pub(super) fn warnings(measurement: &Measurement, options: &FitOptions, valid: Option<usize>) -> Vec<String> {
    let (missing, all) = if measurement.masked.total() > 0 { count(measurement, options, valid) } else { (0, 0) };
    let left_out = format!("{missing} of {all} values are missing (NaN or masked in the file) and were left out");
    let dark = (0..measurement.channels.len()).filter(|c| is_dark(measurement.plane(*c)));
    let dark = dark.map(|c| format!("channel {} has no positive value", measurement.channels[c]));
    let least_cos = least_cos(options);
    let counts = |entry: usize| is_inside(measurement, options, least_cos, entry);
    let copies = copies::warning(measurement, counts);
    (missing > 0).then_some(left_out).into_iter().chain(exact(measurement, options)).chain(dark).chain(copies).collect()
}

/// Says how many valid values weights by σ leave out for want of one.
fn exact(measurement: &Measurement, options: &FitOptions) -> Option<String> {
    let sigma = measurement.sigma.as_ref().filter(|_| options.use_sigma)?;
    let least_cos = least_cos(options);
    let (entries, channels) = (measurement.len(), measurement.channels.len());
    let of_entry = |(without, all): (usize, usize), entry: usize| {
        let valid = (0..channels).map(|c| c * entries + entry).filter(|&i| !measurement.values[i].is_nan());
        let (gone, valid): (usize, usize) =
            valid.fold((0, 0), |(g, v), i| (g + usize::from(sigma[i] == 0.0 || sigma[i].is_nan()), v + 1));
        (without + gone, all + valid)
    };
    let blocks = map_blocks(entries, |block| {
        block.filter(|entry| is_inside(measurement, options, least_cos, *entry)).fold((0, 0), of_entry)
    });
    let (without, all) = blocks.iter().fold((0, 0), |sum, block| (sum.0 + block.0, sum.1 + block.1));
    (without > 0).then(|| {
        format!(
            "{without} of {all} values were left out, for their stated sigma is 0: weights by sigma need a positive one"
        )
    })
}

/// Whether an entry is one of the stride's and within the angular limit.
fn is_inside(measurement: &Measurement, options: &FitOptions, least_cos: f64, entry: usize) -> bool {
    let is_within = || {
        let (wi, wo) = measurement.directions.pair(entry);
        wi.z.min(wo.z) >= least_cos.max(f64::MIN_POSITIVE)
    };
    options.takes(entry) && is_within() // a table's directions take time
}

/// Whether there are values and none of them is positive.
fn is_dark(plane: &[f64]) -> bool {
    !plane.iter().any(|v| *v > 0.0) && plane.iter().any(|v| !v.is_nan())
}

/// Values missing, and values in all, of the entries within the angular limit that the stride takes.
fn count(measurement: &Measurement, options: &FitOptions, valid: Option<usize>) -> (usize, usize) {
    let least_cos = least_cos(options);
    let blocks = match measurement.directions {
        Directions::Merl(grid) if options.stride == 1 => of_grid(measurement, grid, least_cos, valid),
        _ => of_list(measurement, options, least_cos),
    };
    blocks.iter().fold((0, 0), |sum, block| (sum.0 + block.0, sum.1 + block.1))
}

fn of_grid(measurement: &Measurement, grid: MerlGrid, least_cos: f64, valid: Option<usize>) -> Vec<(usize, usize)> {
    let lines = MerlLines::new(grid, least_cos, false);
    let channels = measurement.channels.len();
    if let Some(valid) = valid {
        let entries = (0..MerlLines::blocks()).flat_map(|b| lines.lines(b)).map(|line| line.entries().len());
        let all = entries.sum::<usize>() * channels;
        return vec![(all.saturating_sub(valid), all)];
    }
    let of_entries = |(missing, all), entries: std::ops::Range<usize>| {
        let gone = |c: usize| measurement.plane(c)[entries.clone()].iter().filter(|v| v.is_nan()).count();
        (missing + (0..channels).map(gone).sum::<usize>(), all + entries.len() * channels)
    };
    let of_blocks = |blocks: std::ops::Range<usize>| {
        blocks.flat_map(|b| lines.lines(b)).map(|line| line.entries()).fold((0, 0), of_entries)
    };
    map_blocks(MerlLines::blocks(), of_blocks)
}

fn of_list(measurement: &Measurement, options: &FitOptions, least_cos: f64) -> Vec<(usize, usize)> {
    let channels = measurement.channels.len();
    map_blocks(measurement.len(), |block| {
        let entries = block.filter(|entry| is_inside(measurement, options, least_cos, *entry));
        entries.fold((0, 0), |(missing, all), entry| {
            let gone = (0..channels).filter(|c| measurement.plane(*c)[entry].is_nan()).count();
            (missing + gone, all + channels)
        })
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::measurement::Masked;

    fn options(stride: usize) -> FitOptions {
        let model = "lambert".parse().expect("a model");
        FitOptions { stride, ..FitOptions::new(model) }
    }

    #[test]
    fn values_missing_of_a_list_are_counted_within_limit_and_stride() {
        let tilted = |deg: f64| DVec3::new(deg.to_radians().sin(), 0.0, deg.to_radians().cos());
        let wo = [0.0, 40.0, 80.0, 85.0].map(tilted).to_vec();
        let list = Directions::List { wi: vec![DVec3::Z; 4], wo };
        let nan = f64::NAN;
        let values = vec![nan, 0.1, nan, nan, 0.0, nan, -0.1, 0.0];
        let mut table = Measurement::new("t", list, vec!["r".into(), "g".into()], values);
        table.masked = Masked { marked: 4, ..Masked::default() };
        assert_eq!(count(&table, &options(1), None), (3, 6));
        assert_eq!(count(&table, &options(2), None), (2, 4));
        let said = warnings(&table, &options(1), None);
        assert!(said.len() == 2 && said[0].starts_with("3 of 6 values are missing"), "{said:?}");
        assert_eq!(said[1], "channel g has no positive value");
    }

    #[test]
    fn a_grid_and_its_list_agree() {
        let grid = MerlGrid::default();
        let values: Vec<f64> = (0..MerlGrid::LEN).map(|i| if i % 7 == 3 { f64::NAN } else { 1.0 }).collect();
        let table = Measurement::new("t", Directions::Merl(grid), vec!["r".into()], values);
        let least_cos = least_cos(&FitOptions { max_angle_deg: 70.0, ..options(1) });
        let sum = |blocks: Vec<(usize, usize)>| blocks.iter().fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let want = sum(of_list(&table, &options(1), least_cos));
        assert_eq!(sum(of_grid(&table, grid, least_cos, None)), want);
        assert_eq!(sum(of_grid(&table, grid, least_cos, Some(want.1 - want.0))), want);
    }
}
