//! Sweeps with a section `[antialiasing]`.

use mesoshell::bench::antialiasing::{Outcome, Results, Sweep, is_antialiasing};
use mesoshell::{Error, Result};

use super::Arguments;
use crate::cli::Talk;

/// The sweep, if the one file that is named is of this kind.
///
/// # Errors
/// [`Error::Text`], and [`Error::Usage`] for options that have no meaning here.
pub fn sweep(arguments: &Arguments) -> Result<Option<Sweep>> {
    let [file] = arguments.files.as_slice() else { return Ok(None) };
    if !is_antialiasing(file) {
        return Ok(None);
    }
    let levels_given = arguments.steps.is_some() || arguments.samples.is_some() || arguments.exact;
    if levels_given || arguments.runs.is_some() || arguments.resume || arguments.baseline.is_some() {
        return Err(Error::Usage {
            message: "a sweep of antialiasing takes no time, and says itself what is measured".to_owned(),
            help: Some("leave out --steps, --samples, --exact, --runs, --resume and --baseline".to_owned()),
        });
    }
    let mut sweep = Sweep::load(file)?;
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
        format!("{}\n{}\n{}", points(results), means(results), report.display())
    })
}

/// A line for each scene, distance and filter, in Markdown.
fn points(results: &Results) -> String {
    let mut table = "| scene | distance | level | filter | RMSE | 99.9 % | FLIP | bias |\n".to_owned();
    table += "|---|---|---|---|---|---|---|---|\n";
    for scene in &results.scenes {
        for picture in &scene.pictures {
            for point in &picture.points {
                table += &format!(
                    "| {} | {} | {:.1} | {} | {:.1e} | {:.1e} | {:.1e} | {:+.1} % |\n",
                    scene.name(),
                    picture.distance,
                    picture.level,
                    point.filter.name(),
                    point.error.rmse,
                    point.error.p999,
                    point.error.flip,
                    100.0 * point.bias
                );
            }
        }
    }
    table
}

/// A line for each filter: the geometric mean of the scenes' RMSE from each distance, and from all.
fn means(results: &Results) -> String {
    let distances: Vec<String> = results.sweep.distances.iter().map(f64::to_string).collect();
    let rule = "---|".repeat(distances.len() + 2);
    let mut table = format!("| filter | {} | all |\n|{rule}\n", distances.join(" | "));
    for mean in &results.means {
        let errors: Vec<String> =
            mean.by_distance.iter().chain([&mean.rmse]).map(|rmse| format!("{rmse:.1e}")).collect();
        table += &format!("| {} | {} |\n", mean.filter.name(), errors.join(" | "));
    }
    table
}
