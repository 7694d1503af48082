//! Peaks and widths of the lobes, table and fits side by side.

use crate::report::views::{Peak, Slice, peak};
use crate::report::words::{digits, number};

pub(super) struct Peaks {
    /// Whose, in the order of the columns.
    pub names: Vec<String>,
    pub rows: Vec<PeakRow>,
}

/// The peaks at an incidence.
pub(super) struct PeakRow {
    pub incidence: String,
    /// Value, and where and how wide; none where there is no curve.
    pub cells: Vec<Option<(String, String)>>,
}

/// The peaks of a channel at all incidences.
pub(super) fn peaks(slices: &[Slice], channel: usize) -> Peaks {
    let mut names: Vec<String> = Vec::new();
    // The table comes first wherever it has a curve, so the longest list has all in order.
    if let Some(most) = slices.iter().max_by_key(|s| s.curves.len()) {
        names.extend(most.curves.iter().map(|c| c.name.clone()));
    }
    let cell = |slice: &Slice, name: &String| {
        let curve = slice.curves.iter().find(|c| c.name == *name)?;
        peak(curve, channel).map(said)
    };
    let row = |slice: &Slice| PeakRow {
        incidence: format!("{}°", number(slice.incidence_deg)),
        cells: names.iter().map(|name| cell(slice, name)).collect(),
    };
    Peaks { rows: slices.iter().map(row).collect(), names }
}

fn said(peak: Peak) -> (String, String) {
    let width = peak.width_deg.map_or_else(String::new, |width| format!(", {}° wide", digits(width, 3)));
    let place = peak.theta_o_deg.map_or_else(|| "level".into(), |theta| format!("at {}°", digits(theta, 3)));
    (number(peak.value), place + &width)
}
