//! `mesoshell mesh`: what a mesh file holds, and figures to voxelise.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use clap::builder::PossibleValuesParser;
use mesoshell::Result;
use mesoshell::mesh::figure::Figure;
use mesoshell::mesh::gltf::{self, Contents, Gltf};
use mesoshell::mesh::info::{self, Info};
use mesoshell::mesh::obj;
use mesoshell::mesh::projection::Projection;
use serde::Serialize;

use super::{Talk, table};

#[derive(Subcommand)]
pub enum Command {
    /// Count what a mesh file holds
    Info {
        /// An OBJ or glTF file
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

/// What `info` prints with `--json`.
#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    info: Info,
    /// Of the mesh at rest.
    #[serde(flatten)]
    gltf: Option<Contents<'a>>,
}

fn tell(file: &Path, projection: Option<&Projection>, talk: Talk) -> Result<()> {
    let gltf = gltf::has_name_of_one(file).then(|| Gltf::load(file, projection)).transpose()?;
    let info = info::info(&match &gltf {
        Some(gltf) => gltf.mesh(None)?,
        None => obj::load(file, projection)?,
    });
    let told = Told { info, gltf: gltf.as_ref().map(Gltf::contents) };
    talk.result(&told, || {
        let info = &told.info;
        let mut rows = vec![
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
        if let Some(Contents { vertices, joints, morph_targets, clips }) = &told.gltf {
            rows.push(("vertices in the file", vertices.to_string()));
            rows.push(("joints", joints.to_string()));
            rows.push(("morph targets", morph_targets.to_string()));
            rows.extend(clips.iter().map(|clip| ("clip", format!("{}, {} s", clip.name, clip.duration))));
        }
        format!("{}\n{}", file.display(), table(rows))
    })
}
