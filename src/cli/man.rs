//! `goniofit man`: the manual, a page a command.

use clap::CommandFactory;
use serde_json::json;

use super::Cli;
use super::failure::Failure;
use super::ui::Ui;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit man > ~/.local/share/man/man1/goniofit.1
  goniofit man fit > ~/.local/share/man/man1/goniofit-fit.1")]
pub(super) struct Args {
    /// The command; the program itself where none is said
    command: Option<String>,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let mut program = Cli::command();
    program.build();
    let found = match &args.command {
        None => program,
        Some(name) => page_of(&program, name)?,
    };
    let mut page = Vec::new();
    clap_mangen::Man::new(found).render(&mut page).map_err(|e| Failure::work(e.to_string()))?;
    let page = String::from_utf8_lossy(&page);
    ui.result(&page, &json!({ "command": args.command, "page": page }));
    Ok(())
}

/// A command of the program.
fn page_of(program: &clap::Command, name: &str) -> Result<clap::Command, Failure> {
    let known = || program.get_subcommands().map(clap::Command::get_name).collect::<Vec<_>>().join(", ");
    let found = program.find_subcommand(name).cloned();
    found.ok_or_else(|| Failure::usage(format!("expected a command out of {}, found {name}", known())))
}
