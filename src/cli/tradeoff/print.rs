//! Curves as tables of 80 columns.

use std::fmt::Write as _;

use super::advice::short;
use crate::numeric::estimate::Estimate;
use crate::report;
use crate::tradeoff::{Cost, Curve, Point, Slope, Standing, Sweep};

/// Columns of the terminal.
const WIDTH: usize = 80;
/// Columns of a value with its ±, and of one without.
const WITH: usize = 14;
const WITHOUT: usize = 11;

/// The whole sweep.
pub(super) fn text(sweep: &Sweep) -> String {
    let Sweep { stage, subject, trials, seed, threads, seconds, .. } = sweep;
    let mut text = filled(
        &format!(
            "{stage}: {subject}; {trials} trials of each setting, seed {seed}, {threads} threads, {}",
            time(*seconds)
        ),
        2,
    );
    for said in &sweep.reference {
        text.push_str(&filled(&format!("truth: {said}"), 2));
    }
    for note in &sweep.notes {
        text.push_str(&filled(&format!("note: {note}"), 2));
    }
    for curve in &sweep.curves {
        text.push_str(&table(sweep, curve));
    }
    text.push_str("\n* none is better in both time and error; ~ one is, within the 95 % intervals\n");
    for measure in &sweep.measures {
        text.push_str(&filled(&format!("{}: {}", measure.name, measure.what), 2));
    }
    text
}

/// One curve: a line a setting, then its slopes.
fn table(sweep: &Sweep, curve: &Curve) -> String {
    let main = sweep.measure(curve.main).unwrap_or(0);
    let shown = |m: &usize| curve.points.iter().any(|p| p.errors[*m].is_some());
    let others: Vec<usize> = (0..sweep.measures.len()).filter(|m| *m != main).filter(shown).collect();
    let first = WIDTH - 2 - 2 * WITH - WITHOUT * others.len();
    let whose = match curve.cost {
        Cost::Computer => "time",
        Cost::Instrument => "instrument",
        Cost::Both => "in all",
    };
    let before = first + 2 - whose.len().saturating_sub(8);
    let fits = curve.name.chars().count() <= before;
    let lead = if fits { String::new() } else { format!("\n{}", curve.name) };
    let name = if fits { &curve.name[..] } else { "" };
    let mut text = format!("{lead}\n{name:<before$}{whose:>8}{:>14}", curve.main);
    text.push_str(&" ".repeat(WITH - 8));
    for m in &others {
        let _ = write!(text, "{:>WITHOUT$}", sweep.measures[*m].name);
    }
    let mut text = text.trim_end().to_owned() + "\n";
    for point in &curve.points {
        line(&mut text, curve, point, main, &others, first);
    }
    let kept =
        curve.points.iter().filter_map(|p| Some(format!("{} in {} of {}", short(p.promise?), p.kept?, p.judged?)));
    let kept: Vec<String> = kept.collect();
    if !kept.is_empty() {
        text.push_str(&filled(&format!("  kept: {} at most {}", curve.main, kept.join(", ")), 4));
    }
    let mut said: Vec<&str> = Vec::new();
    // One that may as well be anything says nothing.
    let told = |s: &&Slope| s.slope.high - s.slope.low < 2.0 && (s.law.is_some() || s.slope.low * s.slope.high > 0.0);
    for slope in curve.slopes.iter().filter(told) {
        let why = slope.law.map(|law| law.why).filter(|why| !said.contains(why));
        said.extend(why);
        text.push_str(&filled(&slope_said(curve, slope, why), 4));
    }
    if !curve.commands.is_empty() {
        text.push_str("  settings are options of these commands, one each:\n");
        curve.commands.iter().for_each(|words| _ = writeln!(text, "    {}", report::typed(words)));
    }
    text
}

fn line(text: &mut String, curve: &Curve, point: &Point, main: usize, others: &[usize], first: usize) {
    let mark = match point.standing {
        Standing::Front => '*',
        Standing::Undecided => '~',
        Standing::Beaten | Standing::Unknown => ' ',
    };
    let setting = &point.setting;
    if setting.chars().count() >= first {
        let _ = writeln!(text, "{mark} {setting}");
        let _ = write!(text, "{:w$}", "", w = first + 2);
    } else {
        let _ = write!(text, "{mark} {setting:<first$}");
    }
    let cost = point.cost(curve.cost).map_or_else(|| pair("–", ""), |t| pair(&time(t.value), &reach(t)));
    text.push_str(&cost);
    text.push_str(&point.errors[main].map_or_else(|| pair("–", ""), |e| pair(&value(e), &reach(e))));
    for m in others {
        let said = point.errors[*m].map_or("–".into(), value);
        let _ = write!(text, "{said:>WITHOUT$}");
    }
    let trimmed = text.trim_end().len();
    text.truncate(trimmed);
    text.push('\n');
}

fn pair(value: &str, reach: &str) -> String {
    format!("{value:>8} {reach:<5}")
}

/// An error; one whose interval begins at 0 by its upper end.
fn value(e: Estimate) -> String {
    if e.low == 0.0 && e.high > 0.0 && e.high.is_finite() { format!("<{}", short(e.high)) } else { short(e.value) }
}

/// Half the width of an interval, in per cent of the value, or as a factor where that is large.
fn reach(e: Estimate) -> String {
    if e.low == e.high || e.low == 0.0 {
        return String::new();
    }
    match (e.high / e.low).sqrt() {
        f if f < 1.0005 => String::new(), // of a fit's second beside the instrument's hours
        f if f < 1.095 => format!("±{:.1}%", 100.0 * (f - 1.0)),
        f if f < 2.0 => format!("±{:.0}%", 100.0 * (f - 1.0)),
        f if f < 10.0 => format!("×{f:.1}"),
        f => format!("×{f:.0}"),
    }
}

/// A slope beside that of theory, with the reason where it is to be said.
fn slope_said(curve: &Curve, slope: &Slope, why: Option<&str>) -> String {
    let own = slope.slope;
    let law = slope.law.map_or(String::new(), |law| format!("; theory {}", law.theory.said(|x| x.to_string())));
    let why = why.map_or(String::new(), |why| format!(": {why}"));
    let reach = 0.5 * (own.high - own.low);
    format!("  {} against {}: slope {:.3} ± {reach:.3}{law}{why}", slope.measure, curve.axis, own.value)
}

/// Seconds, minutes or hours in three digits.
pub(super) fn time(seconds: f64) -> String {
    let three = crate::cli::ui::significant;
    match seconds {
        s if s >= 5400.0 => format!("{} h", three(s / 3600.0)),
        s if s >= 90.0 => format!("{} min", three(s / 60.0)),
        s if s >= 0.995 => format!("{} s", three(s)),
        s if s >= 0.995e-3 => format!("{} ms", three(1e3 * s)),
        s => format!("{} µs", three(1e6 * s)),
    }
}

/// Words in lines of 80 columns, later ones set in; leading line breaks and blanks stay.
pub(super) fn filled(words: &str, indent: usize) -> String {
    let body = words.trim_start();
    let mut text = words[..words.len() - body.len()].to_owned();
    let mut column = text.chars().rev().take_while(|c| *c == ' ').count();
    for (k, word) in body.split(' ').enumerate() {
        let length = word.chars().count();
        if k > 0 && column + 1 + length > WIDTH {
            text.push('\n');
            text.push_str(&" ".repeat(indent));
            column = indent;
        } else if k > 0 {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        column += length;
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_say_how_sure_they_are() {
        let estimate = |value: f64, factor: f64| Estimate { value, low: value / factor, high: value * factor };
        assert_eq!(reach(estimate(3.0, 1.031)), "±3.1%");
        assert_eq!(reach(estimate(3.0, 1.5)), "±50%");
        assert_eq!(reach(estimate(3.0, 4.0)), "×4.0");
        assert_eq!([reach(Estimate::alone(3.0)), reach(estimate(3.0, 1.0001))], ["", ""]);
        assert_eq!(value(Estimate { value: 0.001, low: 0.0, high: 0.002 }), "<2.00e-3");
        assert_eq!(
            [time(2e-6), time(0.0123), time(2.0), time(100.0), time(7200.0)],
            ["2.00 µs", "12.3 ms", "2.00 s", "1.67 min", "2.00 h"]
        );
    }

    #[test]
    fn words_fill_eighty_columns() {
        let text = filled(&format!("\n  {}", "twelve chars ".repeat(12)), 4);
        assert!(text.starts_with("\n  twelve") && text.lines().all(|l| l.chars().count() <= 80), "{text}");
        assert!(text.lines().skip(2).all(|l| l.starts_with("    ") && !l.starts_with("     ")), "{text}");
    }
}
