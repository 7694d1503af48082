//! Redrawn instruments, noted line by line as they end, so that a study of hours may be stopped and go on.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::sync::Mutex;

use serde::{Deserialize, Serialize};

use super::experiment::{Experiment, Outcome};

/// One line of the file.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    instrument: String,
    material: String,
    seed: u64,
    outcome: Outcome,
}

/// What was noted so far, and where more goes.
pub struct Journal {
    known: HashMap<(String, String, u64), Outcome>,
    file: Option<Mutex<File>>,
}

/// That of one instrument and one material.
pub struct Cell<'a> {
    journal: &'a Journal,
    instrument: &'a str,
    material: &'a str,
    of: &'a Experiment,
}

impl Journal {
    /// Reads the file, where one is named, and goes on at its end. A last line that is not whole, of a run that was ended within it, does not count.
    pub fn open(path: Option<&str>) -> Self {
        let Some(path) = path else { return Self { known: HashMap::new(), file: None } };
        let mut file = OpenOptions::new().create(true).append(true).read(true).open(path).expect("the journal opens");
        let (mut known, mut whole) = (HashMap::new(), 0);
        let mut lines = BufReader::new(&file);
        let mut line = String::new();
        while lines.read_line(&mut line).expect("the journal is text") > 0 && line.ends_with('\n') {
            let entry: Entry = serde_json::from_str(&line).unwrap_or_else(|e| panic!("{path}: {e}: {line}"));
            known.insert((entry.instrument, entry.material, entry.seed), entry.outcome);
            whole += line.len() as u64;
            line.clear();
        }
        file.set_len(whole).expect("the journal can be cut");
        file.flush().expect("the journal can be written");
        Self { known, file: Some(Mutex::new(file)) }
    }

    /// The instruments of one cell. Where some are known the first of them is redrawn: another state of the program may come to other numbers, which
    /// can't stand in one row with these.
    pub fn cell<'a>(&'a self, instrument: &'a str, material: &'a str, of: &'a Experiment) -> Cell<'a> {
        let cell = Cell { journal: self, instrument, material, of };
        let first = self.known.keys().filter(|key| key.0 == instrument && key.1 == material).map(|key| key.2).min();
        if let Some(seed) = first {
            let noted = cell.known(seed).expect("it is known");
            assert_eq!(
                *noted,
                of.outcome(seed),
                "{instrument}, {material}: the journal is of another state of the program"
            );
        }
        cell
    }
}

impl Cell<'_> {
    fn known(&self, seed: u64) -> Option<&Outcome> {
        self.journal.known.get(&(self.instrument.to_owned(), self.material.to_owned(), seed))
    }

    /// Noted, or redrawn and noted.
    pub fn outcome(&self, seed: u64) -> Outcome {
        if let Some(known) = self.known(seed) {
            return known.clone();
        }
        let outcome = self.of.outcome(seed);
        if let Some(file) = &self.journal.file {
            let (instrument, material) = (self.instrument.to_owned(), self.material.to_owned());
            let entry = Entry { instrument, material, seed, outcome: outcome.clone() };
            let line = serde_json::to_string(&entry).expect("it is plain data") + "\n";
            file.lock()
                .expect("no panic while writing")
                .write_all(line.as_bytes())
                .expect("the journal can be written");
        }
        outcome
    }
}
