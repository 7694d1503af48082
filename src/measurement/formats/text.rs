//! Text files line by line, with the line's number for messages. CRLF, LF and a byte order mark are accepted.

use std::io::{BufRead, Read};
use std::path::Path;

use super::source::Source;
use crate::measurement::MeasurementError;

/// Longest line accepted, bytes: a file without line ends must not be taken into memory whole.
const LINE_LIMIT: u64 = 1 << 20;

/// The lines of a text file.
pub(super) struct Lines<'a> {
    path: &'a Path,
    input: Box<dyn BufRead + 'a>,
    buffer: Vec<u8>,
    number: u64,
    cut: bool,
}

/// One line, without its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<'a> {
    path: &'a Path,
    /// Its number, from 1.
    pub(super) number: u64,
    /// Its text.
    pub(super) text: &'a str,
}

impl<'a> Lines<'a> {
    /// The lines of `source`.
    pub(super) fn new(source: &'a Source) -> Result<Self, MeasurementError> {
        let input = source.reader_at(0)?;
        Ok(Self { path: source.path(), input, buffer: Vec::new(), number: 0, cut: false })
    }

    /// The next line, `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<Line<'_>>, MeasurementError> {
        self.buffer.clear();
        let read = (&mut self.input).take(LINE_LIMIT + 1).read_until(b'\n', &mut self.buffer);
        if read.map_err(|e| MeasurementError::io(self.path, e))? == 0 {
            return Ok(None);
        }
        self.number += 1;
        let place = |number: u64| format!("line {number}");
        if self.buffer.len() as u64 > LINE_LIMIT {
            let (expected, found) = (format!("a line of at most {LINE_LIMIT} bytes"), "a longer one");
            return Err(MeasurementError::invalid(self.path, place(self.number), expected, found));
        }
        self.cut = self.buffer.last() != Some(&b'\n');
        let bytes = self.buffer.strip_prefix(b"\xef\xbb\xbf".as_slice()).filter(|_| self.number == 1);
        let Ok(text) = std::str::from_utf8(bytes.unwrap_or(&self.buffer)) else {
            return Err(MeasurementError::invalid(self.path, place(self.number), "text in UTF-8", "other bytes"));
        };
        let text = text.strip_suffix('\n').unwrap_or(text);
        Ok(Some(Line { path: self.path, number: self.number, text: text.strip_suffix('\r').unwrap_or(text) }))
    }

    /// The next line that is not blank.
    pub(super) fn next_filled(&mut self) -> Result<Option<Line<'_>>, MeasurementError> {
        while let Some(blank) = self.next()?.map(|line| line.text.trim().is_empty()) {
            if !blank {
                return Ok(Some(self.current()));
            }
        }
        Ok(None)
    }

    /// The next line that is neither blank nor a comment (`#`).
    pub(super) fn next_content(&mut self) -> Result<Option<Line<'_>>, MeasurementError> {
        while let Some(comment) = self.next_filled()?.map(|line| line.text.trim_start().starts_with('#')) {
            if !comment {
                return Ok(Some(self.current()));
            }
        }
        Ok(None)
    }

    /// Number of the line that was read last.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// The error that in line `number` `found` stands in `column` where `expected` belongs.
    pub(super) fn invalid_at(
        &self,
        number: u64,
        column: &str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> MeasurementError {
        Line { path: self.path, number, text: "" }.invalid(column, expected, found)
    }

    /// The line that was read last, as text again.
    fn current(&self) -> Line<'_> {
        let bytes = self.buffer.strip_prefix(b"\xef\xbb\xbf".as_slice()).filter(|_| self.number == 1);
        let text = std::str::from_utf8(bytes.unwrap_or(&self.buffer)).unwrap_or_default();
        Line { path: self.path, number: self.number, text: text.trim_end_matches(['\n', '\r']) }
    }

    /// The error that the file ends where `expected` belongs.
    pub(super) fn ends_too_early(&self, expected: impl Into<String>) -> MeasurementError {
        let place = format!("after line {}", self.number);
        MeasurementError::invalid(self.path, place, expected, "the end of the file")
    }

    /// What to tell the user at the end: a last line without a line end may have been cut.
    pub(super) fn cut_note(&self) -> Option<String> {
        self.cut.then(|| {
            let number = self.number;
            format!("line {number}, the last, has no line end: if the file was cut, its last number may be too")
        })
    }
}

impl Line<'_> {
    /// The error that `found` stands in `column` where `expected` belongs.
    pub(super) fn invalid(
        &self,
        column: &str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> MeasurementError {
        MeasurementError::invalid(self.path, self.place(column), expected, found)
    }

    /// The error that the content of this line can't be used.
    pub(super) fn unsupported(&self, reason: &str) -> MeasurementError {
        MeasurementError::unsupported(self.path, format!("line {}: {reason}", self.number))
    }

    /// "line 7, column `r`"; without a column, "line 7".
    pub(super) fn place(&self, column: &str) -> String {
        let number = self.number;
        if column.is_empty() { format!("line {number}") } else { format!("line {number}, {column}") }
    }

    /// The number, finite or not, written as `text` in `column`.
    pub(super) fn number(&self, column: &str, text: &str) -> Result<f64, MeasurementError> {
        text.trim().parse().map_err(|_| self.invalid(column, "a number", quoted(text)))
    }

    /// The finite number written as `text` in `column`.
    pub(super) fn finite(&self, column: &str, text: &str) -> Result<f64, MeasurementError> {
        let value = self.number(column, text)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.invalid(column, "a finite number", quoted(text)))
    }

    /// [`Self::numbers`] of a line that should hold `what`: where it holds words instead, the error says so.
    pub(super) fn numbers_of(&self, what: &str) -> Result<Vec<f64>, MeasurementError> {
        match self.text.split_whitespace().next() {
            Some(word) if word.starts_with(|c: char| c.is_alphabetic()) && word.parse::<f64>().is_err() => {
                Err(self.invalid("", what, quoted(self.text)))
            }
            _ => self.numbers(),
        }
    }

    /// All numbers of the line, separated by blanks (or commas): finite or not.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, MeasurementError> {
        let cells = self.text.split(|c: char| c.is_whitespace() || c == ',').filter(|cell| !cell.is_empty());
        cells.enumerate().map(|(i, cell)| self.number(&format!("column {}", i + 1), cell)).collect()
    }
}

/// `text` in quotes for a message, shortened to 60 characters.
pub(super) fn quoted(text: &str) -> String {
    let text = text.trim();
    let mut short: String = text.chars().take(60).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    format!("{short:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: &[u8]) -> Vec<(u64, String)> {
        let source = Source::from_bytes(Path::new("t"), bytes.to_vec());
        let mut lines = Lines::new(&source).expect("open");
        let mut out = Vec::new();
        while let Some(line) = lines.next_filled().expect("line") {
            out.push((line.number, line.text.to_string()));
        }
        out
    }

    #[test]
    fn line_ends_and_byte_order_mark_do_not_show() {
        let want = vec![(1, "a".to_string()), (3, "b".to_string())];
        assert_eq!(lines(b"a\n\nb\n"), want);
        assert_eq!(lines(b"\xef\xbb\xbfa\r\n\r\nb"), want);
    }

    #[test]
    fn a_file_without_line_ends_is_not_taken_into_memory() {
        let source = Source::from_bytes(Path::new("t"), vec![b'1'; 3 << 20]);
        let mut lines = Lines::new(&source).expect("open");
        let error = lines.next().expect_err("too long");
        assert!(error.to_string().contains("line 1: expected a line of at most 1048576 bytes"), "{error}");
        assert!(lines.buffer.capacity() < 4 << 20);
    }
}
