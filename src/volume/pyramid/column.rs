//! Columns of texels along an axis, merged by the opacity equation: exact but for rounding to f32, and associative, so that four texels give one
//! column whether merged at once or two by two.

use super::coverage::{Coverage, index_of, stored, texels_of};
use super::medium::{Passage, opacity};
use crate::volume::Volume;

/// Pieces of columns, looked at from above or, of two sides, from below as well.
pub struct Columns<const SIDES: usize> {
    /// Along the axis of the columns, pieces; across, texels.
    pub size: [u32; 3],
    axis: usize,
    pieces: Vec<Piece<SIDES>>,
}

/// A [`Passage`], in less memory.
struct Piece<const SIDES: usize> {
    depth: f64,
    opacity: f64,
    /// Light for its opacity, seen from each side.
    straight: [[f32; 3]; SIDES],
}

impl<const SIDES: usize> Columns<SIDES> {
    /// The columns of a volume along an axis, in `coarse` pieces each. A texel is `edge` opacity distances long there; `depths` are
    /// those of the volume's texels over one.
    pub fn of(volume: &Volume, depths: &[f64], axis: usize, coarse: u32, edge: f64) -> Self {
        let through = |place, part: f64| {
            let index = index_of(volume.size, place);
            Passage::through(volume.texels[index].map(f64::from), depths[index] * (part * edge))
        };
        Self::merged(volume.size, axis, coarse, through)
    }

    /// The same columns in fewer pieces.
    pub fn coarser(&self, coarse: u32) -> Self {
        Self::merged(self.size, self.axis, coarse, |place, part| self.passage(place, part))
    }

    fn merged(
        fine: [u32; 3],
        axis: usize,
        coarse: u32,
        through: impl Fn([u32; 3], f64) -> Passage<SIDES> + Sync,
    ) -> Self {
        let mut size = fine;
        size[axis] = coarse;
        let coverage = Coverage::new(fine[axis], coarse);
        let pieces = texels_of(size, |at| {
            let mut whole = Passage::NOTHING;
            for &(texel, part) in coverage.of(at[axis]) {
                let mut place = at;
                place[axis] = texel;
                whole = whole.under(through(place, part));
            }
            let straight = whole.straight().map(|colour| colour.map(stored));
            Piece { depth: whole.depth, opacity: whole.opacity, straight }
        });
        Self { size, axis, pieces }
    }

    /// Through what one piece is of, as many times as long as it is.
    #[inline(always)] // as those of `Passage`
    pub fn passage(&self, at: [u32; 3], times: f64) -> Passage<SIDES> {
        let Piece { depth, opacity: once, straight } = *self.piece(at);
        if depth == 0.0 {
            return Passage::NOTHING;
        }
        // Most are passed once or twice, which needs no exponential.
        let opacity = match times {
            1.0 => once,
            2.0 => once * (2.0 - once),
            _ => opacity(depth * times),
        };
        Passage::of(depth * times, opacity, straight.map(|colour| colour.map(f64::from)))
    }

    /// Whether nothing is in a piece.
    pub fn is_empty(&self, at: [u32; 3]) -> bool {
        self.piece(at).depth == 0.0
    }

    fn piece(&self, at: [u32; 3]) -> &Piece<SIDES> {
        &self.pieces[index_of(self.size, at)]
    }
}
