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

/// When a frame is, and how what plays by itself goes on at its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    /// Seconds.
    pub time: f64,
    /// From the beginning again; else it stands still.
    pub loops: bool,
}

impl Moment {
    /// Which of `count` files of `rate` a second is shown, `time` seconds after the first.
    pub(super) fn file(self, count: usize, rate: f64, time: Option<f64>) -> usize {
        // A time that is a whole number of files, but for rounding, is the beginning of that file.
        let files = (time.unwrap_or(self.time) * rate + 1e-6).floor().max(0.0);
        let file = files as usize;
        if self.loops { file % count } else { file.min(count - 1) }
    }

    /// As [`Moment::file`], with the file that comes after it, and how far towards that it is, 0..1.
    pub(super) fn between(self, count: usize, rate: f64, time: Option<f64>) -> (usize, usize, f64) {
        let from = self.file(count, rate, time);
        let to = if self.loops { (from + 1) % count } else { (from + 1).min(count - 1) };
        let files = (time.unwrap_or(self.time) * rate).max(0.0);
        // What is a whole number but for rounding shows one file alone.
        let part = (files - (files + 1e-6).floor()).max(0.0);
        (from, to, if from == to { 0.0 } else { part })
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

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;

    const SCENE: &str = "mesh.generator = 'torus'\nshell.thickness = 1\nvolume.recipe = 'fog.toml'\n";

    /// The text laid over by a track with these keys, in a timeline of four seconds that loops.
    fn track(keys: &str) -> Result<Track> {
        let timeline = "timeline = { frames = 8, rate = 2, loop = true }";
        let text = format!("{SCENE}{timeline}\n[[track]]\nkey = 'shell.uv_offset'\n{keys}\n");
        let text = Text::new("scene", text, &[])?;
        let file = load::read(&text)?;
        Ok(Track::all(&text, &file, &Timeline::of(file.timeline.as_ref()))?.remove(0))
    }

    /// The first number of a track's values.
    fn values(keys: &str, times: &[f64]) -> Vec<f64> {
        let track = track(keys).unwrap_or_else(|error| panic!("{error}"));
        let Values::Numbers(values, _) = &track.values else { panic!("no numbers") };
        times.iter().map(|&time| track.interpolated(values, time)[0]).collect()
    }

    fn assert_near(found: &[f64], expected: &[f64]) {
        // A few roundings of numbers up to 10.
        let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13);
        assert!(near && found.len() == expected.len(), "{found:?}, expected {expected:?}");
    }

    #[test]
    fn keys_are_met_and_ends_hold() {
        for ease in ["linear", "smooth", "spline"] {
            let keys = format!("at = [1, 2, 4]\nvalues = [3, 5, -1]\nease = '{ease}'");
            assert_near(&values(&keys, &[-1.0, 1.0, 2.0, 4.0, 9.0]), &[3.0, 3.0, 5.0, -1.0, -1.0]);
        }
    }

    #[test]
    fn ways_between_keys() {
        let keys = |ease: &str| format!("at = [0, 2]\nvalues = [0, 8]\nease = '{ease}'");
        assert_near(&values(&keys("linear"), &[0.5, 1.0]), &[2.0, 4.0]);
        // 8 (3 / 16 - 2 / 64).
        assert_near(&values(&keys("smooth"), &[0.5, 1.0]), &[1.25, 4.0]);
        assert_near(&values(&keys("spline"), &[0.5, 1.0]), &[2.0, 4.0]);
        // A spline is exact on a parabola where keys are evenly spaced: slopes are central differences.
        let squares = "at = [0, 1, 2, 3]\nvalues = [0, 1, 4, 9]\nease = 'spline'";
        assert_near(&values(squares, &[1.5, 1.25]), &[2.25, 1.5625]);
    }

    #[test]
    fn a_spline_goes_on_round_the_seam_of_a_loop() {
        let slope = |keys: &str, time: f64| {
            let [a, b] = values(keys, &[time, time + 1e-6])[..] else { unreachable!() };
            (b - a) / 1e-6
        };
        // Of period four: what comes before 0 is what comes before 4.
        let keys = "at = [0, 1, 3, 4]\nvalues = [0, 1, -1, 0]\nease = 'spline'";
        // (1 - -1) / 2 on both sides; second derivatives below 10 leave 1e-5.
        assert!((slope(keys, 0.0) - 1.0).abs() < 2e-5 && (slope(keys, 4.0 - 1e-6) - 1.0).abs() < 2e-5);
        // A track that is shorter than the loop does not go round it.
        let keys = "at = [0, 1, 2, 3]\nvalues = [0, 1, -1, 0]\nease = 'spline'";
        assert!((slope(keys, 0.0) - 2.0).abs() > 0.5, "{}", slope(keys, 0.0));
    }

    #[test]
    fn steps_hold_until_the_next_key() {
        let track = track("at = [0, 1]\nvalues = ['a', 'b']\nease = 'step'").unwrap();
        let laid = |time: f64| format!("{:?}", track.at(time).unwrap());
        for (time, value) in
            [(-1.0, "\\\"a\\\""), (0.99, "\\\"a\\\""), (1.0, "\\\"b\\\""), (9.0, "\\\"b\\\"")]
        {
            assert!(laid(time).contains(&format!("={value}")), "{time}: {}", laid(time));
        }
    }

    #[test]
    fn lists_go_number_by_number() {
        let track = track("at = [0, 2]\nvalues = [[0, 1], [1, 0.5]]").unwrap();
        let laid = format!("{:?}", track.at(0.5).unwrap());
        assert!(laid.contains("shell.uv_offset=[0.25, 0.875]"), "{laid}");
    }

    #[test]
    fn moments_have_files() {
        let file = |time: f64, loops: bool, own: Option<f64>| Moment { time, loops }.file(4, 10.0, own);
        assert_eq!([0.0, 0.09, 0.1, 0.3 - 1e-9, 0.3].map(|time| file(time, false, None)), [0, 0, 1, 3, 3]);
        assert_eq!([0.4, 0.55].map(|time| file(time, false, None)), [3, 3]);
        assert_eq!([0.4, 0.55].map(|time| file(time, true, None)), [0, 1]);
        assert_eq!(file(0.4, true, Some(0.2)), 2, "its own time");
        assert_eq!(file(0.0, false, Some(-1.0)), 0);
        let between = |time: f64, loops: bool| Moment { time, loops }.between(4, 8.0, None);
        assert_eq!(between(0.125 - 1e-9, false), (1, 2, 0.0), "but for rounding");
        assert_eq!(between(0.15625, false), (1, 2, 0.25));
        assert_eq!([between(0.40625, false), between(9.0, false)], [(3, 3, 0.0); 2]);
        assert_eq!(between(0.40625, true), (3, 0, 0.25));
    }
}
