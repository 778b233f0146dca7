//! Sculptures: round parts that melt into one another, as a field that is negative inside.
//!
//! Parts join by the polynomial smooth minimum (I. Quilez, *Smooth minimum*, 2013). The field is a distance near the surface, to
//! first order, which is all that meshing and painting need.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::tetrahedra;
use crate::mesh::model::{Material, Model};
use crate::value::Colour;

/// A round solid.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shape {
    /// From one ball to another.
    Cone { ends: [DVec3; 2], radii: [f64; 2] },
    /// With half axes along X, Y, Z.
    Ellipsoid { centre: DVec3, radii: DVec3 },
    /// A triangle with a thickness.
    Plate { corners: [DVec3; 3], radius: f64 },
    /// A chain's link along X: a ring around an axis (of unit length, across X), pulled apart.
    Link { centre: DVec3, axis: DVec3, straight: f64, ring: f64, radius: f64 },
}

impl Shape {
    /// Negative inside; near the surface a distance, to first order.
    fn field(&self, point: DVec3) -> f64 {
        match *self {
            Self::Cone { ends: [a, b], radii } => {
                let part = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                point.distance(a.lerp(b, part)) - (radii[0] + part * (radii[1] - radii[0]))
            }
            Self::Ellipsoid { centre, radii } => {
                let scaled = (point - centre) / radii;
                let steepness = (scaled / radii).length();
                if steepness > 0.0 {
                    scaled.length() * (scaled.length() - 1.0) / steepness
                } else {
                    -radii.min_element()
                }
            }
            Self::Plate { corners, radius } => point.distance(nearest_in_triangle(corners, point)) - radius,
            Self::Link { centre, axis, straight, ring, radius } => {
                let from = point - centre;
                let along = DVec3::X * from.x.clamp(-straight, straight);
                let within = (from - along).reject_from(axis).length() - ring;
                DVec2::new(within, (from - along).dot(axis)).length() - radius
            }
        }
    }

    /// A box around it.
    fn bounds(&self) -> [DVec3; 2] {
        match *self {
            Self::Cone { ends: [a, b], radii: [m, n] } => [(a - m).min(b - n), (a + m).max(b + n)],
            Self::Ellipsoid { centre, radii } => [centre - radii, centre + radii],
            Self::Plate { corners: [a, b, c], radius } => {
                [a.min(b).min(c) - radius, a.max(b).max(c) + radius]
            }
            Self::Link { centre, straight, ring, radius, .. } => {
                let reach = DVec3::splat(ring + radius) + straight * DVec3::X;
                [centre - reach, centre + reach]
            }
        }
    }
}

/// The nearest point of a triangle: C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5, by edges and plane.
fn nearest_in_triangle([a, b, c]: [DVec3; 3], point: DVec3) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let is_inner = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal) >= 0.0;
    if is_inner(a, b) && is_inner(b, c) && is_inner(c, a) {
        return point - (point - a).project_onto(normal);
    }
    let on_edge = |from: DVec3, to: DVec3| {
        let part = (point - from).dot(to - from) / (to - from).length_squared();
        from.lerp(to, part.clamp(0.0, 1.0))
    };
    let nearer =
        |p: DVec3, q: DVec3| if point.distance_squared(q) < point.distance_squared(p) { q } else { p };
    nearer(nearer(on_edge(a, b), on_edge(b, c)), on_edge(c, a))
}

/// A part of a sculpture.
#[derive(Debug, Clone, Copy)]
struct Part {
    shape: Shape,
    /// A box around it.
    bounds: [DVec3; 2],
    colour: Colour,
    /// Over how many units it melts into the parts before it.
    blend: f64,
    /// Whether it is taken away from them.
    is_carved: bool,
}

/// Parts, joined in order.
#[derive(Debug, Clone)]
pub(crate) struct Sculpture {
    parts: Vec<Part>,
    /// The side of the cubes by which it is meshed.
    step: f64,
    /// How much it is darkened where it sees little of the sky, 0 to 1.
    pub(super) shade: f64,
}

/// What a sculpture is around a point that is near its surface.
pub(crate) struct Place {
    /// Negative inside; near the surface a distance, to first order.
    pub field: f64,
    /// How fast, and where to, that grows.
    pub outward: DVec3,
    /// Linear; without light.
    pub colour: Vec3,
    /// The part of the sky, 0 to 1, that is seen from the surface there.
    pub sky: f64,
}

/// The shades that a colour is painted in.
const SHADES: u32 = 24;

/// How far a point looks for what hides the sky, in steps.
const HORIZON: f64 = 12.0;

impl Sculpture {
    /// Nothing yet, to be meshed by cubes with this side.
    pub fn new(step: f64) -> Self {
        Self { parts: Vec::new(), step, shade: 0.75 }
    }

    /// Adds a part in the sRGB colour `0xrrggbb` that melts over `blend` units into what is there.
    pub(super) fn add(&mut self, shape: Shape, colour: u32, blend: f64) {
        self.join(shape, colour, blend, false);
    }

    /// Takes a part away from what is there; what is laid bare has its colour.
    pub(super) fn carve(&mut self, shape: Shape, colour: u32, blend: f64) {
        self.join(shape, colour, blend, true);
    }

    fn join(&mut self, shape: Shape, colour: u32, blend: f64, is_carved: bool) {
        let (bounds, colour) = (shape.bounds(), Colour::srgb(colour));
        self.parts.push(Part { shape, bounds, colour, blend, is_carved });
    }

    /// Adds a part and its mirror image across X.
    pub(super) fn add_both(&mut self, shape: Shape, colour: u32, blend: f64) {
        self.add(shape, colour, blend);
        self.add(mirrored(shape), colour, blend);
    }

    /// Takes a part and its mirror image across X away.
    pub(super) fn carve_both(&mut self, shape: Shape, colour: u32, blend: f64) {
        self.carve(shape, colour, blend);
        self.carve(mirrored(shape), colour, blend);
    }

    /// A tube through `points`, each with its radius, rounded by a Catmull-Rom spline.
    pub fn tube(&mut self, points: &[(DVec3, f64)], colour: u32, blend: f64) {
        for ends in spline(points).windows(2) {
            self.add(
                Shape::Cone { ends: [ends[0].0, ends[1].0], radii: [ends[0].1, ends[1].1] },
                colour,
                blend,
            );
        }
    }

    /// Negative inside; near the surface a distance, to first order.
    pub(crate) fn field(&self, point: DVec3) -> f64 {
        self.parts.iter().fold(f64::INFINITY, |field, part| {
            // What is farther than this changes nothing.
            let reach = part.blend + if part.is_carved { -field } else { field };
            let [low, high] = part.bounds;
            if point.distance_squared(point.clamp(low, high)) > reach.max(0.0).powi(2) {
                return field;
            }
            let own = part.shape.field(point);
            if part.is_carved {
                -smooth_minimum(-field, own, part.blend)
            } else {
                smooth_minimum(field, own, part.blend)
            }
        })
    }

    /// The colour of the part whose surface is nearest, those that cover others first.
    fn colour(&self, point: DVec3) -> Vec3 {
        let distance = |part: &Part| part.shape.field(point).abs();
        let nearest = self.parts.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map_or(Vec3::ONE, |part| part.colour.0)
    }

    /// The part of the sky, 0 to 1, that is seen from a point of the surface: the field is as large as a distance from the surface
    /// where nothing else is near (A. Evans, *Fast Approximations for Global Illumination on Dynamic Scenes*, 2006).
    fn sky(&self, point: DVec3, normal: DVec3) -> f64 {
        let open: f64 = [0.125, 0.25, 0.5, 1.0]
            .map(|part| {
                let reach = part * self.horizon();
                (self.field(point + reach * normal) / reach).clamp(0.0, 1.0)
            })
            .iter()
            .sum();
        0.25 * open * (0.65 + 0.35 * normal.y)
    }

    /// The parts that matter within `reach` of a point: there, and wherever the field is at most `reach`, it is the same.
    pub(crate) fn around(&self, centre: DVec3, reach: f64) -> Self {
        let is_near = |part: &&Part| {
            let [low, high] = part.bounds;
            centre.distance_squared(centre.clamp(low, high)) <= (2.0 * reach + part.blend).powi(2)
        };
        Self { parts: self.parts.iter().filter(is_near).copied().collect(), ..*self }
    }

    /// Whether there is nothing.
    pub(crate) fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// How far from a point [`Sculpture::place`] looks.
    pub(crate) fn horizon(&self) -> f64 {
        HORIZON * self.step
    }

    /// All that is known of the surroundings of a point near the surface.
    pub(crate) fn place(&self, point: DVec3) -> Place {
        let field = self.field(point);
        let half = 0.25 * self.step;
        let rise = |axis: DVec3| self.field(point + half * axis) - self.field(point - half * axis);
        let outward = DVec3::new(rise(DVec3::X), rise(DVec3::Y), rise(DVec3::Z)) / (2.0 * half);
        let normal = outward.normalize_or_zero();
        let surface = point - field * normal;
        Place { field, outward, colour: self.colour(surface), sky: self.sky(surface, normal) }
    }

    /// A box around it; nothing is below the ground.
    pub(crate) fn bounds(&self) -> [DVec3; 2] {
        let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] =
            self.parts.iter().filter(|part| !part.is_carved).fold(start, |[low, high], part| {
                let bounds = part.shape.bounds();
                [low.min(bounds[0] - part.blend), high.max(bounds[1] + part.blend)]
            });
        [low.with_y(low.y.max(0.0)), high]
    }

    /// The mesh, painted.
    pub fn model(&self) -> Model {
        let [low, high] = self.bounds();
        let room = 2.0 * self.step;
        let ground = |point: DVec3| self.field(point).max(-point.y);
        let (positions, triangles) = tetrahedra::mesh(ground, [low - room, high + room], self.step);

        let colours: Vec<Vec3> = triangles
            .par_iter()
            .map(|ids| {
                let [a, b, c] = ids.map(|id| positions[id as usize]);
                let middle = (a + b + c) / 3.0;
                let sky = self.sky(middle, (b - a).cross(c - a).normalize_or_zero());
                let light = 1.0 - self.shade * (1.0 - sky);
                let shade = (light * f64::from(SHADES)).round() / f64::from(SHADES);
                self.colour(middle) * shade as f32
            })
            .collect();
        let mut model = Model {
            path: "figure".into(),
            uvs: vec![[DVec2::ZERO; 3]; triangles.len()],
            triangle_materials: Vec::with_capacity(triangles.len()),
            positions,
            triangles,
            materials: Vec::new(),
        };
        let mut known = HashMap::new();
        for colour in colours {
            let material = *known.entry(colour.to_array().map(f32::to_bits)).or_insert_with(|| {
                model.materials.push(Material { colour, texture: None });
                model.materials.len() as u32 - 1
            });
            model.triangle_materials.push(material);
        }
        model
    }
}

/// The lesser of two, rounded off where they differ by less than `blend`.
fn smooth_minimum(a: f64, b: f64, blend: f64) -> f64 {
    let near = (blend - (a - b).abs()).max(0.0);
    let round = if near > 0.0 { near * near / (4.0 * blend) } else { 0.0 };
    a.min(b) - round
}

/// The image of a shape in the plane X = 0.
fn mirrored(shape: Shape) -> Shape {
    let turn = |p: DVec3| p.with_x(-p.x);
    match shape {
        Shape::Cone { ends, radii } => Shape::Cone { ends: ends.map(turn), radii },
        Shape::Ellipsoid { centre, radii } => Shape::Ellipsoid { centre: turn(centre), radii },
        Shape::Plate { corners, radius } => Shape::Plate { corners: corners.map(turn), radius },
        Shape::Link { centre, axis, straight, ring, radius } => {
            Shape::Link { centre: turn(centre), axis: turn(axis), straight, ring, radius }
        }
    }
}

/// A Catmull-Rom spline through points and radii, six pieces between two.
pub(super) fn spline(points: &[(DVec3, f64)]) -> Vec<(DVec3, f64)> {
    const PIECES: usize = 6;
    let at = |index: isize| points[index.clamp(0, points.len() as isize - 1) as usize];
    let mut fine = Vec::new();
    for k in 0..points.len() as isize - 1 {
        let near = [at(k - 1), at(k), at(k + 1), at(k + 2)];
        for piece in 0..PIECES {
            let t = piece as f64 / PIECES as f64;
            let weights = [
                0.5 * (-t + 2.0 * t * t - t * t * t),
                0.5 * (2.0 - 5.0 * t * t + 3.0 * t * t * t),
                0.5 * (t + 4.0 * t * t - 3.0 * t * t * t),
                0.5 * (-t * t + t * t * t),
            ];
            let position = near.iter().zip(weights).map(|((p, _), weight)| weight * *p).sum();
            let radius = near[1].1 + t * (near[2].1 - near[1].1);
            fine.push((position, radius));
        }
    }
    fine.extend(points.last());
    fine
}
