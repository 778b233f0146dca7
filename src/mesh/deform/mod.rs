//! Deformations of a mesh in space: each moves every point `x` to `F(x)`, one after the other.
//!
//! Twist, taper and bend are those of Alan Barr, "Global and local deformations of solid primitives", SIGGRAPH 1984;
//! `wave` and `noise` displace. All have a closed-form Jacobian `J`. A normal `n` becomes the cofactor matrix of `J` times
//! `n`, at unit length: `J` inverse transposed up to the sign of its determinant, as in Barr's paper, but with that sign it
//! stays with the triangles even where a deformation turns space inside out. So what was smooth stays smooth, and what
//! was an edge stays one.
//!
//! Positions along `axis` are measured from `centre`; lengths are in world units, angles in degrees, positive ones
//! counter-clockwise seen from the end of the axis.

mod axial;
mod displace;
mod transform;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

pub use axial::{Bend, Taper, Twist};
pub use displace::{Noise, Wave};
pub use transform::Transform;

use super::Mesh;
use super::flow::Flow;

/// One deformation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Deform {
    /// Sines that travel.
    Wave(Wave),
    /// A straight spine becomes an arc.
    Bend(Bend),
    /// Cross-sections are turned.
    Twist(Twist),
    /// Cross-sections are scaled.
    Taper(Taper),
    /// Displacement by noise.
    Noise(Noise),
}

/// A deformation with what is the same for all points computed.
enum Ready {
    Wave(Wave),
    Bend(Bend),
    Twist(Twist),
    Taper(Taper),
    Noise(Noise, Box<Flow>),
}

/// Vertices that one task of the thread pool takes at least: some 20 us of work.
const TASK: usize = 256;

/// Moves the mesh's positions by each deformation in turn, and its normals with them.
///
/// A normal stays where the surface is crushed to nothing (the Jacobian leaves no direction).
pub fn apply(deforms: &[Deform], mesh: &mut Mesh) {
    let ready: Vec<Ready> = deforms.iter().map(Ready::of).collect();
    mesh.positions.par_iter_mut().zip(&mut mesh.normals).with_min_len(TASK).for_each(|(position, normal)| {
        for deform in &ready {
            let (moved, jacobian) = deform.at(*position);
            *position = moved;
            *normal = carried(jacobian, *normal);
        }
    });
}

impl Ready {
    fn of(deform: &Deform) -> Self {
        match *deform {
            Deform::Wave(wave) => Self::Wave(wave),
            Deform::Bend(bend) => Self::Bend(bend),
            Deform::Twist(twist) => Self::Twist(twist),
            Deform::Taper(taper) => Self::Taper(taper),
            Deform::Noise(noise) => Self::Noise(noise, Box::new(Flow::new(noise.phase, noise.seed))),
        }
    }

    /// Where a point goes, and the Jacobian there.
    fn at(&self, point: DVec3) -> (DVec3, DMat3) {
        match self {
            Self::Wave(wave) => wave.at(point),
            Self::Bend(bend) => bend.at(point),
            Self::Twist(twist) => twist.at(point),
            Self::Taper(taper) => taper.at(point),
            Self::Noise(noise, flow) => noise.at(flow, point),
        }
    }
}

/// The unit normal after a map with this Jacobian.
pub(super) fn carried(jacobian: DMat3, normal: DVec3) -> DVec3 {
    (cofactor(jacobian) * normal).try_normalize().unwrap_or(normal)
}

/// The cofactor matrix.
pub(super) fn cofactor(DMat3 { x_axis: x, y_axis: y, z_axis: z }: DMat3) -> DMat3 {
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}

/// The matrix `column row^T`.
fn outer(column: DVec3, row: DVec3) -> DMat3 {
    DMat3::from_cols(column * row.x, column * row.y, column * row.z)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::mesh::generate::{Generator, Plane, Torus};
    use crate::mesh::{info, normals};

    fn examples() -> [Deform; 7] {
        let axis = DVec3::new(0.3, 1.0, -0.2).normalize();
        let centre = DVec3::new(0.1, -0.2, 0.3);
        let range = [-0.6, 0.7];
        let towards = axis.any_orthonormal_vector();
        let wave = Wave {
            axis,
            centre,
            direction: towards,
            amplitude: 0.2,
            wavelength: 1.3,
            phase: 0.2,
            range: None,
        };
        let noise = Noise { amplitude: 0.2, size: 0.7, phase: 0.3, seed: 4, direction: None };
        [
            Deform::Wave(wave),
            Deform::Wave(Wave { range: Some(range), ..wave }),
            Deform::Bend(Bend { axis, centre, towards, range, angle: 50.0 }),
            Deform::Twist(Twist { axis, centre, range, angle: 130.0 }),
            Deform::Taper(Taper { axis, centre, range, factor: 0.4 }),
            Deform::Noise(noise),
            Deform::Noise(Noise { direction: Some(axis), ..noise }),
        ]
    }

    /// Central differences with h = 1e-5, third derivatives below 500: 500 h^2 / 6 < 1e-8. Where the range ends the second
    /// derivative jumps, by at most 100: points within 2 h of it, of which there are hardly any, may be 100 h = 1e-3 off.
    #[test]
    fn jacobians_are_those_of_the_maps() {
        let mut random = Pcg64Mcg::seed_from_u64(11);
        for deform in examples() {
            let ready = Ready::of(&deform);
            let mut moved = 0.0f64;
            for _ in 0..400 {
                let point = DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
                let (position, jacobian) = ready.at(point);
                moved = moved.max(position.distance(point));
                for axis in 0..3 {
                    let mut step = DVec3::ZERO;
                    step[axis] = 1e-5;
                    let difference = (ready.at(point + step).0 - ready.at(point - step).0) / 2e-5;
                    let apart = difference.distance(jacobian.col(axis));
                    assert!(apart < 2e-8, "{deform:?} at {point}: {difference} for {}", jacobian.col(axis));
                }
            }
            assert!(moved > 0.05, "{deform:?} moves");
        }
    }

    /// The normals of a fine torus, deformed, against those of its deformed triangles. Rings of 1 degree: the facets' mean is off
    /// by the square of their angle, (pi / 180)^2 = 3e-4, times the curvature that deformation adds, some 20 at worst.
    #[test]
    fn normals_stay_those_of_the_surface() {
        let torus = Torus { major_radius: 0.7, minor_radius: 0.3, segments: 360, rings: 180 };
        let torus = Generator::Torus(torus).build().unwrap();
        for deform in examples() {
            let mut mesh = torus.clone();
            apply(&[deform], &mut mesh);
            let facets = normals::per_position(&mesh.positions, &mesh.triangles, None).unwrap();
            // Where the range of a linear ramp begins and ends there is a crease, and no normal.
            let off =
                mesh.normals.iter().zip(&facets).filter(|(n, facet)| n.dot(**facet) < 1.0 - 2e-5).count();
            assert!(off < mesh.normals.len() / 30, "{deform:?}: {off}");
            assert_eq!(info(&mesh).triangles_against_normals, 0, "{deform:?}");
        }
    }

    #[test]
    fn deformations_are_stacked_in_order() {
        let [.., bend, twist, _, _, _] = examples();
        let stacked = |deforms: &[Deform]| {
            let mut mesh = Generator::Plane(Plane::default()).build().unwrap();
            apply(deforms, &mut mesh);
            mesh
        };
        let both = stacked(&[bend, twist]);
        let mut one_by_one = stacked(&[bend]);
        apply(&[twist], &mut one_by_one);
        assert_eq!(both, one_by_one);
        assert_ne!(both, stacked(&[twist, bend]));
        assert_eq!(both.validate(), Ok(()));
    }
}
