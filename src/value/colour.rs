//! Colours, in either of the two forms in which people have them.

use std::fmt::Formatter;

use glam::Vec3;
use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, Error, SeqAccess, Unexpected, Visitor};

use super::{Exactly, NotNegative};
use crate::frame::srgb::linear_from_srgb;

/// A colour in linear light; each of red, green and blue is finite and at least 0.
///
/// A file says it as `"#rrggbb"`, encoded in sRGB as colour pickers give it, or as `[red, green, blue]`, linear and 1 where
/// the other form has `ff`; the list may hold more than 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Colour(pub Vec3);

impl Colour {
    /// The colour of linear red, green and blue.
    pub const fn linear(red: f32, green: f32, blue: f32) -> Self {
        Self(Vec3::new(red, green, blue))
    }

    /// The colour `0xrrggbb`, encoded in sRGB.
    pub fn srgb(hex: u32) -> Self {
        let linear = |shift: u32| linear_from_srgb((hex >> shift & 0xff) as f32 / 255.);
        Self::linear(linear(16), linear(8), linear(0))
    }
}

impl<'de> Deserialize<'de> for Colour {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EitherForm;
        impl<'de> Visitor<'de> for EitherForm {
            type Value = Colour;

            fn expecting(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
                formatter.write_str("a colour such as \"#c8955a\" (sRGB) or [0.58, 0.3, 0.1] (linear)")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Colour, E> {
                text.strip_prefix('#')
                    .filter(|digits| {
                        digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit())
                    })
                    .and_then(|digits| u32::from_str_radix(digits, 16).ok())
                    .map(Colour::srgb)
                    .ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Colour, A::Error> {
                let Exactly(rgb) = Exactly::<3, NotNegative>::deserialize(SeqAccessDeserializer::new(list))?;
                Ok(Colour(rgb.map(|part| part.0 as f32).into()))
            }
        }
        deserializer.deserialize_any(EitherForm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Paint {
        colour: Colour,
    }

    fn read(colour: &str) -> Result<Colour, toml::de::Error> {
        toml::from_str(&format!("colour = {colour}")).map(|paint: Paint| paint.colour)
    }

    #[test]
    fn both_forms_mean_the_same() {
        for (hex, list) in
            [("'#000000'", "[0, 0.0, 0]"), ("'#FFffff'", "[1, 1, 1]"), ("'#ff0000'", "[1, 0, 0]")]
        {
            assert_eq!(read(hex).unwrap(), read(list).unwrap());
        }
        // Half of the code range is 0.216 of the light; the list is taken as it is, beyond 1 too.
        let grey = read("'#808080'").unwrap().0;
        assert!((grey - Vec3::splat(0.215_86)).abs().max_element() < 1e-5, "{grey}");
        assert_eq!(read("[0.5, 0, 20]").unwrap(), Colour::linear(0.5, 0.0, 20.0));
    }

    #[test]
    fn mistakes_have_their_spot() {
        let mistakes = [
            ("'gold'", "'gold'"),
            ("'#12345'", "'#12345'"),
            ("'#12345g'", "'#12345g'"),
            ("'#1234é'", "'#1234é'"),
            ("'+12345'", "'+12345'"),
            ("7", "7"),
            ("[1, 2]", "[1, 2]"),
            ("[1, 2, 3, 4]", "[1, 2, 3, 4]"),
            ("[1, -0.5, 0]", "-0.5"),
            ("[1, nan, 0]", "nan"),
            ("[1, '0', 0]", "'0'"),
        ];
        for (colour, spot) in mistakes {
            let error = read(colour).unwrap_err();
            let text = format!("colour = {colour}");
            assert_eq!(error.span().map(|span| &text[span]), Some(spot), "{error}");
        }
    }
}
