//! Measurements: run time against error.
//!
//! A [`Sweep`] says which scenes are measured at which [`Setting`]s; [`run()`] measures it, and writes what it found as
//! JSON, CSV and a report in HTML. Times are taken in rounds over all points of a scene ([`mod@measure`]), errors against
//! the f64 reference, whose pictures are kept in a [`cache`]. `docs/bench.md` describes the files key by key. The [`pilot`]
//! chooses a march by the error that is accepted; [`antialiasing`] compares filters; [`scaling`] tells how time grows
//! with what a scene has; a [`gallery`] shows many scenes.

pub mod antialiasing;
pub mod cache;
pub mod convergence;
pub mod environment;
pub(crate) mod file;
pub mod fingerprint;
mod fit;
pub mod gallery;
pub mod measure;
pub mod pareto;
pub mod pilot;
mod remaining;
pub mod report;
pub mod results;
mod run;
pub mod scaling;
mod speedup;
pub mod sweep;

pub use environment::Environment;
pub use results::{Point, Results, SceneResults};
pub use run::{Options, Outcome, run};
pub use speedup::Speedup;
pub use sweep::{Levels, Setting, Sweep};
