//! How many texels of the full volume one tetrahedron spans: what single precision resolves and a march can follow has an end.

use glam::DVec3;
use rayon::prelude::*;

use crate::shell::Shell;

/// The most texels along u or v. A device has texture coordinates in f32: of so many texels they tell a sixteenth of one.
pub const MOST_TEXELS: f64 = (1 << 20) as f64;

/// The texture is too fine for a tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the texture coordinates of triangle {triangle} span {texels:.3e} texels along {axis}, expected at most {MOST_TEXELS}"
)]
pub struct TooFine {
    /// Of the base mesh.
    pub triangle: usize,
    /// `'u'` or `'v'`.
    pub axis: char,
    /// Of the full volume; may be infinite.
    pub texels: f64,
}

impl TooFine {
    /// What to do about it.
    pub const HELP: &str =
        "make shell.uv_scale or the mesh's own texture coordinates smaller, or use a coarser volume";
}

/// Whether no tetrahedron spans more than [`MOST_TEXELS`] along u or v of a volume of `size` texels.
///
/// # Errors
/// The first that does.
pub fn check(shell: &Shell, size: [u32; 3]) -> Result<(), TooFine> {
    let too_fine = |(t, corners): (usize, &[DVec3; 4])| {
        let extent = corners.iter().fold(corners[0], |most, &x| most.max(x))
            - corners.iter().fold(corners[0], |least, &x| least.min(x));
        let texels = [('u', extent.x * f64::from(size[0])), ('v', extent.y * f64::from(size[1]))];
        let found = texels.into_iter().find(|(_, texels)| *texels > MOST_TEXELS);
        found.map(|(axis, texels)| TooFine { triangle: t / 3, axis, texels })
    };
    shell.texture.par_iter().enumerate().find_map_first(too_fine).map_or(Ok(()), Err)
}

/// The length of the longest edge of a tetrahedron, in texels of a volume of `size`: no ray passes more in one.
pub fn longest(shell: &Shell, size: [u32; 3]) -> f64 {
    let size = DVec3::from_array(size.map(f64::from));
    let longest = |corners: &[DVec3; 4]| {
        let edges = (0..4).flat_map(|i| (0..i).map(move |j| ((corners[i] - corners[j]) * size).length()));
        edges.fold(0.0, f64::max)
    };
    shell.texture.par_iter().map(longest).reduce(|| 0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::mesh::generate::{Generator, Plane};
    use crate::shell::ShellOptions;

    /// Four quads, each half a unit of texture coordinates wide and high.
    fn shell(uv_scale: DVec2) -> Shell {
        let mesh = Generator::Plane(Plane { size: 1.0, segments: 2 }).build().unwrap();
        Shell::build(&mesh, &ShellOptions { uv_scale, ..ShellOptions::new(0.1) }).unwrap()
    }

    #[test]
    fn texels_are_counted_along_each_axis() {
        let most = f64::from(1 << 17);
        for (scale, size, axis) in [
            (DVec2::new(most, most), [16, 16, 4], None),
            (DVec2::new(-most, most), [16, 16, 4], None),
            (DVec2::new(1.001 * most, 1.0), [16, 16, 4], Some('u')),
            (DVec2::new(1.0, -1.001 * most), [16, 16, 4], Some('v')),
            (DVec2::new(most, 1.0), [17, 16, 4], Some('u')),
            (DVec2::new(1.0, 1e30), [1, 1, 1], Some('v')),
        ] {
            let found = check(&shell(scale), size).err().map(|error| error.axis);
            assert_eq!(found, axis, "{scale} {size:?}");
        }
    }

    #[test]
    fn the_longest_edge_is_a_diagonal() {
        // Half of 6 repeats of 16 texels, half of 4 of 8, 4 along w.
        let expected = DVec3::new(48.0, 16.0, 4.0).length();
        let found = longest(&shell(DVec2::new(6.0, 4.0)), [16, 8, 4]);
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
    }
}
