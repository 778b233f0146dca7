//! `mesoshell mesh`: what a mesh file holds, and figures to voxelise.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use clap::builder::PossibleValuesParser;
use mesoshell::Result;
use mesoshell::mesh::figure::Figure;
use mesoshell::mesh::projection::Projection;
use mesoshell::mesh::{info, obj};
use serde::Serialize;

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
    /// Make a figure to voxelise
    Make {
        /// Which
        #[arg(value_parser = PossibleValuesParser::new(Figure::ALL.map(|(name, _)| name)))]
        figure: String,
        /// The OBJ file; its materials are written beside it, under the same name with .mtl
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
}

/// What `make` prints with `--json`.
#[derive(Serialize)]
struct Made {
    output: PathBuf,
    positions: usize,
    triangles: usize,
    materials: usize,
}

/// # Errors
/// The mesh cannot be read or written.
pub fn run(command: Command, talk: Talk) -> Result<()> {
    match command {
        Command::Info { file, projection } => tell(&file, projection.as_ref(), talk),
        Command::Make { figure, output } => make(&figure, output, talk),
    }
}

fn make(figure: &str, output: PathBuf, talk: Talk) -> Result<()> {
    let entry = Figure::ALL.iter().find(|(name, _)| *name == figure);
    let model = entry.expect("clap lets through the names of the table alone").1.model();
    obj::write_model(&output, &model)?;
    let (positions, triangles) = (model.positions.len(), model.triangles.len());
    let made = Made { output, positions, triangles, materials: model.materials.len() };
    talk.result(&made, || {
        let rows = [("positions", positions), ("triangles", triangles), ("materials", made.materials)];
        format!("{}\n{}", made.output.display(), table(rows.map(|(name, count)| (name, count.to_string()))))
    })
}

fn tell(file: &Path, projection: Option<&Projection>, talk: Talk) -> Result<()> {
    let info = info::info(&obj::load(file, projection)?);
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
