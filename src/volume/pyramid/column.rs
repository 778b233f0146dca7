//! Columns of texels, seen along their axis and merged by the opacity equation: exact, and associative, so that four texels
//! give one column whether merged at once or two by two.

use super::coverage::{coverage, texels_per_coarse, volume_of};
use super::medium::Passage;
use crate::volume::Volume;

/// A direction of sight along an axis of the texture.
#[derive(Debug, Clone, Copy)]
pub struct Sight {
    /// 0, 1 or 2: u, v or w.
    pub axis: usize,
    /// Whether the viewer is at the upper end of the axis.
    pub from_above: bool,
}

/// The volume with `coarse` texels along the axis of sight in place of those it has, whose edges there are `edge` opacity
/// distances long.
pub fn merged_along(volume: &Volume, sight: Sight, coarse: u32, edge: f64) -> Volume {
    let fine = volume.size[sight.axis];
    let mut size = volume.size;
    size[sight.axis] = coarse;
    if fine == coarse {
        return volume.clone();
    }
    volume_of(size, volume.quantity, |at| {
        let taps = coverage(fine, coarse, at[sight.axis]);
        let passage = |(texel, part): (u32, f64)| {
            let mut place = at;
            place[sight.axis] = texel;
            Passage::through(volume.texel(place).map(f64::from), part * edge, volume.quantity)
        };
        let whole = match sight.from_above {
            true => taps.rev().map(passage).reduce(Passage::before),
            false => taps.map(passage).reduce(Passage::before),
        };
        let length = edge * texels_per_coarse(fine, coarse);
        whole.unwrap_or_default().texel(length, volume.quantity)
    })
}
