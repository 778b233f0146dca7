//! A contact sheet: slices of a volume over a checkerboard, each under a line that says where it is.

use super::{Quantity, Volume};
use crate::frame::Image;
use crate::frame::lettering::Letters;

/// Pixels between slices, and around all.
pub(super) const GAP: u32 = 8;
/// A side of a slice along w, the longer one, in pixels.
const CELL: u32 = 144;
/// The height of a line of text.
pub(super) const LINE: u32 = 12;
/// Slices along w in a row.
const COLUMNS: u32 = 4;
/// The most slices along w.
const MOST_SLICES: u32 = 8;

/// The sheet's own grey, and the checkerboard's two, linear.
pub(super) const PAPER: f32 = 0.02;
const CHECKER: [f32; 2] = [0.12, 0.2];
pub(super) const INK: f32 = 0.7;

/// Texels that lie in a plane, by their columns from the left and rows from the bottom.
struct Slice<'a> {
    label: String,
    columns: u32,
    rows: u32,
    texel: &'a dyn Fn(u32, u32) -> [f32; 4],
}

/// Slices of constant w, evenly spaced from the base upwards, row by row, with u to the right and v up; below them the slice through
/// the middle of v (u to the right, w up) and that through the middle of u (v to the right, w up).
///
/// All are seen from where the volume is seen: from above, from the front, from the right.
pub fn contact_sheet(volume: &Volume) -> Image {
    let [width, height, depth] = volume.size;
    let slices = depth.min(MOST_SLICES);
    let rows = slices.div_ceil(COLUMNS);
    let across = COLUMNS * (CELL + GAP) + GAP;
    let half = (across - 3 * GAP) / 2;
    // As high as slices of that width are, but no higher than a cell.
    let height_of = |room: u32, columns: u32, rows: u32| {
        let height = u64::from(room) * u64::from(rows) / u64::from(columns);
        height.clamp(1, u64::from(CELL)) as u32
    };
    let tall = height_of(CELL, width, height);
    let upright = height_of(half, width, depth).max(height_of(half, height, depth));
    let mut sheet = Image::new(across, rows * (LINE + tall + GAP) + LINE + upright + 2 * GAP);
    sheet.rgba.fill([PAPER, PAPER, PAPER, 1.0]);

    let place = |row: u32| GAP + row * (LINE + tall + GAP);
    for slice in 0..slices {
        // The middles of equal parts.
        let w = (2 * slice + 1) * depth / (2 * slices);
        let slice_of = Slice {
            label: format!("w {w}/{depth}"),
            columns: width,
            rows: height,
            texel: &|column, row| volume.texel([column, row, w]),
        };
        let left = GAP + slice % COLUMNS * (CELL + GAP);
        draw(&mut sheet, volume.quantity, &slice_of, [left, place(slice / COLUMNS)], [CELL, tall]);
    }
    let [u, v] = [width / 2, height / 2];
    let through = [
        Slice {
            label: format!("v {v}/{height}"),
            columns: width,
            rows: depth,
            texel: &|column, row| volume.texel([column, v, row]),
        },
        Slice {
            label: format!("u {u}/{width}"),
            columns: height,
            rows: depth,
            texel: &|column, row| volume.texel([u, column, row]),
        },
    ];
    for (slice, left) in through.iter().zip([GAP, 2 * GAP + half]) {
        draw(&mut sheet, volume.quantity, slice, [left, place(rows)], [half, upright]);
    }
    sheet
}

/// Draws a label, and below it a slice as large as fits into a room of so many pixels.
fn draw(
    sheet: &mut Image,
    quantity: Quantity,
    slice: &Slice,
    [left, top]: [u32; 2],
    [width, height]: [u32; 2],
) {
    Letters::Small.write(sheet, &slice.label, [left, top], INK);
    let pixels = (f64::from(width) / f64::from(slice.columns)).min(f64::from(height) / f64::from(slice.rows));
    let [across, down] =
        [slice.columns, slice.rows].map(|texels| ((f64::from(texels) * pixels) as u32).max(1));
    for y in 0..down {
        for x in 0..across {
            let texel = |pixel: u32, count: u32| (((f64::from(pixel) + 0.5) / pixels) as u32).min(count - 1);
            let [r, g, b, a] = (slice.texel)(texel(x, slice.columns), slice.rows - 1 - texel(y, slice.rows));
            let (r, g, b, opacity) = match quantity {
                Quantity::Opacity => (r, g, b, a),
                // The opacity of one texel's path, in the same colour.
                Quantity::Extinction if a > 0.0 => {
                    let opacity = -(-a).exp_m1();
                    (r / a * opacity, g / a * opacity, b / a * opacity, opacity)
                }
                Quantity::Extinction => (0.0, 0.0, 0.0, 0.0),
            };
            let behind = CHECKER[((x / 8 + y / 8) % 2) as usize] * (1.0 - opacity);
            *pixel(sheet, left + x, top + LINE + y) = [r + behind, g + behind, b + behind, 1.0];
        }
    }
}

fn pixel(sheet: &mut Image, x: u32, y: u32) -> &mut [f32; 4] {
    &mut sheet.rgba[(y * sheet.width + x) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slice_lies_as_it_is_seen() {
        // Red where u is high, green where v is, blue where w is.
        let texels = (0..64).map(|i| [i % 4 / 2, i / 4 % 4 / 2, i / 32, 1].map(|x| x as f32)).collect();
        let sheet = contact_sheet(&Volume::new([4, 4, 4], texels).unwrap());
        let at = |x: u32, y: u32| sheet.rgba[(y * sheet.width + x) as usize];
        let [top, near, far] = [GAP + LINE, GAP + 10, GAP + CELL - 10];
        for (slice, blue) in [(0, 0.0), (3, 1.0)] {
            let left = slice * (CELL + GAP);
            assert_eq!(at(left + near, top + 10), [0.0, 1.0, blue, 1.0], "slice {slice}");
            assert_eq!(at(left + far, top + CELL - 10), [1.0, 0.0, blue, 1.0], "slice {slice}");
        }
        let top = top + LINE + CELL + GAP;
        assert_eq!(at(near, top + 10), [0.0, 1.0, 1.0, 1.0], "v in its upper half, from the front");
        assert_eq!(at(far, top + CELL - 10), [1.0, 1.0, 0.0, 1.0]);
        let left = 2 * GAP + (sheet.width - 3 * GAP) / 2;
        assert_eq!(at(left + 10, top + 10), [1.0, 0.0, 1.0, 1.0], "u in its upper half, from the right");
    }
}
