//! Stretch painted on the base mesh: red where the texture is stretched, blue where it is compressed.

use glam::{DVec2, DVec3};

use crate::frame::Image;
use crate::frame::lettering::Letters;
use crate::frame::srgb::linear_from_srgb;
use crate::scene::{Scene, View};

/// Compressed, unchanged, stretched; sRGB.
const COLOURS: [[u8; 3]; 3] = [[0x1c, 0x5c, 0xb0], [0xf2, 0xf0, 0xea], [0xc6, 0x28, 0x28]];

/// Rows of the legend below the picture.
const LEGEND: u32 = 36;

/// The least range, so that rounding is not painted.
const LEAST_RANGE: f64 = 1.01;

/// The base mesh of a scene, each triangle in the colour of the singular value that is furthest from 1 in its three
/// tetrahedra, by what [`deformations`](super::stretch::deformations) tells; opaque on white, with a legend below. Where
/// there is none the triangle is black.
pub fn paint(scene: &Scene, deformations: &[Option<[f64; 3]>], frame: u32) -> Image {
    let View { width, height, .. } = scene.view;
    let values: Vec<Option<f64>> = deformations.chunks(3).map(furthest).collect();
    let range = Range::of(deformations);

    let mut picture = Image::new(width, height + LEGEND);
    picture.rgba.fill([1.0; 4]);
    let mut depths = vec![f64::INFINITY; width as usize * height as usize];
    let camera = scene.view.camera.frame();
    for (triangle, value) in values.iter().enumerate() {
        // The first tetrahedron of a prism has all three base corners.
        let ids = scene.shell.topology.tetrahedra[3 * triangle];
        let on_base = ids.into_iter().filter(|&id| id < scene.shell.topology.base_vertices);
        let corners: Vec<DVec3> = on_base
            .map(|id| scene.shell.vertices[id as usize] - scene.view.camera.eye)
            .map(|v| DVec3::new(v.dot(camera.right), -v.dot(camera.up), v.dot(camera.forward)))
            .collect();
        let &[a, b, c] = corners.as_slice() else { continue };
        if [a, b, c].iter().any(|corner| corner.z <= scene.view.camera.near) {
            continue;
        }
        let facing = (b - a).cross(c - a).normalize_or_zero().dot(a.normalize()).abs();
        // So that the shape is seen.
        let shade = (0.45 + 0.55 * facing) as f32;
        let [r, g, b_] = value.map_or([0.0; 3], |value| range.colour(value)).map(|channel| channel * shade);
        fill(&mut picture, &mut depths, &scene.view, [a, b, c], [r, g, b_, 1.0]);
    }
    legend(&mut picture, height, range, frame);
    picture
}

fn furthest(tetrahedra: &[Option<[f64; 3]>]) -> Option<f64> {
    let values = tetrahedra.iter().flatten().flatten().copied();
    values.max_by(|a, b| a.ln().abs().total_cmp(&b.ln().abs()))
}

/// The least and the greatest factor, on either side of 1.
#[derive(Clone, Copy)]
struct Range {
    least: f64,
    greatest: f64,
}

impl Range {
    fn of(deformations: &[Option<[f64; 3]>]) -> Self {
        let all = deformations.iter().flatten().flatten().filter(|value| value.is_normal());
        let range = Self { least: LEAST_RANGE.recip(), greatest: LEAST_RANGE };
        all.fold(range, |Self { least, greatest }, &value| Self {
            least: least.min(value),
            greatest: greatest.max(value),
        })
    }

    /// Linear RGB: each side goes to its own end, by logarithms.
    fn colour(self, value: f64) -> [f32; 3] {
        let (end, index) = if value < 1.0 { (self.least, 0) } else { (self.greatest, 2) };
        let part = (value.ln() / end.ln()).clamp(0.0, 1.0) as f32;
        std::array::from_fn(|i| {
            let [from, to] = [1, index].map(|index: usize| f32::from(COLOURS[index][i]));
            linear_from_srgb((from + part * (to - from)) / 255.0)
        })
    }
}

/// A triangle in the camera's axes, right, down and forward, at pixel centres that are nearer than what is there.
fn fill(picture: &mut Image, depths: &mut [f64], view: &View, corners: [DVec3; 3], colour: [f32; 4]) {
    let half = 0.5 * DVec2::new(f64::from(view.width), f64::from(view.height));
    let [a, b, c] = corners.map(|v| half + v.truncate() / v.z / view.pixel_at_unit_depth());
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return;
    }
    let low = (a.min(b).min(c) - 0.5).ceil().max(DVec2::ZERO);
    let high = (a.max(b).max(c) - 0.5).floor().min(2.0 * half - 1.0);
    for y in low.y as i64..=high.y as i64 {
        for x in low.x as i64..=high.x as i64 {
            let centre = DVec2::new(x as f64, y as f64) + 0.5;
            let weights = [(b, c), (c, a), (a, b)].map(|(p, q)| (q - p).perp_dot(centre - p) / area);
            // Linear in the picture is the reciprocal of the depth.
            let nearness: f64 = (0..3).map(|k| weights[k] / corners[k].z).sum();
            let pixel = y as usize * view.width as usize + x as usize;
            if weights.iter().all(|&weight| weight >= 0.0) && nearness.recip() < depths[pixel] {
                depths[pixel] = nearness.recip();
                picture.rgba[pixel] = colour;
            }
        }
    }
}

/// A bar of all colours, and the factors at its ends.
fn legend(picture: &mut Image, top: u32, range: Range, frame: u32) {
    let width = picture.width;
    let (left, right) = (8, width.saturating_sub(8));
    for x in left..right {
        let at = 2.0 * f64::from(x - left) / f64::from((right - left).max(2) - 1) - 1.0;
        let end = if at < 0.0 { range.least } else { range.greatest };
        let [r, g, b] = range.colour((at.abs() * end.ln()).exp());
        for y in top + 4..top + 16 {
            picture.rgba[(y * width + x) as usize] = [r, g, b, 1.0];
        }
    }
    let letters = Letters::Small;
    let mut write = |text: &str, left: u32| letters.write(picture, text, [left, top + 22], 0.0);
    let wide = |text: &str| letters.side() * text.len() as u32;
    let (least, greatest) = (format!("{:.3}", range.least), format!("{:.3}", range.greatest));
    write(&least, left);
    write(&greatest, right.saturating_sub(wide(&greatest)));
    let middle = format!("stretch in frame {frame}");
    if wide(&least) + wide(&middle) + wide(&greatest) + 48 < width {
        write(&middle, (width - wide(&middle)) / 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instrument::stretch::deformations;
    use crate::instrument::tests::{moved, torus};
    use crate::volume::{Pyramid, Volume};

    fn reddest(picture: &Image) -> f32 {
        picture.rgba.iter().take(128 * 128).map(|[r, _, b, _]| r - b).fold(f32::NEG_INFINITY, f32::max)
    }

    /// The legend tells the least and the greatest that were measured, not the inverse of the one as the other.
    #[test]
    fn each_side_has_its_own_end() {
        let range = Range::of(&[Some([0.25, 1.0, 1.5]), None, Some([0.9, 1.2, 0.0])]);
        assert_eq!((range.least, range.greatest), (0.25, 1.5));
        let encoded = |colour: [u8; 3]| colour.map(|byte| linear_from_srgb(f32::from(byte) / 255.0));
        for (value, colour) in [(0.25, COLOURS[0]), (1.0, COLOURS[1]), (1.5, COLOURS[2])] {
            assert_eq!(range.colour(value), encoded(colour), "{value}");
        }
        let same = Range::of(&[Some([1.0; 3])]);
        assert_eq!((same.least, same.greatest), (LEAST_RANGE.recip(), LEAST_RANGE));
    }

    #[test]
    fn stretch_is_red_compression_blue_and_rest_neither() {
        let volume = Volume::new([1, 1, 1], vec![[0.5; 4]]).expect("a texel");
        let mut scene = Scene::new(torus(0.1), Pyramid::build(volume), 0.1);
        [scene.view.width, scene.view.height] = [128, 128];
        let rest = scene.shell.clone();
        let painted = |factor: f64| paint(&scene, &deformations(&rest, &moved(&rest, |p| factor * p)), 3);
        let [large, small, same] = [2.0, 0.5, 1.0].map(painted);
        assert_eq!((large.width, large.height), (128, 128 + LEGEND));
        assert!(reddest(&large) > 0.3 && reddest(&small) < 0.05 && reddest(&same) < 0.15);
        let bluest = small.rgba.iter().take(128 * 128).map(|[r, _, b, _]| b - r).fold(0.0, f32::max);
        assert!(bluest > 0.2);
        // White where there is no mesh, and the legend's ends in both.
        assert_eq!(large.rgba[0], [1.0; 4]);
        let bar = |x: usize| same.rgba[(128 + 8) * 128 + x];
        assert!(bar(9)[2] > bar(9)[0] && bar(118)[0] > bar(118)[2]);
    }
}
