//! What reaches a point from a light that casts shadows, as [`scene::shadow`](crate::scene::shadow) defines it.
//!
//! A path runs from the point to the light. A solid on it stops all light; else the optical depths of all
//! tetrahedra on it add up, in any order, each cell by cell of texel centres as the eye's ray is. On a *piece* within a cell
//! `1 - alpha` is a cubic, or a smooth blend of two; its logarithm is integrated by the short rule of `quadrature`, and the piece is
//! halved, graded towards a root of `1 - alpha`, while the nested rule disagrees.
//!
//! # The promise
//! An error `e` of an optical depth `d` is one of `exp(-d) e` of what reaches the point, and that shows in the picture as at most
//! `weight` times as much. So where `allowed` is what the picture's tolerance leaves, divided by that weight, a
//! panel passes with an error of at most `allowed exp(d) / 2 (length / extent of the scene + 1e-3)`, `d` being the depth
//! that was added up before; and where `exp(-d)` is below `allowed`, nothing passes.
//!
//! # Where a wall begins
//! What the eye sees of a wall is a point of its surface, where the cell that is the wall begins. Rounding may put the point a
//! little within: a wall counts from [`THINNEST_WALL`] on. In the same way a solid counts from [`NEAREST_SOLID`] on, and a solid's
//! own triangle does not count.

use glam::DVec3;

use super::Reference;
use super::crossing::Crossing;
use super::hierarchy::Path;
use super::layer::{Layer, Ray, Width};
use super::penumbra::Penumbra;
use super::quadrature::{SHORT_COARSE_WEIGHTS, SHORT_NODES, SHORT_WEIGHTS};
use super::solids::Hit;
use super::umbra::{Beacon, Umbra};
use crate::scene::{Light, LightView, Scene, Source, texel_edges};
use crate::volume::Quantity;

/// The part of a picture's tolerance that errors of panels on the eye's ray may use.
pub const OF_PANELS: f64 = 0.25;

/// The part that errors of optical depths may use.
const OF_DEPTHS: f64 = 0.25;

/// The part that errors of interpolation may use.
const OF_PENUMBRAE: f64 = 0.5;

/// The length of a whole stretch of a [`Penumbra`], in texels of level 0 along the axis on which they are shortest.
const TEXELS_OF_STRETCH: f64 = 4.0;

/// The share of [`OF_DEPTHS`] that every panel may use, however short it is.
const SHARE_OF_EACH: f64 = 1e-3;

/// The width of the narrowest panels, as a part of their piece: what a panel at a root of `1 - alpha` holds is about as much, times
/// the logarithm.
const NARROWEST: f64 = 1e-12;

/// A product of two such is no zero yet.
const LEAST_CLEAR: f64 = 1e-150;

/// Where a path runs less far than this in a wall, in texels, it does not meet it.
const THINNEST_WALL: f64 = 1e-7;

/// A solid that is nearer to a point than this part of the point's distance from the eye does not stand between it and a light.
const NEAREST_SOLID: f64 = 1e-12;

/// In general position to axes and to whatever is built along them.
const ASIDE: DVec3 = DVec3::new(0.618_03, 0.414_21, 0.732_05);

/// The lights of a scene that cast shadows.
pub struct Shadows {
    /// For each light of the scene [`LightView::pixel`].
    pixels: Vec<Option<f64>>,
    /// For each light of the scene.
    beacons: Vec<Beacon>,
    /// How much of an error of what reaches a point from all these lights may be seen, at most.
    weight: f64,
    /// How many lights cast shadows.
    count: usize,
    /// In world units: no straight line in the scene is longer.
    diameter: f64,
    /// In world units: what is interpolated in one go.
    stretch: f64,
}

/// A part of a path between two neighbouring cuts.
#[derive(Clone, Copy)]
struct Piece {
    start: f64,
    length: f64,
}

impl Shadows {
    /// `None` where no light casts shadows. Nothing in the scene is brighter, unlit, than `unlit`.
    pub fn of(scene: &Scene, eye: DVec3, unlit: f64) -> Option<Self> {
        let shading = scene.shading.as_ref()?;
        let extent = scene.extent();
        let pixel = |light: &Light| {
            let first = || LightView::of(light, &extent, shading.shadow_size)[0];
            light.shadow.then(|| first().pixel)
        };
        let pixels: Vec<_> = shading.lights.iter().map(pixel).collect();
        let beacon = |light: &Light| match light.source {
            Source::Directional { towards } => Beacon::Far(towards),
            Source::Point { position, .. } => Beacon::Near(position - eye),
        };
        let beacons = shading.lights.iter().map(beacon).collect();
        let light: DVec3 = shading.lights.iter().filter(|light| light.shadow).map(|light| light.colour).sum();
        let weight = light.max_element() * (shading.diffuse * unlit + shading.specular);
        let count = pixels.iter().flatten().count();
        (count > 0).then(|| {
            let [u, v, w] = texel_edges(&scene.shell, scene.volume.levels[0].size);
            Self {
                pixels,
                beacons,
                weight,
                count,
                diameter: 2.0 * extent.radius,
                stretch: TEXELS_OF_STRETCH * u.min(v).min(w),
            }
        })
    }

    /// The part of light number `light` that reaches a point relative to the eye, where `own` is the solids' triangle that it is
    /// a point of.
    fn reaching(&self, reference: &Reference<'_>, light: usize, point: DVec3, own: Option<usize>) -> f64 {
        if self.is_hidden(reference, light, point, own) {
            0.0
        } else {
            self.transmittance(reference, light, point)
        }
    }

    /// Whether a solid, but for the triangle `own`, stands before the light.
    fn is_hidden(&self, reference: &Reference<'_>, light: usize, point: DVec3, own: Option<usize>) -> bool {
        let (direction, to) = self.way(light, point);
        let from = NEAREST_SOLID * point.length();
        reference.solids.hide(&Path { start: point, direction, from, to, aside: ASIDE }, own)
    }

    /// The unit vector from a point to a light, and the distance between the two.
    fn way(&self, light: usize, point: DVec3) -> (DVec3, f64) {
        match self.beacons[light] {
            Beacon::Far(towards) => (towards, f64::INFINITY),
            Beacon::Near(place) => {
                let way = place - point;
                (way.normalize_or(DVec3::Y), way.length())
            }
        }
    }

    /// What the medium alone lets through.
    fn transmittance(&self, reference: &Reference<'_>, light: usize, point: DVec3) -> f64 {
        let (scene, eye) = (reference.scene, reference.view.camera.eye);
        let Some(pixel) = self.pixels[light] else { return 1.0 };
        let (direction, to) = self.way(light, point);
        let width = match self.beacons[light] {
            Beacon::Far(_) => Width { at_start: 1.0, slope: 0.0 },
            Beacon::Near(_) => Width { at_start: to, slope: -1.0 },
        };
        let path = Path { start: point, direction, from: 0.0, to, aside: ASIDE };
        let allowed = OF_DEPTHS * reference.tolerance / self.weight;
        let detail_per_texel = reference.lod_footprint * pixel;
        let ray = Ray { eye, start: point, direction, width, detail_per_texel };
        let mut depth =
            OpticalDepth { scene, ray, allowed, most: -allowed.ln(), diameter: self.diameter, sum: 0.0 };
        reference.crossings.visit(&path, |crossing| {
            depth.add(crossing.tetrahedron, crossing.enter, crossing.exit);
            depth.is_open()
        });
        if depth.is_open() { (-depth.sum).exp() } else { 0.0 }
    }
}

/// What reaches the points of one ray of the eye.
pub struct ShadowsOnRay<'a> {
    reference: &'a Reference<'a>,
    direction: DVec3,
    /// For each light, in the medium.
    penumbrae: Vec<Penumbra>,
    /// For each light, of solids.
    umbrae: Vec<Umbra>,
    /// Depths where any of these begins or ends, in order.
    edges: Vec<f64>,
    paths: u64,
}

impl<'a> ShadowsOnRay<'a> {
    /// For the ray along `direction`, where `crossings` are in order of entry.
    pub fn new(reference: &'a Reference<'a>, direction: DVec3, crossings: &[Crossing]) -> Self {
        let mut shadows = Self {
            reference,
            direction,
            penumbrae: Vec::new(),
            umbrae: Vec::new(),
            edges: Vec::new(),
            paths: 0,
        };
        let Some(Shadows { pixels, beacons, diameter, stretch, .. }) = &reference.shadows else {
            return shadows;
        };
        let start = crossings.first().map_or(0.0, |first| first.enter);
        let end = crossings.iter().map(|crossing| crossing.exit).fold(start, f64::max);
        for (pixel, &beacon) in pixels.iter().zip(beacons) {
            let is_asked_for = pixel.is_some() && start < end;
            let umbra =
                is_asked_for.then(|| reference.solids.umbra(direction, beacon, [start, end], *diameter));
            shadows.umbrae.push(umbra.unwrap_or(Umbra::Unknown));
            shadows.penumbrae.push(Penumbra::new(start, end, stretch / direction.length()));
        }
        shadows.edges = shadows.umbrae.iter().flat_map(Umbra::edges).copied().collect();
        shadows.edges.sort_unstable_by(f64::total_cmp);
        shadows
    }

    /// The first depth after this one at which the shadow of a solid begins or ends.
    pub fn next_edge(&self, depth: f64) -> f64 {
        let next = self.edges.partition_point(|edge| *edge <= depth);
        self.edges.get(next).copied().unwrap_or(f64::INFINITY)
    }

    /// How many paths to lights were traced.
    pub fn paths(&self) -> u64 {
        self.paths
    }

    /// The part of light number `light` that reaches the point at this depth, to what the tolerance allows where `weight` of an
    /// error of it is seen.
    pub fn interpolated(&mut self, light: usize, depth: f64, weight: f64) -> f64 {
        let Self { reference, direction, penumbrae, umbrae, paths, .. } = self;
        let Some(shadows) = &reference.shadows else { return 1.0 };
        let is_hidden = umbrae[light]
            .holds(depth)
            .unwrap_or_else(|| shadows.is_hidden(reference, light, depth * *direction, None));
        if is_hidden {
            return 0.0;
        }
        let allowed = OF_PENUMBRAE * reference.tolerance / (shadows.count as f64 * weight);
        penumbrae[light].at(depth, allowed, |depth| {
            *paths += 1;
            shadows.transmittance(reference, light, depth * *direction)
        })
    }

    /// The same exactly.
    pub fn traced(&mut self, light: usize, depth: f64) -> f64 {
        self.trace(light, depth * self.direction, None)
    }

    /// The colour of the solid that the ray ends at.
    pub fn colour_of_solid(&mut self, hit: &Hit) -> DVec3 {
        let (reference, direction) = (self.reference, self.direction);
        let reaching = |light, point| self.trace(light, point, Some(hit.triangle));
        reference.solids.colour(reference, direction, hit, reaching)
    }

    fn trace(&mut self, light: usize, point: DVec3, own: Option<usize>) -> f64 {
        self.paths += 1;
        let shadows = self.reference.shadows.as_ref();
        shadows.map_or(1.0, |shadows| shadows.reaching(self.reference, light, point, own))
    }
}

/// Adds up along a path.
struct OpticalDepth<'a> {
    scene: &'a Scene,
    ray: Ray,
    allowed: f64,
    /// Where depth is more, nothing passes.
    most: f64,
    diameter: f64,
    sum: f64,
}

impl OpticalDepth<'_> {
    /// Whether anything passes.
    fn is_open(&self) -> bool {
        self.sum < self.most
    }

    /// Adds what a tetrahedron holds between two places on the path.
    fn add(&mut self, tetrahedron: usize, enter: f64, exit: f64) {
        let detail = self.ray.detail(self.scene, tetrahedron);
        let can_be_wall = self.scene.volume.levels[0].quantity == Quantity::Opacity;
        let mut start = enter;
        while start < exit {
            let end = self.ray.span_end(self.scene, &[detail], start, exit);
            let length = end - start;
            let mut layer: Layer<'_, 2> =
                Layer::new(self.scene, &self.ray, tetrahedron, detail, start, 0.5 * (start + end));
            let mut from = 0.0;
            while from < length {
                let to = layer.piece_end(length);
                if from < to && layer.load(from, to) {
                    if !(can_be_wall && layer.is_wall()) {
                        self.panels(&layer, Piece { start: start + from, length: to - from }, 0.0, 1.0);
                    } else if layer.texels_along(to - from) > THINNEST_WALL {
                        self.sum = f64::INFINITY;
                    }
                    if !self.is_open() {
                        return;
                    }
                }
                layer.pass(to);
                from = from.max(to);
            }
            start = end;
        }
    }

    /// Adds the part `low..high` (of 0..1) of a piece, halving it until it is accurate.
    fn panels(&mut self, layer: &Layer<'_, 2>, piece: Piece, low: f64, high: f64) {
        let quantity = self.scene.volume.levels[0].quantity;
        let width = high - low;
        let length = width * piece.length;
        let scale = length / self.scene.medium.opacity_distance;
        let texels: [_; 7] = std::array::from_fn(|i| {
            let x = low + width * SHORT_NODES[i];
            layer.at(x, piece.start + x * piece.length)
        });
        // Of two nodes at once: logarithms are what this costs.
        let pair = |i: usize| {
            let [[alpha, clear], [other_alpha, other_clear]] = [texels[i], texels[6 - i]];
            match quantity {
                Quantity::Extinction => alpha + other_alpha,
                Quantity::Opacity => -(clear.max(LEAST_CLEAR) * other_clear.max(LEAST_CLEAR)).ln(),
            }
        };
        let mut extinction: [f64; 4] = std::array::from_fn(pair);
        extinction[3] *= 0.5;
        let sum = |weights: &[f64; 4]| -> f64 {
            weights.iter().zip(extinction).map(|(weight, extinction)| weight * extinction).sum()
        };
        let depth = sum(&SHORT_WEIGHTS);
        let error = scale * (depth - sum(&SHORT_COARSE_WEIGHTS)).abs();
        let limit = 0.5 * self.allowed * (length / self.diameter + SHARE_OF_EACH);
        if width > NARROWEST && error > limit && error * (-self.sum).exp() > limit {
            let middle = low + 0.5 * width;
            self.panels(layer, piece, low, middle);
            self.panels(layer, piece, middle, high);
        } else {
            self.sum += scale * depth;
        }
    }
}
