//! The texel grid that a recipe fills.
//!
//! Recipes are drawn in *tile space*, where lengths are in tile widths and do not stretch: x and y run 0..1
//! along u and v and repeat, z runs from 0, the base surface, to `height`.

use glam::Vec3;
use rayon::prelude::*;

/// Where the texels of a volume lie in tile space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    /// Texels along u, v, w.
    pub size: [usize; 3],
    /// The shell's thickness in tile widths.
    pub height: f32,
}

impl Grid {
    /// Distance between texel centres along each axis, in tile widths.
    pub fn spacing(&self) -> Vec3 {
        Vec3::new(1. / self.size[0] as f32, 1. / self.size[1] as f32, self.height / self.size[2] as f32)
    }

    /// The coarsest spacing, in tile widths: nothing finer can be told apart, and edges are this soft.
    pub fn voxel(&self) -> f32 {
        self.spacing().max_element()
    }

    /// The most noise cells a tile that linear interpolation still follows: three texels a cell.
    pub fn finest_noise(&self) -> u32 {
        (1. / (3. * self.voxel())) as u32
    }

    /// The opacity of one voxel's path along w through a medium that absorbs `depth` (optical depth) over
    /// the whole thickness of the shell.
    pub fn opacity(&self, depth: f32) -> f32 {
        -(-depth / self.size[2] as f32).exp_m1()
    }

    /// The share of a voxel that lies inside a surface `distance` (tile widths, negative inside) away: a
    /// smooth edge, two voxels wide.
    pub fn coverage(&self, distance: f32) -> f32 {
        smoothstep(self.voxel(), -self.voxel(), distance)
    }

    /// Position of a texel's centre in tile space.
    pub fn position(&self, i: usize, j: usize, k: usize) -> Vec3 {
        Vec3::new(i as f32 + 0.5, j as f32 + 0.5, k as f32 + 0.5) * self.spacing()
    }

    /// Sets every texel to what `shade` says of its position.
    pub fn fill<T: Send>(&self, texels: &mut [T], shade: impl Fn(Vec3) -> T + Sync) {
        let [nu, nv, _] = self.size;
        texels.par_chunks_mut(nu).enumerate().for_each(|(row, texels)| {
            for (i, texel) in texels.iter_mut().enumerate() {
                *texel = shade(self.position(i, row % nv, row / nv));
            }
        });
    }

    /// Hands every slice of constant w to `draw`, which may treat it as its own.
    pub fn slices<T: Send>(&self, texels: &mut [T], draw: impl Fn(usize, &mut [T]) + Sync) {
        texels.par_chunks_mut(self.size[0] * self.size[1]).enumerate().for_each(|(k, slice)| draw(k, slice));
    }

    /// Blurs by half a texel or so along each axis (weights 1/4, 1/2, 1/4), so that no step is steeper than
    /// linear interpolation can follow.
    pub fn soften(&self, texels: &mut [[f32; 4]]) {
        let [nu, nv, _] = self.size;
        self.slices(texels, |_, slice| {
            slice.chunks_mut(nu).for_each(|row| soften_blocks(row, 1, true));
            soften_blocks(slice, nu, true);
        });
        soften_blocks(texels, nu * nv, false);
    }

    /// The texel indices along `axis` (0 or 1) whose centres lie between two tile coordinates, and their
    /// coordinates without wrapping; no index comes twice.
    pub fn between(&self, axis: usize, from: f32, to: f32) -> impl Iterator<Item = (usize, f32)> + Clone {
        let count = self.size[axis] as i64;
        let first = (from * count as f32 - 0.5).ceil() as i64;
        let last = ((to * count as f32 - 0.5).floor() as i64).min(first + count - 1);
        (first..=last)
            .map(move |index| (index.rem_euclid(count) as usize, (index as f32 + 0.5) / count as f32))
    }
}

/// Mixes blocks of `length` texels with the blocks before and after them; beyond the ends are the first and
/// last block again, the other way round where it `wraps`.
fn soften_blocks(texels: &mut [[f32; 4]], length: usize, wraps: bool) {
    let count = texels.len() / length;
    let first = texels[..length].to_vec();
    let mut before = if wraps { texels[texels.len() - length..].to_vec() } else { first.clone() };
    for index in 0..texels.len() {
        let (block, within) = (index / length, index % length);
        let here = texels[index];
        let after = match block + 1 < count {
            true => texels[index + length],
            false if wraps => first[within],
            false => here,
        };
        texels[index] = std::array::from_fn(|c| 0.25 * (before[within][c] + after[c]) + 0.5 * here[c]);
        before[within] = here;
    }
}

/// 0 at `from`, 1 at `to` (which may be the smaller), a smooth cubic between.
pub(super) fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0., 1.);
    t * t * (3. - 2. * t)
}

/// A premultiplied texel; colours below 0 are black.
pub(super) fn premultiplied(colour: Vec3, alpha: f32) -> [f32; 4] {
    (colour.max(Vec3::ZERO) * alpha).extend(alpha).to_array()
}

/// `colour` laid over a premultiplied texel.
pub(super) fn lay_over(texel: &mut [f32; 4], colour: Vec3, alpha: f32) {
    let over = premultiplied(colour, alpha);
    for (below, above) in texel.iter_mut().zip(over) {
        *below = *below * (1. - alpha) + above;
    }
}

/// `colour` laid over a premultiplied texel, whose alpha grows to no more than `alpha`: things that crowd
/// share a voxel, and the edge of the crowd is as soft as theirs.
pub(super) fn lay_among(texel: &mut [f32; 4], colour: Vec3, alpha: f32) {
    let fullest = texel[3].max(alpha);
    lay_over(texel, colour, alpha);
    let share = fullest / texel[3].max(f32::MIN_POSITIVE);
    *texel = texel.map(|channel| channel * share);
    texel[3] = fullest;
}
