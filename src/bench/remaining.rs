//! How much of a sweep is done, in time: what is left is estimated from what was measured.

use std::cell::Cell;
use std::sync::Mutex;
use std::time::Instant;

use crate::progress::Progress;

/// Tells [`Progress`] the part of a whole sweep that is done, of the time that it takes.
pub struct Remaining<'a> {
    progress: &'a dyn Progress,
    begun: Instant,
    scenes_begun: Cell<usize>,
    scenes_to_come: Cell<usize>,
}

impl<'a> Remaining<'a> {
    /// Before the first of `scenes`.
    pub fn new(progress: &'a dyn Progress, scenes: usize) -> Self {
        let (scenes_begun, scenes_to_come) = (Cell::new(0), Cell::new(scenes));
        Self { progress, begun: Instant::now(), scenes_begun, scenes_to_come }
    }

    /// A scene begins.
    pub fn next_scene(&self) {
        self.scenes_begun.set(self.scenes_begun.get() + 1);
        self.scenes_to_come.set(self.scenes_to_come.get() - 1);
    }

    /// A part of the scene begins.
    pub fn stage(&self, name: &str) {
        self.progress.stage(name);
    }

    /// The current scene takes another `seconds`.
    pub fn scene_left(&self, seconds: f64) {
        let scenes = [self.scenes_begun.get(), self.scenes_to_come.get()];
        self.progress.fraction(fraction(self.begun.elapsed().as_secs_f64(), seconds, scenes));
    }

    /// Hears of the reference's progress, after which the scene takes another `seconds_after`.
    pub fn reference(&self, scene: &str, seconds_after: f64) -> impl Progress + use<'a> {
        Reference {
            progress: self.progress,
            name: format!("{scene}: reference"),
            begun: self.begun,
            scenes: [self.scenes_begun.get(), self.scenes_to_come.get()],
            seconds_after,
            stage_begun: Mutex::new(Instant::now()),
        }
    }
}

struct Reference<'a> {
    progress: &'a dyn Progress,
    name: String,
    begun: Instant,
    scenes: [usize; 2],
    seconds_after: f64,
    stage_begun: Mutex<Instant>,
}

impl Progress for Reference<'_> {
    fn stage(&self, _: &str) {
        self.progress.stage(&self.name);
        *self.stage_begun.lock().expect("no other holder panics") = Instant::now();
    }

    fn fraction(&self, done: f64) {
        let stage = self.stage_begun.lock().expect("no other holder panics").elapsed().as_secs_f64();
        let left = if done > 0.0 { stage * (1.0 - done) / done } else { 0.0 };
        let spent = self.begun.elapsed().as_secs_f64();
        self.progress.fraction(fraction(spent, left + self.seconds_after, self.scenes));
    }
}

/// The part that is done after `spent` seconds, where the current scene takes another `left`. Scenes to come are taken
/// to be as long as those begun.
fn fraction(spent: f64, left: f64, [begun, to_come]: [usize; 2]) -> f64 {
    let left = left + to_come as f64 * (spent + left) / begun.max(1) as f64;
    spent / (spent + left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_to_come_are_as_long_as_those_begun() {
        assert_eq!(fraction(10.0, 10.0, [1, 0]), 0.5);
        // 30 s for this scene, as much for each of the two others.
        assert_eq!(fraction(10.0, 20.0, [1, 2]), 10.0 / 90.0);
        // Two scenes of 20 s, one to come.
        assert_eq!(fraction(30.0, 10.0, [2, 1]), 0.5);
        assert_eq!(fraction(60.0, 0.0, [3, 0]), 1.0);
    }
}
