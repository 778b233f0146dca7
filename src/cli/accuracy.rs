//! `render --max-error`: the error that the user accepts, what was chosen for it, and what came of it.

use std::path::{Path, PathBuf};

use clap::Args;
use mesoshell::bench::pilot::{self, Estimate, Trial};
use mesoshell::fingerprint::Fingerprint;
use mesoshell::frame::Image;
use mesoshell::method::{Entry, Setup};
use mesoshell::scene::{March, Scene};
use mesoshell::{Error, Result, bench, metric, reference};
use serde::Serialize;

/// What is said of the error.
#[derive(Args)]
pub struct Arguments {
    /// Choose the coarsest march whose RMSE (linear premultiplied RGBA, against the reference) is at most E, in place of
    /// the scene's
    #[arg(long, value_name = "E", value_parser = error_bound)]
    max_error: Option<f64>,
    /// With --max-error: render the reference too, and tell the error there is; exit code 1 where it is above E
    #[arg(long, requires = "max_error")]
    verify: bool,
    /// With --max-error: the folder of what is known from earlier runs, by default `mesoshell` in the user's cache
    #[arg(long, value_name = "DIR", requires = "max_error")]
    cache: Option<PathBuf>,
}

impl Arguments {
    /// Whether an error is accepted.
    pub fn is_used(&self) -> bool {
        self.max_error.is_some()
    }

    /// Whether `--max-error` goes with the rest.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self, method: &str, define: &[String]) -> Result<()> {
        let usage = |message: String, help: &str| Err(Error::Usage { message, help: Some(help.to_owned()) });
        if self.max_error.is_none() {
            return Ok(());
        }
        if method == "reference" {
            return usage(
                "the reference has no march to choose".to_owned(),
                "leave out --max-error, or --method",
            );
        }
        // Where rays end is not chosen, but for a limit.
        let is_of_march = |define: &&String| {
            let key = define.split('=').next().unwrap_or_default();
            let mut parts = key.split('.').map(str::trim);
            parts.next() == Some("march") && parts.next() != Some("end_below")
        };
        match define.iter().find(is_of_march) {
            Some(define) => usage(
                format!("--max-error chooses the march, and so does -D {define}"),
                "leave out one of the two",
            ),
            None => Ok(()),
        }
    }

    /// The march for the scene's own view; `None` without `--max-error`.
    ///
    /// # Errors
    /// As [`pilot::choose`].
    pub fn choose(&self, scene: &Scene, method: &Entry, setup: &Setup<'_>) -> Result<Option<Choice>> {
        let Some(max_error) = self.max_error else { return Ok(None) };
        let (cache, warning) = match &self.cache {
            Some(cache) => (Some(cache.clone()), None),
            None => usable(cache_folder()),
        };
        let choice = pilot::choose(scene, max_error, method, cache.as_deref(), setup)?;
        Ok(Some(Choice { max_error, choice, verify: self.verify, cache, warning }))
    }
}

/// The march that was chosen, and what is still to be done about it.
pub struct Choice {
    max_error: f64,
    choice: pilot::Choice,
    verify: bool,
    cache: Option<PathBuf>,
    /// What the user should know.
    pub warning: Option<String>,
}

impl Choice {
    /// The scene as it is to be rendered.
    pub fn apply(&self, scene: &mut Scene) {
        self.choice.apply(scene);
    }

    /// What came of it: verified, if that was asked for.
    ///
    /// # Errors
    /// As [`reference::render`], and [`Error::Output`] where the reference cannot be kept.
    pub fn accuracy(self, scene: &Scene, image: &Image, setup: &Setup<'_>) -> Result<Accuracy> {
        let Self {
            max_error,
            choice: pilot::Choice { trial: Trial { march, error }, measured, end_below },
            verify,
            cache,
            warning: _,
        } = self;
        let verified = verify.then(|| error_of(scene, image, cache.as_deref(), setup)).transpose()?;
        Ok(Accuracy { max_error, march, end_below, estimate: error, measured, verified })
    }
}

/// How accurate the picture was to be, and is.
#[derive(Serialize)]
pub struct Accuracy {
    /// The RMSE accepted.
    max_error: f64,
    /// What was chosen.
    march: March,
    /// Where its rays end: the scene's, unless that was too much.
    end_below: f64,
    /// Its RMSE, estimated from some of the pixels.
    estimate: Estimate,
    /// Marches measured to choose it; 0 where all was known.
    measured: usize,
    /// With `--verify`: the RMSE against the reference at every pixel.
    pub verified: Option<f64>,
}

impl Accuracy {
    /// Whether nothing is known against it.
    pub fn is_kept(&self) -> bool {
        self.verified.is_none_or(|rmse| rmse <= self.max_error)
    }

    /// A line for people.
    pub fn told(&self) -> String {
        let Self {
            max_error, march, end_below, estimate: Estimate { rmse, standard_error }, verified, ..
        } = self;
        let verified = match verified {
            Some(rmse) if self.is_kept() => format!("; verified: {rmse:.2e}"),
            Some(rmse) => format!("; but it is {rmse:.2e}"),
            None => String::new(),
        };
        format!(
            "{march}, rays end below {end_below:.1e}: RMSE {rmse:.2e} estimated, give or take {standard_error:.0e}, of {max_error:e}{verified}\n"
        )
    }
}

/// The RMSE of a picture against the reference at every pixel.
fn error_of(scene: &Scene, image: &Image, cache: Option<&Path>, setup: &Setup<'_>) -> Result<f64> {
    let (progress, interrupt) = (setup.progress.as_ref(), setup.interrupt);
    let exact = match cache {
        Some(cache) => {
            let fingerprint = Fingerprint::of_reference(scene, &scene.view, 1);
            // Of a damaged file there is no more to say than that it was computed again.
            let mut damaged = Vec::new();
            bench::cache::reference(scene, 1, &fingerprint, cache, &mut damaged, progress, interrupt)?.image
        }
        None => reference::render(scene, &scene.view, progress, interrupt)?.image,
    };
    Ok(metric::compare(image, &exact)?.rmse)
}

/// `mesoshell` in the folder where the user's programs keep what can be computed again.
fn cache_folder() -> Option<PathBuf> {
    let given = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).filter(|folder| folder.is_absolute());
    let folder = given.or_else(|| Some(std::env::home_dir()?.join(".cache")))?;
    Some(folder.join("mesoshell"))
}

/// The folder, if files can be made there; else a warning.
fn usable(folder: Option<PathBuf>) -> (Option<PathBuf>, Option<String>) {
    let Some(folder) = folder else {
        return (None, Some("there is no cache folder: what was learnt of this view is not kept".to_owned()));
    };
    match std::fs::create_dir_all(&folder).and_then(|()| tempfile::tempfile_in(&folder)) {
        Ok(_) => (Some(folder), None),
        Err(error) => {
            let folder = folder.display();
            (
                None,
                Some(format!("{folder}: {error}; what was learnt of this view is not kept, name a --cache")),
            )
        }
    }
}

fn error_bound(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(bound) if bound > 0.0 && bound.is_finite() => Ok(bound),
        _ => Err("expected a number above 0, such as 1e-3".to_owned()),
    }
}
