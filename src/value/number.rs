//! Numbers that cannot hold a value out of their range.

use serde::Deserialize;
use serde::de::value::I64Deserializer;
use serde::de::{Deserializer, Error, Unexpected, Visitor};

use super::Exactly;

/// Reads a number by a visitor with the methods given; `$expecting` says the range in words.
macro_rules! read {
    ($name:ident as $kind:ident = $expecting:expr; $($visit:item)*) => {
        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct InRange;
                impl Visitor<'_> for InRange {
                    type Value = $name;
                    fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                        formatter.write_fmt($expecting)
                    }
                    $($visit)*
                }
                deserializer.$kind(InRange)
            }
        }
    };
}

/// Declares a number whose range is checked as it is read; the second line says the range in words.
macro_rules! number {
    ($(#[$doc:meta])* $name:ident = $expecting:literal, $in_range:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name(pub f64);

        read! {
            $name as deserialize_f64 = format_args!($expecting);
            fn visit_f64<E: Error>(self, value: f64) -> Result<$name, E> {
                let in_range: fn(f64) -> bool = $in_range;
                if value.is_finite() && in_range(value) {
                    Ok($name(value))
                } else {
                    Err(E::invalid_value(Unexpected::Float(value), &self))
                }
            }
            fn visit_i64<E: Error>(self, value: i64) -> Result<$name, E> {
                self.visit_f64(value as f64)
            }
        }
    };
}

/// Declares a whole number from `$least` to `$most`.
macro_rules! count {
    ($(#[$doc:meta])* $name:ident = $least:literal..=$most:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct $name(pub u32);

        read! {
            $name as deserialize_u32 = format_args!("a whole number from {} to {}", $least, $most);
            fn visit_i64<E: Error>(self, value: i64) -> Result<$name, E> {
                match u32::try_from(value) {
                    Ok(count) if ($least..=$most).contains(&count) => Ok($name(count)),
                    _ => Err(E::invalid_value(Unexpected::Signed(value), &self)),
                }
            }
        }
    };
}

// What is far from the limits of f32 and f64 can be squared and divided.
number! {
    /// A coordinate.
    Finite = "a finite number from -1e30 to 1e30", |value| value.abs() <= 1e30
}
number! {
    /// A length.
    Positive = "a finite number greater than 0, from 1e-30 to 1e30", |value| (1e-30..=1e30).contains(&value)
}
number! {
    /// A colour or a factor.
    NotNegative = "a finite number of at least 0, at most 1e30", |value| (0.0..=1e30).contains(&value)
}
number! {
    /// A part of a texel: a step without bound would keep a device busy for ever.
    Step = "a number from 0.001 to 1000", |value| (0.001..=1000.0).contains(&value)
}
number! {
    /// The exponent of a highlight: beyond, it is narrower than three degrees.
    Shininess = "a number from 1 to 1000", |value| (1.0..=1000.0).contains(&value)
}
number! {
    /// From 0 to 1, both included.
    Fraction = "a number from 0 to 1", |value| (0.0..=1.0).contains(&value)
}
number! {
    /// From 0 to 1, the latter excluded.
    BelowOne = "a number from 0 to 1, excluding 1", |value| (0.0..1.0).contains(&value)
}
number! {
    /// The part of light at which a ray ends.
    EndBelow = "a number from 0 to 0.1", |value| (0.0..=0.1).contains(&value)
}
number! {
    /// An exposure: each stop is twice as bright.
    Stops = "a number of stops from -20 to 20", |value| (-20.0..=20.0).contains(&value)
}
number! {
    /// An angle in degrees, above 0 and below 180.
    FieldOfView = "an angle in degrees between 0 and 180, both excluded", |value| value > 0.0 && value < 180.0
}
number! {
    /// Frames a second.
    Rate = "a number of frames a second from 0.001 to 1000", |value| (0.001..=1000.0).contains(&value)
}
count! {
    /// The number of frames of an animation.
    Frames = 1..=100000
}
count! {
    /// The width or height of a picture, in pixels.
    Pixels = 1..=32768
}
count! {
    /// Pixels a side of a light's picture.
    ShadowSize = 16..=16384
}
count! {
    /// Rounds of smoothing.
    Rounds = 0..=1000
}
count! {
    /// Samples in one tetrahedron.
    Samples = 1..=4096
}
count! {
    /// Timed frames of one point of a benchmark.
    Runs = 1..=1000
}
count! {
    /// The side, in pixels, of the squares of which a benchmark measures the error of one pixel.
    ErrorEvery = 1..=64
}

/// Width and height of a picture that fits into memory: at most 2^28 pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "Exactly<2, Pixels>")]
pub struct PictureSize(pub [Pixels; 2]);

impl PictureSize {
    /// The size of so many pixels.
    ///
    /// # Errors
    /// What is out of range, in words.
    pub fn new(width: u32, height: u32) -> Result<Self, String> {
        let side = |pixels: u32| {
            let pixels = I64Deserializer::<serde::de::value::Error>::new(pixels.into());
            Pixels::deserialize(pixels).map_err(|error| error.to_string())
        };
        Ok(Exactly([side(width)?, side(height)?]).try_into()?)
    }
}

impl TryFrom<Exactly<2, Pixels>> for PictureSize {
    type Error = &'static str;

    fn try_from(Exactly(size): Exactly<2, Pixels>) -> Result<Self, Self::Error> {
        let pixels: u64 = size.iter().map(|side| u64::from(side.0)).product();
        if pixels <= 1 << 28 {
            Ok(Self(size))
        } else {
            Err("too large a picture, expected at most 2^28 pixels")
        }
    }
}
