//! A gallery: many scenes rendered at their own sizes, each timed, and held against the f64 reference in a smaller picture.
//!
//! [`scenes`] finds the scene files, [`run()`] renders them and writes a picture of each, a contact sheet and a page. A scene
//! that cannot be rendered is told, and does not keep the others from it. `docs/gallery.md` says how it measures.

mod about;
mod find;
mod page;
mod results;
mod run;
mod sheet;

pub use find::scenes;
pub use results::{Drawn, Measured, Results, SceneResults, Verdict};
pub use run::{Options, Outcome, run};
