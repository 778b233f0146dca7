//! A TOML text with overrides laid over it, whose every error can underline its spot.
//!
//! Text and overrides share one address space of byte positions: the text comes first, each override is
//! parsed behind a padding as long as all that came before it. A position in the merged tree so tells
//! by itself which of them wrote the value, and an error is told of the one that is to blame.

use std::ops::Range;
use std::sync::Arc;

use miette::NamedSource;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

use crate::{Error, Result};

/// A TOML text, its name, and the overrides to be laid over it.
#[derive(Debug)]
pub struct Text {
    source: Arc<NamedSource<String>>,
    overrides: Vec<Override>,
}

/// One `key=value`, as written and as TOML.
#[derive(Debug)]
struct Override {
    written: String,
    /// Padded to its place in the common address space.
    padded: String,
}

impl Text {
    /// `name` is what errors call the text; each override reads `dotted.key=value`, its value TOML or a
    /// bare word, which stands for a string.
    ///
    /// # Errors
    /// [`Error::Usage`] for an override that cannot be read.
    pub fn new(name: &str, text: String, overrides: &[String]) -> Result<Self> {
        let mut end = text.len();
        let overrides = overrides.iter().map(|written| {
            let padding = " ".repeat(end + 1);
            let padded = override_as_toml(&padding, written)?;
            end = padded.len();
            Ok(Override { written: written.clone(), padded })
        });
        let overrides = overrides.collect::<Result<_>>()?;
        Ok(Self { source: Arc::new(NamedSource::new(name, text).with_language("toml")), overrides })
    }

    /// What text and overrides say together.
    ///
    /// `tagged` names a section and the key in it that selects a variant of an enum: the section's other
    /// keys are the variant's fields.
    ///
    /// # Errors
    /// [`Error::Text`] where the text is at fault, [`Error::Usage`] where an override is.
    pub fn parse<T: DeserializeOwned>(&self, tagged: (&str, &str)) -> Result<T> {
        let mut root = self.tree()?;
        nest_variant(root.get_mut(), tagged);
        self.read(root)
    }

    /// As [`parse`](Self::parse), of a text without a section that selects a variant.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_plain<T: DeserializeOwned>(&self) -> Result<T> {
        self.read(self.tree()?)
    }

    fn read<T: DeserializeOwned>(&self, root: Spanned<DeTable<'_>>) -> Result<T> {
        let span = root.span();
        let root = Spanned::new(span, DeValue::Table(root.into_inner()));
        T::deserialize(ValueDeserializer::from(root)).map_err(|error| self.blame(&error))
    }

    /// Where the value of a section's key is written, if it is.
    pub fn span_of(&self, section: &str, key: &str) -> Option<Range<usize>> {
        let root = self.tree().ok()?;
        Some(root.get_ref().get(section)?.get_ref().get(key)?.span())
    }

    /// The text with the overrides laid over it.
    fn tree(&self) -> Result<Spanned<DeTable<'_>>> {
        let parsed = |text| DeTable::parse(text).map_err(|error| self.blame(&error));
        let mut root = parsed(self.source.inner())?;
        for layer in &self.overrides {
            merge(root.get_mut(), parsed(&layer.padded)?.into_inner())
                .map_err(|(span, message)| self.error(span, message))?;
        }
        Ok(root)
    }

    /// An error about the bytes `span`, given as they are found in [`Spanned`] values of
    /// [`parse`](Self::parse). What follows `, expected ` or `: ` in `message` becomes the label under the spot.
    pub fn error(&self, span: Range<usize>, message: impl Into<String>) -> Error {
        let message = message.into();
        let text = self.source.inner();
        if span.start > text.len() {
            let layer = self.overrides.iter().find(|layer| span.start < layer.padded.len());
            let written = layer.map_or("", |layer| &layer.written);
            return Error::Usage {
                message: format!("-D {written}: {message}"),
                help: Some("an override is written -D section.key=value".to_owned()),
            };
        }
        // A section's span may run over many lines: its first is enough to find it.
        let end = span.end.min(text.len());
        let line_end = text[span.start..end].find('\n').map_or(end, |length| span.start + length);
        let label = message.rsplit_once(", expected ").map(|(_, expected)| format!("expected {expected}"));
        Error::Text {
            source_code: Arc::clone(&self.source),
            span: (span.start..line_end).into(),
            label: label.unwrap_or_else(|| message.clone()),
            message,
            help: None,
        }
    }

    /// The reader's error in a scene's words instead of Rust's.
    fn blame(&self, error: &toml::de::Error) -> Error {
        let message = error.message().replace(" field `", " key `").replace(" variant `", " name `");
        let message = message.replace("expected f64", "expected a number");
        self.error(error.span().unwrap_or(0..0), message.replace("expected u32", "expected a whole number"))
    }
}

/// The override as a TOML document behind `padding`.
fn override_as_toml(padding: &str, written: &str) -> Result<String> {
    let usage = |message: String| Error::Usage {
        message: format!("-D {written}: {message}"),
        help: Some("an override is written -D section.key=value".to_owned()),
    };
    let Some((key, value)) = written.split_once('=') else {
        return Err(usage("there is no `=`".to_owned()));
    };
    if key.contains(['\n', '#', '[']) {
        return Err(usage("the key is not a dotted key".to_owned()));
    }
    let as_toml = format!("{padding}{key}={value}");
    let error = match DeTable::parse(&as_toml) {
        Ok(_) => return Ok(as_toml),
        Err(error) => error,
    };
    // A bare word: `{:?}` escapes as TOML's basic strings do for all that may stand in a bare word.
    let bare = |c: char| c.is_alphanumeric() || "-_./+~@# ".contains(c);
    let as_string = format!("{padding}{key}={value:?}");
    if !value.is_empty() && value.chars().all(bare) && DeTable::parse(&as_string).is_ok() {
        return Ok(as_string);
    }
    Err(usage(error.message().to_owned()))
}

/// Lays `over` on `under`, table into table; every other value replaces what was there.
fn merge<'a>(under: &mut DeTable<'a>, over: DeTable<'a>) -> Result<(), (Range<usize>, String)> {
    for (key, value) in over {
        let (name, span) = (key.get_ref().as_ref(), value.span());
        match (under.get_mut(name).map(Spanned::get_mut), value.into_inner()) {
            (Some(DeValue::Table(below)), DeValue::Table(above)) => merge(below, above)?,
            (Some(DeValue::Table(_)), _) => {
                return Err((span, format!("`{name}` is a section, not a value")));
            }
            (Some(_), DeValue::Table(_)) => {
                return Err((span, format!("`{name}` is a value, not a section")));
            }
            (_, value) => {
                under.remove(name);
                under.insert(key, Spanned::new(span, value));
            }
        }
    }
    Ok(())
}

/// Turns `[section] tag = "variant", field = 1` into `[section] tag = { variant = { field = 1 } }`, which is how
/// serde expects an enum. (Its own `tag` attribute would forget where each value stands.)
fn nest_variant(root: &mut DeTable<'_>, (section, tag): (&str, &str)) {
    let Some(DeValue::Table(fields)) = root.get_mut(section).map(Spanned::get_mut) else { return };
    if !matches!(fields.get(tag).map(Spanned::get_ref), Some(DeValue::String(_))) {
        return;
    }
    let Some((key, selector)) = fields.remove_entry(tag) else { return };
    let span = selector.span();
    let DeValue::String(variant) = selector.into_inner() else { return };
    let fields = Spanned::new(span.clone(), DeValue::Table(std::mem::take(fields)));
    let variant = DeTable::from_iter([(Spanned::new(span.clone(), variant), fields)]);
    let nested = (key, Spanned::new(span, DeValue::Table(variant)));
    if let Some(DeValue::Table(table)) = root.get_mut(section).map(Spanned::get_mut) {
        table.insert(nested.0, nested.1);
    }
}

/// For tests of what reads a text.
#[cfg(test)]
pub(crate) mod tests {
    use crate::Error;

    /// The error tells `part` and underlines `spot`, with a label.
    #[track_caller]
    pub(crate) fn assert_underlined(error: Error, spot: &str, part: &str) {
        assert!(error.to_string().contains(part), "{error} does not tell {part}");
        let Error::Text { source_code, span, label, .. } = error else {
            panic!("no spot for {part}: {error}")
        };
        assert_eq!(&source_code.inner()[span.offset()..span.offset() + span.len()], spot, "{part}");
        assert!(!label.is_empty(), "{part}");
    }
}
