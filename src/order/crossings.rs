//! Where the rays of a picture enter the shell and leave it, from the A-buffer: all that a
//! walk along them (M. Garrity, "Raytracing irregular volume data", 1990) needs to know.

use glam::DVec3;
use rayon::prelude::*;

use super::abuffer::{ABuffer, Crossing, Raster};
use super::relations::FaceTable;
use crate::scene::{LightView, View};
use crate::shell::Shell;

/// In [`Crossings::places`]: the ray leaves the shell here; else it enters it.
pub const LEAVES: u32 = 1 << 31;

/// In the first number of [`Crossings::of_pixels`]: the ray is in two parts of the shell at once.
pub const INTRICATE: u32 = 1 << 31;

/// In the first number of [`Crossings::of_pixels`]: the ray begins in the shell.
pub const BEGUN: u32 = 1 << 30;

/// Where the rays of all pixels enter the shell and leave it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Crossings {
    /// For each pixel, row by row from the top, the range of its places: from the first number to before the second. Pixels beside one
    /// another whose rays cross the same have one range.
    pub of_pixels: Vec<[u32; 2]>,
    /// Front to back, in each range: four times a tetrahedron, and the number of its face.
    pub places: Vec<u32>,
    /// How often the rays of all pixels cross the boundary.
    pub count: u64,
    /// Pixels whose ray begins in the shell.
    pub begun_inside: u64,
    /// Pixels whose ray is in two parts of the shell at once.
    pub overlapping: u64,
}

impl Crossings {
    /// Of the pixel centres of `view`, in the memory of `spare`; `faces` are those of the shell's topology. Depends on nothing else,
    /// the number of threads included.
    pub fn new(faces: &FaceTable, shell: &Shell, view: &View, spare: Option<Self>) -> Self {
        let boundary = faces.boundary(&shell.determinants, &shell.vertices, view.camera.eye);
        Self::of(&ABuffer::of_view(&shell.vertices, &boundary, view), spare.unwrap_or_default())
    }

    /// The same of the picture of a light, `side` pixels a side. Parallel rays are those of an eye that a projective map has brought in
    /// from infinity: it takes planes to planes, and keeps what is in front of what.
    pub fn of_light(faces: &FaceTable, shell: &Shell, light: &LightView, side: u32) -> Self {
        let from_light = |&vertex: &DVec3| {
            let DVec3 { x: right, y: up, z: depth } = light.place(vertex);
            if light.is_parallel {
                // The inverse of the new depth falls with the depth, and is positive: depths are 0 to 1.
                DVec3::new(right, -up, 1.0) / (2.0 - depth)
            } else {
                DVec3::new(right, -up, depth)
            }
        };
        let vertices: Vec<DVec3> = shell.vertices.par_iter().with_min_len(1024).map(from_light).collect();
        let boundary = faces.boundary(&shell.determinants, &vertices, DVec3::ZERO);
        let raster = Raster { width: side as usize, height: side as usize, pixel: light.pixel_of_far() };
        Self::of(&ABuffer::new(&vertices, &boundary, raster), Self::default())
    }

    fn of(abuffer: &ABuffer, spare: Self) -> Self {
        let Self { mut of_pixels, mut places, .. } = spare;
        of_pixels.resize(abuffer.pixels(), [0; 2]);
        places.clear();
        let pixels = abuffer.pixels_of_band();
        let bands = abuffer.map_bands(
            of_pixels.chunks_mut(pixels).collect(),
            || (),
            |(), band, of_pixels| {
                let mut found = BandCrossings { of_pixels, ..BandCrossings::default() };
                band.each_run(|pixels, crossings| found.add(pixels, crossings));
                found
            },
        );
        let sum = |of: fn(&BandCrossings<'_>) -> u64| bands.iter().map(of).sum();
        let [count, begun_inside, overlapping] =
            [sum(|band| band.count), sum(|band| band.begun_inside), sum(|band| band.overlapping)];
        let mut before = Vec::with_capacity(bands.len());
        for band in bands {
            before.push(places.len() as u32);
            places.extend(band.places);
        }
        let ranges = of_pixels.par_chunks_mut(pixels).zip(before);
        ranges
            .for_each(|(ranges, before)| ranges.as_flattened_mut().iter_mut().for_each(|end| *end += before));
        Self { of_pixels, places, count, begun_inside, overlapping }
    }

    /// Whether a pixel's ray crosses the boundary, by its range.
    pub fn are_some([first, last]: &[u32; 2]) -> bool {
        first & !(BEGUN | INTRICATE) < *last
    }
}

/// What is found in one band of rows.
#[derive(Default)]
struct BandCrossings<'a> {
    /// Of the pixels that are not done; `places` count from the band's first.
    of_pixels: &'a mut [[u32; 2]],
    places: Vec<u32>,
    count: u64,
    begun_inside: u64,
    overlapping: u64,
}

impl BandCrossings<'_> {
    /// Adds pixels beside one another whose rays cross the same.
    fn add(&mut self, pixels: usize, crossings: &[Crossing]) {
        let leaves = crossings.iter().filter(|crossing| crossing.leaves()).count();
        let mut open = (2 * leaves).saturating_sub(crossings.len());
        let begins_inside = open > 0;
        let mut overlaps = open > 1;
        let first = self.places.len() as u32;
        for crossing in crossings {
            overlaps |= !crossing.leaves() && open > 0;
            open = if crossing.leaves() { open.saturating_sub(1) } else { open + 1 };
            self.places.push(crossing.place() | if crossing.leaves() { LEAVES } else { 0 });
        }
        let flags = if begins_inside { BEGUN } else { 0 } | if overlaps { INTRICATE } else { 0 };
        let range = [first | flags, self.places.len() as u32];
        let (these, others) = std::mem::take(&mut self.of_pixels).split_at_mut(pixels);
        these.fill(range);
        self.of_pixels = others;
        let pixels = pixels as u64;
        self.count += pixels * crossings.len() as u64;
        self.begun_inside += if begins_inside { pixels } else { 0 };
        self.overlapping += if overlaps { pixels } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Generator, Torus};
    use crate::scene::{Extent, Light, Source};
    use crate::shell::{EXTERIOR, ShellOptions};

    /// Where a ray crosses outer faces, each tried by itself.
    fn met(shell: &Shell, origin: DVec3, ray: DVec3) -> Vec<u32> {
        let mut met = Vec::new();
        for (t, neighbours) in shell.topology.neighbours.iter().enumerate() {
            for k in (0..4).filter(|&k| neighbours[k] == EXTERIOR) {
                let at = |id: u32| shell.vertices[id as usize];
                let [a, b, c] = shell.face(t, k).map(at);
                let inner = at(shell.topology.tetrahedra[t][k]);
                let normal = (b - a).cross(c - a);
                let depth = normal.dot(a - origin) / normal.dot(ray);
                let point = origin + depth * ray;
                let is_within = [[a, b], [b, c], [c, a]]
                    .iter()
                    .all(|[from, to]| (to - from).cross(point - from).dot(normal) > 0.0);
                if is_within && depth > 0.0 {
                    let leaves = normal.dot(ray) * normal.dot(inner - a) < 0.0;
                    met.push((depth, (4 * t + k) as u32 | if leaves { LEAVES } else { 0 }));
                }
            }
        }
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        met.into_iter().map(|(_, place)| place).collect()
    }

    #[test]
    fn rays_of_lights_cross_what_they_meet() {
        const SIDE: u32 = 24;
        let mesh = Generator::Torus(Torus { segments: 9, rings: 7, ..Torus::default() }).build().unwrap();
        let shell = Shell::build(&mesh, &ShellOptions::new(0.2)).unwrap();
        let faces = FaceTable::new(&shell.topology);
        let lamp = |position| Source::Point { position, falloff: None };
        let sources = [
            Source::Directional { towards: DVec3::new(0.3, 0.9, 0.5).normalize() },
            Source::Directional { towards: DVec3::new(-0.9, 0.1, 0.2).normalize() },
            lamp(DVec3::new(0.3, 4.0, 1.7)),
            lamp(DVec3::new(0.81, 0.07, 0.62)),
        ];
        let extent = Extent::of(shell.vertices.to_vec());
        let mut crossed = 0;
        for source in sources {
            let light = Light { source, colour: DVec3::ONE, shadow: true };
            for view in LightView::of(&light, &extent, SIDE) {
                let crossings = Crossings::of_light(&faces, &shell, &view, SIDE);
                assert_eq!(crossings.of_pixels.len(), (SIDE * SIDE) as usize);
                let pixels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| [x, y]));
                for ([first, last], pixel) in crossings.of_pixels.iter().zip(pixels) {
                    let [x, y] =
                        pixel.map(|pixel| (f64::from(pixel) + 0.5 - 0.5 * f64::from(SIDE)) * view.pixel);
                    let beside = x * view.frame.right - y * view.frame.up;
                    let (origin, ray) = match view.is_parallel {
                        true => (view.origin + beside, view.frame.forward),
                        false => (view.origin, view.frame.forward + beside),
                    };
                    let met = met(&shell, origin, ray);
                    let range = (first & !(BEGUN | INTRICATE)) as usize..*last as usize;
                    assert_eq!(crossings.places[range], met, "{source:?}, pixel {pixel:?}");
                    let leaves = met.iter().filter(|place| **place & LEAVES != 0).count();
                    assert_eq!(first & BEGUN != 0, 2 * leaves > met.len(), "{source:?}, pixel {pixel:?}");
                    crossed += met.len();
                }
            }
        }
        assert!(crossed > 2000, "{crossed}");
    }
}
