//! A fit in words.

use std::fmt::Write;

use crate::brdf::{FitRecord, Material, ModelChoice, PerChannel};
use crate::cli::text::{COLUMNS, indented};
use crate::fit::Loss;
use crate::measurement::Dimension;

/// A fit in words: every parameter with its standard error, then what else the record says.
pub(super) fn describe(name: &str, material: &Material) -> String {
    let mut t = String::new();
    let default = FitRecord::default();
    let record = material.fit.as_ref().unwrap_or(&default);
    let unit = unit_of(record, material);
    t.push_str(&head(
        name,
        [
            material.model(),
            record.status.clone(),
            format!("{} samples", record.samples),
            format!("rmse {}{unit}", small(record.rmse, 3)),
            format!("{:.3} s", record.seconds),
        ],
    ));
    for (l, lobe) in material.lobes.iter().enumerate() {
        let name = material.lobe_name(l);
        let (errors, intervals) = (record.standard_error.get(l), record.interval_95.get(l));
        for (c, weight) in lobe.weight.iter().enumerate() {
            let error = errors.and_then(|r| r.weight.get(c).copied().flatten());
            let interval = intervals.and_then(|r| r.weight.get(c).copied().flatten());
            parameter(&mut t, record, &format!("{name}.weight[{}]", material.channels[c]), *weight, (error, interval));
        }
        let Some(shape) = &lobe.shape else {
            let _ = writeln!(t, "  {:22} undetermined: the lobe has no weight", format!("{name}.*"));
            continue;
        };
        for (i, known) in lobe.kind.lobe().parameters().iter().enumerate() {
            let errors = errors.and_then(|r| r.shape.get(i)).map(|(_, e)| e);
            let intervals = intervals.and_then(|r| r.shape.get(i)).map(|(_, e)| e);
            let at = |c: usize| (errors.and_then(|e| e.get(c)).flatten(), intervals.and_then(|e| e.get(c)).flatten());
            let label = format!("{name}.{}", known.name);
            match &shape[i] {
                PerChannel::Shared(value) => parameter(&mut t, record, &label, *value, at(0)),
                PerChannel::Each(values) => {
                    for (c, value) in values.iter().enumerate() {
                        let label = format!("{label}[{}]", material.channels[c]);
                        parameter(&mut t, record, &label, *value, at(c));
                    }
                }
            }
        }
    }
    t.push_str(&evidence(record, material));
    for warning in &record.warnings {
        t.push_str(&hanging(&format!("warning: {warning}")));
    }
    t
}

/// What is said of a name beside it, or below it where both are too long for a line.
fn head<const N: usize>(name: &str, facts: [String; N]) -> String {
    // A fact stays in one piece.
    let bound = facts.map(|fact| fact.replace(' ', "\u{a0}")).join(", ");
    let beside = format!("{name}: {bound}");
    let fits = beside.chars().count() <= COLUMNS;
    let text = if fits { beside } else { format!("{name}:\n  {}", indented(&bound, 2)) };
    text.replace('\u{a0}', " ") + "\n"
}

/// Standard error and 95 % interval of a parameter.
type Stated = (Option<f64>, Option<(f64, f64)>);

/// The unit of the residuals, to be put behind a number; empty where they have none.
fn unit_of(record: &FitRecord, material: &Material) -> String {
    let dimension = if material.is_flat() { Dimension::Flat } else { Dimension::Space };
    match Loss::from_name(&record.loss).map_or("", |loss| loss.unit(dimension)) {
        "" => String::new(),
        unit => format!(" {unit}"),
    }
}

/// Something small, by powers of ten; 0 is 0.
fn small(x: f64, places: usize) -> String {
    if x == 0.0 { "0".into() } else { format!("{x:.places$e}") }
}

/// One line a parameter; its interval only where the error does not tell it: where it is lopsided or
/// wider than the error makes it.
fn parameter(t: &mut String, record: &FitRecord, label: &str, value: f64, (error, interval): Stated) {
    let open = record.undetermined.iter().any(|name| name == label);
    let half_width = interval.map(|(low, high)| (high - low) / 2.0);
    let digits = Digits::of(value, error.or(half_width).unwrap_or(0.0));
    let shown = match error {
        None if !open => format!("{} (at the end of its range)", plain(value)),
        _ => plus_minus(value, error),
    };
    let mut line = format!("  {label:22} {shown}");
    if let Some((low, high)) = interval {
        let (below, above) = (value - low, high - value);
        let wide = error.is_some_and(|error| above + below > WIDE * error);
        if wide || below.max(above) > LOPSIDED * below.min(above) {
            let interval = format!("(95 %: {} to {})", digits.show(low), digits.show(high));
            let fits = line.chars().count() + 2 + interval.chars().count() <= COLUMNS;
            let gap = if fits { "  ".to_owned() } else { format!("\n{:25}", "") };
            line.push_str(&gap);
            line.push_str(&interval);
        }
    }
    t.push_str(&line);
    t.push('\n');
}

/// Width of an interval over the standard error from which it is shown; 3.92 is usual.
const WIDE: f64 = 4.8;
/// Halves of an interval that differ by more than this factor are shown.
const LOPSIDED: f64 = 1.2;

/// Three digits.
fn digits(x: f64) -> String {
    if x == 0.0 || !(1e-4..1e6).contains(&x.abs()) {
        return if x == 0.0 { "0".into() } else { format!("{x:.2e}") };
    }
    let places = (2.0 - x.abs().log10().floor()).max(0.0) as usize;
    format!("{x:.places$}")
}

/// What else the numbers say: the noise and the model's own error, how the minimum was found, how the model was chosen.
fn evidence(record: &FitRecord, material: &Material) -> String {
    let mut t = String::new();
    let unit = unit_of(record, material);
    let mut say = |text: String| t.push_str(&hanging(&text));
    if let Some(through) = &record.through {
        say(format!("fitted through {through}: the material, not its readings"));
    }
    if let (Some(robust), [first, ..]) = (&record.robust, &record.robust_scale[..]) {
        let others = if record.robust_scale.len() > 1 { " (the first channel's)" } else { "" };
        say(format!("robust {robust}: residuals beyond {}{unit}{others} count less", small(*first, 3)));
    }
    if !record.relative_epsilon.is_empty() {
        let each = material.channels.iter().zip(&record.relative_epsilon).map(|(c, e)| format!("{c} {}", small(*e, 3)));
        let of_value = if material.is_flat() { "1/rad" } else { "1/sr" };
        say(format!("ε of the relative loss: {} {of_value}", each.collect::<Vec<_>>().join(", ")));
    }
    if let Some(r) = &record.residual {
        let from = if r.noise_from == "sigma" { "as the file states" } else { "from neighbours" };
        let model = match r.model_rmse {
            0.0 => "no model error seen".into(),
            rmse => format!("model error {}{unit}", small(rmse, 2)),
        };
        let noise = small(r.noise_rmse, 2);
        let worth = r.effective_samples;
        say(format!("residuals: noise {noise}{unit} ({from}), {model}; worth {worth:.0} independent values"));
    }
    if let Some(e) = &record.energy {
        say(format!("energy: reflects {} of the light at most", percent(e.largest)));
    }
    // A single shape is bracketed over its whole range: nothing to add unless another minimum is nearly as low.
    if let Some(s) =
        record.search.as_ref().filter(|s| s.unseen_chance.is_some() || s.runner_up_excess.is_some_and(|e| e < RIVAL))
    {
        let more = |e: f64| {
            if e < 1.0 { format!("{} more", percent(e)) } else { format!("{} times as much", digits(1.0 + e)) }
        };
        let others = s.runner_up_excess.map_or(String::new(), |e| format!("; the next costs {}", more(e)));
        let unseen = s
            .unseen_chance
            .map_or(String::new(), |p| format!("; another start finds a new one by a chance of {}", percent(p)));
        if s.starts > 1 {
            say(format!("search: {} of {} starts end in the lowest minimum{others}{unseen}", s.reached, s.starts));
        }
    }
    if let Some(s) = &record.subset {
        say(format!(
            "{} of about {} directions used: rmse over all within {} of the best (95 % confidence)",
            s.samples,
            s.of,
            percent(s.rmse_excess_95)
        ));
    }
    if let Some(text) = redrawn(record) {
        say(text);
    }
    if let Some(choice) = &record.choice {
        t.push_str(&comparison(choice, record, &unit));
    }
    t
}

/// Another minimum whose cost exceeds the lowest by less than this share is worth a word.
const RIVAL: f64 = 0.1;

fn percent(share: f64) -> String {
    format!("{} %", digits(100.0 * share))
}

/// How the bootstrap's standard errors compare with the analytic ones.
fn redrawn(record: &FitRecord) -> Option<String> {
    let bootstrap = record.bootstrap.as_ref()?;
    let mut ratios = Vec::new();
    for (drawn, known) in bootstrap.standard_error.iter().zip(&record.standard_error) {
        let mut compare = |pair: (Option<f64>, Option<f64>)| {
            ratios.extend(pair.0.zip(pair.1).filter(|p| p.1 > 0.0).map(|(drawn, known)| drawn / known));
        };
        drawn.weight.iter().copied().zip(known.weight.iter().copied()).for_each(&mut compare);
        for ((_, drawn), (_, known)) in drawn.shape.iter().zip(&known.shape) {
            let list = |p: &PerChannel<Option<f64>>| match p {
                PerChannel::Shared(one) => vec![*one],
                PerChannel::Each(many) => many.clone(),
            };
            list(drawn).into_iter().zip(list(known)).for_each(&mut compare);
        }
    }
    let (least, most) = ratios.iter().fold((f64::INFINITY, 0.0f64), |(a, b), r| (a.min(*r), b.max(*r)));
    (!ratios.is_empty()).then(|| {
        let count = bootstrap.replicates;
        format!("bootstrap: standard errors over {count} drawings are {least:.2} to {most:.2} of those above")
    })
}

/// The models compared, as a table; the rmse in it has a `unit`.
fn comparison(choice: &ModelChoice, record: &FitRecord, unit: &str) -> String {
    let width = choice.candidates.iter().map(|c| c.model.len()).fold(26, usize::max);
    let mut t = format!("  {:width$} par.       rmse   held out       AICc        BIC\n", "model");
    for c in &choice.candidates {
        let mark = if c.model == choice.chosen { "*" } else { " " };
        let _ = writeln!(
            t,
            "{mark} {:width$} {:4} {:10.3e} {:10.3e} {:>10} {:>10}",
            c.model,
            c.parameters,
            c.rmse,
            c.held_out_rmse,
            criterion(c.aicc),
            criterion(c.bic)
        );
    }
    let open = choice.candidates.iter().any(|c| !c.aicc.is_finite());
    let few = open.then(|| "AICc: — where the independent values are too few for so many parameters".to_owned());
    for line in [basis(choice, record, unit), few, Some(format!("chosen: {}: {}", choice.chosen, choice.reason))] {
        line.iter().for_each(|line| t.push_str(&hanging(line)));
    }
    t
}

/// One decimal; a criterion that has no value is a dash.
fn criterion(x: f64) -> String {
    if x.is_finite() { format!("{x:.1}") } else { "—".into() }
}

/// What the table's rmse are of: their unit, and why the chosen model's differs from that of the fit.
fn basis(choice: &ModelChoice, record: &FitRecord, unit: &str) -> Option<String> {
    let part = match (choice.samples, &record.subset) {
        (Some(n), _) => Some(format!("of {n} samples spread over the file")),
        (None, Some(_)) => Some("of all samples".to_owned()),
        (None, None) => None,
    };
    let robust = record.robust.as_ref().map(|_| "with one robust scale for all".to_owned());
    let unit = (!unit.is_empty()).then(|| format!("in{unit}"));
    let differs = part.is_some() || robust.is_some();
    let facts: Vec<String> = [unit, part, robust].into_iter().flatten().collect();
    let more = if differs { ", so they can differ from the rmse above" } else { "" };
    (!facts.is_empty()).then(|| format!("rmse and held out are {}{more}", facts.join(", ")))
}

/// A paragraph indented by two, what follows its first line by four.
pub(super) fn hanging(text: &str) -> String {
    let mut lines = vec![String::from(" ")];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        if lines[last].chars().count() + 1 + word.chars().count() > COLUMNS && lines[last].trim() != "" {
            lines.push(format!("    {word}"));
        } else {
            lines[last].push(' ');
            lines[last].push_str(word);
        }
    }
    lines.join("\n") + "\n"
}

/// `0.3201 ± 0.0004`: the error to two digits, the value to the same place; powers of ten where that would be long.
pub(in crate::cli) fn plus_minus(value: f64, error: Option<f64>) -> String {
    let Some(error) = error else { return format!("{} (undetermined)", plain(value)) };
    if error == 0.0 {
        return if value == 0.0 || (1e-4..1e9).contains(&value) { value.to_string() } else { format!("{value:e}") };
    }
    let digits = Digits::of(value, error);
    format!("{} ± {}", digits.show(value), digits.show_error(error))
}

/// Six decimals; powers of ten for what is very small or large.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) { format!("{value:.6}") } else { format!("{value:.6e}") }
}

/// To which decimal place numbers about as large as a value are shown.
#[derive(Debug, Clone, Copy)]
struct Digits {
    /// The place of the error's second digit: 10^last.
    last: i32,
    /// Whether by powers of ten.
    powers: bool,
}

impl Digits {
    /// Most decimals without powers of ten.
    const DECIMALS: i32 = 9;

    /// As many as an error of the value leaves; of an error of 0, six decimals.
    fn of(value: f64, error: f64) -> Self {
        let last = if error > 0.0 { error.log10().floor() as i32 - 1 } else { -6 };
        let size = value.abs().max(error);
        Self { last, powers: !((1e-4..1e6).contains(&size) || size == 0.0) }
    }

    fn show(self, x: f64) -> String {
        let decimals = (-self.last).clamp(0, Self::DECIMALS) as usize;
        if !self.powers {
            return format!("{x:.decimals$}");
        }
        if x == 0.0 {
            return "0".into();
        }
        let places = (x.abs().log10().floor() as i32 - self.last).clamp(1, 16) as usize;
        format!("{x:.places$e}")
    }

    fn show_error(self, error: f64) -> String {
        if self.powers || self.last < -Self::DECIMALS { format!("{error:.1e}") } else { self.show(error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paragraphs_hang_and_keep_every_word() {
        let text = "warning: ".to_owned() + &"word ".repeat(60);
        let shown = hanging(text.trim());
        assert!(shown.lines().count() > 3 && shown.lines().all(|l| l.chars().count() <= COLUMNS), "{shown}");
        assert!(
            shown.starts_with("  warning: word") && shown.lines().skip(1).all(|l| l.starts_with("    word")),
            "{shown}"
        );
        assert_eq!(shown.split_whitespace().count(), text.split_whitespace().count());
        assert_eq!(hanging("short"), "  short\n");
    }

    #[test]
    fn a_name_has_a_line_of_its_own_where_it_takes_one_and_facts_stay_whole() {
        let facts = || ["lambert+phong", "converged", "rmse 1.2e-2 1/sr"].map(str::to_owned);
        assert_eq!(head("p.csv", facts()), "p.csv: lambert+phong, converged, rmse 1.2e-2 1/sr\n");
        let name = "a/long/way/to/the/second/lot/of/paint.csv";
        assert_eq!(head(name, facts()), format!("{name}:\n  lambert+phong, converged, rmse 1.2e-2 1/sr\n"));
        let long = head("p.csv", ["x".repeat(70), "rmse 1.2e-2 1/sr".into()]);
        assert_eq!(long, format!("p.csv:\n  {},\n  rmse 1.2e-2 1/sr\n", "x".repeat(70)));
    }

    #[test]
    fn three_digits_whatever_the_size() {
        let shown = [0.0, 0.012_34, 1.0, 89.96, 12_345.6, 1e8, 2e-9].map(digits);
        assert_eq!(shown, ["0", "0.0123", "1.00", "90.0", "12346", "1.00e8", "2.00e-9"]);
    }

    #[test]
    fn an_interval_has_the_digits_of_its_value() {
        let shown = |label: &str, value: f64, error: Option<f64>, interval: (f64, f64)| {
            let mut t = String::new();
            parameter(&mut t, &FitRecord::default(), label, value, (error, Some(interval)));
            t
        };
        let text = shown("phong.exponent", 11.9955, Some(0.0033), (11.9921, 12.004));
        assert_eq!(text, "  phong.exponent         11.9955 ± 0.0033  (95 %: 11.9921 to 12.0040)\n");
        let text = shown("phong.exponent", 60.0, None, (60.0, 60.123_4));
        let below = format!("60.000000 (at the end of its range)\n{:25}(95 %: 60.000 to 60.123)\n", "");
        assert!(text.ends_with(&below), "{text}");
        let text = shown("w", 1e-150, Some(2e-151), (0.0, 3e-150));
        assert!(text.ends_with("1.00e-150 ± 2.0e-151  (95 %: 0 to 3.00e-150)\n"), "{text}");
    }

    #[test]
    fn errors_are_shown_to_two_digits() {
        assert_eq!(plus_minus(0.320_123, Some(0.000_41)), "0.32012 ± 0.00041");
        assert_eq!(plus_minus(312.49, Some(12.3)), "312 ± 12");
        assert_eq!(plus_minus(79.53, Some(134.2)), "80 ± 134");
        assert_eq!(plus_minus(0.314, Some(7e29)), "3.1e-1 ± 7.0e29");
        assert_eq!(plus_minus(1.234_56e-150, Some(1.2e-153)), "1.2346e-150 ± 1.2e-153");
        assert_eq!(plus_minus(1.5e150, Some(2e148)), "1.500e150 ± 2.0e148");
        assert_eq!(plus_minus(1e-150, Some(0.003)), "0.0000 ± 0.0030");
        assert_eq!(plus_minus(2e-150, Some(0.0)), "2e-150");
        assert_eq!(plus_minus(2e-150, None), "2.000000e-150 (undetermined)");
        assert_eq!(plus_minus(0.3, Some(1e-15)), "0.300000000 ± 1.0e-15");
        assert_eq!(plus_minus(0.5, Some(0.0)), "0.5");
        assert_eq!(plus_minus(1.5, None), "1.500000 (undetermined)");
    }
}
