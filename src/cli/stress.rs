//! `mesoshell stress`: cases that are hard on floating-point numbers, each against its bound.

use std::process::ExitCode;
use std::sync::Arc;

use clap::Args;
use mesoshell::gpu::DeviceChoice;
use mesoshell::method::Setup;
use mesoshell::progress::{Interrupt, Progress, Silent};
use mesoshell::stress::{Extent, Outcome, Stand, cases};
use mesoshell::{Error, Result};

use super::Talk;
use super::progress::{Line, listen};

/// Test numerical stability: hostile meshes, rays, media and scales, each against a derived bound
#[derive(Args)]
pub struct Arguments {
    /// Only cases whose name contains this; may be given more than once
    #[arg(long, value_name = "NAME")]
    filter: Vec<String>,
    /// Fewer views, smaller pictures, fewer runs
    #[arg(long)]
    quick: bool,
    /// The device: its number in `mesoshell devices`, a part of its name, or its UUID
    #[arg(long)]
    device: Option<DeviceChoice>,
}

/// Exit code 1 where a case fails.
///
/// # Errors
/// [`Error::Usage`] where no case has such a name; whatever stands between a case and its pictures.
pub fn run(arguments: Arguments, talk: Talk) -> Result<ExitCode> {
    let Arguments { filter, quick, device } = arguments;
    let is_wanted = |name: &str| filter.is_empty() || filter.iter().any(|part| name.contains(part.as_str()));
    let wanted: Vec<_> = cases().filter(|case| is_wanted(case.name)).collect();
    if wanted.is_empty() {
        let names: Vec<_> = cases().map(|case| case.name).collect();
        return Err(Error::Usage {
            message: format!("no case is called `{}`", filter.join("`, `")),
            help: Some(format!("there are {}", names.join(", "))),
        });
    }

    let interrupt = Interrupt::default();
    listen(&interrupt);
    let line = Line::new(talk);
    // The stages of each picture are too many to tell.
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let device = device.unwrap_or_default();
    let stand = Stand {
        setup: Setup { device: &device, validation: None, progress: &silent, interrupt: &interrupt },
        extent: if quick { Extent::Quick } else { Extent::Full },
    };
    let mut outcomes = Vec::new();
    for case in wanted {
        line.stage(case.name);
        outcomes.push(case.run(&stand)?);
    }
    drop(line); // The progress line is wiped before anything else is said.
    talk.result(&outcomes, || table(&outcomes))?;
    let all_passed = outcomes.iter().all(|outcome| outcome.passed);
    Ok(if all_passed { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn table(outcomes: &[Outcome]) -> String {
    let mut table = "| case | measured | bound | worst | |\n|---|---|---|---|---|\n".to_owned();
    for Outcome { case, measure, bound, worst, passed } in outcomes {
        let verdict = if *passed { "pass" } else { "FAIL" };
        table += &format!("| {case} | {measure} | {bound:.1e} | {worst:.1e} | {verdict} |\n");
    }
    table
}
