//! What was found in a sequence.

use std::path::PathBuf;

use serde::Serialize;

use super::faults::Faults;
use super::fold::{Fold, Thickness};
use super::overlap::Overlaps;
use super::pops::Pops;
use super::stretch::Stretch;
use crate::frame::Stage;

/// All that was found, as it is written to `results.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// The scene file.
    pub scene: PathBuf,
    /// What rendered it.
    pub device: String,
    /// Of the pictures, in pixels.
    pub width: u32,
    /// Of the pictures, in pixels.
    pub height: u32,
    /// Of the shell.
    pub tetrahedra: u64,
    /// Frames a second.
    pub rate: f64,
    /// The frame with the largest stretch or the largest compression, by their ratio to 1.
    pub most_deformed: u32,
    /// Those walked, ascending.
    pub frames: Vec<FrameResults>,
}

/// What was found in a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameResults {
    /// From 1.
    pub frame: u32,
    /// Inverted tetrahedra and slivers.
    #[serde(flatten)]
    pub faults: Faults,
    /// Of the texture map, against the first frame of the timeline.
    pub stretch: Stretch,
    /// In force.
    pub thickness: Thickness,
    /// How thick the shell could be.
    pub fold: Fold,
    /// Of the shell with itself.
    pub overlaps: Overlaps,
    /// In the order of visibility.
    pub order: OrderResults,
    /// Against the frame before; `None` in the first of a timeline that does not loop, and after a gap.
    pub pops: Option<Pops>,
    /// Loading and rendering, in the order in which they ran.
    pub stages: Vec<Stage>,
    /// What was kept of the frame before, in words.
    pub skipped: Vec<String>,
}

/// What [`order::check`](crate::order::check()) found along the rays of all pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct OrderResults {
    /// Pairs of tetrahedra on one ray.
    pub pairs: u64,
    /// Of these, in the wrong order.
    pub violations: u64,
    /// Of these, intersecting: neither order is right.
    pub overlapping: u64,
    /// Cycles of tetrahedra that have no order.
    pub cycles: u64,
    /// Tetrahedra in these.
    pub cycle_members: u64,
}

impl FrameResults {
    /// The largest of stretch and compression, as a factor that is at least 1.
    pub fn deformation(&self) -> f64 {
        self.stretch.greatest.max(self.stretch.least.recip())
    }

    /// What is wrong with the frame, each a few words; empty where nothing is.
    pub fn faults(&self) -> Vec<String> {
        let of = |count: u64, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            _ => Some(format!("{count} {many}")),
        };
        let pops = self.pops.as_ref().map_or(0, |pops| pops.pixels);
        [
            of(self.faults.inverted.count, "inverted tetrahedron", "inverted tetrahedra"),
            of(self.overlaps.pairs, "pair of tetrahedra intersects", "pairs of tetrahedra intersect"),
            of(self.order.violations, "pair in the wrong order", "pairs in the wrong order"),
            of(pops, "pixel pops", "pixels pop"),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

impl Results {
    /// Whether no frame has a fault.
    pub fn is_clean(&self) -> bool {
        self.frames.iter().all(|frame| frame.faults().is_empty())
    }

    /// The first frame in which the shell is folded.
    pub fn folds_in(&self) -> Option<&FrameResults> {
        self.frames.iter().find(|frame| frame.faults.inverted.count > 0)
    }

    /// The frame that bears the least thickness, if any thickness is too much.
    pub fn tightest(&self) -> Option<&FrameResults> {
        let with_factor = self.frames.iter().filter(|frame| frame.fold.factor.is_some());
        with_factor.min_by(|a, b| a.fold.factor.unwrap_or(0.0).total_cmp(&b.fold.factor.unwrap_or(0.0)))
    }

    /// What is to be said about the thickness, in a sentence or two.
    pub fn told_fold(&self) -> String {
        let Some(tightest) = self.tightest() else {
            return "No thickness folds the shell in any frame.".to_owned();
        };
        let Fold { factor, tetrahedron, flipped } = tightest.fold;
        let (factor, tetrahedron) = (factor.unwrap_or(0.0), tetrahedron.unwrap_or(0));
        if flipped > 0 {
            return format!(
                "In frame {} {flipped} tetrahedra are inverted at any thickness, the first is {tetrahedron}: their direction of \
                 extrusion points through the base.",
                tightest.frame
            );
        }
        match self.folds_in() {
            None => format!(
                "The shell never folds: its thickness may be {} times what it is, until tetrahedron {tetrahedron} turns over in \
                 frame {}.",
                rounded_down(factor),
                tightest.frame
            ),
            Some(first) => format!(
                "The shell folds from frame {}. Its thickness must be at most {} times what it is, {} % less, so that it never \
                 does: in frame {} tetrahedron {tetrahedron} turns over first.",
                first.frame,
                rounded_down(factor),
                f64::ceil(1e3 * (1.0 - factor)) / 10.0,
                tightest.frame
            ),
        }
    }
}

/// To four digits, so that what is told is still safe.
pub fn rounded_down(factor: f64) -> f64 {
    if factor > 0.0 && factor.is_finite() {
        let unit = 10.0_f64.powf(3.0 - factor.log10().floor());
        (factor * unit).floor() / unit
    } else {
        factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_rounded_down() {
        assert_eq!([0.123_49, 1.0, 75.399, 0.0].map(rounded_down), [0.123_4, 1.0, 75.39, 0.0]);
    }
}
