//! The report as a browser shows it: it loads nothing, its controls do what they say, it fits phones and desks, and it can be read by those who
//! can't see it. Without a browser (Chromium or Chrome) these tests say so and pass.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)] // helpers of tests
#![allow(clippy::needless_pass_by_value)] // messages are made where they are sent

mod accessible;
mod browser;
mod command;
mod controls;
mod layout;
mod loading;
mod others;
mod run;
