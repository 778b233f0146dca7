//! The animations of a glTF file, and the values between their keys: appendix C of the glTF 2.0 specification.

use glam::{DQuat, DVec3, DVec4};
use gltf::json::animation::{Animation, Channel as ChannelJson, Interpolation, Property};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};
use serde::Serialize;

use super::document::Document;
use super::nodes::Place;
use crate::Result;

/// An animation.
#[derive(Debug, Serialize)]
pub struct Clip {
    /// As the file has it; its number, from 1, where it has none.
    pub name: String,
    /// From 0 to its last key, in seconds.
    pub duration: f64,
    #[serde(skip)]
    pub(super) channels: Vec<Channel>,
}

/// What a clip does with one property of one node.
#[derive(Debug)]
pub(super) struct Channel {
    pub node: usize,
    pub property: Property,
    curve: Curve,
}

#[derive(Debug)]
struct Curve {
    interpolation: Interpolation,
    /// Seconds, ascending, at least one.
    times: Vec<f64>,
    /// Of each value.
    width: usize,
    /// One value a key; where it is a cubic spline, three: the slope before, the value, the slope behind.
    values: Vec<f64>,
    /// Values are unit quaternions.
    turns: bool,
}

/// How far a key may be behind its time for being written in single precision, in seconds or, after a second, relative.
const KEY_ROUNDING: f64 = 1e-6;

impl Clip {
    /// All of a file; of each node, how many weights it has is told by `weights`.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) where keys or values are missing or make no sense.
    pub(super) fn all(document: &Document, weights: impl Fn(usize) -> usize) -> Result<Vec<Self>> {
        let clip = |(number, animation): (usize, &Animation)| {
            let name = animation.name.clone().unwrap_or_else(|| (number + 1).to_string());
            let channel = |channel: &ChannelJson| Channel::of(document, animation, channel, &weights);
            let channels: Result<Vec<_>> = animation.channels.iter().map(channel).collect();
            let channels = channels.map_err(|error| error.of(&format!("animation \"{name}\"")))?;
            let ends = channels.iter().map(|channel| channel.curve.times[channel.curve.times.len() - 1]);
            Ok(Self { name, duration: ends.fold(0.0, f64::max), channels })
        };
        document.root.animations.iter().enumerate().map(clip).collect()
    }
}

impl Channel {
    fn of(
        document: &Document,
        animation: &Animation,
        channel: &ChannelJson,
        weights: impl Fn(usize) -> usize,
    ) -> Result<Self> {
        let index = channel.target.node;
        let node = document.get(index, "node")?;
        let sampler = animation.samplers.get(channel.sampler.value());
        let sampler =
            sampler.ok_or_else(|| document.error(format!("there is no sampler {}", channel.sampler)))?;
        let (Checked::Valid(property), Checked::Valid(interpolation)) =
            (channel.target.path, sampler.interpolation)
        else {
            return Err(document.error("a channel has a path or an interpolation that there is not"));
        };
        if node.matrix.is_some() && property != Property::MorphTargetWeights {
            return Err(
                document.error(format!("it moves node {index}, which has a matrix and so stands still"))
            );
        }
        let times: Vec<f64> = document.numbers::<1>(sampler.input, None)?.into_iter().flatten().collect();
        let ascends = times.windows(2).all(|pair| pair[0] < pair[1]);
        if times.first().is_none_or(|first| *first < 0.0) || !ascends {
            let message = format!("accessor {}: times of keys must ascend from 0 or later", sampler.input);
            return Err(document.error(message));
        }
        let elements = times.len() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let (width, mut values) = match property {
            Property::Rotation => (4, flat::<4>(document, sampler.output, elements)?),
            Property::Translation | Property::Scale => (3, flat::<3>(document, sampler.output, elements)?),
            Property::MorphTargetWeights => match weights(index.value()) {
                0 => return Err(document.error(format!("node {index} has no morph targets to weigh"))),
                width => (width, flat::<1>(document, sampler.output, elements * width)?),
            },
        };
        let turns = property == Property::Rotation;
        if turns {
            // Slopes, which are relative to the values as they are, stay.
            let is_cubic = interpolation == Interpolation::CubicSpline;
            let keys = values.as_chunks_mut::<4>().0.iter_mut().enumerate();
            for (_, value) in keys.filter(|(index, _)| !is_cubic || index % 3 == 1) {
                let unit = DVec4::from_array(*value).try_normalize();
                let unit = unit.ok_or_else(|| {
                    document.error(format!("accessor {}: a rotation is zero, which is none", sampler.output))
                })?;
                if !is_cubic {
                    *value = unit.to_array();
                }
            }
        }
        Ok(Self {
            node: index.value(),
            property,
            curve: Curve { interpolation, times, width, values, turns },
        })
    }

    /// Moves the node, or its weights, to where they are at a time in seconds.
    pub fn apply(&self, time: f64, place: &mut Place, weights: &mut [f64]) {
        let value = self.curve.at(time);
        match (self.property, place) {
            (Property::MorphTargetWeights, _) => weights.copy_from_slice(&value),
            (Property::Translation, Place::Parts { translation, .. }) => {
                *translation = DVec3::from_slice(&value)
            }
            (Property::Scale, Place::Parts { scale, .. }) => *scale = DVec3::from_slice(&value),
            (Property::Rotation, Place::Parts { rotation, .. }) => *rotation = DQuat::from_slice(&value),
            (_, Place::Matrix(_)) => {}
        }
    }
}

fn flat<const N: usize>(document: &Document, index: Index<Accessor>, count: usize) -> Result<Vec<f64>> {
    Ok(document.numbers::<N>(index, Some(count))?.into_iter().flatten().collect())
}

impl Curve {
    /// Before the first key the first value holds, after the last the last.
    fn at(&self, time: f64) -> Vec<f64> {
        let Self { times, interpolation, .. } = self;
        let reached = match interpolation {
            Interpolation::Step => time + KEY_ROUNDING * time.max(1.0),
            _ => time,
        };
        let after = times.partition_point(|key| *key <= reached);
        let value = if after == 0 || after == times.len() || *interpolation == Interpolation::Step {
            self.value(after.saturating_sub(1)).to_vec()
        } else {
            let span = times[after] - times[after - 1];
            self.between(after - 1, (time - times[after - 1]) / span, span)
        };
        match self.turns {
            false => value,
            // A spline may pass through zero, where it is no rotation: the key before holds.
            true => {
                let unit = DVec4::from_slice(&value).try_normalize();
                let unit = unit
                    .unwrap_or_else(|| DVec4::from_slice(self.value(after.saturating_sub(1))).normalize());
                unit.to_array().to_vec()
            }
        }
    }

    /// A part of the way, 0 to 1, from a key to the next, which is `span` seconds later.
    fn between(&self, key: usize, part: f64, span: f64) -> Vec<f64> {
        let (from, to) = (self.value(key), self.value(key + 1));
        if self.interpolation == Interpolation::CubicSpline {
            let (slope_from, slope_to) = (self.element(3 * key + 2), self.element(3 * key + 3));
            let (square, cube) = (part * part, part * part * part);
            let towards = 3.0 * square - 2.0 * cube;
            let leaving = span * (cube - 2.0 * square + part);
            let arriving = span * (cube - square);
            let value = |i: usize| {
                (1.0 - towards) * from[i] + towards * to[i] + leaving * slope_from[i] + arriving * slope_to[i]
            };
            return (0..self.width).map(value).collect();
        }
        if self.turns {
            // By the shorter way.
            return DQuat::from_slice(from).slerp(DQuat::from_slice(to), part).to_array().to_vec();
        }
        from.iter().zip(to).map(|(from, to)| from + part * (to - from)).collect()
    }

    fn value(&self, key: usize) -> &[f64] {
        self.element(if self.interpolation == Interpolation::CubicSpline { 3 * key + 1 } else { key })
    }

    fn element(&self, index: usize) -> &[f64] {
        &self.values[index * self.width..][..self.width]
    }
}
