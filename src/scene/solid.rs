//! Opaque surfaces: meshes that hide the volume and are hidden by it, cast shadows into it and receive its shadows; the base
//! mesh among them, where a scene asks for it. This is part of the scene, not of a method: the `shell` method and the reference
//! both obey it, each with its own code.
//!
//! The first triangle on a ray ends it: what the volume before it lets through sees the triangle's colour there. At a point of a
//! triangle, `(u, v)` being its texture coordinates and `t` what the texture has there at the level of detail
//! `log2(lod_footprint * z * pixel * rho)`, clamped and blended as the [medium's](super::Medium::lod_footprint), where `rho` is
//! [`Solid::texels_per_unit`]:
//!
//! ```text
//!   unlit   colour t
//!   lit     colour t (ambient + sum of E diffuse max(0, n.l)) + sum of E specular max(0, n.l) max(0, n.h)^shininess
//! ```
//!
//! with what [`shading`](super::shading) says of `E`, `l` and `h`. `n` is the mesh's normal, interpolated and of unit length. A
//! triangle has two sides, alike: `n` is turned round where the eye is behind the triangle, and a light on the other side of the
//! triangle than the eye, or in its plane, gives nothing.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DMat2, DVec2, DVec3};

use crate::mesh::Mesh;
use crate::volume::Pyramid;

/// An opaque mesh of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// The file of its texture, or that which names that, if it has any; for messages.
    pub origin: PathBuf,
    /// World space.
    pub mesh: Arc<Mesh>,
    /// Linear red, green, blue, each at least 0; multiplies the texture.
    pub colour: DVec3,
    /// What varies over the surface: levels of one texel along w, all of alpha 1; u runs to the right in the picture and v up,
    /// and both repeat. The reconstruction is that of volumes, in two dimensions.
    pub texture: Option<Arc<Pyramid>>,
}

impl Solid {
    /// The corners of a triangle, in world space.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.mesh.triangles[triangle].map(|id| self.mesh.positions[id as usize])
    }

    /// The world-space gradients of the three barycentric coordinates of a triangle, in its plane; zero where it has no area.
    pub fn gradients(&self, triangle: usize) -> [DVec3; 3] {
        let [a, b, c] = self.corners(triangle);
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let area = normal.length_squared();
        if area == 0.0 {
            return [DVec3::ZERO; 3];
        }
        let [of_b, of_c] = [ac.cross(normal) / area, normal.cross(ab) / area];
        [-of_b - of_c, of_b, of_c]
    }

    /// How many texels of the full texture lie along a world unit of a triangle, in the direction in which they are densest;
    /// 0 without a texture.
    pub fn texels_per_unit(&self, triangle: usize) -> f64 {
        let Some(texture) = &self.texture else { return 0.0 };
        let [width, height, _] = texture.levels[0].size.map(f64::from);
        let uvs = self.mesh.uvs[triangle];
        let (mut u, mut v) = (DVec3::ZERO, DVec3::ZERO);
        for (gradient, uv) in self.gradients(triangle).into_iter().zip(uvs) {
            u += gradient * (uv.x * width);
            v += gradient * (uv.y * height);
        }
        // The largest singular value of the map from the plane to texels.
        let gram = DMat2::from_cols(DVec2::new(u.dot(u), u.dot(v)), DVec2::new(u.dot(v), v.dot(v)));
        let (half_trace, determinant) = (0.5 * (gram.x_axis.x + gram.y_axis.y), gram.determinant());
        (half_trace + (half_trace * half_trace - determinant).max(0.0).sqrt()).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::Volume;

    #[test]
    fn texels_are_densest_along_the_shorter_way() {
        let texels = vec![[1.0; 4]; 32];
        let texture = Pyramid::build(Volume::new([8, 4, 1], texels).unwrap());
        let texture = Some(Arc::new(texture));
        let mesh = Arc::new(Mesh::triangle());
        let mut solid = Solid { origin: PathBuf::new(), mesh, colour: DVec3::ONE, texture };
        assert!((solid.texels_per_unit(0) - 8.0).abs() < 1e-12);
        Arc::make_mut(&mut solid.mesh).positions[2] = 0.1 * DVec3::Y;
        assert!((solid.texels_per_unit(0) - 40.0).abs() < 1e-12);
        let [a, b, c] = solid.gradients(0);
        assert!(
            (a + b + c).length() < 1e-12
                && b.distance(DVec3::X) < 1e-12
                && c.distance(10.0 * DVec3::Y) < 1e-12
        );
        solid.texture = None;
        assert_eq!(solid.texels_per_unit(0), 0.0);
    }
}
