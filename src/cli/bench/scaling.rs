//! Sweeps with `[[series]]`.

use mesoshell::bench::scaling::{Outcome, Results, Sweep, is_scaling};
use mesoshell::{Error, Result};

use super::Arguments;
use crate::cli::Talk;

/// The sweep, if the one file that is named is of this kind.
///
/// # Errors
/// [`Error::Text`], and [`Error::Usage`] for options that have no meaning here.
pub fn sweep(arguments: &Arguments) -> Result<Option<Sweep>> {
    let [file] = arguments.files.as_slice() else { return Ok(None) };
    if !is_scaling(file) {
        return Ok(None);
    }
    let levels_given = arguments.steps.is_some() || arguments.samples.is_some() || arguments.exact;
    if levels_given || arguments.resume || arguments.baseline.is_some() || arguments.cache.is_some() {
        return Err(Error::Usage {
            message: "a sweep of scaling compares with no reference, and says itself what is measured"
                .to_owned(),
            help: Some("leave out --steps, --samples, --exact, --resume, --cache and --baseline".to_owned()),
        });
    }
    let mut sweep = Sweep::load(file)?;
    sweep.runs = arguments.runs.unwrap_or(sweep.runs);
    sweep.define.extend(arguments.define.iter().cloned());
    Ok(Some(sweep))
}

/// Prints what was found.
///
/// # Errors
/// [`Error::Output`].
pub fn tell(outcome: &Outcome, talk: Talk) -> Result<()> {
    for warning in &outcome.warnings {
        talk.warn(warning);
    }
    talk.result(&outcome.results, || {
        let Outcome { results, report, .. } = outcome;
        format!("{}\n{}\n{}", points(results), slopes(results), report.display())
    })
}

/// A line for each series and size, in Markdown.
fn points(results: &Results) -> String {
    let mut table = "| series | of | size | frame (ms) | memory (MiB) |\n|---|---|---|---|---|\n".to_owned();
    for series in &results.series {
        for point in &series.points {
            let memory = point.memory.map_or_else(|| "-".to_owned(), |bytes| (bytes >> 20).to_string());
            table += &format!(
                "| {} | {} | {} | {:.1} | {memory} |\n",
                series.name,
                series.of.name(),
                point.size,
                point.frame.median
            );
        }
    }
    table
}

/// A line for each series and stage.
fn slopes(results: &Results) -> String {
    let mut table = "| series | stage | slope |\n|---|---|---|\n".to_owned();
    for series in &results.series {
        for growth in &series.growth {
            table += &format!("| {} | {} | {:.2} |\n", series.name, growth.stage, growth.slope);
        }
    }
    table
}
