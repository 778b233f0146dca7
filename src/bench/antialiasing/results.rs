//! What a benchmark of antialiasing found: the JSON file, which `docs/bench.md` describes key by key.

use std::path::PathBuf;

use serde::Serialize;

use super::Sweep;
use crate::bench::Environment;
use crate::frame::Image;
use crate::metric::Metrics;
use crate::volume::Filter;

/// Of [`Results::schema`].
pub const SCHEMA: u32 = 1;

/// All that was measured.
#[derive(Debug, Clone, Serialize)]
pub struct Results {
    /// 1; another number where keys have another meaning.
    pub schema: u32,
    /// What was asked for.
    pub sweep: Sweep,
    /// On what it was measured.
    pub environment: Environment,
    /// In the sweep's order.
    pub scenes: Vec<SceneResults>,
    /// One for each filter.
    pub means: Vec<FilterMean>,
}

/// What was measured of one scene.
#[derive(Debug, Clone, Serialize)]
pub struct SceneResults {
    /// The scene file.
    pub scene: PathBuf,
    /// One for each distance.
    pub pictures: Vec<Picture>,
}

/// What was measured from one distance.
#[derive(Debug, Clone, Serialize)]
pub struct Picture {
    /// Times that of the scene.
    pub distance: f64,
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// The level of detail in the middle of a tetrahedron: the median over all of them.
    pub level: f64,
    /// What the reference took to compute, in milliseconds.
    pub reference_milliseconds: f64,
    /// Whether the reference came from the cache.
    pub reference_reused: bool,
    /// One for each filter.
    pub points: Vec<Point>,
}

/// One filter from one distance.
#[derive(Debug, Clone, Serialize)]
pub struct Point {
    /// The filter.
    pub filter: Filter,
    /// Against the supersampled reference.
    #[serde(flatten)]
    pub error: Metrics,
    /// The sum of alpha over the picture as a part of the reference's, less 1: positive where too much is hidden.
    pub bias: f64,
}

/// A filter's error over all scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilterMean {
    /// The filter.
    pub filter: Filter,
    /// The geometric mean of the scenes' RMSE from each distance.
    pub by_distance: Vec<f64>,
    /// That over all scenes and distances.
    pub rmse: f64,
}

impl Point {
    /// A filter's picture measured against the reference.
    pub fn new(filter: Filter, error: Metrics, image: &Image, reference: &Image) -> Self {
        let alpha = |image: &Image| image.rgba.iter().map(|pixel| f64::from(pixel[3])).sum::<f64>();
        Self { filter, error, bias: alpha(image) / alpha(reference) - 1.0 }
    }
}

impl SceneResults {
    /// The scene's name for people: its file's, without the extension.
    pub fn name(&self) -> String {
        self.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// The means of each filter.
pub fn means(sweep: &Sweep, scenes: &[SceneResults]) -> Vec<FilterMean> {
    let of_filter = |(index, &filter): (usize, &Filter)| {
        let rmse = |scene: &SceneResults, distance: usize| scene.pictures[distance].points[index].error.rmse;
        let by_distance: Vec<f64> = (0..sweep.distances.len())
            .map(|distance| geometric_mean(scenes.iter().map(|scene| rmse(scene, distance))))
            .collect();
        FilterMean { filter, rmse: geometric_mean(by_distance.iter().copied()), by_distance }
    };
    sweep.filters.iter().enumerate().map(of_filter).collect()
}

fn geometric_mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    (values.map(f64::ln).sum::<f64>() / count).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_geometric_mean_is_one() {
        assert!((geometric_mean([1.0, 8.0, 27.0].into_iter()) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn bias_tells_what_is_hidden_too_much() {
        let mut reference = Image::new(2, 1);
        reference.rgba[0] = [0.1, 0.0, 0.0, 0.5];
        let mut image = reference.clone();
        image.rgba[1] = [0.0, 0.0, 0.0, 0.25];
        let error = crate::metric::compare(&image, &reference).unwrap();
        assert_eq!(Point::new(Filter::Paper, error, &image, &reference).bias, 0.5);
    }
}
