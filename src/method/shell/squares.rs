//! The squares that a picture is drawn in, of 64 x 64 pixels as a rule: each by the shader that suffices for what is seen in it, and a
//! few at a time, so that no submission takes long. Those of 64 x 64 are the bins of lavapipe's rasteriser; nothing in them depends on that.

use std::ops::Range;

use glam::DVec2;

use crate::scene::View;

/// The side in pixels: `SIDE` of `glsl/walk.vert.glsl`.
pub const SIDE: u32 = 64;

/// Those of one picture, numbered row by row from the top.
#[derive(Debug, Clone, Copy)]
pub struct Squares {
    /// Of the picture, in pixels.
    size: [u32; 2],
    side: u32,
    /// How many there are across, and down.
    count: [usize; 2],
}

impl Squares {
    /// Of a picture of this view.
    pub fn of(view: &View) -> Self {
        Self::of_side(view, SIDE)
    }

    /// The same, but of so many pixels a side.
    pub fn of_side(view: &View, side: u32) -> Self {
        let size = [view.width, view.height];
        Self { size, side, count: size.map(|pixels| pixels.div_ceil(side) as usize) }
    }

    /// How many there are.
    pub fn count(self) -> usize {
        self.count[0] * self.count[1]
    }

    /// How many there are in a row.
    pub fn across(self) -> usize {
        self.count[0]
    }

    /// Those in which a convex shape may be seen whose corners are projected to these pixels: all, where one is `None`, which is not
    /// before the eye.
    pub fn around<const N: usize>(self, corners: [Option<DVec2>; N]) -> impl Iterator<Item = usize> {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for corner in corners {
            low = low.min(corner.unwrap_or(DVec2::NEG_INFINITY));
            high = high.max(corner.unwrap_or(DVec2::INFINITY));
        }
        let [columns, rows] = [0, 1].map(|axis| {
            // A pixel more on either side than numbers in f32 can be off. Casts saturate.
            let side = f64::from(self.side);
            let square = |pixel: f64| ((pixel / side).max(0.0) as usize).min(self.count[axis]);
            square(low[axis] - 1.0)..square(high[axis] + 1.0 + side)
        });
        rows.flat_map(move |row| columns.clone().map(move |column| row * self.count[0] + column))
    }

    /// Where one lies in clip space: left, top, right, bottom.
    pub fn bounds(self, square: usize) -> [f32; 4] {
        let [x, y] = [square % self.count[0], square / self.count[0]];
        let clip = |square: usize, axis: usize| {
            (2.0 * (square * self.side as usize) as f64 / f64::from(self.size[axis]) - 1.0) as f32
        };
        [clip(x, 0), clip(y, 1), clip(x + 1, 0), clip(y + 1, 1)]
    }
}

/// The vertices that draw squares which are alike, six each: one range for each run of them.
pub fn vertices<T: PartialEq>(squares: &[T]) -> impl Iterator<Item = (&T, Range<u32>)> {
    let mut end = 0;
    squares.chunk_by(PartialEq::eq).map(move |run| {
        let first = end;
        end += 6 * run.len() as u32;
        (&run[0], first..end)
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::Camera;

    #[test]
    fn host_and_shader_agree_on_the_side() {
        let shader = include_str!("../../../glsl/walk.vert.glsl");
        assert!(shader.contains(&format!("const uint SIDE = {SIDE};")));
    }

    #[test]
    fn runs_of_squares_are_drawn_together() {
        let runs: Vec<_> = vertices(&[true, true, false, true]).collect();
        assert_eq!(runs, [(&true, 0..12), (&false, 12..18), (&true, 18..24)]);
        assert_eq!(vertices::<bool>(&[]).count(), 0);
    }

    #[test]
    fn shapes_are_seen_in_the_squares_that_they_reach_into() {
        let camera = Camera { eye: DVec3::ZERO, target: -DVec3::Z, up: DVec3::Y, fov_y: 1.0, near: 0.1 };
        let squares = Squares::of(&View { camera, width: 130, height: 65, depth: false });
        let around = |corners: [[f64; 2]; 2]| -> Vec<usize> {
            squares.around(corners.map(|corner| Some(DVec2::from_array(corner)))).collect()
        };
        assert_eq!((squares.count(), squares.across()), (6, 3));
        assert_eq!(around([[70.0, 3.0], [71.0, 4.0]]), [1]);
        assert_eq!(around([[64.5, 3.0], [71.0, 4.0]]), [0, 1], "a pixel more");
        assert_eq!(around([[70.0, 3.0], [71.0, 63.5]]), [1, 4], "a pixel more");
        assert_eq!(around([[-1e300, -9.0], [1e300, 9.0]]), [0, 1, 2]);
        assert!(around([[200.0, 3.0], [210.0, 4.0]]).is_empty());
        assert!(
            around([[20.0, -30.0], [21.0, -9.0]]).iter().all(|square| *square == 0),
            "at most at its edge"
        );
        assert_eq!(squares.around([Some(DVec2::ZERO), None]).count(), 6);
        let near = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(near(squares.bounds(1), [-1.0 / 65.0, -1.0, 63.0 / 65.0, 63.0 / 65.0]));
        assert!(near(squares.bounds(3), [-1.0, 63.0 / 65.0, -1.0 / 65.0, 191.0 / 65.0]));
    }
}
