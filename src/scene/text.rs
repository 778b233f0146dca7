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
    layers: Vec<Layer>,
}

/// One `key=value` that is laid over the text.
#[derive(Debug, Clone)]
pub struct Layer {
    /// What errors call it.
    name: String,
    help: Option<String>,
    /// TOML, once it is in a text padded to its place in the common address space.
    toml: String,
}

impl Layer {
    /// A value, in TOML, of a dotted key; `name` is what errors call it.
    ///
    /// # Errors
    /// What is wrong with the key, in a sentence.
    pub fn new(name: String, key: &str, value: &str) -> std::result::Result<Self, String> {
        let toml = format!("{key}={value}");
        if key.contains(['\n', '#', '[', '=']) {
            return Err(format!("`{key}` is not a dotted key"));
        }
        DeTable::parse(&toml).map_err(|error| error.message().to_owned())?;
        Ok(Self { name, help: None, toml })
    }

    /// `dotted.key=value`, its value TOML or a bare word, which stands for a string.
    fn of_override(written: &str) -> Result<Self> {
        let help = Some("an override is written -D section.key=value".to_owned());
        let toml = override_as_toml(written).map_err(|message| Error::Usage {
            message: format!("-D {written}: {message}"),
            help: help.clone(),
        })?;
        Ok(Self { name: format!("-D {written}"), help, toml })
    }
}

impl Text {
    /// `name` is what errors call the text; each override reads `dotted.key=value`, its value TOML or a
    /// bare word, which stands for a string.
    ///
    /// # Errors
    /// [`Error::Usage`] for an override that cannot be read.
    pub fn new(name: &str, text: String, overrides: &[String]) -> Result<Self> {
        let source = Arc::new(NamedSource::new(name, text).with_language("toml"));
        let layers = overrides.iter().map(|written| Layer::of_override(written)).collect::<Result<_>>()?;
        Ok(Self { source, layers: Vec::new() }.with(layers))
    }

    /// The same with more laid over it.
    pub fn with(&self, more: Vec<Layer>) -> Self {
        let mut layers = self.layers.clone();
        let mut end = layers.last().map_or(self.source.inner().len(), |layer| layer.toml.len());
        layers.extend(more.into_iter().map(|layer| {
            let toml = " ".repeat(end + 1) + &layer.toml;
            end = toml.len();
            Layer { toml, ..layer }
        }));
        Self { source: self.source.clone(), layers }
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

    /// What text and layers say together, without the sections named, as TOML that does not depend on how they are written.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn plain(&self, without: &[&str]) -> Result<String> {
        let mut table: toml::Table = self.read(self.tree()?)?;
        table.retain(|section, _| !without.contains(&section));
        Ok(table.to_string())
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
        for layer in &self.layers {
            merge(root.get_mut(), parsed(&layer.toml)?.into_inner())
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
            let layer = self.layers.iter().find(|layer| span.start < layer.toml.len());
            let (name, help) = layer.map_or(("", None), |layer| (&layer.name, layer.help.clone()));
            return Error::Usage { message: format!("{name}: {message}"), help };
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
        let message = IN_SCENES
            .iter()
            .fold(error.message().to_owned(), |said, (rust, scene)| said.replace(rust, scene));
        self.error(error.span().unwrap_or(0..0), message)
    }
}

/// What the reader says, and what that is to those who write scenes.
const IN_SCENES: [(&str, &str); 6] = [
    (" field `", " key `"),
    (" variant `", " name `"),
    ("expected f64", "expected a number"),
    ("expected u32", "expected a whole number"),
    ("expected a boolean", "expected true or false"),
    ("expected a sequence", "expected a list, written [...] or, of tables, each headed [[...]]"),
];

/// The override as a TOML document; else what is wrong with it.
fn override_as_toml(written: &str) -> std::result::Result<String, String> {
    let (key, value) = written.split_once('=').ok_or("there is no `=`")?;
    if key.contains(['\n', '#', '[']) {
        return Err("the key is not a dotted key".to_owned());
    }
    let Err(error) = DeTable::parse(written) else { return Ok(written.to_owned()) };
    // A bare word: `{:?}` escapes as TOML's basic strings do for all that may stand in a bare word.
    let bare = |c: char| c.is_alphanumeric() || "-_./+~@# ".contains(c);
    let as_string = format!("{key}={value:?}");
    if !value.is_empty() && value.chars().all(bare) && DeTable::parse(&as_string).is_ok() {
        return Ok(as_string);
    }
    Err(error.message().to_owned())
}

/// Lays `over` on `under`, table into table; every other value replaces what was there. In a list of tables the keys of a
/// table are the names of those that it is laid on.
fn merge<'a>(under: &mut DeTable<'a>, over: DeTable<'a>) -> Result<(), (Range<usize>, String)> {
    for (key, value) in over {
        let (name, span) = (key.get_ref().as_ref(), value.span());
        match (under.get_mut(name).map(Spanned::get_mut), value.into_inner()) {
            (Some(DeValue::Table(below)), DeValue::Table(above)) => merge(below, above)?,
            (Some(DeValue::Table(_)), _) => {
                return Err((span, format!("`{name}` is a section, not a value")));
            }
            (Some(DeValue::Array(below)), DeValue::Table(above)) if below.iter().any(is_table) => {
                for (named, value) in above {
                    let Some(below) = below.iter_mut().find_map(|table| table_named(table, named.get_ref()))
                    else {
                        let message = format!("no [[{name}]] has the name \"{}\"", named.get_ref());
                        return Err((named.span(), message));
                    };
                    let span = value.span();
                    let DeValue::Table(above) = value.into_inner() else {
                        return Err((span, format!("`{}` is a section, not a value", named.get_ref())));
                    };
                    merge(below, above)?;
                }
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

fn is_table(value: &Spanned<DeValue<'_>>) -> bool {
    matches!(value.get_ref(), DeValue::Table(_))
}

/// The table, where that is its `name`.
fn table_named<'a, 'b>(value: &'b mut Spanned<DeValue<'a>>, wanted: &str) -> Option<&'b mut DeTable<'a>> {
    let DeValue::Table(table) = value.get_mut() else { return None };
    let is_it =
        matches!(table.get("name").map(Spanned::get_ref), Some(DeValue::String(name)) if name == wanted);
    is_it.then_some(table)
}

/// Turns `[section] tag = "variant", field = 1` into `[section] tag = { variant = { field = 1 } }`, which is how
/// serde expects an enum; tables in the section are its own, not the variant's. (Its own `tag` attribute would forget where each value stands.)
fn nest_variant(root: &mut DeTable<'_>, (section, tag): (&str, &str)) {
    let Some(DeValue::Table(fields)) = root.get_mut(section).map(Spanned::get_mut) else { return };
    if !matches!(fields.get(tag).map(Spanned::get_ref), Some(DeValue::String(_))) {
        return;
    }
    let Some((key, selector)) = fields.remove_entry(tag) else { return };
    let span = selector.span();
    let DeValue::String(variant) = selector.into_inner() else { return };
    let (kept, of_variant) = std::mem::take(fields).into_iter().partition(|(_, value)| is_table(value));
    *fields = kept;
    let fields = Spanned::new(span.clone(), DeValue::Table(of_variant));
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
