//! Normals from the volume itself: minus the gradient of alpha (M. Levoy, *Display of surfaces from volume data*, 1988).

use glam::DVec3;

use super::super::Volume;
use super::derivatives::gradient_per_texel;

/// Minus the gradient with respect to (u, v, w): a covector of any length.
pub(super) fn normal(volume: &Volume, at: [u32; 3]) -> DVec3 {
    -gradient_per_texel(volume, at) * DVec3::from_array(volume.size.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Alpha that rises along one axis, whose texels are not cubes of texture space.
    #[test]
    fn a_normal_points_to_where_it_is_clear() {
        let size = [8, 4, 16];
        let texels = (0..512).map(|i| [0.0, 0.0, 0.0, (i / 32) as f32 / 32.0]).collect();
        let volume = Volume::new(size, texels).unwrap();
        let inside = normal(&volume, [3, 2, 7]);
        assert!((inside - DVec3::NEG_Z * 16.0 / 32.0).length() < 1e-6, "{inside}");
        // At the ends of w the texture goes on unchanged: half of the difference.
        assert!((normal(&volume, [0, 0, 15]) - 0.5 * inside).length() < 1e-6);
        assert!((normal(&volume, [0, 0, 0]) - 0.5 * inside).length() < 1e-6);
    }

    #[test]
    fn u_and_v_wrap() {
        let mut texels = vec![[0.0; 4]; 64];
        texels[0] = [0.0, 0.0, 0.0, 0.5];
        let volume = Volume::new([4, 4, 4], texels).unwrap();
        assert_eq!(normal(&volume, [3, 0, 0]), DVec3::NEG_X);
        assert_eq!(normal(&volume, [1, 0, 0]), DVec3::X);
        assert_eq!(normal(&volume, [0, 3, 0]), DVec3::NEG_Y);
        assert_eq!(normal(&volume, [0, 0, 3]), DVec3::ZERO, "w does not wrap");
        assert_eq!(normal(&volume, [2, 2, 2]), DVec3::ZERO);
    }
}
