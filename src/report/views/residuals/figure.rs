//! Residual maps as figures.

use super::{Binned, ResidualMaps, Statistic};
use crate::image::ColorMap;
use crate::report::plot::{Axis, Figure, Heading, HeatMap, Scale};

/// Where colours of means over their error end: what noise alone reaches in one of millions of cells.
const NOISE_RANGE: f64 = 5.0;

/// Where the colours of both maps end: of means over their error at 5, else the 99th percentile of their cells' sizes, rounded up to 1, 2 or 5 times a power of ten; 1 where all are 0.
#[must_use]
pub fn residual_range(maps: &ResidualMaps, statistic: Statistic) -> f64 {
    if statistic == Statistic::OverNoise {
        return NOISE_RANGE;
    }
    let cells = maps.half_diff.iter().chain([&maps.in_out]).flat_map(|m| m.values(statistic));
    let mut sizes: Vec<f64> = cells.flatten().map(f64::abs).filter(|v| *v > 0.0 && v.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len().saturating_sub(1) * 99 / 100).map_or(1.0, |most| Scale::around([*most]).high)
}

/// A map as a figure; `range` is where the colours end.
#[must_use]
pub fn residual_figure(
    map: &Binned,
    over_half: bool,
    statistic: Statistic,
    range: f64,
    (title, unit): (&str, &str),
    titled: bool,
) -> Figure {
    let degrees = |list: &[f64]| (list[0], list[list.len() - 1]);
    let ((x0, x1), (y0, y1)) = (degrees(&map.x_deg), degrees(&map.y_deg));
    let (x_label, y_label, x) = if over_half {
        ("θh [°]", "θd [°]", Scale::root(x0, x1))
    } else {
        ("θi [°]", "θo [°], + mirror side", Scale::degrees(x0, x1))
    };
    let (name, colors, low) = match statistic {
        Statistic::Mean => ("mean residual", ColorMap::Diverging, -range),
        Statistic::Rms => ("rms residual", ColorMap::Sequential, 0.0),
        Statistic::OverNoise => ("mean residual over its error", ColorMap::Diverging, -range),
    };
    let map = HeatMap {
        heading: Heading {
            title: format!("{title}, {name}"),
            description: format!("{name} in {} cells, colours from {} to {}", map.count.len(), low, range),
            drawn: titled,
        },
        x: Axis::new(x_label, x),
        y: Axis::new(y_label, Scale::degrees(y0, y1)),
        x_borders: map.x_deg.clone(),
        y_borders: map.y_deg.clone(),
        values: map.values(statistic),
        map: colors,
        range: (low, range),
        color_label: if statistic == Statistic::OverNoise {
            "σ".into()
        } else if unit.is_empty() {
            "r".into()
        } else {
            format!("r [{}]", unit_text(unit))
        },
        width: 400.0,
    };
    map.figure()
}

/// A unit as it is set: its power raised.
fn unit_text(unit: &str) -> String {
    unit.replace("^(-1/3)", "^{−1/3}")
}
