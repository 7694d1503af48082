//! Text as a terminal shows it: lines that fit.

use std::fmt::{Display, Write as _};

/// Columns that tables keep to, whatever the terminal.
pub(super) const COLUMNS: usize = 80;

/// An option's words; none where it was not given.
pub(super) fn option(name: &str, value: Option<impl Display>) -> Vec<String> {
    value.map_or_else(Vec::new, |value| vec![format!("--{name}"), value.to_string()])
}

/// A command's words: what it begins with, then its options.
pub(super) fn command<const N: usize>(begin: &[&str], options: [Vec<String>; N]) -> Vec<String> {
    begin.iter().map(|word| (*word).to_owned()).chain(options.into_iter().flatten()).collect()
}

/// Words in lines of at most so many characters; a longer word has its own.
pub(super) fn wrapped(words: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split(' ') {
        let line = lines.last().map_or(0, |l| l.chars().count());
        match lines.last_mut() {
            Some(last) if line == 0 || line + 1 + word.chars().count() <= width => {
                last.push_str(if line == 0 { "" } else { " " });
                last.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Words from a column on, within [`COLUMNS`].
pub(super) fn indented(words: &str, column: usize) -> String {
    wrapped(words, COLUMNS.saturating_sub(column)).join(&format!("\n{:column$}", ""))
}

/// The text with lines that are longer than `width` characters folded; what follows stands under the last column that the line begins with, in the left half.
pub(super) fn folded(text: &str, width: usize) -> String {
    let mut out = String::new();
    for (k, line) in text.lines().enumerate() {
        let begin = if k == 0 { "" } else { "\n" };
        if line.chars().count() <= width {
            // Writing to a String can't fail.
            let _ = write!(out, "{begin}{line}");
            continue;
        }
        let column = last_column(line).filter(|c| 2 * c <= width).unwrap_or(0);
        let (head, words): (String, String) =
            (line.chars().take(column).collect(), line.chars().skip(column).collect());
        let indent = if column == 0 { 2 } else { column };
        let folded = wrapped(&words, width - indent).join(&format!("\n{:indent$}", ""));
        let _ = write!(out, "{begin}{head}{folded}");
    }
    out
}

/// Where the text after the last two spaces in a row begins, characters.
fn last_column(line: &str) -> Option<usize> {
    let (head, _) = line.trim_end().rsplit_once("  ")?;
    Some(head.chars().count() + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_are_folded_under_their_last_column() {
        assert_eq!(folded("  name  one two three\nshort", 16), "  name  one two\n        three\nshort");
        assert_eq!(folded("a sentence of five words", 12), "a sentence\n  of five\n  words");
        assert_eq!(folded("", 10), "");
        assert!(indented(&"word ".repeat(40), 30).lines().all(|line| line.chars().count() <= COLUMNS));
    }
}
