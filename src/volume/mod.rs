//! Volumes: RGBA 3D textures, their files, recipes and mip pyramids.

pub mod recipe;

/// An RGBA 3D texture in texture space (u, v, w).
///
/// Alpha is the opacity, 0..1, of a path of one `opacity_distance`; colour is linear and
/// premultiplied by alpha. Values between texel centres `(i + 1/2) / n` are linearly interpolated; u and v
/// repeat, w clamps to the edge.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// Texels along u, v, w; each at least 1.
    pub size: [u32; 3],
    /// `[r a, g a, b a, a]`, u fastest, then v, then w; all finite, alpha in 0..=1, colour at least 0.
    pub texels: Vec<[f32; 4]>,
}

/// A volume and its ever coarser copies; level `l` has `max(1, size >> l)` texels an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Pyramid {
    /// Level 0 is the full volume; the last level is one texel.
    pub levels: Vec<Volume>,
}
