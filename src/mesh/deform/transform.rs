//! The affine transform of a mesh: scaled, turned, moved, in this order.

use glam::{DAffine3, DQuat, DVec3, EulerRot};
use rayon::prelude::*;

use super::{TASK, carried};
use crate::mesh::Mesh;

/// Scales along the axes, then turns, then moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// None is 0; with one or three negative ones the mesh is mirrored.
    pub scale: DVec3,
    /// About the origin.
    pub rotation: DQuat,
    /// World units.
    pub translate: DVec3,
}

impl Transform {
    /// A turn about the world's X axis, then about its Y axis, then about its Z axis; in degrees, counter-clockwise seen from
    /// the end of the axis.
    pub fn euler(degrees: DVec3) -> DQuat {
        let [x, y, z] = degrees.to_array().map(f64::to_radians);
        DQuat::from_euler(EulerRot::ZYX, z, y, x)
    }

    /// Moves the mesh. Where it is mirrored its triangles run the other way round, so that they still face outwards, as the
    /// normals do.
    pub fn apply(&self, mesh: &mut Mesh) {
        let world_from_mesh =
            DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translate);
        let is_mirrored = self.scale.to_array().into_iter().filter(|scale| *scale < 0.0).count() % 2 == 1;
        let side = if is_mirrored { -1.0 } else { 1.0 };
        mesh.positions.par_iter_mut().zip(&mut mesh.normals).with_min_len(TASK).for_each(
            |(position, normal)| {
                *position = world_from_mesh.transform_point3(*position);
                *normal = side * carried(world_from_mesh.matrix3, *normal);
            },
        );
        if is_mirrored {
            mesh.triangles.iter_mut().for_each(|ids| ids.swap(1, 2));
            mesh.uvs.iter_mut().for_each(|uvs| uvs.swap(1, 2));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Generator, Sphere};
    use crate::mesh::info;

    const NONE: Transform =
        Transform { scale: DVec3::ONE, rotation: DQuat::IDENTITY, translate: DVec3::ZERO };

    fn sphere() -> Mesh {
        Generator::Sphere(Sphere { radius: 1.0, segments: 12, rings: 8 }).build().unwrap()
    }

    #[test]
    fn no_transform_changes_no_bit() {
        let mut mesh = sphere();
        NONE.apply(&mut mesh);
        assert_eq!(mesh.positions, sphere().positions);
    }

    #[test]
    fn turns_are_about_x_then_y_then_z() {
        let turned = Transform::euler(DVec3::new(90.0, 90.0, 0.0)) * DVec3::Y;
        assert!(turned.distance(DVec3::X) < 1e-15, "Y to Z about X, Z to X about Y: {turned}");
        let turned = Transform::euler(DVec3::new(0.0, 90.0, 90.0)) * DVec3::Z;
        assert!(turned.distance(DVec3::Y) < 1e-15, "Z to X about Y, X to Y about Z: {turned}");
    }

    /// The ellipsoid x^2 / 9 + y^2 / 4 + z^2 has the gradient (x / 9, y / 4, z).
    #[test]
    fn normals_are_those_of_the_ellipsoid() {
        let scale = DVec3::new(3.0, 2.0, 1.0);
        let mut mesh = sphere();
        Transform { scale, translate: DVec3::ONE, ..NONE }.apply(&mut mesh);
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            let expected = ((*position - DVec3::ONE) / (scale * scale)).normalize();
            assert!(normal.distance(expected) < 1e-14);
        }
    }

    #[test]
    fn mirrored_meshes_face_outwards() {
        for scale in [[-1.0, 1.0, 1.0], [1.0, -2.0, 1.0], [-1.0, -1.0, -3.0], [-1.0, -1.0, 1.0]] {
            let mut mesh = sphere();
            Transform {
                scale: scale.into(),
                rotation: Transform::euler(DVec3::new(10.0, 20.0, 30.0)),
                ..NONE
            }
            .apply(&mut mesh);
            assert_eq!(info(&mesh).triangles_against_normals, 0);
            assert!(mesh.positions.iter().zip(&mesh.normals).all(|(p, n)| p.dot(*n) > 0.0));
        }
    }
}
