//! `mesoshell volume preview`: slices and a rendered slab as one picture.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use mesoshell::frame::{Backdrop, Image, file};
use mesoshell::gpu::DeviceChoice;
use mesoshell::mesh::generate::{Generator, Plane};
use mesoshell::method::{METHODS, Setup};
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::scene::Scene;
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::value::Colour;
use mesoshell::volume::{self, ControlPoint, Interpretation, Pyramid, TransferFunction, Volume, recipe};
use mesoshell::{Error, Result};
use serde::Serialize;

use super::super::Talk;
use super::super::progress::{Line, listen};

/// Show slices and a rendered slab of a volume in one picture
///
/// On the left are slices over a checkerboard: of constant w from the base upwards, seen from above, u to the right; below them those
/// through the middle of v, seen from the front, and of u, seen from the right. On the right is one tile on a plane, rendered by the
/// `shell` method. Values of one channel are shown as white, from transparent for the least to opaque for the greatest; red, green and
/// blue without alpha as opaque.
///
/// With --vary the slabs of a recipe and of its variations stand beside one another instead, each with what is varied below.
#[derive(Args)]
pub struct Arguments {
    /// A KTX2 or NRRD file, a folder or pattern of PNG slices, or a recipe (.toml)
    file: PathBuf,
    /// The picture: .png or .exr
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// The slab's height in tile widths; by default the recipe's, or that of texels that are cubes
    #[arg(long, value_parser = height)]
    height: Option<f64>,
    /// Lays a value over the recipe's: key=value
    #[arg(short = 'D', value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Adds a variation: "key=value", or several with commas between them
    #[arg(long, value_name = "KEY=VALUE,...")]
    vary: Vec<String>,
    /// The device: its number in `mesoshell devices`, a part of its name, or its UUID
    #[arg(long)]
    device: Option<DeviceChoice>,
}

/// What is printed with `--json`.
#[derive(Serialize)]
struct Previewed {
    output: PathBuf,
    width: u32,
    height: u32,
}

/// Pixels along and up each slab of a strip.
const STRIP: [u32; 2] = [232, 176];

/// Linear grey behind the slab.
const BACKGROUND: f32 = 0.12;

/// # Errors
/// The volume cannot be read, drawn or written.
pub fn run(arguments: &Arguments, talk: Talk) -> Result<()> {
    let Arguments { file: path, output, height, overrides, vary, device } = arguments;
    file::check_writable(output)?;
    let is_plain = overrides.is_empty() && vary.is_empty();
    if !is_plain && !volume::is_recipe(path) {
        let message = format!("{} is no recipe: it has no keys for -D and --vary", path.display());
        return Err(Error::Usage { message, help: Some("leave them out, or give a recipe (.toml)".into()) });
    }
    let interrupt = Interrupt::default();
    listen(&interrupt);
    let progress: Arc<dyn Progress> = Arc::new(Line::new(talk));
    let device = device.clone().unwrap_or_default();
    let setup = Setup { device: &device, validation: None, progress: &progress, interrupt: &interrupt };
    let render = |scene: Scene| {
        let view = scene.view;
        Ok::<_, Error>(METHODS[0].prepare(Arc::new(scene), &setup)?.render(&view)?.image)
    };
    let loaded = |overrides: &[String]| {
        progress.stage("loading the volume");
        let (volume, own_height) = load(path, overrides)?;
        interrupt.check()?;
        Ok::<_, Error>((volume, height.unwrap_or(own_height)))
    };
    let picture = if vary.is_empty() {
        let (volume, height) = loaded(overrides)?;
        let sheet = volume::contact_sheet(&volume);
        let slab = render(slab(volume, height, [sheet.height; 2])?)?;
        beside(&sheet, &slab)
    } else {
        let own = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut pictures = Vec::new();
        for (label, variation) in
            std::iter::once((own, None)).chain(vary.iter().map(|v| (v.clone(), Some(v))))
        {
            let overrides: Vec<String> = overrides.iter().chain(variation).cloned().collect();
            let (volume, height) = loaded(&overrides)?;
            pictures.push((label, render(slab(volume, height, STRIP)?)?));
        }
        volume::strip(&pictures, BACKGROUND)
    };
    progress.stage("writing the picture");
    file::write(output, &picture, &Backdrop::colour([BACKGROUND; 3]))?;
    drop(progress); // The progress line is wiped before anything else is said.
    let told = Previewed { output: output.clone(), width: picture.width, height: picture.height };
    talk.result(&told, || output.display().to_string())
}

/// The volume, and the height in tile widths for which it is meant.
fn load(path: &Path, overrides: &[String]) -> Result<(Volume, f64)> {
    if volume::is_recipe(path) {
        let recipe = recipe::load_with(path, overrides)?;
        return Ok((recipe.build()?, f64::from(recipe.header().height)));
    }
    let raw = volume::read(path)?;
    let transfer = (raw.channels == 1)
        .then(|| ramp(&raw.values))
        .transpose()
        .map_err(|invalid| Error::input(path, format!("its values cannot be shown: {invalid}")))?;
    let constant_alpha = (raw.channels == 3).then_some(1.0);
    let how = Interpretation { transfer, constant_alpha, ..Interpretation::default() };
    let volume = Volume::from_raw(raw, &how)?;
    let [width, _, depth] = volume.size.map(f64::from);
    Ok((volume, depth / width))
}

/// White, from transparent at the least value to opaque at the greatest.
fn ramp(values: &[f32]) -> std::result::Result<TransferFunction, volume::InvalidTransferFunction> {
    let least = values.iter().copied().fold(f32::INFINITY, f32::min);
    let greatest = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    // All equal: a range that ends there.
    let least = if least < greatest { least } else { greatest - 1.0 };
    let point = |value, alpha| ControlPoint { value, colour: Colour::linear(1.0, 1.0, 1.0), alpha };
    TransferFunction::new(vec![point(least, 0.0), point(greatest, 1.0)])
}

/// One tile on a plane, seen from the front, a little from the right and above.
fn slab(volume: Volume, height: f64, pixels: [u32; 2]) -> Result<Scene> {
    let [width, across, depth] = volume.size.map(f64::from);
    let plane = Plane { segments: 1, ..Plane::default() };
    let options = ShellOptions::new(height * plane.size);
    let mut mesh = Generator::Plane(plane).build()?;
    // A tile is as wide as the plane, and as deep as cubic texels make it.
    for position in &mut mesh.positions {
        position.z *= across / width;
    }
    let opacity_distance = options.thickness / depth;
    let shell = Shell::build(&mesh, &options)?;
    let mut scene = Scene::new(shell, Pyramid::build(volume), opacity_distance);
    [scene.view.width, scene.view.height] = pixels;
    // The slab fills less than the sphere around it; the lower the picture, the more it is as wide as that.
    let aspect = f64::from(pixels[1]) / f64::from(pixels[0]);
    scene.view.camera.fov_y *= if aspect < 1.0 { 1.04 * aspect } else { 0.95 };
    Ok(scene)
}

/// Two pictures of one height, the second over a grey.
fn beside(left: &Image, right: &Image) -> Image {
    let mut both = Image::new(left.width + right.width, left.height);
    let rows = both.rgba.chunks_mut((left.width + right.width) as usize);
    let sources = left.rgba.chunks(left.width as usize).zip(right.rgba.chunks(right.width as usize));
    for (row, (left, right)) in rows.zip(sources) {
        row[..left.len()].copy_from_slice(left);
        for (pixel, &[r, g, b, a]) in row[left.len()..].iter_mut().zip(right) {
            let behind = BACKGROUND * (1.0 - a);
            *pixel = [r + behind, g + behind, b + behind, 1.0];
        }
    }
    both
}

fn height(text: &str) -> std::result::Result<f64, String> {
    let height: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if (0.001..=1000.0).contains(&height) { Ok(height) } else { Err("it must be from 0.001 to 1000".into()) }
}
