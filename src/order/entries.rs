//! Where the rays of a picture enter the shell, from the [`abuffer`](super::abuffer): all that a walk along them needs to know.

use super::abuffer::ABuffer;
use super::relations::FaceTable;
use crate::scene::View;
use crate::shell::Shell;

/// In [`Entries::places`]: the ray leaves the shell here, and may have begun in it.
pub const LEAVES: u32 = 1 << 31;

/// Where the rays of all pixels enter the shell.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Entries {
    /// For each pixel, row by row from the top, its first place; and after the last pixel, the number of all.
    pub first: Vec<u32>,
    /// Places of one pixel after another, front to back: four times a tetrahedron, and the number of its face.
    pub places: Vec<u32>,
    /// Pixels whose ray begins in the shell.
    pub begun_inside: u64,
    /// Pixels whose ray is in two parts of the shell at once.
    pub overlapping: u64,
}

impl Entries {
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
                    found.first.push(found.places.len() as u32);
                    let leaves = crossings.iter().filter(|crossing| crossing.leaves()).count();
                    let begins_inside = 2 * leaves > crossings.len();
                    let mut open = (2 * leaves).saturating_sub(crossings.len());
                    let mut overlaps = false;
                    for crossing in crossings {
                        if crossing.leaves() {
                            open = open.saturating_sub(1);
                        } else {
                            open += 1;
                        }
                        overlaps |= open > 1;
                        match (crossing.leaves(), begins_inside) {
                            (false, _) => found.places.push(crossing.place()),
                            (true, true) => found.places.push(crossing.place() | LEAVES),
                            (true, false) => {}
                        }
                    }
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
