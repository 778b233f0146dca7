//! Antialiasing measured: how far the mipmapped level of detail is from a picture of many rays a pixel through the full
//! volume, from ever farther away, by each [`Filter`](crate::volume::Filter).
//!
//! This *filter error* holds all that a filter cannot know: the direction of sight, what lies behind or beside in the same
//! pixel, the tent by which the texture is interpolated in place of the pixel's box. The error of the march itself is kept
//! far below it by a fine step.

mod report;
mod results;
mod run;
mod sweep;

pub use results::{FilterMean, Picture, Point, Results, SceneResults};
pub use run::{Outcome, run};
pub use sweep::{Sweep, is_antialiasing};
