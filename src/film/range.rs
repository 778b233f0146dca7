//! Ranges of frames as people write them: `1-120`, `1-100x5`, `3,5-10`, `001-120`, `all`.

use std::str::FromStr;

use crate::scene::Timeline;
use crate::{Error, Result};

/// Some frames of a film.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameRange {
    written: String,
    /// First, last, and every which.
    parts: Vec<[u32; 3]>,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(written: &str) -> std::result::Result<Self, String> {
        let part = |part: &str| {
            let number = |text: &str| {
                let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
                let number = text.parse().ok().filter(|&number: &u32| digits && number > 0);
                number.ok_or_else(|| {
                    format!("`{text}` is no number of a frame: write 1-120, 1-100x5, 3,5-10 or all; the first frame is 1")
                })
            };
            let (range, every) = match part.split_once('x') {
                Some((range, every)) => (range, number(every)?),
                None => (part, 1),
            };
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            let [first, last] = [number(first)?, number(last)?];
            if last < first {
                return Err(format!("`{part}` ends before it begins: write {last}-{first}"));
            }
            Ok([first, last, every])
        };
        let parts = match written.trim() {
            "all" => vec![],
            some => some.split(',').map(|one| part(one.trim())).collect::<std::result::Result<_, _>>()?,
        };
        Ok(Self { written: written.to_owned(), parts })
    }
}

impl FrameRange {
    /// The frames of a timeline that are meant, ascending, none twice.
    ///
    /// # Errors
    /// [`Error::Usage`] where one is not in the timeline.
    pub fn of(&self, timeline: &Timeline) -> Result<Vec<u32>> {
        if self.parts.is_empty() {
            return Ok((1..=timeline.frames).collect());
        }
        if let Some([.., last, _]) = self.parts.iter().find(|[_, last, _]| *last > timeline.frames) {
            return Err(Error::Usage {
                message: format!(
                    "--frames {}: there is no frame {last}; the scene has those from 1 to {}",
                    self.written, timeline.frames
                ),
                help: Some("the section [timeline] of the scene says how many `frames` there are".into()),
            });
        }
        let frames =
            self.parts.iter().flat_map(|&[first, last, every]| (first..=last).step_by(every as usize));
        let mut frames: Vec<u32> = frames.collect();
        frames.sort_unstable();
        frames.dedup();
        Ok(frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMELINE: Timeline = Timeline { frames: 12, rate: 24.0, loops: false };

    #[test]
    fn what_people_write_is_understood() {
        let frames = |text: &str| text.parse::<FrameRange>().unwrap().of(&TIMELINE).unwrap();
        assert_eq!(frames("2-5"), [2, 3, 4, 5]);
        assert_eq!(frames("1-12x5"), [1, 6, 11]);
        assert_eq!(frames("9,3, 5-7,6-8"), [3, 5, 6, 7, 8, 9]);
        assert_eq!(frames("007-009"), [7, 8, 9]);
        assert_eq!(frames("all"), (1..=12).collect::<Vec<_>>());
    }

    #[test]
    fn mistakes_are_told() {
        for (text, part) in [
            ("", "`` is no number"),
            ("0-3", "`0` is no number of a frame"),
            ("1-", "`` is no number"),
            ("-3", "`` is no number"),
            ("1-9x0", "`0` is no number"),
            ("+1", "`+1` is no number"),
            ("9-3", "write 3-9"),
            ("1-99999999999", "`99999999999` is no number"),
        ] {
            let error = text.parse::<FrameRange>().unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
        let error = "3,10-13".parse::<FrameRange>().unwrap().of(&TIMELINE).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("--frames 3,10-13: there is no frame 13"), "{error}");
    }
}
