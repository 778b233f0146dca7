//! Lists of a fixed length. (Serde's own arrays let a list be longer.)

use serde::{Deserialize, Deserializer};

/// A list of exactly `N` values.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "Vec<T>", bound = "T: Deserialize<'de>")]
pub struct Exactly<const N: usize, T>(pub [T; N]);

impl<const N: usize, T> TryFrom<Vec<T>> for Exactly<N, T> {
    type Error = String;

    fn try_from(list: Vec<T>) -> Result<Self, String> {
        let values = list.try_into();
        values
            .map(Self)
            .map_err(|list: Vec<T>| format!("invalid length {}, expected a list of {N}", list.len()))
    }
}

/// For `#[serde(deserialize_with = "exactly")]` on a plain array.
pub(crate) fn exactly<'de, const N: usize, T, D>(deserializer: D) -> Result<[T; N], D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    Exactly::deserialize(deserializer).map(|list| list.0)
}
