//! The command line: what it accepts, what it prints, and with which exit code it ends. One file a subcommand.
//!
//! Standard output carries the result alone, standard error progress, warnings and errors.

mod accuracy;
mod animate_check;
mod bench;
mod devices;
mod diff;
mod frames;
mod gallery;
mod mesh;
mod opening;
mod output;
mod progress;
mod render;
mod stress;
mod volume;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use mesoshell::Error;

const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    diff: the images differ by more than --threshold; stress: a case fails;
       render --verify: the error is above --max-error;
       gallery: a scene's error is above its bound;
       animate-check: a frame has a fault;
       bench --baseline: a speed-up has fallen
  2    the request makes no sense (an unknown option, a bad -D)
  3    an input file is missing, damaged or means something impossible
  4    no usable Vulkan device
  5    out of memory, the machine's or the device's
  6    a result cannot be written
  130  interrupted
  143  ended by SIGTERM";

/// Renders semi-transparent 3D textures mapped into a shell around a triangle mesh.
#[derive(Parser)]
#[command(version, after_help = EXIT_CODES)]
struct Cli {
    #[command(flatten)]
    talk: Talk,
    #[command(subcommand)]
    command: Command,
}

/// How results and progress are told.
#[derive(Args, Clone, Copy)]
struct Talk {
    /// Print the result as JSON
    #[arg(long, global = true)]
    json: bool,
    /// Print nothing but errors
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Command {
    Render(render::Arguments),
    Devices(devices::Arguments),
    /// Tell about meshes
    #[command(subcommand)]
    Mesh(mesh::Command),
    /// Tell about volumes
    #[command(subcommand)]
    Volume(volume::Command),
    Diff(diff::Arguments),
    Bench(bench::Arguments),
    Gallery(gallery::Arguments),
    Stress(stress::Arguments),
    AnimateCheck(animate_check::Arguments),
}

/// Runs what the arguments of this process ask for.
pub fn run() -> ExitCode {
    // Lines are wrapped for a terminal alone: a path in a log file stays in one piece.
    let wrap = std::io::stderr().is_terminal();
    let handler = move |_: &_| -> Box<dyn miette::ReportHandler> {
        Box::new(miette::MietteHandlerOpts::new().wrap_lines(wrap).break_words(false).build())
    };
    miette::set_hook(Box::new(handler)).expect("no other hook has been set");

    let Cli { talk, command } = Cli::parse();
    start_threads();
    let done = match command {
        Command::Render(arguments) => render::run(arguments, talk),
        Command::Devices(arguments) => devices::run(arguments, talk).map(|()| ExitCode::SUCCESS),
        Command::Mesh(command) => mesh::run(command, talk).map(|()| ExitCode::SUCCESS),
        Command::Volume(command) => volume::run(command, talk).map(|()| ExitCode::SUCCESS),
        Command::Diff(arguments) => diff::run(arguments, talk),
        Command::Bench(arguments) => bench::run(arguments, talk),
        Command::Gallery(arguments) => gallery::run(arguments, talk),
        Command::Stress(arguments) => stress::run(arguments, talk),
        Command::AnimateCheck(arguments) => animate_check::run(arguments, talk),
    };
    done.unwrap_or_else(|error| {
        let code = match error {
            Error::Interrupted => progress::exit_code_of_interrupt(),
            _ => error.exit_code(),
        };
        output::complain(&format!("{:?}", miette::Report::new(error)));
        code.into()
    })
}

/// A table of names and values, the values aligned.
fn table<'a>(rows: impl IntoIterator<Item = (&'a str, String)>) -> String {
    let rows: Vec<_> = rows.into_iter().collect();
    let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    let lines = rows.iter().map(|(name, value)| format!("  {name:width$}  {value}\n"));
    lines.collect()
}

/// Starts the pool of threads for all parallel work, a core for each. Left to themselves they may wake, after each pause, on the core
/// that has just fallen asleep for them, and take turns on it while the other stands idle: CPU stages then take twice as long.
fn start_threads() {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    let mut pool = rayon::ThreadPoolBuilder::new();
    // Where fewer are asked for, or allowed, the system knows better which.
    let is_asked = std::env::var_os("RAYON_NUM_THREADS").is_some();
    if !is_asked && std::thread::available_parallelism().is_ok_and(|allowed| allowed.get() == cores.len()) {
        pool = pool.num_threads(cores.len()).start_handler(move |thread| {
            core_affinity::set_for_current(cores[thread]);
        });
    }
    if let Err(error) = pool.build_global() {
        // Work that is parallel then starts the pool by itself, or says why it cannot.
        output::complain(&format!("warning: no thread could be started for each core: {error}"));
    }
}
