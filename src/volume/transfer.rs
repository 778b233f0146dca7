//! Transfer functions: how a scalar becomes colour and opacity.

use serde::Deserialize;

use crate::value::Colour;

/// A piecewise linear map from scalars to straight linear colour and opacity; constant beyond its ends.
///
/// In a scene file:
///
/// ```toml
/// [volume.transfer]
/// points = [
///     { value = 0, colour = [1, 1, 1], alpha = 0 },
///     { value = 255, colour = "#ffbc7c", alpha = 0.8 },
/// ]
/// ```
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "UncheckedTransferFunction")]
pub struct TransferFunction {
    points: Vec<ControlPoint>,
}

/// A corner of a [`TransferFunction`].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlPoint {
    /// The scalar, in the units of [`RawVolume::values`](super::RawVolume::values): 0..=255 for an NRRD of
    /// uint8, 0..=1 for KTX2 UNORM and PNG, the number itself for floats.
    pub value: f32,
    /// Straight.
    pub colour: Colour,
    /// The opacity, 0..=1, of a path of one `opacity_distance`.
    pub alpha: f32,
}

/// Why some control points are not a [`TransferFunction`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InvalidTransferFunction {
    /// There is no point at all.
    #[error("a transfer function needs at least one point")]
    Empty,
    /// A point is out of range.
    #[error(
        "point {index} of the transfer function needs a finite value, colours of at least 0 and alpha in 0..=1"
    )]
    Range {
        /// Its index, from 0.
        index: usize,
    },
    /// A value does not exceed the one before it.
    #[error("point {index} of the transfer function must have a larger value than the point before it")]
    Order {
        /// Its index, from 0.
        index: usize,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UncheckedTransferFunction {
    points: Vec<ControlPoint>,
}

impl TryFrom<UncheckedTransferFunction> for TransferFunction {
    type Error = InvalidTransferFunction;

    fn try_from(unchecked: UncheckedTransferFunction) -> Result<Self, InvalidTransferFunction> {
        Self::new(unchecked.points)
    }
}

impl TransferFunction {
    /// The map through `points`.
    ///
    /// # Errors
    /// Where there is no point, values do not increase strictly, or a number is out of its range.
    pub fn new(points: Vec<ControlPoint>) -> Result<Self, InvalidTransferFunction> {
        if points.is_empty() {
            return Err(InvalidTransferFunction::Empty);
        }
        for (index, point) in points.iter().enumerate() {
            let colour = point.colour.0.is_finite() && point.colour.0.min_element() >= 0.0;
            if !(colour && point.value.is_finite() && (0.0..=1.0).contains(&point.alpha)) {
                return Err(InvalidTransferFunction::Range { index });
            }
        }
        match points.windows(2).position(|pair| pair[0].value >= pair[1].value) {
            Some(before) => Err(InvalidTransferFunction::Order { index: before + 1 }),
            None => Ok(Self { points }),
        }
    }

    /// The straight linear `[r, g, b, alpha]` of a finite scalar.
    pub fn straight_rgba(&self, value: f32) -> [f32; 4] {
        let above = self.points.partition_point(|point| point.value <= value);
        let [low, high] = [above.saturating_sub(1), above.min(self.points.len() - 1)].map(|i| self.points[i]);
        let rgba = |point: ControlPoint| point.colour.0.extend(point.alpha).to_array();
        if low.value == high.value {
            return rgba(low);
        }
        let part = (f64::from(value) - f64::from(low.value)) / (f64::from(high.value) - f64::from(low.value));
        let (low, high) = (rgba(low), rgba(high));
        [0, 1, 2, 3].map(|i| (f64::from(low[i]) * (1.0 - part) + f64::from(high[i]) * part) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(value: f32, red: f32, alpha: f32) -> ControlPoint {
        ControlPoint { value, colour: Colour::linear(red, 0.0, 0.0), alpha }
    }

    #[test]
    fn between_points_it_is_linear_and_beyond_them_constant() {
        let map =
            TransferFunction::new(vec![point(1.0, 0.0, 0.0), point(3.0, 2.0, 1.0), point(4.0, 0.0, 1.0)])
                .unwrap();
        for (value, red, alpha) in [
            (-9.0, 0.0, 0.0),
            (1.0, 0.0, 0.0),
            (1.5, 0.5, 0.25),
            (3.0, 2.0, 1.0),
            (3.75, 0.5, 1.0),
            (9.0, 0.0, 1.0),
        ] {
            assert_eq!(map.straight_rgba(value), [red, 0.0, 0.0, alpha], "at {value}");
        }
        let constant = TransferFunction::new(vec![point(1.0, 0.5, 0.25)]).unwrap();
        assert_eq!(constant.straight_rgba(1.0), constant.straight_rgba(-1e30));
    }

    #[test]
    fn impossible_points_are_named() {
        use InvalidTransferFunction::{Empty, Order, Range};
        assert_eq!(TransferFunction::new(vec![]), Err(Empty));
        let good = point(0.0, 0.0, 0.0);
        for bad in [point(f32::NAN, 0.0, 0.0), point(1.0, -1.0, 0.0), point(1.0, 0.0, 1.1)] {
            assert_eq!(TransferFunction::new(vec![good, bad]), Err(Range { index: 1 }));
        }
        assert_eq!(TransferFunction::new(vec![good, good]), Err(Order { index: 1 }));
    }

    #[test]
    fn it_is_read_from_toml() {
        let text = "points = [{ value = 0, colour = [1, 1, 1], alpha = 0 }, { value = 2, colour = '#000000', alpha = 1 }]";
        let map: TransferFunction = toml::from_str(text).unwrap();
        assert_eq!(map.straight_rgba(1.0), [0.5; 4]);
        for wrong in [
            text.replace("alpha = 1", "alpha = 2"),
            text.replace("value", "valeu"),
            format!("{text}\nmore = 1"),
        ] {
            assert!(toml::from_str::<TransferFunction>(&wrong).is_err());
        }
    }
}
