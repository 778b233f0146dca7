//! Scaling measured: how time and memory grow with the tetrahedra, the pixels, or the texels of a scene.
//!
//! A [`Sweep`] has series; each draws one scene at several sizes. How a time `t` grows with a size `n` is told by the slope of
//! `log t` over `log n`: 1 where twice as much takes twice as long.

mod memory;
mod report;
mod results;
mod run;
mod sweep;

pub use results::{FRAME, Growth, Point, Results, SCHEMA, SeriesResults};
pub use run::{Outcome, run};
pub use sweep::{Measure, Series, Sweep, is_scaling};
