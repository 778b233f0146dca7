//! Letters in pictures: the 8 x 8 font of the first PCs.

use font8x8::legacy::BASIC_LEGACY;

use super::Image;

/// How large letters are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Letters {
    /// 8 x 8 pixels.
    Small,
    /// 16 x 16 pixels, with rounded corners.
    Large,
}

impl Letters {
    /// The width and height of one, in pixels.
    pub fn side(self) -> u32 {
        match self {
            Self::Small => 8,
            Self::Large => 16,
        }
    }

    /// Writes a line in opaque grey of `ink`, linear, with the upper left corner at x, y. What is beyond the picture is cut
    /// off; what is not ASCII is a question mark.
    pub fn write(self, picture: &mut Image, text: &str, [left, top]: [u32; 2], ink: f32) {
        let side = self.side();
        for (letter, left) in text.chars().zip((left..).step_by(side as usize)) {
            let letter = if letter.is_ascii() { letter } else { '?' };
            let glyph = BASIC_LEGACY[letter as usize];
            for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
                let is_inked = match self {
                    Self::Small => bit(glyph, [x as i32, y as i32]),
                    Self::Large => doubled(glyph, x as i32, y as i32),
                };
                let (x, y) = (left + x, top + y);
                if is_inked && x < picture.width && y < picture.height {
                    picture.rgba[(y * picture.width + x) as usize] = [ink, ink, ink, 1.0];
                }
            }
        }
    }
}

fn bit(glyph: [u8; 8], [x, y]: [i32; 2]) -> bool {
    (0..8).contains(&x) && (0..8).contains(&y) && glyph[y as usize] >> x & 1 == 1
}

/// A pixel of the glyph at twice its size, by Scale2x (A. Mazzoleni, 2001): a quarter of a pixel takes the colour of the two
/// neighbours on its side where these are alike and differ from those opposite.
fn doubled(glyph: [u8; 8], x: i32, y: i32) -> bool {
    let at = |dx: i32, dy: i32| bit(glyph, [x / 2 + dx, y / 2 + dy]);
    let (along, down) = (2 * (x % 2) - 1, 2 * (y % 2) - 1);
    let (beside, across) = (at(along, 0), at(-along, 0));
    let (near, opposite) = (at(0, down), at(0, -down));
    if beside == near && beside != opposite && near != across { near } else { at(0, 0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of what is inked.
    fn written(letters: Letters, text: &str, width: u32) -> Vec<String> {
        let mut picture = Image::new(width, letters.side() - 1);
        letters.write(&mut picture, text, [1, 0], 0.5);
        let row =
            |row: &[[f32; 4]]| row.iter().map(|pixel| if pixel[3] == 1.0 { '#' } else { ' ' }).collect();
        picture.rgba.chunks(width as usize).map(row).collect()
    }

    #[test]
    fn letters_are_read_from_left_to_right() {
        let rows = written(Letters::Small, "LT", 17);
        assert_eq!(rows[0], " ####    ######  ");
        assert_eq!(rows[6], " #######  ####   ");
    }

    #[test]
    fn large_letters_have_round_corners_and_are_cut_off() {
        // The 2 x 2 blocks at the four tips of the C have lost a pixel each, and its inner corners have gained one.
        let rows = written(Letters::Large, "Cé", 20);
        let expected = [
            "      ######        ",
            "    ##########    ##",
            "    ####  #####  ###",
            "  ####      ###  ###",
            "  ####              ",
            " ####               ",
            " ####               ",
            " ####               ",
            " ####               ",
            "  ####              ",
            "  ####      ###     ",
            "    ####  #####     ",
            "    ##########      ",
            "      ######        ",
            "                    ",
        ];
        assert_eq!(rows, expected);
    }
}
