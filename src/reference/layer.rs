//! The texture of one tetrahedron along a ray, at the level of detail that the ray asks for.
//!
//! The level of detail is `log2(detail * width)`, `width` being that of what sees through a pixel: a cone from the eye or from a
//! point light, a tube from a directional one. Between integer levels two of them are blended linearly.

use glam::DVec3;

use super::texture::{Cubic, Lattice, Texel};
use crate::scene::Scene;

/// The width of a pixel at `t` along a ray, in units of that at unit depth or of a directional light: `at_start + slope t`.
#[derive(Debug, Clone, Copy)]
pub struct Width {
    /// Where the ray starts.
    pub at_start: f64,
    /// Change per unit of `t`.
    pub slope: f64,
}

/// A ray with what it asks of the texture.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Where positions are measured from, in world space.
    pub eye: DVec3,
    /// Relative to the eye.
    pub start: DVec3,
    /// World units per unit of `t`.
    pub direction: DVec3,
    /// Of a pixel.
    pub width: Width,
    /// The level of detail is `log2(detail_per_texel * texels_across * width)`.
    pub detail_per_texel: f64,
}

/// One tetrahedron's medium along a span in which its levels do not change: its last `N` channels.
pub struct Layer<'a, const N: usize = 5> {
    width: Width,
    detail: f64,
    /// The finer level in play.
    pub level: usize,
    fine: Lattice<'a, N>,
    /// The next level, if the level of detail lies between the two.
    coarse: Option<Lattice<'a, N>>,
    /// Where the width does not change, the part of the coarser level: pieces are blended as they are loaded.
    part: Option<f64>,
    /// Of the current piece.
    fine_cubic: Cubic<N>,
    coarse_cubic: Cubic<N>,
    /// Texture coordinates where the span starts.
    pub texture: DVec3,
    /// Their change per unit of `t`.
    pub texture_slope: DVec3,
}

impl Width {
    /// At `t`.
    pub fn at(&self, t: f64) -> f64 {
        self.at_start + self.slope * t
    }
}

impl Ray {
    /// How the level of detail depends on the width in a tetrahedron.
    pub fn detail(&self, scene: &Scene, tetrahedron: usize) -> f64 {
        self.detail_per_texel * scene.texels_across(tetrahedron, self.direction)
    }

    /// The end, `to` at most, of the span from `start` on which no level of any `details` changes.
    pub fn span_end(&self, scene: &Scene, details: &[f64], start: f64, to: f64) -> f64 {
        let Width { at_start, slope } = self.width;
        if slope == 0.0 {
            return to;
        }
        let last_level = scene.volume.levels.len() - 1;
        let integer_levels = details.iter().flat_map(|detail| {
            (0..=last_level).map(move |level| ((level as f64).exp2() / detail - at_start) / slope)
        });
        integer_levels.filter(|&place| place > start).fold(to, f64::min)
    }
}

impl<'a, const N: usize> Layer<'a, N> {
    /// For the span from `start` with `middle` within.
    pub fn new(
        scene: &'a Scene,
        ray: &Ray,
        tetrahedron: usize,
        detail: f64,
        start: f64,
        middle: f64,
    ) -> Self {
        let shell = &scene.shell;
        let levels = &scene.volume.levels;
        let first_vertex = shell.vertices[shell.topology.tetrahedra[tetrahedron][0] as usize];
        let texture_from_world = shell.cells()[tetrahedron].texture_from_world;
        let from_vertex = (ray.eye - first_vertex) + (ray.start + start * ray.direction);
        let texture = shell.texture[tetrahedron][0] + texture_from_world * from_vertex;
        let texture_slope = texture_from_world * ray.direction;
        let last = levels.len() - 1;
        let level_of_detail = (detail * ray.width.at(middle)).log2().clamp(0.0, last as f64);
        let level = level_of_detail as usize;
        let is_between = level_of_detail > 0.0 && level < last;
        Self {
            width: ray.width,
            detail,
            level,
            fine: Lattice::new(&levels[level], texture, texture_slope),
            coarse: is_between.then(|| Lattice::new(&levels[level + 1], texture, texture_slope)),
            part: (ray.width.slope == 0.0).then_some(level_of_detail - level as f64),
            fine_cubic: Cubic::EMPTY,
            coarse_cubic: Cubic::EMPTY,
            texture,
            texture_slope,
        }
    }

    /// Whether two levels are blended.
    pub fn is_between(&self) -> bool {
        self.coarse.is_some()
    }

    /// The end, in `t` from the start of the span and `to` at most, of the piece that nothing cuts.
    pub fn piece_end(&self, to: f64) -> f64 {
        let lattices = std::iter::once(&self.fine).chain(self.coarse.as_ref());
        lattices.fold(to, |to, lattice| to.min(lattice.next_crossing()))
    }

    /// Passes all cuts up to `to`.
    pub fn pass(&mut self, to: f64) {
        std::iter::once(&mut self.fine).chain(self.coarse.as_mut()).for_each(|lattice| lattice.pass(to));
    }

    /// The length of a piece in texels of the finer level, along the axis on which it is most.
    pub fn texels_along(&self, length: f64) -> f64 {
        self.fine.cells_along(length)
    }

    /// Loads the cubics of a piece; whether there is anything in it.
    pub fn load(&mut self, from: f64, to: f64) -> bool {
        let fine = self.fine.cubic(from, to);
        let coarse = self.coarse.as_mut().and_then(|lattice| lattice.cubic(from, to));
        self.fine_cubic = fine.unwrap_or(Cubic::EMPTY);
        self.coarse_cubic = coarse.unwrap_or(Cubic::EMPTY);
        if let Some(part) = self.part.filter(|_| self.is_between()) {
            self.fine_cubic = self.fine_cubic.lerp(&self.coarse_cubic, part);
        }
        fine.is_some() || coarse.is_some()
    }

    /// Whether alpha is 1 all along the piece.
    pub fn is_wall(&self) -> bool {
        self.fine_cubic.is_wall() && (!self.is_between() || self.coarse_cubic.is_wall())
    }

    /// The texture at `x` (0..1) of the piece, which is at `t`.
    pub fn at(&self, x: f64, t: f64) -> Texel<N> {
        if self.part.is_some() {
            return self.fine_cubic.at(x);
        }
        self.blend(t, || self.fine_cubic.at(x), || self.coarse_cubic.at(x))
    }

    /// Of a value in the finer level and in the coarser one that at the level of detail at `t`, where the width changes.
    pub fn blend<const M: usize>(
        &self,
        t: f64,
        fine: impl Fn() -> Texel<M>,
        coarse: impl Fn() -> Texel<M>,
    ) -> Texel<M> {
        let fine = fine();
        if !self.is_between() {
            return fine;
        }
        let coarse = coarse();
        let part = ((self.detail * self.width.at(t)).log2() - self.level as f64).clamp(0.0, 1.0);
        std::array::from_fn(|c| (1.0 - part) * fine[c] + part * coarse[c])
    }
}
