//! `mesoshell volume voxelize`: from a model to a volume.

use std::path::PathBuf;

use clap::Args;
use mesoshell::Result;
use mesoshell::mesh::obj;
use mesoshell::value::Colour;
use mesoshell::volume::voxelize::{Options, Scaling, Voxels, voxelize};
use mesoshell::volume::{RawVolume, Sample, write_raw};
use serde::de::value::{Error, StrDeserializer};
use serde::{Deserialize, Serialize};

use super::super::{Talk, table};
use super::store::{Storage, Stored, check_name};

/// Turn a model into a volume: coverage becomes opacity, materials and textures colour
///
/// The model's X becomes u, its -Z v, its Y w: it stands on the base of the shell. Opacity is the part of a texel that the model
/// fills. A closed mesh is filled inside, and its parts may overlap; an open one needs --surface.
#[derive(Args)]
pub struct Arguments {
    /// An OBJ file; its material files and textures are read too
    mesh: PathBuf,
    /// Texels along u, v, w
    #[arg(long, value_name = "UxVxW", value_parser = super::size)]
    size: [u32; 3],
    #[command(flatten)]
    storage: Storage,
    /// Scale the model along each axis to all the room that there is, not evenly
    #[arg(long, conflicts_with = "fit")]
    stretch: bool,
    /// Scale the model evenly to the room that there is (this is the default)
    #[arg(long)]
    fit: bool,
    /// Texels left free at every border but the base; below 0, the model sticks out across u and v
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_name = "TEXELS")]
    margin: f64,
    /// Let what sticks out across u and v come in again on the other side, as tiles do; else it is cut off
    #[arg(long)]
    tile: bool,
    /// Fill not the inside but a layer of this thickness around the mesh, which may be open
    #[arg(long, value_name = "TEXELS")]
    surface: Option<f64>,
    /// One colour for all of the model, "#rrggbb" (sRGB); materials are not read
    #[arg(long, value_name = "COLOUR", value_parser = colour)]
    colour: Option<Colour>,
    /// Store the surface's average normal in each texel too: three channels, -1 to 1, along u, v, w as lengths in texels; zero where
    /// there is no surface
    #[arg(long, value_name = "FILE")]
    normals: Option<PathBuf>,
}

/// What is printed with `--json`.
#[derive(Serialize)]
struct Voxelized {
    #[serde(flatten)]
    stored: Stored,
    normals: Option<PathBuf>,
    triangles: usize,
    /// Texels a unit of the model, along u, v, w.
    scale: [f64; 3],
    full_texels: usize,
    partly_filled_texels: usize,
}

/// # Errors
/// The model cannot be read or encloses nothing, or a file cannot be written.
pub fn run(arguments: &Arguments, talk: Talk) -> Result<()> {
    let Arguments { mesh, storage, normals: normals_file, .. } = arguments;
    storage.check()?;
    normals_file.as_deref().map(check_name).transpose()?;
    let model = obj::load_model(mesh, arguments.colour.map(|colour| colour.0))?;
    let options = Options {
        size: arguments.size,
        scaling: if arguments.stretch { Scaling::Stretch } else { Scaling::Fit },
        margin: arguments.margin,
        tile: arguments.tile,
        sheet: arguments.surface,
    };
    let voxels = voxelize(&model, &options)?;
    if let Some(path) = normals_file {
        write_raw(path, &voxels.raw_normals(), Sample::Float32)?;
    }
    let Voxels { volume, scale, .. } = voxels;
    let count = |is: fn(f32) -> bool| volume.texels.iter().filter(|[.., alpha]| is(*alpha)).count();
    let (full_texels, partly_filled_texels) = (count(|a| a == 1.0), count(|a| a > 0.0 && a < 1.0));
    let stored = storage.write(&RawVolume::of(volume, mesh, "voxels".into()))?;
    let triangles = model.triangles.len();
    let told = Voxelized {
        stored,
        normals: normals_file.clone(),
        triangles,
        scale,
        full_texels,
        partly_filled_texels,
    };
    talk.result(&told, || {
        let [u, v, w] = scale;
        let mut rows = told.stored.rows();
        rows.extend([
            ("triangles", triangles.to_string()),
            ("texels a unit", format!("{u} x {v} x {w}")),
            ("filled texels", full_texels.to_string()),
            ("partly filled texels", partly_filled_texels.to_string()),
        ]);
        format!("{}\n{}", storage.output.display(), table(rows))
    })
}

fn colour(text: &str) -> std::result::Result<Colour, Error> {
    Colour::deserialize(StrDeserializer::new(text))
}
