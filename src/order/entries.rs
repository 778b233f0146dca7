//! Where the rays of a picture enter the shell, from the [`abuffer`](super::abuffer): all that a walk along them needs to know.

use super::abuffer::ABuffer;
use super::relations::FaceTable;
use crate::scene::View;
use crate::shell::Shell;

/// In [`Entries::places`]: the ray leaves the shell here, and may have begun in it.
pub const LEAVES: u32 = 1 << 31;

/// In [`Entries::first`]: the ray of this pixel is in two parts of the shell at once.
pub const INTRICATE: u32 = 1 << 31;

/// Where the rays of all pixels enter the shell.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Entries {
    /// For each pixel, row by row from the top, its first place; and after the last pixel, the number of all.
    pub first: Vec<u32>,
    /// Places of one pixel after another: four times a tetrahedron, and the number of its face. First those where it leaves what it may
    /// have begun in, then those where it enters, front to back.
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
                    let first = found.places.len() as u32;
                    let leaves = crossings.iter().filter(|crossing| crossing.leaves());
                    let mut open = (2 * leaves.clone().count()).saturating_sub(crossings.len());
                    let begins_inside = open > 0;
                    let mut overlaps = open > 1;
                    for crossing in crossings {
                        overlaps |= !crossing.leaves() && open > 0;
                        open = if crossing.leaves() { open.saturating_sub(1) } else { open + 1 };
                    }
                    if begins_inside {
                        // Where parts overlap, any of them may be the one that it leaves here.
                        let listed = if overlaps { crossings.len() } else { 1 };
                        found.places.extend(leaves.take(listed).map(|crossing| crossing.place() | LEAVES));
                    }
                    let entered = crossings.iter().filter(|crossing| !crossing.leaves());
                    found.places.extend(entered.map(|crossing| crossing.place()));
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
