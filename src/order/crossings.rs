//! Where the rays of a picture enter the shell and leave it, from the A-buffer: all that a
//! walk along them (M. Garrity, "Raytracing irregular volume data", 1990) needs to know.

use super::abuffer::ABuffer;
use super::relations::FaceTable;
use crate::scene::View;
use crate::shell::Shell;

/// In [`Crossings::places`]: the ray leaves the shell here; else it enters it.
pub const LEAVES: u32 = 1 << 31;

/// In [`Crossings::first`]: the ray of this pixel is in two parts of the shell at once.
pub const INTRICATE: u32 = 1 << 31;

/// In [`Crossings::first`]: the ray of this pixel begins in the shell.
pub const BEGUN: u32 = 1 << 30;

/// Where the rays of all pixels enter the shell and leave it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Crossings {
    /// For each pixel, row by row from the top, its first place; and after the last pixel, the number of all.
    pub first: Vec<u32>,
    /// Places of one pixel after another, front to back: four times a tetrahedron, and the number of its face.
    pub places: Vec<u32>,
    /// Pixels whose ray begins in the shell.
    pub begun_inside: u64,
    /// Pixels whose ray is in two parts of the shell at once.
    pub overlapping: u64,
}

impl Crossings {
    /// Of the pixel centres of `view`; `faces` are those of the shell's topology. Depends on nothing else, the number of threads
    /// included.
    pub fn new(faces: &FaceTable, shell: &Shell, view: &View) -> Self {
        let boundary = faces.boundary(&shell.determinants, &shell.vertices, view.camera.eye);
        let abuffer = ABuffer::new(&shell.vertices, &boundary, view);
        let bands = abuffer.map_bands(
            || (),
            |(), band| {
                let mut found = Self::default();
                band.each_pixel(|crossings| {
                    let mut first = found.places.len() as u32;
                    let leaves = crossings.iter().filter(|crossing| crossing.leaves()).count();
                    let mut open = (2 * leaves).saturating_sub(crossings.len());
                    let begins_inside = open > 0;
                    let mut overlaps = open > 1;
                    for crossing in crossings {
                        overlaps |= !crossing.leaves() && open > 0;
                        open = if crossing.leaves() { open.saturating_sub(1) } else { open + 1 };
                        found.places.push(crossing.place() | if crossing.leaves() { LEAVES } else { 0 });
                    }
                    first |= if begins_inside { BEGUN } else { 0 };
                    found.first.push(if overlaps { first | INTRICATE } else { first });
                    found.begun_inside += u64::from(begins_inside);
                    found.overlapping += u64::from(overlaps);
                });
                found
            },
        );
        let mut all = Self::default();
        for band in bands {
            let before = all.places.len() as u32;
            all.first.extend(band.first.iter().map(|first| before + first));
            all.places.extend(band.places);
            all.begun_inside += band.begun_inside;
            all.overlapping += band.overlapping;
        }
        all.first.push(all.places.len() as u32);
        all
    }
}
