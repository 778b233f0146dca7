//! Time: how long a scene lasts, and values that change in it.
//!
//! Frames are numbered from 1; frame `f` is at the time `(f - 1) / rate` seconds. Before its first key a track has the first
//! value, after its last key the last.

use serde::Deserialize;
use toml::{Spanned, Value};

use super::file::{SceneFile, TimelineSection, TrackSection};
use super::text::{Layer, Text};
use crate::{Error, Result};

/// How long a scene lasts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timeline {
    /// At least 1.
    pub frames: u32,
    /// Frames a second, positive.
    pub rate: f64,
    /// Whether the frame after the last would be the first.
    pub loops: bool,
}

impl Timeline {
    /// Of a scene without one there is one frame.
    pub(super) fn of(section: Option<&TimelineSection>) -> Self {
        section.map_or(Self { frames: 1, rate: 24.0, loops: false }, |section| Self {
            frames: section.frames.0,
            rate: section.rate.0,
            loops: section.loops,
        })
    }

    /// The time of a frame, in seconds.
    pub fn time(&self, frame: u32) -> f64 {
        f64::from(frame - 1) / self.rate
    }

    /// The time after the last frame, in seconds.
    fn end(&self) -> f64 {
        f64::from(self.frames) / self.rate
    }
}

/// How a track goes from one key to the next.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ease {
    /// In a straight line.
    #[default]
    Linear,
    /// Slowly away and slowly in: `3 x^2 - 2 x^3` of the way after `x` of the time.
    Smooth,
    /// Along the cubic Hermite spline whose slope at a key is that from the key before to the key after it (E. Catmull, R. Rom,
    /// *A class of local interpolating splines*, 1974, for keys that are not evenly spaced). At the ends the slope is that of
    /// the end's own piece; where the timeline loops and the track ends as it begins, it goes on round the seam.
    Spline,
    /// Not at all: a value holds until the next key.
    Step,
}

/// A key of the scene whose values change in time.
#[derive(Debug, Clone)]
pub(super) struct Track {
    key: String,
    /// Seconds, ascending; as many as values, at least one.
    at: Vec<f64>,
    values: Values,
    ease: Ease,
    /// The period of a spline that goes round.
    period: Option<f64>,
}

#[derive(Debug, Clone)]
enum Values {
    /// Each a number, or a list of as many as all others.
    Numbers(Vec<Vec<f64>>, Shape),
    /// Of any kind.
    Others(Vec<Value>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Number,
    List(usize),
}

impl Track {
    /// The tracks of a scene.
    ///
    /// # Errors
    /// [`Error`] with the spot.
    pub(super) fn all(text: &Text, file: &SceneFile, timeline: &Timeline) -> Result<Vec<Self>> {
        let mut tracks: Vec<Self> = Vec::new();
        for section in &file.track {
            let track = Self::of(text, section, timeline)?;
            let touches = |other: &Self| {
                let within = |a: &str, b: &str| a == b || b.starts_with(&format!("{a}."));
                within(&other.key, &track.key) || within(&track.key, &other.key)
            };
            if let Some(other) = tracks.iter().find(|other| touches(other)) {
                let message = format!("`{}` has a track already, that of `{}`", track.key, other.key);
                return Err(text.error(section.get_ref().key.span(), message));
            }
            tracks.push(track);
        }
        Ok(tracks)
    }

    fn of(text: &Text, section: &Spanned<TrackSection>, timeline: &Timeline) -> Result<Self> {
        let TrackSection { key, at, values, ease } = section.get_ref();
        let name = key.get_ref();
        if ["timeline", "track"].iter().any(|own| name.split('.').next() == Some(own)) {
            return Err(text.error(key.span(), format!("`{name}` cannot change in time")));
        }
        let times: Vec<f64> = at.get_ref().iter().map(|time| time.0).collect();
        if let Some(pair) = times.windows(2).find(|pair| pair[0] >= pair[1]) {
            let message = format!("{} is followed by {}, expected times that ascend", pair[0], pair[1]);
            return Err(text.error(at.span(), message));
        }
        let count = values.get_ref().len();
        if times.is_empty() || count != times.len() {
            let message = format!("{count} values for {} times, expected one for each", times.len());
            return Err(text.error(values.span(), message));
        }
        let shape = |value: &Value| match value {
            Value::Array(list) if list.iter().all(|one| number(one).is_some()) => {
                Some(Shape::List(list.len()))
            }
            one => number(one).map(|_| Shape::Number),
        };
        let first = shape(&values.get_ref()[0]);
        let alike = values.get_ref().iter().all(|value| shape(value) == first);
        let values = match (first.filter(|_| alike), ease) {
            (_, Ease::Step) => Values::Others(values.get_ref().clone()),
            (Some(shape), _) => Values::Numbers(values.get_ref().iter().map(numbers).collect(), shape),
            (None, _) => {
                return Err(text
                    .error(values.span(), "there is nothing between these values, expected numbers, or lists of as many numbers each")
                    .with_help("write ease = \"step\" for a value that holds until the next key"));
            }
        };
        let goes_round = |values: &[Vec<f64>]| timeline.loops && values.first() == values.last();
        let period = match &values {
            Values::Numbers(numbers, _) if goes_round(numbers) => {
                let span = times[times.len() - 1] - times[0];
                // To rounding: keys are written in decimals.
                ((span - timeline.end()).abs() <= 1e-9 * timeline.end()).then_some(span)
            }
            _ => None,
        };
        Ok(Self { key: name.clone(), at: times, values, ease: *ease, period })
    }

    /// What the track lays over the scene at a time, in seconds.
    ///
    /// # Errors
    /// [`Error::Usage`] where the key is none.
    pub(super) fn at(&self, time: f64) -> Result<Layer> {
        let value = match &self.values {
            Values::Others(values) => {
                let passed = self.at.iter().take_while(|&&at| at <= time).count();
                values[passed.max(1) - 1].to_string()
            }
            Values::Numbers(values, Shape::Number) => told(self.interpolated(values, time)[0]),
            Values::Numbers(values, Shape::List(_)) => {
                let list: Vec<String> = self.interpolated(values, time).into_iter().map(told).collect();
                format!("[{}]", list.join(", "))
            }
        };
        let told = format!("the track of `{}`, which is {value} at {time} s", self.key);
        Layer::new(told, &self.key, &value).map_err(|message| Error::Usage {
            message: format!("the track of `{}`: {message}", self.key),
            help: Some(
                "a track's key is written section.key, or section.name.key where there are several".into(),
            ),
        })
    }

    fn interpolated(&self, values: &[Vec<f64>], time: f64) -> Vec<f64> {
        let last = self.at.len() - 1;
        let time = time.clamp(self.at[0], self.at[last]);
        let after = self.at.iter().position(|&at| at > time).unwrap_or(last);
        if self.at[last] <= time || last == 0 {
            return values[last].clone();
        }
        let before = after - 1;
        let span = self.at[after] - self.at[before];
        let x = (time - self.at[before]) / span;
        let (from, to) = (&values[before], &values[after]);
        (0..from.len())
            .map(|i| {
                let (a, b) = (from[i], to[i]);
                match self.ease {
                    Ease::Linear | Ease::Step => a + x * (b - a),
                    Ease::Smooth => a + x * x * (3.0 - 2.0 * x) * (b - a),
                    Ease::Spline => {
                        let [slope_a, slope_b] = [before, after].map(|key| span * self.slope(values, key, i));
                        let (y, chord) = (1.0 - x, b - a);
                        a + x * x * (3.0 - 2.0 * x) * chord + x * y * (y * slope_a - x * slope_b)
                    }
                }
            })
            .collect()
    }

    /// Of a spline at a key, a second.
    fn slope(&self, values: &[Vec<f64>], key: usize, i: usize) -> f64 {
        let last = self.at.len() - 1;
        let (before, after) = (key.saturating_sub(1), (key + 1).min(last));
        let between = |from: usize, to: usize, period: f64| {
            (values[to][i] - values[from][i]) / (self.at[to] - self.at[from] + period)
        };
        match self.period {
            Some(period) if key == 0 || key == last => between(last - 1, 1, period),
            _ => between(before, after, 0.0),
        }
    }
}

/// So that it is read as the same number.
fn told(number: f64) -> String {
    Value::Float(number).to_string()
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(whole) => Some(*whole as f64),
        Value::Float(number) => Some(*number),
        _ => None,
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().filter_map(number).collect(),
        one => number(one).into_iter().collect(),
    }
}
