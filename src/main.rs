//! The `goniofit` command.

fn main() -> std::process::ExitCode {
    goniofit::cli::main()
}
