//! Wind in the shell: directions of extrusion that lean with it.
//!
//! A direction `d` of unit length becomes `d + w`, of the same length again, where `w` is the wind: strength times direction, without
//! what of it blows into the surface. A normal at an angle `a` to the wind so turns by the arc tangent of
//! `s sin a / (1 + s max(cos a, 0))`, which grows smoothly with the strength `s`: never past the wind, and not at all in one from
//! straight above. In a gust `s` is the strength plus the amplitude times a noise that flows (see [`Flow`]).

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::Mesh;
use crate::mesh::flow::Flow;

/// The sine of the angle to the surface that a direction keeps: 5 degrees.
const LEAST_SINE: f64 = 0.087_155_742_747_658_17;

/// Positions that one task of the thread pool takes at least.
const TASK: usize = 1024;

/// Which of the noises it is.
const SEED: u32 = 1;

/// Wind that the outer vertices lean with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wind {
    /// Where it blows to, in world space; of unit length.
    pub direction: DVec3,
    /// The tangent of the angle by which a normal leans where the wind blows along the surface.
    pub strength: f64,
    /// Added to the strength times a noise in -0.87..0.87.
    pub gust: f64,
    /// Of the cells of the noise, in world units; positive.
    pub size: f64,
    /// Of the gusts, in turns: they are the same after one.
    pub phase: f64,
}

impl Wind {
    /// Turns directions of unit length, one a position.
    pub(super) fn turn(&self, mesh: &Mesh, directions: &mut [DVec3]) {
        let flow = (self.gust != 0.0).then(|| Flow::new(self.phase, SEED));
        directions.par_iter_mut().enumerate().with_min_len(TASK).for_each(|(id, direction)| {
            let noise = flow.as_ref().map_or(0.0, |flow| flow.at(mesh.positions[id] / self.size).0.x);
            *direction = self.leaning(*direction, mesh.normals[id], self.strength + self.gust * noise);
        });
    }

    /// A direction in a wind of that strength. It is never less than 5 degrees above the surface, unless it was before: then it
    /// comes no nearer.
    fn leaning(&self, direction: DVec3, normal: DVec3, strength: f64) -> DVec3 {
        let wind = strength * self.direction;
        let along = wind - wind.dot(normal).min(0.0) * normal;
        if along == DVec3::ZERO {
            return direction;
        }
        // Neither part is so large that its square is out of range.
        let scale = along.abs().max_element().max(1.0);
        let Some(leaning) = (direction / scale + along / scale).try_normalize() else { return direction };
        let least = direction.dot(normal).min(LEAST_SINE);
        if leaning.dot(normal) >= least {
            return leaning;
        }
        let flat = leaning.reject_from_normalized(normal);
        flat.try_normalize().map_or(direction, |flat| least * normal + (1.0 - least * least).sqrt() * flat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Generator, Sphere};
    use crate::shell::{Shell, ShellOptions};

    const WIND: Wind = Wind { direction: DVec3::X, strength: 0.7, gust: 0.0, size: 0.5, phase: 0.0 };

    fn sphere() -> Mesh {
        Generator::Sphere(Sphere { radius: 1.0, segments: 24, rings: 12 }).build().unwrap()
    }

    /// Of every position, where its outer vertex is from it.
    fn extrusions(mesh: &Mesh, wind: Option<Wind>) -> Vec<DVec3> {
        let shell = Shell::build(mesh, &ShellOptions { wind, ..ShellOptions::new(0.25) }).unwrap();
        let (base, outer) = shell.vertices.split_at(mesh.positions.len());
        base.iter().zip(outer).map(|(base, outer)| outer - base).collect()
    }

    #[test]
    fn no_wind_is_no_change() {
        let mesh = sphere();
        let still = Shell::build(&mesh, &ShellOptions::new(0.25)).unwrap();
        let wind = Some(Wind { strength: 0.0, ..WIND });
        let calm = Shell::build(&mesh, &ShellOptions { wind, ..ShellOptions::new(0.25) }).unwrap();
        assert_eq!(still, calm);
    }

    #[test]
    fn the_shell_leans_by_the_angle_that_is_told_and_keeps_its_length() {
        let mesh = sphere();
        for strength in [1e-3, 0.7, 5.0] {
            let found = extrusions(&mesh, Some(Wind { strength, ..WIND }));
            for (extrusion, normal) in found.iter().zip(&mesh.normals) {
                assert!((extrusion.length() - 0.25).abs() < 1e-12);
                let sine = DVec3::X.reject_from_normalized(*normal).length();
                let expected = (strength * sine).atan2(1.0 + strength * normal.x.max(0.0));
                // An angle near 0 between vectors with errors of 1e-16 is known to their square root.
                assert!((extrusion.angle_between(*normal) - expected).abs() < 1e-7, "{extrusion} {normal}");
                assert!(extrusion.x >= 0.25 * normal.x - 1e-12, "against the wind");
            }
        }
    }

    #[test]
    fn a_storm_leaves_five_degrees() {
        let mesh = sphere();
        for strength in [30.0, 1e200, -1e200] {
            let found = extrusions(&mesh, Some(Wind { strength, ..WIND }));
            let heights = found.iter().zip(&mesh.normals).map(|(e, normal)| e.dot(*normal) / 0.25);
            let lowest = heights.fold(1.0, f64::min);
            assert!((lowest - 5f64.to_radians().sin()).abs() < 1e-12, "{lowest}");
            assert!(found.iter().all(|e| (e.length() - 0.25).abs() < 1e-12));
        }
    }

    #[test]
    fn gusts_come_back_after_a_turn_and_differ_between() {
        let mesh = sphere();
        let at = |phase: f64| extrusions(&mesh, Some(Wind { gust: 0.5, phase, ..WIND }));
        let farthest =
            |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        let start = at(0.0);
        assert_eq!(start, at(1.0));
        assert!(farthest(&start, &at(0.5)) > 0.02, "an opposite noise");
        assert!(farthest(&start, &extrusions(&mesh, Some(WIND))) > 0.01, "no gust");
        // The gradients turn by 2 pi 1e-4; the noise and so what leans by less than 0.25 * 0.5 * 2 pi * 1e-4.
        assert!(farthest(&start, &at(1e-4)) < 8e-5);
    }
}
