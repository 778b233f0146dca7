//! The keys of a recipe file: what they are called, what they mean, their defaults and their ranges.

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
