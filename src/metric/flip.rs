//! FLIP: what a person sees who flips between two images on a screen.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, *FLIP: A Difference
//! Evaluator for Alternating Images*, Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2),
//! 2020, for images of low dynamic range and the paper's own observer, [`PIXELS_PER_DEGREE`].
//!
//! Two pipelines meet in one number a pixel. *Colour*: both images are blurred as the eye blurs them, channel by
//! channel, and compared by the HyAB distance of their Hunt-adjusted CIELAB colours. *Features*: edges and points
//! of the luminance that one image has and the other lacks raise that error.
//!
//! Against the paper:
//! - Input is linear light, as everywhere in this crate. The paper takes sRGB and decodes it first, so both see the
//!   same where theirs is ours, clamped to 0..=1 and encoded.
//! - Its opponent space YCxCz, (116 Y - 16, 500 (X - Y), 200 (Y - Z)) for XYZ relative to white, is used as
//!   (Y, X - Y, Y - Z): the filters that are applied there are linear and sum to 1, so scale and offset cancel.
//! - Every filter is written as a sum of products of one along x and one along y. A row of errors then needs
//!   some 300 multiplications a pixel and image, and no intermediate image.

use std::f64::consts::PI;

use glam::{DMat3, DVec3, Mat3, Vec3};
use rayon::prelude::*;

use super::{check_sizes, over};
use crate::Result;
use crate::frame::Image;

/// The observer: 0.7 m from a screen that is 3840 pixels and 0.7 m wide.
pub const PIXELS_PER_DEGREE: f64 = 0.7 * 3840.0 / 0.7 * PI / 180.0;

/// Contrast sensitivity of the eye for Y, X - Y and Y - Z: pairs `a, b` of a sum over
/// `a sqrt(pi / b) exp(-pi^2 r^2 / b)`, `r` in degrees. Its terms for Y and X - Y with `a` = 0 are left out.
const SENSITIVITY: [&[[f64; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];
/// The largest `b` of all, which gives all these filters their size.
const WIDEST: f64 = 0.04;
/// Width of the eye's edge detector, peak to trough, in degrees.
const EDGE_WIDTH: f64 = 0.082;
/// `q_c`: the exponent of distances between colours.
const COLOR_EXPONENT: f32 = 0.7;
/// `p_c` and `p_t`: errors up to `p_c` of the largest get `p_t` of the range, the rest what is left.
const KNEE: [f32; 2] = [0.4, 0.95];

/// The FLIP error of every pixel, 0 (none to be seen) to 1, row by row from the top left; neither image is
/// preferred.
///
/// Both are laid over `background` (linear RGB) and clamped to 0..=1. Around a pixel that is NaN the errors are NaN.
///
/// # Errors
/// [`Error::Usage`](crate::Error::Usage) when their sizes differ, or when they have no pixels.
pub fn errors(a: &Image, b: &Image, background: [f32; 3]) -> Result<Vec<f32>> {
    check_sizes(a, b)?;
    let space = ColorSpace::new();
    let filters = Filters::new();
    let opponents = [a, b].map(|image| Opponent::new(image, background, &space));
    let mut errors = vec![0.0; a.rgba.len()];
    errors.par_chunks_exact_mut(a.width as usize).enumerate().for_each(|(y, errors)| {
        let [colors_a, colors_b] = opponents.each_ref().map(|image| filters.colors(image, y, &space));
        let [features_a, features_b] = opponents.each_ref().map(|image| filters.features(image, y));
        for (x, error) in errors.iter_mut().enumerate() {
            let color = space.color_error(colors_a[x], colors_b[x]);
            *error = color.powf(1.0 - feature_error(features_a[x], features_b[x]));
        }
    });
    Ok(errors)
}

/// One channel of an image.
struct Plane {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Plane {
    /// Row `y` of this plane under the filter that is the product of the two, whose lengths are equal and odd.
    /// Beyond the borders their values go on.
    fn filtered(&self, y: usize, [along_x, along_y]: [&[f32]; 2]) -> Vec<f32> {
        let (width, radius) = (self.width, along_x.len() / 2);
        let mut padded = vec![0.0; width + 2 * radius];
        for (offset, &weight) in along_y.iter().enumerate() {
            let row = (y + offset).saturating_sub(radius).min(self.height - 1);
            add_scaled(&mut padded[radius..][..width], weight, &self.values[row * width..][..width]);
        }
        let [first, last] = [padded[radius], padded[radius + width - 1]];
        padded[..radius].fill(first);
        padded[radius + width..].fill(last);

        let mut filtered = vec![0.0; width];
        for (offset, &weight) in along_x.iter().enumerate() {
            add_scaled(&mut filtered, weight, &padded[offset..][..width]);
        }
        filtered
    }
}

fn add_scaled(sum: &mut [f32], weight: f32, values: &[f32]) {
    for (sum, value) in sum.iter_mut().zip(values) {
        *sum += weight * value;
    }
}

/// An image in opponent channels: Y, X - Y, Y - Z.
struct Opponent([Plane; 3]);

impl Opponent {
    fn new(image: &Image, background: [f32; 3], space: &ColorSpace) -> Self {
        let opponent = |&pixel: &[f32; 4]| {
            let xyz = space.xyz_from_rgb * clamped(Vec3::from(over(pixel, background)));
            [xyz.y, xyz.x - xyz.y, xyz.y - xyz.z]
        };
        let pixels: Vec<[f32; 3]> = image.rgba.par_iter().map(opponent).collect();
        Self(std::array::from_fn(|channel| Plane {
            width: image.width as usize,
            height: image.height as usize,
            values: pixels.iter().map(|pixel| pixel[channel]).collect(),
        }))
    }
}

struct Filters {
    /// For each channel the terms of its contrast sensitivity; each is applied along x and along y.
    sensitivity: [Vec<Vec<f32>>; 3],
    /// A Gaussian and its first two derivatives.
    smooth: Vec<f32>,
    edge: Vec<f32>,
    point: Vec<f32>,
}

impl Filters {
    fn new() -> Self {
        let radius = (3.0 * (WIDEST / 2.0).sqrt() / PI * PIXELS_PER_DEGREE).ceil();
        let sensitivity = SENSITIVITY.map(|terms| {
            let term = |&[a, b]: &[f64; 2]| {
                let amplitude = (a * (PI / b).sqrt()).sqrt();
                sampled(radius, |x| amplitude * (-(PI * x / PIXELS_PER_DEGREE).powi(2) / b).exp())
            };
            let terms: Vec<Vec<f64>> = terms.iter().map(term).collect();
            let sum: f64 = terms.iter().map(|term| term.iter().sum::<f64>().powi(2)).sum();
            terms.iter().map(|term| term.iter().map(|x| (x / sum.sqrt()) as f32).collect()).collect()
        });

        let deviation = 0.5 * EDGE_WIDTH * PIXELS_PER_DEGREE;
        let radius = (3.0 * deviation).ceil();
        let gaussian = |x: f64| (-0.5 * (x / deviation).powi(2)).exp();
        Self {
            sensitivity,
            smooth: balanced(&sampled(radius, gaussian)),
            edge: balanced(&sampled(radius, |x| -x * gaussian(x))),
            point: balanced(&sampled(radius, |x| ((x / deviation).powi(2) - 1.0) * gaussian(x))),
        }
    }

    /// Row `y` as the eye sees it: Hunt-adjusted CIELAB.
    fn colors(&self, image: &Opponent, y: usize, space: &ColorSpace) -> Vec<Vec3> {
        let mut colors = vec![Vec3::ZERO; image.0[0].width];
        for (channel, terms) in self.sensitivity.iter().enumerate() {
            for term in terms {
                let row = image.0[channel].filtered(y, [term, term]);
                colors.iter_mut().zip(row).for_each(|(color, value)| color[channel] += value);
            }
        }
        for color in &mut colors {
            let [y, x_y, y_z] = color.to_array();
            let rgb = space.rgb_from_xyz * Vec3::new(x_y + y, y, y - y_z);
            *color = space.hunt_lab(clamped(rgb));
        }
        colors
    }

    /// How much of an edge, and how much of a point, each pixel of row `y` is.
    fn features(&self, image: &Opponent, y: usize) -> Vec<[f32; 2]> {
        let luminance = &image.0[0];
        let [edges, points] = [&self.edge, &self.point].map(|detector| {
            let along_x = luminance.filtered(y, [detector, &self.smooth]);
            let along_y = luminance.filtered(y, [&self.smooth, detector]);
            along_x.into_iter().zip(along_y).map(|(x, y)| x.hypot(y))
        });
        edges.zip(points).map(|(edge, point)| [edge, point]).collect()
    }
}

/// `function` at the whole numbers from `-radius` to `radius`.
fn sampled(radius: f64, function: impl Fn(f64) -> f64) -> Vec<f64> {
    let radius = radius as i32;
    (-radius..=radius).map(|x| function(x.into())).collect()
}

/// The weights scaled so that those above 0 sum to 1, and those below to -1.
fn balanced(weights: &[f64]) -> Vec<f32> {
    let [above, below] = [1.0, -1.0].map(|sign| weights.iter().map(|x| (sign * x).max(0.0)).sum::<f64>());
    weights
        .iter()
        .map(|&x| (if x > 0.0 { x / above } else { x / below.max(f64::MIN_POSITIVE) }) as f32)
        .collect()
}

/// CIE XYZ, relative to white, and CIELAB for the sRGB primaries and D65.
struct ColorSpace {
    xyz_from_rgb: Mat3,
    rgb_from_xyz: Mat3,
    /// The largest error between two colours, that of green and blue, to the power of [`COLOR_EXPONENT`].
    largest: f32,
}

impl ColorSpace {
    fn new() -> Self {
        // The matrix of the primaries, in whole numbers; each row is divided by its sum, for white is (1, 1, 1).
        let rows = [
            DVec3::new(10_135_552.0, 8_788_810.0, 4_435_075.0),
            DVec3::new(2_613_072.0, 8_788_810.0, 887_015.0),
            DVec3::new(1_425_312.0, 8_788_810.0, 70_074_185.0),
        ];
        let [x, y, z] = rows.map(|row| row / row.element_sum());
        let xyz_from_rgb = DMat3::from_cols(x, y, z).transpose();
        let mut space = Self {
            xyz_from_rgb: xyz_from_rgb.as_mat3(),
            rgb_from_xyz: xyz_from_rgb.inverse().as_mat3(),
            largest: 0.0,
        };
        let [green, blue] = [Vec3::Y, Vec3::Z].map(|rgb| space.hunt_lab(rgb));
        space.largest = distance(green, blue).powf(COLOR_EXPONENT);
        space
    }

    /// CIELAB with a and b scaled by L / 100, as colours of dark surfaces seem less vivid (Hunt 1952).
    fn hunt_lab(&self, rgb: Vec3) -> Vec3 {
        let [x, y, z] = (self.xyz_from_rgb * rgb).to_array().map(|t| {
            const DELTA: f32 = 6.0 / 29.0;
            if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
        });
        let lightness = 116.0 * y - 16.0;
        let scale = 0.01 * lightness;
        Vec3::new(lightness, scale * 500.0 * (x - y), scale * 200.0 * (y - z))
    }

    /// The error of one colour against another, 0 to 1.
    fn color_error(&self, a: Vec3, b: Vec3) -> f32 {
        let [knee, range] = KNEE;
        let error = distance(a, b).powf(COLOR_EXPONENT) / self.largest;
        if error < knee {
            error * range / knee
        } else {
            range + (error - knee) / (1.0 - knee) * (1.0 - range)
        }
    }
}

/// Each component clamped to 0..=1. Unlike that of vectors, this clamp lets NaN through.
fn clamped(rgb: Vec3) -> Vec3 {
    rgb.to_array().map(|x| x.clamp(0.0, 1.0)).into()
}

/// HyAB: how far apart two Lab colours are that differ much.
fn distance(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// How much more of an edge or of a point one pixel is than the other, 0 to 1.
fn feature_error(a: [f32; 2], b: [f32; 2]) -> f32 {
    let [edge, point] = [(a[0] - b[0]).abs(), (a[1] - b[1]).abs()];
    // Divided by the most that a detector along x and another along y give together, to the power q_f = 1/2.
    (edge.max(point) * std::f32::consts::FRAC_1_SQRT_2).sqrt()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_pcg::Pcg32;

    use super::*;

    fn image(width: u32, height: u32, mut pixel: impl FnMut(f32, f32) -> [f32; 4]) -> Image {
        let mut image = Image::new(width, height);
        for (index, rgba) in image.rgba.iter_mut().enumerate() {
            *rgba = pixel((index % width as usize) as f32, (index / width as usize) as f32);
        }
        image
    }

    /// Opaque noise, brighter than white here and there.
    fn noise(seed: u64) -> Image {
        let mut random = Pcg32::new(seed, 1);
        image(40, 30, |_, _| {
            let mut channel = || 1.2 * random.random::<f32>();
            [channel(), channel(), channel(), 1.0]
        })
    }

    /// A half-transparent disc with soft noise in it.
    fn disc(seed: u64, center: f32) -> Image {
        let mut random = Pcg32::new(seed, 2);
        image(61, 47, |x, y| {
            let alpha = (0.1 * (15.0 - (x - center).hypot(y - 20.0))).clamp(0.0, 0.9);
            let mut channel = |mean: f32| alpha * (mean + 0.1 * random.random::<f32>());
            [channel(0.7), channel(0.3), channel(0.05), alpha]
        })
    }

    /// A few bright hairs on nothing, taller than wide and narrower than the filters.
    fn hairs(seed: u64) -> Image {
        let mut random = Pcg32::new(seed, 3);
        let roots: [f32; 4] = std::array::from_fn(|_| 12.0 * random.random::<f32>());
        image(12, 70, |x, y| {
            let nearest = roots.iter().map(|root| (x - root - 0.03 * y).abs()).fold(f32::MAX, f32::min);
            let alpha = (1.0 - nearest).clamp(0.0, 1.0);
            [0.9 * alpha, 0.8 * alpha, 0.6 * alpha, alpha]
        })
    }

    fn pairs() -> [(Image, Image, [f32; 3]); 3] {
        [
            (noise(1), noise(2), [0.0; 3]),
            (disc(1, 30.0), disc(2, 31.5), [0.1, 0.2, 0.4]),
            (hairs(1), hairs(2), [0.0; 3]),
        ]
    }

    fn mean(errors: &[f32]) -> f64 {
        errors.iter().copied().map(f64::from).sum::<f64>() / errors.len() as f64
    }

    /// By the authors' own implementation, the Python package flip-evaluator 1.7, from the pairs laid over
    /// their backgrounds, clamped to 0..=1 and encoded in sRGB as f32: `evaluate(a, b, "LDR", applyMagma=False)`.
    /// Of its map the mean (in f64, since its own adds up in f32), the first pixel and the middle one.
    const EXPECTED: [[f64; 3]; 3] = [
        [0.445_427_5, 0.780_296_2, 0.681_590_3],
        [0.059_258_1, 0.0, 0.071_846_4],
        [0.571_758_2, 0.338_350_2, 0.459_934_6],
    ];

    #[test]
    fn agrees_with_the_authors() {
        for ((a, b, background), expected) in pairs().iter().zip(EXPECTED) {
            for (a, b) in [(a, b), (b, a)] {
                let errors = errors(a, b, *background).unwrap();
                let found = [mean(&errors), errors[0].into(), errors[errors.len() / 2].into()];
                // Both round to f32 in some hundred steps, and the power of 0.7 swells the smallest errors.
                let far = found.iter().zip(expected).any(|(found, expected)| (found - expected).abs() > 1e-4);
                assert!(!far, "{found:?} instead of {expected:?}");
            }
            let mut swapped = b.clone();
            swapped.rgba.iter_mut().for_each(|pixel| pixel.swap(0, 2));
            let errors = errors(a, &swapped, *background).unwrap();
            assert!((mean(&errors) - expected[0]).abs() > 1e-3, "a swapped channel is not seen");
        }
    }

    #[test]
    fn green_against_blue_is_the_most() {
        for (width, height) in [(1, 1), (3, 50), (50, 3)] {
            let [green, blue] = [1, 2].map(|channel| {
                image(width, height, |_, _| std::array::from_fn(|i| f32::from(i == channel || i == 3)))
            });
            let most = errors(&green, &blue, [0.0; 3]).unwrap();
            assert_eq!(most.len(), (width * height) as usize);
            // The filters' weights, in f32, sum to 1 within 30 roundings.
            assert!(most.iter().all(|error| (error - 1.0).abs() < 1e-5), "{most:?}");
            assert!(errors(&green, &green, [0.0; 3]).unwrap().iter().all(|&error| error == 0.0));
        }
    }

    #[test]
    fn what_is_no_number_stays_none() {
        let good = noise(1);
        let mut bad = good.clone();
        bad.rgba[15 * 40 + 20][1] = f32::NAN;
        let errors = errors(&good, &bad, [0.0; 3]).unwrap();
        assert!(errors[15 * 40 + 20].is_nan() && errors[0] == 0.0);
    }
}
