//! The keys of a recipe file: what they are called, what they mean, their defaults and their ranges.

use glam::Vec3;
use serde::Deserialize;

/// A struct whose fields are the keys of a recipe, each told once: its meaning, default and range.
pub(super) trait Keys: for<'de> Deserialize<'de> {
    /// Every key, in the order of the documentation.
    const NAMES: &'static [&'static str];

    /// The first key whose value is out of range, and the range in words.
    fn out_of_range(&self) -> Option<(&'static str, String)>;
}

/// Declares a [`Keys`] struct: `key: Type = default, lowest..=highest;`.
macro_rules! keys {
    ($(#[$about:meta])* $name:ident {
        $($(#[$meaning:meta])* $key:ident: $type:ty = $default:expr $(, $low:literal..=$high:literal)?;)*
    }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $(
                $(#[$meaning])*
                #[doc = concat!("\n\nDefault `", stringify!($default), "`" $(,
                    "; range `", stringify!($low), "..=", stringify!($high), "`")?, ".")]
                pub $key: $type,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)* }
            }
        }

        impl $crate::volume::recipe::keys::Keys for $name {
            const NAMES: &'static [&'static str] = &[$(stringify!($key)),*];

            fn out_of_range(&self) -> Option<(&'static str, String)> {
                $($(
                    if !($low..=$high).contains(&self.$key) {
                        let problem = format!("{} is not in {}..={}", self.$key, $low, $high);
                        return Some((stringify!($key), problem));
                    }
                )?)*
                None
            }
        }
    };
}
pub(super) use keys;

/// A colour, written `"#rrggbb"` in sRGB as colour pickers give it, and kept in linear light.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct Colour(pub Vec3);

/// The colour `0xrrggbb`.
pub(super) fn srgb(hex: u32) -> Colour {
    let linear = |shift: u32| {
        let encoded = (hex >> shift & 0xff) as f32 / 255.;
        if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
    };
    Colour(Vec3::new(linear(16), linear(8), linear(0)))
}

impl TryFrom<String> for Colour {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.strip_prefix('#')
            .filter(|digits| digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit()))
            .and_then(|digits| u32::from_str_radix(digits, 16).ok())
            .map(srgb)
            .ok_or_else(|| format!("`{text}` is not a colour such as \"#c8955a\""))
    }
}
