//! What a picture for people is laid on, and how brightly it is shown. Measurements know nothing of either.

use std::sync::Arc;

use rayon::prelude::*;

use super::Image;

/// How linear premultiplied RGBA becomes a picture to look at.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Backdrop {
    /// What shows where the image does not cover.
    pub behind: Behind,
    /// In stops, from -20 to 20: image and background are multiplied by 2 to the power of it.
    pub exposure: f64,
}

/// What lies behind an image.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Behind {
    /// Nothing: a picture for people is transparent, too.
    #[default]
    Nothing,
    /// Linear RGB.
    Colour([f32; 3]),
    /// A picture, scaled so that it covers the image, and cut off evenly at two sides where their shapes differ. Where it
    /// is transparent itself it is on black.
    Picture(Arc<Image>),
}

impl Backdrop {
    /// A colour, linear RGB, in plain exposure.
    pub fn colour(rgb: [f32; 3]) -> Self {
        Self { behind: Behind::Colour(rgb), exposure: 0.0 }
    }

    /// The one colour that stands for it where no picture can: black, unless it is a colour itself.
    pub fn flat_colour(&self) -> [f32; 3] {
        match self.behind {
            Behind::Colour(rgb) => rgb,
            Behind::Nothing | Behind::Picture(_) => [0.0; 3],
        }
    }

    /// By what linear values are multiplied.
    pub fn gain(&self) -> f32 {
        self.exposure.exp2() as f32
    }

    /// What becomes of the pixels, by index and value, of an image of that size: over what is behind it, and exposed. They
    /// are linear and premultiplied still, and opaque where there is something behind.
    pub(crate) fn develop(&self, width: u32, height: u32) -> impl Fn(usize, [f32; 4]) -> [f32; 4] + use<> {
        let picture = match &self.behind {
            Behind::Picture(picture) => Some(cover(picture, width, height)),
            _ => None,
        };
        let (is_opaque, colour, gain) = (self.behind != Behind::Nothing, self.flat_colour(), self.gain());
        move |index, [r, g, b, a]| {
            let behind = picture.as_ref().map_or(colour, |picture| {
                let [r, g, b, _] = picture.rgba[index];
                [r, g, b]
            });
            let under = behind.map(|x| x * (1.0 - a.clamp(0.0, 1.0)));
            let [r, g, b] = [r + under[0], g + under[1], b + under[2]].map(|x| gain * x);
            [r, g, b, if is_opaque { 1.0 } else { a }]
        }
    }
}

/// What source pixels a row or column is mixed of: the first, and the weights from there on, which sum to 1.
struct Mix {
    first: usize,
    weights: Vec<f32>,
}

/// `picture` in `width` x `height` pixels: its middle, as large as covers them.
///
/// The filter is a tent as wide as two pixels of the finer of both, so that nothing is left out when it shrinks, and it is
/// interpolated when it grows. It never rings, which on the bright sun of a sky would show.
pub(crate) fn cover(picture: &Image, width: u32, height: u32) -> Image {
    // Source pixels a pixel.
    let scale =
        (f64::from(picture.width) / f64::from(width)).min(f64::from(picture.height) / f64::from(height));
    let columns = mixes(picture.width, width, scale);
    let rows = mixes(picture.height, height, scale);
    let narrow = picture
        .rgba
        .par_chunks(picture.width as usize)
        .flat_map_iter(|row| columns.iter().map(move |mix| mixed(mix, |index| row[index])));
    let narrow: Vec<[f32; 4]> = narrow.collect();
    let rgba = rows.par_iter().flat_map_iter(|mix| {
        let narrow = &narrow;
        (0..width as usize).map(move |x| mixed(mix, |row| narrow[row * width as usize + x]))
    });
    Image { width, height, rgba: rgba.collect() }
}

/// For each of `pixels` along one axis, of a source `length` pixels long of which `scale` make one.
fn mixes(length: u32, pixels: u32, scale: f64) -> Vec<Mix> {
    let radius = scale.max(1.0);
    let begin = 0.5 * (f64::from(length) - scale * f64::from(pixels));
    let last = f64::from(length - 1);
    let mix = |pixel: u32| {
        // Where pixels of the source have their middles at whole numbers.
        let middle = begin + scale * (f64::from(pixel) + 0.5) - 0.5;
        let first = (middle - radius).ceil().clamp(0.0, last);
        let end = (middle + radius).floor().clamp(first, last);
        let tent = |index: usize| (1.0 - (first + index as f64 - middle).abs() / radius).max(0.0);
        let weights: Vec<f64> = (0..=(end - first) as usize).map(tent).collect();
        let sum: f64 = weights.iter().sum();
        Mix { first: first as usize, weights: weights.iter().map(|weight| (weight / sum) as f32).collect() }
    };
    (0..pixels).map(mix).collect()
}

fn mixed(mix: &Mix, pixel: impl Fn(usize) -> [f32; 4]) -> [f32; 4] {
    let mut sum = [0.0; 4];
    for (index, weight) in mix.weights.iter().enumerate() {
        let pixel = pixel(mix.first + index);
        sum = std::array::from_fn(|channel| sum[channel] + weight * pixel[channel]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Red grows by 1 from column to column, green from row to row.
    fn ramp(width: u32, height: u32) -> Image {
        let pixel = |index: u32| [(index % width) as f32, (index / width) as f32, 7.0, 1.0];
        Image { width, height, rgba: (0..width * height).map(pixel).collect() }
    }

    #[test]
    fn of_its_own_size_a_picture_stays_as_it_is() {
        let picture = ramp(9, 5);
        assert_eq!(cover(&picture, 9, 5), picture);
    }

    #[test]
    fn the_middle_is_shown_and_covers_all() {
        // Of 90 columns the middle 30 stand, each three by three pixels a tent's mean, which a ramp does not change.
        let covered = cover(&ramp(90, 30), 10, 10);
        let at = |x: usize, y: usize| covered.rgba[y * 10 + x];
        for (found, expected) in
            [(at(1, 1)[0], 34.0), (at(8, 1)[0], 55.0), (at(5, 1)[1], 4.0), (at(5, 8)[1], 25.0)]
        {
            assert!((found - expected).abs() < 1e-4, "{found}, not {expected}");
        }
        assert!(covered.rgba.iter().all(|pixel| (pixel[2] - 7.0).abs() < 1e-5));
        let tall = cover(&ramp(30, 90), 10, 10);
        assert!((tall.rgba[15][1] - 34.0).abs() < 1e-4, "{:?}", tall.rgba[15]);
    }

    #[test]
    fn a_small_picture_is_interpolated() {
        let grown = cover(&ramp(2, 2), 8, 8);
        let row: Vec<f32> = grown.rgba[..8].iter().map(|pixel| pixel[0]).collect();
        assert_eq!(row, [0.0, 0.0, 0.125, 0.375, 0.625, 0.875, 1.0, 1.0]);
        assert!(cover(&ramp(1, 1), 5, 3).rgba.iter().all(|pixel| *pixel == [0.0, 0.0, 7.0, 1.0]));
    }

    #[test]
    fn the_mean_of_what_shrinks_stays() {
        let mut picture = Image::new(64, 64);
        for (index, pixel) in picture.rgba.iter_mut().enumerate() {
            *pixel = if (index % 64 + index / 64) % 2 == 0 { [2.0; 4] } else { [0.0; 4] };
        }
        let small = cover(&picture, 8, 8);
        assert!(small.rgba.iter().all(|pixel| (pixel[0] - 1.0).abs() < 0.02), "{:?}", small.rgba);
    }

    #[test]
    fn a_stop_is_twice_as_bright() {
        let at = |exposure| Backdrop { exposure, ..Backdrop::default() }.gain();
        assert_eq!([at(0.0), at(1.0), at(-2.0)], [1.0, 2.0, 0.25]);
    }
}
