//! What is lost when a volume is stored with fewer bits.

use serde::Serialize;

use super::{RawVolume, Sample, ktx2_file};

/// How far the values of a file are from those that were to be stored.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Loss {
    /// Values stored.
    pub values: u64,
    /// Values that come back as another.
    pub changed: u64,
    /// The largest difference, where 1 is stored as 1.
    pub largest: f32,
    /// The value that is stored as 1; else than 1 where integers become fractions.
    pub unit: f32,
}

impl Loss {
    /// What [`write_raw`](super::write_raw) loses with values that `sample` can hold.
    pub fn of(raw: &RawVolume, sample: Sample) -> Self {
        let unit = ktx2_file::stored_unit(raw, sample);
        let scaled = || raw.values.iter().map(|value| value / unit);
        let stored = sample.decode(&sample.encode(scaled(), raw.channels), raw.channels);
        let mut loss = Self { values: stored.len() as u64, changed: 0, largest: 0.0, unit };
        for (value, stored) in scaled().zip(stored) {
            loss.changed += u64::from(value != stored);
            loss.largest = loss.largest.max((value - stored).abs());
        }
        loss
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::AlphaMode;

    #[test]
    fn half_a_step_is_lost_at_most() {
        let raw = RawVolume {
            path: "a".into(),
            format: String::new(),
            size: [3, 1, 1],
            channels: 1,
            values: vec![0.0, 127.5, 255.0],
            full_scale: 255.0,
            alpha_mode: AlphaMode::Straight,
        };
        let loss = |sample| Loss::of(&raw, sample);
        assert_eq!(loss(Sample::Float32), Loss { values: 3, changed: 0, largest: 0.0, unit: 1.0 });
        let bytes = loss(Sample::Unorm8);
        assert_eq!((bytes.changed, bytes.unit), (1, 255.0));
        // Rounding of f32 beside half a step.
        assert!((bytes.largest - 0.5 / 255.0).abs() < 1e-7, "{bytes:?}");
    }
}
