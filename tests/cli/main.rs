//! The `goniofit` command as a user meets it: files, streams, exit codes. The contract is the command line, not the library.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)] // helpers of tests

mod adaptive;
mod bench;
mod careful;
mod chain;
mod compare;
mod effects;
mod failures;
mod fit_file;
mod fit_options;
mod help;
mod instruments;
#[cfg(unix)]
mod interrupt;
mod json;
mod materials;
mod merl;
mod outputs;
mod plan;
mod plot;
mod real_files;
mod report;
mod scenes;
mod shell;
mod streams;
mod terminal;
mod threads;
mod through;
mod tradeoff;
