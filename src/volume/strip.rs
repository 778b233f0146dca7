//! A strip: pictures beside one another, each over a line that says what it shows.

use super::contact::{GAP, INK, LINE, PAPER};
use crate::frame::Image;
use crate::frame::lettering::Letters;

/// Pictures with their labels from the left to the right, over a linear grey.
pub fn strip(pictures: &[(String, Image)], grey: f32) -> Image {
    let width = GAP + pictures.iter().map(|(_, picture)| picture.width + GAP).sum::<u32>();
    let height = pictures.iter().map(|(_, picture)| picture.height).max().unwrap_or(0);
    let mut strip = Image::new(width, height + LINE + 2 * GAP);
    strip.rgba.fill([PAPER, PAPER, PAPER, 1.0]);
    let mut left = GAP;
    for (label, picture) in pictures {
        let rows = picture.rgba.chunks(picture.width as usize);
        for (row, pixels) in rows.enumerate() {
            let start = (GAP as usize + row) * width as usize + left as usize;
            for (to, &[r, g, b, a]) in strip.rgba[start..].iter_mut().zip(pixels) {
                let behind = grey * (1.0 - a);
                *to = [r + behind, g + behind, b + behind, 1.0];
            }
        }
        Letters::Small.write(&mut strip, label, [left, 2 * GAP + height - 3], INK);
        left += picture.width + GAP;
    }
    strip
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_beside_one_another_over_their_labels() {
        let picture = |colour: [f32; 4]| {
            let mut picture = Image::new(20, 10);
            picture.rgba.fill(colour);
            picture
        };
        let red = ("a".to_owned(), picture([1.0, 0.0, 0.0, 1.0]));
        let clear = ("b".to_owned(), picture([0.0; 4]));
        let strip = strip(&[red, clear], 0.25);
        let at = |x: u32, y: u32| strip.rgba[(y * strip.width + x) as usize];
        assert_eq!((strip.width, strip.height), (40 + 3 * GAP, 10 + LINE + 2 * GAP));
        assert_eq!(at(GAP, GAP), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(2 * GAP + 39, GAP + 9), [0.25, 0.25, 0.25, 1.0]);
        let inked = |from: u32| {
            let pixels = (from..from + 8).flat_map(|x| (GAP + 10..strip.height).map(move |y| (x, y)));
            pixels.filter(|&(x, y)| at(x, y)[0] > PAPER).count()
        };
        assert!(inked(GAP) > 5 && inked(2 * GAP + 20) > 5 && inked(2 * GAP) == 0);
    }
}
