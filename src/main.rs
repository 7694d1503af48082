//! The `goniofit` command.

fn main() {}
