//! `goniofit completions`: what a shell needs to complete the command line.

use clap::CommandFactory;
use clap_complete::Shell;
use serde_json::json;

use super::Cli;
use super::ui::Ui;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit completions bash > ~/.local/share/bash-completion/completions/goniofit
  goniofit completions zsh > ~/.zfunc/_goniofit
  goniofit completions fish > ~/.config/fish/completions/goniofit.fish")]
pub(super) struct Args {
    /// The shell
    shell: Shell,
}

pub(super) fn run(args: &Args, ui: &Ui) {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "goniofit", &mut script);
    let script = String::from_utf8_lossy(&script);
    ui.result(&script, &json!({ "shell": args.shell.to_string(), "script": script }));
}
