//! `mesoshell volume`: what a volume holds, and ways to make one.

mod preview;
mod store;
mod voxelize;

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
    Make(store::Make),
    Convert(store::Convert),
    Voxelize(voxelize::Arguments),
    Preview(preview::Arguments),
}

/// # Errors
/// The volume cannot be read, made or written.
pub fn run(command: Command, talk: Talk) -> Result<()> {
    match command {
        Command::Info { file } => info(&file, talk),
        Command::Make(arguments) => store::make(&arguments, talk),
        Command::Convert(arguments) => store::convert(&arguments, talk),
        Command::Voxelize(arguments) => voxelize::run(&arguments, talk),
        Command::Preview(arguments) => preview::run(&arguments, talk),
    }
}

fn info(file: &std::path::Path, talk: Talk) -> Result<()> {
    let info = volume::info(file)?;
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

/// The texels along u, v, w: `128x128x32`.
fn size(text: &str) -> std::result::Result<[u32; 3], String> {
    let sides: Vec<_> =
        text.split(['x', 'X']).map(str::parse).collect::<std::result::Result<_, _>>().unwrap_or_default();
    let size = <[u32; 3]>::try_from(sides).map_err(|_| "write it as 128x128x32")?;
    if size.contains(&0) { Err("every axis needs at least one texel".into()) } else { Ok(size) }
}
