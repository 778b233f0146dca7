//! `mesoshell volume info`: what a volume file or a recipe holds.

use std::path::PathBuf;

use clap::Subcommand;
use mesoshell::{Result, volume};

use super::{Talk, table};

#[derive(Subcommand)]
pub enum Command {
    /// Tell the size and the ranges of a volume
    Info {
        /// A KTX2 or NRRD file, a folder or pattern of PNG slices, or a recipe (.toml)
        file: PathBuf,
    },
}

/// # Errors
/// The volume cannot be read.
pub fn run(command: Command, talk: Talk) -> Result<()> {
    let Command::Info { file } = command;
    let info = volume::info(&file)?;
    talk.result(&info, || {
        let [width, height, depth] = info.size;
        let mut rows = vec![
            ("format", info.format.clone()),
            ("texels", format!("{width} x {height} x {depth}")),
            ("channels", info.channels.to_string()),
            ("as a texture", format!("{} KiB", info.texture_bytes.div_ceil(1024))),
        ];
        for range in &info.ranges {
            rows.push(("range", format!("{} to {}, mean {}", range.min, range.max, range.mean)));
        }
        format!("{}\n{}", file.display(), table(rows))
    })
}
