//! Derivatives of alpha as the texture has it: u and v repeat, beyond the ends of w it goes on unchanged.

use glam::DVec3;

use super::super::Volume;

/// Central differences of alpha at a texel, per texel along u, v, w.
pub(super) fn gradient_per_texel(volume: &Volume, at: [u32; 3]) -> DVec3 {
    let alpha = |at: [u32; 3]| f64::from(volume.texel(at)[3]);
    DVec3::from_array(std::array::from_fn(|axis| {
        let [before, after] = neighbours(volume.size, at, axis);
        0.5 * (alpha(after) - alpha(before))
    }))
}

/// The texels before and after one along an axis.
pub(super) fn neighbours(size: [u32; 3], at: [u32; 3], axis: usize) -> [[u32; 3]; 2] {
    let (i, n) = (at[axis], size[axis]);
    let [before, after] =
        if axis == 2 { [i.saturating_sub(1), (i + 1).min(n - 1)] } else { [(i + n - 1) % n, (i + 1) % n] };
    [before, after].map(|index| {
        let mut texel = at;
        texel[axis] = index;
        texel
    })
}
