//! Holds the house's import table against the source: what a room may import, and that every room opens with a chapter.
//!
//! The rule is for the code that is shipped: comments, strings and whatever stands under `#[cfg(test)]` do not count, so
//! tests may join rooms as they like. `lib.rs` and `main.rs` stand above the rooms.

// The helpers of this test read the project's own files; they may fail loudly.
#![allow(clippy::expect_used, clippy::panic)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Room → rooms that it may import, besides itself.
const TABLE: [(&str, &[&str]); 14] = [
    ("control", &[]),
    ("numeric", &[]),
    ("geometry", &["numeric"]),
    ("radiometry", &["numeric", "geometry"]),
    ("brdf", &["control", "numeric", "geometry", "radiometry"]),
    ("measurement", &["control", "numeric", "geometry", "radiometry", "brdf"]),
    ("gonio", &["control", "numeric", "geometry", "radiometry", "brdf", "measurement"]),
    ("fit", &["control", "numeric", "geometry", "radiometry", "brdf", "measurement"]),
    ("image", &["numeric"]),
    ("render", &["control", "numeric", "geometry", "radiometry", "brdf", "image"]),
    ("chain", &UP_TO_RENDER),
    ("tradeoff", &UP_TO_CHAIN),
    ("report", &UP_TO_TRADEOFF),
    ("cli", &UP_TO_REPORT),
];

const UP_TO_RENDER: [&str; 10] =
    ["control", "numeric", "geometry", "radiometry", "brdf", "measurement", "gonio", "fit", "image", "render"];
const UP_TO_CHAIN: [&str; 11] =
    ["control", "numeric", "geometry", "radiometry", "brdf", "measurement", "gonio", "fit", "image", "render", "chain"];
const UP_TO_TRADEOFF: [&str; 12] = [
    "control",
    "numeric",
    "geometry",
    "radiometry",
    "brdf",
    "measurement",
    "gonio",
    "fit",
    "image",
    "render",
    "chain",
    "tradeoff",
];
const UP_TO_REPORT: [&str; 13] = [
    "control",
    "numeric",
    "geometry",
    "radiometry",
    "brdf",
    "measurement",
    "gonio",
    "fit",
    "image",
    "render",
    "chain",
    "tradeoff",
    "report",
];

#[test]
fn rooms_import_only_what_the_table_allows() {
    let files = rust_files(&source_root());
    assert!(files.len() > 10, "found only {} source files", files.len());
    let mut violations = String::new();
    for file in files {
        let path = file.strip_prefix(source_root()).expect("under src").to_path_buf();
        if path == Path::new("lib.rs") || path == Path::new("main.rs") || is_test_module(&file) {
            continue;
        }
        for violation in check(&path, &read(&file)) {
            writeln!(violations, "{violation}").expect("a string");
        }
    }
    assert!(violations.is_empty(), "\n{violations}");
}

#[test]
fn every_room_opens_with_a_chapter() {
    for entry in std::fs::read_dir(source_root()).expect("src") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_file() {
            assert!(["lib.rs", "main.rs"].contains(&name.as_str()), "src/{name}: a file outside of every room");
            continue;
        }
        assert!(allowed(&name).is_some(), "src/{name}: a room that the table does not know");
        let opening = read(&path.join("mod.rs"));
        assert!(opening.starts_with("//! "), "src/{name}/mod.rs does not open with a `//!` chapter");
    }
}

#[test]
fn made_up_violations_are_caught_and_lawful_code_is_not() {
    let caught = |path: &str, text: &str| check(Path::new(path), text);
    let lines = |path: &str, text: &str| caught(path, text).len();
    assert_eq!(
        caught("fit/solve.rs", "use crate::brdf::Brdf;\nuse crate::gonio::Scan;\n"),
        ["src/fit/solve.rs:2: fit may not import gonio"]
    );
    assert_eq!(lines("geometry/a.rs", "fn f() { crate::brdf::check::go() }"), 1, "a path without `use`");
    assert_eq!(lines("geometry/a.rs", "use crate::{numeric::{float, sum}, brdf::{self, Brdf}, cli};"), 2, "a group");
    assert_eq!(lines("geometry/a.rs", "use crate::{\n  numeric,\n  render,\n};"), 1, "over lines");
    assert_eq!(lines("geometry/a.rs", "use  crate :: brdf;"), 1, "spaces");
    assert_eq!(lines("geometry/a.rs", "use super::super::brdf::Brdf;"), 1, "by way of super");
    assert_eq!(lines("geometry/mod.rs", "use super::brdf::Brdf;"), 1, "super of a mod.rs");
    assert_eq!(lines("geometry/deep/a.rs", "use super::super::super::brdf::Brdf;"), 1, "deeper");
    assert_eq!(lines("geometry/a.rs", "use crate::*;"), 1, "everything");
    assert_eq!(lines("geometry/a.rs", "use crate as house;"), 1, "under another name");
    assert_eq!(lines("geometry/a.rs", "use goniofit::brdf::Brdf;"), 1, "by the name of the crate");
    assert_eq!(lines("geometry/a.rs", "use crate::attic::Trunk;"), 1, "an unknown room imported");
    assert_eq!(lines("attic/mod.rs", "fn f() {}"), 1, "an unknown room");
    assert_eq!(lines("stray.rs", "fn f() {}"), 1, "no room at all");
    assert_eq!(lines("geometry/a.rs", "#[cfg(not(test))]\nuse crate::brdf::Brdf;"), 1, "not a test");
    assert_eq!(
        lines("geometry/a.rs", "#[cfg(test)]\nmod tests { use super::*; }\nuse crate::brdf::Brdf;"),
        1,
        "after one"
    );
    assert_eq!(lines("geometry/a.rs", "let c = '\"'; use crate::brdf::Brdf; let d = '\"';"), 1, "between quotes");

    assert_eq!(
        lines("geometry/a.rs", "// use crate::brdf::Brdf;\n/// [`crate::gonio`] /* */\n/* crate::cli /* */ */"),
        0
    );
    assert_eq!(lines("geometry/a.rs", "let s = \"crate::brdf\\\" \"; let r = r#\"crate::cli \" \"#;"), 0, "strings");
    assert_eq!(lines("geometry/a.rs", "#[cfg(test)]\nmod tests { use crate::brdf::Brdf; fn f() { '}' } }"), 0, "tests");
    assert_eq!(lines("geometry/a.rs", "#[cfg(test)]\nuse crate::brdf::Brdf;"), 0, "a test's import");
    assert_eq!(lines("geometry/a.rs", "pub(crate) fn f<'a>(x: &'a str) {}\nuse super::angles::direction;"), 0);
    assert_eq!(lines("cli/fit.rs", "use crate::{chain, report::Page, tradeoff};\nuse crate::cli::args;"), 0);
    assert_eq!(lines("geometry/a.rs", "use some_crate::brdf; let goniofit_x = 1;"), 0, "names that only end alike");
}

fn source_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Whether the file is a module that its folder's `mod.rs` declares under `#[cfg(test)]`.
fn is_test_module(file: &Path) -> bool {
    let parent = file.with_file_name("mod.rs");
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if !parent.is_file() || parent == file {
        return false;
    }
    let code = without_comments_and_strings(&read(&parent));
    let declaration = format!("mod {name};");
    code.contains(&declaration) && !without_tests(&code).contains(&declaration)
}

fn allowed(room: &str) -> Option<&'static [&'static str]> {
    TABLE.iter().find(|(name, _)| *name == room).map(|(_, imports)| *imports)
}

/// What is wrong with the imports of one file, `path` being relative to `src`.
fn check(path: &Path, text: &str) -> Vec<String> {
    let place = format!("src/{}", path.display());
    let room = path.components().next().map(|c| c.as_os_str().to_string_lossy().into_owned()).unwrap_or_default();
    let Some(imports) = allowed(&room) else {
        return vec![format!("{place}:1: `{room}` is no room of the table")];
    };
    let code = without_tests(&without_comments_and_strings(text));
    let mut wrong: Vec<_> = imported(&code, depth(path))
        .into_iter()
        .filter(|(_, name)| *name != room && !imports.contains(&name.as_str()))
        .map(|(at, name)| (code[..at].matches('\n').count() + 1, name))
        .collect();
    wrong.sort();
    wrong.iter().map(|(line, name)| format!("{place}:{line}: {room} may not import {name}")).collect()
}

/// How many `super` lead from the file's module to the root of the crate.
fn depth(path: &Path) -> usize {
    path.components().count() - usize::from(path.file_name().is_some_and(|name| name == "mod.rs"))
}

/// Position and name of every path's first segment below the root of the crate.
fn imported(code: &str, depth: usize) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (at, word) in words(code) {
        let rest = &code[at + word.len()..];
        match word {
            "crate" if code[..at].ends_with("pub(") => {}
            "crate" | "goniofit" => match after_colons(rest) {
                Some(tail) => found.extend(first_segments(tail).map(|name| (at, name))),
                None if word == "crate" => found.push((at, "the whole crate".into())),
                None => {}
            },
            "super" if !code[..at].trim_end().ends_with("::") => {
                let (supers, tail) = climb(rest);
                // Modules inside of a file need further steps up, and stay in the room.
                let rooms = |name: &String| allowed(name).is_some();
                if supers >= depth {
                    found.extend(first_segments(tail).filter(rooms).map(|name| (at, name)));
                }
            }
            _ => {}
        }
    }
    found
}

/// Counts `super` (the first being already read) and returns what follows the last `::`.
fn climb(mut rest: &str) -> (usize, &str) {
    let mut supers = 1;
    while let Some(tail) = after_colons(rest) {
        let Some(further) = tail.strip_prefix("super") else { return (supers, tail) };
        supers += 1;
        rest = further;
    }
    (supers, "")
}

fn after_colons(rest: &str) -> Option<&str> {
    rest.trim_start().strip_prefix("::").map(str::trim_start)
}

/// The names that a path goes on with: one, or those at the top level of `{…}`.
fn first_segments(tail: &str) -> impl Iterator<Item = String> {
    let name = |text: &str| {
        let end = text.find(|c: char| !is_word(c)).unwrap_or(text.len());
        if text.starts_with('*') { "everything (*)".to_owned() } else { text[..end].to_owned() }
    };
    let mut names = Vec::new();
    if tail.starts_with('{') {
        let (mut level, mut expect) = (0, false);
        for (at, c) in tail.char_indices() {
            match c {
                '{' => (level, expect) = (level + 1, level == 0),
                '}' if level == 1 => break,
                '}' => level -= 1,
                ',' => expect = level == 1,
                c if expect && !c.is_whitespace() => {
                    names.push(name(&tail[at..]));
                    expect = false;
                }
                _ => {}
            }
        }
    } else {
        names.push(name(tail));
    }
    names.into_iter()
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Every identifier or keyword with its position.
fn words(code: &str) -> impl Iterator<Item = (usize, &str)> {
    code.split(|c: char| !is_word(c)).filter(|word| !word.is_empty()).map(|word| (offset(code, word), word))
}

fn offset(code: &str, part: &str) -> usize {
    part.as_ptr() as usize - code.as_ptr() as usize
}

/// The text with comments, strings and character literals blanked; lines stay where they are.
fn without_comments_and_strings(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let skipped = literal_or_comment(rest, kept.chars().next_back());
        let (taken, tail) = rest.split_at(skipped.unwrap_or(c.len_utf8()));
        if skipped.is_some() {
            kept.extend(taken.chars().filter(|c| *c == '\n'));
            kept.push(' ');
        } else {
            kept.push_str(taken);
        }
        rest = tail;
    }
    kept
}

/// Length of the comment, string or character literal with which the text begins, if it does.
fn literal_or_comment(text: &str, before: Option<char>) -> Option<usize> {
    let in_word = before.is_some_and(is_word);
    if text.starts_with("//") {
        Some(text.find('\n').unwrap_or(text.len()))
    } else if text.starts_with("/*") {
        Some(block_comment(text))
    } else if text.starts_with('"') {
        Some(quoted(text))
    } else if text.starts_with('r') && !in_word {
        raw_string(text)
    } else if text.starts_with('\'') {
        character(text)
    } else {
        None
    }
}

fn block_comment(text: &str) -> usize {
    let (mut level, mut at) = (0, 0);
    while at < text.len() {
        let rest = &text[at..];
        let step = if rest.starts_with("/*") {
            level += 1;
            2
        } else if rest.starts_with("*/") {
            level -= 1;
            2
        } else {
            rest.chars().next().map_or(1, char::len_utf8)
        };
        at += step;
        if level == 0 {
            return at;
        }
    }
    text.len()
}

fn quoted(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

fn raw_string(text: &str) -> Option<usize> {
    let hashes = text[1..].chars().take_while(|c| *c == '#').count();
    let body = 1 + hashes;
    text[body..].starts_with('"').then(|| {
        let end = format!("\"{}", "#".repeat(hashes));
        text[body + 1..].find(&end).map_or(text.len(), |at| body + 1 + at + end.len())
    })
}

/// A character literal, as against a lifetime.
fn character(text: &str) -> Option<usize> {
    let mut chars = text.char_indices().skip(1);
    let (_, first) = chars.next()?;
    if first == '\\' {
        return text[3..].find('\'').map(|at| 3 + at + 1);
    }
    let (at, second) = chars.next()?;
    (second == '\'').then_some(at + 1)
}

/// The code (free of comments and strings) with every item under `#[cfg(test)]` blanked.
fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let mut kept = String::with_capacity(code.len());
    let mut rest = code;
    while let Some(at) = rest.find(MARK) {
        kept.push_str(&rest[..at]);
        let item = &rest[at + MARK.len()..];
        let end = item_end(item);
        kept.extend(item[..end].chars().filter(|c| *c == '\n'));
        rest = &item[end..];
    }
    kept.push_str(rest);
    kept
}

/// Where the item with which the code begins ends: at its closing brace, or at a semicolon outside of every brace (an import's
/// group is followed by one).
fn item_end(code: &str) -> usize {
    let is_import = code.split_whitespace().take(3).any(|word| word == "use");
    let mut level = 0;
    for (at, c) in code.char_indices() {
        match c {
            '{' | '(' | '[' => level += 1,
            '}' | ')' | ']' => {
                level -= 1;
                if level == 0 && c == '}' && !is_import {
                    return at + 1;
                }
            }
            ';' if level == 0 => return at + 1,
            _ => {}
        }
    }
    code.len()
}
