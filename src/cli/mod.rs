//! The command line: one file per subcommand, each from arguments as typed to a validated plan, to the work, to what is printed.
//!
//! In: arguments. Out: text or one JSON object on stdout, progress and warnings on stderr, an exit code: 0 done, 1 the work
//! failed, 2 the command line or an input file is wrong, 130 stopped by Ctrl-C. The one decision to know: nothing is printed on
//! stdout but a command's result, so `--json` output can always be parsed.

mod compare;
mod comparison;
mod completions;
mod convert;
mod costs;
mod demo;
mod effects;
mod failure;
mod fit;
mod info;
mod instrument;
mod instruments;
mod man;
mod models;
mod output;
mod plan;
mod plot;
mod reduce;
mod render;
mod report;
mod scenes;
mod simulate;
mod simulation;
mod text;
mod tradeoff;
mod ui;
mod validate;
mod welcome;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;
use ui::Ui;

const EXAMPLES: &str = "Examples:
  goniofit demo                                   the whole chain, no input needed
  goniofit fit gold.binary --out gold.json        fit lambert+phong to a MERL table
  goniofit validate gold.binary gold.json --out gold/   render both, compare";

/// Measured-BRDF fitting: simulate a gonioreflectometer, fit analytic models, render and compare.
#[derive(Debug, Parser)]
#[command(name = "goniofit", version, after_help = EXAMPLES, max_term_width = 100)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Args)]
struct Global {
    /// Print one JSON object on stdout and nothing else there
    #[arg(long, global = true)]
    json: bool,
    /// No progress, no notes
    #[arg(long, global = true)]
    quiet: bool,
    /// Number of threads (default: all cores); the result does not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run the whole chain on a built-in material: measure, fit, render, compare
    Demo(demo::Args),
    /// Measure a material by the simulated gonioreflectometer
    Simulate(simulate::Args),
    /// Reduce raw readings to a measurement: BRDF ± σ, with what readings share
    Reduce(reduce::Args),
    /// Propose where to measure, for a budget of instrument hours
    Plan(plan::Args),
    /// Say which effects a simulation calls for, why, what each costs and what is off without it
    Effects(effects::Args),
    /// Say what is in a measurement
    Info(info::Args),
    /// Fit an analytic model to each measurement
    Fit(fit::Args),
    /// Render a scene
    Render(render::Args),
    /// Render a table and its fits alike, and report the difference
    Validate(validate::Args),
    /// Compare two pictures
    Compare(compare::Args),
    /// Put a run on one HTML page: measurement, fits, pictures, numbers
    Report(report::Args),
    /// Draw a figure as SVG or PNG: lobes, slices, residuals, coverage, curves of a tradeoff
    Plot(plot::Args),
    /// Convert between measurement formats, or sample a fit onto a grid
    Convert(convert::Args),
    /// Say what accuracy costs in time, and which setting a wanted error or time takes
    Tradeoff(tradeoff::Args),
    /// List the models and built-in materials
    Models(models::Args),
    /// List the built-in scenes, or print one as a file to start from
    Scenes(scenes::Args),
    /// List the built-in instruments, or print one as a file to start from
    Instruments(instruments::Args),
    /// Print what a shell needs to complete this program's command lines
    Completions(completions::Args),
    /// Print the manual page of a command, for man(1)
    Man(man::Args),
}

/// Runs the command that the process was started with.
#[must_use]
pub fn main() -> ExitCode {
    if std::env::args_os().len() < 2 {
        Ui::new(false, false).result(welcome::TEXT, &serde_json::Value::Null);
        return ExitCode::from(u8::from(ui::lost_output()));
    }
    let wants_json = std::env::args_os().any(|a| a == "--json");
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if wants_json && error.use_stderr() => {
            return ui::report_failure(&Failure::usage(error.to_string().trim()), true);
        }
        Err(error) => {
            let code = if error.use_stderr() { 2 } else { 0 };
            let _ = error.print(); // a closed pipe is no error
            return ExitCode::from(code);
        }
    };
    if let Some(threads) = cli.global.threads {
        // Fails only where a pool exists already, and none does.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let ui = Ui::new(cli.global.json, cli.global.quiet);
    match run(cli.command, &ui) {
        Ok(()) if ui::lost_output() => ExitCode::from(1),
        Ok(()) if ui::stop().requested() => ExitCode::from(130),
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) if ui::stop().requested() => ui::report_failure(&failure.while_stopping(), cli.global.json),
        Err(failure) => ui::report_failure(&failure, cli.global.json),
    }
}

fn run(command: Command, ui: &Ui) -> Result<(), Failure> {
    ui::install_stop();
    match command {
        Command::Demo(args) => demo::run(&args, ui),
        Command::Simulate(args) => simulate::run(&args, ui),
        Command::Reduce(args) => reduce::run(&args, ui),
        Command::Plan(args) => plan::run(&args, ui),
        Command::Effects(args) => effects::run(&args, ui),
        Command::Info(args) => info::run(&args, ui),
        Command::Fit(args) => fit::run(&args, ui),
        Command::Render(args) => render::run(&args, ui),
        Command::Validate(args) => validate::run(&args, ui),
        Command::Compare(args) => compare::run(&args, ui),
        Command::Report(args) => report::run(&args, ui),
        Command::Plot(args) => plot::run(&args, ui),
        Command::Convert(args) => convert::run(&args, ui),
        Command::Tradeoff(args) => tradeoff::run(&args, ui),
        Command::Models(args) => models::run(&args, ui),
        Command::Scenes(args) => scenes::run(&args, ui),
        Command::Instruments(args) => instruments::run(&args, ui),
        Command::Completions(args) => {
            completions::run(&args, ui);
            Ok(())
        }
        Command::Man(args) => man::run(&args, ui),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        super::Cli::command().debug_assert();
    }
}
