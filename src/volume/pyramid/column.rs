//! Columns of texels along an axis, merged by the opacity equation: exact but for rounding to f32, and associative, so that four texels give one
//! column whether merged at once or two by two.

use super::coverage::{Coverage, index_of, stored, texels_of};
use super::medium::Passage;
use crate::volume::Volume;

/// Pieces of columns, looked at from above or, of two sides, from below as well.
pub struct Columns<const SIDES: usize> {
    /// Along the axis of the columns, pieces; across, texels.
    pub size: [u32; 3],
    axis: usize,
    pieces: Vec<Piece<SIDES>>,
}

/// A [`Passage`], in less memory.
#[derive(Clone, Copy)]
struct Piece<const SIDES: usize> {
    depth: f64,
    /// Light for its opacity, seen from each side.
    straight: [[f32; 3]; SIDES],
}

impl<const SIDES: usize> Columns<SIDES> {
    /// The columns of a volume along an axis, in `coarse` pieces each. A texel is `edge` opacity distances long there.
    pub fn of(volume: &Volume, axis: usize, coarse: u32, edge: f64) -> Self {
        let through = |place, part: f64| {
            Passage::through(volume.texel(place).map(f64::from), part * edge, volume.quantity)
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
        let nothing = Piece { depth: 0.0, straight: [[0.0; 3]; SIDES] };
        let pieces = texels_of(size, nothing, |at| {
            let passages = coverage.of(at[axis]).iter().map(|&(texel, part)| {
                let mut place = at;
                place[axis] = texel;
                through(place, part)
            });
            let whole = passages.reduce(Passage::under).unwrap_or(Passage::NOTHING);
            Piece { depth: whole.depth, straight: whole.straight().map(|colour| colour.map(stored)) }
        });
        Self { size, axis, pieces }
    }

    /// Through what one piece is of, as many times as long as it is.
    pub fn passage(&self, at: [u32; 3], times: f64) -> Passage<SIDES> {
        let Piece { depth, straight } = *self.piece(at);
        if depth == 0.0 {
            return Passage::NOTHING;
        }
        Passage::of(depth * times, straight.map(|colour| colour.map(f64::from)))
    }

    /// Whether nothing is in a piece.
    pub fn is_empty(&self, at: [u32; 3]) -> bool {
        self.piece(at).depth == 0.0
    }

    fn piece(&self, at: [u32; 3]) -> &Piece<SIDES> {
        &self.pieces[index_of(self.size, at)]
    }
}
