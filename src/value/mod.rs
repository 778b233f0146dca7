//! What the keys of scene and recipe files hold: values that are checked as they are read, so that an error has its spot.

mod colour;
mod list;
mod number;

pub use colour::Colour;
pub use list::Exactly;
pub(crate) use list::exactly;
pub use number::{
    BelowOne, EndBelow, ErrorEvery, FieldOfView, Finite, Fraction, Frames, NotNegative, PictureSize, Pixels,
    Positive, Rate, Rounds, Runs, Samples, ShadowSize, Shininess, Step, Stops,
};
