//! The contact sheet: all pictures in one, folder by folder, each above its name and what it took.

use super::results::{Results, SceneResults};
use crate::frame::backdrop::cover;
use crate::frame::lettering::Letters;
use crate::frame::{Backdrop, Image};

/// The longest side of a picture on the sheet, and the width of its column, in pixels.
const CELL: u32 = 380;
/// The most columns: with the gaps they are 1600 pixels wide.
const COLUMNS: usize = 4;
/// Between columns, and around all.
const GAP: u32 = 16;
/// The height of a line, with the space below it.
const LINE: u32 = 22;

/// Linear greys: the sheet, what is behind transparent pictures, the lines under headings, headings and names, notes.
const PAPER: f32 = 0.01;
const PANEL: f32 = 0.02;
const RULE: f32 = 0.06;
const INK: f32 = 0.8;
const FAINT: f32 = 0.25;

/// The picture as it lies on the sheet: as it is seen, opaque, no larger than a cell and no larger than it was.
pub fn thumbnail(image: &Image, backdrop: &Backdrop) -> Image {
    let develop = backdrop.develop(image.width, image.height);
    let seen = |(index, &pixel): (usize, &[f32; 4])| {
        let [r, g, b, a] = develop(index, pixel);
        let behind = PANEL * (1.0 - a.clamp(0.0, 1.0));
        let [r, g, b] = [r, g, b].map(|x| (x + behind).clamp(0.0, 1.0));
        [r, g, b, 1.0]
    };
    let rgba = image.rgba.iter().enumerate().map(seen).collect();
    let seen = Image { width: image.width, height: image.height, rgba };
    let scale = (f64::from(CELL) / f64::from(image.width.max(image.height))).min(1.0);
    let [width, height] =
        [image.width, image.height].map(|side| ((scale * f64::from(side)).round() as u32).max(1));
    cover(&seen, width, height)
}

/// The sheet, with the thumbnail of each scene that was rendered.
pub fn sheet(results: &Results, thumbnails: &[Option<Image>]) -> Image {
    let columns = results.groups().map(|(_, scenes)| scenes.len()).max().unwrap_or(1).min(COLUMNS);
    let width = columns as u32 * (CELL + GAP) + GAP;
    let mut sheet = Image::new(width, 0);
    let mut thumbnails = thumbnails;
    for (group, scenes) in results.groups() {
        let (of_group, others) = thumbnails.split_at(scenes.len());
        thumbnails = others;
        let top = grow(&mut sheet, GAP + LINE + GAP) + GAP;
        line(&mut sheet, &group, [GAP, top], width - 2 * GAP, INK);
        let rule = top + LINE;
        sheet.rgba[(rule * width + GAP) as usize..(rule * width + width - GAP) as usize]
            .fill([RULE, RULE, RULE, 1.0]);
        for (scenes, thumbnails) in scenes.chunks(columns).zip(of_group.chunks(columns)) {
            let heights = thumbnails.iter().flatten().map(|thumbnail| thumbnail.height);
            let height = heights.max().unwrap_or(LINE);
            let top = grow(&mut sheet, height + GAP / 2 + 2 * LINE + GAP);
            for (column, (scene, thumbnail)) in scenes.iter().zip(thumbnails).enumerate() {
                let left = GAP + column as u32 * (CELL + GAP);
                if let Some(thumbnail) = thumbnail {
                    let across = left + (CELL - thumbnail.width) / 2;
                    lay(&mut sheet, thumbnail, [across, top + (height - thumbnail.height) / 2]);
                }
                let below = top + height + GAP / 2;
                line(&mut sheet, &scene.name(), [left, below], CELL, INK);
                line(&mut sheet, &note(scene), [left, below + LINE], CELL, FAINT);
            }
        }
    }
    sheet
}

/// What is said below a name.
fn note(scene: &SceneResults) -> String {
    let Some(drawn) = &scene.drawn else { return scene.verdict.told().to_owned() };
    let time = format!("{:.0} ms", drawn.frame_milliseconds);
    match &drawn.error {
        None => time,
        Some(error) => format!("{time}  RMSE {:.1e}", error.metrics.rmse),
    }
}

/// Makes the sheet higher, and tells where the new part begins.
fn grow(sheet: &mut Image, rows: u32) -> u32 {
    let top = sheet.height;
    sheet.height += rows;
    sheet.rgba.resize(sheet.width as usize * sheet.height as usize, [PAPER, PAPER, PAPER, 1.0]);
    top
}

/// Writes as large as fits into `room` pixels.
fn line(sheet: &mut Image, text: &str, at: [u32; 2], room: u32, ink: f32) {
    let length = text.chars().count() as u32;
    let letters = if length * Letters::Large.side() <= room { Letters::Large } else { Letters::Small };
    let fits: String = text.chars().take((room / letters.side()) as usize).collect();
    letters.write(sheet, &fits, at, ink);
}

fn lay(sheet: &mut Image, picture: &Image, [left, top]: [u32; 2]) {
    for (row, y) in picture.rgba.chunks(picture.width as usize).zip(top..) {
        let start = (y * sheet.width + left) as usize;
        sheet.rgba[start..start + row.len()].copy_from_slice(row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::gallery::results::tests::results;

    #[test]
    fn every_picture_is_on_the_sheet() {
        let mut image = Image::new(760, 400);
        image.rgba.fill([0.5, 0.0, 0.0, 0.5]);
        let exposed = Backdrop { exposure: 1.0, ..Backdrop::colour([0.0, 0.25, 0.0]) };
        let small = thumbnail(&image, &exposed);
        assert_eq!((small.width, small.height), (380, 200));
        assert!(small.rgba.iter().all(|[r, g, ..]| (r - 1.0).abs() < 1e-5 && (g - 0.25).abs() < 1e-5));
        let clear = thumbnail(&image, &Backdrop::default()).rgba[0];
        assert!((clear[1] - 0.5 * PANEL).abs() < 1e-6 && clear[3] == 1.0, "{clear:?}");

        let results = results();
        let tiny = thumbnail(&Image::new(16, 8), &Backdrop::colour([0.0, 0.0, 1.0]));
        assert_eq!((tiny.width, tiny.height), (16, 8));
        let thumbnails = [Some(small.clone()), Some(tiny), Some(small), None];
        let sheet = sheet(&results, &thumbnails);
        assert_eq!(sheet.width, 3 * (CELL + GAP) + GAP);
        assert_eq!(sheet.rgba.len(), sheet.width as usize * sheet.height as usize);
        let count = |is: &dyn Fn(&[f32; 4]) -> bool| sheet.rgba.iter().filter(|pixel| is(pixel)).count();
        assert_eq!(count(&|[r, _, b, _]| *r > 0.9 && *b < 0.1), 2 * 380 * 200);
        assert_eq!(count(&|[r, _, b, _]| *b > 0.9 && *r < 0.1), 16 * 8);
        assert!(count(&|pixel| *pixel == [INK, INK, INK, 1.0]) > 1000, "names");
        assert!(sheet.rgba.iter().all(|pixel| pixel[3] == 1.0));
    }

    #[test]
    fn four_columns_are_as_wide_as_a_sheet_may_be() {
        assert_eq!(COLUMNS as u32 * (CELL + GAP) + GAP, 1600);
    }
}
