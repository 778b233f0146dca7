//! The command line: see `mesoshell --help`.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
