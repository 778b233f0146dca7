//! The frame report: what a frame cost by stage, what it drew, what it skipped and why.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::Serialize;

/// Time spent in one named stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stage {
    /// `"order"`, `"order.abuffer"`, `"march"`, ...: a dot makes a part of the stage before it.
    pub name: String,
    /// Wall time in milliseconds.
    pub milliseconds: f64,
}

/// How a frame was made.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Report {
    /// The method's name.
    pub method: String,
    /// The device's name, or `"cpu"`.
    pub device: String,
    /// In the order in which they ran.
    pub stages: Vec<Stage>,
    /// What was drawn, counted: names say the unit (`"tetrahedra"`, `"pixels_covered"`).
    pub counts: BTreeMap<String, u64>,
    /// What was skipped and why, each a sentence.
    pub skipped: Vec<String>,
    /// What the user should know about the picture, each a sentence.
    pub warnings: Vec<String>,
}

/// Measures the stages of a report one after another.
#[derive(Debug)]
pub struct Stopwatch {
    last: Instant,
    stages: Vec<Stage>,
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self { last: Instant::now(), stages: Vec::new() }
    }

    /// Ends the current stage, names it, and begins the next.
    pub fn lap(&mut self, name: &str) {
        let now = Instant::now();
        self.add(name, now - self.last);
        self.last = now;
    }

    /// Adds a stage whose time was measured elsewhere (a device timestamp, a part of a stage); to one of that name, if there is one.
    pub fn add(&mut self, name: &str, time: Duration) {
        let milliseconds = time.as_secs_f64() * 1e3;
        match self.stages.iter_mut().find(|stage| stage.name == name) {
            Some(stage) => stage.milliseconds += milliseconds,
            None => self.stages.push(Stage { name: name.to_owned(), milliseconds }),
        }
    }

    /// The stages so far.
    pub fn finish(self) -> Vec<Stage> {
        self.stages
    }
}
