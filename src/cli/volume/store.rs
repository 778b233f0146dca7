//! `mesoshell volume make` and `convert`: from recipes and files of other kinds to KTX2.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use mesoshell::volume::{self, Loss, RawVolume, Sample, recipe};
use mesoshell::{Error, Result};
use serde::Serialize;

use super::super::{Talk, table};

/// How a value is stored.
#[derive(Args)]
pub struct Storage {
    /// The KTX2 file
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// How each value is stored
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

#[derive(Clone, Copy, Default, ValueEnum)]
pub enum Format {
    /// 8 bits, 0 to 1
    U8,
    /// 16 bits, 0 to 1
    U16,
    /// 16-bit floats
    F16,
    /// 32-bit floats, which lose nothing
    #[default]
    F32,
}

/// Compute a recipe and store its volume
#[derive(Args)]
pub struct Make {
    /// The recipe (.toml)
    recipe: PathBuf,
    /// Texels along u, v, w, instead of the recipe's
    #[arg(long, value_name = "UxVxW", value_parser = super::size)]
    size: Option<[u32; 3]>,
    /// Lays a value over the recipe's: key=value
    #[arg(short = 'D', value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    storage: Storage,
}

/// Store a volume of any kind as KTX2, and tell what precision that costs
#[derive(Args)]
pub struct Convert {
    /// A KTX2 or NRRD file, a folder or pattern of PNG slices, or a recipe (.toml)
    file: PathBuf,
    #[command(flatten)]
    storage: Storage,
}

/// What is printed with `--json`.
#[derive(Serialize)]
pub struct Stored {
    output: PathBuf,
    size: [u32; 3],
    channels: u32,
    loss: Loss,
}

pub fn make(arguments: &Make, talk: Talk) -> Result<()> {
    let Make { recipe: path, size, overrides, storage } = arguments;
    storage.check()?;
    let recipe = recipe::load_with(path, overrides)?;
    let made = recipe.build_with_size(size.unwrap_or(recipe.header().size))?;
    let stored = storage.write(&RawVolume::of(made, path, "recipe".into()))?;
    talk.result(&stored, || format!("{}\n{}", storage.output.display(), table(stored.rows())))
}

pub fn convert(arguments: &Convert, talk: Talk) -> Result<()> {
    let Convert { file, storage } = arguments;
    storage.check()?;
    let stored = storage.write(&volume::read_or_make(file)?)?;
    talk.result(&stored, || format!("{}\n{}", storage.output.display(), table(stored.rows())))
}

impl Storage {
    /// Refuses, before any work, a name that a reader would not expect.
    ///
    /// # Errors
    /// [`Error::Usage`] where the output is not named as KTX2 files are.
    pub fn check(&self) -> Result<()> {
        check_name(&self.output)
    }

    /// # Errors
    /// A value is out of the format's range, or the file cannot be written.
    pub fn write(&self, raw: &RawVolume) -> Result<Stored> {
        let sample = match self.format {
            Format::U8 => Sample::Unorm8,
            Format::U16 => Sample::Unorm16,
            Format::F16 => Sample::Float16,
            Format::F32 => Sample::Float32,
        };
        volume::write_raw(&self.output, raw, sample)?;
        let loss = Loss::of(raw, sample);
        Ok(Stored { output: self.output.clone(), size: raw.size, channels: raw.channels, loss })
    }
}

/// # Errors
/// [`Error::Usage`] where a file is not named as KTX2 files are.
pub fn check_name(path: &Path) -> Result<()> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ktx2")) {
        return Ok(());
    }
    let message = format!("{}: volumes are written as .ktx2", path.display());
    Err(Error::Usage { message, help: Some("give the file this extension".into()) })
}

impl Stored {
    /// For people.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let [width, height, depth] = self.size;
        let Loss { values, changed, largest, unit } = self.loss;
        let lost = if changed == 0 {
            "nothing".into()
        } else {
            format!("{changed} of {values} values are rounded, by {largest:.1e} at most")
        };
        let mut rows = vec![
            ("texels", format!("{width} x {height} x {depth}")),
            ("channels", self.channels.to_string()),
            ("precision lost", lost),
        ];
        if unit != 1.0 {
            rows.push(("stored as 1", unit.to_string()));
        }
        rows
    }
}
