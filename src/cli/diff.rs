//! `mesoshell diff`: how far two images are apart, and where.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use mesoshell::frame::{Backdrop, Image, file};
use mesoshell::metric::{self, Comparison, Metrics, map};
use mesoshell::{Error, Result};
use serde::Serialize;

use super::{Talk, table};

/// The images differ by more than they may.
const DIFFERENT: u8 = 1;

/// Compare two images, PNG or EXR
///
/// RMSE, maximum, 99.9th percentile and PSNR are those of linear premultiplied RGBA. FLIP is what a person sees who
/// flips between the two, laid over a background and clamped to 0..1, on a screen with 67 pixels per degree.
#[derive(Args)]
pub struct Arguments {
    /// An image
    a: PathBuf,
    /// The image that it is compared with
    b: PathBuf,
    /// What --threshold holds for
    #[arg(long, value_enum, default_value_t = Metric::Rmse, requires = "threshold")]
    metric: Metric,
    /// End with exit code 1 where the metric is above this; psnr: below
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = threshold)]
    threshold: Option<f64>,
    /// What lies behind the images for FLIP and for the maps: linear red, green, blue
    #[arg(long, value_name = "R,G,B", value_parser = color, default_value = "0,0,0")]
    background: [f32; 3],
    /// Write where A is brighter (red), B is (blue), neither (white), in linear luminance
    #[arg(long, value_name = "FILE.png", value_parser = png)]
    map: Option<PathBuf>,
    /// The difference that has the full red or blue of --map; by default the 99.9th percentile of all
    #[arg(long, value_name = "R", requires = "map", value_parser = range)]
    range: Option<f32>,
    /// Write the FLIP error of each pixel, in magma: black is 0, light yellow is 1
    #[arg(long, value_name = "FILE.png", value_parser = png)]
    flip_map: Option<PathBuf>,
}

fn threshold(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(threshold) if threshold.is_finite() => Ok(threshold),
        _ => Err("expected a number, such as 0.02".to_owned()),
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Metric {
    /// Root of the mean square error
    Rmse,
    /// Largest error of a channel
    Max,
    /// 99.9th percentile of the errors of pixels
    P999,
    /// Peak signal to noise ratio, in decibels
    Psnr,
    /// Mean FLIP error, 0 to 1
    Flip,
}

impl Metric {
    /// Written so that neither a threshold nor a metric that is not a number passes.
    fn passes(self, metrics: &Metrics, threshold: f64) -> bool {
        match self {
            Self::Rmse => metrics.rmse <= threshold,
            Self::Max => metrics.max <= threshold,
            Self::P999 => metrics.p999 <= threshold,
            Self::Psnr => metrics.psnr >= threshold,
            Self::Flip => metrics.flip <= threshold,
        }
    }
}

/// What is printed with `--json`.
#[derive(Serialize)]
struct Difference {
    #[serde(flatten)]
    metrics: Metrics,
    /// The range of the signed map, where one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    map_range: Option<f32>,
}

/// # Errors
/// An image cannot be read, their sizes differ, or a map cannot be made or written.
pub fn run(arguments: Arguments, talk: Talk) -> Result<ExitCode> {
    let Arguments { a: a_path, b: b_path, metric, threshold, background, map, range, flip_map } = arguments;
    check_outputs(&[&a_path, &b_path], &[&map, &flip_map])?;
    let (a, b) = (file::read(&a_path)?, file::read(&b_path)?);
    let Comparison { metrics, flip_errors } = metric::compare_over(&a, &b, background)?;
    if map.is_some() || flip_map.is_some() {
        check_numbers(&a_path, &a)?;
        check_numbers(&b_path, &b)?;
    }
    let black = Backdrop::colour([0.0; 3]);
    let mut map_range = None;
    if let Some(path) = map {
        let differences = map::luminance_differences(&a, &b, background)?;
        let range = *map_range.insert(range.unwrap_or_else(|| map::natural_range(&differences)));
        file::write(path, &map::signed(&differences, a.width, range), &black)?;
    }
    if let Some(path) = flip_map {
        file::write(path, &map::flip(&flip_errors, a.width), &black)?;
    }

    let difference = Difference { metrics, map_range };
    talk.result(&difference, || {
        let mut rows = vec![
            ("RMSE", format!("{:.6e}", metrics.rmse)),
            ("maximum", format!("{:.6e}", metrics.max)),
            ("99.9th percentile", format!("{:.6e}", metrics.p999)),
            ("PSNR", format!("{:.2} dB", metrics.psnr)),
            ("FLIP", format!("{:.6}", metrics.flip)),
            ("pixels", metrics.pixels.to_string()),
        ];
        rows.extend(map_range.map(|range| ("range of the map", format!("-{range:.3e} to {range:.3e}"))));
        format!("{} against {}\n{}", a_path.display(), b_path.display(), table(rows))
    })?;
    let passes = threshold.is_none_or(|threshold| metric.passes(&metrics, threshold));
    Ok(if passes { ExitCode::SUCCESS } else { DIFFERENT.into() })
}

/// Finds out, before anything is read, whether the maps can be written, and that they replace neither image nor
/// each other, by whatever names they are called.
fn check_outputs(images: &[&Path], maps: &[&Option<PathBuf>]) -> Result<()> {
    let mut taken: Vec<PathBuf> = images.iter().copied().map(real_path).collect();
    for path in maps.iter().copied().flatten() {
        let real = real_path(path);
        if taken.contains(&real) {
            let message = format!("{}: named for two things", path.display());
            return Err(Error::Usage { message, help: Some("give each map a file of its own".into()) });
        }
        file::check_writable(path)?;
        taken.push(real);
    }
    Ok(())
}

/// One path for all names of a file, whether it is there already or not.
fn real_path(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| match (path.parent(), path.file_name()) {
        (Some(parent), Some(name)) => {
            let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
            parent.canonicalize().unwrap_or_else(|_| parent.to_owned()).join(name)
        }
        _ => path.to_owned(),
    })
}

/// A value that is not finite has no place on a map.
fn check_numbers(path: &Path, image: &Image) -> Result<()> {
    let bad = image.rgba.iter().position(|pixel| pixel.iter().any(|x| !x.is_finite()));
    bad.map_or(Ok(()), |index| {
        let (x, y) = (index % image.width as usize, index / image.width as usize);
        Err(Error::input(path, format!("pixel ({x}, {y}) is not finite, and has no place on a map"))
            .with_help("compare without --map and --flip-map"))
    })
}

fn color(text: &str) -> std::result::Result<[f32; 3], String> {
    let channel = |text: &str| text.trim().parse().ok().filter(|x| (0.0..=1.0).contains(x));
    let channels: Option<Vec<f32>> = text.split(',').map(channel).collect();
    channels.and_then(|rgb| rgb.try_into().ok()).ok_or("three numbers from 0 to 1, as in 0.2,0.2,0.2".into())
}

fn range(text: &str) -> std::result::Result<f32, String> {
    let range = text.parse().ok().filter(|&x: &f32| x.is_finite() && x > 0.0);
    range.ok_or("a number above 0".into())
}

fn png(text: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    is_png.then_some(path).ok_or("maps are written as .png".into())
}
