//! Films: which frames of a [`Sequence`](crate::scene::Sequence) are rendered, what their files are called, how they are told to be up
//! to date, and the files that hold a whole film.

pub mod mark;
pub mod moving;
pub mod names;
pub mod range;

pub use moving::{Film, FilmFormat};
pub use names::Names;
pub use range::FrameRange;
