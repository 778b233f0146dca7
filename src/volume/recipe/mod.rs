//! Recipes: small TOML files from which a volume is computed.
//!
//! ```toml
//! recipe = "fur"
//! size = [128, 128, 32]
//! seed = 1
//! density = 4000
//! ```
//!
//! [`Header`] lists the keys that every recipe has; [`Fog`], [`Fur`] and the others list their own. Colours are written
//! `"#rrggbb"` (sRGB) or `[red, green, blue]` (linear): see [`Colour`](crate::value::Colour). A recipe
//! yields the same bytes whatever the number of threads, and its volume repeats in u and v without a seam.

mod chain_mail;
mod clouds;
mod ellipsoids;
mod figure;
mod fog;
mod fur;
mod grass;
mod grid;
mod height_map;
mod keys;
mod noise;
mod rocks;
mod scales;
mod strand;
mod trees;
mod uniform;
mod weave;

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::NamedSource;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

pub use chain_mail::ChainMail;
pub use clouds::Clouds;
pub use ellipsoids::Ellipsoids;
pub use figure::Figure;
pub use fog::Fog;
pub use fur::Fur;
pub use grass::Grass;
pub use height_map::HeightMap;
pub use rocks::Rocks;
pub use scales::Scales;
pub use trees::Trees;
pub use uniform::Uniform;
pub use weave::Weave;

use super::{Quantity, Volume};
use crate::value::exactly;
use crate::{Error, Result, input};
use grid::Grid;
use keys::{Keys, keys};

/// The most texels that a recipe may fill: 4 GiB.
pub const MAX_TEXELS: u64 = 1 << 28;

/// Every recipe, by the name that a file calls it.
const RECIPES: &[(&str, Reader)] = &[
    ("chain-mail", read_pattern::<ChainMail>),
    ("clouds", read_pattern::<Clouds>),
    ("ellipsoids", read_pattern::<Ellipsoids>),
    ("figure", |source, table| Ok(Arc::new(figure::read(source, table)?))),
    ("fog", read_pattern::<Fog>),
    ("fur", read_pattern::<Fur>),
    ("grass", read_pattern::<Grass>),
    ("height-map", |source, table| Ok(Arc::new(height_map::read(source, table)?))),
    ("rocks", read_pattern::<Rocks>),
    ("scales", read_pattern::<Scales>),
    ("trees", read_pattern::<Trees>),
    ("uniform", read_pattern::<Uniform>),
    ("weave", read_pattern::<Weave>),
];

type Reader = fn(&Source, DeTable) -> Result<Arc<dyn Pattern>>;

/// What a recipe draws.
trait Pattern: Debug + Send + Sync {
    /// Fills `texels`, all transparent at first, as [`Volume::texels`] wants them.
    fn draw(&self, grid: &Grid, seed: u32, texels: &mut [[f32; 4]]);
}

keys! {
    /// The keys that every recipe has.
    Header {
        /// Which recipe: `"fur"`, `"fog"`, ... Must be given.
        recipe: String = String::new();
        /// Texels along u, v, w; each at least 1, all together at most [`MAX_TEXELS`].
        #[serde(deserialize_with = "exactly")]
        size: [u32; 3] = [128, 128, 32];
        /// Another seed gives another volume of the same kind.
        seed: u32 = 1;
        /// The shell's thickness in tile widths for which the volume is drawn: round things come out round
        /// where a scene keeps this proportion.
        height: f32 = 0.25, 0.01..=4.0;
    }
}

/// A recipe that was read and found to make sense.
#[derive(Debug, Clone)]
pub struct Recipe {
    header: Header,
    pattern: Arc<dyn Pattern>,
}

/// Reads a recipe from a file.
///
/// # Errors
/// [`Error::Input`] where the file cannot be read, else as [`parse`].
pub fn load(path: impl AsRef<Path>) -> Result<Recipe> {
    load_with(path, &[])
}

/// Reads a recipe from a file, with overrides laid over it, each `key = value`, or several with commas between them.
///
/// # Errors
/// As [`load`], and [`Error::Usage`] for an override that is no TOML.
pub fn load_with(path: impl AsRef<Path>, overrides: &[String]) -> Result<Recipe> {
    let path = path.as_ref();
    let mut text =
        input::text(path).map_err(|error| Error::input(path, format!("cannot read the recipe: {error}")))?;
    for written in overrides {
        text = overridden(&text, written)?;
    }
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    parse_in(folder, &path.display().to_string(), &text)
}

/// Reads a recipe from TOML; `name` stands for the file in error messages. Files that it names are relative to the
/// working directory.
///
/// # Errors
/// [`Error::Text`], which underlines the spot: bad TOML, unknown keys, wrong types, values out of range.
/// [`Error::Input`] where a file that the recipe names cannot be read.
pub fn parse(name: &str, text: &str) -> Result<Recipe> {
    parse_in(PathBuf::new(), name, text)
}

/// A recipe's text in which the values of the keys that `written` names are those that it gives them.
fn overridden(text: &str, written: &str) -> Result<String> {
    let as_table = |body: &str| format!("{{{body}}}");
    // A bare word stands for a string.
    let bare = written.split_once('=').map(|(key, value)| as_table(&format!("{key}={:?}", value.trim())));
    let readable = [Some(as_table(written)), bare].into_iter().flatten().find(|body| {
        let document = format!("all={body}");
        DeTable::parse(&document).is_ok()
    });
    let Some(body) = readable else {
        let message = format!("`{written}` cannot be laid over a recipe: it is no `key = value`");
        return Err(Error::Usage {
            message,
            help: Some("write it as TOML, such as \"length = 0.5, curl = 0\"".into()),
        });
    };
    let document = format!("all={body}");
    let mut overridden = text.to_owned();
    let mut added = String::new();
    // Both were read just now, or will be complained of when the whole is.
    let (Ok(own), Ok(over)) = (DeTable::parse(text), DeTable::parse(&document)) else {
        return Ok(overridden);
    };
    let all = over.get_ref().get("all").map(Spanned::get_ref);
    let Some(DeValue::Table(keys)) = all else { return Ok(overridden) };
    for (key, value) in keys {
        if let Some((old_key, old_value)) = own.get_ref().get_key_value(key.get_ref().as_ref()) {
            // Blanks leave all other keys where they are.
            let gap = old_key.span().start..old_value.span().end;
            overridden.replace_range(gap.clone(), &" ".repeat(gap.len()));
        }
        added += &format!("\n{} = {}", key.get_ref(), &document[value.span()]);
    }
    Ok(overridden + &added + "\n")
}

/// The same with the folder to which the files that the recipe names are relative.
fn parse_in(folder: PathBuf, name: &str, text: &str) -> Result<Recipe> {
    let source =
        Source { folder, text: Arc::new(NamedSource::new(name, text.to_owned()).with_language("toml")) };
    let table = DeTable::parse(text).map_err(|error| source.toml_error(&error, None))?.into_inner();
    let (header, body): (DeTable, DeTable) =
        table.into_iter().partition(|(key, _)| Header::NAMES.contains(&key.get_ref().as_ref()));
    let size_span = header.get("size").map(Spanned::span);
    let recipe_span = header.get("recipe").map_or(0..0, Spanned::span);
    let header: Header = source.read(header)?;
    if let Err(problem) = texel_count(header.size) {
        return Err(source.error(size_span.unwrap_or(0..0), format!("`size`: {problem}"), &problem));
    }
    let Some((_, read)) = RECIPES.iter().find(|(name, _)| *name == header.recipe) else {
        let names = RECIPES.iter().map(|(name, _)| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
        let message = format!("`recipe`: there is no recipe \"{}\"", header.recipe);
        let advice = format!("write `recipe = ` and one of {names}");
        return Err(source.error(recipe_span, message, "not a recipe").with_help(advice));
    };
    Ok(Recipe { pattern: read(&source, body)?, header })
}

impl Recipe {
    /// What the recipe says of itself, apart from what it draws.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Computes the volume.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] where the texels do not fit.
    pub fn build(&self) -> Result<Volume> {
        self.build_with_size(self.header.size)
    }

    /// Computes the volume with another number of texels along u, v, w: the same picture, finer or coarser.
    ///
    /// # Errors
    /// [`Error::Usage`] where an axis is empty or there are more than [`MAX_TEXELS`];
    /// [`Error::OutOfMemory`] where the texels do not fit.
    pub fn build_with_size(&self, size: [u32; 3]) -> Result<Volume> {
        let count = texel_count(size).map_err(|message| Error::Usage { message, help: None })?;
        let mut texels = Vec::new();
        texels.try_reserve_exact(count).map_err(|_| Error::OutOfMemory {
            message: format!("no memory for the {} bytes of a volume of {size:?} texels", 16 * count),
            help: Some("ask for a smaller size".into()),
        })?;
        texels.resize(count, [0.; 4]);
        let grid = Grid { size: size.map(|n| n as usize), height: self.header.height };
        self.pattern.draw(&grid, self.header.seed, &mut texels);
        Ok(Volume { size, texels, quantity: Quantity::Opacity })
    }
}

/// The number of texels, or why there cannot be so many.
fn texel_count(size: [u32; 3]) -> Result<usize, String> {
    let count = size.iter().try_fold(1u64, |product, &n| product.checked_mul(u64::from(n)));
    match count {
        Some(0) => Err(format!("an axis of {size:?} has no texels")),
        Some(count) if count <= MAX_TEXELS => Ok(count as usize),
        _ => Err(format!("{size:?} is more than {MAX_TEXELS} texels")),
    }
}

fn read_pattern<T: Keys + Pattern + 'static>(source: &Source, table: DeTable) -> Result<Arc<dyn Pattern>> {
    Ok(Arc::new(source.read::<T>(table)?))
}

/// Where a recipe is from, and its text, to be quoted in errors.
struct Source {
    folder: PathBuf,
    text: Arc<NamedSource<String>>,
}

impl Source {
    /// Reads the keys of `T`; those that are missing get their defaults.
    fn read<T: Keys>(&self, table: DeTable) -> Result<T> {
        let spans: BTreeMap<String, Range<usize>> =
            table.iter().map(|(key, value)| (key.get_ref().to_string(), value.span())).collect();
        let whole = Spanned::new(0..self.text.inner().len(), DeValue::Table(table));
        let keys = T::deserialize(ValueDeserializer::from(whole)).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let key = spans.iter().find(|(_, value)| value.start <= span.start && span.end <= value.end);
            let error = self.toml_error(&error, key.map(|(name, _)| name.as_str()));
            error.with_help(format!("the keys are {} and {}", Header::NAMES.join(", "), T::NAMES.join(", ")))
        })?;
        match keys.out_of_range() {
            None => Ok(keys),
            Some((key, problem)) => {
                let span = spans.get(key).cloned().unwrap_or(0..0);
                Err(self.error(span, format!("`{key}`: {problem}"), &problem))
            }
        }
    }

    /// What the TOML reader found, told of `key` where it is about a value.
    fn toml_error(&self, error: &toml::de::Error, key: Option<&str>) -> Error {
        let message = key.map_or(error.message().to_owned(), |key| format!("`{key}`: {}", error.message()));
        self.error(error.span().unwrap_or(0..0), message, error.message())
    }

    fn error(&self, span: Range<usize>, message: String, label: &str) -> Error {
        let name = self.text.name();
        Error::Text {
            source_code: Arc::clone(&self.text),
            span: span.into(),
            message: format!("{name}: {message}"),
            label: label.to_owned(),
            help: None,
        }
    }
}
