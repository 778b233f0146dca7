//! What was measured: `docs/bench.md` describes the JSON file key by key.

use serde::Serialize;

use super::sweep::{Measure, Sweep};
use crate::bench::Environment;
use crate::bench::fit::slope;
use crate::bench::results::{StageTiming, Timing};

/// Of [`Results`]; another number means that keys have another meaning.
pub const SCHEMA: u32 = 1;

/// The name under which whole frames are told beside their stages.
pub const FRAME: &str = "frame";

/// All that a sweep measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// [`SCHEMA`].
    pub schema: u32,
    /// What was asked for.
    pub sweep: Sweep,
    /// On what it was measured.
    pub environment: Environment,
    /// In the sweep's order.
    pub series: Vec<SeriesResults>,
}

/// One scene at several sizes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SeriesResults {
    /// For people.
    pub name: String,
    /// What the sizes are of.
    pub of: Measure,
    /// In the sweep's order.
    pub points: Vec<Point>,
    /// Of whole frames, and of each stage that all points have.
    pub growth: Vec<Growth>,
    /// By how many bytes the memory grows for each one more, from the first size to the last; where the system tells, and the last is
    /// the larger.
    pub bytes_each: Option<f64>,
}

/// The scene at one size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// How many.
    pub size: u64,
    /// The time of a whole frame, readback included.
    pub frame: Timing,
    /// The stages of loading, and those of frames.
    pub stages: Vec<StageTiming>,
    /// The most that the process held in memory while it loaded the scene and drew it, above what it held before, in bytes.
    pub memory: Option<u64>,
}

/// How a time grows with the size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Growth {
    /// A stage, or [`FRAME`].
    pub stage: String,
    /// Of log time over log size, by least squares.
    pub slope: f64,
}

impl Point {
    /// Without a frame yet.
    pub fn new(size: u64) -> Self {
        Self { size, frame: Timing::default(), stages: Vec::new(), memory: None }
    }

    /// The median, in milliseconds, of a stage or of [`FRAME`].
    pub fn milliseconds(&self, stage: &str) -> Option<f64> {
        if stage == FRAME {
            return Some(self.frame.median);
        }
        self.stages.iter().find(|timing| timing.name == stage).map(|timing| timing.time.median)
    }
}

impl SeriesResults {
    /// Concludes from its points.
    pub fn new(name: &str, of: Measure, points: Vec<Point>) -> Self {
        let stages =
            points.first().into_iter().flat_map(|point| &point.stages).map(|stage| stage.name.as_str());
        let growth = |stage: &str| {
            let times: Option<Vec<[f64; 2]>> =
                points.iter().map(|point| Some([point.size as f64, point.milliseconds(stage)?])).collect();
            Some(Growth { stage: stage.to_owned(), slope: slope(&times?)? })
        };
        let growth = [FRAME].into_iter().chain(stages).filter_map(growth).collect();
        let memory = |point: &Point| point.memory.map(|bytes| (point.size as f64, bytes as f64));
        let ends = [points.first(), points.last()].map(|point| point.and_then(memory));
        let bytes_each = match ends {
            [Some((few, little)), Some((many, much))] if many > few => Some((much - little) / (many - few)),
            _ => None,
        };
        Self { name: name.to_owned(), of, points, growth, bytes_each }
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::bench::results::add_stages;
    use crate::frame::Stage;

    /// Frames in proportion to the size, a stage with its square root; 100 bytes each.
    pub fn series() -> SeriesResults {
        let point = |size: u64| {
            let mut point = Point::new(size);
            for _ in 0..3 {
                point.frame.push(0.5 * size as f64);
                let order = Stage { name: "order".to_owned(), milliseconds: (size as f64).sqrt() };
                add_stages(&mut point.stages, &[order]);
            }
            point.memory = Some(1000 + 100 * size);
            point
        };
        SeriesResults::new("finer", Measure::Tetrahedra, [10, 100, 1000].map(point).to_vec())
    }

    #[test]
    fn growth_is_concluded() {
        let series = series();
        let [frame, order] = series.growth.as_slice() else { panic!("{:?}", series.growth) };
        assert_eq!((frame.stage.as_str(), order.stage.as_str()), ("frame", "order"));
        assert!((frame.slope - 1.0).abs() < 1e-12 && (order.slope - 0.5).abs() < 1e-12);
        assert!((series.bytes_each.unwrap() - 100.0).abs() < 1e-9);
    }

    #[test]
    fn a_stage_that_not_all_have_has_no_growth() {
        let mut points = series().points;
        points[1].stages.clear();
        let series = SeriesResults::new("gap", Measure::Texels, points);
        assert_eq!(series.growth.len(), 1);
    }
}
