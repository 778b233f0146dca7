//! The sizes of a pyramid's texels, and how rays meet them.

use super::coverage::{halved, texels_per_coarse};

/// How much rays through a shell run along u, v and w: the mean square direction cosines of the rays to a surface seen from
/// all sides, `int cos^2 cos / int cos` over the hemisphere, which is 1/2 along the normal, and what is left of 1 along the
/// two tangents.
const ALONG_AXIS: [f64; 3] = [0.25, 0.25, 0.5];

/// A pyramid's levels.
pub struct Geometry {
    /// Texels along u, v and w of each level, the full volume's first.
    pub sizes: Vec<[u32; 3]>,
    /// The edges of a texel of the full volume, in opacity distances.
    texel: [f64; 3],
}

impl Geometry {
    /// Levels down to one texel.
    pub fn new(full: [u32; 3], texel: [f64; 3]) -> Self {
        let next = |size: &[u32; 3]| (*size != [1; 3]).then(|| halved(*size));
        Self { sizes: std::iter::successors(Some(full), next).collect(), texel }
    }

    /// The edges of a level's texels, in opacity distances.
    pub fn edges(&self, level: usize) -> [f64; 3] {
        let (full, size) = (self.sizes[0], self.sizes[level]);
        [0, 1, 2].map(|axis| self.texel[axis] * texels_per_coarse(full[axis], size[axis]))
    }

    /// What part of the rays through a level's texel count as beams along u, v and w: those that run along the axis, by the
    /// area that the texel shows them, its volume over its edge.
    pub fn beams(&self, level: usize) -> [f64; 3] {
        let edges = self.edges(level);
        let parts = [0, 1, 2].map(|axis| ALONG_AXIS[axis] / edges[axis]);
        let sum = parts.iter().sum::<f64>();
        parts.map(|part| part / sum)
    }

    /// The mean length of these beams within the texel, in opacity distances.
    pub fn beam_length(&self, level: usize) -> f64 {
        let edges = self.edges(level);
        self.beams(level).iter().zip(edges).map(|(part, edge)| part * edge).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_texels_are_seen_from_their_flat_side() {
        let geometry = Geometry::new([5, 3, 7], [1.0, 2.0, 0.001]);
        assert_eq!(geometry.sizes, [[5, 3, 7], [2, 1, 3], [1, 1, 1]]);
        assert_eq!(geometry.edges(2), [5.0, 6.0, 0.007]);
        assert!(geometry.beams(2)[2] > 0.998 && geometry.beam_length(2) < 2.0 * 0.007 * 1.001);
        let cube = Geometry::new([4; 3], [0.5; 3]);
        assert_eq!((cube.beams(1), cube.beam_length(1)), (ALONG_AXIS, 1.0));
    }
}
