//! Displacements: waves and noise.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use super::outer;
use crate::mesh::flow::Flow;

/// Adds `amplitude sin(2 pi (s / wavelength - phase))` along `direction`, where `s` is the position along the axis: as the
/// phase grows by 1, the wave travels by one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// Unit length.
    pub axis: DVec3,
    /// Where `s` is 0.
    pub centre: DVec3,
    /// Unit length.
    pub direction: DVec3,
    /// World units.
    pub amplitude: f64,
    /// World units, above 0.
    pub wavelength: f64,
    /// In turns.
    pub phase: f64,
    /// Where along the axis, ascending, the amplitude grows from 0 to what it is, smoothly (`3 t^2 - 2 t^3`): a flag is tied at the
    /// beginning of it. Without it, it is the same everywhere.
    pub range: Option<[f64; 2]>,
}

/// Adds `amplitude` times [`Flow`] noise, whose cells are `size` wide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// World units.
    pub amplitude: f64,
    /// World units, above 0.
    pub size: f64,
    /// In turns: after one, all is as before.
    pub phase: f64,
    /// Which noise.
    pub seed: u32,
    /// Unit length: the only way in which points move. Without it they move in all three, by three noises.
    pub direction: Option<DVec3>,
}

impl Wave {
    pub(super) fn at(&self, point: DVec3) -> (DVec3, DMat3) {
        let along = (point - self.centre).dot(self.axis);
        let (sine, cosine) = (TAU * (along / self.wavelength - self.phase)).sin_cos();
        let (envelope, change) = self.range.map_or((1.0, 0.0), |[from, to]| {
            let t = ((along - from) / (to - from)).clamp(0.0, 1.0);
            (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / (to - from))
        });
        let height = self.amplitude * envelope * sine;
        let slope = self.amplitude * (envelope * cosine * TAU / self.wavelength + change * sine);
        (point + height * self.direction, DMat3::IDENTITY + outer(slope * self.direction, self.axis))
    }
}

impl Noise {
    pub(super) fn at(&self, flow: &Flow, point: DVec3) -> (DVec3, DMat3) {
        let (value, derivative) = flow.at(point / self.size);
        let slopes = derivative * (self.amplitude / self.size);
        match self.direction {
            None => (point + self.amplitude * value, DMat3::IDENTITY + slopes),
            Some(direction) => (
                point + self.amplitude * value.x * direction,
                DMat3::IDENTITY + outer(direction, slopes.row(0)),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_travels_along_its_axis() {
        let wave = |phase| Wave {
            axis: DVec3::X,
            centre: DVec3::ZERO,
            direction: DVec3::Z,
            amplitude: 0.5,
            wavelength: 2.0,
            phase,
            range: None,
        };
        let height = |wave: Wave, x: f64| wave.at(DVec3::X * x).0.z;
        assert!((height(wave(0.0), 0.5) - 0.5).abs() < 1e-15, "the crest is a quarter of the way");
        // A quarter of a turn, half a unit; a turn changes nothing. A few roundings of a sine.
        assert!((height(wave(0.25), 1.3) - height(wave(0.0), 0.8)).abs() < 1e-14);
        assert!((height(wave(1.0), 1.3) - height(wave(0.0), 1.3)).abs() < 1e-14);
        let tied = |x| height(Wave { range: Some([1.0, 3.0]), ..wave(0.1) }, x);
        assert_eq!(tied(0.7), 0.0);
        assert_eq!(tied(3.2), height(wave(0.1), 3.2));
        assert_eq!(tied(2.0), 0.5 * height(wave(0.1), 2.0));
    }
}
