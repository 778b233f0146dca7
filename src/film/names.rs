//! What the pictures of frames are called: `out/{frame}.png`, `out/{frame:04}.png`, `out/####.png`.

use std::path::{Path, PathBuf};

/// A name with a place for the number of the frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names {
    before: String,
    /// At least so many digits; `None` where the name is the same for all frames.
    digits: Option<usize>,
    after: String,
}

impl Names {
    /// Finds the place of the number in a name.
    ///
    /// # Errors
    /// A sentence, where there are several or one is malformed.
    pub fn new(name: &Path) -> Result<Self, String> {
        let text = name.to_str().ok_or("the name is not Unicode")?;
        let (before, digits, after) = match (text.split_once("{frame"), text.split_once('#')) {
            (Some((before, rest)), None) => {
                let (width, after) = rest.split_once('}').ok_or("`{frame` has no end: write {frame:04}")?;
                let digits = match width.strip_prefix(":0") {
                    _ if width.is_empty() => Some(1),
                    Some(digits) => digits.parse().ok().filter(|digits| (1..=9).contains(digits)),
                    None => None,
                };
                let digits = digits.ok_or_else(|| {
                    format!("`{{frame{width}}}` is no place for a number: write {{frame:04}}")
                })?;
                (before, Some(digits), after.to_owned())
            }
            (None, Some((before, rest))) => {
                let after = rest.trim_start_matches('#');
                (before, Some(1 + rest.len() - after.len()), after.to_owned())
            }
            (Some(_), Some(_)) => return Err("there are two places for the number of the frame".into()),
            (None, None) => (text, None, String::new()),
        };
        if after.contains("{frame") || after.contains('#') {
            return Err("there are two places for the number of the frame".into());
        }
        Ok(Self { before: before.to_owned(), digits, after })
    }

    /// Whether each frame has a name of its own.
    pub fn differ(&self) -> bool {
        self.digits.is_some()
    }

    /// The name of a frame's picture.
    pub fn of(&self, frame: u32) -> PathBuf {
        let Self { before, digits, after } = self;
        let number = digits.map_or_else(String::new, |digits| format!("{frame:0digits$}"));
        format!("{before}{number}{after}").into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_where_they_are_wanted() {
        let name =
            |text: &str, frame| Names::new(text.as_ref()).unwrap().of(frame).to_str().unwrap().to_owned();
        assert_eq!(name("a/{frame}.png", 7), "a/7.png");
        assert_eq!(name("a/{frame:04}.exr", 7), "a/0007.exr");
        assert_eq!(name("a-###-b.png", 1234), "a-1234-b.png");
        assert_eq!(name("#.png", 3), "3.png");
        assert_eq!(name("one.png", 3), "one.png");
        assert!(!Names::new("one.png".as_ref()).unwrap().differ());
    }

    #[test]
    fn mistakes_are_told() {
        for text in [
            "{frame:x}.png",
            "{frame:4}.png",
            "{frame",
            "{frame}#.png",
            "#a#.png",
            "{frame}{frame}.png",
            "{frames}.png",
        ] {
            assert!(Names::new(text.as_ref()).is_err(), "{text}");
        }
    }
}
