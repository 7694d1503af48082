//! `--advise`: a curve as the setting for a wanted error or time.

use serde_json::{Value, json};

use super::print::{filled, time};
use crate::cli::failure::Failure;
use crate::cli::fit::{parse_share, parse_time};
use crate::cli::ui::significant;
use crate::report;
use crate::tradeoff::{Advice, NoAdvice, Sweep, Wish, advise};

/// What was asked for, as it was typed.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    typed: String,
    wish: Wish,
}

/// `error=1e-3`, `error=2%`, `flip=0.01`, `time=2s`, `instrument=30m`.
pub(super) fn parse(text: &str) -> Result<Asked, String> {
    let expected = "expected error=E, time=T or instrument=T, error=1e-3 or time=2s say";
    let (name, value) = text.split_once('=').ok_or(expected)?;
    let wish = match name.trim() {
        "time" => Wish::Time(parse_time(value)?.as_secs_f64()),
        "instrument" => Wish::InstrumentTime(parse_time(value)?.as_secs_f64()),
        "error" => Wish::Error(None, parse_share(value)?),
        "" => return Err(expected.into()),
        measure => Wish::Error(Some(measure.to_owned()), parse_share(value)?),
    };
    Ok(Asked { typed: text.to_owned(), wish })
}

impl Asked {
    /// Whether trials tell the error that is asked for, out of these.
    ///
    /// # Errors
    /// That they don't.
    pub fn is_told(&self, told: &[&str]) -> Result<(), Failure> {
        match &self.wish {
            Wish::Error(Some(name), _) if !told.contains(&name.as_str()) => Err(Failure::usage(format!(
                "--advise {}: expected an error out of {} (or error, for that of each curve), found {name}",
                self.typed,
                told.join(", ")
            ))),
            _ => Ok(()),
        }
    }
}

/// What was asked for, and the answers.
pub(super) type Answers = Vec<(Asked, Result<Advice, NoAdvice>)>;

pub(super) fn all(asked: &[Asked], sweep: &Sweep) -> Answers {
    asked.iter().map(|asked| (asked.clone(), advise(sweep, &asked.wish))).collect()
}

pub(super) fn json(answers: &Answers, sweep: &Sweep) -> Value {
    let one = |(asked, found): &(Asked, Result<Advice, NoAdvice>)| match found {
        Ok(advice) => json!({ "asked": asked.typed, "advice": advice, "commands": commands(advice, sweep) }),
        Err(why) => json!({ "asked": asked.typed, "advice": null, "why": why.to_string() }),
    };
    answers.iter().map(one).collect()
}

pub(super) fn text(answers: &Answers, sweep: &Sweep) -> String {
    answers.iter().map(|(asked, found)| one(asked, found, sweep)).collect()
}

fn one(asked: &Asked, found: &Result<Advice, NoAdvice>, sweep: &Sweep) -> String {
    let Ok(advice) = found else {
        return format!("\n{}: none\n", asked.typed); // the command fails, and says why
    };
    let beyond = if advice.beyond { ", beyond what was measured" } else { "" };
    let instrument = advice.instrument_s.map_or(String::new(), |s| format!(" and {} of the instrument", time(s)));
    let said = format!(
        "\n{}: {} ({}{beyond}): {} {}, below {} with 95 % confidence; takes {}{instrument}, less than {} with 95 % confidence",
        asked.typed,
        advice.setting,
        advice.curve,
        advice.measure,
        short(advice.error.expected),
        short(advice.error.at_most),
        time(advice.seconds.expected),
        time(advice.seconds.at_most),
    );
    filled(&said, 2) + &typed(advice, sweep)
}

/// How to ask for it: the command lines, or what to change where no option does.
fn typed(advice: &Advice, sweep: &Sweep) -> String {
    if let Some(times) = advice.setting.strip_prefix("exposures × ") {
        return format!("  no option: write detector.exposures_s times {times} into the instrument's file\n");
    }
    let lines: Vec<String> = commands(advice, sweep).iter().map(|line| format!("  {line}\n")).collect();
    lines.concat()
}

/// The command lines, where the setting is made of options: all of them go with the one command, or one with each of a
/// chain.
fn commands(advice: &Advice, sweep: &Sweep) -> Vec<String> {
    if !advice.setting.starts_with("--") {
        return Vec::new();
    }
    let words: Vec<&str> = advice.setting.split(' ').collect();
    let each = if sweep.commands.len() > 1 { 2 } else { words.len() };
    let lines = sweep.commands.iter().zip(words.chunks(each));
    let typed = |(command, options): (&Vec<String>, &[&str])| report::typed(&with(command, options));
    lines.map(typed).collect()
}

/// The command with options, the first of which takes the place of what was typed of it: a scan of its own, say.
fn with<'a>(command: &'a [String], options: &[&'a str]) -> Vec<&'a str> {
    let place = command.iter().position(|word| options.first() == Some(&word.as_str()));
    let kept = command.iter().enumerate().filter(|(i, _)| place.is_none_or(|p| *i != p && *i != p + 1));
    kept.map(|(_, word)| word.as_str()).chain(options.iter().copied()).collect()
}

/// A number in three digits.
pub(super) fn short(x: f64) -> String {
    if x == 0.0 || (1e-2..1e4).contains(&x) { significant(x) } else { format!("{x:.2e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        line.split('|').map(str::to_owned).collect()
    }

    #[test]
    fn options_go_with_the_command_that_has_them_and_take_the_place_of_what_was_typed() {
        let with = |line: &str, option: &[&str]| report::typed(&with(&words(line), option));
        let base = "goniofit|simulate|my lab.toml|--scan|list:my pairs.csv|--seed|4";
        assert_eq!(with(base, &["--readings", "2"]), format!("{} --readings 2", report::typed(&words(base))));
        assert_eq!(
            with(base, &["--scan", "hemisphere:5"]),
            "goniofit simulate 'my lab.toml' --seed 4 --scan hemisphere:5"
        );
    }
}
