//! `mesoshell mesh info`: what a mesh file holds.

use std::path::PathBuf;

use clap::Subcommand;
use mesoshell::Result;
use mesoshell::mesh::projection::Projection;
use mesoshell::mesh::{info, obj};

use super::{Talk, table};

#[derive(Subcommand)]
pub enum Command {
    /// Count what a mesh file holds
    Info {
        /// An OBJ file
        file: PathBuf,
        /// Where the file has no texture coordinates: planar-x, planar-y, planar-z, spherical or box
        #[arg(long, value_parser = str::parse::<Projection>)]
        projection: Option<Projection>,
    },
}

/// # Errors
/// The mesh cannot be read.
pub fn run(command: Command, talk: Talk) -> Result<()> {
    let Command::Info { file, projection } = command;
    let info = info::info(&obj::load(&file, projection.as_ref())?);
    talk.result(&info, || {
        let rows = [
            ("positions", info.positions.to_string()),
            ("triangles", info.triangles.to_string()),
            ("edges", info.edges.to_string()),
            ("boundary edges", info.boundary_edges.to_string()),
            ("non-manifold edges", info.non_manifold_edges.to_string()),
            ("texture seam edges", info.uv_seam_edges.to_string()),
            ("consistently oriented", info.consistently_oriented.to_string()),
            ("triangles against their normals", info.triangles_against_normals.to_string()),
            ("degenerate triangles", info.degenerate_triangles.to_string()),
            ("bounds", format!("{} to {}", info.low, info.high)),
            ("area", info.area.to_string()),
            ("texture coordinates", format!("{} to {}", info.uv_low, info.uv_high)),
        ];
        format!("{}\n{}", file.display(), table(rows))
    })
}
