//! A sweep as CSV: one row a setting.

use std::fmt::Write as _;

use super::curve::{Point, Sweep};
use super::front::Standing;
use crate::numeric::estimate::Estimate;

/// The sweep as CSV, with `#` lines for what is the same in all rows. Ends of intervals that nothing is known of are empty.
#[must_use]
pub fn to_csv(sweep: &Sweep) -> String {
    let mut text = format!(
        "# goniofit tradeoff {}: {}, {} trials, seed {}, {} threads\n",
        sweep.stage, sweep.subject, sweep.trials, sweep.seed, sweep.threads
    );
    for said in &sweep.reference {
        let _ = writeln!(text, "# reference: {said}");
    }
    let mut header: Vec<String> =
        ["curve", "setting", "axis", "size", "trials", "seconds", "seconds_low", "seconds_high", "instrument_s"]
            .map(str::to_owned)
            .to_vec();
    for measure in &sweep.measures {
        let name = measure.name.replace('-', "_");
        header.extend([name.clone(), format!("{name}_low"), format!("{name}_high")]);
    }
    header.extend(["promise", "kept", "judged", "standing"].map(str::to_owned));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut rows = vec![header];
    for (curve, point) in sweep.points() {
        let curve = &sweep.curves[curve];
        rows.push(row(&curve.name, curve.axis, point));
    }
    // Writing into memory does not fail.
    let written = rows.iter().try_for_each(|row| writer.write_record(row)).ok();
    let bytes = written.and_then(|()| writer.into_inner().ok()).unwrap_or_default();
    text.push_str(&String::from_utf8_lossy(&bytes));
    text
}

fn row(curve: &str, axis: &str, point: &Point) -> Vec<String> {
    let number = |x: Option<f64>| x.filter(|x| x.is_finite()).map_or(String::new(), |x| format!("{x:e}"));
    let three = |e: Option<Estimate>| [number(e.map(|e| e.value)), number(e.map(|e| e.low)), number(e.map(|e| e.high))];
    let mut row = vec![curve.to_owned(), point.setting.clone(), axis.to_owned()];
    row.extend([number(point.size), point.trials.len().to_string()]);
    row.extend(three(Some(point.seconds)));
    row.push(number(point.instrument_s));
    point.errors.iter().for_each(|e| row.extend(three(*e)));
    let standing = match point.standing {
        Standing::Front => "front",
        Standing::Undecided => "undecided",
        Standing::Beaten => "beaten",
        Standing::Unknown => "unknown",
    };
    let count = |n: Option<usize>| n.map_or(String::new(), |n| n.to_string());
    row.extend([number(point.promise), count(point.kept), count(point.judged), standing.into()]);
    row
}
