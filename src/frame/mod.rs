//! What a render yields: linear premultiplied RGBA, depth, and a report of how it was made.

pub mod backdrop;
pub mod file;
pub mod image;
pub(crate) mod lettering;
pub mod report;
pub mod srgb;

pub use backdrop::{Backdrop, Behind};
pub use image::Image;
pub use report::{Report, Stage, Stopwatch};

/// The three results of a render, alike for every method.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Linear premultiplied RGBA.
    pub image: Image,
    /// For each pixel, row by row from the top left: the mean distance from the eye, in world
    /// units, at which light was stopped, `integral of T sigma s ds / alpha`; infinite where alpha is 0.
    /// Present where [`View::depth`](crate::scene::View::depth) asked for it.
    pub depth: Option<Vec<f32>>,
    /// Time by stage, counts, what was skipped.
    pub report: Report,
}
